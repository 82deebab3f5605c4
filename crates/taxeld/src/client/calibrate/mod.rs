//! `taxeld calibrate`: a session from the zero to the models in use, guided.

mod device;
mod follow;
mod screen;

use taxel_client::Server;
use taxel_proto::v1::{
    Branches, ListRequest, ModuleName, PatchRequest, Session, SessionAction, SessionState, StartSessionRequest,
};

use super::ask;
use super::connect::Daemon;
use super::failure::{Failure, Outcome};
use super::json;
use super::model_set::{Candidate, print_set};
use super::places::Places;
use super::sessions::{advance, session_word};
use device::{ByDevice, Pump};
use follow::Course;
use screen::Screen;

/// Guides through a calibration in the vacuum bag: zero, ramps, review, use of the new set.
///
/// A session that is under way is followed again. Ctrl-C asks whether to end the ramp, to abort, or to leave it to the daemon. Several patches
/// in one bag are calibrated by one ramp: one `taxeld calibrate --patch NAME` for each, in terminals of their own; pump when
/// all of them wait for it.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxeld calibrate\n  taxeld calibrate --both --ramps 2        # learns the hysteresis, too\n  taxeld calibrate --yes > calibration.log 2>&1   # asks nothing, uses a good set\n  taxeld calibrate --leave-out 12:3        # without module 3 of board 12\n  taxeld calibrate --device micro --at /dev/ttyACM0"
)]
pub struct CalibrateArgs {
    #[command(flatten)]
    server: Server,
    /// Ramps of the session; the bag is vented between them. Make 2 on a skin that was never pressed: its first ramp is unlike
    /// all later ones, and the curves are those of the last.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100))]
    ramps: u32,
    /// Gather the fall of the pressure after each rise, too.
    #[arg(long)]
    both: bool,
    /// Pressure at which the rise ends, in kPa [default: as the daemon is configured].
    #[arg(long, value_name = "KPA")]
    target: Option<f64>,
    /// Your name, as the one who confirms that nothing touches the skin: the zero is then taken whatever the counts say.
    #[arg(long, value_name = "NAME", default_value = "")]
    confirmed_by: String,
    /// A module to do without, because it is silent or broken; may be given several times.
    #[arg(long, value_name = "BOARD:MODULE", value_parser = parse_module)]
    leave_out: Vec<ModuleName>,
    /// What a dial shows at each plateau, in kPa, for scripts; without it you are asked. After the last of them the models are fitted.
    #[arg(long, value_name = "KPA,KPA,...", value_delimiter = ',')]
    typed: Vec<f64>,
    /// A drive moves the pressure: its profile, a file as in deploy/rigs, or `micro`, `alicat`, `epick`, `vg10` or `analogue`. Ctrl-C,
    /// or an abort from anywhere, vents.
    #[arg(long, value_name = "FILE")]
    device: Option<String>,
    /// Where the drive is, if not where its profile says: a serial device, or tcp:HOST:PORT.
    #[arg(long, value_name = "LINE", requires = "device")]
    at: Option<String>,
    /// You stand beside the valve until the end, because the drive holds the vacuum if this computer stops.
    #[arg(long, requires = "device")]
    attended: bool,
    /// Ask nothing: use the new set if it is good; exit code 4 if it is not.
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
    let daemon = Daemon::at(&args.server).await?;
    let skin = daemon.skin().get_skin(PatchRequest { patch: daemon.patch.clone() }).await?.into_inner();
    let daemon = daemon.about(&skin.patch);
    let asks = !args.yes && !args.json && ask::somebody();
    let mut screen = Screen::new(Places::of(&skin), args.json);
    if let Some(profile) = &args.device {
        let mut pump = Pump::open(profile, args.at.as_deref()).await?;
        pump.attended(asks, args.attended).await?;
        end_what_was_left(&daemon, args.yes).await?;
        let request = new_session(&daemon, &args);
        let course = ByDevice { daemon: &daemon, screen: &mut screen, request, ramps: args.ramps };
        let session = course.run(&mut pump).await?;
        return conclude(&Course { daemon, screen, asks, typed: None, session }, &args).await;
    }
    let session = begin(&daemon, &args, &screen).await?;
    let typed = (!args.typed.is_empty()).then(|| args.typed.clone().into());
    let mut course = Course { daemon, screen, asks, typed, session };
    loop {
        course.follow().await?;
        if course.session.state() != SessionState::Review {
            return Err(failed(&course.session));
        }
        course.until_vented().await?;
        let taken = course.session.ramps;
        if taken >= args.ramps {
            break;
        }
        course.screen.tell(&format!("ramp {} of {}", taken + 1, args.ramps));
        course.session = advance(&course.daemon, course.session.session, SessionAction::StartRamp, "").await?;
    }
    conclude(&course, &args).await
}

