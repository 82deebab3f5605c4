//! Known loads, what the skin read under them, and how far off that is.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use taxel_skin::{Newton, counted};

use crate::request::Rejection;

/// Standard gravity in m/s2 (3rd CGPM, 1901): 1 kg presses with 9.80665 N. Gravity differs from it by up to 0.3 % over
/// the Earth; who knows the local one gives a force instead of a mass.
pub const STANDARD_GRAVITY_M_PER_S2: f64 = 9.806_65;

/// Heavier is no load for skin.
const MASS_MAX_KG: f64 = 1_000.0;
const FORCE_MAX_N: f64 = 10_000.0;
/// A load that is known worse than this proves nothing.
const RELATIVE_SIGMA_MAX: f64 = 0.5;

/// What lies on the skin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Weight {
    /// A mass in kilogram, above 0 and at most 1000, under [`STANDARD_GRAVITY_M_PER_S2`].
    Kilogram(f64),
    /// A force, above 0 and at most 10 000 N.
    Force(Newton),
}

/// A load that an operator knows, before it is read.
#[derive(Clone, Debug, PartialEq)]
pub struct KnownLoad {
    /// Mass or force.
    pub weight: Weight,
    /// Its standard uncertainty as a share of it, 0 to 0.5.
    pub relative_sigma: f64,
    /// Anything worth keeping: which mass, where it lies.
    pub note: String,
    /// Who laid it on.
    pub by: String,
    /// Number of an earlier load that was a mistake and does not count any more.
    pub replaces: Option<u64>,
}

impl KnownLoad {
    /// The force that the load presses with.
    ///
    /// # Errors
    /// [`Rejection::InvalidArgument`] with the field, its value and what is possible.
    pub fn force(&self) -> Result<Newton, Rejection> {
        let within = |field, value: f64, max: f64| {
            let problem = || format!("{value} is not above 0 and at most {max}");
            if value > 0.0 && value <= max { Ok(value) } else { Err(Rejection::invalid(field, problem())) }
        };
        let sigma = self.relative_sigma;
        if !(0.0..=RELATIVE_SIGMA_MAX).contains(&sigma) {
            return Err(Rejection::invalid(
                "relative_uncertainty",
                format!("{sigma} is not in 0 to {RELATIVE_SIGMA_MAX}"),
            ));
        }
        match self.weight {
            Weight::Kilogram(kg) => Ok(Newton(within("mass_kg", kg, MASS_MAX_KG)? * STANDARD_GRAVITY_M_PER_S2)),
            Weight::Force(force) => Ok(Newton(within("force_n", force.0, FORCE_MAX_N)?)),
        }
    }
}

/// What the live force was over the time of the watch.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Reading {
    /// Scans that it was read from.
    pub scans: u32,
    /// Mean of the total force, in N.
    pub mean_n: f64,
    /// Standard deviation of the total from scan to scan, in N.
    pub scatter_n: f64,
    /// Mean of the standard uncertainty that the samples stated, in N.
    pub sigma_n: f64,
    /// Most taxels that were beyond their calibrated range at a time: then the force read is a lower bound.
    pub out_of_range: u32,
    /// Why the last sample was not good, in words; empty if it was.
    pub reasons: Vec<String>,
    /// Taxels that felt it in the last scan, ascending.
    pub taxels: Vec<u16>,
}

/// A known load, what was read under it, and all that the reading depends on. Never changed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Load {
    /// Its number, from 1; unique in a store.
    pub number: u64,
    /// The patch that it lay on.
    pub patch: String,
    /// When it was read, nanoseconds since 1970.
    pub wall_ns: i64,
    /// Who laid it on.
    pub by: String,
    /// What they noted.
    pub note: String,
    /// The mass in kilogram, if that was given.
    pub mass_kg: Option<f64>,
    /// The force laid on, in N.
    pub force_n: f64,
    /// Its standard uncertainty in N.
    pub force_sigma_n: f64,
    /// Number of an earlier load that was a mistake and does not count any more.
    pub replaces: Option<u64>,
    /// What the skin read.
    pub read: Reading,
    /// Id of the model set that it was read with.
    pub model_set: String,
    /// Mean area of the patch's taxels in mm2, as configured.
    pub mean_area_mm2: f64,
    /// Whether faulty taxels were filled by their neighbours.
    pub filled: bool,
}

impl Load {
    /// How far the reading was off, as a share of the load: `read / laid on - 1`.
    #[must_use]
    pub fn error(&self) -> f64 {
        self.read.mean_n / self.force_n - 1.0
    }

    /// That it is far off, and what to do; `None` where it is not.
    #[must_use]
    pub fn far_off(&self) -> Option<String> {
        let percent = 100.0 * self.error();
        (percent.abs() > FAR_OFF_PERCENT).then(|| {
            format!(
                "{percent:+.0} % is far off: was it another mass, did it lie on the skin with all its weight, or did something \
                 else press? If so, lay it on again: `taxeld load KG --replaces {}`",
                self.number
            )
        })
    }

