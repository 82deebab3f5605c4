//! A sample in a reader's hands, and when it came.

use std::fmt;
use std::time::{Duration, SystemTime};

use taxel_proto::judge::{self, aged, judge, on_the_way, withheld};
use taxel_proto::v1::ForceSample;

use crate::moment::Moment;

/// A sample and when it came.
#[derive(Clone, Debug)]
pub struct Received {
    sample: ForceSample,
    at: Moment,
    on_the_way: Duration,
}

/// A force that may be acted on.
#[derive(Clone, Debug)]
pub struct Force {
    /// Total normal force in N.
    pub total_n: f64,
    /// Its age, not less than the true one.
    pub age: Duration,
    /// All that came with it.
    pub sample: ForceSample,
}

/// Why there is no force to act on.
#[derive(Clone, Debug, PartialEq)]
pub enum NoForce {
    /// No sample has come yet; with what is wrong with the connection, if something is.
    NothingYet(Option<String>),
    /// The newest sample is not a force.
    Sample(judge::NoForce),
    /// The newest sample is not a force, and the stream was lost.
    Lost(String),
}

impl fmt::Display for NoForce {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NothingYet(None) => write!(f, "no sample yet"),
            Self::NothingYet(Some(why)) => write!(f, "no sample yet: {why}"),
            Self::Sample(why) => write!(f, "{why}"),
            Self::Lost(why) => write!(f, "the stream was lost: {why}"),
        }
    }
}

impl Received {
    /// A sample that came just now.
    #[must_use]
    pub fn now(sample: ForceSample) -> Self {
        let on_the_way = on_the_way(sample.sent.as_ref(), SystemTime::now());
        Self { sample, at: Moment::now(), on_the_way }
    }

    /// The sample.
    #[must_use]
    pub const fn sample(&self) -> &ForceSample {
        &self.sample
    }

    /// How long ago it was sent.
    #[must_use]
    pub fn waited(&self, now: Moment) -> Duration {
        self.on_the_way.saturating_add(now.since(self.at))
    }

    /// The force, as [`judge()`] has it. `own`: the reader's own limit, where it has a stricter one than the daemon.
    ///
    /// # Errors
    /// Why it is not to be acted on.
    pub fn force(&self, now: Moment, own: Option<Duration>) -> Result<judge::Force, judge::NoForce> {
        judge(&self.sample, self.waited(now), own)
    }

    /// The sample as it goes out now: with its age by now, and without any figure of the force once that is too old.
    #[must_use]
    pub fn told(&self, now: Moment) -> ForceSample {
        let age_s = self.sample.age_s.map(|age_s| aged(age_s, self.waited(now)).as_secs_f64());
        let sample = ForceSample { age_s, ..self.sample.clone() };
        match self.force(now, None) {
            Err(old @ judge::NoForce::TooOld(..)) => withheld(&sample, old.code(), old.to_string()),
            _ => sample,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_proto::Timestamp;
    use taxel_proto::v1::ForceState;

    /// A good sample that is 20 ms old when it is sent, so long ago.
    fn sent_ago(ago: Duration) -> ForceSample {
        ForceSample {
            state: ForceState::Ok.into(),
            total_n: Some(4.9),
            age_s: Some(0.02),
            max_age_s: 0.12,
            sent: Some(Timestamp::from(SystemTime::now() - ago)),
            ..ForceSample::default()
        }
    }

    #[test]
    fn a_sample_that_waited_on_its_way_is_older_than_it_says() {
        let received = Received::now(sent_ago(Duration::from_secs(3_600)));
        let Err(judge::NoForce::TooOld(age, _)) = received.force(received.at, None) else { panic!("{received:?}") };
        assert!(age >= Duration::from_secs(3_600), "{age:?}");
    }
}
