//! The engine as a daemon drives it: stalls, restarts, a store that takes its time, fits that come back later.

use std::sync::Arc;
use std::time::Duration;

use taxel_engine::calibration::{FitJob, SessionView};
use taxel_engine::command::{Command, Done, Reply, RequestId};
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::Plan;
use taxel_engine::snapshot::{Catalogue, PatchSnapshot};
use taxel_engine::{BusNotice, Engine, Input, Now, Output};
use taxel_skin::Time;
use taxel_wire::{Frame, TimedFrame};

use crate::dice::Dice;
use crate::disk::{EPOCH_NS, id_of};
use crate::rig::BUS;
use crate::store::Store;

/// Frames that one read of the socket gives.
const BATCH_FRAMES: usize = 64;

/// One daemon and what it put out since it was last asked.
pub struct Daemon {
    plan: Arc<Plan>,
    engine: Option<Engine>,
    now: Time,
    requests: u64,
    out: Vec<Output>,
    store: Store,
    dice: Dice,
    /// Commits and when they are on disk; `None` where the disk refuses.
    commits: Vec<(Option<Time>, u64)>,
    fits: Vec<(Time, FitJob)>,
    /// Questions for the samples of a session: when they are answered, the ticket and the session.
    loads: Vec<(Time, u64, u64)>,
    set_loads: Vec<(u64, String)>,
    /// Frames that came while the engine stood still.
    waiting: Vec<TimedFrame>,
    stalled_until: Time,
    /// Nothing comes from the bus.
    deaf: bool,
    /// Samples as they were published, with the position of their patch.
    pub published: Vec<(usize, Arc<PatchSnapshot>)>,
    /// Frames for the boards.
    pub sent: Vec<Frame>,
    /// Answers in words.
    pub replies: Vec<(RequestId, String)>,
    /// The newest of each patch.
    pub newest: Vec<Arc<PatchSnapshot>>,
    pub sessions: Vec<Option<Arc<SessionView>>>,
    pub catalogue: Arc<Catalogue>,
}

impl Daemon {
    pub fn new(plan: Arc<Plan>, store: Store, dice: Dice, now: Time) -> Self {
        let patches = plan.patches.len();
        let mut daemon = Self {
            plan,
            engine: None,
            now,
            requests: 0,
            out: Vec::new(),
            store,
            dice,
            commits: Vec::new(),
            fits: Vec::new(),
            loads: Vec::new(),
            set_loads: Vec::new(),
            waiting: Vec::new(),
            stalled_until: now,
            deaf: false,
            published: Vec::new(),
            sent: Vec::new(),
            replies: Vec::new(),
            newest: vec![Arc::default(); patches],
            sessions: vec![None; patches],
            catalogue: Arc::default(),
        };
        daemon.start();
        daemon
    }

    /// Starts from what the store has.
    pub fn start(&mut self) {
        self.store.failed = false;
        self.engine = Some(Engine::new(Arc::clone(&self.plan), self.store.disk.found()));
        self.step(self.now, Input::Tick);
    }

    /// Stops: cleanly everything reaches the disk, in a crash only what did already.
    pub fn stop(&mut self, cleanly: bool) {
        if cleanly {
            self.store.write(Time::from_nanos(i64::MAX));
        }
        self.store.lose_waiting();
        self.engine = None;
        self.newest.fill(Arc::default());
        self.sessions.fill(None);
        self.fits.clear();
        self.loads.clear();
        self.set_loads.clear();
        self.commits.clear();
        self.waiting.clear();
    }

    /// Whether what was found of a board's zero was lost with an earlier run.
    pub const fn has_forgotten(&self) -> bool {
        self.store.has_forgotten()
    }

    /// A model set that was written down.
    pub fn set_of(&self, id: &str) -> Arc<ModelSet> {
        self.store.disk.set_of(id).expect("it is on disk")
    }

    pub fn is_running(&self) -> bool {
        self.engine.is_some()
    }

    /// The engine stands still for so long; frames wait for it.
    pub fn stall(&mut self, span: Duration) {
        self.stalled_until = self.stalled_until.max(self.now + span);
    }

    pub fn notice(&mut self, notice: BusNotice) {
        self.deaf = match notice {
            BusNotice::BusOff | BusNotice::Down(_) => true,
            BusNotice::Up => false,
            _ => self.deaf,
        };
        self.step(self.now, Input::Bus(BUS, notice));
    }

    /// The store refuses all writes until a restart.
    pub fn fail_store(&mut self) {
        self.store.failed = true;
        self.step(self.now, Input::StoreFailed("the disk is full".to_owned()));
    }

