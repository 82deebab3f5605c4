//! How the pressure of a session went: on which branch each of its samples lies, and which follow each other.

use crate::calibration::branch::Branch;
use crate::calibration::samples::Sample;
use crate::statistics::quantile;

/// Scans further apart than so many periods do not follow each other.
const GAP_PERIODS: f64 = 2.5;

/// Whether the pressure fell, one per sample of a session. Its branches need no mark on disk: what comes after the highest
/// pressure of a ramp was taken while the pressure fell.
pub(crate) fn falling(samples: &[Sample], branches: Branch) -> Vec<bool> {
    let mut falling = Vec::with_capacity(samples.len());
    for ramp in samples.chunk_by(|a, b| a.ramp == b.ramp) {
        let top = (0..ramp.len()).max_by(|&a, &b| ramp[a].pressure_kpa.total_cmp(&ramp[b].pressure_kpa));
        let falls = |i: usize| branches == Branch::Both && top.is_some_and(|top| i > top);
        falling.extend((0..ramp.len()).map(falls));
    }
    falling
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
        Sample { ramp, time_ns: ms * 1_000_000, pressure_kpa, counts: [0].into() }
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
        let falls = falling(&samples, Branch::Both);
        let of = |ramp: u16| samples.iter().zip(&falls).filter(|(s, falls)| s.ramp == ramp && **falls).count();
        assert_eq!([0, 1].map(of), [40, 30]);
        assert!(!falling(&samples, Branch::Rising).contains(&true));
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
            (0, 0, 1.04),
            (-100, 0, 1.04),
        ] {
            let step = step(ms, ramp);
            assert!((step - expected).abs() < 1e-9, "{ms} ms, ramp {ramp}: {step} is not {expected}");
        }
        assert!(session_clock(&[], 1.0).is_empty() && session_clock(&[sample(0, 40, 0.0)], 1.0) == [0.0]);
    }
}
