//! What the known loads of a patch propose for its active model set.

use crate::loads::load::Load;
use crate::loads::places::LaidAt;
use crate::loads::validation::Validation;
use crate::model_set::ModelSet;
use crate::recalibration::assumptions::Assumptions;
use crate::recalibration::corrected::corrected;
use crate::recalibration::estimate::{POINTS_MAX, Recalibration};
use crate::recalibration::evidence::LoadPoint;

/// A recalibration of a model set, not in use and not kept.
#[derive(Clone, Debug)]
pub struct Proposal {
    /// What the loads say.
    pub found: Recalibration,
    /// The set that comes of it, without an id; or why there is none.
    pub set: Result<ModelSet, String>,
}

/// Which known loads are taken.
#[derive(Clone, Debug, Default)]
pub struct Chosen {
    /// Their numbers; empty: the newest of those that count.
    pub loads: Vec<u64>,
    /// Numbers of loads that are not taken.
    pub leave_out: Vec<u64>,
}

/// What the known loads in `view` propose for `source`, which is the active set.
///
/// Loads that were read with another set or with other areas are outdated, and one beyond the calibrated range or under a
/// DEGRADED force is only a lower bound: none of them is taken.
///
/// # Errors
/// In words: a load that is named and cannot be taken, or fewer loads than it takes.
pub fn propose(
    view: &Validation,
    source: &ModelSet,
    chosen: &Chosen,
    assumptions: Assumptions,
    now_wall_ns: i64,
) -> Result<Proposal, String> {
    for number in chosen.loads.iter().chain(&chosen.leave_out) {
        let judged = view.loads.iter().find(|judged| judged.load.number == *number);
        let judged = judged.ok_or_else(|| format!("patch `{}` has no load {number}", view.patch))?;
        if chosen.leave_out.contains(number) || judged.in_factor() {
            continue;
        }
        let why = match (&judged.outdated_because, &judged.load.read) {
            (outdated, _) if !outdated.is_empty() => outdated.clone(),
            (_, read) if read.out_of_range > 0 => {
                "it went beyond the calibrated range, so what was read is a lower bound".to_owned()
            }
            (_, read) => format!("the force was DEGRADED under it: {}", read.reasons.join("; ")),
        };
        return Err(format!("load {number} cannot be taken: {why}"));
    }
    let taken = |load: &Load| {
        (chosen.loads.is_empty() || chosen.loads.contains(&load.number))
            && !chosen.leave_out.contains(&load.number)
            && load.model_set == source.id
    };
    let counted = view.loads.iter().filter(|judged| judged.in_factor()).map(|judged| judged.load.as_ref());
    let mut loads: Vec<&Load> = counted.filter(|load| taken(load)).take(POINTS_MAX).collect();
    loads.sort_by_key(|load| load.number);
    let points: Vec<LoadPoint> = loads.iter().copied().map(LoadPoint::of).collect();
    let found = Recalibration::at(&points, &LaidAt::of(&loads), assumptions)?;
    let first = view.loads.iter().find(|judged| judged.in_factor()).map(|judged| &judged.load);
    // Of an earlier version that is not known, and one that is known says it of all: the others are outdated.
    let filled = loads.iter().find_map(|load| load.filled);
    let set = corrected(source, &found, first.map(|load| (load.mean_area_mm2, filled)), now_wall_ns);
    Ok(Proposal { found, set })
}