    /// Gives a command; the reply may come later.
    pub fn command(&mut self, command: Command) -> RequestId {
        self.requests += 1;
        let request = RequestId(self.requests);
        self.step(self.now, Input::Command(request, command));
        request
    }

    /// Time passes up to `now`, and these frames come.
    pub fn advance(&mut self, now: Time, frames: &[TimedFrame]) {
        if now < self.stalled_until {
            self.now = now;
            if !self.deaf && self.engine.is_some() {
                self.waiting.extend_from_slice(frames);
            }
            return;
        }
        let waited = std::mem::take(&mut self.waiting);
        if !waited.is_empty() {
            self.step(now, Input::Resumed(now.since(waited[0].time)));
        }
        for batch in waited.chunks(BATCH_FRAMES) {
            self.step(now, Input::Frames(BUS, batch));
        }
        if let Some(newest) = frames.last().filter(|_| !self.deaf) {
            self.step(newest.time, Input::Frames(BUS, frames));
        }
        self.now = now;
        for (session, samples) in self.store.write(now) {
            self.step(now, Input::Durable { session, samples });
        }
        while let Some(place) = self.commits.iter().position(|(due, _)| due.is_none_or(|due| due <= now)) {
            let (due, ticket) = self.commits.remove(place);
            let result = due.map(|_| ()).ok_or_else(|| "the disk is full".to_owned());
            self.step(now, Input::Committed { ticket, result });
        }
        while let Some(place) = self.loads.iter().position(|(due, ..)| *due <= now) {
            let (_, ticket, session) = self.loads.remove(place);
            let result = self.store.disk.samples_of(session);
            self.step(now, Input::Loaded { ticket, result });
        }
        for (ticket, id) in std::mem::take(&mut self.set_loads) {
            let result = self.store.disk.set_of(&id);
            self.step(now, Input::SetLoaded { ticket, result });
        }
        while let Some(place) = self.fits.iter().position(|(due, _)| *due <= now) {
            let (_, job) = self.fits.remove(place);
            let outcome = job.run(id_of);
            self.step(now, Input::Fitted(outcome));
        }
        self.step(now, Input::Tick);
    }

    fn step(&mut self, time: Time, input: Input<'_>) {
        let Some(engine) = &mut self.engine else { return };
        let now = Now { time, wall_ns: EPOCH_NS + time.as_nanos() };
        engine.step(now, input, &mut self.out);
        for output in std::mem::take(&mut self.out) {
            self.collect(time, output);
        }
    }

    fn collect(&mut self, now: Time, output: Output) {
        match output {
            Output::Patch(patch, snapshot) => {
                self.newest[patch] = Arc::clone(&snapshot);
                self.published.push((patch, snapshot));
            }
            Output::Session(patch, view) => self.sessions[patch] = Some(view),
            Output::Catalogue(catalogue) => self.catalogue = catalogue,
            Output::Send(_, frame) => self.sent.push(frame),
            Output::Record(record) => {
                self.store.take(now + self.dice.span(0.002, 0.3), record);
            }
            Output::Commit { ticket, records } => {
                let due = now + self.dice.span(0.002, 0.3);
                let taken: Vec<Option<Time>> = records.into_iter().map(|record| self.store.take(due, record)).collect();
                self.commits.push((taken.into_iter().flatten().max(), ticket));
            }
            Output::Reply(request, reply) => self.replies.push((request, in_words(&reply))),
            Output::Fit(job) => self.fits.push((now + self.dice.span(0.05, 2.0), job)),
            Output::Load { ticket, session } => {
                let due = self.store.answers_at(now + self.dice.span(0.002, 0.1));
                self.loads.push((due, ticket, session));
            }
            Output::LoadSet { ticket, model_set } => self.set_loads.push((ticket, model_set)),
            Output::SessionGone(patch) => self.sessions[patch] = None,
            Output::Health(_) | Output::Gauge(..) => {}
        }
    }
}

fn in_words(reply: &Reply) -> String {
    match reply {
        Ok(Done::Tared(tare)) => format!("tared: {}", tare.reason),
        Ok(Done::BringUpStarted) => "bring-up started".to_owned(),
        Ok(Done::PushBegun) => "scans may be pushed".to_owned(),
        Ok(Done::Session(view)) => format!("session {} is {}", view.number, view.state.name()),
        Ok(Done::Activated { model_set, .. }) => format!("{model_set} is active"),
        Ok(Done::LoadRecorded(_)) => "load recorded".to_owned(),
        Ok(Done::Kept { model_set, .. }) => format!("{} kept", model_set.id),
        Ok(Done::Deleted) => "deleted".to_owned(),
        Err(rejection) => format!("refused: {rejection}"),
    }
}
