//! The disk fails, fills, goes read-only, hangs, or the process dies: at every single call with which the store changes a
//! file, through all that the daemon asks of it. `disk_faults.c` is preloaded into a process of its own for each.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::mpsc::channel;

use taxel_engine::calibration::SessionState;
use taxel_engine::record::Record;
use tempfile::TempDir;

use super::fixture::*;
use crate::{Batch, Store};

const CHILD: &str = "TAXEL_STORE_DISK_CHILD";
const HOLDING_CHILD: &str = "TAXEL_STORE_HOLDING_CHILD";

/// Everything that the daemon asks of its store, each waited for before the next.
fn steps() -> Vec<Vec<Record>> {
    let [first, second] = [model_set(1), model_set(2)];
    vec![
        vec![session(1, SessionState::Ramping), ramp(1, 0)],
        (0..3).map(|index| sample_record(1, index)).collect(),
        vec![Record::ModelSet(Arc::new(first.clone()))],
        vec![activated(&first)],
        vec![asked(1)],
        vec![answered(1)],
        vec![session(1, SessionState::Review)],
        vec![Record::ModelSet(Arc::new(second.clone())), activated(&second)],
        vec![Record::ModelSetDeleted { model_set: first.id, wall_ns: 9 }],
        vec![session(2, SessionState::Aborted)],
        vec![Record::SessionDeleted { session: 2, wall_ns: 11 }],
    ]
}

/// What a store holds: its model sets, the active one, sessions, samples of the first, requests and results.
type Held = (Vec<String>, Option<String>, Vec<u64>, u64, usize, usize);

/// What it holds after so many steps.
fn after(steps: usize) -> Held {
    let [first, second] = [model_set(1).id, model_set(2).id];
    let between = |from: usize, to: usize| (from..to).contains(&steps);
    let known = [(between(3, 9), &first), (steps >= 8, &second)];
    let active = [(between(4, 8), &first), (steps >= 8, &second)];
    let sessions = [(steps >= 1, 1), (between(10, 11), 2)];
    (
        known.iter().filter(|(there, _)| *there).map(|(_, id)| (*id).clone()).collect(),
        active.iter().find(|(there, _)| *there).map(|(_, id)| (*id).clone()),
        sessions.iter().filter(|(there, _)| *there).map(|(_, number)| *number).collect(),
        if steps >= 2 { 3 } else { 0 },
        usize::from(steps >= 5),
        usize::from(steps >= 6),
    )
}

fn held(path: &Path, what: &str) -> Held {
    let opened = Store::open(path, Box::new(|_| ()));
    let (store, restored, quarantined) = opened.unwrap_or_else(|error| panic!("{what}: {error}"));
    assert_eq!(quarantined, [], "{what}");
    let samples = samples_of(&store, 1).map_or(0, |found| found.samples.len() as u64);
    let log = entries(&store, u64::MAX, u32::MAX).unwrap();
    let answered = log.iter().filter(|entry| entry.answered.is_some()).count();
    // It takes new ones again.
    write(&store, vec![session(7, SessionState::Aborted)]).unwrap_or_else(|error| panic!("{what}: {error}"));
    store.close().unwrap_or_else(|error| panic!("{what}: {error}"));
    (
        restored.model_sets.iter().map(|set| set.id.clone()).collect(),
        restored.active.first().map(|(_, id)| id.clone()),
        restored.sessions.iter().map(|view| view.number).collect(),
        samples,
        log.len(),
        answered,
    )
}

/// Runs in the child: one step after the other, and what came of each.
#[test]
fn disk_child() {
    let Ok(path) = std::env::var(CHILD) else { return };
    let store = match Store::open(Path::new(&path), Box::new(|_| ())) {
        Ok((store, ..)) => store,
        Err(error) => return println!("\nrefused open: {error}"),
    };
    for (number, records) in steps().into_iter().enumerate() {
        match write(&store, records) {
            Ok(_) => println!("\ndone {}", number + 1),
            Err(error) => println!("\nrefused {}: {error}", number + 1),
        }
    }
    match store.close() {
        Ok(()) => println!("\ndone close"),
        Err(error) => println!("\nrefused close: {error}"),
    }
}

/// A folder in memory if there is one: what counts here is which calls came, not the disk.
pub fn folder() -> TempDir {
    let memory = Path::new("/dev/shm");
    if memory.is_dir() { tempfile::tempdir_in(memory).unwrap() } else { tempfile::tempdir().unwrap() }
}

/// The compiled `disk_faults.c`.
pub fn shim(folder: &TempDir) -> PathBuf {
    let (source, library) = (folder.path().join("faults.c"), folder.path().join("faults.so"));
    fs::write(&source, include_str!("disk_faults.c")).unwrap();
    let compiled =
        Command::new("cc").args(["-shared", "-fPIC", "-O1", "-o"]).args([&library, &source]).output().unwrap();
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    library
}

/// What a child said about a new store whose disk has a fault at this call.
pub fn told(shim: &Path, test: &str, variable: &str, store: &Path, fault: &[(&str, &str)]) -> Vec<String> {
    let child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", test, "--nocapture", "--test-threads=1"])
        .env(variable, store)
        .env("LD_PRELOAD", shim)
        .env("FAULT_DIR", store.parent().unwrap())
        .envs(fault.iter().copied())
        .output()
        .unwrap();
    String::from_utf8(child.stdout).unwrap().lines().map(str::to_owned).collect()
}

