//! What a fit gives: a curve with its range, its error and what is known of its quality.

use crate::curve::Curve;
use crate::options::GaugeUncertainty;
use crate::points::{Points, Served};
use crate::status::{Flag, Status};
use crate::uncertainty::SigmaProfile;
use serde::{Deserialize, Serialize};

/// Which way a taxel answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sign {
    /// Counts rise with pressure.
    Rising,
    /// Counts fall with pressure, as iCub's do.
    Falling,
}

impl Sign {
    /// 1 or -1.
    #[must_use]
    pub const fn as_f64(self) -> f64 {
        match self {
            Self::Rising => 1.0,
            Self::Falling => -1.0,
        }
    }
}

/// Where a count lies relative to the calibrated range of counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum RangeState {
    /// Within the range.
    InRange,
    /// Below the least calibrated count; the pressure is the one at that count.
    Below,
    /// Above the greatest calibrated count; the pressure is the one at that count.
    Above,
}

impl RangeState {
    /// Of a count and the least and greatest calibrated one.
    #[must_use]
    pub fn of(count: f64, [low, high]: [f64; 2]) -> Self {
        match count {
            c if c < low => Self::Below,
            c if c > high => Self::Above,
            _ => Self::InRange,
        }
    }

    /// The same of pressure instead of counts: where these fall with pressure, few counts are much pressure.
    #[must_use]
    pub const fn in_pressure(self, sign: Sign) -> Self {
        match (self, sign) {
            (Self::Below, Sign::Falling) => Self::Above,
            (Self::Above, Sign::Falling) => Self::Below,
            (state, _) => state,
        }
    }
}

/// The pressure that a count stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Pressure, kPa.
    pub kpa: f64,
    /// Standard deviation of this one reading, kPa, without what the gauge shares among taxels; infinite if unknown.
    pub sigma_kpa: f64,
    /// Whether the count was within the calibrated range.
    pub range: RangeState,
}

/// Figures about a fit. What cannot be known is `None`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Samples used.
    pub samples: u64,
    /// Distinct counts among them.
    pub distinct_counts: u32,
    /// Width of the calibrated range, counts.
    pub swing_counts: f64,
    /// Coefficients that the data carry, up to the order asked for.
    pub rank: u8,
    /// Samples less coefficients.
    pub dof: f64,
    /// Root mean square of P - P(C) over all samples, kPa.
    pub rmse_kpa: f64,
    /// Largest leverage of a single sample, 0..1.
    pub max_leverage: f64,
    /// What the taxels' readings of light loads and of other legs have in common, kPa; of a skin fit.
    pub repeatability_kpa: Option<f64>,
    /// Half-width of the 95 % prediction interval in the median over the samples, kPa.
    pub interval_kpa: Option<f64>,
    /// The same over full scale.
    pub interval_share: Option<f64>,
}

/// One taxel's model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TaxelModel {
    /// Whether the curve may be used.
    pub status: Status,
    /// What else there is to know.
    pub flags: Vec<Flag>,
    /// Order of the curve; 0 for a constant or none.
    pub order: u8,
    /// Which way the counts answer.
    pub sign: Sign,
    /// Least and greatest calibrated count.
    pub range: Option<[f64; 2]>,
    /// The polynomial. It is served where there are no points, and may exist where the status forbids its use.
    pub curve: Option<Curve>,
    /// The curve of a skin fit, which is served.
    pub points: Option<Points>,
    /// The curve in ascending powers of the raw count, kPa per count^k, each correctly rounded from more digits. Only
    /// to be printed and compared: evaluated in f64 they lose what `curve` keeps. Empty without a curve, and where
    /// one of them is beyond f64.
    pub raw_coefficients: Vec<f64>,
    /// Standard deviation of a reading; `None` if the samples cannot tell.
    pub sigma: Option<SigmaProfile>,
    /// What the gauge shares among all taxels.
    pub gauge: GaugeUncertainty,
    /// Figures.
    pub quality: Quality,
}

impl TaxelModel {
    /// A model without a curve.
    #[must_use]
    pub fn without_curve(status: Status, gauge: GaugeUncertainty) -> Self {
        Self {
            status,
            flags: Vec::new(),
            order: 0,
            sign: Sign::Falling,
            range: None,
            curve: None,
            points: None,
            raw_coefficients: Vec::new(),
            sigma: None,
            gauge,
            quality: Quality::default(),
        }
    }

    /// Whether the curve may be used.
    #[must_use]
    pub const fn is_usable(&self) -> bool {
        self.status.is_ok() && (self.curve.is_some() || self.points.is_some())
    }

    /// The curve that counts are read by.
    #[must_use]
    pub fn served(&self) -> Option<Served<'_>> {
        let points = self.points.as_ref().map(Served::Points);
        points.or_else(|| self.curve.as_ref().map(Served::Polynomial))
    }

    /// The pressure at `count`, clamped to the calibrated range; never evaluated outside it.
    ///
    /// `None` if there is no curve or `count` is not finite. Asks for the curve only: see [`Self::is_usable`].
    #[must_use]
    pub fn evaluate(&self, count: f64) -> Option<Reading> {
        let (curve, [low, high]) = (self.served()?, self.range?);
        if !count.is_finite() {
            return None;
        }
        let range = RangeState::of(count, [low, high]);
        let inside = count.max(low).min(high);
        let sigma_kpa = self.sigma.as_ref().map_or(f64::INFINITY, |sigma| sigma.at(inside));
        Some(Reading { kpa: curve.evaluate(inside), sigma_kpa, range })
    }
}
