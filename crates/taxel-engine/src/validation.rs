//! Known loads: what the skin reads under them, how far it is off, and the effective-area factor they give.
//!
//! An operator lays a known mass on the skin and says so; the live force is read for a second, judged, and kept with
//! everything that it depends on. Three loads or more with the active model set give the factor by which the areas are
//! off in effect: gaps between taxels and what excluded ones leave uncounted are in it. It is applied to the live
//! force only where the plan asks for it.

mod factor;
mod load;
mod watch;

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::command::{Done, Rejection, Reply, RequestId};
use crate::engine::Engine;
use crate::io::{Now, Output};
use crate::patch::PatchEngine;
use crate::plan::PatchPlan;
use crate::record::Record;
use crate::snapshot::PatchSnapshot;

pub use factor::{AreaFactor, LOADS_MIN};
pub use load::{KnownLoad, Load, Reading, STANDARD_GRAVITY_M_PER_S2, Weight};
pub(crate) use watch::LoadWatch;

/// Loads of all patches that one store is good for; laying them down takes an operator days.
pub const LOADS_MAX: usize = 10_000;

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
    /// Whether it enters the factor.
    pub in_factor: bool,
}

/// All that the engine holds of known loads.
#[derive(Debug, Default)]
pub(crate) struct Loads {
    /// Oldest first.
    all: Vec<Arc<Load>>,
    next: u64,
    /// One per patch: the load that is being read.
    watches: Vec<Option<LoadWatch>>,
    /// One per patch: the factor that its areas are multiplied by.
    applied: Vec<Option<AreaFactor>>,
}

impl Loads {
    pub(crate) fn new(patches: usize, all: Vec<Arc<Load>>, next: u64) -> Self {
        let newest = all.iter().map(|load| load.number).max().unwrap_or(0);
        let watches = (0..patches).map(|_| None).collect();
        Self { all, next: next.max(newest + 1), watches, applied: vec![None; patches] }
    }
}

impl Engine {
    /// Begins to read a known load; the answer comes later.
    pub(crate) fn start_load(
        &mut self,
        now: Now,
        request: RequestId,
        patch: &str,
        load: KnownLoad,
    ) -> Result<(), Rejection> {
        let index = self.patch_named(patch)?;
        let force = load.force()?;
        self.store_takes_records()?;
        let patch = &self.patches[index];
        let refuse = |why: String| Err(Rejection::FailedPrecondition(why));
        if let Some(number) = load.replaces
            && !self.loads.all.iter().any(|l| l.number == number && l.patch == patch.plan.patch.name())
        {
            return Err(Rejection::NotFound(format!("load {number} of patch `{}`", patch.plan.patch.name())));
        }
        if self.loads.all.len() >= LOADS_MAX {
            return refuse(format!("there are {LOADS_MAX} loads already, which is the limit"));
        }
        if self.loads.watches[index].is_some() {
            return refuse("another load of this patch is being read: wait a second".to_owned());
        }
        if let Some(open) = patch.session.as_ref().filter(|s| s.view().state.is_open()) {
            let (number, state) = (open.view().number, open.view().state.name());
            return refuse(format!("session {number} is {state}; finish or abort it first"));
        }
        patch.check_vented(now)?;
        if patch.model_set.is_none() {
            return refuse("no model set is active: there is no force to compare".to_owned());
        }
        if patch.evaluator.is_none() {
            return refuse(format!("there is no valid zero: {}", patch.tare.view().reason));
        }
        if let Some(scans) = patch.tare.view().provisional_scans {
            return refuse(format!("the zero rests on {scans} scans so far: wait until it is whole"));
        }
        self.loads.watches[index] = Some(LoadWatch::new(now.time, request, load, force.0));
        Ok(())
    }

    /// Reads what was published in this step under the loads that are being read.
    pub(crate) fn watch_loads(&mut self, now: Now, out: &mut Vec<Output>) {
        for index in 0..self.loads.watches.len() {
            let Some(watch) = &mut self.loads.watches[index] else { continue };
            let verdict = published(out, index).find_map(|snapshot| watch.take(snapshot));
            let Some(verdict) = verdict.or_else(|| watch.overdue(now.time)) else { continue };
            let Some(watch) = self.loads.watches[index].take() else { continue };
            let request = watch.request;
            let reply = match verdict {
                Ok(reading) => self.keep_load(now, index, watch, reading, out),
                Err(why) => Err(Rejection::FailedPrecondition(why)),
            };
            out.push(Output::Reply(request, reply));
        }
    }

