//! Known loads on disk, and files that are older than they are.

use std::sync::Arc;

use rusqlite::Connection;
use taxel_engine::loads::{Load, Reading};
use taxel_engine::record::Record;

use super::fixture::*;
use crate::db::Db;
use crate::schema;

fn load(number: u64) -> Load {
    let read = Reading {
        scans: 20,
        mean_n: 1.7 * number as f64 / 3.0,
        scatter_n: 0.01,
        sigma_n: 0.1,
        reasons: vec!["3 taxels have a fault".to_owned()],
        ..Reading::default()
    };
    Load {
        number,
        patch: PATCH.to_owned(),
        note: "on the wrist".to_owned(),
        force_n: number as f64 / 1.7,
        read,
        area_factor: 1.0,
        ..Load::default()
    }
}

pub fn record(number: u64) -> Record {
    Record::Load(Arc::new(load(number)))
}

#[test]
fn loads_come_back_and_their_numbers_go_on() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let (store, restored, ..) = open(&path);
    assert_eq!((restored.loads.len(), restored.next_load), (0, 1));
    write(&store, vec![record(1), record(2)]).unwrap();
    write(&store, vec![record(3)]).unwrap();
    store.close().unwrap();
    let (_, restored, quarantined) = Db::open(&path).unwrap();
    assert_eq!(quarantined, []);
    assert_eq!(restored.next_load, 4);
    assert_eq!(restored.loads.iter().map(|l| Load::clone(l)).collect::<Vec<_>>(), [load(1), load(2), load(3)]);
}

#[test]
fn damaged_and_missing_loads_are_reported_and_not_believed() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let (store, ..) = open(&path);
    write(&store, vec![record(1), record(2), record(3)]).unwrap();
    store.close().unwrap();
    let other = Connection::open(&path).unwrap();
    for statement in ["DELETE FROM loads", "UPDATE loads SET load = '{}'"] {
        let refused = other.execute(statement, []).unwrap_err().to_string();
        assert!(refused.contains("append-only"), "{statement}: {refused}");
    }
    let damage = "DROP TRIGGER loads_keep; UPDATE loads SET load = replace(load, 'wrist', 'elbow') WHERE number = 2;
                  DROP TRIGGER loads_stay; DELETE FROM loads WHERE number = 1";
    other.execute_batch(damage).unwrap();
    drop(other);
    let (_, restored, quarantined) = Db::open(&path).unwrap();
    assert_eq!(restored.loads.iter().map(|l| l.number).collect::<Vec<_>>(), [3]);
    assert_eq!(restored.next_load, 4);
    let text = format!("{quarantined:?}");
    assert!(text.contains("load 2") && text.contains("3 were written, 2 are there"), "{text}");
}

#[test]
fn a_load_with_a_figure_that_is_no_number_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let (store, ..) = open(&dir.path().join("store.db"));
    let broken = Load { force_n: f64::NAN, ..load(1) };
    let refused = write(&store, vec![Record::Load(Arc::new(broken))]).unwrap_err().to_string();
    assert!(refused.contains("load 1"), "{refused}");
}

#[test]
fn the_first_step_alone_is_what_version_1_wrote() {
    let connection = Connection::open_in_memory().unwrap();
    connection.execute_batch(schema::STEPS[0]).unwrap();
    let tables: i64 =
        connection.query_row("SELECT count(*) FROM sqlite_schema WHERE type = 'table'", [], |r| r.get(0)).unwrap();
    assert_eq!(tables, 7, "sessions, ramps, samples, model_sets, activations, tares, tally");
}
