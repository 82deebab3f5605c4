//! Warmth that came since anybody last looked how far off the zero is.
//!
//! The untouched taxels say only once in a window of seconds how far off the zero is, and say nothing where none is
//! untouched. The pads tell sooner: no load reaches them, and warmth moves taxels by a quarter to all of what it moves them
//! (see `warmth.rs`), towards load or away from it.

use std::time::Duration;

use crate::statistics::median;
use crate::zero::warmth::COEFFICIENT_RMS;

/// Time constant of where the pads are now, seconds ...
const NOW_S: f64 = 0.1;
/// ... and of where they were while a zero was watched.
const BEFORE_S: f64 = 1.0;
/// The noise of pads and their rounding move the median of a few modules by less than this, counts.
const NOISE_COUNTS: f64 = 0.4;
/// So many scans are looked at together.
const SCANS: u16 = 2;

/// The pads of one module, both together, counts.
#[derive(Clone, Copy, Debug)]
struct Pads {
    now: f64,
    before: f64,
    /// Where they were when the zero was last looked at.
    looked: f64,
}

/// The pads of a patch.
#[derive(Clone, Debug)]
pub(super) struct SuddenWarmth {
    /// `None` of a module without pads.
    modules: Vec<Option<Pads>>,
    /// Sums over the scans that are not looked at yet, and how many these are.
    sums: Vec<u16>,
    scans: u16,
    /// What the mean of [`SCANS`] scans weighs in each of the averages.
    shares: [f64; 2],
    sigma_counts: f64,
}

impl SuddenWarmth {
    /// For pads that are read once in each `period`.
    pub(super) fn new(period: Duration) -> Self {
        let share = |time_s: f64| -(-f64::from(SCANS) * period.as_secs_f64() / time_s).exp_m1();
        let shares = [NOW_S, BEFORE_S].map(share);
        Self { modules: Vec::new(), sums: Vec::new(), scans: 0, shares, sigma_counts: 0.0 }
    }

    /// The pads of a scan, two of each module; a module without pads has zeros.
    pub(super) fn push(&mut self, pads: &[[u8; 2]]) {
        self.sums.resize(pads.len(), 0);
        self.sums.iter_mut().zip(pads).for_each(|(sum, [a, b])| *sum += u16::from(*a) + u16::from(*b));
        self.scans += 1;
        if self.scans == SCANS {
            self.take();
        }
    }

    fn take(&mut self) {
        self.modules.resize(self.sums.len(), None);
        for (module, sum) in self.modules.iter_mut().zip(&mut self.sums) {
            let counts = f64::from(std::mem::take(sum)) / f64::from(2 * SCANS);
            *module = match *module {
                _ if counts == 0.0 => None,
                None => Some(Pads { now: counts, before: counts, looked: counts }),
                Some(Pads { now, before, looked }) => {
                    let [short, long] = self.shares;
                    Some(Pads { now: now + short * (counts - now), before: before + long * (counts - before), looked })
                }
            };
        }
        self.scans = 0;
        let moved = median(self.modules.iter().flatten().map(|pads| pads.now - pads.looked)).unwrap_or(0.0);
        self.sigma_counts = COEFFICIENT_RMS * (moved * moved - NOISE_COUNTS * NOISE_COUNTS).max(0.0).sqrt();
    }

    /// A zero was taken, or it was looked at how far off it is: from what the pads were a moment ago on.
    pub(super) fn looked(&mut self) {
        self.modules.iter_mut().flatten().for_each(|pads| pads.looked = pads.before);
    }

    /// Standard uncertainty, in counts, of a zero that all taxels share, for the warmth since it was last looked at.
    pub(super) const fn sigma_counts(&self) -> f64 {
        self.sigma_counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: Duration = Duration::from_millis(50);

    fn after(warmth: &mut SuddenWarmth, scans: usize, pads: &[[u8; 2]]) -> f64 {
        (0..scans).for_each(|_| warmth.push(pads));
        warmth.sigma_counts()
    }

    #[test]
    fn what_the_pads_moved_since_the_last_look_is_in_the_zero_either_way_within_tenths_of_a_second() {
        for moved in [-4_i16, 4] {
            let to = |counts: u8| counts.saturating_add_signed(moved as i8);
            let mut warmth = SuddenWarmth::new(PERIOD);
            assert_eq!(after(&mut warmth, 40, &[[200, 202]; 5]), 0.0);
            warmth.looked();
            let sigma = after(&mut warmth, 6, &[[to(200), to(202)]; 5]);
            let expected = COEFFICIENT_RMS * (16.0_f64 - NOISE_COUNTS * NOISE_COUNTS).sqrt();
            assert!(sigma > 0.93 * expected && sigma <= expected, "{sigma} of {expected}");
            let later = after(&mut warmth, 100, &[[to(200), to(202)]; 5]);
            assert!((later - expected).abs() < 1e-3, "{later}: until the zero is looked at again");
            warmth.looked();
            assert_eq!(after(&mut warmth, 2, &[[to(200), to(202)]; 5]), 0.0);
        }
    }

    #[test]
    fn a_module_without_pads_and_a_broken_one_say_nothing() {
        let mut warmth = SuddenWarmth::new(PERIOD);
        after(&mut warmth, 40, &[[200, 200], [0, 0], [200, 200], [0, 0], [200, 200]]);
        warmth.looked();
        assert_eq!(after(&mut warmth, 40, &[[200, 200], [0, 0], [200, 200], [0, 0], [255, 255]]), 0.0);
        assert_eq!(after(&mut SuddenWarmth::new(PERIOD), 40, &[[0, 0]; 5]), 0.0);
    }
}
