//! `taxeld activate`: uses a model set from now on.

use taxel_proto::v1::ActivateModelSetRequest;

use super::connect::{Daemon, Server};
use super::failure::{Failure, Outcome};
use super::json;

/// Uses a model set from now on, also after a restart. Activating the set that was in use before is the way back.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxeld activate m-26dc52bea9635074\n  taxeld activate m-26dc          # the beginning is enough if no other set has it\n  taxeld activate newest"
)]
pub struct ActivateArgs {
    #[command(flatten)]
    server: Server,
    /// Id of the set, its beginning, or `newest`.
    #[arg(value_name = "MODEL_SET")]
    model_set: String,
    /// Refuse unless this set is the active one now; the empty text for none.
    #[arg(long, value_name = "MODEL_SET")]
    expected: Option<String>,
    /// Print the answer as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs it.
///
/// # Errors
/// Refused with the daemon's reason, or no daemon.
pub async fn activate(args: ActivateArgs) -> Outcome {
    let daemon = args.server.connect().await?;
    let model_set = full_id(&daemon, &args.model_set).await?;
    let request = ActivateModelSetRequest { patch: daemon.patch(), model_set, expected: args.expected };
    let answer = daemon.models().activate_model_set(request).await?.into_inner();
    if args.json {
        return json::print("ActivateModelSetResponse", &answer);
    }
    let before = if answer.previous.is_empty() { "none" } else { &answer.previous };
    say!("{} is in use; before it: {before}", answer.model_set);
    Ok(())
}

/// Fewer characters name no set: a script's variable that is empty would name the only one there is.
const BEGINNING_MIN: usize = 4;

/// The id that these characters begin; `newest` is the newest set of the patch.
///
/// # Errors
/// No set or several begin so, or no daemon.
pub async fn full_id(daemon: &Daemon, beginning: &str) -> Outcome<String> {
    let sets = daemon.model_sets().await?;
    if beginning == "newest" {
        let newest = sets.into_iter().next().map(|set| set.model_set);
        return newest.ok_or_else(|| Failure::refused("there is no model set"));
    }
    if sets.iter().any(|set| set.model_set == beginning) {
        return Ok(beginning.to_owned());
    }
    if beginning.chars().count() < BEGINNING_MIN {
        let words =
            format!("`{beginning}` names no model set: give at least its first {BEGINNING_MIN} characters, as in m-1e");
        return Err(Failure::refused(words));
    }
    let found: Vec<String> = sets.into_iter().map(|set| set.model_set).filter(|id| id.starts_with(beginning)).collect();
    match found.as_slice() {
        [one] => Ok(one.clone()),
        [] => Err(Failure::refused(format!("there is no model set `{beginning}`; `taxeld models list` has them"))),
        several => Err(Failure::refused(format!("`{beginning}` begins {}", several.join(", ")))),
    }
}
