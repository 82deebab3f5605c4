//! What a start finds: every row is proven before it is believed.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use rusqlite::{Connection, Row};
use taxel_engine::Restored;
use taxel_engine::calibration::{SessionState, SessionView};
use taxel_engine::loads::Load;

use crate::audit_rows;
use crate::board_zeros::{self, Missing};
use crate::deletions::Deletions;
use crate::error::Quarantined;
use crate::load_row::load_from_text;
use crate::pass::Unproven;
use crate::rows;
use crate::session_samples::{prove, samples_of};
use crate::sets::{self, Listed, ToIndex};
use crate::tally::{Stream, shortfall, written};

/// What a start has from the database.
pub(crate) struct Found {
    /// What the engine starts from.
    pub(crate) restored: Restored,
    /// The row of each model set.
    pub(crate) rows_of_sets: Vec<(String, u64)>,
    /// What is left to be proven; nothing if all was.
    pub(crate) unproven: Unproven,
    /// How many texts of model sets were read.
    pub(crate) texts_read: usize,
    /// What the index of model sets lacks.
    pub(crate) to_index: Vec<ToIndex>,
}

/// Reads all that the engine starts from. Errors are those of reading; a row that is wrong is quarantined instead.
///
/// Unless it is to prove the `whole` store, it reads the model sets that are active and no samples.
pub(crate) fn read(
    connection: &Connection,
    whole: bool,
    quarantined: &mut Vec<Quarantined>,
) -> rusqlite::Result<Found> {
    let deletions = Deletions::read(connection, quarantined)?;
    let mut list = sets::list(connection, &deletions, whole, quarantined)?;
    let active = active(connection, &mut list.sets, &deletions, quarantined)?;
    let (sessions, next_session) = sessions(connection, &deletions, quarantined)?;
    let mut unproven = Unproven::default();
    let sessions = sessions.into_iter().map(|view| interrupted(connection, view)).collect::<rusqlite::Result<_>>()?;
    let mut sessions: Vec<SessionView> = sessions;
    let to_prove = likely_to_go_on(&sessions);
    if whole {
        prove_samples(connection, &mut sessions, &to_prove, quarantined);
    } else {
        let idle = list.sets.iter().filter(|set| set.known.at_hand.is_none());
        unproven = Unproven::new(idle.map(|set| (set.seq, set.known.id.clone())), to_prove);
    }
    let (loads, next_load) = loads(connection, quarantined)?;
    let patches: BTreeSet<&str> = list.sets.iter().map(|set| set.known.patch.as_str()).collect();
    let known = board_zeros::read(connection, &patches, Missing::default(), quarantined)?;
    let board_zeros = known.into_iter().map(|known| (known.patch, known.zeros)).collect();
    audit_rows::count(connection, quarantined)?;
    let texts_read = list.texts_read + active.len();
    let rows_of_sets = list.sets.iter().map(|set| (set.known.id.clone(), set.seq)).collect();
    let model_sets = list.sets.into_iter().map(|set| set.known).collect();
    let sessions = sessions.into_iter().map(Arc::new).collect();
    let problems = Vec::new();
    let restored = Restored { model_sets, active, sessions, next_session, loads, next_load, board_zeros, problems };
    Ok(Found { restored, rows_of_sets, unproven, texts_read, to_index: list.to_index })
}

/// The active set of each patch, as the rows that are sound tell it; what is not sound was reported at the start.
pub(crate) fn active_now(connection: &Connection) -> rusqlite::Result<Vec<(String, String)>> {
    let mut statement =
        connection.prepare("SELECT seq, patch, model_set, wall_ns, checksum FROM activations ORDER BY seq")?;
    let mut rows = statement.query([])?;
    let mut active = BTreeMap::new();
    while let Some(row) = rows.next()? {
        match activation(row, row.get(0)?) {
            Ok((patch, set)) => drop(active.insert(patch, (set, row.get(0)?))),
            Err(_) => active.clear(), // it may have been any patch's
        }
    }
    let deletions = Deletions::read(connection, &mut Vec::new())?;
    active.retain(|_, (id, seq)| !deletions.ended(id, *seq));
    Ok(active.into_iter().map(|(patch, (id, _))| (patch, id)).collect())
}