/// The session to follow: the one that is under way, or a new one.
async fn begin(daemon: &Daemon, args: &CalibrateArgs, screen: &Screen) -> Outcome<Session> {
    if let Some(session) = under_way(daemon).await? {
        screen.tell(&format!("session {} is under way: following it", session.session));
        return Ok(session);
    }
    let session = daemon.calibration().start_session(new_session(daemon, args)).await?.into_inner();
    session.look.iter().for_each(|line| screen.tell(&format!("check: {line}")));
    Ok(session)
}

/// The session of the patch that has not come to its end, if there is one.
async fn under_way(daemon: &Daemon) -> Outcome<Option<Session>> {
    let request = ListRequest { patch: daemon.patch.clone(), most: 1, before: 0 };
    let newest = daemon.calibration().list_sessions(request).await?.into_inner().sessions.into_iter().next();
    let is_open = |state| matches!(state, SessionState::Taring | SessionState::Ramping | SessionState::Fitting);
    Ok(newest.filter(|session| is_open(session.state())))
}

/// A drive whose program was killed leaves its session under way.
async fn end_what_was_left(daemon: &Daemon, agreed: bool) -> Outcome {
    if let Some(session) = under_way(daemon).await? {
        let number = session.session;
        ask::agree(agreed, &format!("session {number} is under way. Abort it?"), "taxeld calibrate --device").await?;
        advance(daemon, number, SessionAction::Abort, "the program of a drive began anew").await?;
    }
    Ok(())
}

/// A new session.
fn new_session(daemon: &Daemon, args: &CalibrateArgs) -> StartSessionRequest {
    let branches = if args.both { Branches::Both } else { Branches::Unspecified };
    StartSessionRequest {
        patch: daemon.patch.clone(),
        target_kpa: args.target,
        confirmed_by: args.confirmed_by.clone(),
        branches: branches.into(),
        leave_out: args.leave_out.clone(),
    }
}

/// Why no models came of it, and what can be done.
fn failed(session: &Session) -> Failure {
    let (number, state) = (session.session, session_word(session.state()));
    let kept = session.accepted;
    let why = format!("session {number} is {state}: {}; its {kept} scans are kept", session.reason);
    Failure::refused(why).help(format!("taxeld calibrate   # then, to fit both: taxeld sessions refit {number} NEW"))
}

/// The review, and what the operator makes of it.
async fn conclude(course: &Course, args: &CalibrateArgs) -> Outcome {
    let candidate = Candidate::of(&course.daemon, &course.session.model_set).await?;
    if !args.json {
        print_set(&candidate.set, &course.screen.places);
        candidate.print_verdict();
    }
    if candidate.summary.calibrated == 0 {
        return Err(Failure::refused(format!("not one of {} taxels got a usable model", candidate.summary.taxels)));
    }
    let help = format!("taxeld models use {}", candidate.summary.model_set);
    if args.yes && !candidate.is_good() {
        let why = format!("{} is not good, so that --yes does not use it; it is kept", candidate.summary.model_set);
        return Err(Failure::not_good(why).help(format!("{help} --yes   # uses it all the same")));
    }
    if !(args.yes || course.asks && ask::yes("Use it?", candidate.is_good()).await?) {
        course.screen.tell(&format!("not in use yet; help: {help}"));
        return Ok(());
    }
    let answer = candidate.activate(&course.daemon).await?;
    if args.json {
        return json::print("ActivateModelSetResponse", &answer);
    }
    say!("{} is in use. With nothing on the skin: taxeld tare, then taxeld watch", candidate.summary.model_set);
    Ok(())
}
