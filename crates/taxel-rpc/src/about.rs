//! What a command is about: for the audit log and for whoever is refused.

use taxel_engine::command::Command;

use crate::service::Service;

impl Service {
    /// The patch that a command is about; empty if it cannot be told.
    pub(crate) fn patch_of(&self, command: &Command) -> String {
        let of_set = |id: &str| self.known_set(id).map(|set| set.patch.clone()).unwrap_or_default();
        match command {
            Command::Tare { patch, .. }
            | Command::BringUp { patch, .. }
            | Command::BeginPush { patch }
            | Command::StartSession { patch, .. }
            | Command::Activate { patch, .. }
            | Command::RecordLoad { patch, .. } => patch.clone(),
            Command::StartRamp { session }
            | Command::FinishRamp { session }
            | Command::AbortSession { session }
            | Command::DiscardSession { session }
            | Command::DeleteSession { session } => {
                self.session(*session).map(|view| view.patch.clone()).unwrap_or_default()
            }
            Command::DeleteModelSet { model_set } => of_set(model_set),
            Command::Import { model_set, .. }
            | Command::KeepRefit { model_set, .. }
            | Command::KeepRecalibration { model_set } => model_set.patch.clone(),
        }
    }

    /// The kinds of things that a command names, and which of them; the narrowest last.
    pub(crate) fn things_of(&self, command: &Command) -> Vec<(&'static str, String)> {
        let patch = self.patch_of(command);
        // An empty name stands for the only patch.
        let named = self.patch(&patch).map(|index| self.plan(index).patch.name().to_owned());
        let mut things = vec![("patch", named.unwrap_or(patch))];
        things.retain(|(_, name)| !name.is_empty());
        things.extend(match command {
            Command::StartRamp { session }
            | Command::FinishRamp { session }
            | Command::AbortSession { session }
            | Command::DiscardSession { session }
            | Command::DeleteSession { session } => Some(("session", session.to_string())),
            Command::Activate { model_set, .. } | Command::DeleteModelSet { model_set } => {
                Some(("model_set", model_set.clone()))
            }
            Command::Import { model_set, .. }
            | Command::KeepRefit { model_set, .. }
            | Command::KeepRecalibration { model_set } => Some(("model_set", model_set.id.clone())),
            Command::Tare { .. }
            | Command::BringUp { .. }
            | Command::BeginPush { .. }
            | Command::StartSession { .. }
            | Command::RecordLoad { .. } => None,
        });
        things
    }
}
