//! What waits for the engine's task. Of the queues that have something any is the next one with the same chance, so that none
//! starves behind another that is always full.

use std::future::pending;

use taxel_engine::command::{Command, RequestId};
use taxel_engine::{BusNotice, Input};
use taxel_rpc::Request;
use taxel_rpc::push_line::Pushed;
use taxel_skin::BusIndex;
use taxel_store::StoreEvent;
use taxel_wire::TimedFrame;
use tokio::sync::mpsc;

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
pub enum Done {
    /// What the engine waits for: a fit, a commit, what was read, something about the store.
    Input(Input<'static>),
    /// That somebody asked for this is on disk, or why not: now it may be done.
    Asked(RequestId, Box<Command>, Result<(), String>),
}

/// Where work that the driver gave away tells that it is done.
#[derive(Clone)]
pub struct TellDone(mpsc::UnboundedSender<Done>);

impl TellDone {
    /// A new line to the driver. Its length is bounded by the work under way: one event per commit, at most ten a
    /// second, one per fit, one per session or model set that is taken up, and one per damaged
    /// row of the store.
    pub fn new() -> (Self, mpsc::UnboundedReceiver<Done>) {
        let (sender, receiver) = mpsc::unbounded_channel();
        (Self(sender), receiver)
    }

    /// This is done.
    pub fn tell(&self, done: Done) {
        let _ = self.0.send(done); // the driver has ended: nobody is left to tell
    }

    /// The store's end.
    pub fn of_store(&self) -> taxel_store::Notify {
        let line = self.clone();
        Box::new(move |event| {
            line.tell(Done::Input(match event {
                StoreEvent::Durable { session, samples } => Input::Durable { session, samples },
                StoreEvent::Failed(why) => Input::StoreFailed(why),
                StoreEvent::Damaged(damage) => Input::StoreDamaged(damage),
            }));
        })
    }
}

/// The next thing that the engine's task does.
pub enum Action {
    /// Take what a bus handed over.
    Batch(BusBatch),
    /// Take what a program has pushed.
    Pushed(Pushed),
    /// Take a command.
    Command(Request),
    /// Take what is done.
    Done(Done),
}

/// Everything that waits for the engine's task. The other ends: the bus tasks, the service, and [`TellDone`].
pub struct Queues {
    /// What buses hand over.
    pub batches: mpsc::Receiver<BusBatch>,
    /// What is pushed.
    pub pushed: mpsc::Receiver<Pushed>,
    /// What is asked.
    pub commands: mpsc::Receiver<Request>,
    /// What is done.
    pub done: mpsc::UnboundedReceiver<Done>,
}

impl Queues {
    /// The next item, of any queue that has one with the same chance. A queue whose other end is gone counts as empty for ever.
    pub async fn next(&mut self) -> Action {
        let Self { batches, pushed, commands, done } = self;
        tokio::select! {
            Some(batch) = batches.recv() => Action::Batch(batch),
            Some(pushed) = pushed.recv() => Action::Pushed(pushed),
            Some(command) = commands.recv() => Action::Command(command),
            Some(done) = done.recv() => Action::Done(done),
            else => pending().await,
        }
    }

    /// A batch or a scan that waits already.
    pub fn waiting_input(&mut self) -> Option<Action> {
        let batch = self.batches.try_recv().ok().map(Action::Batch);
        batch.or_else(|| self.pushed.try_recv().ok().map(Action::Pushed))
    }
}
