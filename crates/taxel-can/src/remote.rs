//! A source that is no interface of this machine: a gauge's line, a port. It is listened to, opened again when it ends, and
//! nothing can be sent to it.

use std::time::Duration;

use taxel_wire::Frame;
use tokio::time::sleep;

use crate::source::{Batch, BusEvent, FrameSource, NotSent, SendError, SourceError};

/// Pauses between attempts grow from the first to the second: what starts is found soon, and what is gone costs nothing.
const PAUSES: [Duration; 2] = [Duration::from_millis(250), Duration::from_secs(5)];

/// The pause before the next attempt to open a source.
#[derive(Debug, Default)]
pub struct Pause(Duration);

impl Pause {
    /// Waits. The next pause is longer, unless something has come by then.
    pub async fn wait(&mut self) {
        sleep(self.0).await;
        self.0 = (2 * self.0).clamp(PAUSES[0], PAUSES[1]);
    }

    /// Something has come: the next attempt is made at once.
    pub fn end(&mut self) {
        self.0 = Duration::ZERO;
    }
}

/// What is listened to.
pub trait Remote: Send {
    /// Waits until something comes and appends it. May be cancelled at any time, and opens what is not open after a pause.
    ///
    /// # Errors
    /// Why nothing comes, for people; the next call tries again.
    fn more(&mut self, pause: &mut Pause, batch: &mut Batch) -> impl Future<Output = Result<(), String>> + Send;
}

/// It as a bus. That something comes, or why not, is told once for each change.
#[derive(Debug)]
pub struct RemoteBus<R> {
    /// What is listened to.
    pub remote: R,
    pause: Pause,
    told: Option<Result<(), String>>,
}

impl<R: Remote> RemoteBus<R> {
    /// Listens to this.
    pub fn new(remote: R) -> Self {
        Self { remote, pause: Pause::default(), told: None }
    }
}

impl<R: Remote> FrameSource for RemoteBus<R> {
    async fn next(&mut self, batch: &mut Batch) -> Result<(), SourceError> {
        batch.clear();
        while batch.is_empty() {
            let came = self.remote.more(&mut self.pause, batch).await;
            if self.told.as_ref() != Some(&came) {
                let why = came.clone().err();
                batch.events.push(why.map_or(BusEvent::Up, |why| BusEvent::SourceDown { why }));
                self.told = Some(came);
            }
        }
        Ok(())
    }

    async fn send(&mut self, frame: &Frame) -> Result<(), SendError> {
        Err(SendError { id: frame.id, why: NotSent::ListenOnly })
    }
}
