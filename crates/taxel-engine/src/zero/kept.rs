//! What outlives the daemon of a patch's zero. The boards keep theirs while it is away, and go on with it.

use std::sync::Arc;

use serde::{Deserialize, Deserializer, Serialize};

use crate::baseline::TaxelBaseline;
use crate::zero::view::TareView;

/// What is known of the zero of a patch, and of the zeros that its boards take when they are configured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KeptZero {
    /// The sum over the settings of the boards when the daemon ran last, with which it has configured them if it does.
    pub configured: Option<u32>,
    /// Why a zero needs confirmation, if it does: a board took a zero of its own under a load, or nobody saw what lay on it.
    pub unproven: Option<String>,
    /// The model set for which that does not count: it was made in a session on the boards as they are.
    pub excused: Option<String>,
    /// The zero that is valid.
    pub zero: Option<Arc<TakenZero>>,
}

/// A zero as it was taken.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TakenZero {
    /// See [`TareView`].
    pub epoch: u64,
    /// See [`TareView`].
    pub at_rest: bool,
    /// See [`TareView`].
    pub wall_ns: i64,
    /// See [`TareView`].
    pub reason: String,
    /// Whether somebody confirmed it.
    pub confirmed: bool,
    /// Mean of each taxel, counts; NaN where it is not known.
    #[serde(deserialize_with = "with_gaps")]
    pub mean: Vec<f64>,
    /// Noise of each taxel, counts.
    #[serde(deserialize_with = "with_gaps")]
    pub noise: Vec<f64>,
    /// Mean of the thermal pads of each module then, counts.
    pub pads: Vec<Option<f64>>,
}

/// JSON has `null` for a number that is missing.
fn with_gaps<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
    let numbers = Vec::<Option<f64>>::deserialize(deserializer)?;
    Ok(numbers.into_iter().map(|number| number.unwrap_or(f64::NAN)).collect())
}

impl TakenZero {
    pub(super) fn of(view: &TareView, baseline: &[TaxelBaseline], confirmed: bool, pads: Vec<Option<f64>>) -> Self {
        Self {
            epoch: view.epoch,
            at_rest: view.at_rest,
            wall_ns: view.wall_ns,
            reason: view.reason.clone(),
            confirmed,
            mean: baseline.iter().map(|taxel| taxel.mean).collect(),
            noise: baseline.iter().map(|taxel| taxel.noise).collect(),
            pads,
        }
    }

    pub(super) fn baseline(&self) -> Vec<TaxelBaseline> {
        self.mean.iter().zip(&self.noise).map(|(&mean, &noise)| TaxelBaseline { mean, noise }).collect()
    }
}
