//! Warmth that came since anybody last looked how far off the zero is.
//!
//! The untouched taxels say only once in a window of seconds how far off the zero is, and say nothing where none is
//! untouched. The pads tell sooner: no load reaches them, and warmth moves taxels by a quarter to all of what it moves them
//! (see `warmth.rs`), towards load or away from it.

use std::time::Duration;

use taxel_skin::Time;

use crate::scan::Scan;
use crate::statistics::{exponential_share, median};
use crate::zero::warmth::COEFFICIENT_RMS;

/// Time constant of where the pads are now, seconds ...
const NOW_S: f64 = 0.1;
/// ... and of where they were while a zero was watched.
const BEFORE_S: f64 = 1.0;
/// After a longer time without scans what was before says nothing of now, seconds.
const GAP_S: f64 = 1.0;
/// The noise of pads and their rounding move the median of a few modules by less than this, counts.
const NOISE_COUNTS: f64 = 0.4;
/// The median is taken once in so many scans.
const SCANS: u8 = 2;

/// One pad, counts.
#[derive(Clone, Copy, Debug)]
struct Pad {
    now: f64,
    before: f64,
    /// Where it was when the zero was last looked at.
    looked: f64,
}

/// The pads of a patch.
#[derive(Clone, Debug)]
pub(super) struct SuddenWarmth {
    /// `None` of a pad that is not there, and of one at an end of its range.
    modules: Vec<[Option<Pad>; 2]>,
    /// What a new reading weighs in each of the averages.
    shares: [f64; 2],
    last: Option<Time>,
    scans: u8,
    sigma_counts: f64,
}

impl SuddenWarmth {
    /// For pads that are read once in each `period`.
    pub(super) fn new(period: Duration) -> Self {
        let shares = [NOW_S, BEFORE_S].map(|time_s| exponential_share(period.as_secs_f64(), time_s));
        Self { modules: Vec::new(), shares, last: None, scans: 0, sigma_counts: 0.0 }
    }

    /// Takes a scan.
    pub(super) fn on_scan(&mut self, scan: &Scan<'_>) {
        let gap = self.last.is_none_or(|last| scan.time.seconds_since(last) > GAP_S);
        self.last = Some(scan.time);
        self.push(scan.pads, gap);
        self.scans = (self.scans + 1) % SCANS;
        if gap || self.scans == 0 {
            let heard = self.modules.iter().zip(scan.silent).filter(|(_, silent)| !**silent);
            let moved = median(heard.filter_map(|(pads, _)| mean(pads, |pad| pad.now - pad.looked))).unwrap_or(0.0);
            self.sigma_counts = COEFFICIENT_RMS * (moved * moved - NOISE_COUNTS * NOISE_COUNTS).max(0.0).sqrt();
        }
    }

    /// The pads, two of each module; one that is not there has zeros. After a `gap` they are where they are.
    fn push(&mut self, pads: &[[u8; 2]], gap: bool) {
        let [short, long] = if gap { [1.0, self.shares[1]] } else { self.shares };
        self.modules.resize(pads.len(), [None; 2]);
        for (pad, count) in self.modules.as_flattened_mut().iter_mut().zip(pads.as_flattened()) {
            let counts = f64::from(*count);
            *pad = match *pad {
                _ if matches!(*count, u8::MIN | u8::MAX) => None,
                None => Some(Pad { now: counts, before: counts, looked: counts }),
                Some(Pad { now, before, looked }) => {
                    Some(Pad { now: now + short * (counts - now), before: before + long * (counts - before), looked })
                }
            };
        }
    }

    /// A zero was taken, or it was looked at how far off it is: from what the pads were a moment ago on.
    pub(super) fn looked(&mut self) {
        self.modules.as_flattened_mut().iter_mut().flatten().for_each(|pad| pad.looked = pad.before);
    }

    /// A zero was taken with the pads there, counts.
    pub(super) fn looked_at(&mut self, then: &[[Option<f64>; 2]]) {
        let pads = self.modules.as_flattened_mut().iter_mut().zip(then.as_flattened());
        pads.for_each(|(pad, then)| *pad = pad.zip(*then).map(|(pad, then)| Pad { looked: then, ..pad }).or(*pad));
    }

    /// Where the pads of each module were a moment ago, counts, 0 without pads; nothing before the first scan.
    pub(super) fn before(&self) -> Vec<f64> {
        self.modules.iter().map(|pads| mean(pads, |pad| pad.before).unwrap_or(0.0)).collect()
    }

