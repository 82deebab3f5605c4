//! What waits for the engine's task, and whose turn it is: every queue gives one item in turn, so that none starves
//! behind another that is always full.

use std::future::poll_fn;
use std::sync::Arc;
use std::task::{Context, Poll};

use taxel_engine::BusNotice;
use taxel_engine::calibration::{FitOutcome, NotLoaded, SessionSamples};
use taxel_engine::command::{Command, RequestId};
use taxel_engine::model_set::ModelSet;
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
    /// A fit.
    Fitted(FitOutcome),
    /// Something about what was given to the store.
    Store(StoreEvent),
    /// The samples of a session, by the ticket of the question, or why there are none.
    Loaded(u64, Result<SessionSamples, NotLoaded>),
    /// A model set, by the ticket of the question, or why there is none.
    SetLoaded(u64, Result<Arc<ModelSet>, NotLoaded>),
    /// The records of a commit, by its ticket, are on disk, or why not.
    Committed(u64, Result<(), String>),
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
        Box::new(move |event| line.tell(Done::Store(event)))
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
    /// Nothing but to look at the clock.
    Wake,
    /// End.
    Stop,
}

/// The queues in the order in which they have their turn.
#[derive(Clone, Copy)]
enum Turn {
    Batches,
    Pushed,
    Commands,
    Done,
}

impl Turn {
    const COUNT: usize = 4;

    const fn next(self) -> Self {
        match self {
            Self::Batches => Self::Pushed,
            Self::Pushed => Self::Commands,
            Self::Commands => Self::Done,
            Self::Done => Self::Batches,
        }
    }
}

/// Everything that waits for the engine's task. The other ends: the bus tasks, the service, and [`TellDone`].
pub struct Queues {
    batches: mpsc::Receiver<BusBatch>,
    /// Absent where no patch has its scans pushed.
    pushed: Option<mpsc::Receiver<Pushed>>,
    commands: mpsc::Receiver<Request>,
    done: mpsc::UnboundedReceiver<Done>,
    turn: Turn,
}

impl Queues {
    /// Frames first.
    pub fn new(
        batches: mpsc::Receiver<BusBatch>,
        commands: mpsc::Receiver<Request>,
        done: mpsc::UnboundedReceiver<Done>,
    ) -> Self {
        Self { batches, pushed: None, commands, done, turn: Turn::Batches }
    }

    /// The same with what is pushed.
    pub fn with_pushed(self, pushed: Option<mpsc::Receiver<Pushed>>) -> Self {
        Self { pushed, ..self }
    }

    /// The next item: of the queue whose turn it is, or of the next one that has any. So an item at the head of its
    /// queue waits for at most one of each other queue. A queue whose other end is gone counts as empty for ever.
    pub async fn next(&mut self) -> Action {
        poll_fn(|context| self.poll_next(context)).await
    }

    /// A batch or a scan that waits already.
    pub fn waiting_input(&mut self) -> Option<Action> {
        let batch = self.batches.try_recv().ok().map(Action::Batch);
        batch.or_else(|| self.pushed.as_mut()?.try_recv().ok().map(Action::Pushed))
    }

    fn poll_next(&mut self, context: &mut Context<'_>) -> Poll<Action> {
        for _ in 0..Turn::COUNT {
            let turn = self.turn;
            self.turn = turn.next();
            let item = match turn {
                Turn::Batches => self.batches.poll_recv(context).map(|item| item.map(Action::Batch)),
                Turn::Pushed => match &mut self.pushed {
                    Some(pushed) => pushed.poll_recv(context).map(|item| item.map(Action::Pushed)),
                    None => Poll::Pending,
                },
                Turn::Commands => self.commands.poll_recv(context).map(|item| item.map(Action::Command)),
                Turn::Done => self.done.poll_recv(context).map(|item| item.map(Action::Done)),
            };
            if let Poll::Ready(Some(action)) = item {
                return Poll::Ready(action);
            }
        }
        Poll::Pending
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_engine::command::Command;
    use tokio::sync::oneshot;

    #[tokio::test]
    async fn each_queue_has_its_turn_however_full_the_others_are() {
        let (to_batches, batches) = mpsc::channel(64);
        let (to_commands, commands) = mpsc::channel(64);
        let (tell, done) = TellDone::new();
        let mut queues = Queues::new(batches, commands, done);
        let mut seen = String::new();
        for _ in 0..12 {
            let _ = to_batches.try_send(BusBatch { bus: BusIndex(0), frames: Vec::new(), notices: Vec::new() });
            let (reply, _) = oneshot::channel();
            let _ = to_commands.try_send(Request {
                command: Command::BringUp { patch: String::new(), confirmed_by: None },
                reply,
                asked: None,
            });
            tell.tell(Done::Store(StoreEvent::Failed(String::new())));
            seen.push(match queues.next().await {
                Action::Batch(_) => 'b',
                Action::Command(_) => 'c',
                Action::Done(_) => 'd',
                Action::Pushed(_) | Action::Wake | Action::Stop => '?',
            });
        }
        assert_eq!(seen, "bcdbcdbcdbcd");
    }
}
