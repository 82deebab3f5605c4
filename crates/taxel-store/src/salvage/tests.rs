//! The parts of salvaging that whole damaged stores do not show.

use rusqlite::ffi;

use super::*;
use crate::tests::fixture::filled;

fn number(connection: &Connection, query: &str) -> u64 {
    connection.query_row(query, [], |row| row.get(0)).unwrap()
}

fn rows_of(connection: &Connection) -> u64 {
    TABLES.iter().map(|table| number(connection, &format!("SELECT count(*) FROM {}", table.name))).sum()
}

/// A store with rows in it, and where a new one and the copy will be.
fn scene() -> (tempfile::TempDir, [PathBuf; 3]) {
    let dir = tempfile::tempdir().unwrap();
    let paths = ["store.db", "new.db", "copy.db"].map(|name| dir.path().join(name));
    filled(&paths[0]);
    (dir, paths)
}

/// Puts other bytes into the middle of a page that holds samples.
fn damage(path: &Path) {
    let page = "SELECT pageno FROM dbstat WHERE name = 'samples' AND pagetype = 'leaf' LIMIT 1";
    let page = number(&Connection::open(path).unwrap(), page);
    let file = File::options().write(true).open(path).unwrap();
    file.write_all_at(&[0xFF; PAGE_BYTES], (page - 1) * PAGE_BYTES as u64).unwrap();
}

#[test]
fn every_row_is_taken_over_once_and_counted() {
    let (_dir, [damaged, new, copy]) = scene();
    let rows = rows_of(&Connection::open(&damaged).unwrap());
    let mut made = Connection::open(&new).unwrap();
    assert_eq!(fill(&mut made, &damaged, &copy), Ok(rows));
    assert_eq!(rows_of(&made), rows);
    assert!(rows > 40, "{rows}");
}

#[test]
fn what_is_told_of_a_salvaged_store_is_how_many_rows_there_are() {
    let (_dir, [path, ..]) = scene();
    damage(&path);
    let salvaged = salvage(&path).unwrap();
    let rows = rows_of(&Connection::open(&path).unwrap());
    assert_eq!(salvaged.rows, rows);
    assert!(rows > 5 && salvaged.aside.exists(), "{rows}");
}

/// Without room for a copy the file itself is read. What its header says cannot be replaced there.
#[test]
fn without_a_copy_the_file_is_read_as_it_is() {
    let (_dir, [damaged, new, copy]) = scene();
    std::fs::create_dir_all(copy.join("in the way")).unwrap();
    let mut made = Connection::open(&new).unwrap();
    let rows = rows_of(&Connection::open(&damaged).unwrap());
    assert_eq!(fill(&mut made, &damaged, &copy), Ok(rows));

    let (_dir, [damaged, new, copy]) = scene();
    std::fs::create_dir_all(copy.join("in the way")).unwrap();
    damage(&damaged);
    let refused = fill(&mut Connection::open(&new).unwrap(), &damaged, &copy).unwrap_err();
    assert!(refused.starts_with("a copy of it: "), "{refused}");
}

/// SQLite itself tells where its description of the tables lies: of ours, and of so many that it takes more pages.
#[test]
fn the_pages_that_describe_tables_are_found() {
    for more in [0, 100, 300] {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("new.db");
        let mut new = Connection::open(&path).unwrap();
        let made = make_tables(&mut new).unwrap();
        (0..more).for_each(|table| new.execute_batch(&format!("CREATE TABLE more_{table} (a, b)")).unwrap());
        let found = if more == 0 { made } else { table_pages(&path).unwrap() };
        let mut statement =
            new.prepare("SELECT pageno FROM dbstat WHERE name = 'sqlite_schema' ORDER BY pageno").unwrap();
        let pages = statement.query_map([], |row| row.get::<_, u64>(0)).unwrap();
        let expected: Vec<u64> = pages.map(|page| (page.unwrap() - 1) * PAGE_BYTES as u64).collect();
        assert_eq!(found.iter().map(|(at, _)| *at).collect::<Vec<_>>(), expected);
        let least = 2 + more / 100;
        assert!(expected.len() > least, "the first page alone would not tell one rule from another: {expected:?}");
        let file = std::fs::read(&path).unwrap();
        assert!(found.iter().all(|(at, page)| file[*at as usize..][..PAGE_BYTES] == *page));
    }
}

/// A disk that is full, or a file that cannot be opened, says nothing of what the file holds: a later start does better.
#[test]
fn faults_of_the_machine_are_not_those_of_the_file() {
    let error = |code| rusqlite::Error::SqliteFailure(ffi::Error::new(code), None);
    for code in [
        ffi::SQLITE_FULL,
        ffi::SQLITE_CANTOPEN,
        ffi::SQLITE_BUSY,
        ffi::SQLITE_NOMEM,
        ffi::SQLITE_PERM,
        ffi::SQLITE_READONLY,
        ffi::SQLITE_IOERR_WRITE,
        ffi::SQLITE_IOERR_LOCK,
    ] {
        assert!(is_of_the_machine(&error(code)), "{code}");
    }
    for code in [ffi::SQLITE_CORRUPT, ffi::SQLITE_NOTADB, ffi::SQLITE_IOERR_READ, ffi::SQLITE_IOERR_SHORT_READ] {
        assert!(!is_of_the_machine(&error(code)), "{code}");
    }
    assert!(!is_of_the_machine(&rusqlite::Error::InvalidQuery));
}

#[test]
fn a_row_that_the_new_tables_refuse_is_left_out_and_a_store_that_takes_nothing_is_no_store() {
    let (_dir, [damaged, new, _]) = scene();
    let old = Connection::open(&damaged).unwrap();
    let mut made = Connection::open(&new).unwrap();
    make_tables(&mut made).unwrap();
    let refuses = "CREATE TRIGGER refuses BEFORE INSERT ON samples WHEN NEW.idx = 1
        BEGIN SELECT RAISE(ABORT, 'not this one'); END";
    made.execute_batch(refuses).unwrap();
    let samples = TABLES.iter().find(|table| table.name == "samples").unwrap();
    let refused = number(&old, "SELECT count(*) FROM samples WHERE idx = 1");
    let rows = number(&old, "SELECT count(*) FROM samples");
    assert!(refused > 0);
    assert_eq!(take(samples, "ASC", &old, &made), Ok((rows - refused, true)));
    made.pragma_update(None, "query_only", true).unwrap();
    let error = take(samples, "ASC", &old, &made).unwrap_err();
    assert_eq!(error.sqlite_error_code(), Some(ErrorCode::ReadOnly), "{error}");
}
