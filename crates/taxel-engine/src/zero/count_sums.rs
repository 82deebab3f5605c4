//! Mean and noise per taxel over a window of scans of whole counts: exact sums, two additions a taxel and scan.

use taxel_skin::CountRange;

use crate::baseline::TaxelBaseline;
use crate::counts::Counts;
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
    /// Sums of counts and of squares that 32 bits do not hold; empty until wide counts come.
    wide: Vec<[u64; 2]>,
    /// The range of the wide counts.
    range: CountRange,
}

impl CountSums {
    /// Sums of so many taxels over no scan yet.
    #[must_use]
    pub fn new(taxels: usize) -> Self {
        Self {
            scans: 0,
            sound: vec![0; taxels],
            counts: vec![0; taxels],
            squares: vec![0; taxels],
            wide: Vec::new(),
            range: CountRange::BYTE,
        }
    }

    /// Begins anew.
    pub fn restart(&mut self) {
        self.scans = 0;
        for sums in [&mut self.sound, &mut self.counts, &mut self.squares] {
            sums.fill(0);
        }
        self.wide.fill([0; 2]);
    }

    /// Takes a scan; begins anew before the sums could overflow.
    pub fn push(&mut self, scan: &Scan<'_>) {
        if self.scans >= SCANS_MAX {
            self.restart();
        }
        self.scans += 1;
        let bytes = match scan.counts {
            Counts::Bytes(bytes) => bytes,
            Counts::Words(words, range) => return self.push_wide(words, range, scan.sound),
        };
        let sums = self.sound.iter_mut().zip(&mut self.counts).zip(&mut self.squares);
        for (((sound, counts), squares), (&count, &is_sound)) in sums.zip(bytes.iter().zip(scan.sound)) {
            let (one, count) = (u32::from(is_sound), u32::from(count) * u32::from(is_sound));
            *sound += one;
            *counts += count;
            *squares += count * count;
        }
    }

    fn push_wide(&mut self, words: &[u16], range: CountRange, sound: &[bool]) {
        self.range = range;
        self.wide.resize(self.sound.len(), [0; 2]);
        for ((seen, sums), (&count, &is_sound)) in
            self.sound.iter_mut().zip(&mut self.wide).zip(words.iter().zip(sound))
        {
            let (one, count) = (u32::from(is_sound), u64::from(count) * u64::from(is_sound));
            *seen += one;
            sums[0] += count;
            sums[1] += count * count;
        }
    }

    /// Scans taken.
    #[must_use]
    pub fn scans(&self) -> u64 {
        u64::from(self.scans)
    }

    /// Mean and noise per taxel in units; NaN where a taxel was sound in less than half of the scans.
    #[must_use]
    pub fn baseline(&self) -> Vec<TaxelBaseline> {
        if !self.wide.is_empty() {
            let sums = self.wide.iter().map(|sums| sums.map(u128::from));
            return self.sound.iter().zip(sums).map(|(&sound, sums)| self.of_sums(sound, sums)).collect();
        }
        let sums = self.counts.iter().zip(&self.squares).map(|(&counts, &squares)| [counts, squares].map(u128::from));
        self.sound.iter().zip(sums).map(|(&sound, sums)| self.of_sums(sound, sums)).collect()
    }

    fn of_sums(&self, sound: u32, [counts, squares]: [u128; 2]) -> TaxelBaseline {
        if sound == 0 || 2 * sound < self.scans {
            return TaxelBaseline::UNKNOWN;
        }
        // n^2 times the variance, a whole number: exactly zero for a taxel that always read the same.
        let spread = u128::from(sound) * squares - counts * counts;
        let (n, per_unit) = (f64::from(sound), self.range.per_unit());
        TaxelBaseline {
            mean: counts as f64 / n / per_unit,
            noise: if sound > 1 { (spread as f64 / (n * (n - 1.0))).sqrt() / per_unit } else { 0.0 },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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
            scans in proptest::collection::vec(prop::array::uniform3((any::<u8>(), prop::bool::weighted(0.7))), 1..60),
            fine in 0..256_u16
        ) {
            let range = CountRange::to(u16::MAX).unwrap();
            let (mut sums, mut wide, mut running) = (CountSums::new(3), CountSums::new(3), RestStatistics::new(3));
            for counts in &scans {
                let (counts, sound) = (counts.map(|input| input.0), counts.map(|input| input.1));
                sums.push(&scan(&counts, &sound));
                running.push(scan(&counts, &sound).sound_counts());
                let counts = counts.map(|count| 256 * u16::from(count) + fine);
                wide.push(&scan(Counts::Words(&counts, range), &sound));
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

    #[test]
    fn a_window_without_an_end_begins_anew_before_its_sums_overflow() {
        let mut sums = CountSums::new(1);
        for _ in 0..=SCANS_MAX {
            sums.push(&scan(&[255_u8], &[true]));
        }
        assert_eq!(sums.scans(), 1);
        assert_eq!(sums.baseline(), [TaxelBaseline { mean: 255.0, noise: 0.0 }]);
    }
}
