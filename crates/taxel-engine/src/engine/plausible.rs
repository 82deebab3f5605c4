//! Whether the curves of a model set from elsewhere can be those of a patch. A set that was scaled, turned over or damaged
//! on its way reads as a force that nobody would doubt.

use taxel_model::{Curve, Plays, Sign};
use taxel_skin::Kilopascal;

use crate::model_set::ModelSet;

/// A calibration that went further than this many times the pressure that the patch is calibrated to is not its own.
const TARGETS_MAX: f64 = 10.0;

/// Within its range a curve lies between these shares of the pressure that the calibration reached: below zero and above
/// that pressure it may err by half of it.
const SHARES: [f64; 2] = [-0.5, 1.5];

/// Places of the range that are looked at. A curve has at most ten turns.
const PLACES: u32 = 64;

/// What cannot be so about a set, if anything: `target` is the pressure that the patch is calibrated to.
pub(super) fn implausible(set: &ModelSet, target: Kilopascal) -> Option<String> {
    let (most, limit) = (set.pressure_max_kpa, TARGETS_MAX * target.0);
    let mut usable = set.taxels.iter().enumerate().filter(|(_, model)| model.is_usable()).peekable();
    if usable.peek().is_some() && !(most > 0.0 && most <= limit) {
        return Some(format!("`pressure_max_kpa` is {most}, expected more than 0 and at most {limit} for this patch"));
    }
    for (taxel, model) in usable {
        let own = model.curve.as_ref().zip(model.range).map(|(curve, range)| (curve, range, model.sign));
        let plays = set.plays(taxel);
        let with_plays = plays.map(|plays| (&plays.curve, plays.range, plays.sign));
        let problem = own.into_iter().chain(with_plays).find_map(|(curve, range, sign)| odd(curve, range, sign, most));
        if let Some(problem) = problem {
            return Some(format!("taxel {taxel}: {problem}"));
        }
        let lag = |plays: &Plays| plays.radii_counts.iter().zip(&plays.weights_kpa).map(|(r, w)| r * w).sum();
        let lag_kpa: f64 = plays.map_or(0.0, lag);
        if lag_kpa.is_nan() || lag_kpa > most {
            return Some(format!(
                "taxel {taxel}: its hysteresis is {lag_kpa} kPa, the calibration went up to {most} kPa"
            ));
        }
    }
    None
}

/// What cannot be so about a curve of a calibration up to `most` kPa.
fn odd(curve: &Curve, [low, high]: [f64; 2], sign: Sign, most: f64) -> Option<String> {
    let (least, greatest) = (SHARES[0] * most, SHARES[1] * most);
    for place in 0..=PLACES {
        let count = low + (high - low) * f64::from(place) / f64::from(PLACES);
        let kpa = curve.evaluate(count);
        if !(least..=greatest).contains(&kpa) {
            return Some(format!("its curve gives {kpa} kPa at count {count}, expected {least} to {greatest} kPa"));
        }
    }
    let rise = sign.as_f64() * (curve.evaluate(high) - curve.evaluate(low));
    let (from, to) = (curve.evaluate(low), curve.evaluate(high));
    (rise < 0.0).then(|| format!("its curve goes from {from} to {to} kPa, against its `sign`"))
}
