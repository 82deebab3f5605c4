//! The disk fails, fills, goes read-only, or the process dies: at every single call with which the store changes a
//! file, through all that the daemon asks of it. `disk_faults.c` is preloaded into a process of its own for each.

use std::process::Command;

use super::fixture::*;
use super::power::check::check;
use super::power::plan::Plan;
use crate::Store;

const CHILD: &str = "TAXEL_STORE_DISK_CHILD";
const SEED: u64 = 1189;
const EVENTS: usize = 12;

/// What is done to the store: of this seed the first events have all kinds of records.
fn plan() -> Plan {
    let plan = Plan::new(SEED, EVENTS);
    let all = plan.after(EVENTS);
    assert!(all.active.is_some() && all.loads * all.answered > 0 && plan.deleted(EVENTS).count() > 0, "{all:?}");
    plan
}

/// Runs in the child: one event after the other, each waited for before the next, and what came of it.
#[test]
fn disk_child() {
    let Ok(path) = std::env::var(CHILD) else { return };
    let store = match Store::open(Path::new(&path), Box::new(|_| ())) {
        Ok((store, ..)) => store,
        Err(error) => return println!("\nrefused open: {error}"),
    };
    for (number, records) in plan().writes() {
        match write(&store, records.to_vec()) {
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
        let mut next = plan().writes().map(|(number, _)| number + 1).find(|next| *next > done).unwrap_or(done);
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
        check(&path, &plan(), done, next).unwrap_or_else(|lost| panic!("{what}: {lost}, told was {lines:?}"));
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
