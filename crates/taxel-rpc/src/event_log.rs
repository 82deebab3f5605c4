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

    /// Events with numbers below `before` that `wanted` takes, at most so many, newest first.
    pub(crate) fn page(&self, before: u64, most: usize, wanted: impl Fn(&Event) -> bool) -> Vec<Numbered> {
        let kept = self.kept();
        let older = kept.iter().rev().filter(|(number, event)| *number < before && wanted(event));
        older.take(most).cloned().collect()
    }

    fn kept(&self) -> MutexGuard<'_, VecDeque<Numbered>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_engine::events::EventKind;

    fn event(wall_ns: i64) -> Event {
        Event {
            wall_ns,
            kind: EventKind::Tared,
            patch: "palm".to_owned(),
            text: String::new(),
            taxels: Vec::new(),
            session: None,
            model_set: None,
            bus: None,
        }
    }

    #[test]
    fn the_oldest_go_and_numbers_go_on() {
        let log = EventLog::new();
        assert_eq!((log.oldest(), log.page(u64::MAX, 10, |_| true).len()), (1, 0));
        (0..EVENTS_MAX as i64 + 3).for_each(|k| log.push(event(k)));
        let newest = EVENTS_MAX as u64 + 3;
        assert_eq!((log.oldest(), *log.watch().borrow()), (4, newest));
        let numbers = |page: Vec<Numbered>| page.into_iter().map(|(number, _)| number).collect::<Vec<_>>();
        assert_eq!(numbers(log.page(u64::MAX, 2, |_| true)), [newest, newest - 1]);
        assert_eq!(numbers(log.page(6, 9, |_| true)), [5, 4]);
        assert_eq!(numbers(log.page(u64::MAX, 9, |event| event.wall_ns < 5)), [5, 4]);
        assert_eq!(log.next(0, |_| true).map(|(number, event)| (number, event.wall_ns)), Some((4, 3)));
        assert_eq!(log.next(newest, |_| true), None);
    }
}
