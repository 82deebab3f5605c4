//! The force in shared memory of a daemon that lives, hangs, is killed and comes back.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use taxel_shm::{Force, NoForce, Reader};

use crate::common::Ended;

/// How long a busy machine may take for anything.
const PATIENCE: Duration = Duration::from_secs(180);

/// Starts a demo and waits until it is live.
fn start(folder: &Path) -> Ended {
    let mut command = Command::new(env!("CARGO_BIN_EXE_taxeld"));
    command.args(["demo", "--listen", "127.0.0.1:0", "--shared-memory"]).arg(folder);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines().map_while(Result::ok);
    let page = folder.join("left_forearm").display().to_string();
    assert!(lines.any(|line| line == format!("In shared memory: {page}")), "the demo says where its page is");
    std::thread::spawn(move || lines.for_each(drop)); // its text goes on and must not block it
    Ended(child)
}

/// Reads until there is what is looked for.
fn until<T>(reader: &mut Reader, mut wanted: impl FnMut(Result<Force, NoForce>) -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        let force = reader.force();
        let said = format!("{force:?}");
        if let Some(found) = wanted(force) {
            return found;
        }
        assert!(begun.elapsed() < PATIENCE, "{said}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn a_daemon_that_hangs_ends_or_is_killed_never_looks_alive_and_the_next_one_is_found() {
    let folder = tempfile::Builder::new().prefix("taxeld-test-").tempdir_in("/dev/shm").unwrap();
    let path = folder.path().join("left_forearm");
    let mut reader = Reader::new(&path, None);
    let mut demo = start(folder.path());
    let force = until(&mut reader, Result::ok);
    assert!(force.age <= Duration::from_millis(150) && force.total_n >= 0.0, "{force:?}");
    assert!(force.sample.model_set.as_str().starts_with("m-") && force.sample.sigma_n.is_some(), "{force:?}");

    demo.signal("-STOP");
    // From when the daemon is known to stand still, the page is good for no longer than its limits.
    let gone = |force: Result<Force, NoForce>| matches!(force, Err(NoForce::WriterGone(_))).then_some(());
    until(&mut reader, gone);
    demo.signal("-CONT");
    // Whether its zero outlived that is the daemon's to say; that it lives, the page's.
    until(&mut reader, |force| matches!(force, Ok(_) | Err(NoForce::State(..))).then_some(()));

    demo.signal("-KILL");
    demo.0.wait().unwrap();
    until(&mut reader, gone);
    assert!(path.exists(), "a killed daemon leaves its page, and nobody takes it for a living one");

    let mut demo = start(folder.path());
    until(&mut reader, Result::ok);

    demo.signal("-TERM");
    demo.0.wait().unwrap();
    assert_eq!(until(&mut reader, Result::err), NoForce::Closed);
    assert!(!path.exists());
}

#[test]
fn a_second_daemon_is_told_that_the_folder_is_taken() {
    let folder = tempfile::Builder::new().prefix("taxeld-test-").tempdir_in("/dev/shm").unwrap();
    let _first = taxel_shm::Folder::open(folder.path(), None).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_taxeld"));
    command.args(["demo", "--bare", "--listen", "127.0.0.1:0", "--shared-memory"]).arg(folder.path());
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && said.contains("another daemon publishes its pages there"), "{said}");
}
