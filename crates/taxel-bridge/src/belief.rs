//! Whether a force may go out as one: decided where it leaves, by the clock of who sends it.

use std::fmt;
use std::time::Duration;

use taxel_proto::judge::withheld;
use taxel_proto::v1::{ForceSample, ForceState, ReasonCode, Vector3};

/// Why there is no force to send.
#[derive(Clone, Debug, PartialEq)]
pub enum NoForce {
    /// No sample has come yet.
    Nothing,
    /// The daemon itself has none.
    State {
        /// What it says instead.
        state: ForceState,
        /// Why.
        reasons: Vec<String>,
    },
    /// It was good once.
    TooOld {
        /// Its age by now.
        age: Duration,
        /// What is allowed.
        limit: Duration,
    },
    /// Its state promises a figure that is not there or is no number.
    NoFigure {
        /// Which field of the sample.
        field: &'static str,
    },
}

impl NoForce {
    /// The same for programs, where the sample does not say it itself.
    const fn code(&self) -> ReasonCode {
        match self {
            Self::Nothing => ReasonCode::NoFrame,
            Self::State { .. } => ReasonCode::Unspecified,
            Self::TooOld { .. } => ReasonCode::FrameOld,
            Self::NoFigure { .. } => ReasonCode::NoFigure,
        }
    }
}

impl fmt::Display for NoForce {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Nothing => write!(f, "no sample has come yet"),
            Self::State { state, reasons } => {
                let name = state.as_str_name().trim_start_matches("FORCE_STATE_");
                if reasons.is_empty() { write!(f, "{name}") } else { write!(f, "{name}: {}", reasons.join("; ")) }
            }
            Self::TooOld { age, limit } => {
                write!(f, "the sample is {:.2} s old, the limit is {} s", age.as_secs_f64(), limit.as_secs_f64())
            }
            Self::NoFigure { field } => write!(f, "the sample's `{field}` is missing or no finite number"),
        }
    }
}

/// The age of a sample that was sent with `age_s` and has waited here since. An age that is no time is as bad as an old
/// one.
pub fn age(age_s: f64, waited: Duration) -> Duration {
    Duration::try_from_secs_f64(age_s).map_or(Duration::MAX, |sent_with| sent_with.saturating_add(waited))
}

/// Decides whether a sample that has waited here for `waited` is a force, of at most the age `limit`. Its age, or why it
/// is none.
///
/// # Errors
/// Why there is no force.
pub fn believe(sample: &ForceSample, waited: Duration, limit: Duration) -> Result<Duration, NoForce> {
    let state = sample.state();
    if !matches!(state, ForceState::Ok | ForceState::Degraded) {
        return Err(NoForce::State { state, reasons: sample.reasons.clone() });
    }
    let age_s = sample.age_s.ok_or(NoForce::NoFigure { field: "age_s" })?;
    let age = age(age_s, waited);
    if age > limit {
        return Err(NoForce::TooOld { age, limit });
    }
    if sample.time.is_none() {
        return Err(NoForce::NoFigure { field: "time" });
    }
    if !sample.total_n.is_some_and(f64::is_finite) {
        return Err(NoForce::NoFigure { field: "total_n" });
    }
    let vector = |v: &Option<Vector3>| v.is_none_or(|v| [v.x, v.y, v.z].into_iter().all(f64::is_finite));
    let scalar = |v: Option<f64>| v.is_none_or(f64::is_finite);
    for (field, finite) in [
        ("total_sigma_n", scalar(sample.total_sigma_n)),
        ("detection_floor_n", scalar(sample.detection_floor_n)),
        ("resultant_n", vector(&sample.resultant_n)),
        ("moment_nm", vector(&sample.moment_nm)),
        ("centre_of_pressure_m", vector(&sample.centre_of_pressure_m)),
    ] {
        if !finite {
            return Err(NoForce::NoFigure { field });
        }
    }
    Ok(age)
}

/// The oldest that a sample may become.
pub fn limit_of(sample: &ForceSample) -> Duration {
    Duration::try_from_secs_f64(sample.max_age_s).unwrap_or_default()
}

