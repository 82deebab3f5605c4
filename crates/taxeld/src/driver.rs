//! The engine's one task: takes inputs from the buses, the service, the store and the fits, and does what the engine
//! asks for. Nobody else holds the engine.
//!
//! Each turn is the same: note that the engine runs, tick if that is due, wait for the next item of a queue, take it. So no
//! queue, however full, puts a tick off for longer than one item.

mod outputs;

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use taxel_can::ClockReading;
use taxel_engine::audit::Asked;
use taxel_engine::calibration::SessionView;
use taxel_engine::command::{Command, ErrorReason, Rejection, Reply, RequestId};
use taxel_engine::events::EventWatch;
use taxel_engine::plan::Plan;
use taxel_engine::{BusNotice, Engine, Input, Now, Output, Restored};
use taxel_rpc::push_line::{PushEvent, Pushed};
use taxel_rpc::{BEAT_EVERY, Publisher, Request};
use taxel_skin::Time;
use taxel_store::{Batch, OnDurable, Store};
use taxel_wire::Frame;
use tokio::sync::{mpsc, oneshot};
use tokio_util::sync::CancellationToken;

use crate::audit::Auditor;
use crate::bus::BATCHES_WAITING_MAX;
use crate::queues::{BusBatch, Done, Queues, TellDone};
use crate::shared_memory::Pages;

/// Batches taken at once after a stall, so that not even a bus that never pauses puts the next tick off for ever. The
/// kernel keeps half a second of a full bus, 4,505 frames in 71 reads; beside what waited here that is four buses.
const CATCH_UP_BATCHES_MAX: usize = BATCHES_WAITING_MAX + 4 * 71;

/// So many looks in a row must find nothing new before the queues count as empty: one lets the bus tasks see that the
/// kernel has something, one lets them hand it over.
const QUIET_LOOKS: usize = 2;

/// Where "now" comes from. Clones tell the same time.
pub type RunClock = Arc<dyn Fn() -> Now + Send + Sync>;

/// `CLOCK_BOOTTIME`, on which frames are stamped.
pub fn boottime() -> RunClock {
    Arc::new(|| {
        let ClockReading { time, wall_ns } = ClockReading::now();
        Now { time, wall_ns }
    })
}

/// Somebody who waits for the answer to a command.
struct Waiting {
    reply: oneshot::Sender<Reply>,
    /// The patch that it is about, if the audit log has it.
    patch: Option<String>,
}

/// Nothing is done that nobody could find out about later.
fn unwritten(why: &str) -> Rejection {
    Rejection::Unavailable(ErrorReason::StoreUnavailable, format!("the audit log cannot be written: {why}"))
}

/// Everything that the engine's task holds.
pub struct Driver {
    engine: Engine,
    clock: RunClock,
    publisher: Publisher,
    /// Written as well.
    pub pages: Pages,
    /// Each patch's session.
    sessions: Vec<Option<Arc<SessionView>>>,
    store: Store,
    /// One queue of frames to send per bus; a full one loses the frame, which the bring-up's proof then shows.
    buses: Vec<mpsc::Sender<Frame>>,
    waiting: HashMap<RequestId, Waiting>,
    audit: Auditor,
    requests: u64,
    tell_done: TellDone,
    /// On the run's clock.
    last_tick: Option<Time>,
    events: EventWatch,
    out: Vec<Output>,
}

impl Driver {
    /// A driver that goes on from what the store found.
    pub fn new(
        plan: Arc<Plan>,
        restored: Restored,
        clock: RunClock,
        publisher: Publisher,
        store: (Store, TellDone),
        buses: Vec<mpsc::Sender<Frame>>,
    ) -> Self {
        let (store, tell_done) = store;
        let active = restored.active.clone();
        let patches = plan.patches.iter().map(|plan| plan.patch.name());
        Self {
            events: EventWatch::new(patches, &active),
            sessions: vec![None; plan.patches.len()],
            engine: Engine::new(plan, restored),
            clock,
            publisher,
            pages: Pages::default(),
            store,
            buses,
            waiting: HashMap::new(),
            audit: Auditor::new(active),
            requests: 0,
            tell_done,
            last_tick: None,
            out: Vec::new(),
        }
    }

