//! What a command is about, in words: for the logs and for refusals.

use taxel_engine::audit::Asked;
use taxel_engine::command::Command;

use crate::access::caller::Caller;
use crate::service::Service;

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
    /// The kinds of things that a command names, and which of them; the narrowest last.
    pub(crate) fn things(&self) -> Vec<(&'static str, String)> {
        let patch = Some(("patch", self.patch.clone())).filter(|(_, patch)| !patch.is_empty());
        patch.into_iter().chain(self.thing.clone()).collect()
    }

    /// What the audit log says of it; who answers the command adds number, time and model set.
    pub(crate) fn asked(self, caller: &Caller, method: &'static str) -> Asked {
        let thing = self.thing.map_or_else(String::new, |(kind, which)| format!("{kind} {which}, "));
        Asked {
            who: caller.who(),
            role: caller.role.map_or("", |role| role.name()).to_owned(),
            transport: caller.origin.transport().to_owned(),
            place: caller.origin.place(),
            method: method.to_owned(),
            what: thing + &caller.said,
            claimed: self.claimed,
            patch: self.patch,
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
            | Command::AbortSession { session }
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
