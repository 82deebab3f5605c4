//! Commands as most scenes give them: to the only patch, and with nothing said beside their names.

use std::sync::Arc;

use taxel_engine::command::Command;
use taxel_engine::model_set::ModelSet;
use taxel_skin::Kilopascal;

use crate::shared::small;

pub fn start() -> Command {
    start_on("", None, &[])
}

pub fn start_on(patch: &str, target_kpa: Option<f64>, leave_out: &[(u8, u8)]) -> Command {
    let (patch, target, leave_out) = (patch.to_owned(), target_kpa.map(Kilopascal), leave_out.to_vec());
    Command::StartSession { patch, target, branches: None, confirmed_by: None, leave_out }
}

pub fn tare() -> Command {
    Command::Tare { patch: String::new(), confirmed_by: None }
}

pub fn bring_up(confirmed_by: Option<&str>) -> Command {
    Command::BringUp { patch: String::new(), confirmed_by: confirmed_by.map(str::to_owned) }
}

pub fn activate(id: &str) -> Command {
    Command::Activate { patch: String::new(), model_set: id.to_owned(), expected: None }
}

pub fn import(model_set: Arc<ModelSet>) -> Command {
    Command::Import { model_set, insist: false }
}

pub fn delete_set(id: &str) -> Command {
    Command::DeleteModelSet { model_set: id.to_owned() }
}

/// The set of the small skin once more, from elsewhere.
pub fn other(id: &str) -> Arc<ModelSet> {
    other_with(id, |_| ())
}

/// The same with a change.
pub fn other_with(id: &str, change: impl FnOnce(&mut ModelSet)) -> Arc<ModelSet> {
    let mut set = ModelSet { id: id.to_owned(), session: None, ..ModelSet::clone(&small().set) };
    change(&mut set);
    Arc::new(set)
}
