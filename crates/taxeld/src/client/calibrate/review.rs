//! What a calibration came to, before it is put to use.

use std::collections::BTreeMap;

use taxel_engine::comparison::Comparison;
use taxel_engine::model_set::ModelSet;

use crate::client::places::Places;

/// Prints a set, against the one that is active.
pub fn print(set: &ModelSet, active: Option<&ModelSet>, places: &Places) {
    say!();
    say!("model set {}: {}, up to {:.1} kPa", set.id, set.method, set.pressure_max_kpa);
    let usable = || set.taxels.iter().filter(|model| model.is_usable());
    say!("  {} of {} taxels usable", usable().count(), set.taxels.len());
    let mut excluded: BTreeMap<&str, Vec<u32>> = BTreeMap::new();
    for (taxel, model) in (0_u32..).zip(&set.taxels).filter(|(_, model)| !model.is_usable()) {
        excluded.entry(model.status.code()).or_default().push(taxel);
    }
    for (reason, taxels) in excluded {
        say!("    {} {reason}: {}", taxels.len(), places.name(taxels.iter().copied()));
    }
    let figure = |name: &str, values: Vec<f64>| {
        if let Some((_, median, worst)) = crate::values::spread(values) {
            say!("  {name}: median {median:.2} kPa, at worst {worst:.2} kPa");
        }
    };
    figure("error of the fit", usable().map(|model| model.quality.rmse_kpa).collect());
    figure("repeatability between ramps", usable().filter_map(|model| model.quality.repeatability_kpa).collect());
    match active {
        None => say!("  no other set is active"),
        Some(active) if active.id == set.id => say!("  it is the active set"),
        Some(active) => print_change(active, set, places),
    }
}

/// What changes if the set takes the place of the active one; `taxel-lab compare` says more.
fn print_change(active: &ModelSet, set: &ModelSet, places: &Places) {
    let compared = Comparison::of(active, set);
    let ratios = compared.taxels.iter().filter_map(|taxel| taxel.gain_ratio).collect();
    if let Some([low, median, high]) =
        crate::values::spread(ratios).map(|(a, b, c)| [a, b, c].map(|r| 100.0 * (r - 1.0)))
    {
        say!("  pressure at equal counts, against {}: median {median:+.1} %, {low:+.1} % to {high:+.1} %", active.id);
    }
    let lines = [("no longer usable", &compared.lost), ("newly usable", &compared.became_usable)];
    for (what, taxels) in lines.iter().filter(|(_, taxels)| !taxels.is_empty()) {
        say!("    {} {what}: {}", taxels.len(), places.name(taxels.iter().copied()));
    }
}
