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
    /// Its force at the activation threshold, N.
    pub(super) threshold_n: f32,
}

impl Share {
    /// Of a taxel whose zero is `rest`; `None` without a usable model or a zero.
    pub(super) fn of(tables: &Tables, rest: TaxelBaseline, activation: Activation, taxel: usize) -> Option<Self> {
        let (threshold_n, per_count) = at_threshold(tables, rest, activation, taxel)?;
        let noise_n = (per_count * rest.noise.max(NOISE_FLOOR_COUNTS)) as f32;
        let newton_per_count = (per_count * tables.sign(taxel)) as f32;
        // What single precision does not hold stays in the sum, which is no number then: such a taxel is not one without weight.
        let share = Self { newton_per_count, zero: rest.mean as f32, noise_n, threshold_n: threshold_n as f32 };
        rest.mean.is_finite().then_some(share)
    }
}

/// Force at the activation threshold of a taxel with the zero `rest`, and per count on the way there, N: the more of all of it and
/// of its first half, since a taxel with a dead zone shows the less of a load the lighter that is. `None` without a usable model.
fn at_threshold(tables: &Tables, rest: TaxelBaseline, activation: Activation, taxel: usize) -> Option<(f64, f64)> {
    let distance = activation.distance_counts(rest.noise);
    let newton = tables.threshold_n(taxel, distance)?;
    let half = 0.5 * distance;
    let half_n = tables.threshold_n(taxel, half)?;
    Some((newton, (newton / distance).max(half_n / half)))
}

/// How much a count more of each taxel weighs below its threshold, N, negative where counts fall with load; 0 where nothing
/// is known.
pub fn newton_per_count(tables: &Tables, zero: &[TaxelBaseline], activation: Activation) -> Vec<f64> {
    let of = |(taxel, &rest): (usize, &TaxelBaseline)| {
        let per_count = at_threshold(tables, rest, activation, taxel).map_or(0.0, |(_, per_count)| per_count);
        if per_count.is_finite() { per_count * tables.sign(taxel) } else { 0.0 }
    };
    zero.iter().enumerate().map(of).collect()
}
