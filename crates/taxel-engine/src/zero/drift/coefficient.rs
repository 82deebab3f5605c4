//! How many counts taxels move per count of their thermal pads.

use super::limits::COEFFICIENT_MAX;

/// Least coefficient: boards that compensate too much turn the drift round.
const COEFFICIENT_MIN: f64 = -0.5;
/// What boards leave of the drift, as a rule: a quarter to all, give or take a twentieth.
const LEFT_BY_BOARDS: [f64; 2] = [0.2, 1.05];
/// Standard uncertainty of a coefficient outside of that, per unit of how far outside, up to half of the way to the other end.
const UNUSUAL: f64 = 4.0;
/// Before anything is seen: the boards leave a quarter to all of the drift ...
const GUESS: f64 = 0.625;
/// ... with this standard uncertainty.
const GUESS_SIGMA: f64 = 0.25;
/// The pads must have moved by so much, counts, before a module's own coefficient is used: their noise and rounding is a
/// tenth.
const PADS_MOVED_MIN: f64 = 1.5;
/// It is learned from steps of the pads of so many counts. While they stand still nothing is learned, so a load that comes
/// meanwhile is not taken for what warmth does, however long it stays.
const STEP_COUNTS: f64 = 0.5;
/// Noise of a step, counts: the medians of taxels and pads are known to some 0.03. Where one step ends the next begins, so
/// over a path it does not add up.
const NOISE_COUNTS: f64 = 0.04;
/// A step that is further than this and two standard uncertainties from what is known was a load's, counts.
const STEP_APART_COUNTS: f64 = 0.15;

/// A slope, by least squares over steps, drawn towards a guess.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Coefficient {
    /// Pads and taxels where the last step ended, counts from their zero.
    at: [f64; 2],
    n: f64,
    pads_pads: f64,
    pads_taxels: f64,
    taxels_taxels: f64,
    pads_moved_max: f64,
}

impl Coefficient {
    /// Pads and taxels that nothing touches, counts from their zero.
    pub(super) fn learn(&mut self, pads: f64, taxels: f64) {
        let (pads_step, taxels_step) = (pads - self.at[0], taxels - self.at[1]);
        if pads_step.abs() < STEP_COUNTS {
            return;
        }
        self.at = [pads, taxels];
        let (coefficient, sigma) = self.fitted();
        let apart = (taxels_step - coefficient * pads_step).abs();
        if apart > STEP_APART_COUNTS + 2.0 * sigma * pads_step.abs() {
            return;
        }
        self.n += 1.0;
        self.pads_pads += pads_step * pads_step;
        self.pads_taxels += pads_step * taxels_step;
        self.taxels_taxels += taxels_step * taxels_step;
        self.pads_moved_max = self.pads_moved_max.max(pads.abs());
    }

    /// Counts per count of the pads with its standard uncertainty; `None` until the pads have moved enough.
    pub(super) fn value(&self) -> Option<(f64, f64)> {
        (self.pads_moved_max >= PADS_MOVED_MIN).then(|| self.estimate())
    }

    /// The same from the first moment on, when it is a guess. A load on everything that comes as slowly as the warmth looks
    /// like boards that leave less or more of it than they do as a rule: what they do leave may then be anything.
    pub(super) fn estimate(&self) -> (f64, f64) {
        let (coefficient, sigma) = self.fitted();
        let [least, most] = LEFT_BY_BOARDS;
        let outside = (least - coefficient).max(coefficient - most).max(0.0);
        let furthest = (coefficient - least).abs().max((most - coefficient).abs());
        (coefficient, sigma.hypot((UNUSUAL * outside).min(0.5 * furthest)))
    }

    /// What was learned, as if nothing had pressed.
    fn fitted(&self) -> (f64, f64) {
        if self.n == 0.0 {
            return (GUESS, GUESS_SIGMA);
        }
        let free = self.pads_taxels / self.pads_pads;
        let residual = (self.taxels_taxels - free * self.pads_taxels).max(0.0) / self.n;
        // What a step did by itself, as when a load came meanwhile, does add up.
        let by_itself = (residual - NOISE_COUNTS.powi(2)).max(0.0) / self.pads_pads;
        let noise = NOISE_COUNTS.powi(2) / self.pads_pads.max(self.pads_moved_max.powi(2));
        let (seen, guessed) = ((by_itself + noise).recip(), GUESS_SIGMA.powi(-2));
        let coefficient = (seen * free + guessed * GUESS) / (seen + guessed);
        (coefficient.clamp(COEFFICIENT_MIN, COEFFICIENT_MAX), (seen + guessed).sqrt().recip())
    }
}
