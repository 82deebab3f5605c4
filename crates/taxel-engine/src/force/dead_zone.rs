//! What a touch bears before its counts begin to move, as skin with friction between its layers does: the dead zone.
//!
//! A load on such a skin shows nothing at first, so the edge of a contact is lost, and what is left of a load that has gone stays in the
//! counts until the next one (`play`, half of its width on a skin that was never pressed). On a skin that creeps it has gone by
//! then. Counts at rest tell neither from the other; the curve does, because a curve that begins late does not begin at no pressure
//! where it is extended from what was touched to no counts.

use taxel_model::TaxelModel;

use crate::baseline::{Activation, TaxelBaseline};
use crate::model_set::ModelSet;
use crate::statistics::median;

/// A fit of one ramp smooths a dead zone away, of made-up skins by half in the mean.
const SMOOTHED: f64 = 2.0;

/// Pressure of a taxel at once, twice and three times the distance of a touch from its zero, kPa, and that distance, counts. `None`
/// of a polynomial, which may turn there and tells nothing.
fn touched(model: &TaxelModel, zero: TaxelBaseline, activation: Activation) -> Option<([f64; 3], f64)> {
    model.points.as_ref().filter(|_| model.is_usable() && zero.mean.is_finite())?;
    let step = activation.distance_counts(zero.noise);
    let kpa = |steps: f64| model.evaluate(zero.mean + model.sign.as_f64() * steps * step).map(|reading| reading.kpa);
    Some(([kpa(1.0)?, kpa(2.0)?, kpa(3.0)?], step))
}

/// What a taxel bears where its counts begin to move, kPa, not negative: by a line, which is none too much where a curve without a
/// dead zone bends.
pub(super) fn dead_kpa(model: &TaxelModel, zero: TaxelBaseline, activation: Activation) -> f64 {
    touched(model, zero, activation).map_or(0.0, |([one, two, _], _)| (2.0 * one - two).max(0.0))
}

/// How far the counts of a skin stay towards load after one, because of its dead zone: by a parabola, median over its taxels, not
/// negative.
pub(super) fn stays_counts(set: &ModelSet, activation: Activation) -> f64 {
    let of_taxel = |(model, zero): (&TaxelModel, &TaxelBaseline)| {
        let ([one, two, three], step) = touched(model, *zero, activation)?;
        Some((3.0 * (one - two) + three) * step / (two - one)).filter(|counts| counts.is_finite())
    };
    let counts = median(set.taxels.iter().zip(&set.baseline).filter_map(of_taxel));
    SMOOTHED * counts.unwrap_or(0.0).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::force::tests::{ACTIVATION, REST, rest, set};
    use taxel_model::Points;

    /// Two counts a kPa beyond `dead_kpa`, which saturate towards `top`.
    fn skin(dead_kpa: f64, top: f64) -> ModelSet {
        let kpa = |counts: f64| dead_kpa + counts / (2.0 * (1.0 - counts / top));
        let mut set = ModelSet::clone(&set(5));
        for model in &mut set.taxels {
            let counts: Vec<f64> = (0..=60).map(f64::from).collect();
            let points = counts.iter().rev().map(|counts| (f64::from(REST) - counts, kpa(*counts)));
            let (counts, kpa) = points.unzip();
            (model.points, model.curve) = (Some(Points::new(counts, kpa)), None);
        }
        set
    }

    #[test]
    fn a_dead_zone_is_told_from_a_curve_that_bends() {
        for (dead_kpa, top) in [(0.0, 1e9), (0.8, 1e9), (0.0, 80.0), (0.8, 80.0)] {
            let set = skin(dead_kpa, top);
            let (of_one, stays) =
                (super::dead_kpa(&set.taxels[0], rest(1)[0], ACTIVATION), stays_counts(&set, ACTIVATION));
            assert!((of_one - dead_kpa).abs() < 0.35 && of_one <= dead_kpa + 1e-9, "{of_one} kPa of {dead_kpa}");
            assert!((stays - SMOOTHED * 2.0 * dead_kpa).abs() < 0.4, "{stays} counts of {dead_kpa} kPa");
        }
        let polynomial = set(5);
        assert_eq!(super::dead_kpa(&polynomial.taxels[0], rest(1)[0], ACTIVATION), 0.0);
        assert_eq!(stays_counts(&polynomial, ACTIVATION), 0.0);
    }
}
