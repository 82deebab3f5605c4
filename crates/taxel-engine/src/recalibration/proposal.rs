//! What the known loads of a patch propose for its active model set, and the set that comes of it.

use crate::loads::load::{Load, Validation};
use crate::loads::places::places;
use crate::model_set::{EARLIER_MAX, ModelSet, Recalibrated, RecordedTaxel};
use crate::recalibration::estimate::{GAINS, POINTS_MAX, Recalibration};
use crate::recalibration::points::{Assumptions, LoadPoint};

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
        if chosen.leave_out.contains(number) || judged.counts() {
            continue;
        }
        return Err(format!("load {number} cannot be taken: {}{}", judged.outdated_because, judged.left_out_because));
    }
    let taken = |load: &Load| {
        (chosen.loads.is_empty() || chosen.loads.contains(&load.number))
            && !chosen.leave_out.contains(&load.number)
            && load.model_set == source.id
    };
    let counted = view.loads.iter().filter(|judged| judged.counts()).map(|judged| judged.load.as_ref());
    let mut loads: Vec<&Load> = counted.filter(|load| taken(load)).take(POINTS_MAX).collect();
    loads.sort_by_key(|load| load.number);
    let points: Vec<LoadPoint> = loads.iter().copied().map(LoadPoint::of).collect();
    let places = places(loads.iter().map(|load| load.read.taxels.as_slice()));
    let found = Recalibration::of(&points, &places, assumptions)?;
    // All were read with the same areas, or they would not count.
    let read_with = loads.first().map_or((0.0, false), |load| (load.mean_area_mm2, load.filled));
    let set = corrected(source, &found, read_with, now_wall_ns);
    Ok(Proposal { found, set })
}

/// The corrected set, without an id: which taxels are usable, the counts at rest and the settings of the boards are those
/// of `source`; every pressure is corrected, and the uncertainty of the correction is in `gauge_gain_rel`, which the whole
/// skin shares. `read_with`: the mean area that the loads were read with, and whether
/// faulty taxels were filled then.
///
/// # Errors
/// In words: the recalibration is refused, or the gains of all corrections so far go beyond what a skin ages by.
pub fn corrected(
    source: &ModelSet,
    found: &Recalibration,
    (area_mm2, filled): (f64, bool),
    created_wall_ns: i64,
) -> Result<ModelSet, String> {
    if let Some(why) = found.refused_because.first() {
        return Err(why.clone());
    }
    let gain = found.line.gain;
    let before = source.recalibrated.as_ref().map_or(1.0, |earlier| earlier.gain_in_all);
    let gain_in_all = before * gain;
    if !GAINS.contains(&gain_in_all) {
        return Err(format!(
            "with the corrections before it the gain would be {gain_in_all:.3}, and no skin ages by more than {} to {}: \
             calibrate it in the bag",
            GAINS.start(),
            GAINS.end()
        ));
    }
    let earlier: Vec<String> = source.origins().map(str::to_owned).collect();
    if earlier.len() >= EARLIER_MAX {
        return Err(format!("`{}` was corrected {EARLIER_MAX} times already: calibrate it in the bag", source.id));
    }
    let taxel = |taxel: &RecordedTaxel| RecordedTaxel {
        sensitivity: taxel.sensitivity / gain,
        plays: taxel.plays.as_ref().map(|plays| plays.scaled(gain)),
    };
    let mut recorded = source.recorded.clone();
    if let Some(recorded) = &mut recorded {
        recorded.taxels.iter_mut().flatten().for_each(|one| *one = taxel(one));
    }
    let points = found.points.iter().map(|judged| judged.point).collect();
    let recalibrated = Recalibrated {
        derived_from: source.id.clone(),
        earlier,
        area_mm2,
        filled,
        gain,
        gain_sigma: found.gain_sigma(),
        place_rel: found.assumptions.place_rel,
        relative_sigma: found.relative_sigma(),
        gain_in_all,
        points,
    };
    Ok(ModelSet {
        id: String::new(),
        created_wall_ns,
        session: None,
        method: method(source, found),
        pressure_max_kpa: gain * source.pressure_max_kpa,
        gauge_gain_rel: source.gauge_gain_rel.hypot(found.relative_sigma()),
        gauge_offset_kpa: gain * source.gauge_offset_kpa,
        dead_zone_kpa: gain * source.dead_zone_kpa,
        taxels: source.taxels.iter().map(|model| model.scaled(gain, 0.0)).collect(),
        recorded,
        recalibrated: Some(recalibrated),
        ..source.clone()
    })
}

/// How the set came to be, in words. The words of an earlier correction are not repeated: the chain tells.
fn method(source: &ModelSet, found: &Recalibration) -> String {
    let first = source.method.split(WORDS).next().unwrap_or_default();
    let (gain, sigma, points) = (found.line.gain, found.gain_sigma(), found.points.len());
    format!("{first}{WORDS}{gain:.4} +- {sigma:.4} from {points} known loads")
}

/// What separates the words of the fit from those of the correction.
const WORDS: &str = ", recalibrated by ";
