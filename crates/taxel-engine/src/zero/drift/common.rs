//! What all modules have in common: how much of it is warmth, and how much may be a load.
//!
//! Counts of one moment do not tell a skin that warms up everywhere from one that is pressed everywhere. The pads do, for no
//! load reaches them: what they explain is their movement times a coefficient that is learned while they move. What is
//! left may be a load, and is followed towards load by as many counts as [`ABSORBED_MAX`] presses with on the whole patch,
//! counted from where the skin was lightest. Away from load nothing can hide: there it is [`UNEXPLAINED_COUNTS`].

use taxel_skin::Newton;

use super::coefficient::Coefficient;
use super::limits::{ABSORBED_MAX, UNEXPLAINED_COUNTS};

/// The common mode of a patch.
#[derive(Clone, Debug, Default)]
pub(super) struct Common {
    coefficient: Coefficient,
    /// How far the pads of the untouched modules have moved since the zero, in the slow mean that is followed, counts ...
    pads: f64,
    /// ... and those of all modules by now.
    pads_now: f64,
    /// Least and greatest that the pads have left unexplained since the zero, counts.
    left: [f64; 2],
    /// Force per count of each module as a whole, N, negative where counts fall with load; empty while nobody knows.
    newton_per_count: Vec<f64>,
}

/// How the patch warms, for a module that knows nothing of its own.
#[derive(Clone, Copy, Debug)]
pub(super) struct Warming {
    /// Counts of its taxels per count of the pads, with the standard uncertainty.
    pub(super) coefficient: f64,
    pub(super) sigma: f64,
    /// How far the pads of all modules have moved since the zero, counts.
    pub(super) pads: f64,
}

/// What a module heads for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Allowed {
    /// In all, counts.
    pub(super) counts: f64,
    /// What of it the pads do not explain, counts.
    pub(super) unexplained: f64,
}

impl Common {
    /// A new zero: nothing is learned.
    pub(super) fn begin(&mut self) {
        *self = Self { newton_per_count: std::mem::take(&mut self.newton_per_count), ..Self::default() };
    }

    /// What a count of each module weighs.
    pub(super) fn weigh(&mut self, newton_per_count: Vec<f64>) {
        self.newton_per_count = newton_per_count;
    }

    /// All untouched modules together, counts from their zero.
    pub(super) fn look(&mut self, common: f64, pads: f64) {
        self.coefficient.learn(pads, common);
        self.pads = pads;
        let left = (common - self.explained(pads)).clamp(-UNEXPLAINED_COUNTS, UNEXPLAINED_COUNTS);
        self.left = [self.left[0].min(left), self.left[1].max(left)];
    }

    /// The pads of all modules, counts from their zero.
    pub(super) fn feel(&mut self, pads: f64) {
        self.pads_now = pads;
    }

    pub(super) fn warming(&self) -> Warming {
        let (coefficient, sigma) = self.coefficient.estimate();
        Warming { coefficient, sigma, pads: self.pads_now }
    }

    /// What of `common` a module may follow whose others' pads have moved by `pads`.
    pub(super) fn allowed(&self, common: f64, pads: f64) -> Allowed {
        let explained = self.explained(pads);
        let per_count = self.per_count_n();
        let most = if per_count == 0.0 { UNEXPLAINED_COUNTS } else { ABSORBED_MAX.0 / per_count.abs() };
        let (mut low, mut high) = (-UNEXPLAINED_COUNTS, UNEXPLAINED_COUNTS);
        if per_count < 0.0 {
            low = low.max(self.left[1] - most);
        } else {
            high = high.min(self.left[0] + most);
        }
        let unexplained = (common - explained).clamp(low, high);
        Allowed { counts: explained + unexplained, unexplained }
    }

    /// How much of a load on everything may have gone into the zero, if the modules follow what the pads leave unexplained
    /// by these counts.
    pub(super) fn absorbed(&self, unexplained: impl Iterator<Item = f64>) -> Newton {
        let lightest = if self.per_count_n() < 0.0 { self.left[1] } else { self.left[0] };
        let force = |(counts, newton_per_count): (f64, &f64)| newton_per_count * (counts - lightest);
        Newton(unexplained.zip(&self.newton_per_count).map(force).sum::<f64>().max(0.0))
    }

    /// Standard uncertainty of what is followed, counts, if `absorbed` may have gone into it: it may as well be anything
    /// up to that. `followed` is how much of what the pads explain was followed so far. What is not, because it is too
    /// young, too fast or beyond the bound, is uncertain as a whole: where all of the skin is touched nothing but the pads
    /// tells of it.
    pub(super) fn sigma_counts(&self, absorbed: Newton, followed: f64) -> f64 {
        let per_count = self.per_count_n().abs();
        let absorbed = if per_count > 0.0 { absorbed.0 / per_count / 3.0_f64.sqrt() } else { 0.0 };
        let by_coefficient = self.coefficient.estimate().1 * self.pads.abs().max(self.pads_now.abs());
        let behind = self.explained(self.pads_now) - followed;
        absorbed.hypot(by_coefficient).hypot(behind)
    }

    fn explained(&self, pads: f64) -> f64 {
        self.coefficient.estimate().0 * pads
    }

    fn per_count_n(&self) -> f64 {
        self.newton_per_count.iter().sum()
    }
}
