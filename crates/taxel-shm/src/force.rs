//! Whether what a page says may be acted on: the one place of this crate that decides it.

use std::fmt;
use std::time::Duration;

use crate::sample::{Sample, State};
use crate::text::Text;

/// The limits that a page carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// A sample whose newest frame is older is no force.
    pub age: Duration,
    /// A writer that has not been seen alive for longer is gone.
    pub beat: Duration,
}

/// A force that may be acted on now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Force {
    /// Total normal force in N.
    pub total_n: f64,
    /// Time since the arrival of the newest frame in it.
    pub age: Duration,
    /// All that was written with it.
    pub sample: Sample,
}

/// Why there is no force to act on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoForce {
    /// There is no page that could be opened.
    NoPage,
    /// No sample was written yet, or the writer was faster than the reader every time.
    NothingYet,
    /// The writer has ended in good order.
    Closed,
    /// The writer was not seen alive for so long.
    WriterGone(Duration),
    /// The state carries no force; with the first reasons.
    State(State, Text<256>),
    /// The newest frame is so old, and the limit is the second.
    TooOld(Duration, Duration),
    /// The page has stamps of the future: reader and writer do not have the same clock.
    OtherClock,
}

impl fmt::Display for NoForce {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = |span: &Duration| span.as_secs_f64() * 1e3;
        match self {
            Self::NoPage => {
                write!(
                    f,
                    "there is no page to be read: no daemon runs, it has another patch, this account is not in the \
                     page's group, or others may write in it or in its folder"
                )
            }
            Self::NothingYet => write!(f, "no sample yet"),
            Self::Closed => write!(f, "the daemon has ended"),
            Self::WriterGone(silence) => write!(f, "the daemon's engine has not run for {:.0} ms", ms(silence)),
            Self::State(state, reasons) => write!(f, "{}: {reasons}", state.name()),
            Self::TooOld(age, limit) => write!(f, "{:.0} ms old, more than {:.0} ms", ms(age), ms(limit)),
            Self::OtherClock => write!(f, "stamps of the future: reader and daemon do not have the same clock"),
        }
    }
}

/// The force, if it may be acted on at `now_ns`, a reading of the clock that was made after all else was found.
pub(crate) fn judge(sample: &Sample, beat_ns: i64, now_ns: i64, limits: Limits) -> Result<Force, NoForce> {
    let since = |then_ns: i64| match now_ns.checked_sub(then_ns).and_then(|ns| u64::try_from(ns).ok()) {
        Some(ns) => Ok(Duration::from_nanos(ns)),
        None => Err(NoForce::OtherClock),
    };
    let silence = since(beat_ns)?;
    if silence > limits.beat {
        return Err(NoForce::WriterGone(silence));
    }
    let (Some(total_n), Some(frame_ns), true) =
        (sample.total_n, sample.monotonic_ns, matches!(sample.state, State::Ok | State::Degraded))
    else {
        return Err(NoForce::State(sample.state, sample.reasons));
    };
    let age = since(frame_ns)?;
    if age > limits.age {
        return Err(NoForce::TooOld(age, limits.age));
    }
    Ok(Force { total_n, age, sample: *sample })
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;
    const LIMITS: Limits = Limits { age: Duration::from_millis(150), beat: Duration::from_millis(100) };

    fn good() -> Sample {
        Sample { state: State::Ok, total_n: Some(4.9), monotonic_ns: Some(1_000 * MS), ..Sample::default() }
    }

    #[test]
    fn a_force_is_good_up_to_both_limits_and_not_beyond() {
        let force = judge(&good(), 1_060 * MS, 1_080 * MS, LIMITS).unwrap();
        assert_eq!((force.total_n, force.age), (4.9, Duration::from_millis(80)));
        for (now_ms, beat_ms, expected) in [
            (1_150, 1_060, Ok(150)),
            (1_151, 1_060, Err("151 ms old, more than 150 ms")),
            (1_160, 1_060, Err("160 ms old, more than 150 ms")),
            (1_161, 1_060, Err("the daemon's engine has not run for 101 ms")),
            (1_080, 980, Ok(80)),
            (1_080, 979, Err("the daemon's engine has not run for 101 ms")),
            (900_000, 1_060, Err("the daemon's engine has not run for 898940 ms")),
            (999, 900, Err("stamps of the future: reader and daemon do not have the same clock")),
            (1_059, 1_060, Err("stamps of the future: reader and daemon do not have the same clock")),
        ] {
            let judged = judge(&good(), beat_ms * MS, now_ms * MS, LIMITS);
            let judged = judged.map(|force| force.age.as_millis()).map_err(|why| why.to_string());
            assert_eq!(judged, expected.map_err(str::to_owned), "now {now_ms}, beat {beat_ms}");
        }
    }

    #[test]
    fn clocks_that_differ_by_any_amount_give_no_force() {
        for (now_ns, frame_ns) in [(i64::MAX, i64::MIN), (i64::MIN, i64::MAX), (0, i64::MIN), (-1, 0)] {
            let sample = Sample { monotonic_ns: Some(frame_ns), ..good() };
            assert!(judge(&sample, now_ns, now_ns, LIMITS).is_err(), "{now_ns} {frame_ns}");
        }
    }

    #[test]
    fn only_ok_and_degraded_of_a_living_writer_with_a_frame_and_a_number_are_forces() {
        let of = |sample: Sample| judge(&sample, 1_060 * MS, 1_080 * MS, LIMITS);
        for state in [State::Unspecified, State::Stale, State::TareInvalid, State::Uncalibrated] {
            let why = of(Sample { state, reasons: Text::new("unload"), ..good() }).unwrap_err();
            assert_eq!(why.to_string(), format!("{}: unload", state.name()));
        }
        assert!(of(Sample { state: State::Degraded, ..good() }).is_ok());
        assert!(of(Sample { total_n: None, ..good() }).is_err());
        assert!(of(Sample { monotonic_ns: None, ..good() }).is_err());
    }
}
