//! Two model sets of one patch against each other.

use taxel_engine::model_set::ModelSet;
use taxel_proto::v1::{ExportModelSetRequest, ModelSetComparison, TaxelComparison};
use taxel_store::models_json;

use super::connect::Daemon;
use super::failure::Outcome;
use super::places::Places;

/// A taxel whose pressure changed by more is named.
const NAMED_PERCENT: f64 = 10.0;

/// A model set with everything in it; an empty id is the active one.
///
/// # Errors
/// No such set, one that cannot be read, or no daemon.
pub async fn fetch(daemon: &Daemon, model_set: &str) -> Outcome<ModelSet> {
    let request = ExportModelSetRequest { model_set: model_set.to_owned(), patch: daemon.patch() };
    let json = daemon.models().export_model_set(request).await?.into_inner().json;
    Ok(models_json::from_json(&json).map_err(anyhow::Error::new)?)
}

/// Prints what changed; taxels by place.
pub fn print(compared: &ModelSetComparison, places: &Places) {
    let id = |summary: &Option<taxel_proto::v1::ModelSetSummary>| {
        summary.as_ref().map(|set| set.model_set.clone()).unwrap_or_default()
    };
    say!("  {} against {}:", id(&compared.later), id(&compared.earlier));
    let spread = |figure: fn(&TaxelComparison) -> Option<f64>| {
        crate::fit::spread(compared.taxels.iter().filter_map(figure).collect())
    };
    if let Some((low, median, high)) = spread(change_percent) {
        say!("    pressure read at equal counts from rest: median {median:+.1} %, {low:+.1} % to {high:+.1} %");
    }
    if let Some((_, median, worst)) = spread(|taxel| taxel.rms_kpa) {
        say!("    difference: median {median:.2} kPa, at worst {worst:.2} kPa (root mean square of a taxel)");
    }
    if let Some((median, worst)) = compared.median_kpa.zip(compared.worst_kpa) {
        say!("    pressure read: {median:+.2} kPa in the median of the taxels, {worst:+.2} kPa where it differs most");
    }
    if let Some((low, median, high)) = spread(|taxel| taxel.rest_counts) {
        say!("    counts at rest moved: median {median:+.2}, {low:+.2} to {high:+.2}");
    }
    let lines = [("no longer usable", &compared.lost), ("newly usable", &compared.became_usable)];
    for (what, taxels) in lines.iter().filter(|(_, taxels)| !taxels.is_empty()) {
        say!("    {} {what}: {}", taxels.len(), places.name(taxels.iter().copied()));
    }
    let changed = compared.taxels.iter().filter(|taxel| change_percent(taxel).is_some_and(|c| c.abs() > NAMED_PERCENT));
    let far: Vec<u32> = changed.map(|taxel| taxel.taxel).collect();
    if !far.is_empty() {
        say!("    {} changed by more than {NAMED_PERCENT} %: {}", far.len(), places.name(far.iter().copied()));
    }
}

fn change_percent(taxel: &TaxelComparison) -> Option<f64> {
    taxel.gain_ratio.map(|ratio| 100.0 * (ratio - 1.0))
}
