//! Files that an earlier version wrote.

use std::path::Path;
use std::sync::Arc;

use rusqlite::{Connection, params};
use taxel_engine::loads::Load;
use taxel_engine::record::Record;

use super::board_zeros::{WHY, doubt, doubts};
use super::fixture::*;
use crate::db::Db;
use crate::rows;
use crate::salvage::salvage;
use crate::schema;

/// The version from which on the store knows what is held against the boards' zeros.
const WITH_DOUBTS: usize = 6;

/// The tables of each version that hold rows.
const TABLES: [&[&str]; 6] = [
    &["sessions", "samples", "model_sets", "activations", "tares", "tally"],
    &["loads"],
    &["deleted_sessions", "deleted_model_sets"],
    &["audit", "audit_results"],
    &["set_index"],
    &["zero_doubts"],
];

/// A store as `version` wrote it, with what [`filled`] has.
pub fn written_by(version: usize, path: &Path) -> [taxel_engine::model_set::ModelSet; 2] {
    let newer = path.with_extension("newer");
    let sets = filled(&newer);
    if version >= WITH_DOUBTS {
        let (store, ..) = open(&newer);
        write(&store, vec![doubt(PATCH, Some(WHY))]).unwrap();
        store.close().unwrap();
    }
    let old = Connection::open(path).unwrap();
    old.execute_batch("PRAGMA journal_mode = wal").unwrap();
    schema::STEPS[..version].iter().for_each(|step| old.execute_batch(step).unwrap());
    old.pragma_update(None, "application_id", schema::APPLICATION_ID).unwrap();
    old.pragma_update(None, "user_version", version as i64).unwrap();
    old.execute("ATTACH ?1 AS newer", [newer.to_str().unwrap()]).unwrap();
    for table in TABLES.iter().take(version).copied().flatten() {
        let columns = columns_of(&old, table);
        old.execute(&format!("INSERT INTO {table} ({columns}) SELECT {columns} FROM newer.{table}"), []).unwrap();
    }
    ramps_without_a_zero_of_the_gauge(&old);
    sets
}

/// Those that a table had then.
fn columns_of(old: &Connection, table: &str) -> String {
    let mut statement = old.prepare("SELECT name FROM pragma_table_info(?1, 'main')").unwrap();
    let names: Vec<String> = statement.query_map([table], |row| row.get(0)).unwrap().map(Result::unwrap).collect();
    names.join(", ")
}

/// Until version 7 a ramp had the zero of its taxels alone.
fn ramps_without_a_zero_of_the_gauge(old: &Connection) {
    let mut statement = old.prepare("SELECT session, ramp, baseline FROM newer.ramps").unwrap();
    let mut found = statement.query([]).unwrap();
    while let Some(row) = found.next().unwrap() {
        let (session, ramp, blob): (u64, u16, Vec<u8>) =
            (row.get(0).unwrap(), row.get(1).unwrap(), row.get(2).unwrap());
        let baseline = rows::baseline_to_blob(&rows::ramp_from_blob(ramp, &blob).unwrap().taxels);
        assert_eq!(baseline.len() + 8, blob.len());
        let row = params![session, ramp, baseline, rows::ramp_checksum(session, ramp, &baseline)];
        old.execute("INSERT INTO ramps (session, ramp, baseline, checksum) VALUES (?1, ?2, ?3, ?4)", row).unwrap();
    }
}

fn schema_of(path: &Path) -> Vec<String> {
    let connection = Connection::open(path).unwrap();
    let mut statement =
        connection.prepare("SELECT sql FROM sqlite_schema WHERE sql IS NOT NULL ORDER BY name").unwrap();
    statement.query_map([], |row| row.get(0)).unwrap().map(Result::unwrap).collect()
}

#[test]
fn a_file_of_every_earlier_version_keeps_all_it_has_and_takes_what_is_new() {
    for version in 1..schema::STEPS.len() {
        let dir = tempfile::tempdir().unwrap();
        let (path, fresh) = (dir.path().join("store.db"), dir.path().join("fresh.db"));
        let sets = written_by(version, &path);
        filled(&fresh);
        let (store, restored, quarantined, _events) = open(&path);
        assert_eq!(quarantined, [], "version {version}");
        assert_eq!(restored.active, [(PATCH.to_owned(), sets[1].id.clone())]);
        assert_eq!((restored.model_sets.len(), restored.sessions.len(), restored.next_session), (2, 2, 3));
        assert_eq!(doubts(&restored).len(), usize::from(version >= WITH_DOUBTS), "version {version}");
        let samples = samples_of(&store, 2).unwrap();
        assert_eq!((samples.samples.len(), samples.ramps[0].gauge_kpa), (40, None));
        assert_eq!((restored.loads.len(), restored.next_load), (0, 1));
        let load = Load { number: 1, patch: PATCH.to_owned(), force_n: 1.0, ..Load::default() };
        write(&store, vec![Record::Load(Arc::new(load))]).unwrap();
        write(&store, vec![Record::SessionDeleted { session: 2, wall_ns: 5 }]).unwrap();
        store.close().unwrap();
        assert_eq!(schema_of(&path), schema_of(&fresh), "version {version}");
        let connection = Connection::open(&path).unwrap();
        let found: i64 = connection.pragma_query_value(None, "user_version", |row| row.get(0)).unwrap();
        drop(connection);
        assert_eq!(found, schema::VERSION);
        let (_, restored, quarantined) = Db::open(&path).unwrap();
        assert_eq!(quarantined, [], "version {version}");
        assert_eq!((restored.loads.len(), restored.sessions.len(), restored.next_session), (1, 1, 3));
    }
}

#[test]
fn a_damaged_file_of_an_earlier_version_keeps_what_is_held_against_the_boards() {
    for version in WITH_DOUBTS..=schema::STEPS.len() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("store.db");
        written_by(version, &path);
        salvage(&path).unwrap();
        let (_, restored, _) = Db::open(&path).unwrap();
        assert_eq!(doubts(&restored), [(PATCH.to_owned(), WHY.to_owned())], "version {version}");
        assert_eq!((restored.sessions.len(), restored.model_sets.len()), (2, 2), "version {version}");
    }
}
