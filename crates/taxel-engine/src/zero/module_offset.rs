//! The offset of one module: where it is, how it goes with the thermal pads, and how well both are known.
//!
//! `db = k dT + dW`, all in counts towards load. Boards leave a quarter to all of the warmth, so the coefficient `k` of a module
//! is that of its patch give or take [`BETWEEN_MODULES`], and that of a patch is known to be [`GUESS`] give or take
//! [`GUESS_SIGMA`] counts per count of the pads before anything is seen. The variance of `b` is that of its last reading, what it
//! has wandered since, and `(dT sigma_k)^2` of what the pads have moved since. Both are scalar Kalman filters: `k` is read over
//! stretches in which the pads move by [`LEARN_COUNTS`], since over shorter ones their noise would make it zero.

/// Coefficient of a patch before anything is seen, and its standard uncertainty.
pub(super) const GUESS: f64 = 0.62;
pub(super) const GUESS_SIGMA: f64 = 0.25;
/// How far the coefficient of one module lies from that of the patch, standard deviation.
pub(super) const BETWEEN_MODULES: f64 = 0.15;
/// What the pads explain of an offset, counts per count: so much of cold, and so much of warmth. More may be a load.
const EXPLAINED: [f64; 2] = [0.5, 1.0];
/// Pads have to move so far before they tell of the coefficient, counts: twenty times the noise of their mean.
const LEARN_COUNTS: f64 = 2.0;
/// More than the noise of a module's pads: they have stepped, counts.
const PADS_STEP: f64 = 2.5;

/// One module; counts are turned so that load is positive.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ModuleOffset {
    offset: f64,
    /// But for what the pads have moved since the last reading.
    variance: f64,
    coefficient: f64,
    coefficient_variance: f64,
    /// Mean of its pads now, and where it was at the last prediction; counts as they come.
    pads: Option<f64>,
    predicted_at: Option<f64>,
    /// Which way pressure moves the counts.
    sign: f64,
    /// How far the pads have moved since the last reading, and since the zero.
    moved: f64,
    warmed: f64,
    /// From where on the coefficient is read: `warmed` and the offset then, and what it has wandered since, a variance.
    anchor: [f64; 3],
    /// For how long nothing has touched it, seconds.
    pub(super) untouched_s: f64,
    /// What of the offset is in the tables.
    pub(super) followed: f64,
    /// It is at its bound.
    pub(super) is_bounded: bool,
}

impl ModuleOffset {
    /// A zero was taken, with the pads where they were then.
    pub(super) fn begin(&mut self, sigma: f64, pads_then: Option<f64>, untouched_s: f64) {
        *self = Self {
            variance: sigma * sigma,
            coefficient: GUESS,
            coefficient_variance: GUESS_SIGMA.powi(2) + BETWEEN_MODULES.powi(2),
            pads: self.pads,
            predicted_at: pads_then,
            sign: self.sign,
            anchor: [0.0, 0.0, sigma * sigma],
            untouched_s,
            ..Self::default()
        };
    }

    /// Takes what the pads of a scan read; `share` is the weight of a scan in their mean.
    pub(super) fn feel(&mut self, pads: [u8; 2], sign: f64, share: f64) {
        let live = || pads.iter().filter(|pad| !matches!(**pad, u8::MIN | u8::MAX)).map(|pad| f64::from(*pad));
        let n = live().count();
        if n > 0 {
            let mean = live().sum::<f64>() / n as f64;
            let before = self.pads.unwrap_or(mean);
            let share = if (mean - before).abs() > PADS_STEP { 1.0 } else { share };
            (self.pads, self.sign) = (Some(before + share * (mean - before)), sign);
        }
    }

    /// Mean of the pads in the last second, counts.
    pub(super) const fn pads(&self) -> Option<f64> {
        self.pads
    }

