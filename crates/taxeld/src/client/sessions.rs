//! `taxeld sessions`: calibration sessions that are or were.

use std::path::{Path, PathBuf};

use taxel_client::Server;
use taxel_proto::v1::{
    AdvanceSessionRequest, Branches, GetModelSetRequest, ListRequest, RefitSessionsRequest, Session, SessionAction,
    SessionRequest, SessionState,
};
use taxel_skin::{counted, printable};

use super::connect::{Asked, Daemon};
use super::failure::Outcome;
use super::model_set::print_set;
use super::{ask, json, table};
use crate::values::refusals;

/// So much of a reason is kept with a session: 2000 bytes, and a character may have four.
const REASON_CHARS_MAX: usize = 480;

/// Calibration sessions.
#[derive(Debug, clap::Args)]
pub struct SessionsArgs {
    #[command(subcommand)]
    command: SessionsCommand,
}

#[derive(Debug, clap::Subcommand)]
enum SessionsCommand {
    /// All sessions, newest first.
    List(Asked),
    /// One session as it is now.
    Show(One),
    /// Ends a session that is under way; its samples are kept.
    #[command(
        after_help = "Examples:\n  taxeld sessions end 3              # stops it\n  taxeld sessions end 3 --fit        # ends the ramp before its target and fits what there is\n  taxeld sessions end 3 --discard    # its models cannot be used any more"
    )]
    End {
        #[command(flatten)]
        one: One,
        /// End the ramp before its target, and fit what there is.
        #[arg(long, conflicts_with = "discard")]
        fit: bool,
        /// Lay a session aside that has ended: its models cannot be used any more.
        #[arg(long)]
        discard: bool,
    },
    /// Deletes a session with its samples, for good; it asks before that.
    Delete {
        #[command(flatten)]
        one: One,
        /// Do not ask.
        #[arg(long)]
        yes: bool,
    },
    /// Fits the stored samples of a session, or of several of one patch together, once more: a model set that is not in use.
    #[command(
        after_help = "The fit is as configured now; `taxel-lab fit` of an exported session has options. The same fit has the same id.\n\nExamples:\n  taxeld sessions refit 3\n  taxeld sessions refit 3 4 7 && taxel-lab compare active newest"
    )]
    Refit {
        #[command(flatten)]
        asked: Asked,
        /// Numbers of the sessions.
        #[arg(value_name = "SESSION", required = true, value_parser = clap::value_parser!(u64).range(1..))]
        sessions: Vec<u64>,
    },
    /// Writes the samples of a session as a table that `taxel-lab fit` reads.
    #[command(
        after_help = "Examples:\n  taxeld sessions export 3 --out session3.csv\n  taxeld sessions export 3 | taxel-lab fit - --patch left_forearm --out models.json"
    )]
    Export {
        #[command(flatten)]
        server: Server,
        /// Number of the session.
        #[arg(value_name = "SESSION", value_parser = clap::value_parser!(u64).range(1..))]
        session: u64,
        /// Where it goes; `-` is the standard output.
        #[arg(long, value_name = "FILE", default_value = "-")]
        out: PathBuf,
    },
}

#[derive(Debug, clap::Args)]
struct One {
    #[command(flatten)]
    asked: Asked,
    /// Number of the session.
    #[arg(value_name = "SESSION", value_parser = clap::value_parser!(u64).range(1..))]
    session: u64,
}

/// Runs it.
///
/// # Errors
/// Refused with the daemon's reason, or no daemon.
pub async fn sessions(args: SessionsArgs) -> Outcome {
    match args.command {
        SessionsCommand::List(asked) => list(&asked).await,
        SessionsCommand::Export { server, session, out } => export(&server, session, &out).await,
        SessionsCommand::Refit { asked, sessions } => refit(&asked, sessions).await,
        SessionsCommand::Delete { one, yes } => delete(&one, yes).await,
        SessionsCommand::Show(one) => {
            let request = SessionRequest { session: one.session };
            let view = one.asked.daemon().await?.calibration().get_session(request).await?.into_inner();
            one.asked.show("Session", &view, print)
        }
        SessionsCommand::End { one, fit, discard } => {
            let action = match (fit, discard) {
                (true, _) => SessionAction::FinishRamp,
                (false, true) => SessionAction::Discard,
                (false, false) => SessionAction::Abort,
            };
            let view = advance(&one.asked.daemon().await?, one.session, action, "").await?;
            one.asked.show("Session", &view, print)
        }
    }
}

/// Takes a session a step further, for a reason where it is aborted.
///
/// # Errors
/// Refused with the daemon's reason, or no daemon.
pub async fn advance(daemon: &Daemon, session: u64, action: SessionAction, reason: &str) -> Outcome<Session> {
    let reason = printable(reason).chars().take(REASON_CHARS_MAX).collect();
    let request = AdvanceSessionRequest { session, action: action.into(), reason, typed_kpa: None };
    Ok(daemon.calibration().advance_session(request).await?.into_inner())
}

