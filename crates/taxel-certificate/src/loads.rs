//! Known loads: force read against force laid on.

use std::sync::Arc;

use taxel_engine::loads::{JudgedLoad, Load, Patch, Validation, judge};

use crate::document::{LoadPart, LoadsSummary};
use crate::moment::moment;

/// The loads that were read with this model set and not replaced by another, oldest first, judged as the service does. What the
/// skin's areas and its filling are now is taken from the newest: these change with the configuration, which may not be at hand.
pub(crate) fn judged(loads: &[Arc<Load>], model_set: &str) -> Validation {
    let replaced = |number: u64| loads.iter().any(|load| load.replaces == Some(number));
    let mut own: Vec<Arc<Load>> = loads.iter().filter(|load| load.model_set == model_set).cloned().collect();
    own.retain(|load| !replaced(load.number));
    own.sort_by_key(|load| load.number);
    let newest = own.last().map(|load| (load.patch.clone(), load.mean_area_mm2, load.filled.unwrap_or_default()));
    let (name, mean_area_mm2, fills) = newest.unwrap_or_default();
    let patch = Patch { name: &name, mean_area_mm2, fills };
    let mut validation = judge(patch, &own, Some(model_set.to_owned()));
    validation.loads.reverse();
    validation
}

/// One load.
pub(crate) fn part(judged: &JudgedLoad) -> LoadPart {
    let load = judged.load.as_ref();
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
        reasons: load.read.reasons.clone(),
        filled_share: load.read.filled_share,
        filled: load.filled,
        mean_area_mm2: load.mean_area_mm2,
        area_factor: load.area_factor,
        area_uncertainty: load.area_uncertainty,
        error_percent: 100.0 * load.error(),
        normalised_error: (load.read.mean_n - load.force_n) / (2.0 * sigma_n),
        outdated_because: judged.outdated_because.clone(),
        left_out_because: judged.left_out_because.clone(),
    }
}

/// All of them; `None` without any.
pub(crate) fn summary(validation: &Validation) -> Option<LoadsSummary> {
    let factor = validation.factor.as_ref();
    let count = || validation.loads.iter().filter(|judged| judged.outdated_because.is_empty());
    Some(LoadsSummary {
        loads: count().count(),
        mean_absolute_error_percent: 100.0 * validation.mean_absolute_error?,
        within: count().filter(|judged| part(judged).normalised_error.abs() <= 1.0).count(),
        in_factor: count().filter(|judged| judged.in_factor()).count(),
        area_factor: factor.map(|factor| factor.value),
        area_factor_sigma: factor.map(|factor| factor.sigma),
        area_uncertainty: factor.map(|factor| factor.area_uncertainty),
        area_factor_doubt: factor.and_then(|factor| factor.doubt()).unwrap_or_default(),
    })
}
