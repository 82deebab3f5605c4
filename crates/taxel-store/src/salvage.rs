//! What can be read of a damaged database goes into a new one, row by row, each proven; the damaged one is kept as it is
//! under another name.

use std::fs::{self, File};
use std::io::Read;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use rusqlite::config::DbConfig;
use rusqlite::types::Value;
use rusqlite::{Connection, Row, params_from_iter};
use taxel_engine::record::Sample;

use crate::beside;
use crate::rows;
use crate::schema;

/// Pages of our files: SQLite's default.
const PAGE_BYTES: usize = 4096;
/// The part of the first page that describes the file.
const HEADER_BYTES: usize = 100;
/// What a page that points to others has where the header ends.
const INTERIOR_PAGE: u8 = 5;
/// Where the header says how many pages there are, and which of them are free.
const PAGES_AT: usize = 28;
const FREE_AT: usize = 32;

/// Of our files so much is looked at for what makes them ours: their tables are described at the beginning.
const MARKS_WITHIN: u64 = 1 << 20;
const MARKS: [&[u8]; 2] = [b"CREATE TABLE activations", b"CREATE TABLE model_sets"];

/// Whether a file that cannot be opened as a store was one of ours: part of it says so, or what lies beside it.
pub(crate) fn was_ours(path: &Path) -> bool {
    if beside::open_mark(path).exists() || beside::active(path).exists() {
        return true;
    }
    let mut begin = Vec::new();
    // What comes before a sector that cannot be read is enough.
    let _ = File::open(path).and_then(|file| file.take(MARKS_WITHIN).read_to_end(&mut begin));
    MARKS.iter().any(|mark| begin.windows(mark.len()).any(|window| window == *mark))
}

/// What came of a damaged database.
pub(crate) struct Salvaged {
    /// Where it is kept.
    pub(crate) aside: PathBuf,
    /// Rows of it that were taken over.
    pub(crate) rows: u64,
}

/// Puts a new database with what can be read in the place of a damaged one.
///
/// The damaged one keeps its bytes: what reads it reads copies. The new one gets its place in one step, once it is whole.
pub(crate) fn salvage(path: &Path) -> Result<Salvaged, String> {
    let at = |what: &'static str| move |error: std::io::Error| format!("{what}: {error}");
    let aside = beside::keep_aside(path).map_err(at("the damaged store cannot be kept"))?;
    let (part, copy) = (beside::beside(path, "-new-part"), beside::beside(path, "-copy"));
    for left_over in [&part, &copy] {
        remove_with_log(left_over).map_err(at("what an earlier attempt left"))?;
    }
    let mut new = Connection::open(&part).map_err(|error| error.to_string())?;
    let taken = fill(&mut new, path, &copy).map_err(|error| format!("a new store: {error}"));
    let closed = new.close().map_err(|(_, error)| error.to_string());
    remove_with_log(&copy).map_err(at("the copy"))?;
    let rows = taken?;
    closed?;
    File::open(&part).and_then(|file| file.sync_all()).map_err(at("the new store"))?;
    fs::rename(&part, beside::successor(path)).map_err(at("the new store"))?;
    beside::sync_folder(path).map_err(at("the new store"))?;
    succeed(path).map_err(at("the new store"))?;
    Ok(Salvaged { aside, rows })
}

/// Puts a new database that is whole in its place, also if an earlier start was stopped before it could.
pub(crate) fn succeed(path: &Path) -> std::io::Result<()> {
    let new = beside::successor(path);
    if !new.exists() {
        return Ok(());
    }
    // The log belongs to the damaged one, and is kept with it.
    beside::remove(&beside::wal(path))?;
    fs::rename(new, path)?;
    beside::sync_folder(path)
}

fn remove_with_log(path: &Path) -> std::io::Result<()> {
    for suffix in ["", "-wal", "-shm", "-journal"] {
        beside::remove(&beside::beside(path, suffix))?;
    }
    Ok(())
}

