//! What a caller may ask of a fit. The defaults are the ones the programme ships with.

use serde::{Deserialize, Serialize};

/// The highest polynomial order that may be asked for.
pub const MAX_ORDER: u8 = 10;

/// Most coefficients of a curve: those of [`MAX_ORDER`].
pub const TERMS_MAX: usize = MAX_ORDER as usize + 1;

/// Larger counts or pressures (kPa) are refused: a gauge or a converter that says so is broken.
pub const MAX_MAGNITUDE: f64 = 1e15;

/// The paper's order.
const PAPER_ORDER: u8 = 5;

/// What the pressure gauge itself does not know. Gain and offset are common to all taxels, so they do not average
/// out over a skin: they stay out of a taxel's own sigma and belong in the covariance of the total force.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GaugeUncertainty {
    /// Relative standard uncertainty of the gain, 1.
    pub gain_rel: f64,
    /// Standard uncertainty of the zero, kPa.
    pub offset_kpa: f64,
    /// Standard deviation of the noise of one reading, kPa. A recording whose pressure varies by less than ten
    /// times this shows no excitation.
    pub noise_kpa: f64,
}

/// How a taxel is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitOptions {
    /// Order of the polynomial, clamped to 1..=[`MAX_ORDER`]; lowered where the data do not carry it.
    pub order: u8,
    /// The paper's equation in place of the fit of a skin: counts are read by the polynomial.
    pub paper: bool,
    /// The paper's threshold on C_max - C_min, in counts, below which a taxel is excluded; 0 is off.
    pub min_swing_counts: f64,
    /// What the gauge does not know.
    pub gauge: GaugeUncertainty,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self { order: PAPER_ORDER, paper: false, min_swing_counts: 0.0, gauge: GaugeUncertainty::default() }
    }
}
