//! `taxel-lab apply`: pressures from the counts of a recording, and how right they are where it has a gauge.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use taxel_engine::calibration::fit::{Applied, Column, Tare, judge};
use taxel_engine::model_set::ModelSet;
use taxel_files::{Output, announce, quiet_end, read_text};
use taxel_store::models_json;

use crate::fit::parse_number;
use crate::recording::Recording;
use crate::soundness::{Purpose, check};

/// Counts that are all this many calibrated widths away are of another scale.
const FAR_WIDTHS: f64 = 1.0;

/// Turns the counts of a recording into pressures.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxel-lab apply models.json walk.csv.gz --out pressure.csv\n  taxel-lab apply models.json - --tare 5 --out - < walk.csv | head"
)]
pub struct ApplyArgs {
    /// Models, as `taxel-lab fit` or a calibration session writes them.
    models: PathBuf,
    /// Recording: `t_s[,pressure_kpa],c0,c1,...`, one row a scan, plain or .gz; `-` is the standard input. Its
    /// pressure, where it has one, is compared with what the models read.
    data: PathBuf,
    /// Where the pressures go: `t_s,p0,p1,...` in kPa, an empty cell where a taxel is excluded.
    #[arg(long, value_name = "PRESSURE.csv")]
    out: PathBuf,
    /// The zero: `auto` tares from the first two seconds if they are unloaded, `none` leaves the zero of the
    /// calibration, a number tares from the first seconds, which you say are unloaded.
    #[arg(long, value_name = "auto|none|SECONDS", default_value = "auto", value_parser = parse_tare)]
    tare: Tare,
    /// Write standard deviations in kPa here, cell by cell.
    #[arg(long, value_name = "SIGMA.csv")]
    sigma: Option<PathBuf>,
}

fn parse_tare(text: &str) -> Result<Tare, String> {
    match text {
        "auto" => Ok(Tare::Auto),
        "none" => Ok(Tare::None),
        _ => {
            let seconds = parse_number(text).ok().filter(|s| *s > 0.0);
            seconds.map(Tare::Seconds).ok_or_else(|| "expected `auto`, `none` or a number of seconds".to_owned())
        }
    }
}

/// Reads a model set.
///
/// # Errors
/// The file's path and what is wrong with it.
pub(crate) fn read_models(path: &Path) -> anyhow::Result<ModelSet> {
    let text = read_text(path)?;
    models_json::from_json(&text).with_context(|| path.display().to_string())
}

/// Runs `taxel-lab apply`.
///
/// # Errors
/// A file that cannot be read or written, or models of another number of taxels.
pub fn apply(args: &ApplyArgs) -> anyhow::Result<()> {
    let outputs: Vec<&Path> = [&args.out].into_iter().chain(&args.sigma).map(PathBuf::as_path).collect();
    announce(&outputs, &[&args.models, &args.data])?;
    let set = read_models(&args.models)?;
    let mut recording = Recording::read(&args.data)?;
    let named = || args.data.display().to_string();
    refuse_other_counts(&set, &recording).with_context(named)?;
    let notes = if set.is_of_skin() { check(&mut recording, Purpose::Apply).with_context(named)? } else { Vec::new() };
    let applied = taxel_engine::calibration::fit::apply(&recording.as_scans(), &set, args.tare)
        .with_context(|| format!("{} with {}", args.data.display(), args.models.display()))?;
    print_applied(&args.data, &notes, &applied);
    if applied.columns.iter().all(Result::is_err) {
        bail!("not one of {} taxels could be read: nothing is written", applied.columns.len());
    }
    if let Some(gauge_kpa) = &recording.pressure_kpa {
        print_score(&applied, gauge_kpa);
    }
    write(&args.out, "p", &recording.time_s, &columns_of(&applied, |column| &column.kpa))?;
    if let Some(path) = &args.sigma {
        write(path, "s", &recording.time_s, &columns_of(&applied, |column| &column.sigma_kpa))?;
    }
    say!("written to {}", args.out.display());
    Ok(())
}

