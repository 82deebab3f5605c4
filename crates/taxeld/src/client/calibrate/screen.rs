//! The calibration as lines: one a second, and one at each change.

use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

use taxel_proto::v1::{Session, SessionState};

use crate::client::failure::Outcome;
use crate::client::json;
use crate::client::places::Places;
use crate::client::sessions::{refused, session_word};
use taxel_files::say::error_line;

/// Lines come so often while nothing changes.
const LINE_EVERY: Duration = Duration::from_secs(1);
/// From this share of the target on it is told which taxels have not moved: before, most of them cannot have.
const NAMED_FROM: f64 = 0.5;
/// A rate of less than this is no movement, in kPa/s.
const STANDS_KPA_PER_S: f64 = 0.05;
/// Below this pressure the ramp has not begun.
const BEGUN_KPA: f64 = 2.0;
/// From this share of the limit on the pressure changes fast.
const NEAR_LIMIT: f64 = 0.9;

/// Where the calibration is shown.
pub struct Screen {
    /// Where the taxels are.
    pub places: Places,
    json: bool,
    /// What was shown last, and when.
    last: Option<(Instant, Shown)>,
    /// The taxels that were named last as not responding.
    named: String,
}

/// What makes a line due when it changes: the state, the branch, the advice.
type Shown = (SessionState, bool, String);

impl Screen {
    /// A screen; `json` for a line of JSON a message instead.
    pub fn new(places: Places, json: bool) -> Self {
        Self { places, json, last: None, named: String::new() }
    }

    /// Shows a session as it is now.
    ///
    /// # Errors
    /// A session that is no JSON.
    pub fn show(&mut self, session: &Session) -> Outcome {
        if self.json {
            return json::print("Session", session);
        }
        let (at, shown) = (Instant::now(), (session.state(), session.falling, advice(session)));
        let last = self.last.as_ref();
        if last.is_some_and(|(_, (state, falling, _))| {
            *state == SessionState::Ramping && (*state, *falling) != (shown.0, shown.1)
        }) {
            bell();
        }
        if last.is_some_and(|(before, last)| *last == shown && at - *before < LINE_EVERY) {
            return Ok(());
        }
        let silent = self.silent(session);
        let news = if silent == self.named { "" } else { silent.as_str() };
        say!("{}", line(session, news));
        self.named = silent;
        self.last = Some((at, shown));
        Ok(())
    }

    /// Says that nobody may pump on: the pressure may be another one by now.
    pub fn stop(&mut self, why: &str) {
        self.last = None; // what comes next is told anew
        self.tell(&format!("stop pumping: {why}"));
        bell();
    }

    /// Says something beside the lines of the session.
    pub fn tell(&self, text: &str) {
        match self.json {
            true => error_line(format_args!("{text}")),
            false => say!("{text}"),
        }
    }

    /// The taxels that do not respond, by place, once the pressure is high enough to tell.
    fn silent(&self, session: &Session) -> String {
        let high = session.pressure_kpa.is_some_and(|kpa| kpa > NAMED_FROM * session.target_kpa);
        if high || session.falling { self.places.name(session.not_responding.iter().copied()) } else { String::new() }
    }
}

/// Rings the terminal's bell, where there is a terminal.
pub fn bell() {
    let mut out = std::io::stderr();
    if out.is_terminal() {
        let _ = out.write_all(b"\x07").and_then(|()| out.flush());
    }
}

/// What is shown of a session.
fn line(session: &Session, silent: &str) -> String {
    let state = session_word(session.state());
    match session.state() {
        SessionState::Ramping => {
            let left = session.remaining_s.map_or_else(String::new, |left| format!(", {left:.0} s left"));
            let coverage = format!("coverage {:.0} %{left}", 100.0 * session.coverage);
            let not = if silent.is_empty() { String::new() } else { format!("; not: {silent}") };
            let taxels = format!("{} of {} taxels respond{not}", session.taxels_responding, session.taxels);
            format!("{state} {}; {coverage}; {taxels}; {}", pressure(session), advice(session))
        }
        SessionState::Review => {
            format!("{state} {} scans used; not used: {}", session.accepted, refused(session))
        }
        _ => format!("{state} {}", advice(session)),
    }
}

