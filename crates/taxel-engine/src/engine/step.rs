//! The engine: one `step` for every input, all state behind it.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;
use taxel_skin::{BusIndex, Time};
use taxel_wire::TimedFrame;

use crate::boundary::catalogue::{Catalogue, Restored};
use crate::boundary::input::Input;
use crate::boundary::output::Output;
use crate::boundary::record::Record;
use crate::boundary::snapshot::{Health, StoreHealth};
use crate::calibration::transition::Trigger;
use crate::calibration::view::SessionView;
use crate::engine::pending::{Effect, Pending};
use crate::engine::routes::{Route, Routes};
use crate::engine::shared::SharedBoards;
use crate::intake::boards::SILENT_AFTER;
use crate::intake::health::{BusNotice, BusState};
use crate::intake::receive::{Intake, IntakeEvent};
use crate::known_set::KnownSet;
use crate::loads::load::Load;
use crate::now::Now;
use crate::patch::owner::{Intent, Patch};
use crate::plan::Plan;
use crate::request::RequestId;

/// The kernel keeps half a second of a full bus, and what it drops began after that: of so long a time frames may lack that it
/// dropped. A longer pause of the host is reported as such.
const BUFFERED: Duration = Duration::from_millis(500);
/// After a longer pause of the daemon the boards are suspect.
const PAUSE_MAX: Duration = Duration::from_secs(10);
/// Health is shown this soon after something changed; staleness and faults have their own, faster ways out.
const HEALTH_EVERY: Duration = Duration::from_millis(250);
/// Counters alone are shown this often.
const COUNTERS_EVERY: Duration = Duration::from_secs(1);

/// All state of the daemon, and the only thing that changes it.
#[derive(Debug)]
pub struct Engine {
    pub(super) plan: Arc<Plan>,
    routes: Routes,
    pub(super) shared: SharedBoards,
    pub(super) patches: Vec<Patch>,
    pub(super) buses: Vec<BusState>,
    pub(super) sessions: BTreeMap<u64, Arc<SessionView>>,
    /// Every stored set, oldest first. In memory are those in use.
    pub(super) model_sets: Vec<KnownSet>,
    pub(super) next_session: u64,
    pub(super) next_load: u64,
    pub(super) pending: Pending,
    pub(super) store_problem: Option<String>,
    /// What was found wrong at start.
    pub(super) problems: Vec<String>,
    /// What the store found damaged.
    pub(super) damage: Vec<String>,
    pub(super) catalogue_dirty: bool,
    /// When it has been listened for long enough whether the boards stream, until then.
    begins: Option<Time>,
    health: Arc<Health>,
    health_shown: Option<Time>,
    /// What follows of the present step.
    pub(super) out: Vec<Output>,
    /// Something but a counter changed since the health was shown, or a counter did.
    pub(super) health_dirty: (bool, bool),
}

impl Engine {
    /// An engine for `plan` that goes on from what the store found. Nothing happens until the first step.
    #[must_use]
    pub fn new(plan: Arc<Plan>, restored: Restored) -> Self {
        let of_patch = |name: &str| -> Vec<Arc<Load>> {
            restored.loads.iter().filter(|load| load.patch == name).cloned().collect()
        };
        let zero_of = |name: &str| {
            let known = restored.zeros.iter().find(|(patch, _)| patch == name);
            known.map(|(_, zero)| zero.clone()).unwrap_or_default()
        };
        let shared = SharedBoards::new(&plan);
        let patch = |(i, p): (usize, &crate::plan::PatchPlan)| {
            let name = p.patch.name();
            Patch::new(i, p.clone(), of_patch(name), zero_of(name), shared.of_patch(i))
        };
        let newest_load = restored.loads.iter().map(|load| load.number).max().unwrap_or(0);
        let mut engine = Self {
            routes: Routes::new(&plan),
            buses: vec![BusState::default(); plan.buses],
            patches: plan.patches.iter().enumerate().map(patch).collect(),
            sessions: restored.sessions.into_iter().map(|view| (view.number, view)).collect(),
            model_sets: restored.model_sets,
            next_session: restored.next_session.max(1),
            next_load: restored.next_load.max(newest_load + 1),
            shared,
            pending: Pending::default(),
            store_problem: None,
            problems: Vec::new(),
            damage: restored.problems,
            catalogue_dirty: true,
            begins: None,
            health: Arc::default(),
            health_shown: None,
            out: Vec::new(),
            health_dirty: (true, true),
            plan,
        };
        for (patch, id) in restored.active {
            engine.install(&patch, &id);
        }
        engine.keep_at_hand();
        engine
    }

