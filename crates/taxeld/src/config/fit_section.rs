//! `[patch.fit]` of the configuration file: how models are fitted.

use serde::Deserialize;

/// `[patch.fit]`
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FitSection {
    /// 1 to 10, or `auto`: of the static curve. The one that plays bend is of order 3.
    pub order: OrderWord,
    /// `pressure-binned`, `per-sample` or `paper`.
    pub estimator: EstimatorWord,
    /// Whether the solution is refined in double-double until nothing changes.
    pub exact: bool,
    /// Taxels whose counts move less are excluded; 0 is off.
    pub min_swing_counts: f64,
    /// Taxels whose 95 % interval is wider than this share of full scale are excluded.
    pub max_interval_share: Option<f64>,
    /// Whether the hysteresis that a session over both branches learns is compensated.
    pub plays: PlaysWord,
}

impl Default for FitSection {
    fn default() -> Self {
        Self {
            order: OrderWord::Fixed(5),
            estimator: EstimatorWord::default(),
            exact: false,
            min_swing_counts: 0.0,
            max_interval_share: None,
            plays: PlaysWord::default(),
        }
    }
}

/// Compensation of hysteresis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PlaysWord {
    /// If it wins on a branch that the fit did not see.
    Auto,
    /// Always.
    On,
    /// Never: the curve is that of rising pressure, and the hysteresis is in its uncertainty.
    #[default]
    Off,
}

/// Order of the polynomial.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(untagged)]
pub enum OrderWord {
    /// This one.
    Fixed(u8),
    /// Chosen per taxel.
    Auto(AutoWord),
}

/// The word `auto`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AutoWord {
    /// Chosen per taxel by its prediction error.
    Auto,
}

/// Least-squares problem.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum EstimatorWord {
    /// Counts averaged in bins of equal pressure first.
    #[default]
    PressureBinned,
    /// The paper's equation, its curve repaired to be monotone.
    PerSample,
    /// The paper's equation and nothing else.
    Paper,
}
