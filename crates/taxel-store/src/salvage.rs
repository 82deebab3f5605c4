//! What can be read of a damaged database goes into a new one, row by row, each proven; the damaged one is kept as it is
//! under another name.

use std::fs::{self, File};
use std::io;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use rusqlite::config::DbConfig;
use rusqlite::types::Value;
use rusqlite::{Connection, ErrorCode, Row, params_from_iter};
use taxel_engine::record::Sample;

use crate::beside;
use crate::board_zeros;
use crate::error::{Quarantined, StoreError, is_of_reading};
use crate::identity::{check_identity, check_structure};
use crate::in_place;
use crate::open_mark;
use crate::prepare::use_log;
use crate::rows;
use crate::schema;

/// Pages of our files: SQLite's default.
const PAGE_BYTES: usize = 4096;
/// The part of the first page that describes the file.
const HEADER_BYTES: usize = 100;
/// What a page that points to others has where the header ends.
const INTERIOR_PAGE: u8 = 5;
/// Where the header says how many pages there are, and which of them are free. Zeros mean as many as the file has, and
/// none.
const PAGES_AND_FREE: std::ops::Range<usize> = 28..40;

/// What came of a damaged database.
pub(crate) struct Salvaged {
    /// Where it is kept.
    pub(crate) aside: PathBuf,
    /// Rows of it that were taken over.
    pub(crate) rows: u64,
}

/// Puts a new database with what can be read in the place of a damaged one.
///
/// The damaged one keeps its bytes: it is only read. The new one gets its place in one step, once it is whole. Where there is
/// no room to read or to write all that can be read, everything stays as it is, and a later start can do better.
pub(crate) fn salvage(path: &Path) -> Result<Salvaged, String> {
    let at = |what: &'static str| move |error: io::Error| format!("{what}: {error}");
    let (part, copy) = (beside::beside(path, beside::SUCCESSOR_PART), beside::beside(path, beside::COPY));
    for left_over in [&part, &copy] {
        remove_with_log(left_over).map_err(at("what an earlier attempt left"))?;
    }
    beside::make_private(&part);
    if let Ok(made) = File::open(&part) {
        beside::give_to_owner_of(path, &made);
    }
    let mut new = Connection::open(&part).map_err(|error| error.to_string())?;
    let taken = fill(&mut new, path, &copy).map_err(|error| format!("taking over what can be read: {error}"));
    let closed = new.close().map_err(|(_, error)| error.to_string());
    remove_with_log(&copy).map_err(at("the copy"))?;
    let rows = taken.and_then(|rows| closed.map(|()| rows)).inspect_err(|_| drop(remove_with_log(&part)))?;
    let flushed = File::open(&part).and_then(|file| file.sync_all()).map_err(at("the new store"));
    let kept = flushed.and_then(|()| beside::keep_aside(path).map_err(at("the damaged store cannot be kept")));
    let aside = kept.inspect_err(|_| drop(remove_with_log(&part)))?;
    fs::rename(&part, beside::successor(path)).map_err(at("the new store"))?;
    beside::sync_folder(path).map_err(at("the new store"))?;
    take_its_place(path).map_err(at("the new store"))?;
    Ok(Salvaged { aside, rows })
}

/// Ends what an earlier start was stopped in: a new database that is whole gets its place. Anything else that has its name is
/// put aside: what there is to tell of that.
pub(crate) fn succeed(path: &Path) -> io::Result<Option<Quarantined>> {
    let new = beside::successor(path);
    if new.symlink_metadata().is_err() {
        return Ok(None);
    }
    if let Err(why) = is_made_of(path, &new)? {
        let aside = beside::put_aside(path, beside::SUCCESSOR)?;
        let reason = format!(
            "it did not come of this store, which stays in its place: {why}; it is kept as {}",
            aside.display()
        );
        return Ok(Some(Quarantined::lost(new.display().to_string(), reason)));
    }
    take_its_place(path).map(|()| None)
}

/// The log belongs to the damaged database, and is kept with it; so does the mark.
fn take_its_place(path: &Path) -> io::Result<()> {
    open_mark::clear(path)?;
    beside::remove(&beside::wal(path))?;
    fs::rename(beside::successor(path), path)?;
    beside::sync_folder(path)
}

