//! What a start finds: every row is checked before it is used.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use rusqlite::Connection;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use taxel_engine::Restored;
use taxel_engine::calibration::{SessionState, SessionView};
use taxel_engine::known_set::KnownSet;
use taxel_engine::loads::Load;
use taxel_engine::model_set::ModelSet;
use taxel_engine::record::KeptZero;

use crate::error::{Quarantined, StoreError};
use crate::facts::{self, Key};
use crate::{samples, sets};

/// Kinds of facts.
pub(crate) const STATE: &str = "state";
pub(crate) const SESSION: &str = "session";
pub(crate) const ACTIVE: &str = "active";
pub(crate) const ZEROS: &str = "zeros";
pub(crate) const LOAD: &str = "load";

/// Facts of the store itself: how many commits it has had, the number of the next session, and whether somebody has it open.
pub(crate) const GENERATION: Key<'_> = Key::named(STATE, "generation");
pub(crate) const NEXT_SESSION: Key<'_> = Key::named(STATE, "next session");
pub(crate) const OPEN: Key<'_> = Key::named(STATE, "open");

/// The set that is in use on a patch.
#[derive(Serialize, Deserialize)]
pub(crate) struct Active {
    pub(crate) model_set: String,
    pub(crate) wall_ns: i64,
}

/// What a start has from a database.
#[derive(Debug, Default)]
pub(crate) struct Found {
    pub(crate) restored: Restored,
    pub(crate) damage: Vec<Quarantined>,
    /// A model set in use cannot be had.
    pub(crate) lacks_set: bool,
    /// What was noted of the boards' zeros of some patch is damaged.
    pub(crate) zeros_damaged: bool,
    pub(crate) generation: u64,
    /// Somebody had it open and did not close it.
    pub(crate) open: bool,
    /// How many samples each session has.
    pub(crate) samples: BTreeMap<u64, u64>,
}

/// A fact of the store itself. One that is damaged is an error: what it counts cannot be guessed.
pub(crate) fn state<T: DeserializeOwned>(connection: &Connection, key: Key<'_>) -> Result<T, StoreError> {
    let found = facts::get(connection, key)?.unwrap_or_else(|| Err("it is missing".to_owned()));
    found.map_err(|why| StoreError::Damaged(format!("its {}: {why}", key.name)))
}

/// Reads all that the engine starts from. A row that is wrong is left out and told.
///
/// # Errors
/// What the file cannot be read for.
pub(crate) fn read(connection: &Connection) -> Result<Found, StoreError> {
    let mut found = Found { generation: state(connection, GENERATION)?, ..Found::default() };
    found.open = state(connection, OPEN)?;
    found.samples = samples::counted(connection)?;
    let listed = sets::list(connection, &mut found.damage)?;
    found.restored.model_sets = listed.into_iter().map(KnownSet::stored).collect();
    read_active(connection, &mut found)?;
    read_sessions(connection, &mut found)?;
    for row in facts::all::<Load>(connection, LOAD)? {
        found.restored.next_load = row.number;
        match row.fact {
            Ok(load) => found.restored.loads.push(Arc::new(load)),
            Err(why) => found.damage.push(Quarantined::new(format!("load {}", row.number), why)),
        }
    }
    found.restored.next_load += 1;
    for row in facts::all::<KeptZero>(connection, ZEROS)? {
        match row.fact {
            Ok(zero) => found.restored.zeros.push((row.name, zero)),
            Err(why) => {
                found.zeros_damaged = true;
                found.damage.push(Quarantined::new("what was noted of the boards' zeros", why));
            }
        }
    }
    Ok(found)
}

fn read_active(connection: &Connection, found: &mut Found) -> Result<(), StoreError> {
    for row in facts::all::<Active>(connection, ACTIVE)? {
        let set = match row.fact {
            Ok(Active { model_set, .. }) => {
                let set = sets::read(connection, &model_set)?.map_err(|why| format!("{model_set}: {why}"));
                set.and_then(|set| {
                    if set.patch == row.name { Ok(set) } else { Err(format!("{model_set}: it is for another patch")) }
                })
            }
            Err(why) => Err(format!("which one that is: {why}")),
        };
        match set {
            Ok(set) => serve(&mut found.restored, Arc::new(set)),
            Err(why) => {
                found.lacks_set = true;
                found.damage.push(Quarantined::new(format!("the model set in use on patch `{}`", row.name), why));
            }
        }
    }
    Ok(())
}

/// Has a set in use on its patch.
fn serve(restored: &mut Restored, set: Arc<ModelSet>) {
    restored.active.push((set.patch.clone(), set.id.clone()));
    match restored.model_sets.iter_mut().find(|known| known.id == set.id) {
        Some(known) => known.at_hand = Some(set),
        None => restored.model_sets.push(set.into()),
    }
}

fn read_sessions(connection: &Connection, found: &mut Found) -> Result<(), StoreError> {
    let mut next: u64 = state(connection, NEXT_SESSION)?;
    for row in facts::all::<SessionView>(connection, SESSION)? {
        next = next.max(row.number + 1);
        match row.fact {
            Ok(mut view) => {
                view.durable = view.accepted;
                interrupt(connection, &mut view, found.samples.get(&row.number).copied().unwrap_or(0))?;
                found.restored.sessions.push(Arc::new(view));
            }
            Err(why) => found.damage.push(Quarantined::new(format!("session {}", row.number), why)),
        }
    }
    // Also of a session whose own row is damaged: its samples still bear its number.
    found.restored.next_session = next.max(found.samples.last_key_value().map_or(1, |(session, _)| session + 1));
    Ok(())
}

/// A session that was under way is interrupted. Its view was written when its state changed; more may have come since.
fn interrupt(connection: &Connection, view: &mut SessionView, samples: u64) -> Result<(), StoreError> {
    if view.state.is_open() {
        view.reason =
            format!("the daemon stopped, or stored nothing more, while the session was {}", view.state.name());
        view.state = SessionState::Interrupted;
    }
    if view.state == SessionState::Interrupted {
        view.ramps = u16::try_from(samples::ramps(connection, view.number)?).unwrap_or(u16::MAX);
        (view.accepted, view.durable) = (samples, samples);
    }
    Ok(())
}

/// Why a zero needs confirmation whatever was noted of it.
const UNKNOWN: &str = "what was noted of the zeros of its boards is lost: one may have taken a zero under a load";

/// Has every patch of which anything is known need its zero confirmed.
pub(crate) fn require_confirmation(restored: &mut Restored) {
    let of_sets = restored.model_sets.iter().map(|set| &set.patch);
    let of_sessions = restored.sessions.iter().map(|view| &view.patch);
    let of_zeros = restored.zeros.iter().map(|(patch, _)| patch);
    let patches: BTreeSet<String> = of_sets.chain(of_sessions).chain(of_zeros).cloned().collect();
    let mut known: BTreeMap<_, _> = restored.zeros.drain(..).collect();
    for patch in patches {
        let zero = known.entry(patch).or_default();
        zero.needs_confirmation.get_or_insert_with(|| UNKNOWN.to_owned());
        (zero.excused, zero.zero) = (None, None);
    }
    restored.zeros = known.into_iter().collect();
}