fn pressure(session: &Session) -> String {
    let limit = if session.falling { session.fall_max_kpa_per_s } else { session.rise_max_kpa_per_s };
    let kpa = session.pressure_kpa.map_or_else(|| "-".to_owned(), |kpa| format!("{kpa:.1}"));
    let rate = session.rate_kpa_per_s.map_or_else(|| "-".to_owned(), |rate| format!("{rate:+.2}"));
    format!("{kpa} of {:.0} kPa, {rate} kPa/s of {limit:.1}", session.target_kpa)
}

/// What an operator at the pump is to do now, in the daemon's own words where it has some.
fn advice(session: &Session) -> String {
    let rate = session.rate_kpa_per_s.unwrap_or(0.0);
    let advice = match (session.state(), session.pressure_kpa) {
        (SessionState::Fitting, _) => "fitting the models",
        (SessionState::Ramping, _) if session.typed.is_some() => &session.reason,
        (SessionState::Ramping, None) => "no pressure reading: is the gauge on?",
        (SessionState::Ramping, _) if session.falling && -rate > NEAR_LIMIT * session.fall_max_kpa_per_s => "slower",
        (SessionState::Ramping, _) if session.falling && rate < -STANDS_KPA_PER_S => "go on",
        (SessionState::Ramping, _) if session.falling => "let air in slowly",
        _ if !session.reason.is_empty() => &session.reason,
        (SessionState::Taring, _) => "hands off: the zero is being taken",
        (SessionState::Ramping, _) if rate > NEAR_LIMIT * session.rise_max_kpa_per_s => "slower",
        (SessionState::Ramping, _) if rate > STANDS_KPA_PER_S => "go on",
        (SessionState::Ramping, Some(kpa)) if kpa < BEGUN_KPA => "pump: lower the pressure in the bag slowly",
        (SessionState::Ramping, _) if rate < -STANDS_KPA_PER_S => "leak: the pressure falls",
        (SessionState::Ramping, _) => "the pressure stands: pump on",
        _ => "",
    };
    advice.to_owned()
}

#[cfg(test)]
mod tests {
    use taxel_proto::v1::TypedPlateaus;

    use super::*;

    fn ramping(kpa: f64, rate: f64) -> Session {
        Session {
            state: SessionState::Ramping.into(),
            pressure_kpa: Some(kpa),
            rate_kpa_per_s: Some(rate),
            rise_max_kpa_per_s: 5.0,
            fall_max_kpa_per_s: 2.0,
            target_kpa: 70.0,
            ..Session::default()
        }
    }

    #[test]
    fn each_branch_is_guided_by_its_rate_and_other_states_by_the_daemons_words() {
        for (kpa, rate, expected) in [
            (0.1, 0.0, "pump: lower the pressure in the bag slowly"),
            (1.0, 1.0, "go on"),
            (10.0, 4.4, "go on"),
            (20.0, 4.6, "slower"),
            (30.0, 0.01, "the pressure stands: pump on"),
            (29.8, -0.2, "leak: the pressure falls"),
        ] {
            assert_eq!(advice(&ramping(kpa, rate)), expected, "{kpa} kPa at {rate} kPa/s");
        }
        for (rate, expected) in [(-1.0, "go on"), (-1.9, "slower"), (0.0, "let air in slowly")] {
            assert_eq!(advice(&Session { falling: true, ..ramping(40.0, rate) }), expected, "{rate} kPa/s");
        }
        let words = "the skin has settled: read the dial".to_owned();
        let dial = Session { typed: Some(TypedPlateaus::default()), reason: words.clone(), ..ramping(40.0, 0.0) };
        assert_eq!(advice(&dial), words, "where a dial is typed the daemon says what to do");
        let mut session = Session { state: SessionState::Taring.into(), ..Session::default() };
        assert_eq!(advice(&session), "hands off: the zero is being taken");
        session.reason = "waiting for an unloaded skin: it moves".to_owned();
        assert_eq!(advice(&session), "waiting for an unloaded skin: it moves");
    }
}
