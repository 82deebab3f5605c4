//! The force in shared memory of a daemon that lives, hangs, is killed and comes back.

use std::process::Command;
use std::time::{Duration, Instant};

use taxel_shm::{Force, NoForce, Reader};

use crate::common::PATIENCE;
use crate::demo::Demo;

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
    let mut demo = Demo::start(&["--shared-memory", folder.path().to_str().unwrap()]).child;
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

    let mut demo = Demo::start(&["--shared-memory", folder.path().to_str().unwrap()]).child;
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