/// The newest activation of all that is proven to have been; 0 if none is.
pub(crate) fn newest_activation(connection: &Connection) -> rusqlite::Result<u64> {
    let mut statement =
        connection.prepare("SELECT seq, patch, model_set, wall_ns, checksum FROM activations ORDER BY seq DESC")?;
    let mut rows = statement.query([])?;
    let mut newest = written(connection, Stream::Activations)?.unwrap_or(0);
    while let Some(row) = rows.next()? {
        let seq: u64 = row.get(0)?;
        if seq <= newest {
            break;
        }
        if activation(row, seq).is_ok() {
            newest = seq;
        }
    }
    Ok(newest)
}

/// The text of a model set, as it was written.
pub(crate) fn text_of(connection: &Connection, id: &str) -> rusqlite::Result<Option<Vec<u8>>> {
    let mut statement = connection.prepare("SELECT sha256, json FROM model_sets WHERE id = ?1 ORDER BY seq DESC")?;
    let mut rows = statement.query([id])?;
    while let Some(row) = rows.next()? {
        let (hash, json): (Vec<u8>, Vec<u8>) = (row.get(0)?, row.get(1)?);
        if hash == rows::sha256_of(&json) {
            return Ok(Some(json));
        }
    }
    Ok(None)
}

/// Whether a model set was deleted after this activation of all.
pub(crate) fn was_deleted(connection: &Connection, id: &str, activation: u64) -> rusqlite::Result<bool> {
    Ok(Deletions::read(connection, &mut Vec::new())?.ended(id, activation))
}

/// The newest activation of each patch.
///
/// A damaged or missing row may have been any patch's, so that nothing older than it can be called active any more: no
/// model is served rather than one that was replaced.
fn active(
    connection: &Connection,
    sets: &mut Vec<Listed>,
    deletions: &Deletions,
    quarantined: &mut Vec<Quarantined>,
) -> rusqlite::Result<Vec<(String, String)>> {
    let mut statement =
        connection.prepare("SELECT seq, patch, model_set, wall_ns, checksum FROM activations ORDER BY seq")?;
    let mut rows = statement.query([])?;
    let mut active = BTreeMap::new();
    let mut newest = 0;
    while let Some(row) = rows.next()? {
        let seq: u64 = row.get(0)?;
        if seq != newest + 1 {
            active.clear();
            quarantined.push(Quarantined::lost(format!("activation {}", newest + 1), "it is missing"));
        }
        newest = seq;
        match activation(row, seq) {
            Ok((patch, set)) => {
                active.insert(patch, (set, seq));
            }
            Err(reason) => {
                active.clear();
                quarantined.push(Quarantined::new(format!("activation {seq}"), reason));
            }
        }
    }
    if let Some(reason) = shortfall(connection, Stream::Activations, newest)? {
        active.clear();
        quarantined.push(Quarantined::lost("the list of activations", reason));
    }
    let mut served = Vec::new();
    for (patch, (id, seq)) in active {
        if deletions.ended(&id, seq) {
            continue;
        }
        if take_at_hand(connection, sets, &patch, &id, quarantined)? {
            served.push((patch, id));
            continue;
        }
        let reason = format!("it names model set {id}, which is not there or not of this patch");
        quarantined.push(Quarantined::lost(format!("the choice of the active model set of patch `{patch}`"), reason));
    }
    Ok(served)
}

