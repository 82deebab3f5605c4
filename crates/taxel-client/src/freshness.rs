//! Whether a force may still be acted on, as its receiver judges it.
//!
//! Only OK and DEGRADED are forces. The age is the sample's age when it was sent, plus the time that it was on its way
//! ([`DaemonClock`]), plus the time that passed here since it came.

use std::fmt;
use std::time::Duration;

use taxel_proto::v1::{ForceReason, ForceSample, ForceState, ReasonCode};

use crate::clock::DaemonClock;
use crate::moment::Moment;

/// What a stream has shown of the daemon's clock against ours.
#[derive(Clone, Debug, Default)]
pub struct Reader {
    clock: DaemonClock,
}

/// A sample and when it came.
#[derive(Clone, Debug)]
pub struct Received {
    sample: ForceSample,
    at: Moment,
    delayed: Duration,
}

/// A force that may be acted on.
#[derive(Clone, Debug)]
pub struct Force {
    /// Total normal force in N.
    pub total_n: f64,
    /// Its age, at least the true one.
    pub age: Duration,
    /// All that came with it.
    pub sample: ForceSample,
}

/// Why there is no force to act on.
#[derive(Clone, Debug, PartialEq)]
pub enum NoForce {
    /// No sample has come yet; with what is wrong with the connection, if something is.
    NothingYet(Option<String>),
    /// The state carries none; with the reasons for people and, as many and in the same order, for programs.
    State(ForceState, Vec<String>, Vec<ReasonCode>),
    /// It is so old, and the limit is the second.
    TooOld(Duration, Duration),
    /// There is none, or it is too old, and the stream was lost.
    Lost(String),
}

impl fmt::Display for NoForce {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NothingYet(None) => write!(f, "no sample yet"),
            Self::NothingYet(Some(why)) => write!(f, "no sample yet: {why}"),
            Self::State(state, reasons, _) => write!(f, "{}: {}", word(*state), reasons.join("; ")),
            Self::TooOld(age, limit) => {
                write!(f, "{:.0} ms old, more than {} ms", age.as_secs_f64() * 1e3, limit.as_millis())
            }
            Self::Lost(why) => write!(f, "the stream was lost: {why}"),
        }
    }
}

/// The state's name without its prefix.
#[must_use]
pub fn word(state: ForceState) -> &'static str {
    let name = state.as_str_name();
    name.strip_prefix("FORCE_STATE_").unwrap_or(name)
}

/// When the daemon sent this, in seconds of its own clock.
fn sent_s(sample: &ForceSample) -> Option<f64> {
    Some(sample.monotonic_ns? as f64 * 1e-9 + sample.age_s?)
}

impl Reader {
    /// A question left at `left`, and this is the answer: it was sent later.
    pub fn asked(&mut self, left: Moment, answer: &ForceSample) {
        self.clock.asked(left, sent_s(answer));
    }

    /// Whether an answer has shown the daemon's clock.
    #[must_use]
    pub const fn knows_the_clock(&self) -> bool {
        self.clock.is_known()
    }

    /// Takes the next sample of the stream, which came at `at`.
    pub fn take(&mut self, sample: ForceSample, at: Moment) -> Received {
        let delayed = self.clock.delay(at, sent_s(&sample));
        Received { sample, at, delayed }
    }
}

impl Received {
    /// The sample.
    #[must_use]
    pub const fn sample(&self) -> &ForceSample {
        &self.sample
    }

    /// Its age now; `None` if no frame has come to the daemon yet.
    #[must_use]
    pub fn age(&self, now: Moment) -> Option<Duration> {
        // An age that is no time at all is as bad as an old one.
        let sent_with = Duration::try_from_secs_f64(self.sample.age_s?).unwrap_or(Duration::MAX);
        Some(sent_with.saturating_add(self.delayed).saturating_add(now.since(self.at)))
    }

