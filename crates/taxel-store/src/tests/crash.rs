//! What was acknowledged is on disk: a process is killed at any moment, 50 times on one file.

use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;

use taxel_engine::calibration::SessionState;
use taxel_engine::record::Record;

use super::fixture::*;
use crate::{Batch, Store, StoreEvent};

const CYCLES: u64 = 50;
const CHILD: &str = "TAXEL_STORE_CRASH_CHILD";

/// One line to the parent; the test harness must not hold it back.
fn say(line: &str) {
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
        batch = full.0;
        std::thread::yield_now();
    }
}

/// Runs in the child: goes on with the session for ever, with a model set made and activated now and then.
#[test]
fn child() {
    let Ok(path) = std::env::var(CHILD) else { return };
    let notify = Box::new(|event| match event {
        StoreEvent::Durable { samples, .. } => say(&format!("durable {samples}")),
        StoreEvent::Failed(why) => panic!("{why}"),
    });
    let (store, restored, _) = Store::open(Path::new(&path), notify).unwrap();
    let known = restored.sessions.first().map_or(0, |session| session.view.accepted);
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
    for cycle in 0..CYCLES {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "tests::crash::child", "--nocapture"])
            .env(CHILD, &path)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap());
        // Not the same place twice: how many lines are read before the kill wanders from 1 to 40.
        for _ in 0..1 + cycle * 17 % 40 {
            let mut line = String::new();
            lines.read_line(&mut line).unwrap();
            told.note(line.trim_end());
        }
        child.kill().unwrap();
        child.wait().unwrap();
        let mut rest = String::new();
        lines.read_to_string(&mut rest).unwrap();
        // A last line without its end may be torn.
        rest.lines().filter(|_| rest.ends_with('\n')).for_each(|line| told.note(line));

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
        let stored = restored.sessions.first().map_or(0, |session| session.view.accepted);
        assert!(stored >= told.samples, "cycle {cycle}: {} samples acknowledged, {stored} there", told.samples);
        if let Some(found) = restored.sessions.first() {
            assert_eq!(found.view.state, SessionState::Interrupted);
            let samples = &found.samples.as_ref().unwrap().samples;
            assert!(samples.iter().cloned().eq((0..stored).map(sample)), "cycle {cycle}");
        }
        store.close().unwrap();
    }
    assert!(told.samples > CYCLES && told.sets.len() > 5, "the children got somewhere: {} samples", told.samples);
}
