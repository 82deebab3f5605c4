//! What was found against the zeros of a patch's boards: boards keep their zeros while the daemon is away.

use std::collections::{BTreeMap, BTreeSet};

use rusqlite::{Connection, Row, params};

use crate::error::Quarantined;
use crate::rows;
use crate::tally::{Stream, written};

/// What is held against the boards of a patch whose row cannot be read any more.
const UNREADABLE: &str =
    "what was noted of the zeros of its boards is damaged on disk: one may have taken a zero under a load";

pub(crate) fn insert(
    connection: &Connection,
    seq: u64,
    patch: &str,
    why: Option<&str>,
    wall_ns: i64,
) -> rusqlite::Result<()> {
    let why = why.unwrap_or_default();
    connection.execute(
        "INSERT INTO zero_doubts (seq, patch, why, wall_ns, checksum) VALUES (?1, ?2, ?3, ?4, ?5)",
        params![seq, patch, why, wall_ns, rows::doubt_checksum(seq, patch, why, wall_ns)],
    )?;
    Ok(())
}

/// Per patch: why its counts cannot show that the skin is at rest, where the newest row of it says so.
///
/// A damaged or missing row may have been any patch's: each of `patches` that has no newer one is doubted, rather than that a
/// zero under a load is believed.
pub(crate) fn read(
    connection: &Connection,
    patches: &BTreeSet<&str>,
    quarantined: &mut Vec<Quarantined>,
) -> rusqlite::Result<Vec<(String, String)>> {
    let mut statement =
        connection.prepare("SELECT seq, patch, why, wall_ns, checksum FROM zero_doubts ORDER BY seq")?;
    let mut rows = statement.query([])?;
    let (mut doubts, mut next) = (BTreeMap::new(), 1);
    let mut lost = |doubts: &mut BTreeMap<String, String>, reason: String| {
        quarantined.push(Quarantined::new("what was noted of the boards' zeros", reason));
        doubts.extend(patches.iter().map(|&patch| (patch.to_owned(), UNREADABLE.to_owned())));
    };
    while let Some(row) = rows.next()? {
        let seq: u64 = row.get(0)?;
        if seq != next {
            lost(&mut doubts, format!("row {next} is missing"));
        }
        next = seq + 1;
        match doubt(row, seq) {
            Ok((patch, why)) => drop(doubts.insert(patch, why)),
            Err(reason) => lost(&mut doubts, format!("row {seq}: {reason}")),
        }
    }
    match written(connection, Stream::ZeroDoubts)? {
        Some(written) if written < next => {}
        Some(written) => lost(&mut doubts, format!("{written} rows were written, the last ones are missing")),
        None => lost(&mut doubts, "the record of how many rows there were is damaged".to_owned()),
    }
    doubts.retain(|_, why| !why.is_empty());
    Ok(doubts.into_iter().collect())
}

fn doubt(row: &Row<'_>, seq: u64) -> Result<(String, String), String> {
    let text = |error: rusqlite::Error| error.to_string();
    let (patch, why): (String, String) = (row.get(1).map_err(text)?, row.get(2).map_err(text)?);
    let (wall_ns, checksum): (i64, Vec<u8>) = (row.get(3).map_err(text)?, row.get(4).map_err(text)?);
    match checksum == rows::doubt_checksum(seq, &patch, &why, wall_ns) {
        true => Ok((patch, why)),
        false => Err("its checksum is wrong".to_owned()),
    }
}
