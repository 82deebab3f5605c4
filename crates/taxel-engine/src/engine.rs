//! The engine: one `step` for every input, all state behind it.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;
use taxel_skin::{BusIndex, Time};
use taxel_wire::TimedFrame;
use taxel_wire::icub::Refusal;
use taxel_wire::signal::SignalRefusal;

use crate::health::BusLive;
use crate::io::{BusNotice, Input, Now, Output, Restored};
use crate::model_set::ModelSet;
use crate::patch::PatchEngine;
use crate::plan::Plan;
use crate::route::{Route, Routes};
use crate::session::{SessionSamples, SessionState, SessionView};
use crate::snapshot::{Catalogue, Health};
use crate::validation::Loads;

/// Health is looked at this often; staleness and faults have their own, faster ways out.
const HEALTH_EVERY: Duration = Duration::from_millis(250);

/// All state of the daemon, and the only thing that changes it.
#[derive(Debug)]
pub struct Engine {
    pub(crate) plan: Arc<Plan>,
    routes: Routes,
    pub(crate) patches: Vec<PatchEngine>,
    buses: Vec<BusLive>,
    pub(crate) sessions: BTreeMap<u64, Arc<SessionView>>,
    /// Samples of restored sessions that can go on, until one is taken up again.
    pub(crate) resumable: BTreeMap<u64, SessionSamples>,
    pub(crate) model_sets: Vec<Arc<ModelSet>>,
    pub(crate) next_session: u64,
    pub(crate) loads: Loads,
    pub(crate) store_problem: Option<String>,
    /// What was found wrong at start.
    problems: Vec<String>,
    pub(crate) catalogue_dirty: bool,
    health: Arc<Health>,
    health_seen: Option<Time>,
}

impl Engine {
    /// An engine for `plan` that goes on from what the store found. Nothing happens until the first step.
    #[must_use]
    pub fn new(plan: Arc<Plan>, restored: Restored) -> Self {
        let patches = plan.patches.iter().enumerate().map(|(i, p)| PatchEngine::new(i, p.clone())).collect();
        let mut engine = Self {
            routes: Routes::new(&plan),
            buses: vec![BusLive::default(); plan.buses],
            loads: Loads::new(plan.patches.len(), restored.loads, restored.next_load),
            patches,
            sessions: BTreeMap::new(),
            resumable: BTreeMap::new(),
            model_sets: restored.model_sets,
            next_session: restored.next_session.max(1),
            store_problem: None,
            problems: Vec::new(),
            catalogue_dirty: true,
            health: Arc::default(),
            health_seen: None,
            plan,
        };
        for session in restored.sessions {
            let number = session.view.number;
            if let Some(samples) = session.samples {
                engine.take_up(&session.view, samples);
            }
            engine.sessions.insert(number, session.view);
        }
        for (patch, id) in restored.active {
            engine.install(&patch, &id);
        }
        engine
    }

    /// Keeps the samples of a session that can go on, if they are of the patch as it is configured now.
    fn take_up(&mut self, view: &SessionView, samples: SessionSamples) {
        let patch = self.patches.iter().find(|p| p.plan.patch.name() == view.patch);
        let taxels = patch.map_or(0, |p| p.plan.patch.taxels().len());
        if samples.samples.iter().all(|sample| sample.counts.len() == taxels) {
            self.resumable.insert(view.number, samples);
        } else {
            let (number, patch) = (view.number, &view.patch);
            self.problems.push(format!("session {number} is of another layout of patch `{patch}` and cannot go on"));
        }
    }

    /// Installs the model set that was active when the store was last written.
    fn install(&mut self, patch: &str, id: &str) {
        let set = self.model_sets.iter().find(|set| set.id == id && set.patch == patch).cloned();
        let found = self.patches.iter_mut().find(|p| p.plan.patch.name() == patch);
        match (found, set) {
            (Some(patch), Some(set)) if set.taxels.len() == patch.plan.patch.taxels().len() => patch.set_model_set(set),
            (Some(_), Some(_)) => self.problems.push(format!(
                "model set `{id}` is of another layout of patch `{patch}`: it is not used; calibrate again"
            )),
            (Some(_), None) => self.problems.push(format!("the active model set `{id}` of patch `{patch}` is lost")),
            (None, _) => {} // the patch is not configured any more
        }
    }

    /// Which identifiers of a bus the kernel has to let through.
    #[must_use]
    pub const fn routes(&self) -> &Routes {
        &self.routes
    }

