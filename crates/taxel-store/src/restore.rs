//! What a start finds: every row is proven before it is believed.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use rusqlite::{Connection, Row};
use taxel_engine::Restored;
use taxel_engine::calibration::{RampBaseline, SessionSamples, SessionState, SessionView};
use taxel_engine::loads::Load;
use taxel_engine::model_set::ModelSet;
use taxel_engine::record::Sample;

use crate::deletions::Deletions;
use crate::error::{Quarantined, lines};
use crate::load_row::load_from_text;
use crate::models_json;
use crate::rows;
use crate::tally::{Stream, shortfall, written};

/// Reads all that the engine starts from. Errors are those of reading; a row that is wrong is quarantined instead.
pub(crate) fn read(connection: &Connection) -> rusqlite::Result<(Restored, Vec<Quarantined>)> {
    let mut quarantined = Vec::new();
    let deletions = Deletions::read(connection, &mut quarantined)?;
    let model_sets = model_sets(connection, &deletions, &mut quarantined)?;
    let active = active(connection, &model_sets, &deletions, &mut quarantined)?;
    let (sessions, next_session) = sessions(connection, &deletions, &mut quarantined)?;
    let (loads, next_load) = loads(connection, &mut quarantined)?;
    let problems = lines(&quarantined);
    Ok((Restored { model_sets, active, sessions, next_session, loads, next_load, problems }, quarantined))
}

fn model_sets(
    connection: &Connection,
    deletions: &Deletions,
    quarantined: &mut Vec<Quarantined>,
) -> rusqlite::Result<Vec<Arc<ModelSet>>> {
    let mut statement = connection.prepare("SELECT seq, id, sha256, json FROM model_sets ORDER BY seq")?;
    let mut rows = statement.query([])?;
    let mut sets: Vec<Arc<ModelSet>> = Vec::new();
    let mut there = deletions.rows_of_sets();
    while let Some(row) = rows.next()? {
        let seq = row.get(0)?;
        there.insert(seq);
        let id: String = match row.get(1) {
            Ok(id) => id,
            Err(error) => {
                quarantined.push(Quarantined::new(format!("model set in row {seq}"), error));
                continue;
            }
        };
        match model_set(row, &id) {
            Ok(set) if sets.iter().any(|other| other.id == set.id) => {}
            Ok(set) => sets.push(Arc::new(set)),
            Err(reason) => quarantined.push(Quarantined::new(format!("model set {id}"), reason)),
        }
    }
    let newest = there.last().copied().unwrap_or(0);
    let lost = newest.saturating_sub(there.len() as u64);
    if lost > 0 {
        quarantined.push(Quarantined::new("the list of model sets", format!("{lost} of {newest} rows are missing")));
    }
    if let Some(reason) = shortfall(connection, Stream::ModelSets, newest)? {
        quarantined.push(Quarantined::new("the list of model sets", reason));
    }
    Ok(sets)
}

fn model_set(row: &Row<'_>, id: &str) -> Result<ModelSet, String> {
    let (hash, json): (Vec<u8>, Vec<u8>) = (row.get(2).map_err(text)?, row.get(3).map_err(text)?);
    if hash != rows::sha256_of(&json) {
        return Err("its hash is not that of its content".to_owned());
    }
    let json = std::str::from_utf8(&json).map_err(|error| error.to_string())?;
    let set = models_json::from_json(json).map_err(|error| error.to_string())?;
    if set.id == id { Ok(set) } else { Err(format!("its row names it `{id}`, its content is {}", set.id)) }
}

/// The newest activation of each patch.
///
/// A damaged or missing row may have been any patch's, so that nothing older than it can be called active any more: no
/// model is served rather than one that was replaced.
fn active(
    connection: &Connection,
    sets: &[Arc<ModelSet>],
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
            quarantined.push(Quarantined::new(format!("activation {}", newest + 1), "it is missing"));
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
        quarantined.push(Quarantined::new("the list of activations", reason));
    }
    active.retain(|patch, (id, seq)| {
        if deletions.ended(id, *seq) {
            return false;
        }
        let served = sets.iter().any(|set| set.id == *id && set.patch == *patch);
        if !served {
            let reason = format!("it names model set {id}, which is not there or not of this patch");
            quarantined
                .push(Quarantined::new(format!("the choice of the active model set of patch `{patch}`"), reason));
        }
        served
    });
    Ok(active.into_iter().map(|(patch, (id, _))| (patch, id)).collect())
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
) -> rusqlite::Result<(Vec<Arc<SessionView>>, u64)> {
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
        quarantined.push(Quarantined::new("the list of sessions", reason));
    }
    let sessions = prove_newest(connection, sessions, quarantined).into_iter();
    Ok((sessions.map(Arc::new).collect(), newest + 1))
}

/// The samples of sessions that an operator is likely to go on with are proven at the start, so that damage shows before
/// a day in the vacuum bag is planned: those of every interrupted session, and of the newest one of each patch if it can
/// take another ramp. None is kept. Damage to the latter fails nothing, because it is still what it was.
fn prove_newest(
    connection: &Connection,
    sessions: Vec<SessionView>,
    quarantined: &mut Vec<Quarantined>,
) -> Vec<SessionView> {
    let mut patches = BTreeSet::new();
    let mut proven: Vec<SessionView> = Vec::new();
    for view in sessions.into_iter().rev() {
        let is_newest = patches.insert(view.patch.clone());
        let view = interrupted(connection, view, quarantined);
        let can_go_on = matches!(view.state, SessionState::Review | SessionState::Failed | SessionState::Aborted);
        let was_proven = quarantined.last().is_some_and(|last| last.what == samples_of(view.number));
        if is_newest
            && can_go_on
            && !was_proven
            && let Err(reason) = prove(connection, view.number)
        {
            quarantined.push(Quarantined::new(samples_of(view.number), reason));
        }
        proven.push(view);
    }
    proven.reverse();
    proven
}

