//! The calibration as a living screen on a terminal, else as plain lines: one a second, and one at each change.

use std::collections::BTreeMap;
use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget};
use taxel_proto::v1::{Session, SessionState};

use super::guide::{Advice, Guide};
use crate::client::failure::Outcome;
use crate::client::json;
use crate::client::places::Places;
use crate::client::sessions::refusals;
use crate::client::sessions::session_word;
use crate::client::text::style;

/// Plain lines come so often while nothing changes.
const LINE_EVERY: Duration = Duration::from_secs(1);
/// From this share of the target on it is told which taxels have not moved: before, most of them cannot have.
const NAMED_FROM: f64 = 0.5;

/// Where the calibration is shown.
pub struct Screen {
    /// By the names of the patches.
    places: BTreeMap<String, Places>,
    guide: Guide,
    /// On a terminal.
    living: Option<(MultiProgress, ProgressBar)>,
    json: bool,
    last: Option<Shown>,
}

/// What was shown last.
struct Shown {
    session: u64,
    at: Instant,
    state: SessionState,
    falling: bool,
    advice: Advice,
    silent: String,
}

impl Screen {
    /// A screen for patches with taxels at these places; `json` for a line of JSON a message instead.
    pub fn new(places: BTreeMap<String, Places>, json: bool) -> Self {
        let living = (!json && std::io::stderr().is_terminal()).then(|| {
            let all = MultiProgress::with_draw_target(ProgressDrawTarget::stderr());
            let lines = all.add(ProgressBar::new_spinner().with_style(style("{msg}")));
            (all, lines)
        });
        Self { places, guide: Guide::default(), living, json, last: None }
    }

    /// Shows a session as it is now, and was before: in full the one that leads, of another only that its state changed.
    ///
    /// # Errors
    /// A session that is no JSON.
    pub fn show(&mut self, session: &Session, before: &Session, leads: bool) -> Outcome {
        if self.json {
            return json::print("Session", session);
        }
        if leads {
            self.draw(session);
        } else if (session.state, session.falling) != (before.state, before.falling) {
            self.tell(&format!("{}: {} {}", session.patch, session_word(session.state()), session.reason));
        }
        Ok(())
    }

    fn draw(&mut self, session: &Session) {
        let advice = self.guide.advise(session);
        let (state, falling, at) = (session.state(), session.falling, Instant::now());
        // Another session may lead now.
        let last = self.last.take().filter(|last| last.session == session.session);
        let turned = last.as_ref().is_some_and(|last| {
            last.state == SessionState::Ramping && (last.state != state || last.falling != falling)
        });
        if turned {
            bell();
        }
        let changed =
            last.as_ref().is_none_or(|last| (last.state, last.falling) != (state, falling) || last.advice != advice);
        match &self.living {
            Some((_, lines)) => lines.set_message(picture(session, &advice, &self.silent(session))),
            None => {
                let due = last.as_ref().is_none_or(|last| at - last.at >= LINE_EVERY);
                if !changed && !due {
                    self.last = last;
                    return;
                }
                let silent = self.silent(session);
                // In a log the places are told when they change, not each second.
                let told = last.as_ref().is_some_and(|last| last.silent == silent && last.state == state);
                say!("{}", line(session, &advice, if told { "" } else { &silent }));
            }
        }
        let silent = self.silent(session);
        self.last = Some(Shown { session: session.session, at, state, falling, advice, silent });
    }

    /// Says that nothing new comes of a session, and shows nothing of it that may not be so any more.
    ///
    /// # Errors
    /// A session that is no JSON.
    pub fn stop(&mut self, session: &Session, why: String) -> Outcome {
        let (advice, unknown) =
            (Advice::Stop(why), Session { pressure_kpa: None, rate_kpa_per_s: None, ..session.clone() });
        self.last = None; // what comes next is told anew
        match &self.living {
            _ if self.json => return json::print("Session", &unknown),
            Some((_, lines)) => lines.set_message(picture(&unknown, &advice, "")),
            None => self.tell(&format!("{}: {}", session.patch, advice.words())),
        }
        bell();
        Ok(())
    }

    /// Says something beside the picture.
    pub fn tell(&self, text: &str) {
        match &self.living {
            Some((all, _)) => {
                let _ = all.println(text); // a terminal that has gone is noticed elsewhere
            }
            None if self.json => {}
            None => say!("{text}"),
        }
    }

