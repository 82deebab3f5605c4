//! Which session a patch's calibration follows: one that is under way, one to be taken up, or a new one.

use crate::client::sessions::advance;
use taxel_proto::v1::{
    Branches, ListRequest, PatchRequest, Session, SessionAction, SessionRequest, SessionState, StartSessionRequest,
};

use super::args::CalibrateArgs;
use super::course::{Course, Followed};
use crate::client::ask;
use crate::client::connect::Daemon;
use crate::client::failure::{Failure, Outcome};
use crate::client::places::Places;

/// A patch in the bag.
pub struct Patch {
    /// The daemon, about it.
    pub daemon: Daemon,
    /// Where its taxels are.
    pub places: Places,
    /// The model set in use; empty if there is none.
    pub active: String,
}

/// The patch of this name; an empty one is the only one.
///
/// # Errors
/// There is none, or it has no gauge.
pub async fn patch(daemon: &Daemon, name: &str) -> Outcome<Patch> {
    let skin = daemon.skin().get_skin(PatchRequest { patch: name.to_owned() }).await?.into_inner();
    if !skin.has_gauge {
        return Err(Failure::refused(format!("patch {} has no pressure gauge: it cannot be calibrated", skin.patch)));
    }
    let (daemon, places) = (daemon.about(&skin.patch), Places::of(&skin));
    Ok(Patch { daemon, places, active: skin.model_set })
}

/// The session to follow.
///
/// # Errors
/// What the daemon refuses.
pub async fn begin(course: &Course, args: &CalibrateArgs, patch: &Patch) -> Outcome<Followed> {
    let daemon = patch.daemon.clone();
    if let Some(number) = args.session {
        let request = SessionRequest { session: number };
        let session = daemon.calibration().get_session(request).await?.into_inner();
        return take_up(daemon, session).await;
    }
    if let Some(session) = newest(&daemon).await?.filter(|_| !args.new)
        && wants(course, args, &session).await?
    {
        return take_up(daemon, session).await;
    }
    let branches = if args.both { Branches::Both } else { Branches::Unspecified };
    let request = StartSessionRequest {
        patch: daemon.patch(),
        target_kpa: args.target,
        confirmed_by: args.confirmed_by.clone(),
        branches: branches.into(),
        leave_out: args.leave_out.clone(),
    };
    let session = daemon.calibration().start_session(request).await?.into_inner();
    session.look.iter().for_each(|line| course.screen.tell(&format!("look: {line}")));
    Ok(Followed { daemon, session, begun: true })
}

async fn newest(daemon: &Daemon) -> Outcome<Option<Session>> {
    let patch = daemon.patch();
    let request = ListRequest { patch, page_size: 1, page_token: String::new() };
    Ok(daemon.calibration().list_sessions(request).await?.into_inner().sessions.into_iter().next())
}

/// Whether this earlier session is the one to go on with.
async fn wants(course: &Course, args: &CalibrateArgs, session: &Session) -> Outcome<bool> {
    let (number, scans) = (session.session, session.accepted);
    match session.state() {
        SessionState::Taring | SessionState::Ramping | SessionState::Fitting => {
            course.screen.tell(&format!("session {number} is under way: following it"));
            Ok(true)
        }
        SessionState::Interrupted if course.asks => {
            ask::yes(&format!("session {number} was interrupted with {scans} scans. Take it up?")).await
        }
        SessionState::Interrupted => Ok(args.yes),
        SessionState::Review if course.asks => {
            ask::yes(&format!("session {number} waits for review, with {scans} scans. Look at it?")).await
        }
        _ => Ok(false),
    }
}

async fn take_up(daemon: Daemon, session: Session) -> Outcome<Followed> {
    let session = match session.state() {
        // Of a session whose models are in use it begins a successor.
        SessionState::Interrupted | SessionState::Failed | SessionState::Aborted | SessionState::Active => {
            advance(&daemon, session.session, SessionAction::StartRamp).await?
        }
        _ => session,
    };
    Ok(Followed { daemon, session, begun: false })
}