/// The state's name without its prefix.
pub fn session_word(state: SessionState) -> &'static str {
    state.as_str_name().trim_start_matches("SESSION_STATE_")
}

async fn delete(one: &One, yes: bool) -> Outcome {
    let (mut service, session) = (one.asked.daemon().await?.calibration(), one.session);
    let view = service.get_session(SessionRequest { session }).await?.into_inner();
    let (patch, scans, state) = (&view.patch, view.accepted, session_word(view.state()));
    let question = format!("delete session {session} of {patch} ({state}) with its {scans} scans for good?");
    ask::agree(yes, &question, &format!("taxeld sessions delete {session}")).await?;
    service.delete_session(SessionRequest { session }).await?;
    match one.asked.json {
        true => say!("{{}}"),
        false => say!("session {session} is deleted"),
    }
    Ok(())
}

async fn list(asked: &Asked) -> Outcome {
    let daemon = asked.daemon().await?;
    let (mut sessions, mut before) = (Vec::<Session>::new(), 0);
    loop {
        let request = ListRequest { patch: daemon.patch.clone(), most: 0, before };
        let more = daemon.calibration().list_sessions(request).await?.into_inner().sessions;
        let Some(last) = more.last() else { break };
        before = last.session;
        sessions.extend(more);
    }
    if asked.json {
        return sessions.iter().try_for_each(|session| json::print("Session", session));
    }
    let header = ["session", "patch", "state", "started", "ramps", "scans", "model set", ""];
    table::print(&header, sessions.iter().map(row));
    Ok(())
}

fn row(view: &Session) -> Vec<String> {
    vec![
        view.session.to_string(),
        view.patch.clone(),
        session_word(view.state()).to_owned(),
        table::moment(view.started.as_ref()),
        view.ramps.to_string(),
        view.accepted.to_string(),
        if view.model_set.is_empty() { "-".to_owned() } else { view.model_set.clone() },
        view.reason.clone(),
    ]
}

fn print(view: &Session) {
    let reason = if view.reason.is_empty() { String::new() } else { format!(": {}", view.reason) };
    say!("session {} of {}: {}{reason}", view.session, view.patch, session_word(view.state()));
    let branches = if view.branches() == Branches::Both { "rising and falling" } else { "rising" };
    let confirmed = if view.confirmed_by.is_empty() {
        String::new()
    } else {
        format!(", unloaded: confirmed by {}", view.confirmed_by)
    };
    let (started, ramps) = (table::moment(view.started.as_ref()), counted(view.ramps as usize, "ramp", "ramps"));
    say!("  started {started}, {ramps} of {branches} pressure to {:.1} kPa{confirmed}", view.target_kpa);
    let refused = refused(view);
    say!("  {} scans entered, {} of them on disk; refused: {refused}", view.accepted, view.durable);
    say!("  coverage {:.0} %, {} of {} taxels responded", 100.0 * view.coverage, view.taxels_responding, view.taxels);
    if !view.model_set.is_empty() {
        say!("  model set {}", view.model_set);
    }
}

/// Refused scans by reason.
pub fn refused(view: &Session) -> String {
    refusals(view.refused.iter().map(|(why, scans)| (why.as_str(), *scans)))
}

/// Fits one session once more, or several together.
async fn refit(asked: &Asked, sessions: Vec<u64>) -> Outcome {
    let daemon = asked.daemon().await?;
    let request = RefitSessionsRequest { sessions };
    let answer = daemon.calibration().refit_sessions(request).await?.into_inner();
    if asked.json {
        return json::print("Refit", &answer);
    }
    say!("{} scans fitted", answer.scans);
    let summary = answer.model_set.unwrap_or_default();
    let (id, patch) = (summary.model_set, summary.patch);
    let request = GetModelSetRequest { model_set: id.clone(), ..GetModelSetRequest::default() };
    let set = daemon.models().get_model_set(request).await?.into_inner();
    print_set(&set, &daemon.places(&patch).await?);
    if answer.known {
        say!("the same samples were fitted so before: the set was there already");
    }
    if !summary.active {
        say!("it is not in use. What changes: taxel-lab compare active {id}; use it: taxeld models use {id}");
    }
    Ok(())
}

/// Writes figures of the session and its zeros, then a row a scan: seconds since the first one, kPa, and a count a taxel.
async fn export(server: &Server, session: u64, out: &Path) -> Outcome {
    let daemon = Daemon::at(server).await?;
    let mut pieces = daemon.calibration().export_samples(SessionRequest { session }).await?.into_inner();
    let mut text = String::new();
    while let Some(piece) = pieces.message().await? {
        text += &piece.text;
    }
    taxel_files::write_text(out, &text)?;
    if !taxel_files::is_standard(out) {
        say!("session {}: {}", session, out.display());
    }
    Ok(())
}
