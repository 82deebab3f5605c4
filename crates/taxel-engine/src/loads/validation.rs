//! Known loads, judged: how far off the readings are, and what factor they give.

use std::collections::BTreeMap;
use std::sync::Arc;
use taxel_skin::SquareMillimetre;

use crate::loads::factor::AreaFactor;
use crate::loads::load::Load;

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
    /// The factor that these loads give, if they are enough.
    pub factor: Option<AreaFactor>,
    /// Whether the areas are multiplied by it now.
    pub applied: bool,
    /// Why it is not applied, in words; empty if it is.
    pub not_applied_because: String,
}

/// A load and what it is good for now.
#[derive(Clone, Debug, PartialEq)]
pub struct JudgedLoad {
    /// What was laid on and read.
    pub load: Arc<Load>,
    /// Why it says nothing of the present state, in words; empty if it does.
    pub outdated_because: String,
    /// Why it does not enter the factor although it is of the present state, in words; empty if it does.
    pub left_out_because: String,
}

impl JudgedLoad {
    /// Whether it enters the factor.
    #[must_use]
    pub fn in_factor(&self) -> bool {
        self.outdated_because.is_empty() && self.left_out_because.is_empty()
    }
}

/// Why a reading says nothing of areas, in words: what a fault or the filling does to it is no property of the skin.
fn unfit(load: &Load) -> String {
    let read = &load.read;
    if read.out_of_range > 0 {
        format!("{} taxels were beyond their calibrated range", read.out_of_range)
    } else if !read.reasons.is_empty() {
        format!("the force had a shortcoming: {}", read.reasons.join("; "))
    } else {
        String::new()
    }
}

/// Mean of the areas, in mm2.
#[must_use]
pub fn mean_area_mm2(areas: &[SquareMillimetre]) -> f64 {
    areas.iter().map(|area| area.0).sum::<f64>() / areas.len().max(1) as f64
}

/// What loads are judged by.
#[derive(Clone, Copy, Debug)]
pub struct Patch<'a> {
    /// Its name.
    pub name: &'a str,
    /// Mean of the configured areas, in mm2.
    pub mean_area_mm2: f64,
    /// Whether faulty taxels are filled by their neighbours.
    pub fills: bool,
}

/// The loads of a patch, oldest first, judged by its active model set and the mean of its configured areas.
#[must_use]
pub fn judge(patch: Patch<'_>, all: &[Arc<Load>], model_set: Option<String>) -> Validation {
    let area_mm2 = patch.mean_area_mm2;
    let replaced: BTreeMap<u64, u64> = all.iter().filter_map(|load| Some((load.replaces?, load.number))).collect();
    let outdated = |load: &Load| {
        if let Some(by) = replaced.get(&load.number) {
            format!("load {by} replaces it")
        } else if Some(&load.model_set) != model_set.as_ref() {
            "another model set is active now".to_owned()
        } else if (load.mean_area_mm2 / area_mm2 - 1.0).abs() > SAME_AREA_SHARE {
            format!("the configured areas were {:.3} mm2 in the mean, now {area_mm2:.3}", load.mean_area_mm2)
        } else if load.filled.is_some_and(|then| then != patch.fills) {
            let [then, now] = if patch.fills { ["not ", ""] } else { ["", "not "] };
            format!("faulty taxels were {then}filled by their neighbours, and are {now}now")
        } else {
            String::new()
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
        patch: patch.name.to_owned(),
        model_set,
        mean_absolute_error: (!errors.is_empty()).then(|| errors.iter().sum::<f64>() / errors.len() as f64),
        factor: AreaFactor::estimate(loads.iter().filter(|j| j.in_factor()).map(|j| j.load.as_ref())),
        loads,
        ..Validation::default()
    }
}
