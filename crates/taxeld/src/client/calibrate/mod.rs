//! `taxeld calibrate`: a session from the zero to the models in use, guided.

mod course;
mod guide;
mod review;
mod screen;

use taxel_proto::v1::{
    ActivateModelSetRequest, Branches, GetSkinRequest, ModuleName, Session, SessionState, StartRampRequest,
};

use course::{Course, follow, until_vented};
use screen::Screen;

use super::ask;
use super::compare::fetch;
use super::connect::{Daemon, Server};
use super::failure::{Failure, Outcome};
use super::json;
use super::places::Places;

/// Guides through a calibration in the vacuum bag: zero, ramps, review, activation.
///
/// A session that is under way is taken up again. Ctrl-C asks whether to abort it or to leave it to the daemon.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxeld calibrate\n  taxeld calibrate --both --ramps 2        # learns the hysteresis, too\n  taxeld calibrate --yes > calibration.log # asks nothing, activates what comes of it\n  taxeld calibrate --leave-out 12:3        # without module 3 of board 12"
)]
pub struct CalibrateArgs {
    #[command(flatten)]
    server: Server,
    /// Ramps of the session; the bag is vented between them.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100))]
    ramps: u32,
    /// Gather the fall of the pressure after each rise, too.
    #[arg(long)]
    both: bool,
    /// Pressure at which the rise ends, in kPa [default: as the daemon is configured].
    #[arg(long, value_name = "KPA")]
    target: Option<f64>,
    /// Who vouches that nothing touches the skin: then the zero is taken even if the counts do not show rest.
    #[arg(long, value_name = "NAME", default_value = "")]
    confirmed_by: String,
    /// A module to do without, because it is silent or broken; may be given several times.
    #[arg(long, value_name = "BOARD:MODULE", value_parser = parse_module)]
    leave_out: Vec<ModuleName>,
    /// Take up this session.
    #[arg(long, value_name = "SESSION", conflicts_with = "new", value_parser = clap::value_parser!(u64).range(1..))]
    session: Option<u64>,
    /// Begin a new session although an earlier one could be taken up.
    #[arg(long)]
    new: bool,
    /// Ask nothing: take up what was interrupted, activate what comes of it.
    #[arg(long)]
    yes: bool,
    /// Print the session as lines of JSON, as it changes.
    #[arg(long)]
    json: bool,
}

fn parse_module(text: &str) -> Result<ModuleName, String> {
    let numbers = text.split_once(':').and_then(|(board, module)| Some((board.parse().ok()?, module.parse().ok()?)));
    let (board, module) = numbers.ok_or_else(|| "expected BOARD:MODULE, for example 12:3".to_owned())?;
    Ok(ModuleName { board, module })
}

/// Runs it.
///
/// # Errors
/// A calibration that fails or is left, what the daemon refuses, or no daemon.
pub async fn calibrate(args: CalibrateArgs) -> Outcome {
    let daemon = args.server.connect().await?;
    let skin = daemon.skin().get_skin(GetSkinRequest { patch: daemon.patch() }).await?.into_inner();
    if !skin.has_gauge {
        return Err(Failure::refused(format!("patch {} has no pressure gauge: it cannot be calibrated", skin.patch)));
    }
    let daemon = daemon.about(&skin.patch);
    let places = Places::of(&skin);
    let asks = !args.yes && !args.json && ask::somebody();
    let mut course = Course { daemon, screen: Screen::new(places.clone(), args.json), asks };
    let mut session = begin(&mut course, &args).await?;
    loop {
        session = follow(&mut course, session.session).await?;
        if session.state() != SessionState::Review {
            course.screen.end();
            return Err(failed(&session));
        }
        session = until_vented(&mut course, session).await?;
        if session.ramps >= args.ramps {
            break;
        }
        course.screen.tell(&format!("ramp {} of {}", session.ramps + 1, args.ramps));
        let request = StartRampRequest { session: session.session };
        session = course.daemon.calibration().start_ramp(request).await?.into_inner();
    }
    course.screen.end();
    conclude(&course, &args, &session, &skin.model_set, &places).await
}

/// Why no models came of it, and what can be done.
fn failed(session: &Session) -> Failure {
    let (number, state) = (session.session, super::list::session_word(session.state()));
    let kept = session.accepted;
    Failure::refused(format!(
        "session {number} is {state}: {}; its {kept} scans are kept: `taxeld calibrate --session {number}` adds another ramp",
        session.reason
    ))
}

/// The session to follow: one that is under way, one to be taken up, or a new one.
async fn begin(course: &mut Course, args: &CalibrateArgs) -> Outcome<Session> {
    if let Some(number) = args.session {
        let request = taxel_proto::v1::GetSessionRequest { session: number };
        let session = course.daemon.calibration().get_session(request).await?.into_inner();
        return take_up(course, session).await;
    }
    if let Some(session) = newest(&course.daemon).await?.filter(|_| !args.new)
        && wants(course, args, &session).await?
    {
        return take_up(course, session).await;
    }
    let branches = if args.both { Branches::Both } else { Branches::Unspecified };
    let request = taxel_proto::v1::StartSessionRequest {
        patch: course.daemon.patch(),
        target_kpa: args.target,
        confirmed_by: args.confirmed_by.clone(),
        branches: branches.into(),
        leave_out: args.leave_out.clone(),
    };
    let session = course.daemon.calibration().start_session(request).await?.into_inner();
    session.look.iter().for_each(|line| course.screen.tell(&format!("look: {line}")));
    Ok(session)
}

async fn newest(daemon: &Daemon) -> Outcome<Option<Session>> {
    let patch = daemon.patch();
    let request = taxel_proto::v1::ListSessionsRequest { patch, page_size: 1, page_token: String::new() };
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

async fn take_up(course: &Course, session: Session) -> Outcome<Session> {
    match session.state() {
        SessionState::Interrupted | SessionState::Failed | SessionState::Aborted => {
            let request = StartRampRequest { session: session.session };
            Ok(course.daemon.calibration().start_ramp(request).await?.into_inner())
        }
        _ => Ok(session),
    }
}

/// The review, and what the operator makes of it.
async fn conclude(course: &Course, args: &CalibrateArgs, session: &Session, active: &str, places: &Places) -> Outcome {
    let set = fetch(&course.daemon, &session.model_set).await?;
    if set.taxels.iter().all(|model| !model.is_usable()) {
        review::print(&set, None, places);
        return Err(Failure::refused(format!("not one of {} taxels got a usable model", set.taxels.len())));
    }
    let before = if active.is_empty() { None } else { Some(fetch(&course.daemon, active).await?) };
    if !args.json {
        review::print(&set, before.as_ref(), places);
    }
    let activate = args.yes || (course.asks && ask::yes("activate?").await?);
    if !activate {
        course.screen.tell(&format!("not in use yet: taxeld activate {}", set.id));
        return Ok(());
    }
    let request = ActivateModelSetRequest {
        patch: course.daemon.patch(),
        model_set: set.id.clone(),
        expected: Some(active.to_owned()),
    };
    let answer = course.daemon.models().activate_model_set(request).await?.into_inner();
    if args.json {
        return json::print("ActivateModelSetResponse", &answer);
    }
    say!("{} is in use. With nothing on the skin: taxeld tare, then taxeld watch", answer.model_set);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_module_is_named_by_board_and_number() {
        assert_eq!(parse_module("12:3"), Ok(ModuleName { board: 12, module: 3 }));
        for text in ["", "12", "12:", ":3", "a:b", "12:3:4"] {
            assert!(parse_module(text).is_err(), "{text}");
        }
    }
}
