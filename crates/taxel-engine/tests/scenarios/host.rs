//! The engine, driven as the daemon drives it, and all that came out of it.

use std::collections::{BTreeMap, HashMap};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;
use std::time::Duration;

use taxel_engine::calibration::{FitJob, NotLoaded, SessionSamples, SessionView};
use taxel_engine::catalogue::StoreDamage;
use taxel_engine::command::{Command, Reply, RequestId};
use taxel_engine::events::{Event, EventWatch};
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::Plan;
use taxel_engine::record::{KeptZero, Record, Sample};
use taxel_engine::snapshot::{Catalogue, ForceState, Health, PatchSnapshot};
use taxel_engine::{BusNotice, Engine, Input, Now, Output, Restored};
use taxel_skin::Time;
use taxel_wire::{Frame, TimedFrame};

use crate::rig::BUS;
use crate::watch::check;

pub const SLOT: Duration = Duration::from_millis(10);

/// Wall time at the origin of the run's clock: a label that nothing may depend on.
pub const EPOCH_NS: i64 = 1_700_000_000_000_000_000;

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
    /// What an earlier run left on disk of its sessions.
    pub stored: HashMap<u64, SessionSamples>,
    /// And of its zeros, which are written down again only if they change.
    pub zeros: Vec<(String, KeptZero)>,
    /// Tickets and sessions whose samples are to be read, as soon as the disk is not slow.
    pub loads: Vec<(u64, u64)>,
    /// Model sets that an earlier run wrote down.
    pub shelf: Vec<Arc<ModelSet>>,
    /// Model sets that were asked for, by ticket.
    pub set_loads: Vec<(u64, String)>,
    /// Patches whose session was deleted.
    pub sessions_gone: Vec<usize>,
    /// Commits that wait for the disk, and whether it takes them by itself.
    pub commits: Vec<u64>,
    pub disk_is_slow: bool,
    /// Whether every fit ends in a panic.
    pub fits_panic: bool,
    /// How far the wall clock was set since the start.
    pub wall_offset_ns: i64,
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
        let shelf = restored.model_sets.iter().filter_map(|known| known.at_hand.clone()).collect();
        let mut host = Self {
            zeros: restored.zeros.clone(),
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
            stored: HashMap::new(),
            loads: Vec::new(),
            set_loads: Vec::new(),
            shelf,
            sessions_gone: Vec::new(),
            commits: Vec::new(),
            disk_is_slow: false,
            fits_panic: false,
            wall_offset_ns: 0,
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
                format!("m-{:016x}", digest(&format!("{:?}", set.taxels)))
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

    pub fn store_failed(&mut self, why: &str) {
        self.step(Input::StoreFailed(why.to_owned()));
    }

    pub fn store_damaged(&mut self, damage: StoreDamage) {
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

    /// The samples that were recorded of a session.
    pub fn samples(&self, number: u64) -> Vec<Sample> {
        let of_session = |record: &Record| match record {
            Record::Sample { session, sample, .. } if *session == number => Some(sample.clone()),
            _ => None,
        };
        self.records.iter().filter_map(of_session).collect()
    }

    fn step(&mut self, input: Input<'_>) {
        let now = Now { time: self.now, wall_ns: EPOCH_NS + self.now.as_nanos() + self.wall_offset_ns };
        // Whoever runs the engine may not have done everything of the step before: outputs are appended to that.
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
            let samples = self.on_disk(session);
            let result = samples.ok_or_else(|| NotLoaded::Damaged("they are not there".to_owned()));
            self.step(Input::Loaded { ticket, result });
        }
    }

    /// The disk gives the model sets that were asked for.
    pub fn load_sets(&mut self) {
        for (ticket, id) in std::mem::take(&mut self.set_loads) {
            let made = self.records.iter().filter_map(|record| match record {
                Record::ModelSet(set) => Some(set),
                _ => None,
            });
            let found = self.shelf.iter().chain(made).find(|set| set.id == id).cloned();
            let result = found.ok_or_else(|| NotLoaded::Damaged("its hash is not that of its content".to_owned()));
            self.step(Input::SetLoaded { ticket, result });
        }
    }

    /// A model set of the catalogue that is in memory.
    pub fn set(&self, position: usize) -> Arc<ModelSet> {
        let id = &self.catalogue.model_sets[position].id;
        let written = self.records.iter().filter_map(|record| match record {
            Record::ModelSet(set) => Some(set),
            _ => None,
        });
        let in_use = self.catalogue.model_sets.iter().filter_map(|known| known.at_hand.as_ref());
        let mut all = written.chain(&self.shelf).chain(in_use);
        Arc::clone(all.find(|set| set.id == *id).expect("it was written down"))
    }

    /// The newest model set of the catalogue.
    pub fn newest_set(&self) -> Arc<ModelSet> {
        self.set(self.catalogue.model_sets.len() - 1)
    }

    /// What this run and an earlier one wrote down of a session.
    pub fn on_disk(&self, number: u64) -> Option<SessionSamples> {
        let mut found = self.stored.get(&number).cloned();
        for record in &self.records {
            match record {
                Record::Ramp { session, ramp } if *session == number => {
                    found.get_or_insert_default().ramps.push(ramp.clone());
                }
                Record::Sample { session, sample, .. } if *session == number => {
                    found.get_or_insert_default().samples.push(sample.clone());
                }
                Record::SessionDeleted { session, .. } if *session == number => found = None,
                _ => {}
            }
        }
        found
    }

    /// The disk takes, or refuses, everything that waits for it.
    pub fn commit(&mut self, result: Result<(), String>) {
        for ticket in std::mem::take(&mut self.commits) {
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
            Output::Record(record) => self.records.push(record),
            Output::Reply(request, reply) => {
                let earlier = self.replies.insert(request, reply);
                assert!(earlier.is_none(), "request {request:?} was answered twice");
            }
            Output::Commit { ticket, records } => {
                self.records.extend(records);
                self.commits.push(ticket);
            }
            Output::Fit(job) => self.fits.push(job),
            Output::Load { ticket, session } => self.loads.push((ticket, session)),
            Output::LoadSet { ticket, model_set } => self.set_loads.push((ticket, model_set)),
            Output::SessionGone(patch) => self.sessions_gone.push(patch),
        }
    }
}

fn digest(text: &str) -> u64 {
    let mut hasher = DefaultHasher::new();
    text.hash(&mut hasher);
    hasher.finish()
}
