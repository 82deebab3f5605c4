//! Mean and noise per taxel over a window of scans of whole counts: exact sums, two additions a taxel and scan.

use taxel_skin::CountRange;

use crate::baseline::TaxelBaseline;
use crate::scan::Scan;

/// Sums of the sound counts of each taxel. 64 bits hold four billion scans.
#[derive(Clone, Debug)]
pub struct CountSums {
    scans: u32,
    taxels: Vec<Sums>,
    range: CountRange,
}

/// In how many scans a taxel was sound, and its counts and their squares then.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    sound: u32,
    counts: u64,
    squares: u64,
}

impl Sums {
    fn push(&mut self, count: u32, is_sound: bool) {
        let (one, count) = (u32::from(is_sound), count * u32::from(is_sound));
        self.sound += one;
        self.counts += u64::from(count);
        self.squares += u64::from(count) * u64::from(count);
    }
}

impl CountSums {
    /// Sums of so many taxels over no scan yet.
    pub fn new(taxels: usize) -> Self {
        Self { scans: 0, taxels: vec![Sums::default(); taxels], range: CountRange::BYTE }
    }

    /// Begins anew.
    pub fn restart(&mut self) {
        self.scans = 0;
        self.taxels.fill(Sums::default());
    }

    /// Takes a scan.
    pub fn push(&mut self, scan: &Scan<'_>) {
        self.scans = self.scans.saturating_add(1);
        self.range = scan.counts.range();
        let taxels = self.taxels.iter_mut().zip(scan.sound).zip(scan.counts.all());
        taxels.for_each(|((sums, &sound), &count)| sums.push(count.into(), sound));
    }

    /// Scans taken.
    pub fn scans(&self) -> u64 {
        u64::from(self.scans)
    }

    /// Mean and noise per taxel in units; NaN where a taxel was sound in less than half of the scans.
    pub fn baseline(&self) -> Vec<TaxelBaseline> {
        let per_unit = self.range.per_unit();
        let of = |&Sums { sound, counts, squares }: &Sums| {
            if sound == 0 || 2 * sound < self.scans {
                return TaxelBaseline::UNKNOWN;
            }
            // n^2 times the variance, a whole number: exactly zero for a taxel that always read the same.
            let spread = u128::from(sound) * u128::from(squares) - u128::from(counts) * u128::from(counts);
            let n = f64::from(sound);
            let noise = if sound > 1 { (spread as f64 / (n * (n - 1.0))).sqrt() / per_unit } else { 0.0 };
            TaxelBaseline { mean: counts as f64 / n / per_unit, noise }
        };
        self.taxels.iter().map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::counts::Counts;
    use crate::zero::rest::statistics::RestStatistics;
    use proptest::prelude::*;
    use taxel_skin::Time;

    fn scan<'a>(counts: impl Into<Counts<'a>>, sound: &'a [bool]) -> Scan<'a> {
        let (time, whole, soundness) = (Time::default(), true, 0);
        Scan { time, whole, counts: counts.into(), pads: &[], silent: &[], sound, soundness, jumps: &[] }
    }

    proptest! {
        #[test]
        fn mean_and_noise_are_those_of_the_running_statistics(
            scans in proptest::collection::vec(prop::array::uniform3((0..=255_u16, prop::bool::weighted(0.7))), 1..60),
            fine in 0..256_u16
        ) {
            let range = CountRange::to(u16::MAX).unwrap();
            let (mut sums, mut wide, mut running) = (CountSums::new(3), CountSums::new(3), RestStatistics::new(3));
            for counts in &scans {
                let (counts, sound) = (counts.map(|input| input.0), counts.map(|input| input.1));
                sums.push(&scan(&counts, &sound));
                running.push(scan(&counts, &sound).sound_counts());
                let counts = counts.map(|count| 256 * count + fine);
                wide.push(&scan(Counts::new(&counts, range), &sound));
            }
            prop_assert_eq!((sums.scans(), wide.scans()), (running.count(), running.count()));
            let fine = f64::from(fine) / 256.0;
            for ((one, wide), other) in sums.baseline().iter().zip(wide.baseline()).zip(running.baseline()) {
                prop_assert_eq!((one.mean.is_nan(), wide.mean.is_nan()), (other.mean.is_nan(), other.mean.is_nan()));
                prop_assert!(one.mean.is_nan() || (one.mean - other.mean).abs() < 1e-9, "{one:?} {other:?}");
                prop_assert!(one.mean.is_nan() || (one.noise - other.noise).abs() < 1e-9, "{one:?} {other:?}");
                prop_assert!(one.mean.is_nan() || (wide.mean - other.mean - fine).abs() < 1e-9, "{wide:?} {other:?}");
                prop_assert!(one.mean.is_nan() || (wide.noise - other.noise).abs() < 1e-9, "{wide:?} {other:?}");
                prop_assert_eq!([one.noise == 0.0, wide.noise == 0.0], [other.noise == 0.0; 2]);
            }
        }
    }
}