/// Reads an active set; whether it is there and sound. One that is not is no longer listed.
fn take_at_hand(
    connection: &Connection,
    sets: &mut Vec<Listed>,
    patch: &str,
    id: &str,
    quarantined: &mut Vec<Quarantined>,
) -> rusqlite::Result<bool> {
    let Some(position) = sets.iter().position(|set| set.known.id == id && set.known.patch == patch) else {
        return Ok(false);
    };
    match sets::model_set(connection, sets[position].seq, id)? {
        Ok(set) => sets[position].known.at_hand = Some(Arc::new(set)),
        Err(reason) => {
            quarantined.push(Quarantined::new(format!("model set {id}"), reason));
            sets.remove(position);
            return Ok(false);
        }
    }
    Ok(true)
}

fn activation(row: &Row<'_>, seq: u64) -> Result<(String, String), String> {
    let (patch, set): (String, String) = (row.get(1).map_err(text)?, row.get(2).map_err(text)?);
    let (wall_ns, checksum): (i64, Vec<u8>) = (row.get(3).map_err(text)?, row.get(4).map_err(text)?);
    if checksum == rows::activation_checksum(seq, &patch, &set, wall_ns) {
        Ok((patch, set))
    } else {
        Err("its checksum is wrong".to_owned())
    }
}

fn sessions(
    connection: &Connection,
    deletions: &Deletions,
    quarantined: &mut Vec<Quarantined>,
) -> rusqlite::Result<(Vec<SessionView>, u64)> {
    let mut statement = connection.prepare("SELECT number, view, checksum FROM sessions ORDER BY number")?;
    let mut rows = statement.query([])?;
    let mut sessions = Vec::new();
    // Also of a session whose own row is lost: its ramps and samples still bear its number.
    let mut newest: u64 = connection.query_row(
        "SELECT max((SELECT coalesce(max(session), 0) FROM ramps), (SELECT coalesce(max(session), 0) FROM samples))",
        [],
        |row| row.get(0),
    )?;
    newest = newest.max(deletions.newest_session()).max(written(connection, Stream::Sessions)?.unwrap_or(0));
    let mut found = deletions.sessions();
    while let Some(row) = rows.next()? {
        let number: i64 = row.get(0)?;
        newest = newest.max(u64::try_from(number).unwrap_or(0));
        found += 1;
        match session_view(row, number) {
            Ok(view) => sessions.push(view),
            Err(reason) => quarantined.push(Quarantined::new(format!("session {number}"), reason)),
        }
    }
    if let Some(reason) = shortfall(connection, Stream::Sessions, found)? {
        quarantined.push(Quarantined::lost("the list of sessions", reason));
    }
    Ok((sessions, newest + 1))
}

/// Sessions that an operator is likely to go on with: their samples are proven, so that damage shows before a day in the
/// vacuum bag is planned. Those are every interrupted session, and the newest one of each patch if it can take another ramp.
fn likely_to_go_on(sessions: &[SessionView]) -> Vec<u64> {
    let mut patches = BTreeSet::new();
    let goes_on = |view: &&SessionView| {
        let is_newest = patches.insert(view.patch.clone());
        let can_go_on = matches!(view.state, SessionState::Review | SessionState::Failed | SessionState::Aborted);
        view.state == SessionState::Interrupted || (is_newest && can_go_on)
    };
    sessions.iter().rev().filter(goes_on).map(|view| view.number).collect()
}

/// Proves samples and keeps none. An interrupted session whose samples are damaged has failed; another is still what it was.
fn prove_samples(
    connection: &Connection,
    sessions: &mut [SessionView],
    to_prove: &[u64],
    quarantined: &mut Vec<Quarantined>,
) {
    for view in sessions.iter_mut().rev().filter(|view| to_prove.contains(&view.number)) {
        let Err(reason) = prove(connection, view.number) else { continue };
        if view.state == SessionState::Interrupted {
            view.state = SessionState::Failed;
            view.reason = format!("its samples are damaged on disk: {reason}");
        }
        quarantined.push(Quarantined::new(samples_of(view.number), reason));
    }
}