/// Whether a file is a whole store and this database was found damaged, or why not. One that was found damaged has a second
/// name before there is a new one, and loses its first when that takes its place.
fn is_made_of(database: &Path, new: &Path) -> io::Result<Result<(), String>> {
    if !fs::metadata(new).is_ok_and(|found| found.is_file() && found.len() > 0) {
        return Ok(Err("it is empty or no regular file".to_owned()));
    }
    if !beside::is_kept_aside(database) {
        return Ok(Err("no damaged store is being put right".to_owned()));
    }
    let whole =
        in_place::open(new).and_then(|store| check_identity(&store, new).and_then(|()| check_structure(&store, new)));
    match whole {
        Ok(()) => Ok(Ok(())),
        // The machine's fault, which says nothing of the file.
        Err(error @ (StoreError::Open { .. } | StoreError::Io(_) | StoreError::Full(_))) => {
            Err(io::Error::other(error.to_string()))
        }
        Err(error) => Ok(Err(error.to_string())),
    }
}

fn remove_with_log(path: &Path) -> io::Result<()> {
    for suffix in ["", "-wal", "-shm", "-journal"] {
        beside::remove(&beside::beside(path, suffix))?;
    }
    Ok(())
}

/// Makes the tables and fills them from one reading of the damaged file after another, until one meets no damage. What
/// a file says of itself can be wrong while its content is whole, so that the others take it from the new one: the header,
/// the first page, all pages that describe tables.
///
/// Each reads a copy, whose unreadable sectors are zeros; without room for one, the file itself is read as it is.
fn fill(new: &mut Connection, damaged: &Path, copy: &Path) -> Result<u64, String> {
    let words = |error: rusqlite::Error| error.to_string();
    let table_pages = make_tables(new).map_err(words)?;
    let first_page = table_pages.first().map(|(_, page)| page.clone()).unwrap_or_default();
    let beginning = |bytes: usize| first_page.get(..bytes).map(|part| (0, part.to_vec()));
    let header = Vec::from_iter(beginning(HEADER_BYTES));
    let first = Vec::from_iter(beginning(PAGE_BYTES));
    let mut rows = 0;
    for replaced in [Vec::new(), header, first, table_pages] {
        let as_it_is = replaced.is_empty();
        let copied = remove_with_log(copy).and_then(|()| copy_of(damaged, copy, replaced));
        let old = match copied {
            Ok(()) => open_copy(copy).map_err(words),
            Err(error) if as_it_is => {
                tracing::warn!(%error, "there is no copy of the damaged store: it is read as it is");
                in_place::open(damaged).map_err(|error| error.to_string())
            }
            Err(error) => return Err(format!("a copy of it: {error}")),
        };
        let transaction = new.transaction().map_err(words)?;
        let (taken, whole) = take_all(&old?, &transaction).map_err(words)?;
        transaction.commit().map_err(words)?;
        rows += taken;
        if whole {
            break;
        }
    }
    // Nothing is left to be changed once it has its place: the start that follows may find no room for that.
    let part = new.path().map(PathBuf::from).unwrap_or_default();
    use_log(new, &part).map_err(|error| error.to_string())?;
    Ok(rows)
}

/// Makes all tables in a new database, and gives the pages that describe them.
fn make_tables(new: &mut Connection) -> rusqlite::Result<Vec<Part>> {
    new.pragma_update_and_check(None, "locking_mode", "exclusive", |_| Ok(()))?;
    new.pragma_update(None, "foreign_keys", false)?;
    new.pragma_update(None, "synchronous", "off")?; // nothing counts before it is whole and flushed
    let transaction = new.transaction()?;
    transaction.pragma_update(None, "application_id", schema::APPLICATION_ID)?;
    transaction.pragma_update(None, "user_version", schema::VERSION)?;
    schema::STEPS.iter().try_for_each(|step| transaction.execute_batch(step))?;
    transaction.commit()?;
    Ok(new.path().and_then(|path| table_pages(Path::new(path)).ok()).unwrap_or_default())
}

/// Bytes of a file, and where they begin.
type Part = (u64, Vec<u8>);

