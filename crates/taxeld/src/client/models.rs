//! `taxeld models`: model sets, and one set or one taxel of it.

use std::collections::BTreeMap;
use std::path::PathBuf;

use taxel_engine::model_set::ModelSet as EngineSet;
use taxel_proto::v1::{
    DeleteModelSetRequest, ExportModelSetRequest, GetModelSetRequest, ImportModelSetRequest, ModelSet, ModelSetSummary,
    PatchRequest, TaxelModel,
};
use taxel_store::models_json;

use super::connect::{Daemon, Server};
use super::failure::Outcome;
use super::places::Places;
use super::use_set::{SetInWords, UseArgs, full_id, use_set};
use super::{ask, json, table};
use crate::files;
use crate::output;

/// Model sets: what sessions produced.
#[derive(Debug, clap::Args)]
pub struct ModelsArgs {
    #[command(subcommand)]
    command: ModelsCommand,
}

#[derive(Debug, clap::Subcommand)]
enum ModelsCommand {
    /// All sets, newest first.
    List(OfServer),
    /// A set with its excluded taxels by place, or one taxel's curve.
    #[command(
        after_help = "Examples:\n  taxeld models show                 # the active one\n  taxeld models show m-26dc --taxel 13"
    )]
    Show {
        #[command(flatten)]
        of: OfServer,
        /// Id of the set, its beginning or `newest` [default: the active one].
        #[arg(value_name = "MODEL_SET")]
        model_set: Option<String>,
        /// One taxel's model in full.
        #[arg(long, value_name = "N")]
        taxel: Option<u32>,
    },
    /// Uses a set from now on.
    Use(UseArgs),
    /// Writes a set as MODELS.json, as `taxel-lab fit` does.
    Export {
        #[command(flatten)]
        of: OfServer,
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
        of: OfServer,
        /// The file; `-` is the standard input.
        file: PathBuf,
        /// Import it although its curves do not look like those of this skin.
        #[arg(long)]
        insist: bool,
    },
    /// Deletes a set that is not in use, for good; it asks before that.
    Delete {
        #[command(flatten)]
        of: OfServer,
        /// Id of the set, or its beginning.
        #[arg(value_name = "MODEL_SET")]
        model_set: String,
        /// Do not ask.
        #[arg(long)]
        yes: bool,
    },
}

