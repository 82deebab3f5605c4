//! `taxeld sessions refit`: stored samples fitted once more.

use taxel_client::Server;
use taxel_proto::v1::{GetModelSetRequest, RefitSessionsRequest};

use super::connect::Daemon;
use super::failure::Outcome;
use super::json;
use super::model_set::print_set;

/// What it takes beside the sessions.
#[derive(Debug, clap::Args)]
pub struct RefitArgs {
    #[command(flatten)]
    server: Server,
    /// Print the answer as JSON.
    #[arg(long)]
    json: bool,
}

/// Fits one session once more, or several together.
///
/// # Errors
/// Refused with the daemon's reason, or no daemon.
pub async fn refit(args: &RefitArgs, sessions: Vec<u64>) -> Outcome {
    let daemon = Daemon::at(&args.server).await?;
    let request = RefitSessionsRequest { sessions };
    let answer = daemon.calibration().refit_sessions(request).await?.into_inner();
    if args.json {
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
