//! What a caller may ask of a fit. The defaults are the ones the programme ships with.

use serde::{Deserialize, Serialize};

/// The highest polynomial order that may be asked for.
pub const MAX_ORDER: u8 = 10;

/// Most coefficients of a curve: those of [`MAX_ORDER`].
pub const TERMS_MAX: usize = MAX_ORDER as usize + 1;

/// The polynomial order of a taxel's curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Order {
    /// This order, clamped to 1..=[`MAX_ORDER`]; lowered where the data do not carry it.
    Fixed(u8),
    /// The smallest order whose leave-one-out error (PRESS) is within 1 % of the best.
    Auto,
}

impl Default for Order {
    fn default() -> Self {
        Self::Fixed(5)
    }
}

/// Which least-squares problem is solved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Estimator {
    /// The paper's equation, made fit for use: the sum of (P - P(C))^2 over all samples off the rails, on a range of
    /// counts that were seen more than once or twice, its curve repaired to be monotone. Noise in the counts flattens the curve
    /// (regression dilution), the same way for every taxel, so that it does not average out of a force.
    PerSample,
    /// The counts are averaged in bins of equal pressure first, which removes most of that bias.
    ///
    /// A set of fewer than [`MIN_BINNED_SAMPLES`] samples has nothing to average and is fitted per sample.
    #[default]
    PressureBinned,
    /// The paper's equation and nothing else: all samples have a say, clipped and rare ones too, the curve is served as
    /// it comes out over all counts that were seen, monotone or not, and swing alone excludes a taxel.
    Paper,
}

impl Estimator {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::PerSample, Self::PressureBinned, Self::Paper];

    /// A short stable word for files, interfaces and configurations.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::PerSample => "per-sample",
            Self::PressureBinned => "pressure-binned",
            Self::Paper => "paper",
        }
    }

    /// The one that is used, which for samples that are too few to be `binned` is not the one asked for.
    pub(crate) const fn used(self, binned: bool) -> Self {
        match self {
            Self::PressureBinned if !binned => Self::PerSample,
            asked => asked,
        }
    }
}

/// Below this many samples `PressureBinned` falls back to `PerSample`: two samples for each of 140 bins.
pub const MIN_BINNED_SAMPLES: u64 = 280;

/// How many pressure bins the range is divided into unless a width is given.
pub const DEFAULT_BINS: f64 = 140.0;

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

impl GaugeUncertainty {
    /// Standard uncertainty, in kPa, that the gauge adds to a pressure of `kpa`: sqrt((gain P)^2 + offset^2).
    #[must_use]
    pub fn sigma_kpa(&self, kpa: f64) -> f64 {
        (self.gain_rel * kpa).hypot(self.offset_kpa)
    }
}

/// When a curve exists but must not be used.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Exclusion {
    /// The paper's threshold on C_max - C_min, in counts; 0 is off.
    pub min_swing_counts: f64,
    /// Largest median half-width of the 95 % prediction interval, as a share of full scale; infinite is off.
    pub max_interval_share: f64,
    /// Full scale, kPa; `None` is the pressure range of the calibration itself.
    pub full_scale_kpa: Option<f64>,
}

impl Default for Exclusion {
    fn default() -> Self {
        Self { min_swing_counts: 0.0, max_interval_share: 0.2, full_scale_kpa: None }
    }
}

/// What happens to a curve that is not monotone on its calibrated range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Shape {
    /// `Repair` for integer counts and for recordings; a table of fewer than [`MIN_BINNED_SAMPLES`] samples with
    /// real abscissae is a regression set, not a taxel: `Report`.
    #[default]
    Auto,
    /// Refit under the constraint of monotony. If the data contradict it, the taxel is excluded.
    Repair,
    /// Leave the least-squares curve as it is and flag it.
    Report,
}

/// Which counts are the ends of the converter, where a reading is clipped and not measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Rails {
    /// For recordings of integer counts 0 and the greatest count of the fewest bits, 8 to 24, that hold them all: 255 for
    /// those within 0..=255. None otherwise.
    #[default]
    Auto,
    /// No count is a rail.
    None,
    /// These two counts.
    At {
        /// Lower rail, counts.
        low: f64,
        /// Upper rail, counts.
        high: f64,
    },
}

/// How one taxel is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitOptions {
    /// Polynomial order.
    pub order: Order,
    /// Least-squares problem.
    pub estimator: Estimator,
    /// Refine in double-double until nothing changes, for audits and reference values. Without it the refinement
    /// ends where what is left cannot be seen in f64.
    pub exact: bool,
    /// Width of a pressure bin, kPa; `None` gives about 140 bins. An [`crate::Accumulator`] rounds it
    /// to a multiple of its own bins of 0.256 kPa.
    pub bin_width_kpa: Option<f64>,
    /// What the gauge does not know.
    pub gauge: GaugeUncertainty,
    /// Highest order that [`Order::Auto`] considers, 1..=[`MAX_ORDER`].
    pub max_order_auto: u8,
    /// When a curve must not be used.
    pub exclusion: Exclusion,
    /// The calibrated range ends at the outermost counts that were seen this often. Applies to recordings
    /// ([`MIN_BINNED_SAMPLES`] samples and more) of integer counts that repeat. Real counts, and those of a converter so
    /// fine that this would cost an end 1 % of the samples, lose 0.2 % of the samples per end.
    pub min_samples_at_ends: u32,
    /// What to do where the curve is not monotone.
    pub shape: Shape,
    /// Which counts are clipped readings.
    pub rails: Rails,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            order: Order::default(),
            estimator: Estimator::default(),
            exact: false,
            bin_width_kpa: None,
            gauge: GaugeUncertainty::default(),
            max_order_auto: 9,
            exclusion: Exclusion::default(),
            min_samples_at_ends: 3,
            shape: Shape::default(),
            rails: Rails::default(),
        }
    }
}

impl FitOptions {
    /// The counts at which a reading is clipped, where those of the converter are known or guessed from a recording.
    pub(crate) fn rails(&self, of_converter: Option<(f64, f64)>) -> Option<(f64, f64)> {
        match self.rails {
            _ if self.estimator == Estimator::Paper => None,
            Rails::Auto => of_converter,
            Rails::At { low, high } => Some((low, high)),
            Rails::None => None,
        }
    }

    /// The highest order that may come out.
    pub(crate) fn max_order(&self) -> usize {
        let order = match self.order {
            Order::Fixed(order) => order,
            Order::Auto => self.max_order_auto,
        };
        usize::from(order.clamp(1, MAX_ORDER))
    }
}