    /// The force in newton and its age. `own`: the reader's own limit, where it has a stricter one than the daemon.
    ///
    /// # Errors
    /// [`NoForce`]: why it is not to be acted on.
    pub fn usable(&self, now: Moment, own: Option<Duration>) -> Result<(f64, Duration), NoForce> {
        let sample = &self.sample;
        let good = matches!(sample.state(), ForceState::Ok | ForceState::Degraded);
        let newton = sample.total_n.filter(|newton| newton.is_finite());
        let (Some(newton), Some(age), true) = (newton, self.age(now), good) else {
            let codes = sample.causes.iter().map(ForceReason::code).collect();
            return Err(NoForce::State(sample.state(), sample.reasons.clone(), codes));
        };
        let limit = sample.max_age(own);
        if age > limit { Err(NoForce::TooOld(age, limit)) } else { Ok((newton, age)) }
    }
}

/// What is left of a sample that must not be believed, and why that is so.
#[must_use]
pub fn withheld(sample: &ForceSample, code: ReasonCode, reason: String) -> ForceSample {
    let cause = ForceReason { code: code.into(), ..ForceReason::default() };
    ForceSample { reasons: vec![reason], causes: vec![cause], ..without_force(sample) }
}

/// A sample without its force: its time, what it is of, and STALE.
#[must_use]
pub fn without_force(sample: &ForceSample) -> ForceSample {
    ForceSample {
        sequence: sample.sequence,
        state: ForceState::Stale.into(),
        monotonic_ns: sample.monotonic_ns,
        time: sample.time,
        excluded: sample.excluded,
        uncovered_share: 1.0,
        model_set: sample.model_set.clone(),
        max_age_s: sample.max_age_s,
        patch: sample.patch.clone(),
        ..ForceSample::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(state: ForceState, sent_ms: i64, age_ms: i64) -> ForceSample {
        ForceSample {
            state: state.into(),
            total_n: Some(4.9),
            age_s: Some(age_ms as f64 * 1e-3),
            max_age_s: 0.12,
            monotonic_ns: Some((sent_ms - age_ms) * 1_000_000),
            ..ForceSample::default()
        }
    }

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn a_force_grows_old_while_nothing_comes() {
        let begun = Moment::now();
        let received = Reader::default().take(sample(ForceState::Ok, 5_000, 20), begun);
        let (newton, age) = received.usable(begun + ms(80), None).unwrap();
        assert_eq!((newton, age.as_millis()), (4.9, 100));
        let why = received.usable(begun + ms(101), None).unwrap_err();
        assert_eq!(why.to_string(), "121 ms old, more than 120 ms");
        let stricter = received.usable(begun + ms(31), Some(ms(50))).unwrap_err();
        assert_eq!(stricter.to_string(), "51 ms old, more than 50 ms");
    }

    #[test]
    fn a_sample_that_waited_on_its_way_is_older_than_it_says() {
        let begun = Moment::now();
        let mut reader = Reader::default();
        reader.take(sample(ForceState::Ok, 5_000, 20), begun);
        let at = begun + ms(350);
        let late = reader.take(sample(ForceState::Ok, 5_050, 20), at);
        // By a quarter of a millisecond the clocks may have parted meanwhile.
        assert_eq!(late.age(at).unwrap().as_micros(), 319_790);
        assert!(matches!(late.usable(at, None), Err(NoForce::TooOld(..))));
    }

    #[test]
    fn after_a_question_also_the_first_sample_that_waited_is_known_as_old() {
        let begun = Moment::now();
        let mut reader = Reader::default();
        reader.asked(begun, &sample(ForceState::Ok, 5_002, 20)); // 2 ms on its way there at most
        // The first sample of the stream was sent 10 ms later and came after 500 ms.
        let at = begun + ms(510);
        let late = reader.take(sample(ForceState::Ok, 5_010, 20), at);
        let age = late.age(at).unwrap();
        assert!(age >= ms(520) && age < ms(525), "{age:?}: 20 ms when it was sent, 500 ms on the way, 2 ms unknown");
        assert!(late.usable(at, None).is_err());
    }

    #[test]
    fn clocks_that_part_make_no_force_old_for_ever_and_none_younger_than_it_is() {
        let begun = Moment::now();
        for drift in [-5e-4, 0.0, 5e-4] {
            let mut reader = Reader::default();
            for second in 0..3_600_u64 {
                let at = begun + Duration::from_secs(second);
                let theirs_ms = 5_000 + ((second as f64) * 1e3 * (1.0 + drift)) as i64;
                if second % 10 == 0 {
                    reader.asked(at, &sample(ForceState::Ok, theirs_ms, 20));
                }
                let age = reader.take(sample(ForceState::Ok, theirs_ms, 20), at).age(at).unwrap();
                assert!(age >= ms(19) && age <= ms(33), "{drift}: {age:?} after {second} s");
            }
        }
    }

    /// The daemon's machine sleeps for an hour, and its clock with it. What was sent before waits in a buffer; the next question is
    /// asked, and answered, before it is looked at.
    #[test]
    fn what_was_sent_before_a_sleep_of_the_daemon_is_old_after_it() {
        let begun = Moment::now();
        let mut reader = Reader::default();
        reader.asked(begun, &sample(ForceState::Ok, 5_000, 20));
        let woke = begun + Duration::from_secs(3_600);
        reader.asked(woke, &sample(ForceState::Ok, 5_400, 20));
        for sent_ms in [5_100, 5_150, 5_399] {
            let age = reader.take(sample(ForceState::Ok, sent_ms, 20), woke).age(woke).unwrap();
            assert!(age > Duration::from_secs(3_500), "sent at {sent_ms} ms: {age:?}");
        }
        let at = woke + ms(30);
        let age = reader.take(sample(ForceState::Ok, 5_425, 20), at).age(at).unwrap();
        assert!(age < ms(50), "{age:?}");
    }

    /// Ours stood still for a minute, as that of a machine does that another one holds up, and theirs did not.
    #[test]
    fn a_clock_of_ours_that_stood_still_makes_no_old_force_a_fresh_one() {
        let begun = Moment::now();
        let mut reader = Reader::default();
        reader.asked(begun, &sample(ForceState::Ok, 5_000, 20));
        let at = begun + ms(50);
        let late = reader.take(sample(ForceState::Ok, 35_000, 20), at);
        assert!(late.usable(at, None).is_err() && !reader.knows_the_clock());
        reader.asked(at, &sample(ForceState::Ok, 65_001, 20));
        let late = reader.take(sample(ForceState::Ok, 35_050, 20), at);
        assert!(late.age(at).unwrap() > Duration::from_secs(29));
    }

    /// Of a fleet nobody can ask for the clock.
    #[test]
    fn without_a_question_clocks_that_part_make_no_force_old_for_ever() {
        let begun = Moment::now();
        for drift in [-5e-4, 0.0, 5e-4] {
            let mut reader = Reader::default();
            for second in 0..36_000_u64 {
                let at = begun + Duration::from_secs(second);
                let theirs_ms = 5_000 + ((second as f64) * 1e3 * (1.0 + drift)) as i64;
                let age = reader.take(sample(ForceState::Ok, theirs_ms, 20), at).age(at).unwrap();
                assert!(age <= ms(22), "{drift}: {age:?} after {second} s");
            }
        }
    }

    #[test]
    fn a_state_without_a_force_and_figures_that_are_no_numbers_are_refused() {
        let now = Moment::now();
        for state in [ForceState::Stale, ForceState::TareInvalid, ForceState::Uncalibrated, ForceState::Unspecified] {
            let cause = ForceReason { code: ReasonCode::ZeroLost.into(), ..ForceReason::default() };
            let (reasons, causes) = (vec!["why".to_owned()], vec![cause]);
            let told = ForceSample { reasons: reasons.clone(), causes, ..sample(state, 5_000, 1) };
            let received = Reader::default().take(told, now);
            let expected = NoForce::State(state, reasons, vec![ReasonCode::ZeroLost]);
            assert_eq!(received.usable(now, None), Err(expected));
        }
        for odd in [f64::NAN, f64::INFINITY, -1.0] {
            let of = |odd| Reader::default().take(odd, now).usable(now, None);
            assert!(of(ForceSample { age_s: Some(odd), ..sample(ForceState::Ok, 5_000, 1) }).is_err(), "{odd}");
        }
        let odd = ForceSample { total_n: Some(f64::NAN), ..sample(ForceState::Ok, 5_000, 1) };
        assert!(Reader::default().take(odd, now).usable(now, None).is_err());
    }
}
