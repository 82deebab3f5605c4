//! Following the sessions of one bag from one state to the next, with a hand on Ctrl-C.

use std::time::Duration;

use crate::client::sessions::advance;
use taxel_proto::v1::{Session, SessionAction, SessionRequest, SessionState};
use tokio::sync::mpsc;
use tonic::{Status, Streaming};

use super::screen::{Screen, bell};
use crate::client::ask;
use crate::client::connect::Daemon;
use crate::client::failure::{Failure, Outcome};

/// Without anybody to ask, a bag that is not vented within this time is told and left so.
const VENT_WITHIN: Duration = Duration::from_secs(120);

/// A ramp under way tells something new several times a second. Where nothing comes for so long, the daemon is asked.
const QUIET: Duration = Duration::from_secs(1);
/// Its health takes milliseconds.
const ANSWER_WITHIN: Duration = Duration::from_secs(1);

/// What a calibration is followed with.
pub struct Course {
    /// Where it is shown.
    pub screen: Screen,
    /// Whether somebody can be asked.
    pub asks: bool,
    /// The session, ramp and branch of which it was asked whether it shall end where it cannot get further.
    pub offered: Option<(u64, u32, bool)>,
}

/// A session and the daemon, about its patch.
#[derive(Clone)]
pub struct Followed {
    /// The daemon.
    pub daemon: Daemon,
    /// As it was told last.
    pub session: Session,
    /// Whether this calibration began it, and did not take it up.
    pub begun: bool,
}

impl Followed {
    /// Whether it goes on by itself.
    fn is_under_way(&self) -> bool {
        matches!(self.session.state(), SessionState::Taring | SessionState::Ramping | SessionState::Fitting)
    }

    async fn watch(&self) -> Outcome<Streaming<Session>> {
        let request = SessionRequest { session: self.session.session };
        Ok(self.daemon.calibration().watch_session(request).await?.into_inner())
    }
}

/// What a stream told: whose, and the session, or that it ended.
type Told = (usize, Result<Option<Session>, Status>);