/// Makes the tables and fills them from one reading of the damaged file after another, until one meets no damage. What
/// a file says of itself can be wrong while its content is whole, so that the others take it from the new one: the header,
/// the first page, all pages that describe tables.
fn fill(new: &mut Connection, damaged: &Path, copy: &Path) -> rusqlite::Result<u64> {
    new.pragma_update(None, "foreign_keys", false)?;
    new.pragma_update(None, "synchronous", "off")?; // nothing counts before it is whole and flushed
    let transaction = new.transaction()?;
    transaction.pragma_update(None, "application_id", schema::APPLICATION_ID)?;
    transaction.pragma_update(None, "user_version", schema::VERSION)?;
    schema::STEPS.iter().try_for_each(|step| transaction.execute_batch(step))?;
    transaction.commit()?;
    let table_pages = new.path().and_then(|path| table_pages(Path::new(path)).ok()).unwrap_or_default();
    let first_page = table_pages.first().map(|(_, page)| page.clone()).unwrap_or_default();
    let beginning = |bytes: usize| first_page.get(..bytes).map(|part| (0, part.to_vec()));
    let header = Vec::from_iter(beginning(HEADER_BYTES));
    let first = Vec::from_iter(beginning(PAGE_BYTES));
    let mut rows = 0;
    for replaced in [Vec::new(), header, first, table_pages] {
        if remove_with_log(copy).and_then(|()| copy_of(damaged, copy, replaced)).is_err() {
            continue; // for want of space: what was taken before counts
        }
        let transaction = new.transaction()?;
        let (taken, whole) = take_all(copy, &transaction);
        transaction.commit()?;
        rows += taken;
        if whole {
            break;
        }
    }
    Ok(rows)
}

/// Bytes of a file, and where they begin.
type Part = (u64, Vec<u8>);

/// The pages of a new database that describe its tables: the first one, and those that it points to. A file that was made
/// by the same version has them in the same places.
fn table_pages(path: &Path) -> std::io::Result<Vec<Part>> {
    let file = File::open(path)?;
    let page = |number: u32| {
        let (at, mut page) = (u64::from(number - 1) * PAGE_BYTES as u64, vec![0; PAGE_BYTES]);
        file.read_exact_at(&mut page, at).map(|()| (at, page))
    };
    let first = page(1)?;
    let number =
        |at: usize, bytes: usize| first.1[at..at + bytes].iter().fold(0, |sum, byte| sum << 8 | u32::from(*byte));
    let mut children = Vec::new();
    if first.1[HEADER_BYTES] == INTERIOR_PAGE {
        children.push(number(HEADER_BYTES + 8, 4));
        let cells = number(HEADER_BYTES + 3, 2) as usize;
        children.extend((0..cells).map(|cell| number(number(HEADER_BYTES + 12 + 2 * cell, 2) as usize, 4)));
    }
    children.sort_unstable();
    let children = children.into_iter().map(page).collect::<Result<Vec<_>, _>>()?;
    Ok([vec![first], children].concat())
}

/// A copy of the database and its log in which some bytes are replaced.
fn copy_of(damaged: &Path, copy: &Path, replaced: Vec<Part>) -> std::io::Result<()> {
    let mut file = File::create(copy)?;
    beside::copy_readable(damaged, &mut file)?;
    if beside::wal(damaged).exists() {
        beside::copy_readable(&beside::wal(damaged), &mut File::create(beside::wal(copy))?)?;
    }
    let pages = u32::try_from(file.metadata()?.len() / PAGE_BYTES as u64).unwrap_or(u32::MAX);
    for (at, mut part) in replaced {
        if at == 0 {
            part[PAGES_AT..PAGES_AT + 4].copy_from_slice(&pages.to_be_bytes());
            part[FREE_AT..FREE_AT + 8].fill(0); // whatever is free is not read
        }
        file.write_all_at(&part, at)?;
    }
    Ok(())
}

/// Takes every proven row that the new database lacks: how many, and whether all could be read.
fn take_all(copy: &Path, new: &Connection) -> (u64, bool) {
    let opened = Connection::open(copy).and_then(|old| {
        old.set_db_config(DbConfig::SQLITE_DBCONFIG_DEFENSIVE, true)?;
        old.pragma_update(None, "trusted_schema", false)?;
        Ok(old)
    });
    let Ok(old) = opened else { return (0, false) };
    let (mut rows, mut whole) = (0, true);
    for table in &TABLES {
        // From both ends, because reading ends at the first page that is damaged.
        for direction in ["ASC", "DESC"] {
            let (taken, read_all) = take(table, direction, &old, new);
            rows += taken;
            if read_all {
                break;
            }
            whole = false;
        }
    }
    (rows, whole)
}

