//! What `taxel-lab fit` says of a model set.

use std::collections::BTreeMap;

use taxel_engine::model_set::ModelSet;

use crate::numbers::spread;

/// Prints what a model set holds: how many taxels of which status, and how good they are.
pub(super) fn print(set: &ModelSet) {
    say!("model set {} of patch {}: {}", set.id, set.patch, set.method);
    let mut reasons: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (taxel, model) in set.taxels.iter().enumerate().filter(|(_, model)| !model.is_usable()) {
        reasons.entry(model.status.code()).or_default().push(taxel);
    }
    let usable = || set.taxels.iter().filter(|model| model.is_usable());
    say!("  taxels: {} of {} usable", usable().count(), set.taxels.len());
    for (reason, taxels) in &reasons {
        let numbers: Vec<String> = taxels.iter().map(ToString::to_string).collect();
        say!("    {} {reason}: {}", taxels.len(), numbers.join(" "));
    }
    let figure = |name: &str, values: Vec<f64>, unit: &str| {
        if let Some((low, middle, high)) = spread(values) {
            say!("  {name}: median {middle:.3} {unit}, {low:.3} to {high:.3}");
        }
    };
    figure("RMSE of the static fit", usable().map(|model| model.quality.rmse_kpa).collect(), "kPa");
    if set.dead_zone_kpa > 0.0 {
        say!("  dead zone: {:.2} kPa, below which the skin does not answer", set.dead_zone_kpa);
    }
    let Some(recorded) = &set.recorded else { return };
    if let Some(share) = recorded.unloading_share {
        say!("  a pressure that falls is read off by {:.1} %", 100.0 * share);
    }
    let plays = recorded.taxels.iter().flatten().filter(|taxel| taxel.plays.is_some()).count();
    let left = recorded.plays_error_ratio.map(|ratio| {
        format!("; on the branch kept from the fit they leave {:.0} % of the static error", 100.0 * ratio)
    });
    say!("  plays: {plays} taxels{}", left.unwrap_or_default());
}
