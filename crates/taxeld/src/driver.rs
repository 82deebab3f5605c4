//! The engine's one task: takes inputs from the buses, the service, the store and the fits, and does what the engine
//! asks for. Nobody else holds the engine.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use taxel_engine::calibration::{Direction, FitJob, FitOutcome, SessionState, SessionView};
use taxel_engine::command::{Rejection, Reply, RequestId};
use taxel_engine::plan::Plan;
use taxel_engine::record::Record;
use taxel_engine::{BusNotice, Engine, Input, Output, Restored};
use taxel_rpc::{Publisher, Request};
use taxel_skin::BusIndex;
use taxel_store::{Batch, Durability, OnDurable, QueueFull, Store, StoreError, StoreEvent, models_json};
use taxel_wire::{Frame, TimedFrame};
use tokio::sync::{mpsc, oneshot, watch};
use tokio_util::sync::CancellationToken;

use crate::clock::RunClock;

/// Staleness and bring-up are looked at this often.
const TICK: Duration = Duration::from_millis(10);

/// What the newest session is at.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(not(feature = "sim"), allow(dead_code))] // read by the simulator alone
pub struct Stage {
    /// Where it stands.
    pub state: SessionState,
    /// Which branch a ramp gathers.
    pub direction: Direction,
}

/// What a bus task hands over at a time.
pub struct BusBatch {
    /// Which bus.
    pub bus: BusIndex,
    /// Frames in the order of reception.
    pub frames: Vec<TimedFrame>,
    /// What else the bus has to say, before these frames.
    pub notices: Vec<BusNotice>,
}

/// What comes back from work that the driver gave away.
enum Internal {
    Fitted(FitOutcome),
    Store(StoreEvent),
    /// Records of a commit are on disk, or why not.
    Committed(u64, Result<(), String>),
}

/// Everything that the engine's task holds.
pub struct Driver {
    engine: Engine,
    clock: RunClock,
    publisher: Publisher,
    /// The state of each patch's session as it was last logged.
    logged: Vec<Option<(u64, SessionState)>>,
    store: Store,
    /// One queue of frames to send per bus; a full one loses the frame, which the bring-up's proof then shows.
    buses: Vec<mpsc::Sender<Frame>>,
    waiting: HashMap<RequestId, oneshot::Sender<Reply>>,
    requests: u64,
    internal: (mpsc::UnboundedSender<Internal>, mpsc::UnboundedReceiver<Internal>),
    out: Vec<Output>,
    /// What the newest session is at, for whoever plays the operator's hand.
    session_state: Option<watch::Sender<Option<Stage>>>,
}

/// Opens the store in such a way that its events reach the driver that is made with it.
pub struct StoreEvents(mpsc::UnboundedSender<Internal>, mpsc::UnboundedReceiver<Internal>);

impl StoreEvents {
    /// A new line from a store to a driver. Its length is bounded by the work under way: one event per commit, at
    /// most ten a second, and one per fit.
    pub fn new() -> Self {
        let (sender, receiver) = mpsc::unbounded_channel();
        Self(sender, receiver)
    }

    /// The store's end.
    pub fn notify(&self) -> taxel_store::Notify {
        let sender = self.0.clone();
        Box::new(move |event| {
            let _ = sender.send(Internal::Store(event)); // the driver has ended: nobody is left to tell
        })
    }
}

impl Driver {
    /// A driver that goes on from what the store found.
    pub fn new(
        plan: Arc<Plan>,
        restored: Restored,
        clock: RunClock,
        publisher: Publisher,
        store: (Store, StoreEvents),
        buses: Vec<mpsc::Sender<Frame>>,
    ) -> Self {
        let (store, StoreEvents(sender, receiver)) = store;
        Self {
            logged: vec![None; plan.patches.len()],
            engine: Engine::new(plan, restored),
            clock,
            publisher,
            store,
            buses,
            waiting: HashMap::new(),
            requests: 0,
            internal: (sender, receiver),
            out: Vec::new(),
            session_state: None,
        }
    }

    /// Also tells what the newest session is at.
    pub fn telling(mut self, session_state: watch::Sender<Option<Stage>>) -> Self {
        self.session_state = Some(session_state);
        self
    }

    /// Runs until cancelled; then the store is closed with everything that was recorded.
    pub async fn run(
        mut self,
        mut frames: mpsc::Receiver<BusBatch>,
        mut commands: mpsc::Receiver<Request>,
        cancel: CancellationToken,
    ) {
        let mut tick = tokio::time::interval(TICK);
        tick.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
        loop {
            tokio::select! {
                biased;
                () = cancel.cancelled() => break,
                Some(batch) = frames.recv() => self.take_batch(batch),
                Some(request) = commands.recv() => self.take_command(request),
                Some(done) = self.internal.1.recv() => self.take_internal(done),
                _ = tick.tick() => self.step(Input::Tick),
            }
        }
        // Closing commits what is queued, which can take a disk's time.
        let store = self.store;
        match tokio::task::spawn_blocking(move || store.close()).await {
            Ok(Ok(())) => {}
            Ok(Err(error)) => tracing::error!(%error, "the store could not be closed cleanly"),
            Err(error) => tracing::error!(%error, "the store's thread"),
        }
    }