/// Whether a row is what was written; no error if its columns are of the wrong type.
type Proof = fn(&Row<'_>) -> rusqlite::Result<bool>;

struct Table {
    name: &'static str,
    columns: &'static str,
    key: &'static str,
    proof: Proof,
}

const fn table(name: &'static str, key: &'static str, columns: &'static str, proof: Proof) -> Table {
    Table { name, columns, key, proof }
}

/// All tables, with the columns in the order in which the proof takes them.
const TABLES: [Table; 13] = [
    table("sessions", "number", "number, view, checksum", |row| {
        Ok(row.get::<_, Vec<u8>>(2)? == rows::view_checksum(row.get(0)?, &row.get::<_, String>(1)?))
    }),
    table("ramps", "session {}, ramp", "session, ramp, baseline, checksum", |row| {
        Ok(row.get::<_, Vec<u8>>(3)? == rows::ramp_checksum(row.get(0)?, row.get(1)?, &row.get::<_, Vec<u8>>(2)?))
    }),
    table("samples", "session {}, idx", "session, idx, ramp, time_ns, pressure_kpa, counts, checksum", |row| {
        let counts: Vec<u8> = row.get(5)?;
        let (ramp, time_ns, pressure_kpa) = (row.get(2)?, row.get(3)?, row.get(4)?);
        let sample = Sample { ramp, time_ns, pressure_kpa, counts: counts.into() };
        Ok(row.get::<_, Vec<u8>>(6)? == rows::sample_checksum(row.get(0)?, row.get(1)?, &sample))
    }),
    table("model_sets", "seq", "seq, id, sha256, json", |row| {
        row.get::<_, u64>(0)?; // no row of ours has a negative number, and a start could not read one
        Ok(row.get::<_, Vec<u8>>(2)? == rows::sha256_of(&row.get::<_, Vec<u8>>(3)?))
    }),
    table("activations", "seq", "seq, patch, model_set, wall_ns, checksum", |row| {
        let (patch, set): (String, String) = (row.get(1)?, row.get(2)?);
        Ok(row.get::<_, Vec<u8>>(4)? == rows::activation_checksum(row.get(0)?, &patch, &set, row.get(3)?))
    }),
    // Nothing is decided by these, so nothing proves them.
    table("tares", "seq", "seq, patch, epoch, valid, wall_ns, reason, baseline_median, noise_median, baseline", |_| {
        Ok(true)
    }),
    table("loads", "number", "number, load, checksum", |row| {
        Ok(row.get::<_, Vec<u8>>(2)? == rows::load_checksum(row.get(0)?, &row.get::<_, String>(1)?))
    }),
    table("deleted_sessions", "number", "number, wall_ns, checksum", |row| {
        Ok(row.get::<_, Vec<u8>>(2)? == rows::deleted_session_checksum(row.get(0)?, row.get(1)?))
    }),
    table("deleted_model_sets", "seq", "seq, id, activation, wall_ns, checksum", |row| {
        let id: String = row.get(1)?;
        let expected = rows::deleted_set_checksum(row.get(0)?, &id, row.get(2)?, row.get(3)?);
        Ok(row.get::<_, Vec<u8>>(4)? == expected)
    }),
    table("zero_doubts", "seq", "seq, patch, why, wall_ns, checksum", |row| {
        let (patch, why): (String, String) = (row.get(1)?, row.get(2)?);
        Ok(row.get::<_, Vec<u8>>(4)? == rows::doubt_checksum(row.get(0)?, &patch, &why, row.get(3)?))
    }),
    table("audit", "seq", "seq, entry, checksum", |row| {
        Ok(row.get::<_, Vec<u8>>(2)? == rows::audit_checksum("audit", row.get(0)?, &row.get::<_, String>(1)?))
    }),
    table("audit_results", "seq", "seq, entry, checksum", |row| {
        Ok(row.get::<_, Vec<u8>>(2)? == rows::audit_checksum("audit_results", row.get(0)?, &row.get::<_, String>(1)?))
    }),
    table("tally", "stream", "stream, rows, checksum", |row| {
        Ok(row.get::<_, Vec<u8>>(2)? == rows::tally_checksum(&row.get::<_, String>(0)?, row.get(1)?))
    }),
];

/// Takes the proven rows of a table: how many are new, and whether the last one was read.
fn take(table: &Table, direction: &str, old: &Connection, new: &Connection) -> (u64, bool) {
    let Table { name, columns, key, proof } = table;
    let key = key.replace("{}", direction);
    let query = format!("SELECT {columns} FROM {name} ORDER BY {key} {direction}");
    let Ok(mut statement) = old.prepare(&query) else { return (0, false) };
    let width = statement.column_count();
    let places = vec!["?"; width].join(", ");
    let insert = new.prepare(&format!("INSERT OR IGNORE INTO {name} ({columns}) VALUES ({places})"));
    let (Ok(mut insert), Ok(mut found)) = (insert, statement.query([])) else { return (0, false) };
    let mut taken = 0;
    loop {
        match found.next() {
            Ok(None) => return (taken, true),
            Err(_) => return (taken, false),
            Ok(Some(row)) => {
                let values = (0..width).map(|column| row.get::<_, Value>(column)).collect::<Result<Vec<_>, _>>();
                if let (Ok(true), Ok(values)) = (proof(row), values) {
                    // A row that the new tables refuse is no row of ours.
                    taken += insert.execute(params_from_iter(values)).unwrap_or(0) as u64;
                }
            }
        }
    }
}
