//! What is told of the force and of each taxel at one moment.

use std::sync::Arc;
use taxel_skin::{Newton, Time};

use crate::force::reason::{Reason, in_words};
use crate::intake::faults::fault::FaultSet;

/// How far a force can be trusted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum ForceState {
    /// Every activated taxel is calibrated, fresh and in range.
    Ok,
    /// A force with named shortcomings.
    Degraded,
    /// No force: too much of the skin is silent.
    Stale,
    /// No force: the zero is not proven.
    TareInvalid,
    /// No force: no model set is active.
    #[default]
    Uncalibrated,
}

/// The total normal force and what is known of it.
#[derive(Clone, Debug, Default)]
pub struct ForceSample {
    /// How far it can be trusted.
    pub state: ForceState,
    /// Why it is not `Ok`, most important first.
    pub reasons: Vec<Reason>,
    /// Sum of area x pressure over active taxels; absent unless the state is `Ok` or `Degraded`.
    pub total: Option<Newton>,
    /// Standard uncertainty of the total.
    pub total_sigma: Option<Newton>,
    /// The force that may press in addition without activating a taxel: below what this scan can show, or on an excluded taxel.
    pub detection_floor: Option<Newton>,
    /// The true force may be higher than total and uncertainty say, by any amount; it is not lower.
    pub lower_bound: bool,
    /// Sum of -area x pressure x outward normal: the force that acts on the skin, in N, patch frame.
    pub resultant: Option<[f64; 3]>,
    /// Its moment about the patch origin, in N m.
    pub moment: Option<[f64; 3]>,
    /// Force-weighted mean position of active taxels, in m.
    pub centre_of_pressure: Option<[f64; 3]>,
    /// Clusters of active taxels, strongest first.
    pub contacts: Vec<Contact>,
    /// Taxels above their activation threshold that count in the total.
    pub active: u32,
    /// Taxels without a usable model or with a fault.
    pub excluded: u32,
    /// Taxels of silent modules.
    pub stale: u32,
    /// Active taxels beyond the calibrated range: the total is then a lower bound.
    pub out_of_range: u32,
    /// Excluded taxels whose pressure was taken from their neighbours.
    pub filled: u32,
    /// Their share of the total, 0 to 1.
    pub filled_share: f64,
    /// Share of the patch's area that no usable taxel covers, 0 to 1.
    pub uncovered_share: f64,
    /// Id of the active model set.
    pub model_set: Option<Arc<str>>,
}

impl ForceSample {
    /// How much more than its total the force may be by what it says of itself: so many standard uncertainties, and the floor.
    #[must_use]
    pub fn room_above(&self, sigmas: f64) -> Newton {
        let (sigma, floor) = (self.total_sigma.unwrap_or_default(), self.detection_floor.unwrap_or_default());
        Newton(sigmas * sigma.0 + floor.0)
    }

    /// Why it is not `Ok`, in one line.
    #[must_use]
    pub fn why(&self) -> String {
        in_words(&self.reasons)
    }
}

/// A cluster of neighbouring active taxels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contact {
    /// Sum of area x pressure, in N.
    pub force_n: f64,
    /// Force-weighted mean position, in m.
    pub centre: [f64; 3],
    /// Sum of -area x pressure x outward normal: the force that acts on the skin, in N, patch frame.
    pub resultant: [f64; 3],
    /// Its moment about the patch origin, in N m.
    pub moment: [f64; 3],
    /// The numbers of its taxels, ascending.
    pub taxels: Vec<u16>,
}

/// One taxel at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TaxelState {
    /// The raw count as last received.
    pub count: u16,
    /// When it was received; meaningless while `seen` is false.
    pub time: Time,
    /// Whether it ever was.
    pub seen: bool,
    /// Whether its module is silent.
    pub stale: bool,
    /// Whether its count is beyond its activation threshold.
    pub active: bool,
    /// Whether it has a usable model.
    pub calibrated: bool,
    /// Below, in or above the calibrated range.
    pub range: RangeFlag,
    /// What is wrong with it now.
    pub faults: FaultSet,
    /// Pressure in kPa, present if calibrated, tared and fresh; beyond the calibrated range by the curve's extension.
    pub pressure_kpa: Option<f32>,
    /// Standard uncertainty of the pressure in kPa.
    pub sigma_kpa: Option<f32>,
}

/// Where a count lies against the calibrated range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RangeFlag {
    /// In the calibrated range.
    #[default]
    In,
    /// Less pressure than was calibrated; read as the low end.
    Below,
    /// More pressure than was calibrated; read by the curve's extension.
    Above,
}
