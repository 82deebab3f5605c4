//! The ramps and samples of a session, each proven as it is read.

use rusqlite::{Connection, OptionalExtension, Row};
use taxel_engine::calibration::{RampBaseline, SessionSamples};
use taxel_engine::record::Sample;

use crate::rows;
use crate::tally::{Stream, shortfall};

/// Samples that are proven in one go while the daemon runs: some milliseconds of the store's thread.
const PART_SAMPLES: u64 = 1_000;

/// How findings name the samples of a session.
pub(crate) fn samples_of(session: u64) -> String {
    format!("samples of session {session}")
}

/// Reads every ramp and sample of a session and keeps none; how many there are of each.
pub(crate) fn prove(connection: &Connection, session: u64) -> Result<(u64, u64), String> {
    each_of(connection, session, |_| {}, |_| {})
}

/// Proves a part of a session's samples, beginning with sample `from`, and with the first part its ramps. Gives where the
/// next part begins; `None` after the last, or if there is no such session any more.
pub(crate) fn prove_part(connection: &Connection, session: u64, from: u64) -> Result<Option<u64>, String> {
    let there = connection.query_row("SELECT 1 FROM sessions WHERE number = ?1", [session], |_| Ok(())).optional();
    if there.map_err(text)?.is_none() {
        return Ok(None);
    }
    if from == 0 {
        let ramps = each(connection, RAMPS, [session, 0, u64::MAX >> 1], |at, row| ramp(session, at, row), |_| {})?;
        whole(connection, Stream::Ramps(session), ramps)?;
    }
    let read = |at, row: &Row<'_>| sample(session, from + at, row);
    let found = each(connection, SAMPLES, [session, from, PART_SAMPLES], read, |_| {})?;
    if found == PART_SAMPLES {
        return Ok(Some(from + found));
    }
    whole(connection, Stream::Samples(session), from + found).map(|()| None)
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
    let all = [session, 0, u64::MAX >> 1];
    let ramps = each(connection, RAMPS, all, |at, row| ramp(session, at, row), on_ramp)?;
    let samples = each(connection, SAMPLES, all, |at, row| sample(session, at, row), on_sample)?;
    whole(connection, Stream::Ramps(session), ramps)?;
    whole(connection, Stream::Samples(session), samples)?;
    Ok((ramps, samples))
}

/// Of a session, from a number on, and at most so many.
const RAMPS: &str =
    "SELECT ramp, baseline, checksum FROM ramps WHERE session = ?1 AND ramp >= ?2 ORDER BY ramp LIMIT ?3";
const SAMPLES: &str = "SELECT idx, ramp, time_ns, pressure_kpa, counts, checksum FROM samples
     WHERE session = ?1 AND idx >= ?2 ORDER BY idx LIMIT ?3";

/// Whether all rows of a stream were found.
fn whole(connection: &Connection, stream: Stream, found: u64) -> Result<(), String> {
    match shortfall(connection, stream, found).map_err(text)? {
        Some(reason) => Err(format!("{stream}: {reason}")),
        None => Ok(()),
    }
}

/// Rows of a session, each proven by `read`, which also gets the row's position among them; how many there are.
fn each<T>(
    connection: &Connection,
    query: &str,
    which: [u64; 3],
    read: impl Fn(u64, &Row<'_>) -> Result<T, String>,
    mut take: impl FnMut(T),
) -> Result<u64, String> {
    let mut statement = connection.prepare_cached(query).map_err(text)?;
    let mut rows = statement.query(which).map_err(text)?;
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
    rows::ramp_from_blob(ramp, &blob).ok_or_else(|| format!("ramp {ramp} has a torn baseline"))
}

fn sample(session: u64, position: u64, row: &Row<'_>) -> Result<Sample, String> {
    let index: u64 = row.get(0).map_err(text)?;
    let counts: Vec<u8> = row.get(4).map_err(text)?;
    let sample = Sample {
        ramp: row.get(1).map_err(text)?,
        time_ns: row.get(2).map_err(text)?,
        pressure_kpa: row.get(3).map_err(text)?,
        counts: [].as_slice().into(),
    };
    let checksum: Vec<u8> = row.get(5).map_err(text)?;
    if index != position {
        return Err(format!("sample {position} is missing"));
    }
    rows::with_counts(session, index, sample, counts, &checksum)
        .ok_or_else(|| format!("the checksum of sample {index} is wrong"))
}

fn text(error: rusqlite::Error) -> String {
    error.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::fixture::{filled, open, sample_record, write};

    const SESSION: u64 = 2;

    /// A store whose session has samples for two whole parts and five more.
    fn scene() -> (tempfile::TempDir, Connection) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("store.db");
        filled(&path);
        let (store, ..) = open(&path);
        write(&store, (40..2 * PART_SAMPLES + 5).map(|index| sample_record(SESSION, index)).collect()).unwrap();
        store.close().unwrap();
        let connection = Connection::open(&path).unwrap();
        connection
            .execute_batch("DROP TRIGGER ramps_keep; DROP TRIGGER samples_keep; DROP TRIGGER samples_stay")
            .unwrap();
        (dir, connection)
    }

    /// The parts that are proven, each by its first sample, and how it ends.
    fn parts(connection: &Connection) -> (Vec<u64>, Result<(), String>) {
        let (mut parts, mut from) = (Vec::new(), 0);
        loop {
            parts.push(from);
            match prove_part(connection, SESSION, from) {
                Ok(Some(next)) => from = next,
                end => return (parts, end.map(drop)),
            }
        }
    }

    #[test]
    fn each_row_of_a_session_is_proven_in_some_part() {
        let (_dir, connection) = scene();
        assert_eq!(parts(&connection), (vec![0, PART_SAMPLES, 2 * PART_SAMPLES], Ok(())));
        assert_eq!(prove_part(&connection, 7, 0), Ok(None), "there is no such session");
        for (change, found_in, said) in [
            ("UPDATE samples SET pressure_kpa = 1 WHERE idx = 2004", 3, "the checksum of sample 2004 is wrong"),
            ("DELETE FROM samples WHERE idx = 2004", 3, "2005 were written, 2004 are there"),
            ("DELETE FROM samples WHERE idx = 1500", 2, "sample 1500 is missing"),
            ("UPDATE ramps SET baseline = x'00'", 1, "the checksum of ramp 0 is wrong"),
            ("UPDATE ramps SET ramp = 1", 1, "ramp 0 is missing"),
        ] {
            connection.execute_batch(change).unwrap();
            let (parts, end) = parts(&connection);
            assert_eq!(parts.len(), found_in, "{change}");
            assert!(end.as_ref().is_err_and(|why| why.contains(said)), "{change}: {end:?}");
        }
    }

    #[test]
    fn what_cannot_be_asked_for_says_why() {
        let nothing = Connection::open_in_memory().unwrap();
        let said = [samples(&nothing, SESSION).unwrap_err(), prove_part(&nothing, SESSION, 0).unwrap_err()];
        assert!(said.iter().all(|said| said.contains("no such table")), "{said:?}");
    }
}
