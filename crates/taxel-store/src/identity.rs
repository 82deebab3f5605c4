//! Whether a file is a store of ours, of a version that we know, and whole.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use rusqlite::Connection;

use crate::error::StoreError;
use crate::{beside, open_mark, schema, wal_check};

/// Of our files so much is looked at for what makes them ours: their tables are described at the beginning.
const MARKS_WITHIN: u64 = 1 << 20;
const MARKS: [&[u8]; 2] = [b"CREATE TABLE activations", b"CREATE TABLE model_sets"];

/// Whether it is damage that keeps a file from being opened, and not its owner, its permissions, or that it is not ours.
pub(crate) fn is_damage(error: &StoreError, path: &Path) -> bool {
    match error {
        StoreError::Damaged { .. } => true,
        StoreError::Foreign { .. } => was_ours(path),
        _ => false,
    }
}

/// Whether a file that cannot be opened as a store was one of ours: part of it says so, or what lies beside it.
fn was_ours(path: &Path) -> bool {
    if open_mark::is_set(path) || beside::active(path).exists() {
        return true;
    }
    let mut begin = Vec::new();
    // What comes before a sector that cannot be read is enough.
    let _ = File::open(path).and_then(|file| file.take(MARKS_WITHIN).read_to_end(&mut begin));
    MARKS.iter().any(|mark| begin.windows(mark.len()).any(|window| window == *mark))
}

/// Refuses what is not ours or is newer than we are; lets an empty file pass.
pub(crate) fn check_identity(connection: &Connection, path: &Path) -> Result<(), StoreError> {
    let opening = |error: rusqlite::Error| StoreError::opening(path, &error);
    let number = |pragma: &str| connection.pragma_query_value(None, pragma, |row| row.get::<_, i64>(0));
    let (application, version) = (number("application_id").map_err(opening)?, number("user_version").map_err(opening)?);
    let is_empty = is_empty(connection).map_err(opening)?;
    if is_empty && (application, version) == (0, 0) && !was_ours(path) {
        return Ok(());
    }
    let path = path.to_path_buf();
    let tables = tables(connection).map_err(opening)?;
    if is_empty {
        return Err(StoreError::Damaged { path, findings: "it has no tables any more".to_owned() });
    }
    if application != schema::APPLICATION_ID {
        let expected = schema::APPLICATION_ID;
        let reason = format!("its application id is {application:#x}, expected {expected:#x}");
        return Err(StoreError::Foreign { path, reason });
    }
    // A newer version has other tables, too; otherwise it is the number that is wrong.
    if version > schema::VERSION && tables != expected_tables(schema::VERSION).map_err(opening)? {
        return Err(StoreError::TooNew { path, found: version, newest: schema::VERSION });
    }
    if !(1..=schema::VERSION).contains(&version) {
        let findings = format!("its schema version is {version}, which its tables are not of");
        return Err(StoreError::Damaged { path, findings });
    }
    if tables != expected_tables(version).map_err(opening)? {
        let findings = format!("its tables are not those of schema version {version}");
        return Err(StoreError::Damaged { path, findings });
    }
    Ok(())
}

/// Name and definition of every table.
fn tables(connection: &Connection) -> rusqlite::Result<Vec<(String, String)>> {
    let mut statement = connection.prepare("SELECT name, sql FROM sqlite_schema WHERE type = 'table' ORDER BY name")?;
    statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?.collect()
}

/// The tables of a file of this version.
fn expected_tables(version: i64) -> rusqlite::Result<Vec<(String, String)>> {
    let connection = Connection::open_in_memory()?;
    let steps = schema::STEPS.get(..usize::try_from(version).unwrap_or(0)).unwrap_or_default();
    steps.iter().try_for_each(|step| connection.execute_batch(step))?;
    tables(&connection)
}

fn is_empty(connection: &Connection) -> rusqlite::Result<bool> {
    connection.query_row("SELECT count(*) = 0 FROM sqlite_schema", [], |row| row.get(0))
}

