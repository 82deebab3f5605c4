//! What is known of the zeros of a patch's boards, which they keep while the daemon is away: what was found against them, and
//! what they hide.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use rusqlite::{Connection, Row, params};
use taxel_engine::record::{BoardZeros, HiddenCounts};

use crate::error::Quarantined;
use crate::rows;
use crate::tally::{Stream, written};

/// What is held against the boards of a patch whose row cannot be read any more.
const UNREADABLE: &str =
    "what was noted of the zeros of its boards is damaged on disk: one may have taken a zero under a load";

/// So many losses elsewhere are named.
const NAMED_MAX: usize = 3;

/// How findings name these rows.
const NOTED: &str = "what was noted of the boards' zeros";

pub(crate) fn insert(
    connection: &Connection,
    seq: u64,
    patch: &str,
    zeros: &BoardZeros,
    wall_ns: i64,
) -> rusqlite::Result<()> {
    let why = &in_words(zeros);
    let blobs = zeros.hidden.as_deref().map(|hidden| [&hidden.counts, &hidden.reads].map(|c| rows::f32_to_blob(c)));
    let checksum = rows::board_zeros_checksum(seq, patch, why, wall_ns, blobs.as_ref());
    let [hidden, reads] = blobs.map_or([None, None], |blobs| blobs.map(Some));
    connection.execute(
        "INSERT INTO zero_doubts (seq, patch, why, wall_ns, checksum, hidden, reads)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)",
        params![seq, patch, why, wall_ns, checksum, hidden, reads],
    )?;
    Ok(())
}

/// What stands before what is held against the boards where one set is excused. The column has words for people, so that an
/// earlier program holds it against them whatever is in use.
const EXCUSED: &str = "but for ";

/// What is held against the boards, and the set for which that does not count; empty where nothing is held.
fn in_words(zeros: &BoardZeros) -> String {
    match (&zeros.unproven, &zeros.excused) {
        (Some(why), Some(set)) => format!("{EXCUSED}{set}: {why}"),
        (why, _) => why.clone().unwrap_or_default(),
    }
}

/// The inverse of [`in_words`].
fn of_words(words: String) -> (Option<String>, Option<String>) {
    match words.strip_prefix(EXCUSED).and_then(|rest| rest.split_once(": ")) {
        Some((set, why)) => (Some(why.to_owned()), Some(set.to_owned())),
        None => (Some(words).filter(|why| !why.is_empty()), None),
    }
}

/// What is known of the boards of a patch.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Known {
    pub(crate) patch: String,
    pub(crate) zeros: BoardZeros,
    /// Whether a row says so, and not only that a row is lost.
    pub(crate) is_noted: bool,
}

/// By patch: what its newest row says, and why a newer one may be lost.
type Newest = BTreeMap<String, (BoardZeros, Option<String>)>;

/// What may be missing without that the rows themselves show it.
#[derive(Clone, Copy, Default)]
pub(crate) struct Missing<'a> {
    /// The newest rows.
    pub(crate) newest: bool,
    /// What else has rows that are missing, or too many: the file is damaged, or its parts are of several moments.
    pub(crate) elsewhere: &'a [String],
}

impl Missing<'_> {
    /// Why a row may be, where that shows elsewhere. A disk that dies leaves thousands of findings: the first are named, and
    /// how many more there are.
    fn in_words(&self) -> Option<String> {
        let elsewhere: Vec<&str> = self.elsewhere.iter().map(String::as_str).filter(|what| *what != NOTED).collect();
        let (first, more) = elsewhere.split_at(elsewhere.len().min(NAMED_MAX));
        if first.is_empty() {
            return None;
        }
        let more = if more.is_empty() { String::new() } else { format!(" and {} more", more.len()) };
        Some(format!("{UNREADABLE}, as more of the store is not what was written: {}{more}", first.join(", ")))
    }
}

/// Per patch: what the newest row of it says, if that is anything.
///
/// A damaged or missing row may have been any patch's: each of `patches` that has no newer one is doubted, rather than that a
/// zero under a load is believed. What is missing elsewhere stays so, and is held against a patch once: a row of it says so then.
pub(crate) fn read(
    connection: &Connection,
    patches: &BTreeSet<&str>,
    missing: Missing<'_>,
    quarantined: &mut Vec<Quarantined>,
) -> rusqlite::Result<Vec<Known>> {
    let columns = "seq, patch, why, wall_ns, checksum, hidden, reads";
    let mut statement = connection.prepare(&format!("SELECT {columns} FROM zero_doubts ORDER BY seq"))?;
    let mut rows = statement.query([])?;
    let (mut newest, mut next) = (Newest::new(), 1);
    let mut lost = |newest: &mut Newest, reason: String| {
        quarantined.push(Quarantined::lost(NOTED, reason));
        lose(newest, patches, UNREADABLE);
    };
    while let Some(row) = rows.next()? {
        let seq: u64 = row.get(0)?;
        if seq != next {
            lost(&mut newest, format!("row {next} is missing"));
        }
        next = seq + 1;
        match proven(row, seq) {
            Ok((patch, zeros)) => drop(newest.insert(patch, (zeros, None))),
            Err(reason) => lost(&mut newest, format!("row {seq}: {reason}")),
        }
    }
    match written(connection, Stream::BoardZeros)? {
        Some(written) if written < next => {}
        Some(written) => lost(&mut newest, format!("{written} rows were written, the last ones are missing")),
        None => lost(&mut newest, "the record of how many rows there were is damaged".to_owned()),
    }
    if missing.newest {
        lose(&mut newest, patches, UNREADABLE);
    }
    if let Some(why) = missing.in_words() {
        lose(&mut newest, &without_row(connection, patches, &why)?, &why);
    }
    let known = newest.into_iter().map(|(patch, (zeros, lost))| Known {
        patch,
        is_noted: zeros.unproven.is_some() || lost.is_none(),
        zeros: BoardZeros {
            excused: zeros.excused.filter(|_| lost.is_none()), // of what is lost no set is known to be
            unproven: zeros.unproven.or(lost),
            ..zeros
        },
    });
    Ok(known.filter(|known| known.zeros != BoardZeros::default()).collect())
}

