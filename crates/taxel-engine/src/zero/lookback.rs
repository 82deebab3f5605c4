//! What a patch read since its zero was taken, looked at in windows: how far off the zero is, and whether the skin became
//! lighter than it.

use std::ops::Range;
use std::time::Duration;

use crate::baseline::TaxelBaseline;
use crate::scan::Scan;
use crate::statistics;
use crate::zero::count_sums::CountSums;
use crate::zero::rest::limits::RestLimits;
use crate::zero::rest::moves::Moves;
use crate::zero::sudden::SuddenWarmth;
use crate::zero::unloading::{Later, Unloading};
use crate::zero::warmth::Warmth;

/// Length of a window.
const WINDOW: Duration = Duration::from_secs(2);

/// A median beyond this is a load on half of the skin, and no uncertainty of the zero, counts.
const OFFSET_MAX_COUNTS: f64 = 4.0;

/// The window that is being read, and what the last one showed.
#[derive(Clone, Debug)]
pub struct Lookback {
    later: CountSums,
    /// `None` where the zero follows the temperature.
    warmth: Option<Warmth>,
    sudden: SuddenWarmth,
    /// Scans of a window.
    scans: u64,
    offset_counts: f64,
    /// How far the median taxel moved towards load in the window that ended with this scan, counts.
    median_counts: Option<f64>,
}

/// What a window is compared with.
#[derive(Clone, Copy, Debug)]
pub struct Present<'a> {
    /// The zero now, one per taxel.
    pub zero: &'a [TaxelBaseline],
    /// Which way pressure moves the count of each taxel: +1, -1, or 0 where that is not known.
    pub signs: &'a [i8],
    /// Which taxels form each module.
    pub modules: &'a [Range<usize>],
    /// How much lighter a true zero allows a skin to be.
    pub limits: &'a RestLimits,
}

impl Lookback {
    /// For so many taxels that are scanned once in each `period`, with a zero that follows the temperature or not.
    #[must_use]
    pub fn new(taxels: usize, period: Duration, follows: bool) -> Self {
        let scans = (WINDOW.as_secs_f64() / period.as_secs_f64()).ceil() as u64;
        let warmth = (!follows).then(Warmth::default);
        let (later, sudden) = (CountSums::new(taxels), SuddenWarmth::new(period));
        Self { later, warmth, sudden, scans, offset_counts: 0.0, median_counts: None }
    }

    /// A zero was taken, with these means of each module's pads, counts.
    pub fn begin(&mut self, pads: &[[Option<f64>; 2]]) {
        self.offset_counts = 0.0;
        let mean = |pads: &[Option<f64>; 2]| statistics::mean(pads.iter().flatten().copied()).0;
        let of_modules = || pads.iter().map(mean).map(|mean| if mean.is_finite() { mean } else { 0.0 }).collect();
        self.warmth.iter_mut().for_each(|warmth| warmth.begin(of_modules()));
        self.sudden.looked_at(pads);
        self.restart();
    }

    /// The window begins anew.
    pub fn restart(&mut self) {
        self.later.restart();
    }

    /// How far the median taxel lay from its zero in the last window, counts, or may have lain by what the thermal pads say,
    /// whichever is more. Half of the skin is seldom touched, so the median is what the zero is off by everywhere. Where
    /// all of it is, a light load and the cold hide each other from the median, but not from the pads. What has warmed the
    /// skin since the last window comes to it.
    #[must_use]
    pub fn offset_counts(&self) -> f64 {
        let by_pads = self.warmth.as_ref().map_or(0.0, Warmth::sigma_counts); // no load reaches them
        // The same taxels by the same coefficients: what came before and what comes now add up.
        by_pads.max(self.offset_counts) + self.sudden.sigma_counts()
    }

    /// Where each pad was in the last second, counts, `None` without one.
    #[must_use]
    pub fn pads(&self) -> Vec<[Option<f64>; 2]> {
        self.sudden.pads_before()
    }

    /// The pads of a scan, whether there is a zero or not.
    pub fn feel(&mut self, scan: &Scan<'_>) {
        self.sudden.on_scan(scan);
    }

    /// How far the median taxel moved towards load, if a window has just ended, counts.
    #[must_use]
    pub const fn median_counts(&self) -> Option<f64> {
        self.median_counts
    }

    /// Takes a scan. At the end of a window, what shows that the skin became lighter than its zero.
    pub fn on_scan(&mut self, scan: &Scan<'_>, present: Present<'_>) -> Option<Unloading> {
        self.later.push(scan);
        self.median_counts = None;
        if self.later.scans() < self.scans {
            return None;
        }
        let Present { zero, signs, modules, limits } = present;
        let (seen, scans) = (self.later.baseline(), self.later.scans());
        let median = Moves::between(zero, &seen, scans, signs).median();
        self.median_counts = median.is_finite().then_some(median);
        self.later.restart();
        // Where too little was sound, what was seen before holds, and what has warmed the skin since.
        let median = self.median_counts?;
        self.offset_counts = median.abs().min(OFFSET_MAX_COUNTS);
        self.sudden.looked();
        let towards_load = f64::from(signs.iter().map(|&sign| i32::from(sign)).sum::<i32>().signum());
        self.warmth.iter_mut().for_each(|warmth| warmth.look(self.sudden.before(), towards_load));
        Later { seen: &seen, scans, modules }.unloaded(zero, signs, limits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::counts::Counts;
    use taxel_skin::Time;

    const TAXELS: usize = 20;

    /// What the zero is off by after windows of scans at these counts, each sound or not.
    fn offset_after(windows: &[(u8, bool)]) -> f64 {
        let mut lookback = Lookback::new(TAXELS, Duration::from_millis(50), false);
        lookback.begin(&[]);
        let zero = vec![TaxelBaseline { mean: 240.0, noise: 0.5 }; TAXELS];
        let (signs, limits) = (vec![-1; TAXELS], RestLimits::default());
        let modules = [0..10, 10..TAXELS];
        let present = Present { zero: &zero, signs: &signs, modules: &modules, limits: &limits };
        let scans = windows.iter().flat_map(|window| std::iter::repeat_n(window, 40));
        for (number, &(count, is_sound)) in (0..).zip(scans) {
            let (counts, sound) = (vec![count + (number % 2) as u8; TAXELS], vec![is_sound; TAXELS]);
            let scan = Scan {
                time: Time::from_nanos(number * 50_000_000),
                whole: true,
                counts: Counts::Bytes(&counts),
                pads: &[[200; 2]; 2],
                silent: &[false; 2],
                sound: &sound,
                soundness: 0,
                jumps: &[],
            };
            lookback.feel(&scan);
            lookback.on_scan(&scan, present);
        }
        lookback.offset_counts()
    }

    #[test]
    fn a_window_in_which_nothing_was_sound_says_nothing_of_the_zero() {
        let near = |is: f64, expected: f64| assert!((is - expected).abs() < 1e-9, "{is} is not {expected}");
        near(offset_after(&[(238, true)]), 1.5);
        near(offset_after(&[(238, true), (238, false), (0, false)]), 1.5);
        near(offset_after(&[(238, true), (238, false), (239, true)]), 0.5);
    }
}
