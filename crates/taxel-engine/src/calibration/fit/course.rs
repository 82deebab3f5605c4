//! How the pressure went: which scans form a ramp, on which branch each of them lies, and which follow each other.

use std::ops::Range;

use crate::calibration::branch::Branch;
use crate::calibration::fit::legs::{Leg, legs, rising};
use crate::calibration::samples::Sample;
use crate::statistics::quantile;

/// A falling branch that gets below this share of the range of pressure can judge a fit that did not see it.
const HELD_OUT_BELOW: f64 = 0.5;

/// Fewest scans down there that can judge.
const HELD_OUT_SCANS_MIN: usize = 20;

/// Scans further apart than so many periods do not follow each other.
const GAP_PERIODS: f64 = 2.5;

/// The course of the pressure over the scans of a recording or a session.
#[derive(Clone, Debug)]
pub(crate) struct Course {
    /// Number of the ramp, one per scan.
    ramp: Vec<u16>,
    /// Whether the ramp's highest pressure has passed, one per scan.
    falling: Vec<bool>,
    /// Runs of scans without a gap between them, all of one ramp and branch.
    stretches: Vec<Range<usize>>,
}

impl Course {
    /// A recording of one run or several, each a ramp of its own, without a gap that is told. What follows the highest
    /// pressure of a ramp has fallen.
    pub(crate) fn of_recording(kpa: &[f64]) -> Self {
        let ramp = runs(kpa, &legs(kpa));
        let mut falling = Vec::with_capacity(kpa.len());
        for of_ramp in ramp.chunk_by(|a, b| a == b) {
            let kpa = &kpa[falling.len()..][..of_ramp.len()];
            let known = (0..kpa.len()).filter(|&i| kpa[i].is_finite());
            let top = known.max_by(|&a, &b| kpa[a].total_cmp(&kpa[b]));
            falling.extend((0..kpa.len()).map(|i| top.is_some_and(|top| i > top)));
        }
        Self { ramp, falling, stretches: std::iter::once(0..kpa.len()).collect() }
    }

    /// The same as the paper has it: whatever does not rise counts as falling.
    pub(crate) fn of_rises(kpa: &[f64]) -> Self {
        let legs = legs(kpa);
        let falling = rising(kpa, &legs).into_iter().map(|rises| !rises).collect();
        Self { ramp: runs(kpa, &legs), falling, stretches: std::iter::once(0..kpa.len()).collect() }
    }

    /// The samples of a session. Its branches need no mark on disk: what comes after the highest pressure of a ramp
    /// was taken while the pressure fell.
    pub(crate) fn of_session(samples: &[Sample], branches: Branch) -> Self {
        let mut course = Self {
            ramp: samples.iter().map(|sample| sample.ramp).collect(),
            falling: Vec::with_capacity(samples.len()),
            stretches: Vec::new(),
        };
        for ramp in samples.chunk_by(|a, b| a.ramp == b.ramp) {
            let top = (0..ramp.len()).max_by(|&a, &b| ramp[a].pressure_kpa.total_cmp(&ramp[b].pressure_kpa));
            let falls = |i: usize| branches == Branch::Both && top.is_some_and(|top| i > top);
            course.falling.extend((0..ramp.len()).map(falls));
        }
        let gap_s = GAP_PERIODS * period_s(samples);
        let mut begin = 0;
        for i in 1..=samples.len() {
            let ends = i == samples.len()
                || course.ramp[i] != course.ramp[i - 1]
                || course.falling[i] != course.falling[i - 1]
                || seconds_between(&samples[i - 1], &samples[i]) > gap_s;
            if ends {
                course.stretches.push(begin..i);
                begin = i;
            }
        }
        course
    }

    /// Whether the pressure fell, one per scan.
    pub(crate) fn falling(&self) -> &[bool] {
        &self.falling
    }

    /// Runs of scans without a gap between them.
    pub(crate) fn stretches(&self) -> &[Range<usize>] {
        &self.stretches
    }

