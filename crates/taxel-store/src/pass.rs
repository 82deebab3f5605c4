//! What a start has left unproven is proven while the daemon runs, in small steps of the store's thread when nothing else
//! waits for it.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rusqlite::Connection;

use crate::error::Quarantined;
use crate::identity::structure_findings;
use crate::session_samples::{prove_part, samples_of};
use crate::sets;

/// Pages of the file that are looked at between two looks whether work has come.
const PAGES_AT_ONCE: i32 = 16;

/// What is left to be proven.
#[derive(Debug, Default)]
pub(crate) struct Unproven {
    /// Model sets: row and id.
    sets: VecDeque<(u64, String)>,
    /// Sessions.
    sessions: VecDeque<u64>,
    /// The first sample of the first session that is left.
    from: u64,
    /// How the file's pages hang together.
    structure: bool,
}

/// What cannot be read any more.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Lost {
    /// A model set.
    ModelSet(String),
    /// The samples of a session.
    Samples(u64),
    /// Something of the file: the next start has to look at all of it.
    Structure,
}

/// What was found, and the words for it.
#[derive(Debug)]
pub(crate) struct Finding {
    pub(crate) lost: Lost,
    pub(crate) damage: Quarantined,
}

impl Finding {
    /// A model set is damaged.
    pub(crate) fn of_set(id: &str, reason: impl std::fmt::Display) -> Self {
        Self { lost: Lost::ModelSet(id.to_owned()), damage: Quarantined::new(format!("model set {id}"), reason) }
    }

    /// The samples of a session are damaged.
    pub(crate) fn of_samples(session: u64, reason: impl std::fmt::Display) -> Self {
        Self { lost: Lost::Samples(session), damage: Quarantined::new(samples_of(session), reason) }
    }

    /// The file is damaged.
    pub(crate) fn of_file(reason: impl std::fmt::Display) -> Self {
        Self { lost: Lost::Structure, damage: Quarantined::new("a part of the store", reason) }
    }
}

/// What a step came to.
#[derive(Debug)]
pub(crate) enum Step {
    /// All is well so far.
    Sound,
    /// Something is not.
    Found(Finding),
    /// Work came in between: the step is to be done again later.
    Disturbed,
}

impl Unproven {
    /// These model sets and sessions, and the file's structure.
    pub(crate) fn new(sets: impl Iterator<Item = (u64, String)>, sessions: Vec<u64>) -> Self {
        Self { sets: sets.collect(), sessions: sessions.into(), from: 0, structure: true }
    }

    /// Whether nothing is left.
    pub(crate) fn is_over(&self) -> bool {
        !self.structure // which comes last
    }

    /// Proves one model set, a part of a session's samples, or the structure. `row_of_set` gives the row that a model set has
    /// now: it may have been written again or deleted meanwhile. `disturbed` tells whether work has come.
    pub(crate) fn step(
        &mut self,
        connection: &mut Connection,
        row_of_set: impl Fn(&str) -> Option<u64>,
        disturbed: impl Fn() -> bool + Send + 'static,
    ) -> Step {
        if let Some((seq, id)) = self.sets.pop_front() {
            if row_of_set(&id) != Some(seq) {
                return Step::Sound;
            }
            return match sets::text(connection, seq) {
                Ok(None | Some(Ok(_))) => Step::Sound,
                Ok(Some(Err(reason))) => Step::Found(Finding::of_set(&id, reason)),
                Err(error) => Step::Found(Finding::of_file(format!("reading model set {id}: {error}"))),
            };
        }
        if let Some(&session) = self.sessions.front() {
            let part = prove_part(connection, session, self.from);
            self.from = *part.as_ref().unwrap_or(&None).as_ref().unwrap_or(&0);
            if self.from == 0 {
                self.sessions.pop_front();
            }
            return match part {
                Ok(_) => Step::Sound,
                Err(reason) => Step::Found(Finding::of_samples(session, reason)),
            };
        }
        self.step_structure(connection, disturbed)
    }

    fn step_structure(&mut self, connection: &mut Connection, disturbed: impl Fn() -> bool + Send + 'static) -> Step {
        let stopped = Arc::new(AtomicBool::new(false));
        let stop = Arc::clone(&stopped);
        let look = move || {
            let stops = disturbed();
            stop.fetch_or(stops, Ordering::Relaxed);
            stops
        };
        let found =
            connection.progress_handler(PAGES_AT_ONCE, Some(look)).and_then(|()| structure_findings(connection));
        let handed_back = connection.progress_handler(PAGES_AT_ONCE, None::<fn() -> bool>);
        if stopped.load(Ordering::Relaxed) {
            return Step::Disturbed;
        }
        self.structure = false;
        match (found, handed_back) {
            (Ok(None), Ok(())) => Step::Sound,
            (Ok(Some(findings)), _) => Step::Found(Finding::of_file(findings)),
            (Err(error), _) | (_, Err(error)) => Step::Found(Finding::of_file(error)),
        }
    }
}
