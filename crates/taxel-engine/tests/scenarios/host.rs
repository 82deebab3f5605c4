//! The engine, driven as the daemon drives it, and all that came out of it.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::time::Duration;

use taxel_engine::calibration::{FitJob, SessionView};
use taxel_engine::command::{Command, Reply, RequestId};
use taxel_engine::events::{Event, EventWatch};
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::Plan;
use taxel_engine::record::{Record, Sample};
use taxel_engine::snapshot::{Catalogue, ForceState, Health, PatchSnapshot};
use taxel_engine::{BusNotice, Engine, Input, Now, Output, Restored};
use taxel_skin::Time;
use taxel_wire::{Frame, TimedFrame};

use crate::disk::{Disk, EPOCH_NS, id_of};
use crate::rig::BUS;
use crate::watch::check;

pub const SLOT: Duration = Duration::from_millis(10);

/// One engine and everything that it put out, oldest first.
pub struct Host {
    engine: Engine,
    pub plan: Arc<Plan>,
    pub now: Time,
    requests: u64,
    /// What came out of the first patch.
    pub snapshots: Vec<Arc<PatchSnapshot>>,
    /// The newest of each other patch, by its position.
    pub others: BTreeMap<usize, Arc<PatchSnapshot>>,
    /// When each snapshot came out.
    pub published: Vec<Time>,
    pub sessions: Vec<Arc<SessionView>>,
    pub healths: Vec<Arc<Health>>,
    pub catalogue: Arc<Catalogue>,
    pub sent: Vec<(Time, Frame)>,
    pub records: Vec<Record>,
    pub fits: Vec<FitJob>,
    /// What this run and earlier ones wrote down.
    pub disk: Disk,
    /// Tickets and sessions whose samples are to be read, as soon as the disk is not slow.
    pub loads: Vec<(u64, u64)>,
    /// Model sets that were asked for, by ticket.
    pub set_loads: Vec<(u64, String)>,
    /// Patches whose session was deleted.
    pub sessions_gone: Vec<usize>,
    /// Commits that wait for the disk, and whether it takes them by itself.
    pub commits: Vec<(u64, Vec<Record>)>,
    pub disk_is_slow: bool,
    /// Whether every fit ends in a panic.
    pub fits_panic: bool,
    /// What an operator may ask for later.
    pub events: Vec<Event>,
    event_watch: EventWatch,
    fitted: usize,
    /// Ticks in a row after which something was due already.
    overdue: u32,
    replies: HashMap<RequestId, Reply>,
}

impl Host {
    pub fn new(plan: Arc<Plan>, restored: Restored, now: Time) -> Self {
        let names = plan.patches.iter().map(|plan| plan.patch.name());
        let mut host = Self {
            disk: Disk { restored: restored.clone(), samples: BTreeMap::new() },
            events: Vec::new(),
            event_watch: EventWatch::new(names, &restored.active),
            engine: Engine::new(Arc::clone(&plan), restored),
            plan,
            now,
            requests: 0,
            snapshots: Vec::new(),
            others: BTreeMap::new(),
            published: Vec::new(),
            sessions: Vec::new(),
            healths: Vec::new(),
            catalogue: Arc::default(),
            sent: Vec::new(),
            records: Vec::new(),
            fits: Vec::new(),
            loads: Vec::new(),
            set_loads: Vec::new(),
            sessions_gone: Vec::new(),
            commits: Vec::new(),
            disk_is_slow: false,
            fits_panic: false,
            fitted: 0,
            overdue: 0,
            replies: HashMap::new(),
        };
        host.step(Input::Tick);
        host
    }

    /// Frames of one batch, in the order of reception.
    pub fn frames(&mut self, frames: &[TimedFrame]) {
        if let Some(newest) = frames.iter().map(|f| f.time).max() {
            self.now = self.now.max(newest);
            self.step(Input::Frames(BUS, frames));
        }
    }

    /// Scans that a program pushes, and frames of another bus than the boards'.
    pub fn input(&mut self, time: Time, input: Input<'_>) {
        self.now = self.now.max(time);
        self.step(input);
    }

    /// Time passes. A fit takes milliseconds, so it ends here and not among a slot's frames.
    pub fn tick(&mut self, now: Time) {
        self.now = self.now.max(now);
        while self.fitted < self.fits.len() {
            let panics = self.fits_panic;
            let outcome = self.fits[self.fitted].run(|set| {
                assert!(!panics, "this fit was to panic");
                id_of(set)
            });
            self.fitted += 1;
            self.step(Input::Fitted(outcome));
        }
        self.step(Input::Tick);
        // A daemon sleeps until then: what is due after tick and tick would keep it awake for nothing.
        let due = self.engine.next_deadline().filter(|due| *due <= self.now);
        self.overdue = if due.is_some() { self.overdue + 1 } else { 0 };
        assert!(self.overdue < 5, "due at {due:?}, still after five ticks, at {:?}", self.now);
    }

    /// Plays a recording up to `until` in slots of 10 ms; `cut` says how many of so many frames make the next batch.
    pub fn play(&mut self, log: &[TimedFrame], until: Time, mut cut: impl FnMut(usize) -> usize) {
        let mut rest = log;
        while self.now < until {
            let end = self.now + SLOT;
            let (slot, later) = rest.split_at(rest.partition_point(|f| f.time < end));
            let mut slot = slot;
            while !slot.is_empty() {
                let (batch, others) = slot.split_at(cut(slot.len()).clamp(1, slot.len()));
                self.frames(batch);
                slot = others;
            }
            rest = later;
            self.tick(end);
        }
    }

