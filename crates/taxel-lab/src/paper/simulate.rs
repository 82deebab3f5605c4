//! The paper's experiment on a simulated forearm: three runs in the bag, then masses on the skin.

use std::sync::Arc;

use taxel_engine::calibration::fit::{Branch, FitRecipe, OneByOne, PlaysChoice, fit};
use taxel_engine::plan::{Outputs, PatchPlan};
use taxel_model::Estimator;

use super::data::{Data, Weighing, Weighings};
use super::figures::RUNS;
use crate::forearm::{Forearm, Weighed, forces, recording};

/// The highest pressure, and how fast it rises and falls.
const TARGET_KPA: f64 = 70.0;
const KPA_PER_S: f64 = 1.0;

/// Calibrates the forearm of a seed and weighs masses on it, with models that exclude taxels of less swing than this.
///
/// # Errors
/// A simulation that cannot be set up, which it can.
pub(super) fn simulate(seed: u64, min_swing_counts: f64) -> anyhow::Result<Data> {
    let mut forearm = Forearm::new(&[], seed)?;
    let plan = forearm.plan()?;
    let mut scans = Vec::new();
    for _ in 0..RUNS {
        scans.extend(forearm.cycle(TARGET_KPA, KPA_PER_S));
        forearm.vent();
    }
    let recording = recording(&scans);
    let zero = forearm.rest();
    let weighings = forearm.weigh_all(0)?;
    let read = |by: &str, estimator, plan: &PatchPlan| -> anyhow::Result<Weighings> {
        let mut recipe = FitRecipe { branch: Branch::Rising, plays: PlaysChoice::Off, ..FitRecipe::default() };
        recipe.options.estimator = estimator;
        recipe.options.exclusion.min_swing_counts = min_swing_counts;
        let set = fit(&recording.as_scans(), &recipe, &OneByOne)?;
        let forces = forces(Arc::new(set), plan, &zero, &weighings).0.into_iter();
        let weighing = |(measured_n, &Weighed { kilogram, true_n, .. }): (f64, &Weighed)| Weighing {
            kilogram: Some(kilogram),
            true_n,
            measured_n,
        };
        Ok(Weighings { by: by.to_owned(), all: forces.zip(&weighings).map(weighing).collect() })
    };
    let equal = PatchPlan { geometry: None, outputs: Outputs::default(), ..plan.clone() };
    let loads = vec![
        read("the paper's recipe: its models, equal areas, active taxels only", Estimator::Paper, &equal)?,
        read("the shipped default: binned models, excluded taxels filled", Estimator::PressureBinned, &plan)?,
    ];
    let source = format!("a simulated forearm, seed {seed}: {RUNS} runs to {TARGET_KPA} kPa");
    let kpa = recording.pressure_kpa.unwrap_or_default();
    let mut data = Data::new(source, kpa, recording.counts);
    data.loads = loads;
    Ok(data)
}