#[derive(Debug, clap::Args)]
struct OfServer {
    #[command(flatten)]
    server: Server,
    /// Print the answer as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs it.
///
/// # Errors
/// Refused with the daemon's reason, a file that cannot be read or written, or no daemon.
pub async fn models(args: ModelsArgs) -> Outcome {
    match args.command {
        ModelsCommand::List(of) => list(&of).await,
        ModelsCommand::Show { of, model_set, taxel } => show(&of, model_set.as_deref(), taxel).await,
        ModelsCommand::Use(args) => use_set(args).await,
        ModelsCommand::Export { of, model_set, out } => {
            let daemon = of.server.connect().await?;
            let model_set = wanted(&daemon, model_set.as_deref()).await?;
            let request = ExportModelSetRequest { model_set, patch: daemon.patch() };
            let answer = daemon.models().export_model_set(request).await?.into_inner();
            output::write_text(&out, &answer.json)?;
            Ok(())
        }
        ModelsCommand::Import { of, file, insist } => {
            let daemon = of.server.connect().await?;
            let json = files::read_text(&file)?;
            let answer = daemon.models().import_model_set(ImportModelSetRequest { json, insist }).await?.into_inner();
            if of.json {
                return json::print("ImportModelSetResponse", &answer);
            }
            say!("{} is in the store; use it with: taxeld models use {}", answer.model_set, answer.model_set);
            let set = SetInWords::of(&daemon, &answer.model_set).await?;
            say!("  {}\n  {}", set.usable(), set.rest());
            Ok(())
        }
        ModelsCommand::Delete { of, model_set, yes } => {
            let daemon = of.server.connect().await?;
            let model_set = full_id(&daemon, &model_set).await?;
            let sets = daemon.model_sets().await?;
            if let Some(set) = sets.iter().find(|set| set.model_set == model_set && !set.active) {
                let question = format!(
                    "delete model set {model_set} of {} for good ({} of {} taxels usable, made {})?",
                    set.patch,
                    set.calibrated,
                    set.taxels,
                    table::moment(set.created.as_ref())
                );
                ask::agree(yes, &question, &format!("taxeld models delete {model_set}")).await?;
            }
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

async fn list(of: &OfServer) -> Outcome {
    let daemon = of.server.connect().await?;
    let sets = daemon.model_sets().await?;
    if of.json {
        sets.iter().try_for_each(|set| json::print("ModelSetSummary", set))?;
    } else {
        let rows: Vec<_> = sets.iter().map(row).collect();
        table::print(&["model set", "", "patch", "made", "session", "usable", "to kPa", "method"], &rows);
    }
    Ok(())
}

fn row(set: &ModelSetSummary) -> Vec<String> {
    vec![
        set.model_set.clone(),
        if set.active { "active" } else { "" }.to_owned(),
        set.patch.clone(),
        table::moment(set.created.as_ref()),
        set.session.map_or_else(|| "-".to_owned(), |session| session.to_string()),
        format!("{} of {}", set.calibrated, set.taxels),
        format!("{:.1}", set.pressure_max_kpa),
        set.method.clone(),
    ]
}

async fn show(of: &OfServer, model_set: Option<&str>, taxel: Option<u32>) -> Outcome {
    let daemon = of.server.connect().await?;
    let (model_set, patch) = (wanted(&daemon, model_set).await?, daemon.patch());
    if let Some(taxel) = taxel {
        let request = GetModelSetRequest { model_set, patch, curves: vec![taxel] };
        let set = daemon.models().get_model_set(request).await?.into_inner();
        let model = set.curves.into_iter().next().unwrap_or_default();
        return if of.json { json::print("TaxelModel", &model) } else { print_taxel(&model) };
    }
    let set =
        daemon.models().get_model_set(GetModelSetRequest { model_set, patch, curves: Vec::new() }).await?.into_inner();
    if of.json {
        return json::print("ModelSet", &set);
    }
    let patch = set.summary.as_ref().map(|summary| summary.patch.clone()).unwrap_or_default();
    let skin = daemon.skin().get_skin(PatchRequest { patch }).await?.into_inner();
    print_set(&set, &Places::of(&skin))
}

pub fn print_set(set: &ModelSet, places: &Places) -> Outcome {
    if let Some(summary) = &set.summary {
        let session = summary.session.map_or_else(|| "a file".to_owned(), |session| format!("session {session}"));
        let active = if summary.active { ", active" } else { "" };
        say!(
            "model set {} of {}, from {session}, made {}{active}",
            summary.model_set,
            summary.patch,
            table::moment(summary.created.as_ref())
        );
        say!("  {}; up to {:.1} kPa", summary.method, summary.pressure_max_kpa);
        say!("  {} of {} taxels usable", summary.calibrated, summary.taxels);
    }
    let mut excluded: BTreeMap<&str, Vec<u32>> = BTreeMap::new();
    for taxel in set.taxels.iter().filter(|taxel| taxel.status != "ok") {
        excluded.entry(&taxel.status).or_default().push(taxel.taxel);
    }
    for (reason, taxels) in excluded {
        say!("    {} {reason}: {}", taxels.len(), places.name(taxels.iter().copied()));
    }
    let usable = || set.taxels.iter().filter(|taxel| taxel.status == "ok");
    let rmse = crate::values::spread(usable().filter_map(|taxel| taxel.figures.get("rmse_kpa").copied()).collect());
    if let Some((low, middle, high)) = rmse {
        say!("  RMSE of the fit: median {middle:.3} kPa, {low:.3} to {high:.3}");
    }
    if let Some(plays) = set.in_use.get("taxels_with_plays") {
        let back = set.in_use.get("zero_return_counts");
        let back = back.map(|counts| format!("; zero after a load: {counts:.2} counts off"));
        say!("  hysteresis compensated: {plays} taxels{}", back.unwrap_or_default());
    }
    set.board_settings.iter().for_each(|line| say!("  {line}"));
    Ok(())
}

fn print_taxel(model: &TaxelModel) -> Outcome {
    let Some(summary) = &model.summary else { return Ok(()) };
    say!("taxel {}: {}", summary.taxel, summary.status_text);
    if let (Some(low), Some(high)) = (model.count_min, model.count_max) {
        say!("  order {}, {}, calibrated for counts {low:.1} to {high:.1}", summary.order, model.estimator);
    }
    let coefficients: Vec<String> = model.coefficients.iter().map(|c| format!("{c:e}")).collect();
    if !coefficients.is_empty() {
        say!("  P(C) in kPa, ascending powers of the count: {}", coefficients.join(" "));
    }
    model.notes.iter().for_each(|note| say!("  {note}"));
    let row = |point: &taxel_proto::v1::CurvePoint| {
        let sigma = point.sigma_kpa.map_or_else(String::new, |sigma| format!("{sigma:.3}"));
        vec![point.count.to_string(), format!("{:.3}", point.pressure_kpa), sigma]
    };
    let rows: Vec<Vec<String>> = model.points.iter().map(row).collect();
    table::print(&["count", "kPa", "standard uncertainty kPa"], &rows);
    Ok(())
}

/// A model set with everything in it; an empty id is the active one.
///
/// # Errors
/// No such set, one that cannot be read, or no daemon.
pub async fn fetch(daemon: &Daemon, model_set: &str) -> Outcome<EngineSet> {
    let request = ExportModelSetRequest { model_set: model_set.to_owned(), patch: daemon.patch() };
    let json = daemon.models().export_model_set(request).await?.into_inner().json;
    Ok(models_json::from_json(&json).map_err(anyhow::Error::new)?)
}