fn loads(connection: &Connection, quarantined: &mut Vec<Quarantined>) -> rusqlite::Result<(Vec<Arc<Load>>, u64)> {
    let mut statement = connection.prepare("SELECT number, load, checksum FROM loads ORDER BY number")?;
    let mut rows = statement.query([])?;
    let (mut loads, mut found, mut newest) = (Vec::new(), 0, 0);
    while let Some(row) = rows.next()? {
        newest = row.get(0)?;
        found += 1;
        match load(row, newest) {
            Ok(load) => loads.push(Arc::new(load)),
            Err(reason) => quarantined.push(Quarantined::new(format!("load {newest}"), reason)),
        }
    }
    if let Some(reason) = shortfall(connection, Stream::Loads, found)? {
        quarantined.push(Quarantined::lost("the list of known loads", reason));
    }
    Ok((loads, newest + 1))
}

fn load(row: &Row<'_>, number: u64) -> Result<Load, String> {
    let (load, checksum): (String, Vec<u8>) = (row.get(1).map_err(text)?, row.get(2).map_err(text)?);
    if checksum != rows::load_checksum(number, &load) {
        return Err("its checksum is wrong".to_owned());
    }
    load_from_text(&load).map_err(|error| error.to_string())
}

fn session_view(row: &Row<'_>, number: i64) -> Result<SessionView, String> {
    let (view, checksum): (String, Vec<u8>) = (row.get(1).map_err(text)?, row.get(2).map_err(text)?);
    let number = u64::try_from(number).map_err(|_| format!("{number} is no session number"))?;
    if checksum != rows::view_checksum(number, &view) {
        return Err("its checksum is wrong".to_owned());
    }
    rows::view_from_text(&view)
}

/// A session that was under way is interrupted. Its view was written when its state changed; more may have come since.
fn interrupted(connection: &Connection, mut view: SessionView) -> rusqlite::Result<SessionView> {
    if view.state.is_open() {
        view.reason =
            format!("the daemon stopped, or stored nothing more, while the session was {}", view.state.name());
        view.state = SessionState::Interrupted;
    }
    if view.state != SessionState::Interrupted {
        return Ok(view);
    }
    if let Some(ramps) = written(connection, Stream::Ramps(view.number))? {
        view.ramps = u16::try_from(ramps).unwrap_or(u16::MAX);
    }
    if let Some(samples) = written(connection, Stream::Samples(view.number))? {
        (view.accepted, view.durable) = (samples, samples);
    }
    Ok(view)
}

fn text(error: rusqlite::Error) -> String {
    error.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_operator_goes_on_with_what_was_interrupted_and_with_the_newest_of_a_patch() {
        use SessionState::{Aborted, Discarded, Interrupted, Review};
        let view = |(number, (patch, state)): (usize, (&str, SessionState))| SessionView {
            number: number as u64,
            patch: patch.to_owned(),
            state,
            ..SessionView::default()
        };
        let [a, b, c] = ["a", "b", "c"];
        let sessions = [(a, Interrupted), (a, Aborted), (a, Review), (b, Aborted), (b, Discarded), (c, Interrupted)];
        let sessions: Vec<_> = sessions.into_iter().enumerate().map(view).collect();
        assert_eq!(likely_to_go_on(&sessions), [5, 2, 0]);
    }

    #[test]
    fn a_row_of_other_columns_says_so() {
        let connection = Connection::open_in_memory().unwrap();
        let found = |sql: &str| connection.query_row(sql, [], |row| Ok((session_view(row, 1), load(row, 1)))).unwrap();
        for sql in ["SELECT 1, 5, x'00'", "SELECT 1, '{}', 5"] {
            let (view, load) = found(sql);
            let [view, load] = [view.unwrap_err(), load.unwrap_err()];
            assert!(view.contains("Invalid column type") && load.contains("Invalid column type"), "{view}, {load}");
        }
    }
}
