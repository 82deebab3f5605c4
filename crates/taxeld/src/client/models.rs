//! `taxeld models`: model sets, and one of them.

use std::path::PathBuf;

use taxel_client::Server;
use taxel_proto::v1::{
    DeleteModelSetRequest, ExportModelSetRequest, GetModelSetRequest, ImportModelSetRequest, ModelSetSummary,
};

use super::connect::{Asked, Daemon};
use super::failure::Outcome;
use super::model_set::{Candidate, full_id, print_set};
use super::{ask, json, table};

/// Model sets: what sessions produced.
#[derive(Debug, clap::Args)]
pub struct ModelsArgs {
    #[command(subcommand)]
    command: ModelsCommand,
}

#[derive(Debug, clap::Subcommand)]
enum ModelsCommand {
    /// All sets, newest first.
    List(Asked),
    /// A set with its excluded taxels by place.
    #[command(
        after_help = "Examples:\n  taxeld models show                 # the active one\n  taxeld models show m-26dc"
    )]
    Show {
        #[command(flatten)]
        of: Asked,
        /// Id of the set, its beginning or `newest` [default: the active one].
        #[arg(value_name = "MODEL_SET")]
        model_set: Option<String>,
    },
    /// Uses a set from now on, also after a restart. Using the set that was in use before is the way back.
    #[command(
        after_help = "Examples:\n  taxeld models use m-26dc52bea9635074\n  taxeld models use m-26dc          # the beginning is enough if no other set has it\n  taxeld models use newest"
    )]
    Use {
        #[command(flatten)]
        of: Asked,
        /// Id of the set, its beginning, or `newest`.
        #[arg(value_name = "MODEL_SET")]
        model_set: String,
        /// Do not ask where it is not good: too few taxels, a bad fit, or far fewer taxels than the set in use.
        #[arg(long)]
        yes: bool,
    },
    /// Writes a set as MODELS.json, as `taxel-lab fit` does.
    Export {
        #[command(flatten)]
        server: Server,
        /// Id of the set, its beginning or `newest` [default: the active one].
        #[arg(value_name = "MODEL_SET")]
        model_set: Option<String>,
        /// Where it goes; `-` is the standard output.
        #[arg(long, value_name = "MODELS.json", default_value = "-")]
        out: PathBuf,
    },
    /// Takes in a MODELS.json; it is in use after `taxeld models use`.
    Import {
        #[command(flatten)]
        of: Asked,
        /// The file; `-` is the standard input.
        file: PathBuf,
        /// Import it although its curves do not look like those of this skin.
        #[arg(long)]
        insist: bool,
    },
    /// Deletes a set that is not in use, for good; it asks before that.
    Delete {
        #[command(flatten)]
        server: Server,
        /// Id of the set, or its beginning.
        #[arg(value_name = "MODEL_SET")]
        model_set: String,
        /// Do not ask.
        #[arg(long)]
        yes: bool,
    },
}

/// Runs it.
///
/// # Errors
/// Refused with the daemon's reason, a file that cannot be read or written, or no daemon.
pub async fn models(args: ModelsArgs) -> Outcome {
    match args.command {
        ModelsCommand::List(of) => list(&of).await,
        ModelsCommand::Show { of, model_set } => show(&of, model_set.as_deref()).await,
        ModelsCommand::Use { of, model_set, yes } => use_set(&of, &model_set, yes).await,
        ModelsCommand::Export { server, model_set, out } => {
            let daemon = Daemon::at(&server).await?;
            let model_set = wanted(&daemon, model_set.as_deref()).await?;
            let request = ExportModelSetRequest { model_set, patch: daemon.patch.clone() };
            let answer = daemon.models().export_model_set(request).await?.into_inner();
            Ok(taxel_files::write_text(&out, &answer.json)?)
        }
        ModelsCommand::Import { of, file, insist } => {
            let daemon = of.daemon().await?;
            let json = taxel_files::read_text(&file)?;
            let answer = daemon.models().import_model_set(ImportModelSetRequest { json, insist }).await?.into_inner();
            if of.json {
                return json::print("ImportModelSetResponse", &answer);
            }
            say!("{} is in the store; use it with: taxeld models use {}", answer.model_set, answer.model_set);
            let set = Candidate::of(&daemon, &answer.model_set).await?;
            set.print_verdict();
            say!("{}", set.zero());
            Ok(())
        }
        ModelsCommand::Delete { server, model_set, yes } => {
            let daemon = Daemon::at(&server).await?;
            let model_set = full_id(&daemon, &model_set).await?;
            let question = format!("delete model set {model_set} for good?");
            ask::agree(yes, &question, &format!("taxeld models delete {model_set}")).await?;
            daemon.models().delete_model_set(DeleteModelSetRequest { model_set: model_set.clone() }).await?;
            say!("{model_set} is deleted");
            Ok(())
        }
    }
}

/// The id asked for; empty, which is the active set, if none was.
async fn wanted(daemon: &Daemon, model_set: Option<&str>) -> Outcome<String> {
    match model_set {
        Some(beginning) => full_id(daemon, beginning).await,
        None => Ok(String::new()),
    }
}

async fn list(of: &Asked) -> Outcome {
    let sets = of.daemon().await?.model_sets().await?;
    if of.json {
        return sets.iter().try_for_each(|set| json::print("ModelSetSummary", set));
    }
    let row = |set: &ModelSetSummary| {
        vec![
            set.model_set.clone(),
            if set.active { "active" } else { "" }.to_owned(),
            set.patch.clone(),
            table::moment(set.created.as_ref()),
            set.session.map_or_else(|| "-".to_owned(), |session| session.to_string()),
            format!("{} of {}", set.calibrated, set.taxels),
            format!("{:.1}", set.pressure_max_kpa),
        ]
    };
    table::print(&["model set", "", "patch", "made", "session", "usable", "to kPa"], sets.iter().map(row));
    Ok(())
}

async fn use_set(of: &Asked, beginning: &str, yes: bool) -> Outcome {
    let daemon = of.daemon().await?;
    let set = Candidate::of(&daemon, &full_id(&daemon, beginning).await?).await?;
    if !set.is_good() {
        let command = format!("taxeld models use {}", set.summary.model_set);
        ask::agree(yes, &format!("{} Use it?", set.verdict().join(" ")), &command).await?;
    }
    let answer = set.activate(&daemon).await?;
    of.show("ActivateModelSetResponse", &answer, |answer| {
        let before = if answer.previous.is_empty() { "none" } else { &answer.previous };
        set.print_verdict();
        say!("{} is in use; before it: {before}\n{}", set.summary.model_set, set.zero());
    })
}

async fn show(of: &Asked, model_set: Option<&str>) -> Outcome {
    let daemon = of.daemon().await?;
    let model_set = wanted(&daemon, model_set).await?;
    let request = GetModelSetRequest { model_set, patch: daemon.patch.clone(), curves: Vec::new() };
    let set = daemon.models().get_model_set(request).await?.into_inner();
    if of.json {
        return json::print("ModelSet", &set);
    }
    let patch = set.summary.as_ref().map(|summary| summary.patch.as_str()).unwrap_or_default();
    print_set(&set, &daemon.places(patch).await?);
    Ok(())
}
