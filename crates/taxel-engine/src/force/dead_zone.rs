//! What a touch bears before its counts begin to move, as on skin with friction between its layers (play): the dead zone.
//!
//! A load on such a skin shows nothing at first, so the edge of a contact is lost. And what is left of a load that has gone stays in the
//! counts until the next one, half of the width of the play on a skin that was never pressed: as much as its first ramp's dead
//! zone. On a skin that creeps it has gone by then. Counts at rest tell neither from the other; the calibration does.

use taxel_model::TaxelModel;

use crate::baseline::{Activation, TaxelBaseline};
use crate::model_set::ModelSet;
use crate::statistics::median;

/// The dead zone of a skin at a zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct DeadZone {
    /// What of the residue that the zero was taken with the next load finds again, counts.
    pub(super) stays_counts: f64,
    /// What lies on a taxel where its counts begin to move, kPa.
    pub(super) kpa: f64,
}

impl DeadZone {
    /// Of a set, at a zero that lies `residue_counts` towards load from that of its models.
    pub(super) fn of(set: &ModelSet, activation: Activation, residue_counts: f64) -> Self {
        // Where counts move, from a touch to twice that.
        let kpa_per_count = |(model, zero): (&TaxelModel, &TaxelBaseline)| {
            let step = activation.distance_counts(zero.noise);
            let kpa = |steps: f64| model.evaluate(zero.mean + model.sign.as_f64() * steps * step);
            Some((kpa(2.0)?.kpa - kpa(1.0)?.kpa) / step).filter(|_| model.is_usable())
        };
        let slopes = set.taxels.iter().zip(&set.baseline).filter_map(kpa_per_count);
        let Some(kpa_per_count) = median(slopes).filter(|slope| *slope > 0.0) else { return Self::default() };
        let stays_counts = residue_counts.min(set.dead_zone_kpa / kpa_per_count);
        Self { stays_counts, kpa: set.dead_zone_kpa + stays_counts * kpa_per_count }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::force::tests::{ACTIVATION, set};

    /// A count for each kPa.
    #[test]
    fn what_stays_of_a_residue_is_no_more_than_the_dead_zone_explains() {
        let skin = |dead_zone_kpa: f64| ModelSet { dead_zone_kpa, ..ModelSet::clone(&set(5)) };
        let at = |dead_zone_kpa, residue_counts| DeadZone::of(&skin(dead_zone_kpa), ACTIVATION, residue_counts);
        let near = |is: DeadZone, [counts, kpa]: [f64; 2]| {
            assert!((is.stays_counts - counts).abs() < 0.02 && (is.kpa - kpa).abs() < 0.02, "{is:?}");
        };
        near(at(0.0, 1.0), [0.0, 0.0]);
        near(at(0.8, 0.0), [0.0, 0.8]);
        near(at(0.8, 1.2), [0.8, 1.6]);
        near(at(0.8, 0.5), [0.5, 1.3]);
    }
}