    pub fn notice(&mut self, notice: BusNotice) {
        self.step(Input::Bus(BUS, notice));
    }

    pub fn store_damaged(&mut self, damage: Vec<String>) {
        self.step(Input::StoreDamaged(damage));
    }

    /// Gives a command; the reply may come later.
    pub fn command(&mut self, command: Command) -> RequestId {
        self.requests += 1;
        let request = RequestId(self.requests);
        self.step(Input::Command(request, command));
        request
    }

    /// The store has written samples of a session.
    pub fn durable(&mut self, session: u64, samples: u64) {
        self.step(Input::Durable { session, samples });
    }

    /// Whether the reply is there.
    pub fn replied(&self, request: RequestId) -> bool {
        self.replies.contains_key(&request)
    }

    /// The reply, once it is there.
    pub fn reply(&mut self, request: RequestId) -> Option<Reply> {
        self.replies.remove(&request)
    }

    pub fn snapshot(&self) -> &PatchSnapshot {
        self.snapshots.last().expect("a snapshot was published")
    }

    pub fn state(&self) -> ForceState {
        self.snapshot().force.state
    }

    pub fn reasons(&self) -> String {
        self.snapshot().force.why()
    }

    pub fn session(&self) -> &SessionView {
        self.sessions.last().expect("there is a session")
    }

    pub fn health(&self) -> &Health {
        self.healths.last().expect("health was published")
    }

    /// What an operator would look at.
    pub fn present(&self) -> String {
        let force = self.snapshots.last().map(|s| (s.force.state, s.force.why()));
        format!("force {force:?}, session {:?}, health {:?}", self.sessions.last(), self.healths.last())
    }

    /// The samples of a session on disk.
    pub fn samples(&self, number: u64) -> Vec<Sample> {
        self.disk.samples[&number].samples.clone()
    }

    fn step(&mut self, input: Input<'_>) {
        let now = Now { time: self.now, wall_ns: EPOCH_NS + self.now.as_nanos() };
        // The shell may not have done everything of the step before: outputs are appended to that.
        let mut out = vec![Output::SessionGone(usize::MAX), Output::SessionGone(usize::MAX)];
        self.engine.step(now, input, &mut out);
        for output in out.drain(2..) {
            self.event_watch.look(now.wall_ns, &output, &mut self.events);
            self.collect(output);
        }
        if !self.disk_is_slow {
            self.commit(Ok(()));
            self.load();
            self.load_sets();
        }
    }

    /// The disk gives the samples that were asked for.
    pub fn load(&mut self) {
        for (ticket, session) in std::mem::take(&mut self.loads) {
            let result = self.disk.samples_of(session);
            self.step(Input::Loaded { ticket, result });
        }
    }

    /// The disk gives the model sets that were asked for.
    pub fn load_sets(&mut self) {
        for (ticket, id) in std::mem::take(&mut self.set_loads) {
            let result = self.disk.set_of(&id);
            self.step(Input::SetLoaded { ticket, result });
        }
    }

    /// A model set of the catalogue.
    pub fn set(&self, position: usize) -> Arc<ModelSet> {
        self.disk.set_of(&self.catalogue.model_sets[position].id).expect("it was written down")
    }

    /// The newest model set of the catalogue.
    pub fn newest_set(&self) -> Arc<ModelSet> {
        self.set(self.catalogue.model_sets.len() - 1)
    }

    /// The disk takes, or refuses, everything that waits for it.
    pub fn commit(&mut self, result: Result<(), String>) {
        for (ticket, records) in std::mem::take(&mut self.commits) {
            records.into_iter().filter(|_| result.is_ok()).for_each(|record| self.disk.write(record));
            self.step(Input::Committed { ticket, result: result.clone() });
        }
    }

    fn collect(&mut self, output: Output) {
        match output {
            Output::Patch(index @ 1.., snapshot) => {
                let before = self.others.get(&index).map(Arc::as_ref);
                check::snapshot(&self.plan.patches[index], self.now, before, &snapshot);
                self.others.insert(index, snapshot);
            }
            Output::Patch(_, snapshot) => {
                check::snapshot(&self.plan.patches[0], self.now, self.snapshots.last().map(Arc::as_ref), &snapshot);
                self.snapshots.push(snapshot);
                self.published.push(self.now);
            }
            Output::Session(_, view) => {
                check::session(&view);
                check::model_set_is_there(&view, &self.catalogue);
                self.sessions.push(view);
            }
            Output::Gauge(..) => {}
            Output::Health(health) => self.healths.push(health),
            Output::Catalogue(catalogue) => self.catalogue = catalogue,
            Output::Send(_, frame) => self.sent.push((self.now, frame)),
            Output::Record(record) => {
                self.disk.write(record.clone());
                self.records.push(record);
            }
            Output::Reply(request, reply) => {
                let earlier = self.replies.insert(request, reply);
                assert!(earlier.is_none(), "request {request:?} was answered twice");
            }
            Output::Commit { ticket, records } => {
                self.records.extend_from_slice(&records);
                self.commits.push((ticket, records));
            }
            Output::Fit(job) => self.fits.push(job),
            Output::Load { ticket, session } => self.loads.push((ticket, session)),
            Output::LoadSet { ticket, model_set } => self.set_loads.push((ticket, model_set)),
            Output::SessionGone(patch) => self.sessions_gone.push(patch),
        }
    }
}
