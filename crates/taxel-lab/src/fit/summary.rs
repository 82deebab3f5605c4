//! What `taxel-lab fit` says of a model set.

use std::collections::BTreeMap;

use taxel_engine::model_set::ModelSet;
use taxel_model::Flag;

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
        say!("    {} {reason}: {}", taxels.len(), listed(taxels));
    }
    let figure = |name: &str, values: Vec<f64>, unit: &str| {
        if let Some((low, middle, high)) = spread(values) {
            say!("  {name}: median {middle:.3} {unit}, {low:.3} to {high:.3}");
        }
    };
    figure("RMSE of the static fit", usable().map(|model| model.quality.rmse_kpa).collect(), "kPa");
    figure("swing", usable().map(|model| model.quality.swing_counts).collect(), "counts");
    print_flags(set);
    let Some(recorded) = &set.recorded else { return };
    let in_use = || recorded.taxels.iter().flatten();
    figure("RMSE in use, smoothed", in_use().map(|taxel| taxel.rmse_kpa).collect(), "kPa");
    figure("hysteresis", in_use().filter_map(|taxel| taxel.hysteresis_kpa).collect(), "kPa");
    let plays = in_use().filter(|taxel| taxel.plays.is_some()).count();
    match recorded.plays_error_ratio {
        Some(ratio) => say!(
            "  plays: {plays} taxels; on the branch kept from the fit they leave {:.0} % of the static error",
            100.0 * ratio
        ),
        None => say!("  plays: {plays} taxels"),
    }
    match recorded.zero_return {
        Some(zero) => say!("  zero after the load has gone: {:.2} counts off (root mean square)", zero.rms),
        None => say!("  zero after the load has gone: not measured, the recording does not end at rest"),
    }
    if let Some(clock) = recorded.clock {
        let use_of_it = if clock.applied { "used" } else { "not used" };
        say!(
            "  clock of the gauge: {:+.2} s late, {:+.3} % fast; where it was not found it leaves {:.0} % of the error: {use_of_it}",
            clock.offset_s,
            100.0 * clock.rate,
            100.0 * clock.error_ratio
        );
    }
    if recorded.lag_s != 0.0 {
        let use_of_it = if set.session.is_some() { "not taken out: one clock pairs them" } else { "taken out" };
        say!("  lag of the gauge behind the counts: {:.3} s, {use_of_it}", recorded.lag_s);
    }
}

/// Prints which of the fits are not what was asked for, or not of all that was there.
fn print_flags(set: &ModelSet) {
    let mut kinds: BTreeMap<&str, Vec<(usize, &Flag)>> = BTreeMap::new();
    for (taxel, model) in set.taxels.iter().enumerate().filter(|(_, model)| model.curve.is_some()) {
        for flag in &model.flags {
            if let Some(kind) = told(flag) {
                kinds.entry(kind).or_default().push((taxel, flag));
            }
        }
    }
    for (kind, flagged) in kinds {
        let mut taxels: Vec<usize> = flagged.iter().map(|(taxel, _)| *taxel).collect();
        taxels.dedup(); // a taxel may have clipped readings at both ends
        say!("  {kind}: {} ({}); the first: {}", taxels.len(), listed(&taxels), flagged[0].1);
    }
}

/// What is said of a flag that changes the curve, or what it was made from.
fn told(flag: &Flag) -> Option<&'static str> {
    match flag {
        Flag::Repaired { .. } => Some("repaired to be monotone"),
        Flag::NotMonotone { .. } => Some("not monotone"),
        Flag::RankReduced { .. } => Some("of a lower order than asked for"),
        Flag::RailDropped { .. } => Some("clipped readings left out"),
        Flag::Rejected { .. } => Some("values left out that are not finite or beyond 1e15"),
        Flag::Dropouts { .. }
        | Flag::FewDistinctCounts { .. }
        | Flag::HighLeverage { .. }
        | Flag::Gap { .. }
        | Flag::NotBinned { .. } => None,
    }
}

/// The first taxels of a list.
fn listed(taxels: &[usize]) -> String {
    const MOST: usize = 12;
    let shown: Vec<String> = taxels.iter().take(MOST).map(ToString::to_string).collect();
    format!("{}{}", shown.join(" "), if taxels.len() > MOST { " ..." } else { "" })
}
