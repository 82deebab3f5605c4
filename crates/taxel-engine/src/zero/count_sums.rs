//! Mean and noise per taxel over a window of scans of whole counts: exact sums, two additions a taxel and scan.

use crate::baseline::TaxelBaseline;
use crate::scan::Scan;

/// Scans that the sums can take: 2^16 squares of a count fill 32 bits.
const SCANS_MAX: u32 = 1 << 16;

/// Sums of the sound counts of each taxel.
#[derive(Clone, Debug)]
pub struct CountSums {
    scans: u32,
    /// In how many scans each taxel was sound.
    sound: Vec<u32>,
    counts: Vec<u32>,
    squares: Vec<u32>,
}

impl CountSums {
    /// Sums of so many taxels over no scan yet.
    #[must_use]
    pub fn new(taxels: usize) -> Self {
        Self { scans: 0, sound: vec![0; taxels], counts: vec![0; taxels], squares: vec![0; taxels] }
    }

    /// Begins anew.
    pub fn restart(&mut self) {
        self.scans = 0;
        for sums in [&mut self.sound, &mut self.counts, &mut self.squares] {
            sums.fill(0);
        }
    }

    /// Takes a scan; begins anew before the sums could overflow.
    pub fn push(&mut self, scan: &Scan<'_>) {
        if self.scans >= SCANS_MAX {
            self.restart();
        }
        self.scans += 1;
        let sums = self.sound.iter_mut().zip(&mut self.counts).zip(&mut self.squares);
        for (((sound, counts), squares), (&count, &is_sound)) in sums.zip(scan.counts.iter().zip(scan.sound)) {
            let (one, count) = (u32::from(is_sound), u32::from(count) * u32::from(is_sound));
            *sound += one;
            *counts += count;
            *squares += count * count;
        }
    }

    /// Scans taken.
    #[must_use]
    pub fn scans(&self) -> u64 {
        u64::from(self.scans)
    }

    /// Mean and noise per taxel; NaN where a taxel was sound in less than half of the scans.
    #[must_use]
    pub fn baseline(&self) -> Vec<TaxelBaseline> {
        let of = |((&sound, &counts), &squares): ((&u32, &u32), &u32)| {
            if sound == 0 || 2 * sound < self.scans {
                return TaxelBaseline::UNKNOWN;
            }
            // n^2 times the variance, a whole number: exactly zero for a taxel that always read the same.
            let spread = u64::from(sound) * u64::from(squares) - u64::from(counts) * u64::from(counts);
            let n = f64::from(sound);
            TaxelBaseline {
                mean: f64::from(counts) / n,
                noise: if sound > 1 { (spread as f64 / (n * (n - 1.0))).sqrt() } else { 0.0 },
            }
        };
        self.sound.iter().zip(&self.counts).zip(&self.squares).map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::zero::rest::statistics::RestStatistics;
    use proptest::prelude::*;
    use taxel_skin::Time;

    proptest! {
        #[test]
        fn mean_and_noise_are_those_of_the_running_statistics(
            scans in proptest::collection::vec(prop::array::uniform3((any::<u8>(), prop::bool::weighted(0.7))), 1..60)
        ) {
            let (mut sums, mut running) = (CountSums::new(3), RestStatistics::new(3));
            for scan in &scans {
                let (counts, sound) = (scan.map(|input| input.0), scan.map(|input| input.1));
                let (time, whole, soundness) = (Time::default(), true, 0);
                let scan = Scan { time, whole, counts: &counts, pads: &[], silent: &[], sound: &sound, soundness };
                sums.push(&scan);
                running.push(scan.sound_counts());
            }
            prop_assert_eq!(sums.scans(), running.count());
            for (one, other) in sums.baseline().iter().zip(running.baseline()) {
                prop_assert_eq!(one.mean.is_nan(), other.mean.is_nan());
                prop_assert!(one.mean.is_nan() || (one.mean - other.mean).abs() < 1e-9, "{one:?} {other:?}");
                prop_assert!(one.mean.is_nan() || (one.noise - other.noise).abs() < 1e-9, "{one:?} {other:?}");
                prop_assert_eq!(one.noise == 0.0, other.noise == 0.0);
            }
        }
    }
}
