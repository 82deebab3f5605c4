//! Why a taxel has no usable curve, and what else its fit has to say.

use serde::{Deserialize, Serialize};
use std::fmt;
use thiserror::Error;

/// Whether a curve may be used, and if not, why.
#[derive(Clone, Copy, Debug, Error, PartialEq, Serialize, Deserialize)]
#[serde(tag = "status", content = "figures", rename_all = "snake_case")]
pub enum Status {
    /// The curve may be used.
    #[error("ok")]
    Ok,
    /// No valid sample.
    #[error("no valid sample")]
    NoData,
    /// The pressure did not vary.
    #[error("the pressure did not vary (standard deviation {pressure_sd_kpa:.3} kPa)")]
    NoExcitation {
        /// Standard deviation of the pressure, kPa.
        pressure_sd_kpa: f64,
    },
    /// The count never changed.
    #[error("the count stayed at {count}")]
    Dead {
        /// The one count seen.
        count: f64,
    },
    /// The counts move less than the threshold asks for.
    #[error("the counts moved by {swing_counts:.1}, at least {needed_counts:.1} are needed")]
    InsufficientSwing {
        /// C_max - C_min, counts.
        swing_counts: f64,
        /// The threshold, counts.
        needed_counts: f64,
    },
    /// As many coefficients as samples: the curve passes through all of them and nothing tells its error.
    #[error("{samples} samples leave nothing to tell the error of the curve")]
    Unproven {
        /// Valid samples.
        samples: u64,
    },
    /// The residuals are far larger than those of the other taxels in the same recording.
    #[error("the RMSE of the fit is {rmse_kpa:.1} kPa, the limit is {limit_kpa:.1} kPa")]
    PoorFit {
        /// RMSE of the fit over the recording, kPa.
        rmse_kpa: f64,
        /// The limit, kPa: a multiple of the median over the taxels.
        limit_kpa: f64,
    },
    /// On an end of the converter for too much of the recording.
    #[error("saturated ({:.1} % of the scans left out)", 100.0 * .share)]
    Railed {
        /// Share of the scans that had to be left out.
        share: f64,
    },
    /// Without a change for too much of the recording.
    #[error("frozen ({:.1} % of the scans left out)", 100.0 * .share)]
    Frozen {
        /// Share of the scans that had to be left out.
        share: f64,
    },
    /// Going back and forth for too much of the recording.
    #[error("jumping ({:.1} % of the scans left out)", 100.0 * .share)]
    Jumping {
        /// Share of the scans that had to be left out.
        share: f64,
    },
    /// Part of a module that flickered for too much of the recording.
    #[error("in a flickering module ({:.1} % of the scans left out)", 100.0 * .share)]
    ModuleFlicker {
        /// Share of the scans that had to be left out.
        share: f64,
    },
    /// Without a reading for too much of the recording.
    #[error("without a reading in {:.1} % of the scans", 100.0 * .share)]
    Missing {
        /// Share of the scans that had to be left out.
        share: f64,
    },
}

impl Status {
    /// Whether the curve may be used.
    #[must_use]
    pub const fn is_ok(&self) -> bool {
        matches!(self, Self::Ok)
    }

    /// A short stable word for files and interfaces, for example `ok` or `poor_fit`.
    #[must_use]
    pub const fn code(&self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::NoData => "no_data",
            Self::NoExcitation { .. } => "no_excitation",
            Self::Dead { .. } => "dead",
            Self::InsufficientSwing { .. } => "insufficient_swing",
            Self::Unproven { .. } => "unproven",
            Self::PoorFit { .. } => "poor_fit",
            Self::Railed { .. } => "railed",
            Self::Frozen { .. } => "frozen",
            Self::Jumping { .. } => "jumping",
            Self::ModuleFlicker { .. } => "module_flicker",
            Self::Missing { .. } => "missing",
        }
    }
}

/// Something to know about a fit that does not by itself forbid its use.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Flag {
    /// The distinct counts carry a lower order than was asked for.
    RankReduced {
        /// Order asked for.
        asked: u8,
        /// Order fitted.
        used: u8,
    },
    /// Fewer distinct counts than twice the coefficients.
    FewDistinctCounts {
        /// Distinct counts.
        distinct: u32,
        /// 2 (order + 1).
        wanted: u32,
    },
    /// One sample alone decides the curve at its count.
    HighLeverage {
        /// The count.
        count: f64,
        /// Leverage of one sample there, 0..1.
        leverage: f64,
    },
    /// Single readings that stood alone were left out of the fit.
    Dropouts {
        /// How many.
        samples: u64,
    },
    /// No sample lies in a wide part of the range.
    Gap {
        /// Last count before the gap.
        from: f64,
        /// First count after it.
        to: f64,
    },
    /// The polynomial is not monotone on its range.
    NotMonotone {
        /// A count where the slope has the wrong sign.
        count: f64,
    },
    /// Samples that were not finite or out of range were left out.
    Rejected {
        /// How many.
        samples: u64,
    },
}

impl fmt::Display for Flag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::RankReduced { asked, used } => write!(f, "order {asked} was asked for, the counts carry {used}"),
            Self::FewDistinctCounts { distinct, wanted } => {
                write!(f, "{distinct} distinct counts, {wanted} or more are wanted")
            }
            Self::HighLeverage { count, leverage } => {
                write!(f, "one sample at count {count} decides the curve there (leverage {leverage:.2})")
            }
            Self::Dropouts { samples } => write!(f, "{samples} single readings that stood alone were left out"),
            Self::Gap { from, to } => write!(f, "no sample between counts {from} and {to}"),
            Self::NotMonotone { count } => write!(f, "not monotone near count {count:.1}"),
            Self::Rejected { samples } => write!(f, "{samples} samples were not finite or out of range"),
        }
    }
}
