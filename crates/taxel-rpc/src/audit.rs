//! What a command is about, in words, for the logs and for refusals; and `AuditService`, the log of it.

use taxel_engine::audit::{Asked, AuditEntry};
use taxel_engine::command::Command;
use taxel_proto::refusal::Refusal;
use taxel_proto::v1;
use taxel_proto::v1::audit_service_server::AuditService;
use tonic::{Request, Response};

use crate::access::rules::Caller;
use crate::backend::ask;
use crate::convert::timestamp;
use crate::service::{Reply, Service, part};

/// What a command is about.
pub(crate) struct About {
    /// Empty if it cannot be told.
    patch: String,
    /// The kind of thing beside the patch that it names, and which of them.
    thing: Option<(&'static str, String)>,
    /// The name that it claims.
    claimed: String,
}

impl About {
    /// A refusal that names it; the narrowest last.
    pub(crate) fn of(&self, refusal: Refusal) -> Refusal {
        let patch = Some(("patch", &self.patch)).filter(|(_, patch)| !patch.is_empty());
        let thing = self.thing.as_ref().map(|(kind, which)| (*kind, which));
        patch.into_iter().chain(thing).fold(refusal, |refusal, (kind, which)| refusal.about(kind, which))
    }

    /// What the audit log says of it; who answers the command adds number, time and model set.
    pub(crate) fn asked(&self, caller: &Caller, method: &'static str) -> Asked {
        let thing = self.thing.as_ref().map_or_else(String::new, |(kind, which)| format!("{kind} {which}, "));
        Asked {
            who: caller.who(),
            role: caller.role.map_or("", |role| role.name()).to_owned(),
            transport: caller.origin.transport().to_owned(),
            place: caller.origin.place(),
            method: method.to_owned(),
            what: thing + &caller.said,
            claimed: self.claimed.clone(),
            patch: self.patch.clone(),
            ..Asked::default()
        }
    }
}

impl Service {
    /// What a command is about.
    pub(crate) fn about(&self, command: &Command) -> About {
        let of_set = |id: &String| Some(("model_set", id.clone()));
        let (patch, thing, claimed) = match command {
            Command::Tare { patch, confirmed_by }
            | Command::BringUp { patch, confirmed_by }
            | Command::StartSession { patch, confirmed_by, .. } => (patch.clone(), None, confirmed_by.as_ref()),
            Command::RecordLoad { patch, load } => (patch.clone(), None, Some(&load.by)),
            Command::BeginPush { patch } => (patch.clone(), None, None),
            Command::StartRamp { session }
            | Command::Plateau { session, .. }
            | Command::FinishRamp { session }
            | Command::AbortSession { session, .. }
            | Command::DiscardSession { session }
            | Command::DeleteSession { session } => {
                let patch = self.session(*session).map(|view| view.patch.clone()).unwrap_or_default();
                (patch, Some(("session", session.to_string())), None)
            }
            Command::Activate { patch, model_set, .. } => (patch.clone(), of_set(model_set), None),
            Command::DeleteModelSet { model_set } => {
                let patch = self.known_set(model_set).map(|set| set.patch.clone()).unwrap_or_default();
                (patch, of_set(model_set), None)
            }
            Command::Import { model_set, .. }
            | Command::KeepRecalibration { model_set }
            | Command::KeepRefit { model_set, .. } => (model_set.patch.clone(), of_set(&model_set.id), None),
        };
        // An empty name stands for the only patch.
        let named = self.patch(&patch).map(|index| self.plan(index).patch.name().to_owned());
        About { patch: named.unwrap_or(patch), thing, claimed: claimed.cloned().unwrap_or_default() }
    }
}

#[tonic::async_trait]
impl AuditService for Service {
    async fn list_audit(&self, request: Request<v1::ListRequest>) -> Reply<v1::ListAuditResponse> {
        let request = request.into_inner();
        let (most, mut before) = part(&request)?;
        // Of one patch it has what is known to be of it, and what is damaged.
        let patch = request.patch;
        let is_of = |entry: &v1::AuditEntry| patch.is_empty() || entry.patch == patch || !entry.damage.is_empty();
        let mut entries = Vec::new();
        loop {
            let read = ask(|told| self.backend.audit(before, most as u32, told)).await?;
            let is_end = read.len() < most;
            before = read.last().map_or(0, |last| last.number);
            entries.extend(read.into_iter().map(message).filter(is_of));
            if is_end || entries.len() >= most {
                entries.truncate(most);
                return Ok(Response::new(v1::ListAuditResponse { entries }));
            }
        }
    }
}

fn message(entry: AuditEntry) -> v1::AuditEntry {
    let time = entry.asked.as_ref().and_then(|asked| timestamp(asked.wall_ns));
    let answered = entry.answered.as_ref().and_then(|answered| timestamp(answered.wall_ns));
    let (asked, result) = (entry.asked.unwrap_or_default(), entry.answered.unwrap_or_default());
    v1::AuditEntry {
        entry: entry.number,
        time,
        who: asked.who,
        role: asked.role,
        transport: asked.transport,
        from: asked.place,
        method: asked.method,
        request: asked.what,
        claimed_name: asked.claimed,
        patch: asked.patch,
        model_set_before: asked.before,
        answered,
        result: result.result,
        model_set_after: result.after,
        damage: entry.damage,
    }
}