    /// Takes the engine's first step now, so that a client that asks before its task has a turn hears what the store has.
    pub fn begun(mut self) -> Self {
        self.tick_if_due();
        self
    }

    /// Runs until cancelled; then the store is closed with everything that was recorded.
    pub async fn run(mut self, mut queues: Queues, cancel: CancellationToken) -> anyhow::Result<()> {
        while self.turn(&mut queues, &cancel).await {}
        drop(self.pages); // from here on nobody judges what they say
        // Closing commits what is queued, which can take a disk's time.
        let store = self.store;
        match tokio::task::spawn_blocking(move || store.close()).await {
            Ok(Ok(())) => {}
            Ok(Err(error)) => tracing::error!(%error, "the store could not be closed cleanly"),
            Err(error) => tracing::error!(%error, "the store's thread"),
        }
        Ok(())
    }

    /// One turn; `false` after the last.
    async fn turn(&mut self, queues: &mut Queues, cancel: &CancellationToken) -> bool {
        self.pages.beat();
        if let Some(gap) = self.publisher.beat() {
            // For so long nobody took frames: what the engine did not hear then is no silence of a board. It is told so before any
            // frame of that time and before any tick.
            tracing::debug!(gap_s = gap.as_secs_f64(), "what came meanwhile is taken before the next tick");
            self.step(Input::Resumed(gap));
            self.catch_up(queues).await;
        }
        self.tick_if_due();
        // Looked at from any of them on, by chance, so that none is passed over; one whose other end is gone counts as empty.
        tokio::select! {
            () = cancel.cancelled() => return false,
            Some(batch) = queues.batches.recv() => self.take_batch(batch),
            Some(pushed) = queues.pushed.recv() => self.take_pushed(pushed),
            Some(request) = queues.commands.recv() => self.take_command(request),
            Some(done) = queues.done.recv() => self.take_done(done),
            () = tokio::time::sleep(self.time_to_sleep()) => {} // a tick is due, or a sign of life
        }
        true
    }

    /// Takes what came while this task had no turn: what waits in the queue and what the kernel kept. A tick before that
    /// would find every board silent.
    async fn catch_up(&mut self, queues: &mut Queues) {
        let (mut left, mut quiet) = (CATCH_UP_BATCHES_MAX, 0);
        while quiet < QUIET_LOOKS {
            tokio::task::yield_now().await;
            quiet += 1;
            loop {
                if let Ok(batch) = queues.batches.try_recv() {
                    self.take_batch(batch);
                } else if let Ok(pushed) = queues.pushed.try_recv() {
                    self.take_pushed(pushed);
                } else {
                    break;
                }
                quiet = 0;
                left -= 1;
                if left == 0 {
                    return;
                }
            }
        }
    }

    /// When the engine wants its next tick at the latest, on the run's clock; `None` if it needs none.
    fn next_tick(&self) -> Option<Time> {
        if self.last_tick.is_none() { Some(Time::default()) } else { self.engine.next_deadline() }
    }

    fn tick_if_due(&mut self) {
        let now = (self.clock)().time;
        if self.next_tick().is_some_and(|due| due <= now) {
            self.last_tick = Some(now);
            self.step(Input::Tick);
        }
    }

    fn time_to_sleep(&self) -> Duration {
        let until_tick = self.next_tick().map(|due| due.since((self.clock)().time));
        until_tick.unwrap_or(BEAT_EVERY).min(BEAT_EVERY)
    }

    fn take_batch(&mut self, batch: BusBatch) {
        for notice in batch.notices {
            self.step(Input::Bus(batch.bus, notice));
        }
        if !batch.frames.is_empty() {
            self.step(Input::Frames(batch.bus, &batch.frames));
        }
    }

