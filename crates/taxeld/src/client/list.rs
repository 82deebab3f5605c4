//! `taxeld list`: the patches of a daemon at a glance.

use taxel_proto::judge::word;
use taxel_proto::v1::{ForceSample, GetForceRequest, GetSkinRequest, ListSessionsRequest, SessionState, Skin};

use super::connect::{Daemon, Server};
use super::failure::Outcome;
use super::{json, table};

/// The patches, what each reads now, its active model set and its newest session.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxeld list\n  taxeld list --server https://robot:50052 --ca ca.pem --certificate operator.pem --key operator.key"
)]
pub struct ListArgs {
    #[command(flatten)]
    server: Server,
    /// Print each patch's layout (message Skin) as a line of JSON.
    #[arg(long)]
    json: bool,
}

/// Runs it.
///
/// # Errors
/// No daemon.
pub async fn list(args: ListArgs) -> Outcome {
    let daemon = args.server.connect().await?;
    let mut rows = Vec::new();
    for patch in patches(&daemon).await? {
        let skin = daemon.skin().get_skin(GetSkinRequest { patch: patch.clone() }).await?.into_inner();
        if args.json {
            json::print("Skin", &skin)?;
            continue;
        }
        let force = daemon.force().get_force(GetForceRequest { patch: patch.clone() }).await?.into_inner();
        rows.push(row(&skin, force, &newest_session(&daemon, &patch).await?));
    }
    if !args.json {
        table::print(&["patch", "taxels", "state", "force", "model set", "newest session"], &rows);
    }
    Ok(())
}

/// The names of the patches asked about: one, or all of the daemon's.
///
/// # Errors
/// No such patch, or no daemon.
async fn patches(daemon: &Daemon) -> Outcome<Vec<String>> {
    if !daemon.patch().is_empty() {
        return Ok(vec![daemon.patch()]);
    }
    let health = daemon.skin().get_health(taxel_proto::v1::GetHealthRequest {}).await?.into_inner();
    Ok(health.patches.into_iter().map(|patch| patch.patch).collect())
}

async fn newest_session(daemon: &Daemon, patch: &str) -> Outcome<String> {
    let request = ListSessionsRequest { patch: patch.to_owned(), page_size: 1, page_token: String::new() };
    let sessions = daemon.calibration().list_sessions(request).await?.into_inner().sessions;
    Ok(sessions
        .first()
        .map_or_else(|| "-".to_owned(), |session| format!("{} {}", session.session, session_word(session.state()))))
}

/// The state's name without its prefix.
pub fn session_word(state: SessionState) -> &'static str {
    let name = state.as_str_name();
    name.strip_prefix("SESSION_STATE_").unwrap_or(name)
}

fn row(skin: &Skin, force: ForceSample, session: &str) -> Vec<String> {
    let state = force.state();
    let simulated = if force.simulated { ", simulated" } else { "" };
    let newton = force.total_n.map_or_else(|| "-".to_owned(), |newton| format!("{newton:.2} N{simulated}"));
    let set = if skin.model_set.is_empty() { "-" } else { &skin.model_set };
    let calibrated = skin.taxels.iter().filter(|taxel| taxel.calibrated).count();
    let taxels = format!("{calibrated} of {}", skin.taxels.len());
    vec![skin.patch.clone(), taxels, word(state).to_owned(), newton, set.to_owned(), session.to_owned()]
}
