//! Whether what a cut has left is a state in which the store has been since the last acknowledgement.

use std::fmt::Display;
use std::fs;
use std::path::Path;

use taxel_engine::Restored;
use taxel_engine::calibration::SessionState;

use super::plan::{Held, Plan, signature, signed};
use crate::tests::fixture::*;
use crate::{Store, copy};

/// Opens the store. It is to hold what it held after event `done`, `begun` or one between, whole, without anything that
/// is called damaged; and it takes more. Gives the event after which it is, or what is wrong. No file is open any more then.
pub fn check(path: &Path, plan: &Plan, done: usize, begun: usize) -> Result<usize, String> {
    let states: Vec<_> = (done..=begun).map(|event| plan.after(event)).collect();
    copy_is_whole(path, plan, begun)?;
    let (store, restored, quarantined) = Store::open(path, Box::new(|_| ())).map_err(text)?;
    let found = if quarantined.is_empty() {
        state_among(&states, &store, &restored, path, plan.deleted(done))
    } else {
        Err(format!("called damaged: {quarantined:?}"))
    };
    let closed = store.close().map_err(text);
    found.and_then(|at| closed.map(|()| done + at))
}

/// Which of these states an open store is in; it takes more, and what was deleted is gone.
fn state_among(
    states: &[Held],
    store: &Store,
    restored: &Restored,
    path: &Path,
    deleted: impl Iterator<Item = u64>,
) -> Result<usize, String> {
    let held = held(store, restored)?;
    let Some(at) = states.iter().position(|state| *state == held) else {
        return Err(format!("there is {held:?}, expected {:?} or one of {} later states", states[0], states.len() - 1));
    };
    let bytes = fs::read(path).map_err(text)?;
    for session in deleted {
        let signature = signature(session);
        if bytes.windows(signature.len()).any(|window| window == signature) {
            return Err(format!("samples of session {session} are on the disk, which was deleted"));
        }
    }
    write(store, vec![session(900, SessionState::Aborted)]).map_err(text)?;
    Ok(at)
}

fn text(error: impl Display) -> String {
    error.to_string()
}

/// The copy is a whole one of the past, or none was made yet.
fn copy_is_whole(path: &Path, plan: &Plan, begun: usize) -> Result<(), String> {
    let Some(found) = copy::read(path).map_err(|error| format!("the copy: {error}"))? else { return Ok(()) };
    let active = found.restored.active.first().map(|(_, id)| id);
    let was_active = (0..=begun).any(|event| plan.after(event).active.as_ref() == active);
    if was_active { Ok(()) } else { Err(format!("the copy has {active:?} in use, which never was")) }
}

/// What the store holds, each sample and each set of it read.
fn held(store: &Store, restored: &Restored) -> Result<Held, String> {
    let mut held = Held { loads: restored.loads.len(), ..Held::default() };
    for set in &restored.model_sets {
        set_of(store, &set.id).map_err(text)?;
        held.sets.insert(set.id.clone());
    }
    held.zero = restored.zeros.first().map(|(_, zero)| zero.clone()).unwrap_or_default();
    held.active = restored.active.first().map(|(_, id)| id.clone());
    for view in &restored.sessions {
        let samples = samples_of(store, view.number).map_err(text)?.samples;
        if !samples.iter().cloned().eq((0..samples.len() as u64).map(|index| signed(view.number, index))) {
            return Err(format!("a sample of session {} is not what was written", view.number));
        }
        held.sessions.insert(view.number, samples.len() as u64);
    }
    let log = entries(store, u64::MAX, u32::MAX).map_err(text)?;
    if let Some(entry) = log.iter().find(|entry| !entry.damage.is_empty() || entry.asked.is_none()) {
        return Err(format!("entry {} of the audit log: {}", entry.number, entry.damage));
    }
    held.asked = log.len();
    held.answered = log.iter().filter(|entry| entry.answered.is_some()).count();
    Ok(held)
}
