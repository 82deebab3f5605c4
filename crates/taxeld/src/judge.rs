//! `taxeld judge`: how good models are on a recording that has its own gauge.

mod judged;
mod recalibrated;
mod table;

use std::path::PathBuf;

use anyhow::Context;
use taxel_engine::calibration::fit::judge as score_of;

use crate::apply::{RecipeArgs, print_applied, read_models};
use crate::fit::scans_of;
use crate::recording::Recording;
use crate::soundness::{Wanted, check};
use judged::Judged;

/// Compares a recording's pressure with what models say of its counts.
#[derive(Debug, clap::Args)]
pub struct JudgeArgs {
    /// Models, as `taxeld fit` writes them.
    #[arg(required_unless_present = "table")]
    models: Option<PathBuf>,
    /// Recording with its pressure, which is compared with and not used.
    #[arg(required_unless_present = "table")]
    data: Option<PathBuf>,
    #[command(flatten)]
    recipe: RecipeArgs,
    /// Instead: fit DIR/left_calibration.csv.gz by every recipe, judge on left_validation and left_steps, print a table.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["models", "data", "tare", "smooth", "module_size", "load_points"])]
    table: Option<PathBuf>,
    /// Correct the gain by so many load points, stretches in which gauge and skin hold still, and score only the rest.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(5..=100))]
    load_points: Option<u8>,
    /// With --load-points: another recording, scored as it is with the same correction.
    #[arg(long, value_name = "DATA.csv", requires = "load_points")]
    then: Vec<PathBuf>,
}

/// Runs `taxeld judge`.
///
/// # Errors
/// A file that cannot be read, a recording without pressure, or models of another number of taxels.
pub fn judge(args: &JudgeArgs) -> anyhow::Result<()> {
    let (Some(models), Some(data)) = (&args.models, &args.data) else {
        let directory = args.table.as_deref().context("expected MODELS.json and DATA.csv, or --table DIR")?;
        return table::print(directory);
    };
    let set = read_models(models)?;
    if let Some(points) = args.load_points {
        let others = args.then.iter().map(|path| Judged::read(path)).collect::<anyhow::Result<Vec<_>>>()?;
        let (data, recipe) = (Judged::read(data)?, args.recipe.recipe(true));
        return recalibrated::judge_recalibrated(&set, &data, &recipe, usize::from(points), &others);
    }
    let mut recording = Recording::read(data)?;
    recording.report_refused(data);
    let named = || data.display().to_string();
    let notes = if set.is_of_skin() { check(&mut recording, Wanted::JUDGE).with_context(named)? } else { Vec::new() };
    let scans = scans_of(&recording);
    let gauge = scans.pressure_kpa.context("there is no column `pressure_kpa` to judge by").with_context(named)?;
    let applied = taxel_engine::calibration::fit::apply(&scans, &set, &args.recipe.recipe(true)).with_context(named)?;
    print_applied(data, &notes, &applied);
    let score = score_of(&applied, gauge);
    say!("  area-mean error above 30 kPa: {:.2} % (bias {:+.2} kPa)", score.area_percent, score.bias_kpa);
    say!("  taxel RMSE: mean {:.2} kPa, median {:.2} kPa", score.taxel_rmse_kpa, score.taxel_rmse_median_kpa);
    if let Some(coverage) = score.coverage_percent {
        say!("  within the 95 % interval: {coverage:.1} % of the readings");
    }
    if let Some(coverage) = score.coverage_beyond_percent {
        say!("    {coverage:.1} % of the {:.1} % that are beyond the calibrated range", score.beyond_percent);
    }
    if let Some(coverage) = score.area_coverage_percent {
        say!("    {coverage:.1} % of the area-means");
    }
    Ok(())
}
