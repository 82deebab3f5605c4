//! An exported session as the engine has it: its samples, its modules, its gauge, and its own fit.

use std::ops::Range;
use std::sync::Arc;

use anyhow::{Context, anyhow, bail, ensure};
use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::calibration::fit::{Branch, FitRecipe};
use taxel_engine::calibration::{FitJob, RampBaseline, Sample, SessionSamples};
use taxel_engine::counts::Counts;
use taxel_engine::model_set::ModelSet;
use taxel_model::GaugeUncertainty;
use taxel_skin::CountRange;

use crate::recording::{Figure, Recording};

/// Whether the recording is that of a session: it says at which zeros its ramps began.
#[must_use]
pub fn is_session(recording: &Recording) -> bool {
    recording.figures.iter().any(|figure| figure.name == "zero")
}

/// The patch that it is of.
#[must_use]
pub fn patch(recording: &Recording) -> Option<String> {
    recording.figures.iter().find_map(|figure| figure.name.strip_prefix("patch ")).map(str::to_owned)
}

/// The session's own fit with this recipe, over `branch`, or over what was gathered.
///
/// # Errors
/// A figure that is missing or cannot be, or samples that give no models.
pub fn fit(recording: &Recording, mut recipe: FitRecipe, branch: Option<Branch>) -> anyhow::Result<ModelSet> {
    let (samples, counts) = samples(recording)?;
    let (modules, left_out) = modules(recording, recipe.module_size)?;
    recipe.module_size = modules.iter().map(ExactSizeIterator::len).max().unwrap_or(1);
    recipe.options.gauge = gauge(recording);
    if counts != CountRange::BYTE {
        let high = counts.units(counts.top());
        recipe.faults.rail_high = high as f32;
    }
    let gathered = gathered(recording);
    ensure!(
        branch != Some(Branch::Both) || gathered == Branch::Both,
        "the session gathered rising pressure alone: it cannot be fitted over both branches"
    );
    recipe.branch = branch.unwrap_or(gathered);
    let samples = if gathered == Branch::Both { samples.of_branch(recipe.branch) } else { samples };
    let (samples, simulated) = (Arc::new(samples), recording.figure("simulated").is_some());
    let job = FitJob { samples, simulated, modules, left_out, recipe, ..FitJob::default() };
    let set = job.run(|_| String::new()).result.map_err(|why| anyhow!(why))?;
    Ok(ModelSet::clone(&set))
}

/// What is said of a table that somebody has changed.
const NOT_EXPORTED: &str = "not as `taxeld sessions export` writes it: export the session again";

/// The range of the converters; eight bits unless it is told.
fn count_range(recording: &Recording) -> anyhow::Result<CountRange> {
    let Some(top) = recording.figure("count_max").map(|figure| figure.cells[0]) else { return Ok(CountRange::BYTE) };
    CountRange::to(top as u16).with_context(|| format!("the row `count_max` is {NOT_EXPORTED}"))
}

fn gauge(recording: &Recording) -> GaugeUncertainty {
    let of = |name| recording.figure(name).map(|figure| figure.kpa).filter(|kpa| kpa.is_finite() && *kpa >= 0.0);
    GaugeUncertainty {
        gain_rel: of("gauge_gain").unwrap_or(0.0),
        offset_kpa: of("gauge_offset").unwrap_or(0.0),
        noise_kpa: of("gauge_noise").unwrap_or(0.0),
    }
}

/// The taxels of each module, and the modules that the session was without.
fn modules(recording: &Recording, size: usize) -> anyhow::Result<(Vec<Range<usize>>, Vec<u16>)> {
    let taxels = recording.counts.len();
    let Some(figure) = recording.figure("module") else {
        let module = |first: usize| first..(first + size).min(taxels);
        return Ok(((0..taxels).step_by(size.max(1)).map(module).collect(), Vec::new()));
    };
    // Neighbouring cells that are equal are a module; NaN is one of the session was without.
    let same = |a: f64, b: f64| a == b || (a.is_nan() && b.is_nan());
    let (mut modules, mut left_out): (Vec<Range<usize>>, Vec<u16>) = (Vec::new(), Vec::new());
    for part in figure.cells.chunk_by(|a, b| same(*a, *b)) {
        let first = modules.last().map_or(0, |last| last.end);
        if part[0].is_nan() {
            left_out.push(u16::try_from(modules.len())?);
        }
        modules.push(first..first + part.len());
    }
    ensure!(left_out.len() < modules.len(), "the row `module` is empty: there is no taxel to fit");
    Ok((modules, left_out))
}

/// Which branches the session gathered.
#[must_use]
pub fn gathered(recording: &Recording) -> Branch {
    if recording.figure("both").is_some() { Branch::Both } else { Branch::Rising }
}

/// The samples of the session, and the range of its converters.
///
/// # Errors
/// Which line is not as it was exported.
pub fn samples(recording: &Recording) -> anyhow::Result<(SessionSamples, CountRange)> {
    let range = count_range(recording)?;
    let (Some(pressure), Some(ramp_of)) = (&recording.pressure_kpa, &recording.ramps) else {
        bail!("there is no column `pressure_kpa` to fit to");
    };
    let of = |name: &'static str| recording.figures.iter().filter(move |figure| figure.name == name);
    let ramp = |(zero, noise): (&Figure, &Figure)| {
        let rest = zero.cells.iter().zip(&noise.cells).map(|(&mean, &noise)| TaxelBaseline { mean, noise });
        let gauge_kpa = Some(zero.kpa).filter(|kpa| kpa.is_finite());
        RampBaseline { ramp: zero.ramp.saturating_sub(1), taxels: rest.collect(), gauge_kpa }
    };
    let ramps: Vec<RampBaseline> = of("zero").zip(of("noise")).map(ramp).collect();
    let sample = |scan: usize| {
        let ramp = ramp_of[scan].saturating_sub(1);
        let count = |column: &Vec<f64>| Some(column[scan] as u16).filter(|count| f64::from(*count) == column[scan]);
        let raw: Vec<u16> = recording.counts.iter().map(count).collect::<Option<_>>()?;
        let is_whole = pressure[scan].is_finite() && raw.iter().all(|count| *count <= range.top());
        let time_ns = (recording.time_s[scan] * 1e9).round() as i64;
        (is_whole && ramps.iter().any(|zero| zero.ramp == ramp)).then_some(Sample {
            ramp,
            time_ns,
            pressure_kpa: pressure[scan],
            counts: Counts::new(&raw, range).into(),
        })
    };
    let told = |scan: usize| sample(scan).with_context(|| format!("line {} is {NOT_EXPORTED}", recording.lines[scan]));
    let samples = (0..recording.scans()).map(told).collect::<anyhow::Result<_>>()?;
    Ok((SessionSamples { ramps, samples }, range))
}
