//! The paper's experiment on a simulated forearm: three runs in the bag, then masses on the skin.

use std::sync::Arc;

use taxel_engine::calibration::fit::{Branch, FitRecipe, OneByOne, PlaysChoice, fit};
use taxel_model::Estimator;

use super::data::{Data, Weighing, Weighings};
use super::figures::RUNS;
use crate::forearm::{TARGET_KPA, Tried, Weighed};

/// Calibrates the forearm of a seed and weighs masses on it, with models that exclude taxels of less swing than this.
///
/// # Errors
/// A simulation that cannot be set up, which it can.
pub(super) fn simulate(seed: u64, min_swing_counts: f64) -> anyhow::Result<Data> {
    let tried = Tried::new(&[], seed, RUNS, 0)?;
    let read = |by: &str, estimator| -> anyhow::Result<Weighings> {
        let mut recipe = FitRecipe { branch: Branch::Rising, plays: PlaysChoice::Off, ..FitRecipe::default() };
        recipe.options.estimator = estimator;
        recipe.options.exclusion.min_swing_counts = min_swing_counts;
        let set = fit(&tried.calibration.as_scans(), &recipe, &OneByOne)?;
        let (forces, _) = tried.forces(Arc::new(set), &recipe);
        let weighing = |(measured_n, &Weighed { kilogram, true_n, .. }): (f64, &Weighed)| Weighing {
            kilogram: Some(kilogram),
            true_n,
            measured_n,
        };
        Ok(Weighings { by: by.to_owned(), all: forces.into_iter().zip(&tried.weighings).map(weighing).collect() })
    };
    let loads = vec![
        read("the paper's recipe: its models, equal areas, active taxels only", Estimator::Paper)?,
        read("the shipped default: binned models, excluded taxels filled", Estimator::PressureBinned)?,
    ];
    let source = format!("a simulated forearm, seed {seed}: {RUNS} runs to {TARGET_KPA} kPa");
    let kpa = tried.calibration.pressure_kpa.unwrap_or_default();
    let mut data = Data::new(source, kpa, tried.calibration.counts);
    data.loads = loads;
    Ok(data)
}