fn samples_of(session: u64) -> String {
    format!("samples of session {session}")
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
        quarantined.push(Quarantined::new("the list of known loads", reason));
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

/// A session that was under way is interrupted; one whose samples are damaged has failed.
fn interrupted(connection: &Connection, mut view: SessionView, quarantined: &mut Vec<Quarantined>) -> SessionView {
    if view.state.is_open() {
        view.reason = format!("the daemon stopped while the session was {}", view.state.name());
        view.state = SessionState::Interrupted;
    }
    if view.state != SessionState::Interrupted {
        return view;
    }
    match prove(connection, view.number) {
        Ok((ramps, samples)) => {
            // The view was written when the state changed; more may have come since.
            view.ramps = u16::try_from(ramps).unwrap_or(u16::MAX);
            (view.accepted, view.durable) = (samples, samples);
        }
        Err(reason) => {
            view.state = SessionState::Failed;
            view.reason = format!("its samples are damaged on disk: {reason}");
            quarantined.push(Quarantined::new(samples_of(view.number), reason));
        }
    }
    view
}

/// Reads every ramp and sample of a session and keeps none; how many there are of each.
fn prove(connection: &Connection, session: u64) -> Result<(u64, u64), String> {
    each_of(connection, session, |_| {}, |_| {})
}

/// Every ramp and sample of a session, or why they cannot be trusted.
pub(crate) fn samples(connection: &Connection, session: u64) -> Result<SessionSamples, String> {
    let (mut ramps, mut samples) = (Vec::new(), Vec::new());
    each_of(connection, session, |ramp| ramps.push(ramp), |sample| samples.push(sample))?;
    Ok(SessionSamples { ramps, samples })
}

/// Gives every ramp and sample of a session, each proven, and then how many there are of each.
fn each_of(
    connection: &Connection,
    session: u64,
    on_ramp: impl FnMut(RampBaseline),
    on_sample: impl FnMut(Sample),
) -> Result<(u64, u64), String> {
    let ramps = each(
        connection,
        "SELECT ramp, baseline, checksum FROM ramps WHERE session = ?1 ORDER BY ramp",
        session,
        |position, row| ramp(session, position, row),
        on_ramp,
    )?;
    let samples = each(
        connection,
        "SELECT idx, ramp, time_ns, pressure_kpa, counts, checksum FROM samples WHERE session = ?1 ORDER BY idx",
        session,
        |position, row| sample(session, position, row),
        on_sample,
    )?;
    for (stream, found) in [(Stream::Ramps(session), ramps), (Stream::Samples(session), samples)] {
        if let Some(reason) = shortfall(connection, stream, found).map_err(text)? {
            return Err(format!("{stream}: {reason}"));
        }
    }
    Ok((ramps, samples))
}

/// All rows of a session, each proven by `read`, which also gets the row's position; how many there are.
fn each<T>(
    connection: &Connection,
    query: &str,
    session: u64,
    read: impl Fn(u64, &Row<'_>) -> Result<T, String>,
    mut take: impl FnMut(T),
) -> Result<u64, String> {
    let mut statement = connection.prepare(query).map_err(text)?;
    let mut rows = statement.query([session]).map_err(text)?;
    let mut found = 0;
    while let Some(row) = rows.next().map_err(text)? {
        take(read(found, row)?);
        found += 1;
    }
    Ok(found)
}

fn ramp(session: u64, position: u64, row: &Row<'_>) -> Result<RampBaseline, String> {
    let (ramp, blob): (u16, Vec<u8>) = (row.get(0).map_err(text)?, row.get(1).map_err(text)?);
    let checksum: Vec<u8> = row.get(2).map_err(text)?;
    if u64::from(ramp) != position {
        return Err(format!("ramp {position} is missing"));
    }
    if checksum != rows::ramp_checksum(session, ramp, &blob) {
        return Err(format!("the checksum of ramp {ramp} is wrong"));
    }
    let taxels = rows::baseline_from_blob(&blob).ok_or_else(|| format!("ramp {ramp} has a torn baseline"))?;
    Ok(RampBaseline { ramp, taxels })
}

fn sample(session: u64, position: u64, row: &Row<'_>) -> Result<Sample, String> {
    let index: u64 = row.get(0).map_err(text)?;
    let counts: Vec<u8> = row.get(4).map_err(text)?;
    let sample = Sample {
        ramp: row.get(1).map_err(text)?,
        time_ns: row.get(2).map_err(text)?,
        pressure_kpa: row.get(3).map_err(text)?,
        counts: counts.into(),
    };
    let checksum: Vec<u8> = row.get(5).map_err(text)?;
    if index != position {
        return Err(format!("sample {position} is missing"));
    }
    if checksum != rows::sample_checksum(session, index, &sample) {
        return Err(format!("the checksum of sample {index} is wrong"));
    }
    Ok(sample)
}

fn text(error: rusqlite::Error) -> String {
    error.to_string()
}
