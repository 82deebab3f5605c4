//! What waits for the engine's task. Of the queues that have something any is the next one with the same chance, so that none
//! starves behind another that is always full.

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