    /// Every ramp with its scans.
    pub(crate) fn ramps(&self) -> impl Iterator<Item = (u16, Range<usize>)> {
        let mut end = 0;
        self.ramp.chunk_by(|a, b| a == b).map(move |ramp| {
            end += ramp.len();
            (ramp[0], end - ramp.len()..end)
        })
    }

    /// The scans that a fit can be tried on which did not see them: with several falling branches the last of them,
    /// with one its lower half. `None` if the pressure never fell so far, or too fast.
    pub(crate) fn held_out(&self, kpa: &[f64]) -> Option<Range<usize>> {
        let (low, high) = (quantile(kpa.to_vec(), 0.0)?, quantile(kpa.to_vec(), 1.0)?);
        let middle = low + HELD_OUT_BELOW * (high - low);
        let below = |branch: &Range<usize>| {
            let first = branch.clone().find(|&i| kpa[i] < middle)?;
            (branch.end - first >= HELD_OUT_SCANS_MIN).then_some(first)
        };
        let mut branches = self.falling_branches();
        branches.retain(|branch| below(branch).is_some());
        let last = branches.last()?.clone();
        let first = if branches.len() > 1 { last.start } else { below(&last)? };
        Some(first..last.end)
    }

    fn falling_branches(&self) -> Vec<Range<usize>> {
        let branch = |(_, ramp): (u16, Range<usize>)| {
            let begin = ramp.clone().find(|&i| self.falling[i])?;
            Some(begin..ramp.end)
        };
        self.ramps().filter_map(branch).collect()
    }
}

/// Number of the run that each scan is of; a run begins where the pressure turns upwards.
fn runs(kpa: &[f64], legs: &[Leg]) -> Vec<u16> {
    let (mut ramp, mut runs) = (Vec::with_capacity(kpa.len()), 0);
    for leg in legs {
        runs += u16::from(leg.rising && leg.scans.start > 0);
        ramp.resize(leg.scans.end, runs);
    }
    ramp
}

/// Median time from one sample to the next within a ramp, seconds.
fn period_s(samples: &[Sample]) -> f64 {
    let pairs = samples.windows(2).filter(|pair| pair[0].ramp == pair[1].ramp);
    let steps = pairs.map(|pair| seconds_between(&pair[0], &pair[1])).filter(|step| *step > 0.0);
    quantile(steps.collect(), 0.5).unwrap_or(0.0)
}

fn seconds_between(before: &Sample, after: &Sample) -> f64 {
    after.time_ns.saturating_sub(before.time_ns) as f64 * 1e-9
}

