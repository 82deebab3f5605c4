//! Whether a force may be acted on: the one rule, for senders and receivers of samples.
//!
//! A sample is a force while its state is OK or DEGRADED, its total is a number, and its age has not passed `max_age_s`.
//! Its age is the age that it was sent with and the time that has passed since. The same rule is in
//! `deploy/taxel_force.h`, in `deploy/python` and on the page; `judge.csv` beside this file has the cases that all of
//! them are tested with.

use std::fmt;
use std::time::{Duration, SystemTime};

use crate::v1::{ForceReason, ForceSample, ForceState, ReasonCode, TaxelSample};
use prost_types::Timestamp;

/// A force that may be acted on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Force {
    /// Total normal force in N.
    pub total_n: f64,
    /// Its age, not less than the true one.
    pub age: Duration,
}

/// Why a sample is not a force.
#[derive(Clone, Debug, PartialEq)]
pub enum NoForce {
    /// The state carries none; with the reasons for people and, in the same order, for programs.
    State(ForceState, Vec<String>, Vec<ReasonCode>),
    /// It is so old, and the limit is the second.
    TooOld(Duration, Duration),
}

impl NoForce {
    /// The same for programs, where the sample does not say it itself.
    #[must_use]
    pub fn code(&self) -> ReasonCode {
        match self {
            Self::State(_, _, codes) => codes.first().copied().unwrap_or(ReasonCode::NoFigure),
            Self::TooOld(..) => ReasonCode::FrameOld,
        }
    }
}

impl fmt::Display for NoForce {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::State(state, reasons, _) => write!(f, "{}: {}", word(*state), reasons.join("; ")),
            Self::TooOld(age, limit) => {
                write!(f, "{:.0} ms old, more than {} ms", age.as_secs_f64() * 1e3, limit.as_millis())
            }
        }
    }
}

/// The state's name without its prefix.
#[must_use]
pub fn word(state: ForceState) -> &'static str {
    let name = state.as_str_name();
    name.strip_prefix("FORCE_STATE_").unwrap_or(name)
}

/// Judges a sample for which `waited` has passed since it was sent. `own`: the reader's own limit of age, where it has a
/// stricter one than the daemon.
///
/// # Errors
/// Why it is not a force.
pub fn judge(sample: &ForceSample, waited: Duration, own: Option<Duration>) -> Result<Force, NoForce> {
    let state = sample.state();
    let has_force = matches!(state, ForceState::Ok | ForceState::Degraded);
    let total_n = sample.total_n.filter(|total_n| has_force && total_n.is_finite());
    let (Some(total_n), Some(age_s)) = (total_n, sample.age_s.filter(|age_s| !age_s.is_nan())) else {
        let codes = sample.causes.iter().map(ForceReason::code).collect();
        return Err(NoForce::State(state, sample.reasons.clone(), codes));
    };
    let daemons = limit(sample.max_age_s);
    let (age, limit) = (aged(age_s, waited), own.map_or(daemons, |own| own.min(daemons)));
    if age > limit { Err(NoForce::TooOld(age, limit)) } else { Ok(Force { total_n, age }) }
}

/// An age by now. One that is not a time is as bad as an old one.
#[must_use]
pub fn aged(age_s: f64, waited: Duration) -> Duration {
    Duration::try_from_secs_f64(age_s).map_or(Duration::MAX, |age| age.saturating_add(waited))
}

impl TaxelSample {
    /// The oldest that a taxel's reading may become; nothing where the daemon says none.
    #[must_use]
    pub fn max_age(&self) -> Duration {
        limit(self.max_age_s)
    }
}

fn limit(max_age_s: f64) -> Duration {
    Duration::try_from_secs_f64(max_age_s).unwrap_or(Duration::ZERO)
}

/// How long ago a message was sent, by the wall clocks of both machines: on one machine they are the same clock, and
/// others keep time by NTP or PTP. Zero where the sender's clock is ahead.
#[must_use]
pub fn on_the_way(sent: Option<&Timestamp>, received: SystemTime) -> Duration {
    let Some(sent) = sent.and_then(|sent| SystemTime::try_from(*sent).ok()) else { return Duration::MAX };
    received.duration_since(sent).unwrap_or_default()
}

/// What is left of a sample that is not a force, with the reason: its time, what it is of, and STALE.
#[must_use]
pub fn withheld(sample: &ForceSample, code: ReasonCode, reason: String) -> ForceSample {
    ForceSample {
        sequence: sample.sequence,
        state: ForceState::Stale.into(),
        age_s: sample.age_s,
        monotonic_ns: sample.monotonic_ns,
        time: sample.time,
        sent: sample.sent,
        skipped: sample.skipped,
        excluded: sample.excluded,
        model_set: sample.model_set.clone(),
        max_age_s: sample.max_age_s,
        patch: sample.patch.clone(),
        simulated: sample.simulated,
        reasons: vec![reason],
        causes: vec![ForceReason { code: code.into(), ..ForceReason::default() }],
        ..ForceSample::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(text: &str) -> Option<f64> {
        (!text.is_empty()).then(|| text.parse().unwrap())
    }

    #[test]
    fn every_case_of_the_table_is_judged_as_it_says() {
        for line in include_str!("judge.csv").lines().skip(1) {
            let [state, total_n, age_s, max_age_s, waited_s, own_s, verdict]: [&str; 7] =
                line.split(',').collect::<Vec<_>>().try_into().unwrap();
            let sample = ForceSample {
                state: ForceState::from_str_name(&format!("FORCE_STATE_{state}")).unwrap().into(),
                total_n: number(total_n),
                age_s: number(age_s),
                max_age_s: number(max_age_s).unwrap(),
                ..ForceSample::default()
            };
            let span = |text| number(text).map(Duration::from_secs_f64);
            let judged = match judge(&sample, span(waited_s).unwrap(), span(own_s)) {
                Ok(_) => "FORCE",
                Err(NoForce::State(..)) => "STATE",
                Err(NoForce::TooOld(..)) => "TOO_OLD",
            };
            assert_eq!(judged, verdict, "{line}");
        }
    }

    #[test]
    fn a_refusal_says_state_and_reasons_or_both_ages() {
        let sample = ForceSample {
            state: ForceState::TareInvalid.into(),
            reasons: vec!["no zero has been taken yet".to_owned()],
            causes: vec![ForceReason { code: ReasonCode::ZeroNotTaken.into(), ..ForceReason::default() }],
            ..ForceSample::default()
        };
        let why = judge(&sample, Duration::ZERO, None).unwrap_err();
        assert_eq!(why.to_string(), "TARE_INVALID: no zero has been taken yet");
        assert_eq!(why.code(), ReasonCode::ZeroNotTaken);
        let why = NoForce::TooOld(Duration::from_micros(120_600), Duration::from_millis(120));
        assert_eq!((why.to_string().as_str(), why.code()), ("121 ms old, more than 120 ms", ReasonCode::FrameOld));
    }

    #[test]
    fn the_time_on_the_way_is_that_between_the_wall_clocks_and_never_less_than_none() {
        let at = |seconds| SystemTime::UNIX_EPOCH + Duration::from_secs(seconds);
        let sent = Timestamp::from(at(1_000));
        assert_eq!(on_the_way(Some(&sent), at(1_003)), Duration::from_secs(3));
        assert_eq!(on_the_way(Some(&sent), at(999)), Duration::ZERO, "the sender's clock is ahead");
        assert_eq!(on_the_way(None, at(999)), Duration::MAX, "a sample that does not say it");
    }
}
