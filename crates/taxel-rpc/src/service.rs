//! What the services share: looking things up, sending commands, counting streams.

use std::fmt;
use std::sync::Arc;
use taxel_engine::audit::Asked;
use taxel_engine::calibration::SessionView;
use taxel_engine::command::{self, Command, Done};
use taxel_engine::known_set::{KnownSet, SetSummary};
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::PatchPlan;
use taxel_engine::snapshot::PatchSnapshot;
use taxel_proto::refusal::Refusal;
use taxel_proto::v1::{self, ErrorReason};
use tokio::sync::{mpsc, oneshot};
use tonic::{Code, Response, Status};

use crate::access::rules::{Access, Caller, said};
use crate::backend::{Backend, ask};
use crate::handle::{Handle, Request};
use crate::limits::{Limits, Shares};
use crate::status::{SHUTTING_DOWN, STOPPED, invalid, left_open, of_rejection, unavailable};

/// Longest text that a client may have written down, in bytes.
const NAME_BYTES_MAX: usize = 256;

/// Most items in one answer with a list.
const ITEMS_MAX: u32 = 1_000;

/// What a call is answered with.
pub(crate) type Reply<T> = Result<Response<T>, Status>;

/// The implementation behind all services. Cheap to clone.
#[derive(Clone)]
pub(crate) struct Service {
    pub(crate) handle: Handle,
    pub(crate) backend: Arc<dyn Backend>,
    pub(crate) limits: Arc<Limits>,
    pub(crate) shares: Arc<Shares>,
    pub(crate) access: Access,
}

impl Service {
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
        Ok(self.handle.position(name).ok_or_else(|| {
            let why = format!("there is no patch `{name}`; there are: {}", names());
            Refusal::not_found(ErrorReason::PatchUnknown, why).about("patch", name)
        })?)
    }

    /// Whether an answer of several patches is about this one: an empty name wants all.
    pub(crate) fn check_wanted(&self, patch: &str) -> Result<(), Status> {
        if patch.is_empty() { Ok(()) } else { self.patch(patch).map(drop) }
    }

    pub(crate) fn plan(&self, patch: usize) -> &PatchPlan {
        &self.handle.plan.patches[patch]
    }

    pub(crate) fn snapshot(&self, patch: usize) -> Arc<PatchSnapshot> {
        Arc::clone(&self.handle.patches[patch].snapshot.borrow())
    }

    /// Id of the active model set of a patch.
    pub(crate) fn active(&self, patch: &str) -> Option<String> {
        let catalogue = self.handle.catalogue.borrow();
        catalogue.active.iter().find(|(name, _)| name == patch).and_then(|(_, id)| id.clone())
    }

    /// The model set of this id; an empty id stands for the active one of `patch`. One that is not in memory is read.
    pub(crate) async fn model_set(&self, id: &str, patch: &str) -> Result<Arc<ModelSet>, Status> {
        let id = if id.is_empty() {
            let name = self.plan(self.patch(patch)?).patch.name();
            let active = self.active(name);
            active.ok_or_else(|| {
                let why = format!("there is no active model set of patch `{name}`");
                Refusal::not_found(ErrorReason::NoModelSet, why).about("patch", name)
            })?
        } else {
            id.to_owned()
        };
        let known = self.known_set(&id).ok_or_else(|| {
            let why = format!("there is no model set `{id}`");
            Refusal::not_found(ErrorReason::ModelSetUnknown, why).about("model_set", &id)
        })?;
        if let Some(set) = known.at_hand {
            return Ok(set);
        }
        self.stored_set(&known).await
    }

    /// A model set that is not in memory, with this summary.
    async fn stored_set(&self, summary: &SetSummary) -> Result<Arc<ModelSet>, Status> {
        let named = |refusal: Refusal| refusal.about("model_set", &summary.id);
        let text = ask(|told| self.backend.model_set(summary.id.clone(), told)).await.map_err(named)?;
        let backend = Arc::clone(&self.backend);
        let damaged = |why| Refusal::failed_precondition(ErrorReason::DataDamaged, format!("{}: {why}", summary.id));
        let set = aside(move || backend.read_json(&text)).await?.map_err(|why| named(damaged(why)))?;
        if SetSummary::of(&set) != *summary {
            return Err(Refusal::fault(format!("the store gave another model set than {}", summary.id)).into());
        }
        Ok(Arc::new(set))
    }

    /// What lists show of the model set of this id.
    pub(crate) fn known_set(&self, id: &str) -> Option<KnownSet> {
        self.handle.catalogue.borrow().model_sets.iter().find(|set| set.id == id).cloned()
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
        let found = self.sessions().into_iter().find(|session| session.number == number);
        Ok(found.ok_or_else(|| {
            let why = format!("there is no session {number}");
            Refusal::not_found(ErrorReason::SessionUnknown, why).about("session", number)
        })?)
    }

    /// Hands a command to the engine and waits for its answer, which comes once everything before it is on disk.
    pub(crate) async fn command(&self, caller: &Caller, name: &'static str, command: Command) -> Result<Done, Status> {
        let keeps = matches!(
            command,
            Command::StartSession { .. }
                | Command::Import { .. }
                | Command::KeepRefit { .. }
                | Command::KeepRecalibration { .. }
        );
        if keeps {
            self.backend.room().map_err(|why| Refusal::exhausted(ErrorReason::LimitReached, why))?;
        }
        let (reply, answer) = oneshot::channel();
        let about = self.about(&command);
        let told = about.asked(caller, name);
        let answer = self.answer(Request { command, reply, asked: Some(Box::new(told.clone())) }, answer).await;
        let answer = answer.map_err(|refusal| Status::from(about.of(refusal)));
        // Of a caller that goes away before the answer the audit log tells what came of it.
        let Asked { who, role, place: from, what: request, claimed, .. } = &told;
        let why = answer.as_ref().err().map(Status::message);
        let end = if why.is_some() { "refused" } else { "done" };
        tracing::info!(command = name, request, who, role, from, claimed, why, "{end}");
        answer
    }

    /// Hands a command over and waits for its answer.
    async fn answer(&self, request: Request, answer: oneshot::Receiver<command::Reply>) -> Result<Done, Refusal> {
        self.handle.commands.try_send(request).map_err(|refused| match refused {
            mpsc::error::TrySendError::Full(_) => {
                let waiting = self.handle.commands.max_capacity();
                let why = format!("{waiting} commands wait for the engine already: try again later");
                Refusal::exhausted(ErrorReason::DaemonBusy, why)
            }
            mpsc::error::TrySendError::Closed(_) => unavailable(STOPPED),
        })?;
        let limit = self.limits.command;
        let answer = tokio::select! {
            answer = tokio::time::timeout(limit, answer) => answer.map_err(|_| {
                let why = format!("the engine has not answered within {} s", limit.as_secs_f64());
                left_open(Code::DeadlineExceeded, why)
            })?,
            () = self.handle.shutdown.cancelled() => return Err(left_open(Code::Unavailable, SHUTTING_DOWN)),
        };
        answer.map_err(|_| left_open(Code::Unavailable, STOPPED))?.map_err(|rejection| of_rejection(&rejection))
    }
}