/// Reads every page once and checks its structure.
pub(crate) fn check_structure(connection: &Connection, path: &Path) -> Result<(), StoreError> {
    match structure_findings(connection).map_err(|error| StoreError::opening(path, &error))? {
        None => Ok(()),
        Some(findings) => Err(StoreError::Damaged { path: path.to_path_buf(), findings }),
    }
}

/// Refuses a log that is that of another database, or of this one at another time: each transaction tells how many pages the
/// database has after it, and the first page, which says so too, is part of each that changes that.
pub(crate) fn check_log(connection: &Connection, path: &Path) -> Result<(), StoreError> {
    let pages = connection.pragma_query_value(None, "page_count", |row| row.get::<_, u32>(0));
    let pages = pages.map_err(|error| StoreError::opening(path, &error))?;
    match wal_check::database_pages(path) {
        Some(by_log) if by_log != pages => {
            let findings = format!("it has {pages} pages, and its log is that of one with {by_log}");
            Err(StoreError::Damaged { path: path.to_path_buf(), findings })
        }
        _ => Ok(()),
    }
}

/// What is wrong with how the pages hang together; `None` if all is well.
pub(crate) fn structure_findings(connection: &Connection) -> rusqlite::Result<Option<String>> {
    let mut findings = Vec::new();
    connection.pragma_query(None, "quick_check", |row| {
        findings.push(row.get::<_, String>(0)?);
        Ok(())
    })?;
    if findings == ["ok"] {
        return Ok(None);
    }
    let more = findings.len().saturating_sub(3);
    findings.truncate(3);
    let mut findings = findings.join("; ").replace('\n', " ");
    if more > 0 {
        findings += &format!("; and {more} more");
    }
    Ok(Some(findings))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A table with so many rows that its description forbids.
    fn forbidden(rows: u64) -> Connection {
        let connection = Connection::open_in_memory().unwrap();
        let fill = "INSERT INTO t VALUES (NULL);".repeat(rows as usize);
        let change = "PRAGMA writable_schema = 1; UPDATE sqlite_schema SET sql = 'CREATE TABLE t (a NOT NULL)';
            PRAGMA writable_schema = RESET;";
        connection.execute_batch(&format!("CREATE TABLE t (a); {fill} {change}")).unwrap();
        connection
    }

    #[test]
    fn what_lies_beside_a_file_says_that_it_was_a_store() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("store.db");
        std::fs::write(&path, [0; 4096]).unwrap();
        assert!(!was_ours(&path));
        for beside in [beside::active(&path), beside::open_mark(&path)] {
            std::fs::write(&beside, []).unwrap();
            assert!(was_ours(&path), "{}", beside.display());
            std::fs::remove_file(beside).unwrap();
        }
    }

    /// Other tables are a newer version's only where the number says so.
    #[test]
    fn a_file_of_other_tables_is_damaged_unless_its_version_is_newer() {
        let connection = Connection::open_in_memory().unwrap();
        schema::STEPS.iter().for_each(|step| connection.execute_batch(step).unwrap());
        connection.pragma_update(None, "application_id", schema::APPLICATION_ID).unwrap();
        connection.execute_batch("CREATE TABLE more (a)").unwrap();
        let found = |version: i64| {
            connection.pragma_update(None, "user_version", version).unwrap();
            check_identity(&connection, Path::new("store.db"))
        };
        assert!(matches!(found(schema::VERSION), Err(StoreError::Damaged { .. })));
        assert!(matches!(found(schema::VERSION + 1), Err(StoreError::TooNew { .. })));
        connection.execute_batch("DROP TABLE more").unwrap();
        assert_eq!(found(schema::VERSION), Ok(()));
        assert!(matches!(found(schema::VERSION + 1), Err(StoreError::Damaged { .. })));
    }

    #[test]
    fn the_first_three_findings_are_told_and_how_many_more_there_are() {
        let one = "NULL value in t.a";
        let found = |rows| structure_findings(&forbidden(rows)).unwrap();
        assert_eq!(found(0), None);
        assert_eq!(found(1).as_deref(), Some(one));
        assert_eq!(found(3), Some([one; 3].join("; ")));
        assert_eq!(found(5), Some(format!("{}; and 2 more", [one; 3].join("; "))));
    }
}
