//! What a calibration came to, before it is put to use.

use std::collections::BTreeMap;

use taxel_engine::model_set::ModelSet;

use crate::client::compare;
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
        if let Some((_, median, worst)) = crate::fit::spread(values) {
            say!("  {name}: median {median:.2} kPa, at worst {worst:.2} kPa");
        }
    };
    figure("error of the fit", usable().map(|model| model.quality.rmse_kpa).collect());
    figure("repeatability between ramps", usable().filter_map(|model| model.quality.repeatability_kpa).collect());
    match active {
        None => say!("  no other set is active"),
        Some(active) if active.id == set.id => say!("  it is the active set"),
        Some(active) => compare::print(&taxel_rpc::comparison(active, set), places),
    }
}