/// The sample as it may go on, with its age by now: with no figure of the force if it is none.
pub fn passed_on(sample: &ForceSample, waited: Duration) -> ForceSample {
    let age_s = sample.age_s.map(|age_s| age(age_s, waited).as_secs_f64());
    match believe(sample, waited, limit_of(sample)) {
        Ok(_) => ForceSample { age_s, ..sample.clone() },
        Err(NoForce::State { state, reasons }) => {
            let causes = sample.causes.clone();
            let none = withheld(sample, ReasonCode::Unspecified, String::new());
            ForceSample { age_s, state: state.into(), stale: sample.stale, reasons, causes, ..none }
        }
        Err(why) => ForceSample { age_s, ..withheld(sample, why.code(), why.to_string()) },
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use taxel_proto::Timestamp;
    use taxel_proto::v1::ForceReason;

    const LIMIT: Duration = Duration::from_millis(150);

    fn codes(sample: &ForceSample) -> Vec<ReasonCode> {
        sample.causes.iter().map(ForceReason::code).collect()
    }

    /// A good sample of 4.9 N.
    pub(crate) fn good() -> ForceSample {
        let vector = |x, y, z| Some(Vector3 { x, y, z });
        ForceSample {
            sequence: 7,
            state: ForceState::Ok.into(),
            total_n: Some(4.9),
            total_sigma_n: Some(0.5),
            age_s: Some(0.02),
            max_age_s: 0.15,
            monotonic_ns: Some(1),
            sent: Some(std::time::SystemTime::now().into()),
            time: Some(Timestamp { seconds: 1_700_000_000, nanos: 5 }),
            resultant_n: vector(1.0, -2.0, 3.0),
            moment_nm: vector(0.1, 0.2, 0.3),
            centre_of_pressure_m: vector(0.01, 0.02, 0.03),
            patch: "left_forearm".into(),
            model_set: "m-1".into(),
            ..ForceSample::default()
        }
    }

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn a_force_is_believed_until_its_age_and_its_wait_pass_the_limit() {
        assert_eq!(believe(&good(), ms(0), LIMIT), Ok(ms(20)));
        assert_eq!(believe(&good(), ms(130), LIMIT), Ok(LIMIT));
        assert_eq!(believe(&good(), ms(131), LIMIT), Err(NoForce::TooOld { age: ms(151), limit: LIMIT }));
        for age_s in [f64::NAN, f64::INFINITY, -1.0] {
            let sample = ForceSample { age_s: Some(age_s), ..good() };
            assert!(matches!(believe(&sample, ms(0), LIMIT), Err(NoForce::TooOld { .. })), "{age_s}");
        }
    }

    #[test]
    fn only_ok_and_degraded_are_forces_whatever_figures_come_along() {
        for state in 0..=5 {
            let sample = ForceSample { state, reasons: vec!["why".into()], ..good() };
            let believed = believe(&sample, ms(0), LIMIT);
            assert_eq!(believed.is_ok(), state == 1 || state == 2, "{state}: {believed:?}");
        }
        let unknown = ForceSample { state: 99, ..good() };
        assert!(believe(&unknown, ms(0), LIMIT).is_err());
        let cause = ForceReason { code: ReasonCode::RestNotProven.into(), ..ForceReason::default() };
        let (reasons, causes) = (vec!["no rest".into()], vec![cause]);
        let tare = ForceSample { state: ForceState::TareInvalid.into(), reasons, causes, ..good() };
        let sent = passed_on(&tare, ms(0));
        assert_eq!((sent.state(), sent.total_n, sent.resultant_n), (ForceState::TareInvalid, None, None));
        assert_eq!(sent.reasons, ["no rest"]);
        assert_eq!(codes(&sent), [ReasonCode::RestNotProven], "as the daemon has it");
        assert_eq!(believe(&tare, ms(0), LIMIT).unwrap_err().to_string(), "TARE_INVALID: no rest");
    }

    #[test]
    fn a_figure_that_is_no_number_takes_the_whole_force_along() {
        let none = Some(Vector3 { x: 0.0, y: f64::NAN, z: 0.0 });
        let cases = [
            ("total_n", ForceSample { total_n: None, ..good() }),
            ("total_n", ForceSample { total_n: Some(f64::NAN), ..good() }),
            ("total_n", ForceSample { total_n: Some(f64::INFINITY), ..good() }),
            ("total_sigma_n", ForceSample { total_sigma_n: Some(f64::NAN), ..good() }),
            ("detection_floor_n", ForceSample { detection_floor_n: Some(f64::NAN), ..good() }),
            ("resultant_n", ForceSample { resultant_n: none, ..good() }),
            ("moment_nm", ForceSample { moment_nm: none, ..good() }),
            ("centre_of_pressure_m", ForceSample { centre_of_pressure_m: none, ..good() }),
            ("age_s", ForceSample { age_s: None, ..good() }),
            ("time", ForceSample { time: None, ..good() }),
        ];
        for (field, sample) in cases {
            assert_eq!(believe(&sample, ms(0), LIMIT), Err(NoForce::NoFigure { field }));
            let sent = passed_on(&sample, ms(0));
            assert_eq!((sent.state(), sent.total_n, sent.resultant_n), (ForceState::Stale, None, None), "{field}");
            assert_eq!(codes(&sent), [ReasonCode::NoFigure], "{field}");
        }
    }

    #[test]
    fn what_goes_on_carries_its_age_and_loses_its_figures_when_it_is_too_old() {
        let sent = passed_on(&good(), ms(30));
        assert_eq!((sent.age_s, sent.total_n, sent.state()), (Some(0.05), Some(4.9), ForceState::Ok));
        let sent = passed_on(&good(), ms(500));
        assert_eq!((sent.age_s, sent.total_n, sent.state()), (Some(0.52), None, ForceState::Stale));
        assert_eq!((sent.resultant_n, sent.moment_nm, sent.centre_of_pressure_m), (None, None, None));
        assert_eq!(sent.reasons, ["the sample is 0.52 s old, the limit is 0.15 s"]);
        assert_eq!(codes(&sent), [ReasonCode::FrameOld]);
        assert_eq!((sent.sequence, sent.patch.as_str(), sent.model_set.as_str()), (7, "left_forearm", "m-1"));
    }
}