/// A list that `make` makes, beside the thread on which all streams are served: a long one takes tens of milliseconds.
pub(crate) async fn list<M: Send + 'static>(make: impl FnOnce() -> M + Send + 'static) -> Reply<M> {
    aside(make).await.map(Response::new)
}

/// Does work of tens of milliseconds, beside the thread on which all streams are served.
///
/// # Errors
/// INTERNAL if the work panicked.
pub(crate) async fn aside<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, Status> {
    let lost = |error| Refusal::fault(format!("the work for this call was lost: {error}"));
    Ok(tokio::task::spawn_blocking(work).await.map_err(lost)?)
}

/// Who makes a call, as the gate has noted it, and what is asked for.
pub(crate) fn caller<M: fmt::Debug>(request: &tonic::Request<M>) -> Result<Caller, Status> {
    let unknown = || Refusal::fault("nobody has judged this call, which is a fault of this program");
    let caller = request.extensions().get::<Caller>().cloned().ok_or_else(unknown)?;
    Ok(Caller { said: said(request.get_ref()), ..caller })
}

/// Session numbers begin at 1, so that a field that was left out is not taken for a session.
pub(crate) fn check_session(number: u64) -> Result<u64, Status> {
    if number == 0 { Err(invalid("session", "0 is not a session; they are numbered from 1")) } else { Ok(number) }
}

/// The operator who confirms something, if one does.
pub(crate) fn confirmed_by(text: &str) -> Result<Option<String>, Status> {
    let name = name("confirmed_by", text)?;
    Ok((!name.is_empty()).then_some(name))
}

/// A person's name in a request, trimmed. It is written down and shown, so it is short and nothing but text.
pub(crate) fn name(field: &str, text: &str) -> Result<String, Status> {
    let text = line(field, text, NAME_BYTES_MAX, "a name")?;
    if !text.is_empty() && !text.contains(char::is_alphanumeric) {
        return Err(invalid(field, format_args!("`{text}` has no letter and no digit, expected a name")));
    }
    Ok(text.trim().to_owned())
}

/// Checks a text that is kept in logs: short, and nothing that a terminal acts upon. `expected` says what it should be.
pub(crate) fn line<'a>(field: &str, text: &'a str, bytes_max: usize, expected: &str) -> Result<&'a str, Status> {
    let length = text.len();
    if length > bytes_max {
        return Err(invalid(field, format_args!("{length} bytes, at most {bytes_max} are kept")));
    }
    let Some(odd) = taxel_skin::unprintable(text).map(u32::from) else { return Ok(text) };
    Err(invalid(field, format_args!("has the unprintable character U+{odd:04X}, expected {expected}")))
}

/// The engine answered a command with something else than that command's result.
pub(crate) fn misfit() -> Status {
    Refusal::fault("the engine's answer does not fit the command").into()
}

/// How much of a list is asked for: so many items at most, and only those with a number below the second.
pub(crate) fn part(request: &v1::ListRequest) -> Result<(usize, u64), Status> {
    let before = if request.before == 0 { u64::MAX } else { request.before };
    match request.most {
        0 => Ok((ITEMS_MAX as usize, before)),
        most if most <= ITEMS_MAX => Ok((most as usize, before)),
        most => Err(invalid("most", format_args!("{most} is not in 0 to {ITEMS_MAX}"))),
    }
}