/// The pages of a new database that describe its tables: the first one, and those that it points to. A file that was made
/// by the same version has them in the same places.
fn table_pages(path: &Path) -> io::Result<Vec<Part>> {
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
fn copy_of(damaged: &Path, copy: &Path, replaced: Vec<Part>) -> io::Result<()> {
    let mut file = File::create(copy)?;
    beside::copy_readable(damaged, &mut file)?;
    if beside::wal(damaged).exists() {
        beside::copy_readable(&beside::wal(damaged), &mut File::create(beside::wal(copy))?)?;
    }
    for (at, mut part) in replaced {
        if at == 0 {
            part[PAGES_AND_FREE].fill(0); // whatever is free is not read
        }
        file.write_all_at(&part, at)?;
    }
    Ok(())
}

fn open_copy(copy: &Path) -> rusqlite::Result<Connection> {
    let old = Connection::open(copy)?;
    old.set_db_config(DbConfig::SQLITE_DBCONFIG_DEFENSIVE, true)?;
    old.pragma_update(None, "trusted_schema", false)?;
    Ok(old)
}

/// Takes every proven row that the new database lacks: how many, and whether all could be read. Errors are those of the
/// machine, by which nothing is known of the damaged file; what the file is to blame for is left out.
fn take_all(old: &Connection, new: &Connection) -> rusqlite::Result<(u64, bool)> {
    let (mut rows, mut whole) = (0, true);
    for table in &TABLES {
        // From both ends, because reading ends at the first page that is damaged.
        for direction in ["ASC", "DESC"] {
            let (taken, read_all) = take(table, direction, old, new)?;
            rows += taken;
            if read_all {
                break;
            }
            whole = false;
        }
    }
    Ok((rows, whole))
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

/// The columns of zero_doubts that files of earlier versions lack.
const SINCE_VERSION_8: &str = ", hidden, reads";

/// All tables, with the columns in the order in which the proof takes them.
const TABLES: [Table; 13] = [
    table("sessions", "number", "number, view, checksum", |row| {
        Ok(row.get::<_, Vec<u8>>(2)? == rows::view_checksum(row.get(0)?, &row.get::<_, String>(1)?))
    }),
    table("ramps", "session {}, ramp", "session, ramp, baseline, checksum", |row| {
        Ok(row.get::<_, Vec<u8>>(3)? == rows::ramp_checksum(row.get(0)?, row.get(1)?, &row.get::<_, Vec<u8>>(2)?))
    }),
    table("samples", "session {}, idx", "session, idx, ramp, time_ns, pressure_kpa, counts, checksum", |row| {
        let (ramp, time_ns, pressure_kpa) = (row.get(2)?, row.get(3)?, row.get(4)?);
        let sample = Sample { ramp, time_ns, pressure_kpa, counts: Vec::new().into() };
        let (counts, found): (Vec<u8>, Vec<u8>) = (row.get(5)?, row.get(6)?);
        Ok(rows::with_counts(row.get(0)?, row.get(1)?, sample, counts, &found).is_some())
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
    table("zero_doubts", "seq", "seq, patch, why, wall_ns, checksum, hidden, reads", |row| {
        let (patch, why): (String, String) = (row.get(1)?, row.get(2)?);
        let (found, blobs): (Vec<u8>, _) = (row.get(4)?, board_zeros::blobs(row)?);
        Ok(found == rows::board_zeros_checksum(row.get(0)?, &patch, &why, row.get(3)?, blobs.as_ref()))
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

/// Whether the machine is to blame for an error, and not the content of a file.
fn is_of_the_machine(error: &rusqlite::Error) -> bool {
    use ErrorCode::{CannotOpen, DatabaseBusy, DiskFull, OutOfMemory, PermissionDenied, ReadOnly};
    let of_the_machine = [CannotOpen, DatabaseBusy, DiskFull, OutOfMemory, PermissionDenied, ReadOnly];
    match error.sqlite_error_code() {
        Some(ErrorCode::SystemIoFailure) => !is_of_reading(error),
        code => code.is_some_and(|code| of_the_machine.contains(&code)),
    }
}

/// Takes the proven rows of a table: how many are new, and whether the last one was read.
fn take(table: &Table, direction: &str, old: &Connection, new: &Connection) -> rusqlite::Result<(u64, bool)> {
    let Table { name, columns, key, proof } = table;
    let key = key.replace("{}", direction);
    let query = |columns: &str| format!("SELECT {columns} FROM {name} ORDER BY {key} {direction}");
    let not_read = |error, taken| if is_of_the_machine(&error) { Err(error) } else { Ok((taken, false)) };
    let of_earlier = columns.replace(SINCE_VERSION_8, ", NULL, NULL");
    let mut statement = match old.prepare(&query(columns)).or_else(|_| old.prepare(&query(&of_earlier))) {
        Ok(statement) => statement,
        Err(error) => return not_read(error, 0),
    };
    let width = statement.column_count();
    let places = vec!["?"; width].join(", ");
    let mut insert = new.prepare(&format!("INSERT OR IGNORE INTO {name} ({columns}) VALUES ({places})"))?;
    let mut found = statement.query([])?;
    let mut taken = 0;
    loop {
        match found.next() {
            Ok(None) => return Ok((taken, true)),
            Err(error) => return not_read(error, taken),
            Ok(Some(row)) => {
                let values = (0..width).map(|column| row.get::<_, Value>(column)).collect::<Result<Vec<_>, _>>();
                if let (Ok(true), Ok(values)) = (proof(row), values) {
                    taken += match insert.execute(params_from_iter(values)) {
                        Ok(inserted) => inserted as u64,
                        // A row that the new tables refuse is no row of ours.
                        Err(error) if error.sqlite_error_code() == Some(ErrorCode::ConstraintViolation) => 0,
                        Err(error) => return Err(error),
                    };
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
