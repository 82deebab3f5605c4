//! What reads from a store that somebody else owns and may close at any time. Cheap to clone; without a store any more the
//! answer is [`StoreError::Closed`]. No method waits.

use std::sync::Weak;

use crate::error::StoreError;
use crate::work::{OnAudit, OnModelSet, OnSamples, OnSize, Work, WorkQueue};

/// Reads samples of sessions.
#[derive(Clone, Debug)]
pub struct SamplesReader(pub(crate) Weak<WorkQueue>);

impl SamplesReader {
    /// As [`Store::read_samples`](crate::Store::read_samples).
    pub fn read(&self, session: u64, on_samples: OnSamples) {
        match self.0.upgrade() {
            Some(queue) => read_samples(&queue, session, on_samples),
            None => on_samples(Err(StoreError::Closed)),
        }
    }
}

pub(crate) fn read_samples(queue: &WorkQueue, session: u64, on_samples: OnSamples) {
    queue.ask(
        on_samples,
        |waiting| Work::Read { session, waiting },
        |work| match work {
            Work::Read { waiting, .. } => Some(waiting),
            _ => None,
        },
    );
}

/// Reads model sets.
#[derive(Clone, Debug)]
pub struct SetReader(pub(crate) Weak<WorkQueue>);

impl SetReader {
    /// As [`Store::read_model_set`](crate::Store::read_model_set).
    pub fn read(&self, model_set: String, on_model_set: OnModelSet) {
        match self.0.upgrade() {
            Some(queue) => read_set(&queue, model_set, on_model_set),
            None => on_model_set(Err(StoreError::Closed)),
        }
    }
}

pub(crate) fn read_set(queue: &WorkQueue, model_set: String, on_model_set: OnModelSet) {
    queue.ask(
        on_model_set,
        |waiting| Work::ReadSet { model_set, waiting },
        |work| match work {
            Work::ReadSet { waiting, .. } => Some(waiting),
            _ => None,
        },
    );
}

/// Reads the audit log.
#[derive(Clone, Debug)]
pub struct AuditReader(pub(crate) Weak<WorkQueue>);

impl AuditReader {
    /// Reads entries with numbers below `before`, at most so many, newest first, after all that was submitted before.
    pub fn read(&self, before: u64, most: u32, on_audit: OnAudit) {
        let Some(queue) = self.0.upgrade() else { return on_audit(Err(StoreError::Closed)) };
        queue.ask(
            on_audit,
            |waiting| Work::Audit { before, most, waiting },
            |work| match work {
                Work::Audit { waiting, .. } => Some(waiting),
                _ => None,
            },
        );
    }
}

/// Asks how much there is.
#[derive(Clone, Debug)]
pub struct SizeReader(pub(crate) Weak<WorkQueue>);

impl SizeReader {
    /// How much there is after all that was submitted before.
    pub fn read(&self, on_size: OnSize) {
        let Some(queue) = self.0.upgrade() else { return on_size(Err(StoreError::Closed)) };
        queue.ask(
            on_size,
            |waiting| Work::Size { waiting },
            |work| match work {
                Work::Size { waiting } => Some(waiting),
                _ => None,
            },
        );
    }
}
