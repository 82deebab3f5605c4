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

/// What is held against the boards of a patch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Doubt {
    pub(crate) patch: String,
    /// Why its counts cannot show that the skin is at rest.
    pub(crate) why: String,
    /// Whether a row says so, and not only that a row is lost.
    pub(crate) is_noted: bool,
}

/// By patch: what its newest row says, nothing where somebody vouched for its zero; `None` if a row may be lost.
type Newest = BTreeMap<String, Option<String>>;

/// Per patch: why its counts cannot show that the skin is at rest, where the newest row of it says so.
///
/// A damaged or missing row may have been any patch's: each of `patches` that has no newer one is doubted, rather than that a
/// zero under a load is believed. `end_is_lost` tells that the newest rows may be missing without that the others show it.
pub(crate) fn read(
    connection: &Connection,
    patches: &BTreeSet<&str>,
    end_is_lost: bool,
    quarantined: &mut Vec<Quarantined>,
) -> rusqlite::Result<Vec<Doubt>> {
    let mut statement =
        connection.prepare("SELECT seq, patch, why, wall_ns, checksum FROM zero_doubts ORDER BY seq")?;
    let mut rows = statement.query([])?;
    let (mut newest, mut next) = (Newest::new(), 1);
    let mut lost = |newest: &mut Newest, reason: String| {
        quarantined.push(Quarantined::new("what was noted of the boards' zeros", reason));
        lose(newest, patches);
    };
    while let Some(row) = rows.next()? {
        let seq: u64 = row.get(0)?;
        if seq != next {
            lost(&mut newest, format!("row {next} is missing"));
        }
        next = seq + 1;
        match doubt(row, seq) {
            Ok((patch, why)) => drop(newest.insert(patch, Some(why))),
            Err(reason) => lost(&mut newest, format!("row {seq}: {reason}")),
        }
    }
    match written(connection, Stream::ZeroDoubts)? {
        Some(written) if written < next => {}
        Some(written) => lost(&mut newest, format!("{written} rows were written, the last ones are missing")),
        None => lost(&mut newest, "the record of how many rows there were is damaged".to_owned()),
    }
    if end_is_lost {
        lose(&mut newest, patches);
    }
    let doubt = |(patch, why): (String, Option<String>)| {
        let is_noted = why.is_some();
        Doubt { patch, why: why.unwrap_or_else(|| UNREADABLE.to_owned()), is_noted }
    };
    Ok(newest.into_iter().map(doubt).filter(|doubt| !doubt.why.is_empty()).collect())
}

/// A row may be lost that is newer than all of these. What is held against a patch's boards already goes on being held.
fn lose(newest: &mut Newest, patches: &BTreeSet<&str>) {
    for &patch in patches {
        let known = newest.entry(patch.to_owned()).or_default();
        *known = known.take().filter(|why| !why.is_empty());
    }
}

/// All patches, of which nothing is known.
pub(crate) fn of_all<'a>(patches: impl Iterator<Item = &'a str>) -> Vec<(String, String)> {
    patches.map(|patch| (patch.to_owned(), UNREADABLE.to_owned())).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_nothing_is_known_every_patch_is_told_that() {
        let (arm, hand) = ("arm".to_owned(), "hand".to_owned());
        let all = of_all(["arm", "hand"].into_iter());
        assert_eq!(all, [(arm, UNREADABLE.to_owned()), (hand, UNREADABLE.to_owned())]);
    }
}