    fn keep_load(&mut self, now: Now, index: usize, watch: LoadWatch, read: Reading, out: &mut Vec<Output>) -> Reply {
        self.store_takes_records()?;
        let (known, patch) = (watch.load, &self.patches[index]);
        let load = Arc::new(Load {
            number: self.loads.next,
            patch: patch.plan.patch.name().to_owned(),
            wall_ns: now.wall_ns,
            by: known.by,
            note: known.note,
            mass_kg: if let Weight::Kilogram(kilogram) = known.weight { Some(kilogram) } else { None },
            force_n: watch.force_n,
            force_sigma_n: watch.force_n * known.relative_sigma,
            replaces: known.replaces,
            read,
            model_set: patch.model_set.as_ref().map(|set| set.id.clone()).unwrap_or_default(),
            mean_area_mm2: mean_area_mm2(&self.plan.patches[index]),
            area_factor: self.loads.applied[index].map_or(1.0, |factor| factor.value),
            area_uncertainty: patch.plan.area_uncertainty,
        });
        self.loads.next += 1;
        self.loads.all.push(Arc::clone(&load));
        self.catalogue_dirty = true;
        out.push(Output::Record(Record::Load(Arc::clone(&load))));
        Ok(Done::LoadRecorded(load))
    }

    /// Judges all loads against the present model sets, and applies the factors where the plan asks for them.
    pub(crate) fn judge_loads(&mut self) -> Vec<Arc<Validation>> {
        (0..self.patches.len()).map(|index| Arc::new(self.judge_patch(index))).collect()
    }

    fn judge_patch(&mut self, index: usize) -> Validation {
        let (nominal, patch) = (&self.plan.patches[index], &mut self.patches[index]);
        let model_set = patch.model_set.as_ref().map(|set| set.id.clone());
        let mut view = judge(&self.loads.all, nominal, model_set);
        view.not_applied_because = match view.factor {
            _ if !nominal.area_from_loads => "the configuration says area_factor = \"off\"".to_owned(),
            None => format!("it takes at least {LOADS_MIN} loads with the active model set"),
            Some(factor) => factor.doubt().unwrap_or_default(),
        };
        view.applied = view.not_applied_because.is_empty();
        let factor = view.factor.filter(|_| view.applied);
        if self.loads.applied[index] != factor {
            self.loads.applied[index] = factor;
            let (k, u) = factor.map_or((1.0, nominal.area_uncertainty), |f| (f.value, f.relative_sigma()));
            patch.set_area_factor(nominal, k, u);
        }
        view
    }
}

impl PatchEngine {
    /// Multiplies the areas of the plan, `nominal`, by `k`; `u` is their relative standard uncertainty from now on.
    ///
    /// Zero, faults and what hysteresis has done stay: a load may lie on the skin.
    pub(crate) fn set_area_factor(&mut self, nominal: &PatchPlan, k: f64, u: f64) {
        self.plan.areas = nominal.areas.iter().map(|area| taxel_skin::SquareMillimetre(area.0 * k)).collect();
        self.plan.area_uncertainty = u;
        self.parts = crate::force::ForceParts::new(&self.plan);
        self.move_tables();
        self.dirty = true;
    }
}

/// What a patch published, oldest first.
fn published(out: &[Output], patch: usize) -> impl Iterator<Item = &PatchSnapshot> {
    out.iter().filter_map(move |output| match output {
        Output::Patch(index, snapshot) if *index == patch => Some(snapshot.as_ref()),
        _ => None,
    })
}

fn mean_area_mm2(plan: &PatchPlan) -> f64 {
    plan.areas.iter().map(|area| area.0).sum::<f64>() / plan.areas.len().max(1) as f64
}

/// The loads of one patch, judged by its active model set and configured areas.
fn judge(all: &[Arc<Load>], nominal: &PatchPlan, model_set: Option<String>) -> Validation {
    let name = nominal.patch.name();
    let area_mm2 = mean_area_mm2(nominal);
    let of_patch = || all.iter().filter(|load| load.patch == name);
    let replaced: BTreeMap<u64, u64> = of_patch().filter_map(|load| Some((load.replaces?, load.number))).collect();
    let outdated = |load: &Load| {
        if let Some(by) = replaced.get(&load.number) {
            format!("load {by} replaces it")
        } else if Some(&load.model_set) != model_set.as_ref() {
            "another model set is active now".to_owned()
        } else if (load.mean_area_mm2 / area_mm2 - 1.0).abs() > SAME_AREA_SHARE {
            format!("the configured areas were {:.3} mm2 in the mean, now {area_mm2:.3}", load.mean_area_mm2)
        } else {
            String::new()
        }
    };
    let judged = |load: &Arc<Load>| {
        let outdated_because = outdated(load);
        let in_factor = outdated_because.is_empty() && load.read.out_of_range == 0;
        JudgedLoad { load: Arc::clone(load), outdated_because, in_factor }
    };
    let loads: Vec<JudgedLoad> = of_patch().rev().map(judged).collect();
    let errors: Vec<f64> =
        loads.iter().filter(|j| j.outdated_because.is_empty()).map(|j| j.load.error().abs()).collect();
    Validation {
        patch: name.to_owned(),
        model_set,
        mean_absolute_error: (!errors.is_empty()).then(|| errors.iter().sum::<f64>() / errors.len() as f64),
        factor: AreaFactor::estimate(loads.iter().filter(|j| j.in_factor).map(|j| j.load.as_ref())),
        loads,
        ..Validation::default()
    }
}
