//! What waits for the recorder's thread: bounded by its weight, and never waited for.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// What a recorder is at.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Status {
    /// Why it does not record; `None` if it does.
    pub problem: Option<String>,
    /// The file that is written, or was last.
    pub file: String,
    /// Bytes of all recordings in the folder.
    pub bytes: u64,
    /// Frames and messages that are not in the recording.
    pub lost: u64,
}

/// A status that two threads share. Only its fields are read and written while it is locked.
#[derive(Debug, Default)]
pub(crate) struct Shared(Mutex<Status>);

impl Shared {
    pub(crate) fn get(&self) -> MutexGuard<'_, Status> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Bytes that may wait. A full bus of 9,009 frames/s makes about 0.9 MB/s here: the disk may be nine seconds behind.
pub(crate) const WAITING_BYTES_MAX: usize = 8 << 20;

/// What a thing in the queue weighs beside its content.
const ITEM_BYTES: usize = 128;

/// Makes the bytes of a message; called on the recorder's thread.
pub(crate) type Encode = Box<dyn FnOnce() -> Vec<u8> + Send>;

/// A message on its way to the file.
pub(crate) struct Item {
    pub(crate) topic: usize,
    pub(crate) log_ns: u64,
    pub(crate) encode: Encode,
    /// How many things it is, for the count of what is lost.
    pub(crate) things: u64,
    weight: usize,
}

/// Whether the recorder took something.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Given {
    /// It will be written, unless the disk fails.
    Taken,
    /// There was no room; it is counted as lost.
    Lost,
}

/// Where frames and samples to be recorded are given. Cheap to clone.
#[derive(Clone)]
pub struct Queue {
    sender: Sender<Item>,
    waiting: Arc<AtomicUsize>,
    status: Arc<Shared>,
}

impl Queue {
    pub(crate) fn new(status: Arc<Shared>) -> (Self, Waiting) {
        let (sender, items) = channel();
        let waiting = Arc::new(AtomicUsize::new(0));
        (Self { sender, waiting: Arc::clone(&waiting), status }, Waiting { items, waiting })
    }

    /// Gives a message of a topic, by its position, as bytes.
    pub fn give(&self, topic: usize, log_ns: u64, message: Vec<u8>) -> Given {
        let weight = message.len();
        self.give_later(topic, log_ns, (1, weight), move || message)
    }

    /// Gives a message that is made when it is written: of so many things, which take about so many bytes until then.
    pub fn give_later(
        &self,
        topic: usize,
        log_ns: u64,
        (things, bytes): (u64, usize),
        encode: impl FnOnce() -> Vec<u8> + Send + 'static,
    ) -> Given {
        let weight = bytes.saturating_add(ITEM_BYTES);
        let before = self.waiting.fetch_add(weight, Ordering::Relaxed);
        let item = Item { topic, log_ns, encode: Box::new(encode), things, weight };
        if before.saturating_add(weight) <= WAITING_BYTES_MAX && self.sender.send(item).is_ok() {
            return Given::Taken;
        }
        self.waiting.fetch_sub(weight, Ordering::Relaxed);
        self.status.get().lost += things;
        Given::Lost
    }
}

/// The recorder's end of the queue.
pub(crate) struct Waiting {
    items: Receiver<Item>,
    waiting: Arc<AtomicUsize>,
}

impl Waiting {
    /// The next item, if one comes in this time. `Err`: nobody is left who could give one.
    pub(crate) fn next(&self, within: Duration) -> Result<Option<Item>, ()> {
        match self.items.recv_timeout(within) {
            Ok(item) => {
                self.waiting.fetch_sub(item.weight, Ordering::Relaxed);
                Ok(Some(item))
            }
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(()),
        }
    }
}
