//! A dial that is read by eye: the operator holds a plateau and types what it shows.

use taxel_proto::v1::{AdvanceSessionRequest, SessionAction};

use super::follow::Course;
use crate::client::ask;
use crate::client::failure::Outcome;
use crate::client::sessions::advance;

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
                    self.session = advance(&self.daemon, number, SessionAction::FinishRamp, "").await?;
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
        let request = AdvanceSessionRequest { session: number, action, typed_kpa: Some(kpa), reason: String::new() };
        match self.daemon.calibration().advance_session(request).await {
            Ok(session) => self.session = session.into_inner(),
            Err(refused) if self.typed.is_none() => self.screen.tell(refused.message()),
            Err(refused) => return Err(refused.into()),
        }
        Ok(())
    }
}