/// A fault at each call in turn. Every time what was acknowledged is there, and of what was refused nothing unless that was told;
/// a step is there whole or not at all, nothing is taken after the first refusal, and the next start goes on with all of it.
fn at_every_call(fault: &str, expected: &[&str]) {
    let tools = folder();
    let shim = shim(&tools);
    let tell = |path: &Path, fault: &[(&str, &str)]| told(&shim, "tests::disk::disk_child", CHILD, path, fault);
    let whole = folder();
    let count = tools.path().join("calls");
    let lines = tell(&whole.path().join("store.db"), &[("FAULT_COUNT", count.to_str().unwrap())]);
    assert!(lines.iter().any(|line| line == "done close"), "{lines:?}");
    let calls: u64 = fs::read_to_string(count).unwrap().trim().parse().unwrap();
    let mut refusals = 0;
    for call in 1..=calls {
        let folder = folder();
        let path = folder.path().join("store.db");
        let what = format!("{fault} at call {call} of {calls}");
        let lines = tell(&path, &[("FAULT", fault), ("FAULT_AT", &call.to_string())]);
        let done = lines.iter().filter_map(|line| line.strip_prefix("done ")?.parse::<usize>().ok()).max().unwrap_or(0);
        let mut refused = lines.iter().skip_while(|line| !line.starts_with("refused"));
        // What a kill interrupts nobody was told of.
        let mut next = (done + 1).min(steps().len());
        if let Some(first) = refused.next() {
            refusals += 1;
            // A start says what could not be done with the store, a step what the disk said.
            let says: &[&str] = if first.starts_with("refused open") { &["store"] } else { expected };
            assert!(says.iter().any(|says| first.contains(says)), "{what}: {first}");
            assert!(!refused.any(|line| line.starts_with("done")), "{what}: {lines:?}");
            if !first.contains("the next start may find what was refused") {
                next = done;
            }
        }
        let there = held(&path, &what);
        let may_be = [after(done), after(next)];
        assert!(may_be.contains(&there), "{what}: after step {done} there is {there:?}, told was {lines:?}");
    }
    println!("{fault} at each of {calls} calls: {refusals} were told as a refusal, nothing acknowledged was lost");
    assert!(calls > 50 && (expected.is_empty() || refusals > 20), "{calls} calls, {refusals} refusals");
}

#[test]
fn a_disk_that_fails_once_at_any_call_loses_nothing_acknowledged_and_is_told() {
    at_every_call("eio", &["I/O error", "Input/output error", "is the disk full"]);
}

#[test]
fn a_disk_that_is_full_from_any_call_on_loses_nothing_acknowledged_and_is_told() {
    at_every_call("enospc", &["full", "I/O error", "No space left"]);
}

#[test]
fn a_disk_that_is_read_only_from_any_call_on_loses_nothing_acknowledged_and_is_told() {
    at_every_call("erofs", &["store"]);
}

#[test]
fn a_kill_at_any_call_loses_nothing_acknowledged() {
    at_every_call("kill", &[]);
}

#[test]
fn a_kill_in_the_middle_of_any_write_loses_nothing_acknowledged() {
    at_every_call("torn", &[]);
}

/// Runs in the child: the disk takes nothing until all of this was submitted.
#[test]
fn holding_child() {
    let Ok(path) = std::env::var(HOLDING_CHILD) else { return };
    let path = Path::new(&path);
    let (store, ..) = Store::open(path, Box::new(|_| ())).unwrap();
    let hangs = std::env::var("FAULT_WHEN").unwrap();
    fs::write(&hangs, "").unwrap();
    let (tell, answer) = channel();
    let on_durable: crate::OnDurable = Box::new(move |outcome| tell.send(outcome).unwrap());
    let records = vec![session(1, SessionState::Ramping)];
    store.submit(Batch { records, on_durable: Some(on_durable) }).unwrap();
    for index in 0..1000 {
        store.submit(quiet(vec![sample_record(1, index)])).unwrap();
    }
    println!("\nsubmitted, and {} yet", if answer.try_recv().is_ok() { "an answer" } else { "no answer" });
    fs::remove_file(hangs).unwrap();
    answer.recv().unwrap().unwrap();
    store.close().unwrap();
    println!("\nclosed");
}

#[test]
fn a_disk_that_hangs_holds_nobody_up_and_what_waited_is_stored_when_it_is_back() {
    let tools = folder();
    let shim = shim(&tools);
    let opened = folder();
    Store::open(&opened.path().join("store.db"), Box::new(|_| ())).unwrap().0.close().unwrap();
    let path = opened.path().join("store.db");
    let hangs = tools.path().join("hangs");
    let fault = [("FAULT", "hold"), ("FAULT_WHEN", hangs.to_str().unwrap())];
    let lines = told(&shim, "tests::disk::holding_child", HOLDING_CHILD, &path, &fault);
    assert!(lines.iter().any(|line| line == "submitted, and no answer yet"), "{lines:?}");
    assert!(lines.iter().any(|line| line == "closed"), "{lines:?}");
    let (store, _, quarantined, _events) = open(&path);
    assert_eq!(quarantined, []);
    assert_eq!(samples_of(&store, 1).unwrap().samples.len(), 1000);
    store.close().unwrap();
}
