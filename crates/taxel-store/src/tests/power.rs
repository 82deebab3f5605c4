//! What was acknowledged is on disk, and what was deleted is not: a process is killed at any moment, or the power fails. One
//! process does to a store what a daemon does for days, and says what is acknowledged; another one opens what is left and says
//! whether that is a state in which the store has been. For power cuts `tests/power` has a disk that can be put back to any
//! moment.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Command, Stdio};

use check::check;
use plan::{Event, Plan};

use super::fixture::*;
use crate::{Batch, Store};

pub mod check;
pub mod plan;

/// The store of the writing process.
const WRITER: &str = "TAXEL_STORE_POWER_WRITER";
/// Set for the looking process.
const LOOKER: &str = "TAXEL_STORE_POWER_LOOKER";
/// Seed and number of events, with a blank between.
const PLAN: &str = "TAXEL_STORE_POWER_PLAN";

/// Kills unless the environment says otherwise: `TAXEL_STORE_KILLS=1000 cargo test -p taxel-store kills`.
const KILLS: usize = 50;

/// One line to the parent; the test harness must not hold it back.
fn say(line: &str) {
    // The parent kills this process when it has read enough: a closed pipe is no fault.
    let _ = std::io::stdout().write_all(format!("\n{line}\n").as_bytes());
}

fn plan_of_environment() -> Plan {
    let text = std::env::var(PLAN).unwrap();
    let (seed, events) = text.split_once(' ').unwrap();
    Plan::new(seed.parse().unwrap(), events.parse().unwrap())
}

fn start(path: &Path) -> Store {
    let (store, _, quarantined) = Store::open(path, Box::new(|_| ())).unwrap();
    assert_eq!(quarantined, []);
    store
}

/// Does what the plan says. It tells in `begins` which event it will have come to when it tells so again, and in `done`
/// which one has been acknowledged, from the store's thread as a daemon does.
fn follow(plan: &Plan, path: &Path, mut begins: impl FnMut(usize), done: fn(usize)) {
    let mut store = start(path);
    let mut number = 0;
    for burst in plan.bursts() {
        begins(number + burst.len());
        let (tell, told) = channel();
        for event in burst {
            number += 1;
            match event {
                Event::Write(records) => {
                    let (tell, number) = (tell.clone(), number);
                    let on_durable: crate::OnDurable = Box::new(move |outcome| {
                        outcome.unwrap();
                        done(number);
                        tell.send(()).unwrap();
                    });
                    store.submit(Batch { records: records.clone(), on_durable: Some(on_durable) }).unwrap();
                }
                Event::Refused(records) => {
                    write(&store, records.clone()).unwrap_err();
                    store.close().unwrap_err(); // nothing is taken after a refusal
                    store = start(path);
                    done(number);
                    tell.send(()).unwrap();
                }
                Event::Reopen => {
                    store.close().unwrap();
                    store = start(path);
                    done(number);
                    tell.send(()).unwrap();
                }
            }
        }
        drop(tell);
        assert_eq!(told.iter().count(), burst.len());
    }
    store.close().unwrap();
}

/// Runs in the writing process: before each burst it waits for a line, so that the keeper of the record knows what was
/// acknowledged before anything of the burst is written.
#[test]
fn writing_child() {
    let Ok(path) = std::env::var(WRITER) else { return };
    let mut lines = std::io::stdin().lines();
    let begins = |number: usize| {
        say(&format!("begins {number}"));
        lines.next().unwrap().unwrap();
    };
    follow(&plan_of_environment(), Path::new(&path), begins, |number| say(&format!("done {number}")));
    say("closed");
}

/// Runs in the looking process: for each line with a store, the last event that was acknowledged and the last that had
/// begun, a line that says what was found.
#[test]
fn looking_child() {
    if std::env::var(LOOKER).is_err() {
        return;
    }
    let plan = plan_of_environment();
    for line in std::io::stdin().lock().lines() {
        let line = line.unwrap();
        let words: Vec<_> = line.split(' ').collect();
        let [path, done, begun] = words[..] else { panic!("expected a path and two numbers, found `{line}`") };
        match check(Path::new(path), &plan, done.parse().unwrap(), begun.parse().unwrap()) {
            Ok(state) => say(&format!("sound {state}")),
            Err(lost) => say(&format!("lost {}", lost.replace('\n', " "))),
        }
    }
}

/// What a child says before it is killed, when so many of its lines have been read. A last line that may be torn is left out.
fn said_until_killed(path: &Path, plan: &str, lines: usize) -> Vec<String> {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "tests::power::writing_child", "--nocapture"])
        .envs([(WRITER, path.to_str().unwrap()), (PLAN, plan)])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let _goes_on = child.stdin.take().map(|mut to| to.write_all(&[b'\n'; 100]).map(|()| to));
    let mut from = BufReader::new(child.stdout.take().unwrap());
    let mut said = String::new();
    (0..lines).for_each(|_| assert!(from.read_line(&mut said).is_ok()));
    child.kill().unwrap();
    child.wait().unwrap();
    from.read_to_string(&mut said).unwrap();
    said.rsplit_once('\n').map_or("", |(whole, _)| whole).lines().map(str::to_owned).collect()
}

#[test]
fn what_was_acknowledged_survives_fifty_kills() {
    let kills = std::env::var("TAXEL_STORE_KILLS").ok().and_then(|kills| kills.parse().ok()).unwrap_or(KILLS);
    let mut acknowledged = 0;
    for kill in 0..kills {
        let (_dir, path) = place();
        // Not the same place twice: how many lines are read before the kill wanders.
        let said = said_until_killed(&path, &format!("{kill} 60"), 8 + kill * 37 % 150);
        let last = |word: &str| said.iter().filter_map(|line| line.strip_prefix(word)?.trim().parse().ok()).max();
        let (done, begun) = (last("done").unwrap_or(0), last("begins").unwrap_or(0));
        let plan = Plan::new(kill as u64, 60);
        check(&path, &plan, done, begun).unwrap_or_else(|lost| panic!("kill {kill}, {done} acknowledged: {lost}"));
        acknowledged += done;
    }
    assert!(acknowledged > 10 * kills, "the children got somewhere: {acknowledged} events");
}
