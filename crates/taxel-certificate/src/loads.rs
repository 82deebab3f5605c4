//! Known loads: force read against force laid on.

use std::sync::Arc;

use taxel_engine::loads::{AreaFactor, Load};

use crate::document::{LoadPart, LoadsSummary};
use crate::moment::moment;

/// The loads that were read with this model set and not replaced by another, oldest first.
pub(crate) fn counting<'a>(loads: &'a [Arc<Load>], model_set: &str) -> Vec<&'a Load> {
    let replaced = |number: u64| loads.iter().any(|load| load.replaces == Some(number));
    let mut own: Vec<&Load> = loads.iter().map(Arc::as_ref).filter(|load| load.model_set == model_set).collect();
    own.retain(|load| !replaced(load.number));
    own.sort_by_key(|load| load.number);
    own
}

/// One load.
pub(crate) fn part(load: &Load) -> LoadPart {
    let sigma_n = load.read.sigma_n.hypot(load.force_sigma_n).hypot(load.scatter_of_mean_n());
    LoadPart {
        load: load.number,
        time: moment(load.wall_ns),
        by: load.by.clone(),
        note: load.note.clone(),
        mass_kg: load.mass_kg,
        force_n: load.force_n,
        force_sigma_n: load.force_sigma_n,
        read_n: load.read.mean_n,
        read_sigma_n: load.read.sigma_n,
        read_scatter_n: load.read.scatter_n,
        scans: load.read.scans,
        out_of_range: load.read.out_of_range,
        mean_area_mm2: load.mean_area_mm2,
        area_factor: load.area_factor,
        area_uncertainty: load.area_uncertainty,
        error_percent: 100.0 * load.error(),
        normalised_error: (load.read.mean_n - load.force_n) / (2.0 * sigma_n),
    }
}

/// All of them; `None` without any.
pub(crate) fn summary(loads: &[&Load]) -> Option<LoadsSummary> {
    let factor = AreaFactor::estimate(loads.iter().copied().filter(|load| load.read.out_of_range == 0));
    (!loads.is_empty()).then(|| LoadsSummary {
        loads: loads.len(),
        mean_absolute_error_percent: 100.0 * loads.iter().map(|load| load.error().abs()).sum::<f64>()
            / loads.len() as f64,
        within: loads.iter().filter(|load| part(load).normalised_error.abs() <= 1.0).count(),
        area_factor: factor.map(|factor| factor.value),
        area_factor_sigma: factor.map(|factor| factor.sigma),
        area_uncertainty: factor.map(|factor| factor.area_uncertainty),
        area_factor_doubt: factor.and_then(|factor| factor.doubt()).unwrap_or_default(),
    })
}
