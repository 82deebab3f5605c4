//! What happened since the daemon's start: a ring in memory that the engine's task fills and the service reads.
//!
//! It is bounded, and what is older is gone. What has to survive a restart is in the store in other words: who asked for
//! what is in the audit log, sessions and model sets are there themselves.

use std::collections::VecDeque;

use taxel_engine::events::Event;

/// Events that are kept: at the one or two a second that a flickering contact can make at most, half an hour; of a quiet
/// installation months. One takes about 1 KiB.
const EVENTS_MAX: usize = 4096;

/// The newest events with their numbers, from 1.
#[derive(Debug, Default)]
pub(crate) struct EventLog(pub(crate) VecDeque<(u64, Event)>);

impl EventLog {
    /// Adds an event, and lets the oldest go if there are too many.
    pub(crate) fn push(&mut self, event: Event) {
        let number = self.newest() + 1;
        if self.0.len() >= EVENTS_MAX {
            self.0.pop_front();
        }
        self.0.push_back((number, event));
    }

    /// Number of the newest event; 0 before the first.
    pub(crate) fn newest(&self) -> u64 {
        self.0.back().map_or(0, |(number, _)| *number)
    }
}