/// All streams as one.
async fn watch(all: &[Followed]) -> Outcome<mpsc::Receiver<Told>> {
    let (tell, told) = mpsc::channel(1);
    for (position, followed) in all.iter().enumerate() {
        let (mut stream, tell) = (followed.watch().await?, tell.clone());
        // Ends when nobody listens any more, or with its stream.
        tokio::spawn(async move {
            loop {
                let message = stream.message().await;
                let last = !matches!(message, Ok(Some(_)));
                if tell.send((position, message)).await.is_err() || last {
                    return;
                }
            }
        });
    }
    Ok(told)
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

/// Follows sessions until each waits for review or has ended. The first that is still under way is shown, of the others
/// only what changes.
///
/// # Errors
/// A lost connection, or an operator who leaves or aborts them.
pub async fn follow(course: &mut Course, all: &mut [Followed]) -> Outcome {
    let mut told = watch(all).await?;
    loop {
        let ramping = all.iter().position(|followed| followed.session.state() == SessionState::Ramping);
        let quiet = async {
            match ramping {
                Some(position) => (position, stands_still(&all[position].daemon).await),
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            (position, why) = quiet => {
                if let Some(why) = why {
                    course.screen.stop(&all[position].session, why)?;
                }
            }
            message = told.recv() => {
                let Some((position, session)) = message else { return Ok(()) };
                let number = all[position].session.session;
                let is_gone = match &session {
                    Ok(Some(_)) => false,
                    Ok(None) => all[position].is_under_way(),
                    Err(_) => true,
                };
                if ramping.is_some() && is_gone {
                    course.screen.tell("stop pumping: the daemon has gone");
                }
                let Some(session) = session? else {
                    if all[position].is_under_way() {
                        let ended = anyhow::anyhow!("the daemon ended the stream of session {number}");
                        return Err(Failure::Broken(ended));
                    }
                    continue; // one that has failed has nothing more to tell
                };
                let before = std::mem::replace(&mut all[position].session, session);
                let shown = all.iter().position(Followed::is_under_way).unwrap_or(position);
                course.screen.show(&all[position].session, &before, shown == position)?;
                offer_to_finish(course, &all[position]).await?;
                if !all.iter().any(Followed::is_under_way) {
                    return Ok(());
                }
            }
            interrupted = tokio::signal::ctrl_c() => {
                interrupted?;
                interrupt(course, all).await?;
            }
        }
    }
}

/// Where a rise cannot get further: end it here, or wait for the pump. It is asked once a ramp.
async fn offer_to_finish(course: &mut Course, followed: &Followed) -> Outcome {
    let session = &followed.session;
    let stalled = session.state() == SessionState::Ramping && !session.falling && !session.reason.is_empty();
    let ramp = Some((session.session, session.ramps, session.falling));
    if !stalled || !course.asks || course.offered == ramp {
        return Ok(());
    }
    course.offered = ramp;
    course.screen.clear();
    bell();
    let question = format!("{}\nf: end the ramp here and fit what there is, Enter: go on pumping.", session.reason);
    if ask::ask(&question).await? == "f" {
        advance(&followed.daemon, session.session, SessionAction::FinishRamp).await?;
    }
    Ok(())
}

/// Ctrl-C: abort, leave, or go on.
async fn interrupt(course: &Course, all: &[Followed]) -> Outcome {
    let under_way: Vec<&Followed> = all.iter().filter(|followed| followed.is_under_way()).collect();
    let numbers: Vec<String> = under_way.iter().map(|followed| followed.session.session.to_string()).collect();
    let named = format!("session {}", numbers.join(", "));
    let left = || Failure::refused(format!("{named} goes on in the daemon; `taxeld calibrate` takes it up again"));
    if !course.asks {
        return Err(left());
    }
    course.screen.clear();
    let answer = ask::ask("a: abort the session, l: leave it to the daemon, Enter: go on.").await?;
    match answer.as_str() {
        "a" => {
            for followed in under_way {
                advance(&followed.daemon, followed.session.session, SessionAction::Abort).await?;
            }
            Err(Failure::refused(format!("{named} is aborted; its samples are kept")))
        }
        "l" => Err(left()),
        _ => Ok(()),
    }
}

const VENTED: &str = "the bag is vented";

/// Whether the bag is vented as far as the session asks for; a pressure that is not known says nothing against it.
fn is_vented(session: &Session) -> bool {
    session.pressure_kpa.is_none_or(|kpa| kpa < session.vented_below_kpa)
}

/// Waits until the bag of a session in review is vented, and says when it is. It may be so already: the models take their time.
///
/// # Errors
/// A lost connection.
pub async fn until_vented(course: &mut Course, followed: &mut Followed) -> Outcome {
    if is_vented(&followed.session) {
        if followed.session.pressure_kpa.is_some() {
            course.screen.tell(VENTED);
        }
        return Ok(());
    }
    course.screen.tell("the target is reached: vent the bag (Ctrl-C goes on without)");
    let mut stream = followed.watch().await?;
    let asks = course.asks;
    let give_up = async { if asks { std::future::pending().await } else { tokio::time::sleep(VENT_WITHIN).await } };
    tokio::pin!(give_up);
    while !is_vented(&followed.session) {
        tokio::select! {
            session = stream.message() => {
                let Some(session) = session? else { break };
                let before = std::mem::replace(&mut followed.session, session);
                course.screen.show(&followed.session, &before, true)?;
            }
            interrupted = tokio::signal::ctrl_c() => { interrupted?; return Ok(()); }
            () = &mut give_up => { course.screen.tell("the bag is still not vented"); return Ok(()); }
        }
    }
    bell();
    course.screen.tell(VENTED);
    Ok(())
}
