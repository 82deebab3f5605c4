//! `taxel-lab compare`: what changed from one model set of a patch to another.

use std::path::Path;

use anyhow::ensure;
use taxel_client::Server;
use taxel_engine::comparison::{Comparison, TaxelComparison};
use taxel_engine::model_set::ModelSet;
use taxel_skin::counted;
use taxel_store::models_json;

use crate::apply::read_models;
use crate::daemon::{Daemon, ask};
use crate::numbers::spread;

/// A taxel whose pressure changed by more is named.
const NAMED_PERCENT: f64 = 10.0;

/// What changed from one model set to another: of a running daemon, of files, or both.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "To go back to an earlier set, use it: taxeld models use m-26dc\n\nExamples:\n  taxel-lab compare active newest\n  taxel-lab compare before.json after.json\n  taxel-lab compare active models.json"
)]
pub struct CompareArgs {
    #[command(flatten)]
    server: Server,
    /// The earlier set: a file MODELS.json, or of the daemon its id, the beginning of it, `active` or `newest`.
    #[arg(value_name = "EARLIER")]
    earlier: String,
    /// The later one, likewise.
    #[arg(value_name = "LATER")]
    later: String,
}

/// Runs `taxel-lab compare`.
///
/// # Errors
/// A set that is not there or cannot be read, or sets of two patches.
pub fn compare(args: &CompareArgs) -> anyhow::Result<()> {
    let file = |name: &str| Path::new(name).is_file().then(|| read_models(Path::new(name))).transpose();
    let (earlier, later) = match (file(&args.earlier)?, file(&args.later)?) {
        (Some(earlier), Some(later)) => (earlier, later),
        (earlier, later) => ask(&args.server, async |daemon| {
            Ok((of(&daemon, earlier, &args.earlier).await?, of(&daemon, later, &args.later).await?))
        })?,
    };
    let skin = |set: &ModelSet| format!("{} taxels of patch `{}`", set.taxels.len(), set.patch);
    let (is, was) = (skin(&later), skin(&earlier));
    ensure!(is == was, "{} is for {is}, {} for {was}", later.id, earlier.id);
    print(&earlier, &later);
    Ok(())
}

async fn of(daemon: &Daemon, read: Option<ModelSet>, name: &str) -> anyhow::Result<ModelSet> {
    match read {
        Some(set) => Ok(set),
        None => Ok(models_json::from_json(&daemon.export_set(if name == "active" { "" } else { name }).await?)?),
    }
}

fn print(earlier: &ModelSet, later: &ModelSet) {
    let compared = Comparison::of(earlier, later);
    say!("{} against {}, patch {}:", later.id, earlier.id, later.patch);
    let over = |of: fn(&TaxelComparison) -> Option<f64>| spread(compared.taxels.iter().filter_map(of).collect());
    if let Some((low, median, high)) = over(change_percent) {
        say!("  pressure at equal counts from the zero: median {median:+.1} %, {low:+.1} % to {high:+.1} %");
    }
    if let Some((_, median, worst)) = over(|taxel| taxel.rms_kpa) {
        say!("  difference: median {median:.2} kPa, at worst {worst:.2} kPa (root mean square of a taxel)");
    }
    if let Some((low, median, high)) = over(|taxel| taxel.rest_counts) {
        say!("  unloaded counts moved: median {median:+.2}, {low:+.2} to {high:+.2}");
    }
    let far = |taxel: &&TaxelComparison| change_percent(taxel).is_some_and(|change| change.abs() > NAMED_PERCENT);
    let far: Vec<u32> = compared.taxels.iter().filter(far).map(|taxel| taxel.taxel).collect();
    let changed = &*format!("changed by more than {NAMED_PERCENT} %");
    let Comparison { lost, became_usable, .. } = &compared;
    let lines = [("no longer usable", lost), ("newly usable", became_usable), (changed, &far)];
    for (what, taxels) in lines.into_iter().filter(|(_, taxels)| !taxels.is_empty()) {
        let numbers: Vec<String> = taxels.iter().map(ToString::to_string).collect();
        say!("  {} {what}: {}", counted(taxels.len(), "taxel", "taxels"), numbers.join(" "));
    }
}

fn change_percent(taxel: &TaxelComparison) -> Option<f64> {
    taxel.gain_ratio.map(|ratio| 100.0 * (ratio - 1.0))
}