    /// Follows the pads; `wandered` is the variance of what the offset may have moved by itself meanwhile.
    pub(super) fn predict(&mut self, wandered: f64) {
        let step = self.pads.zip(self.predicted_at).map_or(0.0, |(now, then)| self.sign * (now - then));
        self.predicted_at = self.pads;
        self.moved += step;
        self.warmed += step;
        self.offset += self.coefficient * step;
        self.variance += wandered;
        self.anchor[2] += wandered;
    }

    /// Where it is, counts.
    pub(super) const fn offset(&self) -> f64 {
        self.offset
    }

    /// Variance of where it is.
    pub(super) fn variance(&self) -> f64 {
        self.variance + self.moved * self.moved * self.coefficient_variance
    }

    /// The offset after a reading, counts.
    pub(super) fn after(&self, seen: f64, sigma: f64) -> f64 {
        self.offset + self.variance() / (self.variance() + sigma * sigma) * (seen - self.offset)
    }

    /// How far `offset` lies towards load beyond what any warmth explains, counts: what may be a load that was taken for one.
    pub(super) fn unexplained(&self, offset: f64) -> f64 {
        let [cold, warm] = EXPLAINED;
        (offset - (cold * self.warmed).max(warm * self.warmed)).max(0.0)
    }

    /// How far what the tables follow lies away from load beyond what any cold explains, counts of 0 and less: what has left the
    /// skin since its zero was taken, be it a load or what the fabric crept back.
    pub(super) fn left(&self) -> f64 {
        let [cold, warm] = EXPLAINED;
        (self.followed - (cold * self.warmed).min(warm * self.warmed)).min(0.0)
    }

    /// Nothing touches it, and its taxels read `seen`, give or take `sigma`. Lighter is taken always, heavier where `heavier_may`
    /// and within three standard deviations. Returns whether it was.
    pub(super) fn read(&mut self, seen: f64, sigma: f64, heavier_may: bool) -> bool {
        let (apart, before) = (seen - self.offset, self.variance());
        let variance = before + sigma * sigma;
        if apart > 0.0 && (!heavier_may || apart * apart > 9.0 * variance) {
            return false;
        }
        self.offset += before / variance * apart;
        self.variance = before * sigma * sigma / variance;
        self.moved = 0.0;
        self.learn();
        true
    }

    /// Reads the coefficient, if the pads have moved far enough since it was last.
    fn learn(&mut self) {
        let [warmed, offset, variance] = self.anchor;
        let moved = self.warmed - warmed;
        if moved.abs() < LEARN_COUNTS {
            return;
        }
        let noise = (variance + self.variance) / (moved * moved);
        let gain = self.coefficient_variance / (self.coefficient_variance + noise);
        self.coefficient += gain * ((self.offset - offset) / moved - self.coefficient);
        self.coefficient_variance *= 1.0 - gain;
        self.anchor = [self.warmed, self.offset, self.variance];
    }

    /// The patch's coefficient, with its variance, is news to a module that has learned less of its own.
    pub(super) fn hear(&mut self, [coefficient, variance]: [f64; 2]) {
        let known = variance + BETWEEN_MODULES.powi(2);
        if self.coefficient_variance > known {
            self.offset += (coefficient - self.coefficient) * self.moved;
            (self.coefficient, self.coefficient_variance) = (coefficient, known);
        }
    }
}

/// The coefficient of a patch, and its variance: of the modules that have learned more of their own than another can tell them.
pub(super) fn coefficient_of_all(modules: &[ModuleOffset]) -> [f64; 2] {
    let prior = GUESS_SIGMA.powi(2);
    let (mut sum, mut weight) = (GUESS / prior, 1.0 / prior);
    for module in modules.iter().filter(|module| module.coefficient_variance < BETWEEN_MODULES.powi(2)) {
        let own = 1.0 / (module.coefficient_variance + BETWEEN_MODULES.powi(2));
        sum += own * module.coefficient;
        weight += own;
    }
    [sum / weight, 1.0 / weight]
}