/// A clock for the samples of a session, in seconds, that tells how the skin was heard.
///
/// Scans that were refused are no silence of the taxels: within a ramp a pause below `silence_s` counts as one period,
/// so that it is not taken for a freeze. Between ramps, where the run's clock may have begun anew, and over a longer
/// pause a silence passes, after which a taxel's trend begins anew.
pub(crate) fn session_clock(samples: &[Sample], silence_s: f64) -> Vec<f64> {
    let period = period_s(samples);
    let mut now = 0.0;
    let steps = samples.windows(2).map(|pair| {
        let step = seconds_between(&pair[0], &pair[1]);
        let other = pair[0].ramp != pair[1].ramp || step <= 0.0 || step > silence_s;
        now += match other {
            true => step.max(2.0 * silence_s + period),
            false if step > GAP_PERIODS * period => period,
            false => step,
        };
        now
    });
    let clock: Vec<f64> = steps.collect();
    samples.first().map(|_| 0.0).into_iter().chain(clock).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(ramp: u16, ms: i64, pressure_kpa: f64) -> Sample {
        Sample { ramp, time_ns: ms * 1_000_000, pressure_kpa, counts: [0_u8].as_slice().into() }
    }

    /// Ramps to 20 kPa and back down to `end`, a sample each 50 ms and 0.5 kPa.
    fn samples(ends: &[f64]) -> Vec<Sample> {
        let mut all = Vec::new();
        for (ramp, &end) in (0..).zip(ends) {
            let falling = ((20.0 - end) / 0.5) as i64;
            let mut ms = i64::from(ramp) * 100_000;
            for k in 0..=40 + falling {
                let kpa = if k <= 40 { 0.5 * k as f64 } else { 20.0 - 0.5 * (k - 40) as f64 };
                ms += if k == 41 { 4_000 } else { 50 };
                all.push(sample(ramp, ms, kpa));
            }
        }
        all
    }

    #[test]
    fn what_follows_the_highest_pressure_of_a_ramp_has_fallen() {
        let samples = samples(&[0.0, 5.0]);
        let course = Course::of_session(&samples, Branch::Both);
        let falling: Vec<usize> = course.ramps().map(|(_, r)| r.filter(|&i| course.falling()[i]).count()).collect();
        assert_eq!(falling, [40, 30]);
        assert_eq!(course.stretches().len(), 4, "the wait at the top parts the branches: {:?}", course.stretches());
        let rising = Course::of_session(&samples, Branch::Rising);
        assert!(!rising.falling().contains(&true));
    }

    /// Each of several cycles has its own top, whichever of them is the highest; a recording may begin with a fall.
    #[test]
    fn every_cycle_of_a_recording_has_its_own_branches() {
        let way =
            |from: i32, to: i32| (0..350).map(move |k| f64::from(from) + f64::from(to - from) * f64::from(k) / 350.0);
        for tops in [[700, 600, 650], [600, 700, 650], [600, 650, 700]] {
            let cycle = |top: i32| way(0, top).chain(way(top, 0));
            let kpa: Vec<f64> = tops.into_iter().flat_map(cycle).map(|p| 0.1 * p).collect();
            let course = Course::of_recording(&kpa);
            assert_eq!(course.ramps().map(|(ramp, _)| ramp).collect::<Vec<_>>(), [0, 1, 2], "{tops:?}");
            let falls = |i: usize| i % 700 > 350;
            let wrong = (0..kpa.len()).filter(|&i| course.falling()[i] != falls(i)).count();
            assert!(wrong <= 20, "{wrong} scans of {tops:?} are on the other branch");
            let held_out = course.held_out(&kpa).unwrap();
            assert!((1_750..1_753).contains(&held_out.start) && held_out.end == 2_100, "{held_out:?} of {tops:?}");
        }
        let valley: Vec<f64> = way(700, 0).chain(way(0, 705)).collect();
        let course = Course::of_recording(&valley);
        let falling = course.falling().iter().filter(|falls| **falls).count();
        assert!((345..=350).contains(&falling) && !course.falling()[500], "{falling} of 700");
    }

    #[test]
    fn the_lower_half_is_held_out_or_a_whole_further_branch() {
        let kpa = |samples: &[Sample]| samples.iter().map(|s| s.pressure_kpa).collect::<Vec<f64>>();
        let one = samples(&[-1.0]);
        let held = Course::of_session(&one, Branch::Both).held_out(&kpa(&one)).unwrap();
        assert_eq!((one[held.start].pressure_kpa, held.end), (9.0, one.len()));
        let two = samples(&[-1.0, -1.0]);
        let held = Course::of_session(&two, Branch::Both).held_out(&kpa(&two)).unwrap();
        assert_eq!((two[held.start].pressure_kpa, two[held.start].ramp, held.end), (19.5, 1, two.len()));
        // A ramp that was cut off soon after its top cannot judge.
        let cut_off = samples(&[-1.0, 18.0]);
        let held = Course::of_session(&cut_off, Branch::Both).held_out(&kpa(&cut_off)).unwrap();
        assert_eq!((cut_off[held.start].ramp, cut_off[held.start].pressure_kpa), (0, 9.0));
        let never = samples(&[15.0]);
        assert_eq!(Course::of_session(&never, Branch::Both).held_out(&kpa(&never)), None);
        assert_eq!(Course::of_session(&one, Branch::Rising).held_out(&kpa(&one)), None);
    }

    #[test]
    fn the_highest_scan_of_a_recording_is_the_last_of_its_rise() {
        let course = Course::of_recording(&[0.0, 1.0, 2.0, 3.0, 2.0, f64::NAN]);
        assert_eq!(course.falling, [false, false, false, false, true, true]);
    }

    /// Scans that follow each other without a gap, every 40 ms.
    #[test]
    fn a_stretch_ends_with_its_ramp_its_branch_and_at_a_gap() {
        let of = |samples: &[Sample], branches| Course::of_session(samples, branches).stretches;
        let ramps: Vec<Sample> = (0..20).map(|k| sample((k / 10) as u16, 40 * k, k as f64)).collect();
        assert_eq!(of(&ramps, Branch::Rising), [0..10, 10..20]);
        let top: Vec<Sample> = (0..20).map(|k| sample(0, 40 * k, (k.min(18 - k)) as f64)).collect();
        assert_eq!(of(&top, Branch::Both), [0..10, 10..20]);
        assert_eq!(of(&top, Branch::Rising), std::slice::from_ref(&(0..20)));
        // Two and a half periods are none, more are.
        let gap = |ms: i64| -> Vec<Sample> {
            (0..20).map(|k| sample(0, 40 * k + if k < 5 { 0 } else { ms - 40 }, k as f64)).collect()
        };
        assert_eq!(of(&gap(100), Branch::Rising), std::slice::from_ref(&(0..20)));
        assert_eq!(of(&gap(101), Branch::Rising), [0..5, 5..20]);
        // Scans at one time have no pace.
        let mut twice: Vec<Sample> = ramps.iter().flat_map(|sample| vec![sample.clone(); 3]).collect();
        assert!((period_s(&twice) - 0.04).abs() < 1e-12, "{}", period_s(&twice));
        twice.truncate(3);
        assert_eq!(period_s(&twice), 0.0);
    }

    #[test]
    fn the_clock_of_a_session_tells_pauses_from_silences() {
        let step = |ms: i64, ramp: u16| {
            let mut samples: Vec<Sample> = (0..20).map(|k| sample(0, 40 * k, 0.0)).collect();
            samples.push(sample(ramp, 40 * 19 + ms, 0.0));
            let clock = session_clock(&samples, 0.5);
            clock[20] - clock[19]
        };
        for (ms, ramp, expected) in [
            (40, 0, 0.04),
            (100, 0, 0.1),  // no pause yet
            (101, 0, 0.04), // scans that were refused
            (500, 0, 0.04),
            (501, 0, 1.04), // a silence
            (3_000, 0, 3.0),
            (40, 1, 1.04),
            (-900, 1, 1.04), // the run's clock began anew
        ] {
            let step = step(ms, ramp);
            assert!((step - expected).abs() < 1e-9, "{ms} ms, ramp {ramp}: {step} is not {expected}");
        }
    }

    #[test]
    fn pauses_of_the_intake_are_no_silence_and_ramps_are_apart() {
        let mut samples: Vec<Sample> = (0..100).map(|k| sample(0, 50 * k, k as f64)).collect();
        samples.iter_mut().skip(50).for_each(|s| s.time_ns += 800_000_000);
        samples.extend((0..10).map(|k| sample(1, 50 * k, k as f64))); // after a restart the clock began anew
        let clock = session_clock(&samples, 1.0);
        assert_eq!(clock.len(), samples.len());
        assert!((clock[50] - clock[49] - 0.05).abs() < 1e-9, "{}", clock[50] - clock[49]);
        assert!(clock[100] - clock[99] > 2.0, "{}", clock[100] - clock[99]);
        assert!(clock.windows(2).all(|pair| pair[1] > pair[0]));
        assert!(session_clock(&[], 1.0).is_empty());
    }
}