    /// Takes the picture away for good; what is told from now on are plain lines.
    pub fn end(&mut self) {
        if let Some((_, lines)) = self.living.take() {
            lines.finish_and_clear();
        }
    }

    /// Takes the picture away for a question.
    pub fn clear(&self) {
        if let Some((all, _)) = &self.living {
            let _ = all.clear();
        }
    }

    /// The taxels that do not respond, by place, once the pressure is high enough to tell.
    fn silent(&self, session: &Session) -> String {
        let high = session.pressure_kpa.is_some_and(|kpa| kpa > NAMED_FROM * session.target_kpa) || session.falling;
        let told = high || matches!(session.state(), SessionState::Fitting | SessionState::Review);
        let Some(places) = self.places.get(&session.patch).filter(|_| told) else { return String::new() };
        let left_out = |taxel: &u32| !places.is_in(*taxel, &session.left_out);
        places.name(session.not_responding.iter().copied().filter(left_out))
    }
}

/// Rings the terminal's bell, where there is a terminal.
pub fn bell() {
    let mut out = std::io::stderr();
    if out.is_terminal() {
        let _ = out.write_all(b"\x07").and_then(|()| out.flush());
    }
}

/// The picture of a terminal: some lines that are drawn anew.
fn picture(session: &Session, advice: &Advice, silent: &str) -> String {
    let (number, patch, ramp) = (session.session, &session.patch, session.ramps.max(1));
    [
        format!("session {number} of {patch}, ramp {ramp}: {}  {}", session_word(session.state()), advice.words()),
        format!("pressure  {}", pressure(session)),
        format!("coverage  {}", coverage(session)),
        taxels(session, silent),
        scans(session),
    ]
    .join("\n")
}

fn pressure(session: &Session) -> String {
    let limit = if session.falling { session.fall_max_kpa_per_s } else { session.rise_max_kpa_per_s };
    let kpa = session.pressure_kpa.map_or_else(|| "-".to_owned(), |kpa| format!("{kpa:.1}"));
    let rate = session.rate_kpa_per_s.map_or_else(|| "-".to_owned(), |rate| format!("{rate:+.2}"));
    format!("{kpa} of {:.0} kPa, {rate} kPa/s of {limit:.1}", session.target_kpa)
}

fn coverage(session: &Session) -> String {
    let left = session.remaining_s.map_or_else(String::new, |left| format!(", {left:.0} s left"));
    format!("{:.0} %{left}", 100.0 * session.coverage)
}

fn taxels(session: &Session, silent: &str) -> String {
    let not = if silent.is_empty() { String::new() } else { format!("; not: {silent}") };
    format!("{} of {} taxels respond{not}", session.taxels_responding, session.taxels)
}

fn scans(session: &Session) -> String {
    format!("{} scans entered, refused: {}", session.accepted, refusals(&session.refused))
}

/// Everything in one line, for a log.
fn line(session: &Session, advice: &Advice, silent: &str) -> String {
    let state = session_word(session.state());
    match session.state() {
        SessionState::Ramping => format!(
            "{state} {}; coverage {}; {}; {}",
            pressure(session),
            coverage(session),
            taxels(session, silent),
            advice.words()
        ),
        SessionState::Taring | SessionState::Fitting => format!("{state} {}", advice.words()),
        SessionState::Review => format!("{state} {}; {}", scans(session), taxels(session, silent)),
        _ => format!("{state} {}", session.reason),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plain_line_has_pressure_rate_coverage_and_who_does_not_respond() {
        let session = Session {
            state: SessionState::Ramping.into(),
            pressure_kpa: Some(34.2),
            rate_kpa_per_s: Some(2.0),
            rise_max_kpa_per_s: 5.0,
            target_kpa: 70.0,
            coverage: 0.48,
            remaining_s: Some(17.9),
            taxels: 230,
            taxels_responding: 220,
            ..Session::default()
        };
        assert_eq!(
            line(&session, &Advice::GoOn, "board 12 module 3 (all 10)"),
            "RAMPING 34.2 of 70 kPa, +2.00 kPa/s of 5.0; coverage 48 %, 18 s left; \
             220 of 230 taxels respond; not: board 12 module 3 (all 10); go on"
        );
        let no_gauge = Session { pressure_kpa: None, rate_kpa_per_s: None, ..session };
        assert!(line(&no_gauge, &Advice::NoGauge, "").starts_with("RAMPING - of 70 kPa, - kPa/s of 5.0"));
    }
}
