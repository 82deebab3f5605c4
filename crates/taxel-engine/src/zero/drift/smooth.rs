//! Exponential means of unevenly spaced values.

use crate::statistics::exponential_share;

/// Time constant of the mean in which a touch shows, seconds.
const FAST_S: f64 = 0.5;
/// Time constant of the mean that is followed, seconds: half a minute of quiet gives a tenth of a count of a taxel with
/// a count of noise.
const SLOW_S: f64 = 10.0;

/// What a new value counts in a mean after a step of `dt`: `1 - exp(-dt / tau)`, exact for any step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shares {
    pub(super) dt_s: f64,
    pub(super) fast: f64,
    pub(super) slow: f64,
}

impl Shares {
    /// For a step of `dt_s` seconds, 0 or more.
    pub(super) fn of(dt_s: f64) -> Self {
        Self { dt_s, fast: exponential_share(dt_s, FAST_S), slow: exponential_share(dt_s, SLOW_S) }
    }
}

/// An exponential mean; its weights add up to one from the first value on.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Smooth {
    mean: f64,
    /// How much of the full weight the values so far have, 0 to 1.
    weight: f64,
}

impl Smooth {
    /// Takes a value whose share is 0 to 1.
    pub(super) fn push(&mut self, value: f64, share: f64) {
        self.weight += share * (1.0 - self.weight);
        if self.weight > 0.0 {
            self.mean += share / self.weight * (value - self.mean);
        }
    }

    /// The mean, once its values have this share of the full weight.
    pub(super) fn mean(&self, weight_min: f64) -> Option<f64> {
        (self.weight >= weight_min).then_some(self.mean)
    }

    /// Whether no value has any weight yet.
    pub(super) fn is_empty(&self) -> bool {
        self.weight == 0.0
    }

    /// Forgets everything.
    pub(super) fn restart(&mut self) {
        *self = Self::default();
    }
}
