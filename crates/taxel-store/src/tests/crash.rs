//! What was acknowledged is on disk, and what was deleted is not: a process is killed at any moment, 50 and 30 times on
//! one file.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;

use taxel_engine::calibration::SessionState;
use taxel_engine::record::{Record, Sample};

use super::fixture::*;
use crate::{Batch, Store, StoreEvent};

/// Kills of the first test unless the environment says otherwise: `TAXEL_STORE_KILLS=1000 cargo test -p taxel-store crash`.
const KILLS: u64 = 50;
const CHILD: &str = "TAXEL_STORE_CRASH_CHILD";
const AUDITING_CHILD: &str = "TAXEL_STORE_AUDITING_CHILD";
const DELETING_CHILD: &str = "TAXEL_STORE_DELETING_CHILD";

/// One line to the parent; the test harness must not hold it back.
pub fn say(line: &str) {
    // The parent kills this process when it has read enough: a closed pipe is no fault.
    let _ = std::io::stdout().write_all(format!("\n{line}\n").as_bytes());
}

/// A batch that says its name when it is acknowledged; waits while the queue is full.
fn submit(store: &Store, records: Vec<Record>, name: Option<String>) {
    let on_durable = name.map(|name| -> crate::OnDurable {
        Box::new(move |outcome| {
            outcome.unwrap();
            say(&name);
        })
    });
    let mut batch = Batch { records, on_durable };
    while let Err(full) = store.submit(batch) {
        batch = full.batch;
        std::thread::yield_now();
    }
}

/// The counts of a sample that bear the number of its session.
fn signed(session: u64, index: u64) -> Record {
    let counts = format!("<<session-{session:06}>>").into_bytes();
    Record::Sample { session, index, sample: Sample { counts: counts.into(), ..sample(index) } }
}

/// Runs in the child: makes sessions and model sets for ever, and deletes each as soon as the next is there.
#[test]
fn deleting_child() {
    let Ok(path) = std::env::var(DELETING_CHILD) else { return };
    let (store, restored, _) = Store::open(Path::new(&path), Box::new(|_| ())).unwrap();
    let mut before = restored.sessions.last().map(|view| view.number);
    let mut old_set = restored.model_sets.last().map(|set| set.id.clone());
    for number in restored.next_session.. {
        let mut records = vec![session(number, SessionState::Review), ramp(number, 0)];
        records.extend((0..50).map(|index| signed(number, index)));
        let set = model_set(number as i64);
        records.push(Record::ModelSet(Arc::new(set.clone())));
        submit(&store, records, Some(format!("made {number} {}", set.id)));
        if let Some((session, model_set)) = before.zip(old_set) {
            let said = format!("deleted {session} {model_set}");
            let records =
                vec![Record::SessionDeleted { session, wall_ns: 0 }, Record::ModelSetDeleted { model_set, wall_ns: 0 }];
            submit(&store, records, Some(said));
        }
        (before, old_set) = (Some(number), Some(set.id));
    }
}

#[test]
fn what_was_deleted_stays_deleted_through_thirty_kills() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let (mut made, mut deleted) = (BTreeMap::new(), BTreeMap::new());
    for cycle in 0..30 {
        for line in lines_until_killed("tests::crash::deleting_child", DELETING_CHILD, &path, 1 + cycle * 7 % 20) {
            let words: Vec<_> = line.split(' ').collect();
            match words[..] {
                ["made", number, id] => made.insert(number.parse::<u64>().unwrap(), id.to_owned()),
                ["deleted", number, id] => deleted.insert(number.parse::<u64>().unwrap(), id.to_owned()),
                _ => None, // the test harness talks, too
            };
        }
        let (store, restored, quarantined, _events) = open(&path);
        assert_eq!(quarantined, [], "cycle {cycle}");
        // A kill between making the next one and deleting the one before leaves one behind.
        assert!(restored.sessions.len() <= cycle + 2, "cycle {cycle}: {} sessions", restored.sessions.len());
        let bytes = std::fs::read(&path).unwrap();
        for (number, id) in &made {
            let session = restored.sessions.iter().any(|view| view.number == *number);
            let set = restored.model_sets.iter().any(|set| set.id == *id);
            assert_eq!(session, set, "cycle {cycle}: session {number} and {id} went together or not at all");
            assert!(!session || !deleted.contains_key(number), "cycle {cycle}: session {number} is back");
            let text = format!("<<session-{number:06}>>");
            let on_disk = bytes.windows(text.len()).any(|window| window == text.as_bytes());
            assert_eq!(on_disk, session, "cycle {cycle}: the samples of session {number}");
        }
        let newest = made.keys().last().copied().unwrap_or(0);
        assert!(restored.next_session > newest, "cycle {cycle}: no number is used again");
        if let Some(number) = made.keys().last() {
            let there = restored.sessions.iter().any(|view| view.number >= *number);
            assert!(there, "cycle {cycle}: session {number} is lost");
        }
        store.close().unwrap();
    }
    assert!(deleted.len() > 30, "the children got somewhere: {} deletions", deleted.len());
}

/// Starts this programme as a child that runs one test, reads so many lines of it, kills it, and gives all lines.
fn lines_until_killed(test: &str, variable: &str, path: &Path, lines_read: usize) -> Vec<String> {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", test, "--nocapture"])
        .env(variable, path)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap());
    let mut read = Vec::new();
    for _ in 0..lines_read {
        let mut line = String::new();
        lines.read_line(&mut line).unwrap();
        read.push(line.trim_end().to_owned());
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let mut rest = String::new();
    lines.read_to_string(&mut rest).unwrap();
    // A last line without its end may be torn.
    read.extend(rest.lines().filter(|_| rest.ends_with('\n')).map(str::to_owned));
    read
}