    /// Which identifiers of a bus the kernel has to let through.
    #[must_use]
    pub const fn routes(&self) -> &Routes {
        &self.routes
    }

    /// When the engine has something to do at the latest, if nothing comes before: give it [`Input::Tick`] then.
    #[must_use]
    pub fn next_deadline(&self) -> Option<Time> {
        let health = self.health_shown.and_then(|shown| match self.health_dirty {
            (true, _) => Some(shown + HEALTH_EVERY),
            (false, true) => Some(shown + COUNTERS_EVERY),
            (false, false) => None,
        });
        self.patches.iter().filter_map(Patch::deadline).chain(health).chain(self.begins).min()
    }

    /// Takes one input; what has to be done because of it is appended to `out`, in order.
    pub fn step(&mut self, now: Now, input: Input<'_>, out: &mut Vec<Output>) {
        if self.health_shown.is_none() {
            self.each_patch(now, |patch| patch.start(now));
            self.begins = Some(now.time + SILENT_AFTER);
            self.show_health(now.time);
        }
        match input {
            Input::Frames(bus, frames) => self.on_frames(now, bus, frames),
            Input::Pushed(scan) => self.on_pushed(now, scan),
            Input::Bus(bus, notice) => self.on_bus(now, bus, notice),
            Input::Tick => self.tick(now),
            Input::Resumed(gap) => self.on_resumed(now, gap),
            Input::Command(request, command) => self.on_command(now, request, command),
            Input::Fitted(outcome) => self.on_fitted(now, outcome),
            Input::Committed { ticket, result } => self.on_committed(now, ticket, result),
            Input::Loaded { ticket, result } => self.on_loaded(now, ticket, result),
            Input::SetLoaded { ticket, result } => self.on_set_loaded(now, ticket, result),
            Input::StoreDamaged(damage) => {
                self.damage = damage;
                self.health_dirty.0 = true;
            }
            Input::Durable { session, samples } => {
                self.each_patch(now, |patch| {
                    patch.with_session(now, |held, _| held.on_durable(session, samples));
                });
            }
            Input::StoreFailed(why) => self.on_store_failed(now, &why),
        }
        self.note_sessions();
        if std::mem::take(&mut self.catalogue_dirty) {
            // Before the sessions of this step: a reader that sees one in review asks for its model set.
            let session = self.out.iter().position(|output| matches!(output, Output::Session(..)));
            let catalogue = Output::Catalogue(Arc::new(self.catalogue()));
            self.out.insert(session.unwrap_or(self.out.len()), catalogue);
        }
        out.append(&mut self.out);
    }

    /// Does something to every patch, and what it intends.
    fn each_patch(&mut self, now: Now, mut act: impl FnMut(&mut Patch)) {
        for index in 0..self.patches.len() {
            self.with_patch(now, index, &mut act);
        }
    }

    /// Does something to one patch, and then what it intends.
    pub(super) fn with_patch<T>(&mut self, now: Now, index: usize, act: impl FnOnce(&mut Patch) -> T) -> T {
        let patch = &mut self.patches[index];
        let result = act(patch);
        patch.note_zero();
        self.out.append(&mut patch.out);
        for intent in std::mem::take(&mut patch.intents) {
            self.intend(now, index, intent);
        }
        result
    }

    /// Something comes in to one patch.
    fn with_intake<T>(
        &mut self,
        now: Now,
        index: usize,
        act: impl FnOnce(&mut Intake, &mut Vec<IntakeEvent>) -> T,
    ) -> T {
        self.with_patch(now, index, |patch| patch.with_intake(now, act))
    }