/// A row may be lost that is newer than all of these. What is known of a patch's boards already goes on being held.
fn lose(newest: &mut Newest, patches: &BTreeSet<&str>, why: &str) {
    for &patch in patches {
        newest.entry(patch.to_owned()).or_default().1 = Some(why.to_owned());
    }
}

/// Those of the patches of which no row says this.
fn without_row<'a>(
    connection: &Connection,
    patches: &BTreeSet<&'a str>,
    why: &str,
) -> rusqlite::Result<BTreeSet<&'a str>> {
    let mut said = connection.prepare("SELECT EXISTS (SELECT 1 FROM zero_doubts WHERE patch = ?1 AND why = ?2)")?;
    let mut without = BTreeSet::new();
    for &patch in patches {
        if !said.query_row([patch, why], |row| row.get::<_, bool>(0))? {
            without.insert(patch);
        }
    }
    Ok(without)
}

/// All patches, of which nothing is known.
pub(crate) fn of_all<'a>(patches: impl Iterator<Item = &'a str>) -> Vec<(String, BoardZeros)> {
    let unreadable = || BoardZeros { unproven: Some(UNREADABLE.to_owned()), ..BoardZeros::default() };
    patches.map(|patch| (patch.to_owned(), unreadable())).collect()
}

fn proven(row: &Row<'_>, seq: u64) -> Result<(String, BoardZeros), String> {
    let text = |error: rusqlite::Error| error.to_string();
    let (patch, why): (String, String) = (row.get(1).map_err(text)?, row.get(2).map_err(text)?);
    let (wall_ns, checksum): (i64, Vec<u8>) = (row.get(3).map_err(text)?, row.get(4).map_err(text)?);
    let blobs = blobs(row).map_err(text)?;
    if checksum != rows::board_zeros_checksum(seq, &patch, &why, wall_ns, blobs.as_ref()) {
        return Err("its checksum is wrong".to_owned());
    }
    let hidden = blobs.map(|[counts, reads]| {
        let [counts, reads] = [rows::f32_from_blob(&counts), rows::f32_from_blob(&reads)];
        Some(Arc::new(HiddenCounts { counts: counts?, reads: reads? }))
    });
    let hidden = hidden.map(|hidden| hidden.ok_or("its counts are of no whole number")).transpose()?;
    let (unproven, excused) = of_words(why);
    Ok((patch, BoardZeros { unproven, excused, hidden }))
}

/// The counts in a row: what is hidden, and what the taxels read then. Both or none.
pub(crate) fn blobs(row: &Row<'_>) -> rusqlite::Result<Option<[Vec<u8>; 2]>> {
    let [hidden, reads]: [Option<Vec<u8>>; 2] = [row.get(5)?, row.get(6)?];
    Ok(match (hidden, reads) {
        (None, None) => None,
        (hidden, reads) => Some([hidden, reads].map(Option::unwrap_or_default)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_held_but_for_a_set_is_read_as_it_was_written() {
        for (unproven, excused, words) in [
            (None, None, ""),
            (Some("a load: 2 N"), None, "a load: 2 N"),
            (Some("a load: 2 N"), Some("m-1"), "but for m-1: a load: 2 N"),
        ] {
            let of = |text: Option<&str>| text.map(str::to_owned);
            let zeros = BoardZeros { unproven: of(unproven), excused: of(excused), hidden: None };
            assert_eq!(in_words(&zeros), words);
            assert_eq!(of_words(words.to_owned()), (zeros.unproven, zeros.excused));
        }
    }

    #[test]
    fn where_nothing_is_known_every_patch_is_told_that() {
        let all = of_all(["arm", "hand"].into_iter());
        let doubted = BoardZeros { unproven: Some(UNREADABLE.to_owned()), ..BoardZeros::default() };
        assert_eq!(all, [("arm".to_owned(), doubted.clone()), ("hand".to_owned(), doubted)]);
    }

    #[test]
    fn of_many_losses_elsewhere_the_first_three_are_named_and_these_rows_themselves_are_none() {
        let said = |names: &[&str]| {
            let elsewhere: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
            Missing { newest: true, elsewhere: &elsewhere }.in_words()
        };
        assert_eq!((said(&[]), said(&[NOTED])), (None, None));
        for (names, end) in [
            (&["loads", NOTED][..], ": loads"),
            (&["a", "b", "c"], ": a, b, c"),
            (&["a", "b", NOTED, "c", "d", "e"], ": a, b, c and 2 more"),
        ] {
            let said = said(names).unwrap();
            assert!(said.starts_with(UNREADABLE) && said.ends_with(end), "{said}");
        }
    }
}