    fn take_batch(&mut self, batch: BusBatch) {
        for notice in batch.notices {
            self.step(Input::Bus(batch.bus, notice));
        }
        if let Some(first) = batch.frames.first() {
            self.clock.start(first.time);
            self.step(Input::Frames(batch.bus, &batch.frames));
        }
    }

    fn take_command(&mut self, Request { command, reply }: Request) {
        self.requests += 1;
        let request = RequestId(self.requests);
        self.waiting.insert(request, reply);
        self.step(Input::Command(request, command));
    }

    fn take_internal(&mut self, done: Internal) {
        match done {
            Internal::Fitted(outcome) => self.step(Input::Fitted(outcome)),
            Internal::Committed(ticket, result) => self.step(Input::Committed { ticket, result }),
            Internal::Store(StoreEvent::Durable { session, samples }) => self.step(Input::Durable { session, samples }),
            Internal::Store(StoreEvent::Failed(why)) => {
                tracing::error!(%why, "the store failed");
                self.step(Input::StoreFailed(why));
            }
        }
    }

    fn step(&mut self, input: Input<'_>) {
        let mut out = std::mem::take(&mut self.out);
        self.engine.step(self.clock.now(), input, &mut out);
        let (mut records, mut replies) = (Vec::new(), Vec::new());
        for output in out.drain(..) {
            match output {
                Output::Patch(index, snapshot) => self.publisher.patch(index, snapshot),
                Output::Session(index, view) => self.show_session(index, view),
                Output::Health(health) => self.publisher.health(health),
                Output::Catalogue(catalogue) => self.publisher.catalogue(catalogue),
                Output::Send(bus, frame) => self.send(bus, frame),
                Output::Fit(job) => self.fit(job),
                Output::Record(record) => records.push(record),
                Output::Commit { ticket, records: intended } => {
                    // What came before goes first, so that the order on disk is that of what happened.
                    self.commit(std::mem::take(&mut records), Vec::new());
                    self.commit_intended(ticket, intended);
                }
                Output::Reply(request, reply) => replies.extend(self.waiting.remove(&request).map(|to| (to, reply))),
            }
        }
        self.out = out;
        self.commit(records, replies);
    }

    /// A reply goes out once everything recorded in the same step is on disk.
    fn commit(&mut self, records: Vec<Record>, replies: Vec<(oneshot::Sender<Reply>, Reply)>) {
        if records.is_empty() {
            for (to, reply) in replies {
                let _ = to.send(reply); // the client has gone
            }
            return;
        }
        let on_durable: Option<OnDurable> =
            if replies.is_empty() { None } else { Some(Box::new(move |outcome| answer(replies, outcome))) };
        if let Err(QueueFull(batch)) = self.store.submit(Batch { records, on_durable }) {
            let full = QueueFull(Batch::default()).to_string();
            if let Some(on_durable) = batch.on_durable {
                on_durable(Err(StoreError::Closed));
            }
            self.step(Input::StoreFailed(full));
        }
    }

    /// Writes down what the engine intends, and tells it how that went.
    fn commit_intended(&mut self, ticket: u64, records: Vec<Record>) {
        let done = self.internal.0.clone();
        let on_durable: OnDurable = Box::new(move |outcome: Result<Durability, StoreError>| {
            let result = outcome.map(|_| ()).map_err(|error| error.to_string());
            let _ = done.send(Internal::Committed(ticket, result)); // the driver has ended: nobody is left to tell
        });
        if let Err(QueueFull(batch)) = self.store.submit(Batch { records, on_durable: Some(on_durable) }) {
            let full = QueueFull(Batch::default()).to_string();
            if let Some(on_durable) = batch.on_durable {
                on_durable(Err(StoreError::Closed));
            }
            let _ = self.internal.0.send(Internal::Store(StoreEvent::Failed(full))); // this is its own receiver
        }
    }

    fn show_session(&mut self, index: usize, view: Arc<SessionView>) {
        let state = Some((view.number, view.state));
        if std::mem::replace(&mut self.logged[index], state) != state {
            let (session, state) = (view.number, view.state.name());
            tracing::info!(session, patch = %view.patch, state, reason = %view.reason, "calibration session");
        }
        if let Some(told) = &self.session_state {
            told.send_replace(Some(Stage { state: view.state, direction: view.direction }));
        }
        self.publisher.session(index, view);
    }

    fn send(&self, bus: BusIndex, frame: Frame) {
        let queue = self.buses.get(bus.0 as usize);
        if queue.is_none_or(|queue| queue.try_send(frame).is_err()) {
            tracing::warn!(bus = bus.0, id = %frame.id, "a command to a board was not sent: the send queue is full");
        }
    }

    fn fit(&self, job: FitJob) {
        let done = self.internal.0.clone();
        tokio::task::spawn_blocking(move || {
            let outcome = job.run(models_json::content_id);
            let _ = done.send(Internal::Fitted(outcome)); // the daemon is stopping: the samples are on disk
        });
    }
}

/// Tells everyone who waited for a commit how it went.
fn answer(replies: Vec<(oneshot::Sender<Reply>, Reply)>, outcome: Result<Durability, StoreError>) {
    for (to, reply) in replies {
        let reply = match &outcome {
            Ok(_) => reply,
            Err(error) => Err(Rejection::Unavailable(format!("it could not be written to disk: {error}"))),
        };
        let _ = to.send(reply); // the client has gone
    }
}
