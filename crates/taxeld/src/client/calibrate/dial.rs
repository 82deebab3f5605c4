//! A dial that is read by eye: the operator holds a plateau and types what it shows.

use taxel_proto::v1::{AdvanceSessionRequest, Session, SessionAction, SessionState};

use super::follow::Course;
use crate::client::ask;
use crate::client::failure::Outcome;
use crate::client::sessions::advance;

/// So many plateaus above the vented bag make a calibration; the daemon refuses to fit fewer.
const PLATEAUS: u32 = 8;

/// Whether the skin has settled, and what the dial shows may be typed.
pub fn is_due(session: &Session) -> bool {
    session.state() == SessionState::Ramping && session.typed.as_ref().is_some_and(|typed| typed.settled)
}

/// What an operator at the pump is to do now.
pub fn advice(session: &Session) -> Option<String> {
    let typed = session.typed.as_ref().filter(|_| session.state() == SessionState::Ramping)?;
    Some(match typed.last_kpa {
        _ if typed.settled => "the skin has settled: read the dial".to_owned(),
        None => "leave the bag vented: the skin is watched".to_owned(),
        Some(last) => {
            let left = PLATEAUS.saturating_sub(typed.taken).max(1);
            let next = last + (session.target_kpa - last).max(0.0) / f64::from(left);
            format!("{} of {PLATEAUS} plateaus; pump to about {next:.0} kPa and hold", typed.taken)
        }
    })
}

impl Course {
    /// Types what the dial shows, of the script or of whoever is asked. Elsewhere than at a terminal it is typed on the page.
    ///
    /// # Errors
    /// A plateau of a script that is refused, a lost connection, or an operator who leaves or aborts the session.
    pub(super) async fn type_plateau(&mut self) -> Outcome {
        let number = self.session.session;
        let kpa = match &mut self.typed {
            Some(script) => match script.pop_front() {
                Some(kpa) => kpa,
                None => {
                    self.session = advance(&self.daemon, number, SessionAction::FinishRamp).await?;
                    return Ok(());
                }
            },
            None if self.asks => {
                match ask::ask("What does the dial show, in kPa? (e: end, abort or leave)").await?.as_str() {
                    "e" => return self.interrupt().await,
                    answer => match answer.replace(',', ".").parse() {
                        Ok(kpa) => kpa,
                        Err(_) => return Ok(()),
                    },
                }
            }
            None => return Ok(()),
        };
        let action = SessionAction::Plateau.into();
        let request = AdvanceSessionRequest { session: number, action, typed_kpa: Some(kpa) };
        match self.daemon.calibration().advance_session(request).await {
            Ok(session) => self.session = session.into_inner(),
            Err(refused) if self.typed.is_none() => self.screen.tell(refused.message()),
            Err(refused) => return Err(refused.into()),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use taxel_proto::v1::TypedPlateaus;

    use super::*;

    fn at(settled: bool, taken: u32, last_kpa: Option<f64>) -> Session {
        let typed = Some(TypedPlateaus { settled, taken, last_kpa });
        Session { state: SessionState::Ramping.into(), target_kpa: 70.0, typed, ..Session::default() }
    }

    #[test]
    fn an_operator_is_led_from_plateau_to_plateau() {
        for (session, says) in [
            (at(false, 0, None), "leave the bag vented: the skin is watched"),
            (at(true, 0, None), "the skin has settled: read the dial"),
            (at(false, 0, Some(0.5)), "0 of 8 plateaus; pump to about 9 kPa and hold"),
            (at(false, 7, Some(62.0)), "7 of 8 plateaus; pump to about 70 kPa and hold"),
            (at(false, 9, Some(72.0)), "9 of 8 plateaus; pump to about 72 kPa and hold"),
        ] {
            assert_eq!(advice(&session).as_deref(), Some(says));
            assert_eq!(is_due(&session), says.ends_with("dial"));
        }
        assert_eq!(advice(&Session::default()), None);
    }
}