    /// Takes one input; what has to be done because of it is appended to `out`, in order.
    pub fn step(&mut self, now: Now, input: Input<'_>, out: &mut Vec<Output>) {
        if self.health_seen.is_none() {
            self.health_seen = Some(now.time);
            self.patches.iter_mut().for_each(|p| p.start(now));
        }
        match input {
            Input::Frames(bus, frames) => self.on_frames(now, bus, frames, out),
            Input::Bus(bus, notice) => self.on_bus(bus, notice),
            Input::Tick => self.tick(now, out),
            Input::Command(request, command) => self.on_command(now, request, command, out),
            Input::Fitted(outcome) => {
                for patch in &mut self.patches {
                    if let Some(set) = patch.on_fitted(now, outcome.clone(), out) {
                        self.model_sets.push(set);
                    }
                }
                self.catalogue_dirty = true;
            }
            Input::Durable { session, samples } => {
                for patch in &mut self.patches {
                    patch.on_durable(session, samples);
                }
            }
            Input::StoreFailed(why) => self.on_store_failed(now, why, out),
        }
        self.note_sessions(out);
        self.watch_loads(now, out);
        if std::mem::take(&mut self.catalogue_dirty) {
            out.push(Output::Catalogue(Arc::new(self.catalogue())));
        }
    }

    fn on_frames(&mut self, now: Now, bus: BusIndex, frames: &[TimedFrame], out: &mut Vec<Output>) {
        let Some(live) = self.buses.get_mut(bus.0 as usize) else { return };
        live.up = true;
        for frame in frames {
            // What a frame brings about happens at its own time, so that it does not matter how frames were batched.
            let now = now.at(frame.time);
            let refused = match self.routes.of(bus, frame.frame.id) {
                Route::Foreign => {
                    live.foreign += 1;
                    continue;
                }
                Route::Module { patch, module } => {
                    let patch = &mut self.patches[patch as usize];
                    patch.on_module_frame(now, module as usize, frame, out).err().map(|e: Refusal| e.to_string())
                }
                Route::Board { patch, board } => {
                    let patch = &mut self.patches[patch as usize];
                    patch.on_board_frame(board as usize, &frame.frame).err().map(|e| e.to_string())
                }
                Route::Gauge => on_gauge(&mut self.patches, now, bus, frame, out).err().map(|e| e.to_string()),
            };
            match refused {
                None => live.frames += 1,
                Some(why) => live.refuse(&frame.frame, why),
            }
        }
    }

    fn on_bus(&mut self, bus: BusIndex, notice: BusNotice) {
        let Some(live) = self.buses.get_mut(bus.0 as usize) else { return };
        let lost = live.on_notice(notice);
        if let Some(why) = lost {
            for patch in &mut self.patches {
                if patch.plan.patch.boards().iter().any(|board| board.bus == bus) {
                    patch.lose_zero(format!("bus {}: {why}", bus.0));
                }
            }
        }
        self.health_seen = Some(Time::from_nanos(i64::MIN)); // due at the next tick
    }

    fn on_store_failed(&mut self, now: Now, why: String, out: &mut Vec<Output>) {
        for patch in &mut self.patches {
            if patch.session.as_ref().is_some_and(|s| s.view().state.is_open()) {
                patch.enter(now, SessionState::Failed, format!("the store failed: {why}"), out);
            }
        }
        self.store_problem = Some(format!("the store failed and takes nothing until a restart: {why}"));
    }

    fn tick(&mut self, now: Now, out: &mut Vec<Output>) {
        for patch in &mut self.patches {
            patch.tick(now, out);
        }
        if self.health_seen.is_none_or(|seen| now.time.since(seen) >= HEALTH_EVERY) {
            self.health_seen = Some(now.time);
            let health = self.look_at_health(now.time);
            if health != *self.health {
                self.health = Arc::new(health);
                out.push(Output::Health(Arc::clone(&self.health)));
            }
        }
    }

    fn look_at_health(&self, now: Time) -> Health {
        Health {
            buses: self.buses.iter().map(BusLive::view).collect(),
            boards: self.patches.iter().flat_map(|patch| patch.board_health(now)).collect(),
            problems: self.problems.iter().chain(&self.store_problem).cloned().collect(),
        }
    }

    /// Keeps the list of sessions in step with what was recorded of them.
    fn note_sessions(&mut self, out: &[Output]) {
        use crate::record::Record;
        for output in out {
            if let Output::Record(Record::Session(view)) = output {
                let old = self.sessions.insert(view.number, Arc::clone(view));
                self.catalogue_dirty |= old.is_none_or(|old| old != *view);
            }
        }
    }

    fn catalogue(&mut self) -> Catalogue {
        let validations = self.judge_loads();
        let active = |p: &PatchEngine| (p.plan.patch.name().to_owned(), p.model_set.as_ref().map(|set| set.id.clone()));
        Catalogue {
            sessions: self.sessions.values().cloned().collect(),
            model_sets: self.model_sets.clone(),
            active: self.patches.iter().map(active).collect(),
            validations,
        }
    }
}

/// One gauge may serve several patches, each with its own idea of scale and meaning.
fn on_gauge(
    patches: &mut [PatchEngine],
    now: Now,
    bus: BusIndex,
    frame: &TimedFrame,
    out: &mut Vec<Output>,
) -> Result<(), SignalRefusal> {
    for patch in patches {
        let Some(gauge) = patch.plan.gauge.as_ref().filter(|g| g.bus == bus && g.signal.id == frame.frame.id) else {
            continue;
        };
        let pressure = gauge.signal.decode(&frame.frame)?;
        patch.gauge.push(frame.time, pressure);
        patch.advance_session(now, out);
    }
    Ok(())
}