    /// Has written down what a patch intends, before it takes effect, and tells others what concerns them, too.
    fn intend(&mut self, now: Now, index: usize, intent: Intent) {
        let (request, planned) = match intent {
            Intent::News { board, news } => {
                for (other, board) in self.shared.others(index, board).to_vec() {
                    self.with_intake(now, other, |intake, events| intake.on_news(board, &news, events));
                }
                return;
            }
            Intent::Zero { request, record } => {
                (request, self.store_takes_records().map(|()| (Effect::Zero(index, request), record)))
            }
            Intent::Load(read) => {
                let request = read.request;
                let load = self.store_takes_records();
                let load = load.and_then(|()| self.patches[index].complete_load(now, self.next_load, read));
                let planned = load.map(|load| {
                    self.next_load += 1;
                    (Effect::Load(index, Arc::clone(&load)), Record::Load(load))
                });
                (request, planned)
            }
        };
        match planned {
            Ok((effect, record)) => self.commit(Some(request), effect, vec![record]),
            Err(rejection) => {
                self.patches[index].reject_zero(request);
                self.out.push(Output::Reply(request, Err(rejection)));
            }
        }
    }

    /// Hands records to the shell; the effect follows once they are on disk.
    pub(super) fn commit(&mut self, request: Option<RequestId>, effect: Effect, records: Vec<Record>) {
        let ticket = self.pending.keep(request, effect);
        self.out.push(Output::Commit { ticket, records });
    }

    fn on_frames(&mut self, now: Now, bus: BusIndex, frames: &[TimedFrame]) {
        if let (Some(state), Some(newest)) = (self.buses.get_mut(usize::from(bus.0)), frames.last()) {
            self.health_dirty.0 |= state.on_frames(newest.time);
        }
        for frame in frames {
            // What a frame brings about happens at its own time, so that it does not matter how frames were batched.
            let refused = self.on_frame(now.at(frame.time), bus, frame);
            let Some(state) = self.buses.get_mut(usize::from(bus.0)) else { return };
            match refused {
                Ok(true) => state.health.frames += 1,
                Ok(false) => state.health.foreign += 1,
                Err(why) => state.refuse(format!("{}: {why}", frame.frame.id)),
            }
        }
        self.health_dirty.1 |= !frames.is_empty();
    }

    /// Whether a frame is for anybody here, or what is wrong with one that is.
    fn on_frame(&mut self, now: Now, bus: BusIndex, frame: &TimedFrame) -> Result<bool, String> {
        let taken = match self.routes.of(bus, frame.frame.id) {
            Route::Foreign => return Ok(false),
            Route::Described => return self.on_described(now, bus, frame),
            Route::Module { patch, module } => self.with_intake(now, usize::from(patch), |intake, events| {
                intake.on_module_frame(usize::from(module), frame, events)
            }),
            Route::Board { patch, board } => self.with_intake(now, usize::from(patch), |intake, events| {
                intake.on_board_frame(usize::from(board), &frame.frame, events)
            }),
        };
        taken.map(|()| true).map_err(|refusal| refusal.to_string())
    }

    /// A frame of gauges and devices, which may have numbers of several patches in it. One gauge may serve several, each with its
    /// own idea of scale and meaning: what one refuses may well be right for the next.
    fn on_described(&mut self, now: Now, bus: BusIndex, frame: &TimedFrame) -> Result<bool, String> {
        let (mut ours, mut refused) = (false, None);
        for index in 0..self.patches.len() {
            let plan = &self.plan.patches[index];
            let gauge = plan.gauge.as_ref().filter(|gauge| gauge.bus == bus && gauge.signal.id == frame.frame.id);
            let (pressure, has_devices) = (
                gauge.map(|gauge| gauge.signal.decode(&frame.frame)),
                !plan.devices.is_empty() && plan.patch.is_on(bus),
            );
            ours |= pressure.is_some();
            match pressure {
                Some(Ok(kpa)) => self.with_patch(now, index, |patch| patch.on_pressure(now, frame.time, kpa)),
                Some(Err(why)) => refused = Some(why.to_string()),
                None => {}
            }
            if has_devices {
                match self.with_intake(now, index, |intake, events| intake.on_device_frame(frame, events)) {
                    Ok(theirs) => ours |= theirs,
                    Err(short) => refused = Some(short.to_string()),
                }
            }
        }
        refused.map_or(Ok(ours), Err)
    }

