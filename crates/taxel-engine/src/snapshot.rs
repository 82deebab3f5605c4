//! Immutable views of the engine's state: all that readers ever see.

use std::sync::Arc;
use taxel_skin::{Newton, Time};

use crate::drift::DriftView;
use crate::faults::FaultSet;
use crate::model_set::ModelSet;
use crate::session::SessionView;
use crate::taxels::Taxels;
use crate::validation::Validation;

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

/// One patch at one moment.
#[derive(Clone, Debug, Default)]
pub struct PatchSnapshot {
    /// One more for each published snapshot of this patch.
    pub sequence: u64,
    /// Receive time of the newest frame in it.
    pub time: Time,
    /// The same instant in nanoseconds since 1970, a label only.
    pub wall_ns: i64,
    /// Whether any frame of the patch has come.
    pub seen: bool,
    /// The force on the patch.
    pub force: ForceSample,
    /// One entry per taxel, worked out when somebody looks.
    pub taxels: Taxels,
    /// The zero, if one was taken.
    pub tare: Option<TareView>,
}

/// The total normal force and what is known of it.
#[derive(Clone, Debug, Default)]
pub struct ForceSample {
    /// How far it can be trusted.
    pub state: ForceState,
    /// Why it is not `Ok`.
    pub reasons: Vec<String>,
    /// Sum of area x pressure over active taxels; absent unless the state is `Ok` or `Degraded`.
    pub total: Option<Newton>,
    /// Standard uncertainty of the total.
    pub total_sigma: Option<Newton>,
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

/// A cluster of neighbouring active taxels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Contact {
    /// Sum of area x pressure, in N.
    pub force_n: f64,
    /// Force-weighted mean position, in m.
    pub centre: [f64; 3],
    /// How many taxels.
    pub taxels: u32,
}

/// One taxel at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TaxelState {
    /// The raw count as last received.
    pub count: u8,
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
    /// Pressure in kPa, present if calibrated, tared and fresh; clamped to the calibrated range.
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
    /// More pressure than was calibrated; read as the high end.
    Above,
}

/// How the present zero came to be.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TareView {
    /// One more for each zero taken or lost.
    pub epoch: u64,
    /// Whether live force may rely on it.
    pub valid: bool,
    /// When it was taken, nanoseconds since 1970.
    pub wall_ns: i64,
    /// Why it is valid (the rest test's figures, who confirmed) or why it is not any more.
    pub reason: String,
    /// Median over taxels of the baseline, in counts.
    pub baseline_median: f64,
    /// Median over taxels of the rest noise, standard deviation in counts.
    pub noise_median: f64,
    /// Scans that a provisional zero rests on; `None` for one that was watched in full.
    pub provisional_scans: Option<u32>,
    /// How it follows the temperature.
    pub drift: DriftView,
}

/// Buses, boards and modules.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Health {
    /// One per bus.
    pub buses: Vec<BusHealth>,
    /// One per board, patch by patch.
    pub boards: Vec<BoardHealth>,
    /// What else is wrong, for example the store.
    pub problems: Vec<String>,
}

/// One bus.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BusHealth {
    /// Whether frames can come.
    pub up: bool,
    /// Why not, or the last error the controller reported.
    pub problem: String,
    /// Frames that were understood.
    pub frames: u64,
    /// Frames whose identifier concerns nobody here.
    pub foreign: u64,
    /// Frames with an identifier of ours and a content that is not.
    pub malformed: u64,
    /// Text of the last malformed one.
    pub last_malformed: String,
    /// Frames lost in the kernel.
    pub dropped: u64,
}

/// One board.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BoardHealth {
    /// Its patch.
    pub patch: String,
    /// Its bus.
    pub bus: u8,
    /// Its address.
    pub address: u8,
    /// What bring-up has come to: `listening`, `configuring`, `verified`, `incomplete: ...`.
    pub bring_up: String,
    /// Modules that are enabled, and those of them that are fresh.
    pub modules: (u32, u32),
    /// Whole modules received.
    pub scans: u64,
    /// Heads without tail and tails without head.
    pub orphans: u64,
    /// Tails whose status word named a trouble.
    pub status_errors: u64,
    /// Temperature in Celsius, where the board sends it.
    pub celsius: Option<f64>,
    /// Firmware, where the board answered.
    pub firmware: Option<String>,
    /// Warnings about it.
    pub warnings: Vec<String>,
}

/// Sessions and model sets as the store has them.
#[derive(Clone, Debug, Default)]
pub struct Catalogue {
    /// Oldest first.
    pub sessions: Vec<Arc<SessionView>>,
    /// Oldest first.
    pub model_sets: Vec<Arc<ModelSet>>,
    /// Per patch, in plan order: patch name and active model set.
    pub active: Vec<(String, Option<String>)>,
    /// Per patch, in plan order: its known loads.
    pub validations: Vec<Arc<Validation>>,
}