    /// Whether the reading was off by no more than twice its standard uncertainty, that of the load included.
    #[must_use]
    pub fn is_within_two_sigma(&self) -> bool {
        let sigma_n = self.read.sigma_n.hypot(self.force_sigma_n).hypot(self.scatter_of_mean_n());
        (self.read.mean_n - self.force_n).abs() <= 2.0 * sigma_n
    }

    /// Standard uncertainty of the mean from the scatter of the scans, in N.
    #[must_use]
    pub fn scatter_of_mean_n(&self) -> f64 {
        self.read.scatter_n / f64::from(self.read.scans.max(1)).sqrt()
    }
}

/// A load that is read so far off is most likely another than was noted.
const FAR_OFF_PERCENT: f64 = 50.0;

/// Configured areas are the same if their means agree to this share.
const SAME_AREA_SHARE: f64 = 1e-9;

/// All known loads of a patch, judged.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Validation {
    /// The patch.
    pub patch: String,
    /// The active model set.
    pub model_set: Option<String>,
    /// Every load, newest first.
    pub loads: Vec<JudgedLoad>,
    /// Mean of the absolute errors of the loads that count for the active model set, as a share; `None` without one.
    pub mean_absolute_error: Option<f64>,
}

/// A load and what it is good for now.
#[derive(Clone, Debug, PartialEq)]
pub struct JudgedLoad {
    /// What was laid on and read.
    pub load: Arc<Load>,
    /// Why it says nothing of the present state, in words; empty if it does.
    pub outdated_because: String,
    /// Why it says nothing of the gain although it is of the present state, in words; empty if it does.
    pub left_out_because: String,
}

impl JudgedLoad {
    /// Whether it says something of the gain.
    #[must_use]
    pub fn counts(&self) -> bool {
        self.outdated_because.is_empty() && self.left_out_because.is_empty()
    }
}

/// Why a reading says nothing of the gain, in words: what a fault or the filling does to it is no property of the skin.
fn unfit(load: &Load) -> String {
    let read = &load.read;
    if read.out_of_range > 0 {
        counted(read.out_of_range as usize, "taxel was", "taxels were") + " beyond the calibrated range"
    } else if !read.reasons.is_empty() {
        format!("the force was DEGRADED: {}", read.reasons.join("; "))
    } else {
        String::new()
    }
}

/// What the loads of a patch are judged by.
#[derive(Clone, Debug)]
pub struct LoadsPlan {
    /// The patch's name.
    pub patch: String,
    /// Mean of the configured areas of its taxels, in mm2.
    pub mean_area_mm2: f64,
    /// Whether faulty taxels are filled by their neighbours.
    pub fills: bool,
}

impl LoadsPlan {
    /// How loads that were read with this mean area, in mm2, and `filled` taxels or not, were summed otherwise, in words.
    #[must_use]
    pub fn differs_from(&self, area_mm2: f64, filled: bool) -> Option<String> {
        let now_mm2 = self.mean_area_mm2;
        if (area_mm2 / now_mm2 - 1.0).abs() > SAME_AREA_SHARE {
            return Some(format!("the configured areas were {area_mm2:.3} mm2 in the mean, now {now_mm2:.3}"));
        }
        let [then, now] = if self.fills { ["not ", ""] } else { ["", "not "] };
        (filled != self.fills).then(|| format!("faulty taxels were {then}filled by their neighbours, and are {now}now"))
    }
}

/// The loads of a patch, oldest first, judged by its active model set and the mean of its configured areas.
#[must_use]
pub fn judge(plan: &LoadsPlan, all: &[Arc<Load>], model_set: Option<String>) -> Validation {
    let replaced: BTreeMap<u64, u64> = all.iter().filter_map(|load| Some((load.replaces?, load.number))).collect();
    let outdated = |load: &Load| {
        if let Some(by) = replaced.get(&load.number) {
            format!("load {by} replaces it")
        } else if Some(&load.model_set) != model_set.as_ref() {
            "another model set is active now".to_owned()
        } else {
            plan.differs_from(load.mean_area_mm2, load.filled).unwrap_or_default()
        }
    };
    let judged = |load: &Arc<Load>| {
        let outdated_because = outdated(load);
        let left_out_because = if outdated_because.is_empty() { unfit(load) } else { String::new() };
        JudgedLoad { load: Arc::clone(load), outdated_because, left_out_because }
    };
    let loads: Vec<JudgedLoad> = all.iter().rev().map(judged).collect();
    let errors: Vec<f64> =
        loads.iter().filter(|j| j.outdated_because.is_empty()).map(|j| j.load.error().abs()).collect();
    Validation {
        patch: plan.patch.clone(),
        model_set,
        mean_absolute_error: (!errors.is_empty()).then(|| errors.iter().sum::<f64>() / errors.len() as f64),
        loads,
    }
}
