//! Known loads: force read against force laid on.

use taxel_proto::v1::Load;

use super::budget::COVERAGE_FACTOR;
use super::document::{LoadPart, LoadsSummary};

/// The loads that were read with this model set and not replaced by another, oldest first.
pub(super) fn parts(loads: &[Load], model_set: &str) -> Vec<LoadPart> {
    let replaced = |number: u64| loads.iter().any(|load| load.replaces == number);
    let own = loads.iter().filter(|load| load.model_set == model_set && !replaced(load.load));
    let mut parts: Vec<LoadPart> = own.map(part).collect();
    parts.sort_by_key(|part| part.load);
    parts
}

fn part(load: &Load) -> LoadPart {
    let scatter_of_mean_n = load.read_scatter_n / f64::from(load.scans.max(1)).sqrt();
    let sigma_n = load.read_sigma_n.hypot(load.force_sigma_n).hypot(scatter_of_mean_n);
    LoadPart {
        load: load.load,
        time: load.time.as_ref().map(ToString::to_string).unwrap_or_default(),
        by: load.by.clone(),
        note: load.note.clone(),
        mass_kg: load.mass_kg,
        force_n: load.force_n,
        force_sigma_n: load.force_sigma_n,
        read_n: load.read_n,
        read_sigma_n: load.read_sigma_n,
        read_scatter_n: load.read_scatter_n,
        scans: load.scans,
        error_percent: 100.0 * (load.read_n / load.force_n - 1.0),
        normalised_error: (load.read_n - load.force_n) / (COVERAGE_FACTOR * sigma_n),
    }
}

/// All of them; `None` without any.
pub(super) fn summary(parts: &[LoadPart]) -> Option<LoadsSummary> {
    let sum: f64 = parts.iter().map(|load| load.error_percent.abs()).sum();
    (!parts.is_empty()).then(|| LoadsSummary {
        loads: parts.len(),
        mean_absolute_error_percent: sum / parts.len() as f64,
        within: parts.iter().filter(|load| load.normalised_error.abs() <= 1.0).count(),
    })
}
