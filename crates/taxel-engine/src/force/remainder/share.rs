//! What a taxel weighs below its activation threshold.

use crate::baseline::{Activation, NOISE_FLOOR_COUNTS, TaxelBaseline};
use crate::force::tables::Tables;

/// Standard uncertainties that the detection floor lies above the remainder: 95 %.
pub(super) const FLOOR_SIGMAS: f64 = 2.0;

/// A contact touches so many modules at the most that a fingertip or a known mass does.
pub(super) const CONTACT_MODULES: usize = 3;

/// One taxel's share in the remainder, by its raw count.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Share {
    /// Force per raw count, N; negative where counts fall with pressure. 0 for a taxel that is not selected.
    pub(super) newton_per_count: f32,
    /// Its zero, counts.
    pub(super) zero: f32,
    /// Noise of a single reading, N.
    pub(super) noise_n: f32,
    /// Its activation threshold, counts from its zero towards load.
    pub(super) threshold: f32,
}

impl Share {
    /// Of a taxel whose zero is `rest`; `None` without a usable model or a zero.
    pub(super) fn of(tables: &Tables, rest: TaxelBaseline, activation: Activation, taxel: usize) -> Option<Self> {
        let per_count = per_count_n(tables, rest, activation, taxel)?;
        let noise_n = (per_count * rest.noise.max(NOISE_FLOOR_COUNTS)) as f32;
        let newton_per_count = (per_count * tables.sign(taxel)) as f32;
        let threshold = activation.distance_counts(rest.noise) as f32;
        // What single precision does not hold stays in the sum, which is no number then: such a taxel is not one without weight.
        let share = Self { newton_per_count, zero: rest.mean as f32, noise_n, threshold };
        rest.mean.is_finite().then_some(share)
    }
}

/// Force per count below the activation threshold of a taxel with the zero `rest`, N: the more of all of the way there and of its
/// first half, since a taxel with a dead zone shows the less of a load the lighter that is. `None` without a usable model.
fn per_count_n(tables: &Tables, rest: TaxelBaseline, activation: Activation, taxel: usize) -> Option<f64> {
    let distance = activation.distance_counts(rest.noise);
    let per_count_n = |distance: f64| Some(tables.threshold_n(taxel, distance)? / distance);
    Some(per_count_n(distance)?.max(per_count_n(0.5 * distance)?))
}

/// How much a count more of each taxel weighs below its threshold, N, negative where counts fall with load; 0 where nothing
/// is known.
pub fn newton_per_count(tables: &Tables, zero: &[TaxelBaseline], activation: Activation) -> Vec<f64> {
    let of = |(taxel, &rest): (usize, &TaxelBaseline)| {
        let per_count = per_count_n(tables, rest, activation, taxel).unwrap_or(0.0);
        if per_count.is_finite() { per_count * tables.sign(taxel) } else { 0.0 }
    };
    zero.iter().enumerate().map(of).collect()
}
