//! What the services share: looking things up, sending commands, counting streams.

use std::sync::Arc;
use taxel_engine::calibration::SessionView;
use taxel_engine::command::{Command, Done};
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::PatchPlan;
use taxel_engine::snapshot::PatchSnapshot;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc, oneshot};
use tonic::Status;

use crate::convert::Sending;
use crate::handle::{Handle, Request};
use crate::limits::Limits;
use crate::status::{engine_stopped, invalid, of_rejection, shutting_down};

/// Longest text that a client may have written down, in bytes.
const NAME_BYTES_MAX: usize = 256;

/// The implementation behind all services. Cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Service {
    pub(crate) handle: Handle,
    pub(crate) limits: Arc<Limits>,
    streams: Arc<Semaphore>,
}

impl Service {
    pub(crate) fn new(handle: Handle, limits: Limits) -> Self {
        let streams = Arc::new(Semaphore::new(limits.streams));
        Self { handle, limits: Arc::new(limits), streams }
    }

    /// Position of the patch of this name; an empty name stands for the only one.
    pub(crate) fn patch(&self, name: &str) -> Result<usize, Status> {
        let patches = &self.handle.plan.patches;
        if name.is_empty() && patches.len() == 1 {
            return Ok(0);
        }
        let names = || patches.iter().map(|p| p.patch.name()).collect::<Vec<_>>().join(", ");
        if name.is_empty() {
            return Err(invalid("patch", format_args!("must name one of the patches: {}", names())));
        }
        let found = patches.iter().position(|p| p.patch.name() == name);
        let short = || name.chars().take(NAME_BYTES_MAX).collect::<String>();
        found.ok_or_else(|| Status::not_found(format!("there is no patch `{}`; there are: {}", short(), names())))
    }

    pub(crate) fn plan(&self, patch: usize) -> &PatchPlan {
        &self.handle.plan.patches[patch]
    }

    pub(crate) fn snapshot(&self, patch: usize) -> Arc<PatchSnapshot> {
        Arc::clone(&self.handle.patches[patch].snapshot.borrow())
    }

    /// What sending this snapshot now comes to, for a reader that did not get `skipped` values before it.
    pub(crate) fn sending(&self, patch: usize, snapshot: &PatchSnapshot, skipped: u64) -> Sending {
        let now = (self.handle.clock)();
        Sending { now, freshness: self.handle.freshness_at(now, patch, snapshot), skipped }
    }

    /// Id of the active model set of a patch.
    pub(crate) fn active(&self, patch: &str) -> Option<String> {
        let catalogue = self.handle.catalogue.borrow();
        catalogue.active.iter().find(|(name, _)| name == patch).and_then(|(_, id)| id.clone())
    }

    /// The model set of this id; an empty id stands for the active one of `patch`.
    pub(crate) fn model_set(&self, id: &str, patch: &str) -> Result<Arc<ModelSet>, Status> {
        let id = if id.is_empty() {
            let name = self.plan(self.patch(patch)?).patch.name();
            let active = self.active(name);
            active.ok_or_else(|| Status::not_found(format!("there is no active model set of patch `{name}`")))?
        } else {
            id.to_owned()
        };
        let catalogue = self.handle.catalogue.borrow();
        let set = catalogue.model_sets.iter().find(|set| set.id == id).cloned();
        let short = || id.chars().take(NAME_BYTES_MAX).collect::<String>();
        set.ok_or_else(|| Status::not_found(format!("there is no model set `{}`", short())))
    }

    /// Every session, oldest first. What a patch is at is newer than what the catalogue has.
    pub(crate) fn sessions(&self) -> Vec<Arc<SessionView>> {
        let mut sessions = self.handle.catalogue.borrow().sessions.clone();
        for feed in self.handle.patches.iter() {
            let Some(live) = feed.session.borrow().clone() else { continue };
            match sessions.iter_mut().find(|known| known.number == live.number) {
                Some(known) => *known = live,
                None => sessions.push(live),
            }
        }
        sessions.sort_by_key(|session| session.number);
        sessions
    }

    pub(crate) fn session(&self, number: u64) -> Result<Arc<SessionView>, Status> {
        check_session(number)?;
        let live = self.handle.patches.iter().filter_map(|feed| feed.session.borrow().clone());
        let found = live.into_iter().find(|session| session.number == number);
        let stored = || self.handle.catalogue.borrow().sessions.iter().find(|s| s.number == number).cloned();
        found.or_else(stored).ok_or_else(|| Status::not_found(format!("there is no session {number}")))
    }

    /// A place for one more stream. The place moves into the stream and is free again when that is dropped.
    pub(crate) fn stream_place(&self) -> Result<OwnedSemaphorePermit, Status> {
        Arc::clone(&self.streams).try_acquire_owned().map_err(|_| {
            let limit = self.limits.streams;
            Status::resource_exhausted(format!(
                "{limit} streams are being served, which is the limit: end another first"
            ))
        })
    }

    /// Streams that are being served now.
    pub(crate) fn streams_open(&self) -> usize {
        self.limits.streams.saturating_sub(self.streams.available_permits())
    }

    /// Hands a command to the engine and waits for its answer, which comes once everything before it is on disk.
    pub(crate) async fn command(&self, name: &'static str, command: Command) -> Result<Done, Status> {
        let (reply, answer) = oneshot::channel();
        self.handle.commands.try_send(Request { command, reply }).map_err(|refused| match refused {
            mpsc::error::TrySendError::Full(_) => {
                let waiting = self.handle.commands.max_capacity();
                Status::resource_exhausted(format!("{waiting} commands wait for the engine already: try again later"))
            }
            mpsc::error::TrySendError::Closed(_) => engine_stopped(),
        })?;
        let limit = self.limits.command;
        let outcome = tokio::select! {
            answer = tokio::time::timeout(limit, answer) => match answer {
                Ok(Ok(Ok(done))) => Ok(done),
                Ok(Ok(Err(rejection))) => Err(of_rejection(&rejection)),
                Ok(Err(_)) => Err(engine_stopped()),
                Err(_) => Err(Status::deadline_exceeded(format!(
                    "the engine has not answered within {} s; what was asked for may still come to pass",
                    limit.as_secs_f64()
                ))),
            },
            () = self.handle.shutdown.cancelled() => Err(shutting_down()),
        };
        match &outcome {
            Ok(_) => tracing::info!(command = name, "done"),
            Err(status) => tracing::info!(command = name, code = ?status.code(), why = status.message(), "refused"),
        }
        outcome
    }
}

/// Session numbers begin at 1, so that a field that was left out is not taken for a session.
pub(crate) fn check_session(number: u64) -> Result<(), Status> {
    if number == 0 { Err(invalid("session", "0 is not a session; they are numbered from 1")) } else { Ok(()) }
}

/// The operator who vouches for something, if one does.
pub(crate) fn confirmed_by(text: String) -> Result<Option<String>, Status> {
    if text.len() > NAME_BYTES_MAX {
        let length = text.len();
        return Err(invalid("confirmed_by", format_args!("{length} bytes, at most {NAME_BYTES_MAX} are kept")));
    }
    let name = text.trim();
    Ok((!name.is_empty()).then(|| name.to_owned()))
}

/// The engine answered a command with something else than that command's result.
pub(crate) fn strange_answer(done: &Done) -> Status {
    tracing::error!(?done, "the engine's answer does not fit the command");
    Status::internal("the engine's answer does not fit the command")
}