    fn on_bus(&mut self, now: Now, bus: BusIndex, notice: BusNotice) {
        let Some(state) = self.buses.get_mut(usize::from(bus.0)) else { return };
        let dropped = matches!(notice, BusNotice::Dropped(_));
        let lost = state.on_notice(now.time, notice);
        self.health_dirty.0 = true;
        for index in 0..self.patches.len() {
            if !self.plan.patches[index].patch.is_on(bus) {
                continue;
            }
            if dropped {
                self.patches[index].on_frames_lost(now.time, Some(bus), BUFFERED);
            }
            if let Some(why) = &lost {
                let why = format!("bus {}: {why}", bus.0);
                self.with_patch(now, index, |patch| patch.on_bus_lost(now, bus, &why));
            }
        }
    }

    /// A short pause says nothing of the boards: the kernel kept their frames. After a long one, as when the machine was
    /// suspended, they may have been without power or have taken a new zero.
    fn on_resumed(&mut self, now: Now, gap: Duration) {
        self.patches.iter_mut().for_each(|patch| patch.on_frames_lost(now.time, None, gap));
        if gap <= PAUSE_MAX {
            return;
        }
        let seconds = gap.as_secs_f64();
        let why = format!("the daemon did not run for {seconds:.1} s; boards may have lost their zero meanwhile");
        for index in 0..self.patches.len() {
            for bus in (0..self.buses.len()).map(|bus| BusIndex(bus as u8)) {
                if self.plan.patches[index].patch.is_on(bus) {
                    self.with_patch(now, index, |patch| patch.on_bus_lost(now, bus, &why));
                }
            }
        }
    }

    fn on_store_failed(&mut self, now: Now, why: &str) {
        let reason = format!("the store failed: {why}");
        self.each_patch(now, |patch| {
            patch.with_session(now, |session, _| session.trigger(now, Trigger::Fail, &reason));
        });
        self.store_problem = Some(format!("the store failed and takes nothing until a restart: {why}"));
        self.health_dirty.0 = true;
    }

    fn tick(&mut self, now: Now) {
        let before = self.out.len();
        let heard = self.patches.iter().all(Patch::is_heard);
        if self.begins.take_if(|at| heard || *at <= now.time).is_some() {
            self.begin_bring_up(now);
        }
        self.each_patch(now, |patch| patch.tick(now));
        self.health_dirty.0 |= self.out.len() > before; // silence and bring-up show without a frame
        let since = self.health_shown.map_or(Duration::MAX, |shown| now.time.since(shown));
        // Boards change with their frames; what they say is looked at with the counters.
        let (changed, counted) = self.health_dirty;
        if (changed && since >= HEALTH_EVERY) || (counted && since >= COUNTERS_EVERY) {
            self.show_health(now.time);
        }
    }

    fn show_health(&mut self, now: Time) {
        self.health_shown = Some(now);
        self.health_dirty = (false, false);
        let health = self.look_at_health(now);
        if health != *self.health {
            self.health = Arc::new(health);
            self.out.push(Output::Health(Arc::clone(&self.health)));
        }
    }

    fn look_at_health(&self, now: Time) -> Health {
        Health {
            buses: self.buses.iter().map(|bus| bus.health.clone()).collect(),
            boards: self.patches.iter().flat_map(|patch| patch.board_health(now)).collect(),
            problems: self.problems.iter().chain(&self.damage).chain(&self.store_problem).cloned().collect(),
            store: StoreHealth { problem: self.store_problem.clone(), damage: self.damage.clone() },
        }
    }

    /// Keeps the list of sessions in step with what was recorded of them.
    fn note_sessions(&mut self) {
        for output in &self.out {
            if let Output::Record(Record::Session(view)) = output {
                let old = self.sessions.insert(view.number, Arc::clone(view));
                self.catalogue_dirty |= old.is_none_or(|old| old != *view);
            }
        }
    }

    fn catalogue(&self) -> Catalogue {
        let validations = self.patches.iter().map(|patch| Arc::new(patch.validate())).collect();
        let active = |p: &Patch| (p.name().to_owned(), p.models().map(|set| set.id.clone()));
        Catalogue {
            sessions: self.sessions.values().map(|view| self.seen(view)).collect(),
            model_sets: self.model_sets.clone(),
            active: self.patches.iter().map(active).collect(),
            validations,
        }
    }
}
