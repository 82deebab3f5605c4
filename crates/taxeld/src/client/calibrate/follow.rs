//! Following a session from one state to the next, with a hand on Ctrl-C.

use std::collections::VecDeque;
use std::time::Duration;

use taxel_proto::v1::{AdvanceSessionRequest, Session, SessionAction, SessionState};

use super::screen::{Screen, bell};
use crate::client::ask;
use crate::client::connect::Daemon;
use crate::client::failure::{Failure, Outcome};
use crate::client::sessions::advance;

/// Without anybody to ask, a bag that is not vented within this time is told and left so.
const VENT_WITHIN: Duration = Duration::from_secs(120);

/// A ramp under way tells something new several times a second. Where nothing comes for so long, the daemon is asked.
const QUIET: Duration = Duration::from_secs(1);
/// Its health takes milliseconds.
const ANSWER_WITHIN: Duration = Duration::from_secs(1);

/// A calibration as it runs.
pub struct Course {
    /// The daemon, about the patch.
    pub daemon: Daemon,
    /// Where it is shown.
    pub screen: Screen,
    /// Whether somebody can be asked.
    pub asks: bool,
    /// What a dial shows, where a script says it: one for each plateau to come.
    pub typed: Option<VecDeque<f64>>,
    /// The session as it was told last.
    pub session: Session,
}

impl Course {
    /// Follows the session until it waits for review or has ended.
    ///
    /// # Errors
    /// A lost connection, or an operator who leaves or aborts it.
    pub async fn follow(&mut self) -> Outcome {
        let mut stream = self.daemon.watch_session(self.session.session).await?;
        while matches!(self.session.state(), SessionState::Taring | SessionState::Ramping | SessionState::Fitting) {
            let is_ramping = self.session.state() == SessionState::Ramping;
            tokio::select! {
                why = stands_still(&self.daemon), if is_ramping => {
                    why.into_iter().for_each(|why| self.screen.stop(&format!("nothing new comes from the daemon: {why}")));
                }
                message = stream.message() => {
                    if is_ramping && !matches!(message, Ok(Some(_))) {
                        self.screen.stop("the daemon has gone");
                    }
                    let ended = || anyhow::anyhow!("the daemon ended the stream of session {}", self.session.session);
                    self.session = message?.ok_or_else(ended)?;
                    self.screen.show(&self.session)?;
                }
                interrupted = tokio::signal::ctrl_c() => {
                    interrupted?;
                    self.interrupt().await?;
                }
            }
            // Once the skin has settled, what the dial shows may be typed.
            if self.session.state() == SessionState::Ramping && self.session.typed.is_some_and(|typed| typed.settled) {
                self.type_plateau().await?;
            }
        }
        Ok(())
    }

    /// Ctrl-C: end the ramp, abort, leave, or go on.
    async fn interrupt(&self) -> Outcome {
        let number = self.session.session;
        let question = "f: end the ramp here and fit what there is, a: abort, l: leave it to the daemon, Enter: go on.";
        let answer = if self.asks { ask::ask(question).await? } else { "l".to_owned() };
        match answer.as_str() {
            "a" => {
                advance(&self.daemon, number, SessionAction::Abort, "").await?;
                Err(Failure::refused(format!("session {number} is aborted; its samples are kept")))
            }
            "f" => advance(&self.daemon, number, SessionAction::FinishRamp, "").await.map(drop),
            "l" => {
                let why = format!("session {number} goes on in the daemon");
                Err(Failure::refused(why).help("taxeld calibrate   # follows it again"))
            }
            _ => Ok(()),
        }
    }

    /// Types what the dial shows, as the script or the operator says. Elsewhere than at a terminal it is typed on the page.
    ///
    /// # Errors
    /// A plateau of a script that is refused, a lost connection, or an operator who leaves or aborts the session.
    async fn type_plateau(&mut self) -> Outcome {
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

    /// Whether the bag is vented as far as the session asks for; a pressure that is not known says nothing against it.
    fn is_vented(&self) -> bool {
        self.session.pressure_kpa.is_none_or(|kpa| kpa < self.session.vented_below_kpa)
    }

    /// Waits until the bag of a session in review is vented, and says when it is. It may be so already: the models take their time.
    ///
    /// # Errors
    /// A lost connection.
    pub async fn until_vented(&mut self) -> Outcome {
        if self.session.typed.is_some() {
            self.screen.tell("vent the bag");
            if self.asks {
                ask::ask("Enter when it is vented:").await?;
            }
            return Ok(());
        }
        if !self.is_vented() {
            self.screen.tell("the target is reached: vent the bag (Ctrl-C: go on without venting)");
            let mut stream = self.daemon.watch_session(self.session.session).await?;
            let give_up = tokio::time::sleep(if self.asks { Duration::MAX } else { VENT_WITHIN });
            tokio::pin!(give_up);
            while !self.is_vented() {
                tokio::select! {
                    session = stream.message() => {
                        let Some(session) = session? else { break };
                        self.session = session;
                        self.screen.show(&self.session)?;
                    }
                    interrupted = tokio::signal::ctrl_c() => { interrupted?; return Ok(()); }
                    () = &mut give_up => { self.screen.tell("the bag is still not vented"); return Ok(()); }
                }
            }
            bell();
        }
        if self.session.pressure_kpa.is_some() {
            self.screen.tell("the bag is vented");
        }
        Ok(())
    }
}

/// Waits for [`QUIET`], and says why nothing can come then; `None` where the daemon runs, and nothing has changed.
async fn stands_still(daemon: &Daemon) -> Option<String> {
    tokio::time::sleep(QUIET).await;
    match tokio::time::timeout(ANSWER_WITHIN, daemon.skin().get_health(())).await {
        Err(_) => Some("it does not answer".to_owned()),
        Ok(Err(refused)) => Some(refused.message().to_owned()),
        Ok(Ok(health)) => {
            let stalled_s = health.into_inner().engine_stalled_s?;
            Some(format!("its engine has not run for {stalled_s:.1} s"))
        }
    }
}