/// Runs in the child: goes on with the session for ever, with a model set made and activated now and then.
#[test]
fn child() {
    let Ok(path) = std::env::var(CHILD) else { return };
    let notify = Box::new(|event| match event {
        StoreEvent::Durable { samples, .. } => say(&format!("durable {samples}")),
        StoreEvent::Failed(why) => panic!("{why}"),
        StoreEvent::Damaged(damage) => panic!("{damage:?}"),
    });
    let (store, restored, _) = Store::open(Path::new(&path), notify).unwrap();
    let known = restored.sessions.first().map_or(0, |session| session.accepted);
    submit(&store, vec![session(1, SessionState::Ramping)], None);
    for index in known.. {
        let name = index.is_multiple_of(3).then(|| format!("sample {index}"));
        submit(&store, vec![sample_record(1, index)], name);
        if index.is_multiple_of(40) {
            let set = model_set(index as i64);
            let records = vec![Record::ModelSet(Arc::new(set.clone())), activated(&set)];
            submit(&store, records, Some(format!("set {index} {}", set.id)));
        }
    }
}

/// What a child was told before it died.
#[derive(Default)]
struct Acknowledged {
    samples: u64,
    sets: Vec<(u64, String)>,
}

impl Acknowledged {
    fn note(&mut self, line: &str) {
        let words: Vec<_> = line.split(' ').collect();
        match words[..] {
            ["sample", index] => self.samples = self.samples.max(index.parse::<u64>().unwrap() + 1),
            ["durable", samples] => self.samples = self.samples.max(samples.parse().unwrap()),
            ["set", index, id] => self.sets.push((index.parse().unwrap(), id.to_owned())),
            _ => {} // the test harness talks, too
        }
    }
}

#[test]
fn what_was_acknowledged_survives_fifty_kills() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let mut told = Acknowledged::default();
    let kills = std::env::var("TAXEL_STORE_KILLS").ok().and_then(|kills| kills.parse().ok()).unwrap_or(KILLS);
    for cycle in 0..kills {
        // Not the same place twice: how many lines are read before the kill wanders from 1 to 40.
        let lines = lines_until_killed("tests::crash::child", CHILD, &path, 1 + cycle as usize * 17 % 40);
        lines.iter().for_each(|line| told.note(line));

        let (store, restored, quarantined, _events) = open(&path);
        assert_eq!(quarantined, [], "cycle {cycle}");
        for (_, id) in &told.sets {
            assert!(restored.model_sets.iter().any(|set| set.id == *id), "cycle {cycle}: {id} is lost");
        }
        if let Some((newest, _)) = told.sets.last() {
            let active = &restored.active[0].1;
            let active = restored.model_sets.iter().find(|set| set.id == *active).unwrap();
            assert!(active.created_wall_ns >= *newest as i64, "cycle {cycle}: an older set is active");
        }
        let stored = restored.sessions.first().map_or(0, |session| session.accepted);
        assert!(stored >= told.samples, "cycle {cycle}: {} samples acknowledged, {stored} there", told.samples);
        if let Some(found) = restored.sessions.first() {
            assert_eq!(found.state, SessionState::Interrupted);
            let samples = samples_of(&store, 1).unwrap().samples;
            assert!(samples.iter().cloned().eq((0..stored).map(sample)), "cycle {cycle}");
        }
        store.close().unwrap();
    }
    assert!(told.samples > kills && told.sets.len() > 5, "the children got somewhere: {} samples", told.samples);
}

/// Runs in the child: asks and answers for ever, as the daemon does: only the answer is waited for.
#[test]
fn auditing_child() {
    let Ok(path) = std::env::var(AUDITING_CHILD) else { return };
    let (store, ..) = Store::open(Path::new(&path), Box::new(|_| ())).unwrap();
    for request in 1.. {
        submit(&store, vec![asked(request)], None);
        submit(&store, vec![sample_record(1, request - 1), answered(request)], Some(format!("answered {request}")));
    }
}

#[test]
fn whoever_was_answered_is_in_the_audit_log_after_thirty_kills() {
    let dir = tempfile::tempdir().unwrap();
    let mut told = 0;
    for cycle in 0..30 {
        let path = dir.path().join(format!("store-{cycle}.db"));
        let (store, ..) = open(&path);
        write(&store, vec![session(1, SessionState::Ramping), ramp(1, 0)]).unwrap();
        store.close().unwrap();
        let lines = lines_until_killed("tests::crash::auditing_child", AUDITING_CHILD, &path, 3 + cycle * 13 % 40);
        let answered = lines.iter().filter_map(|line| line.strip_prefix("answered ")?.parse::<u64>().ok()).max();
        told += answered.unwrap_or(0);
        let (store, restored, quarantined, _events) = open(&path);
        assert_eq!(quarantined, [], "cycle {cycle}");
        let (mut all, mut before) = (Vec::new(), u64::MAX);
        while before > 1 {
            all.append(&mut entries(&store, before, u32::MAX).unwrap());
            before = all.last().map_or(1, |oldest| oldest.number);
        }
        let entries = all;
        let complete = entries.iter().filter(|entry| entry.answered.is_some()).count() as u64;
        assert!(complete >= answered.unwrap_or(0), "cycle {cycle}: {answered:?} answered, {complete} in the log");
        // What was done because of a request is never there without the request.
        let done = restored.sessions[0].accepted;
        assert!(entries.len() as u64 >= done, "cycle {cycle}: {done} done, {} asked", entries.len());
        assert!(entries.iter().all(|entry| entry.damage.is_empty() && entry.asked.is_some()), "cycle {cycle}");
        store.close().unwrap();
    }
    assert!(told > 100, "the children got somewhere: {told} answers");
}
