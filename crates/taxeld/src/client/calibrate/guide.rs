//! What an operator at the pump is to do now, from what the session tells.

use taxel_proto::v1::{Session, SessionState};

/// A rate of less than this is no movement, in kPa/s.
const STANDS_KPA_PER_S: f64 = 0.05;
/// The pressure fell by so much below the highest of the ramp: a leak, or the pump runs backwards.
const LEAK_KPA: f64 = 1.0;
/// Below this pressure the ramp has not begun.
const BEGUN_KPA: f64 = 2.0;
/// From this share of the limit on the pressure changes fast.
const NEAR_LIMIT: f64 = 0.9;

/// What to do now.
#[derive(Clone, Debug, PartialEq)]
pub enum Advice {
    /// Touch nothing: the skin is watched for its zero; why it is not at rest yet, if so.
    HandsOff(String),
    /// Begin to lower the pressure in the bag.
    Pump,
    /// The rate is right.
    GoOn,
    /// The rate is near its limit or beyond it.
    Slower,
    /// The pressure stands before the end of the branch; why, and what can be done, where the daemon says so.
    Stands(String),
    /// The pressure falls on the rising branch.
    Leak,
    /// Let air in slowly.
    LetAirIn,
    /// No pressure reading comes.
    NoGauge,
    /// Nothing new comes from the daemon, and why.
    Stop(String),
    /// Models are being computed.
    Fitting,
    /// Nothing: the session is not under way.
    Nothing,
}

impl Advice {
    /// The advice in words.
    pub fn words(&self) -> String {
        match self {
            Self::HandsOff(reason) if reason.is_empty() => "hands off: the zero is being taken".to_owned(),
            Self::HandsOff(reason) => reason.clone(),
            Self::Pump => "pump: lower the pressure in the bag slowly".to_owned(),
            Self::GoOn => "go on".to_owned(),
            Self::Slower => "slower".to_owned(),
            Self::Stands(reason) if reason.is_empty() => "the pressure stands: pump on".to_owned(),
            Self::Stands(reason) => reason.clone(),
            Self::Leak => "leak: the pressure falls".to_owned(),
            Self::LetAirIn => "let air in slowly".to_owned(),
            Self::NoGauge => "no pressure reading: is the gauge on?".to_owned(),
            Self::Stop(why) => format!("stop pumping: nothing new comes from the daemon: {why}"),
            Self::Fitting => "fitting the models".to_owned(),
            Self::Nothing => String::new(),
        }
    }
}

/// Follows one ramp.
#[derive(Clone, Copy, Debug, Default)]
pub struct Guide {
    /// Highest pressure of the ramp so far.
    highest_kpa: f64,
    ramp: u32,
}

impl Guide {
    /// What to do now.
    pub fn advise(&mut self, session: &Session) -> Advice {
        match session.state() {
            SessionState::Taring => return Advice::HandsOff(session.reason.clone()),
            SessionState::Fitting => return Advice::Fitting,
            SessionState::Ramping => {}
            _ => return Advice::Nothing,
        }
        if std::mem::replace(&mut self.ramp, session.ramps) != session.ramps {
            self.highest_kpa = 0.0;
        }
        let Some(kpa) = session.pressure_kpa else { return Advice::NoGauge };
        self.highest_kpa = self.highest_kpa.max(kpa);
        let rate = session.rate_kpa_per_s.unwrap_or(0.0);
        match session.falling {
            true => falling(session, rate),
            false if !session.reason.is_empty() => Advice::Stands(session.reason.clone()),
            false => self.rising(session, kpa, rate),
        }
    }

    fn rising(&self, session: &Session, kpa: f64, rate: f64) -> Advice {
        if rate > NEAR_LIMIT * session.rise_max_kpa_per_s {
            Advice::Slower
        } else if kpa < self.highest_kpa - LEAK_KPA || (kpa > BEGUN_KPA && rate < -STANDS_KPA_PER_S) {
            Advice::Leak
        } else if rate > STANDS_KPA_PER_S {
            Advice::GoOn
        } else if kpa < BEGUN_KPA {
            Advice::Pump
        } else {
            Advice::Stands(String::new())
        }
    }
}

fn falling(session: &Session, rate: f64) -> Advice {
    if -rate > NEAR_LIMIT * session.fall_max_kpa_per_s {
        Advice::Slower
    } else if rate < -STANDS_KPA_PER_S {
        Advice::GoOn
    } else {
        Advice::LetAirIn
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramping(kpa: f64, rate: f64) -> Session {
        Session {
            state: SessionState::Ramping.into(),
            ramps: 1,
            pressure_kpa: Some(kpa),
            rate_kpa_per_s: Some(rate),
            rise_max_kpa_per_s: 5.0,
            fall_max_kpa_per_s: 2.0,
            ..Session::default()
        }
    }

    #[test]
    fn the_rising_branch_is_guided_by_rate_and_highest_pressure() {
        let mut guide = Guide::default();
        for (kpa, rate, advice) in [
            (0.1, 0.0, Advice::Pump),
            (1.0, 1.0, Advice::GoOn),
            (10.0, 4.4, Advice::GoOn),
            (20.0, 4.6, Advice::Slower),
            (30.0, 0.01, Advice::Stands(String::new())),
            (29.8, -0.2, Advice::Leak),
            (28.9, 0.0, Advice::Leak),
            (31.0, 2.0, Advice::GoOn),
        ] {
            assert_eq!(guide.advise(&ramping(kpa, rate)), advice, "{kpa} kPa at {rate} kPa/s");
        }
        let next = Session { ramps: 2, ..ramping(0.5, 1.0) };
        assert_eq!(guide.advise(&next), Advice::GoOn, "a further ramp begins at its own zero");
    }

    #[test]
    fn the_falling_branch_has_its_own_limit() {
        let mut guide = Guide::default();
        for (rate, advice) in
            [(-1.0, Advice::GoOn), (-1.9, Advice::Slower), (0.0, Advice::LetAirIn), (0.5, Advice::LetAirIn)]
        {
            let session = Session { falling: true, ..ramping(40.0, rate) };
            assert_eq!(guide.advise(&session), advice, "{rate} kPa/s");
        }
    }

    #[test]
    fn outside_of_a_ramp_the_advice_follows_the_state() {
        let mut guide = Guide::default();
        let mut session = Session { state: SessionState::Taring.into(), ..Session::default() };
        assert_eq!(guide.advise(&session).words(), "hands off: the zero is being taken");
        session.reason = "waiting for rest: restless".to_owned();
        assert_eq!(guide.advise(&session).words(), "waiting for rest: restless");
        session.state = SessionState::Ramping.into();
        assert_eq!(guide.advise(&session), Advice::NoGauge);
        session.state = SessionState::Review.into();
        assert_eq!(guide.advise(&session), Advice::Nothing);
    }
}
