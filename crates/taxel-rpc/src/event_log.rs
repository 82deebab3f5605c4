//! What happened since the daemon's start: a ring in memory that the engine's task fills and the service reads.
//!
//! It is bounded, and what is older is gone. What has to survive a restart is in the store in other words: who asked for
//! what is in the audit log, sessions and model sets are there themselves.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use taxel_engine::events::Event;
use tokio::sync::watch;

/// Events that are kept: at the one or two a second that a flickering contact can make at most, half an hour; of a quiet
/// installation months. One takes about 1 KiB.
pub const EVENTS_MAX: usize = 4096;

/// An event with its number, from 1.
pub(crate) type Numbered = (u64, Arc<Event>);

/// The newest events.
#[derive(Debug)]
pub(crate) struct EventLog {
    kept: Mutex<VecDeque<Numbered>>,
    /// Number of the newest event; 0 before the first.
    newest: watch::Sender<u64>,
}

impl EventLog {
    pub(crate) fn new() -> Self {
        Self { kept: Mutex::default(), newest: watch::Sender::new(0) }
    }

    /// Adds an event, and lets the oldest go if there are too many. Never waits for a reader for longer than it takes to
    /// copy a page of pointers.
    pub(crate) fn push(&self, event: Event) {
        let number = *self.newest.borrow() + 1;
        let mut kept = self.kept();
        if kept.len() >= EVENTS_MAX {
            kept.pop_front();
        }
        kept.push_back((number, Arc::new(event)));
        drop(kept);
        self.newest.send_replace(number);
    }

    /// Tells when there are more.
    pub(crate) fn watch(&self) -> watch::Receiver<u64> {
        self.newest.subscribe()
    }

    /// The oldest event with a number above `after` that `wanted` takes.
    pub(crate) fn next(&self, after: u64, wanted: impl Fn(&Event) -> bool) -> Option<Numbered> {
        let kept = self.kept();
        let begin = kept.partition_point(|(number, _)| *number <= after);
        kept.range(begin..).find(|(_, event)| wanted(event)).cloned()
    }

    /// Number of the oldest event that is kept; 1 before the first.
    pub(crate) fn oldest(&self) -> u64 {
        self.kept().front().map_or(1, |(number, _)| *number)
    }

    fn kept(&self) -> MutexGuard<'_, VecDeque<Numbered>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