    /// The same of each pad, `None` without one.
    pub(super) fn pads_before(&self) -> Vec<[Option<f64>; 2]> {
        self.modules.iter().map(|pads| pads.map(|pad| pad.map(|pad| pad.before))).collect()
    }

    /// Standard uncertainty, in counts, of a zero that all taxels share, for the warmth since it was last looked at.
    pub(super) const fn sigma_counts(&self) -> f64 {
        self.sigma_counts
    }
}

/// Mean over the pads that are there.
fn mean(pads: &[Option<Pad>; 2], of: impl Fn(&Pad) -> f64) -> Option<f64> {
    let (sum, there) = pads.iter().flatten().fold((0.0, 0.0), |(sum, there), pad| (sum + of(pad), there + 1.0));
    (there > 0.0).then(|| sum / there)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::counts::Counts;

    const PERIOD: Duration = Duration::from_millis(50);

    /// Scans of pads alone; after each of them time goes on by a period.
    struct Pads {
        warmth: SuddenWarmth,
        time: Time,
        silent: [bool; 5],
    }

    impl Pads {
        fn new() -> Self {
            Self { warmth: SuddenWarmth::new(PERIOD), time: Time::default(), silent: [false; 5] }
        }

        fn after(&mut self, scans: usize, pads: &[[u8; 2]; 5]) -> f64 {
            for _ in 0..scans {
                let (counts, silent) = (Counts::Bytes(&[]), &self.silent);
                let scan =
                    Scan { time: self.time, whole: true, counts, pads, silent, sound: &[], soundness: 0, jumps: &[] };
                self.warmth.on_scan(&scan);
                self.time = self.time + PERIOD;
            }
            self.warmth.sigma_counts()
        }
    }

    fn sigma_of(moved: f64) -> f64 {
        COEFFICIENT_RMS * (moved * moved - NOISE_COUNTS * NOISE_COUNTS).sqrt()
    }

    #[test]
    fn what_the_pads_moved_since_the_last_look_is_in_the_zero_either_way_within_tenths_of_a_second() {
        for moved in [-4_i8, 4] {
            // Hands have one pad a module.
            for second in [202_u8, 0] {
                let to = |counts: u8| if counts == 0 { 0 } else { counts.saturating_add_signed(moved) };
                let mut pads = Pads::new();
                assert_eq!(pads.after(40, &[[200, second]; 5]), 0.0);
                pads.warmth.looked();
                let (sigma, expected) = (pads.after(6, &[[to(200), to(second)]; 5]), sigma_of(4.0));
                assert!(sigma > 0.93 * expected && sigma <= expected, "{sigma} of {expected}");
                let later = pads.after(100, &[[to(200), to(second)]; 5]);
                assert!((later - expected).abs() < 1e-3, "{later}: until the zero is looked at again");
                pads.warmth.looked();
                assert_eq!(pads.after(2, &[[to(200), to(second)]; 5]), 0.0);
            }
        }
    }

    #[test]
    fn the_first_scan_after_a_gap_tells_what_came_meanwhile() {
        let mut pads = Pads::new();
        pads.after(40, &[[200, 202]; 5]);
        pads.warmth.looked();
        pads.time = pads.time + Duration::from_secs(300);
        let sigma = pads.after(1, &[[210, 212]; 5]);
        assert!((sigma - sigma_of(10.0)).abs() < 1e-12, "{sigma}");
    }

    #[test]
    fn modules_without_pads_or_that_are_silent_and_pads_at_an_end_of_their_range_say_nothing() {
        let mut pads = Pads::new();
        pads.after(40, &[[200, 200], [0, 0], [200, 200], [0, 0], [200, 200]]);
        pads.warmth.looked();
        assert_eq!(pads.after(40, &[[200, 200], [0, 0], [200, 200], [0, 0], [255, 255]]), 0.0);
        pads.silent = [true, false, true, false, false];
        let sigma = pads.after(40, &[[200, 200], [0, 0], [200, 200], [0, 0], [204, 255]]);
        assert_eq!(sigma, 0.0, "a pad that is there again was not there at the look");
        pads.warmth.looked();
        let sigma = pads.after(40, &[[200, 200], [0, 0], [200, 200], [0, 0], [208, 255]]);
        assert!((sigma - sigma_of(4.0)).abs() < 1e-3, "{sigma}");
    }
}