/// Compares what was read with the recording's own gauge.
fn print_score(applied: &Applied, gauge_kpa: &[f64]) {
    let score = judge(applied, gauge_kpa);
    say!("  area-mean error above 30 kPa: {:.2} % (bias {:+.2} kPa)", score.area_percent, score.bias_kpa);
    say!("  taxel RMSE: mean {:.2} kPa, median {:.2} kPa", score.taxel_rmse_kpa, score.taxel_rmse_median_kpa);
    if let Some(coverage) = score.coverage_percent {
        say!("  within the 95 % interval: {coverage:.1} % of the readings");
    }
    if let Some(coverage) = score.coverage_beyond_percent {
        say!("    {coverage:.1} % of the {:.1} % that are beyond the calibrated range", score.beyond_percent);
    }
}

/// Refuses counts of another scale than the models', for example of 16 bits where the models are for 8.
fn refuse_other_counts(set: &ModelSet, recording: &Recording) -> anyhow::Result<()> {
    let ends = |values: &mut dyn Iterator<Item = f64>| {
        values.map(|value| (value, value)).reduce(|(a, b), (c, d)| (a.min(c), b.max(d)))
    };
    let calibrated =
        ends(&mut set.taxels.iter().filter(|model| model.is_usable()).filter_map(|model| model.range).flatten());
    let counts = ends(&mut recording.counts.iter().flatten().copied().filter(|count| count.is_finite()));
    let (Some((low, high)), Some((least, most))) = (calibrated, counts) else { return Ok(()) };
    // All of them far outside: neither a load beyond the calibrated one nor a zero that moved does that.
    let far = FAR_WIDTHS * (high - low).max(1.0);
    if least > high + far || most < low - far {
        bail!("the counts are {least} to {most}, the models are for {low:.1} to {high:.1}: another converter or scale");
    }
    Ok(())
}

/// Says what was done and what was left out.
fn print_applied(data: &Path, notes: &[String], applied: &Applied) {
    say!("{}: {}", data.display(), applied.zero.words);
    notes.iter().for_each(|note| say!("  {note}"));
    let (all, read) = (applied.columns.len(), applied.columns.iter().flatten().count());
    let mut reasons: BTreeMap<String, usize> = BTreeMap::new();
    for why in applied.columns.iter().filter_map(|column| column.as_ref().err()) {
        *reasons.entry(why.clone()).or_default() += 1;
    }
    say!("  taxels: {read} of {all} read");
    for (reason, taxels) in reasons {
        say!("    {taxels} {reason}");
    }
    let (masked, cells) = applied.masked;
    if masked > 0 {
        let share = 100.0 * masked as f64 / cells as f64;
        say!("  left out as faulty for a time: {share:.2} % of the readings of those taxels");
    }
}

/// Some numbers of each taxel; none of one that is excluded.
fn columns_of(applied: &Applied, of: impl Fn(&Column) -> &[f64]) -> Vec<&[f64]> {
    applied.columns.iter().map(|column| column.as_ref().map_or(&[][..], &of)).collect()
}

/// Writes one column per taxel, to a tenth of a pascal; NaN and empty columns are empty cells.
fn write(path: &Path, letter: &str, time_s: &[f64], columns: &[&[f64]]) -> anyhow::Result<()> {
    let write = || {
        let mut out = Output::create(path)?;
        write!(out, "t_s")?;
        (0..columns.len()).try_for_each(|taxel| write!(out, ",{letter}{taxel}"))?;
        for (i, time_s) in time_s.iter().enumerate() {
            write!(out, "\n{time_s}")?;
            for column in columns {
                match column.get(i).filter(|value| value.is_finite()) {
                    Some(value) => write!(out, ",{value:.4}")?,
                    None => write!(out, ",")?,
                }
            }
        }
        writeln!(out)?;
        out.finish()
    };
    quiet_end(path, write())
}
