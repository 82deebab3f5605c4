//! Following a session from one state to the next, with a hand on Ctrl-C.

use std::time::Duration;

use taxel_proto::v1::{AbortSessionRequest, Session, SessionState, WatchSessionRequest};
use tonic::Streaming;

use super::screen::{Screen, bell};
use crate::client::ask;
use crate::client::connect::Daemon;
use crate::client::failure::{Failure, Outcome};

/// Without anybody to ask, a bag that is not vented within this time is told and left so.
const VENT_WITHIN: Duration = Duration::from_secs(120);

/// What a calibration is followed with.
pub struct Course {
    /// The daemon, about the one patch.
    pub daemon: Daemon,
    /// Where it is shown.
    pub screen: Screen,
    /// Whether somebody can be asked.
    pub asks: bool,
}

async fn watch(daemon: &Daemon, session: u64) -> Outcome<Streaming<Session>> {
    Ok(daemon.calibration().watch_session(WatchSessionRequest { session }).await?.into_inner())
}

/// Follows a session until it waits for review or has ended.
///
/// # Errors
/// A lost connection, or an operator who leaves or aborts it.
pub async fn follow(course: &mut Course, number: u64) -> Outcome<Session> {
    let mut stream = watch(&course.daemon, number).await?;
    loop {
        tokio::select! {
            session = stream.message() => {
                let Some(session) = session? else {
                    return Err(Failure::Broken(anyhow::anyhow!("the daemon ended the stream of session {number}")));
                };
                course.screen.show(&session)?;
                if !matches!(
                    session.state(),
                    SessionState::Taring | SessionState::Ramping | SessionState::Fitting
                ) {
                    return Ok(session);
                }
            }
            interrupted = tokio::signal::ctrl_c() => {
                interrupted?;
                interrupt(course, number).await?;
            }
        }
    }
}

/// Ctrl-C: abort, leave, or go on.
async fn interrupt(course: &Course, number: u64) -> Outcome {
    let left =
        || Failure::refused(format!("session {number} goes on in the daemon; `taxeld calibrate` takes it up again"));
    if !course.asks {
        return Err(left());
    }
    course.screen.clear();
    let answer = ask::ask("a: abort the session, l: leave it to the daemon, Enter: go on.").await?;
    match answer.as_str() {
        "a" => {
            course.daemon.calibration().abort_session(AbortSessionRequest { session: number }).await?;
            Err(Failure::refused(format!("session {number} is aborted; its samples are kept")))
        }
        "l" => Err(left()),
        _ => Ok(()),
    }
}

/// Whether the bag is vented as far as the session asks for; a pressure that is not known says nothing against it.
fn is_vented(session: &Session) -> bool {
    session.pressure_kpa.is_none_or(|kpa| kpa < session.vented_below_kpa)
}

/// Waits until the bag of a session in review is vented.
///
/// # Errors
/// A lost connection.
pub async fn until_vented(course: &mut Course, session: Session) -> Outcome<Session> {
    if is_vented(&session) {
        return Ok(session);
    }
    course.screen.tell("the target is reached: vent the bag (Ctrl-C goes on without)");
    let mut stream = watch(&course.daemon, session.session).await?;
    let mut newest = session;
    let asks = course.asks;
    let give_up = async { if asks { std::future::pending().await } else { tokio::time::sleep(VENT_WITHIN).await } };
    tokio::pin!(give_up);
    while !is_vented(&newest) {
        tokio::select! {
            session = stream.message() => {
                let Some(session) = session? else { break };
                course.screen.show(&session)?;
                newest = session;
            }
            interrupted = tokio::signal::ctrl_c() => { interrupted?; return Ok(newest); }
            () = &mut give_up => { course.screen.tell("the bag is still not vented"); return Ok(newest); }
        }
    }
    bell();
    course.screen.tell("the bag is vented");
    Ok(newest)
}