    fn take_pushed(&mut self, pushed: Pushed) {
        if pushed.refused > 0 {
            self.step(Input::Bus(pushed.bus, BusNotice::Dropped(pushed.refused)));
        }
        match pushed.event {
            PushEvent::Scan(scan) => self.step(Input::Pushed(&scan)),
            PushEvent::Reading(frame) => self.step(Input::Frames(pushed.bus, &[frame])),
            PushEvent::Ended(why) => self.step(Input::Bus(pushed.bus, BusNotice::Down(why))),
        }
    }

    fn take_command(&mut self, Request { command, reply, asked }: Request) {
        self.requests += 1;
        let request = RequestId(self.requests);
        let Some(asked) = asked else {
            self.waiting.insert(request, Waiting { reply, patch: None });
            return self.step(Input::Command(request, command));
        };
        // What takes effect at once waits until it is on disk that somebody asked for it. All else waits for the disk itself
        // before it takes effect, and its rows come in order.
        let at_once = matches!(command, Command::BringUp { .. } | Command::BeginPush { .. });
        let after = at_once.then(|| (request, Box::new(command.clone())));
        match self.note(request, *asked, after) {
            Ok(patch) => {
                self.waiting.insert(request, Waiting { reply, patch: Some(patch) });
                if !at_once {
                    self.step(Input::Command(request, command));
                }
            }
            Err(why) => {
                let _ = reply.send(Err(unwritten(&why))); // the client may have gone
            }
        }
    }

    /// Writes down who asks for what, before the engine hears of it: what the engine writes because of it comes after.
    /// Gives the patch that it is about. The command in `after` comes back as [`Done::Asked`].
    fn note(
        &self,
        request: RequestId,
        asked: Asked,
        after: Option<(RequestId, Box<Command>)>,
    ) -> Result<String, String> {
        let (patch, row) = self.audit.asked(request, (self.clock)().wall_ns, asked)?;
        let on_durable = after.map(|(request, command)| -> OnDurable {
            let done = self.tell_done.clone();
            Box::new(move |outcome| {
                let result = outcome.map(|_| ()).map_err(|error| error.to_string());
                done.tell(Done::Asked(request, command, result));
            })
        });
        self.store.submit_asked(Batch { records: vec![row], on_durable }).map_err(|full| full.to_string())?;
        Ok(patch)
    }

    /// That somebody asked for this is on disk, or cannot be. Who does not wait any more is not obeyed: what was true then ("nothing
    /// touches the skin") may not be any more.
    fn take_asked(&mut self, request: RequestId, command: Command, written: Result<(), String>) {
        let Some(waiting) = self.waiting.remove(&request) else { return };
        match written {
            Err(why) => drop(waiting.reply.send(Err(unwritten(&why)))), // the client may have gone
            Ok(()) if !waiting.reply.is_closed() => {
                self.waiting.insert(request, waiting);
                self.step(Input::Command(request, command));
            }
            Ok(()) => {
                let why = "the client did not wait until it was written down who asked: nothing is done";
                tracing::warn!(%why, "a command was not done");
                let refused = Err(Rejection::Unavailable(ErrorReason::StoreUnavailable, why.to_owned()));
                let row =
                    self.audit.answered(request, (self.clock)().wall_ns, &waiting.patch.unwrap_or_default(), &refused);
                self.note_refusals(vec![row], Vec::new());
            }
        }
    }

    fn take_done(&mut self, done: Done) {
        match done {
            Done::Asked(request, command, written) => self.take_asked(request, *command, written),
            Done::Input(input) => {
                if let Input::StoreFailed(why) = &input {
                    tracing::error!(%why, "the store failed");
                    self.audit.store_failed(why);
                }
                self.step(input);
            }
        }
    }
}

#[cfg(all(test, feature = "sim"))]
pub(crate) mod tests;
