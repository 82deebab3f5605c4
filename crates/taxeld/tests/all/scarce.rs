//! What a machine may be short of: a disk that takes long for each write, as worn flash does, file descriptors, somebody who
//! reads the log, memory to share, and the hours for which it slept. The force goes on meanwhile, or is not believed. A write
//! takes half a second, or as many milliseconds as TAXELD_SLOW_MS says.

use std::net::TcpStream;
use std::os::unix::fs::PermissionsExt;
use std::time::SystemTime;

use crate::common::*;
use crate::daemon::Daemon;

/// One whose disk takes so long for each write while there is this file; `with` changes more.
fn with_slow_disk(milliseconds: &str, when: &str, with: impl FnOnce(&Path)) -> Daemon {
    Daemon::start(|command, folder| {
        let library = compiled(folder, include_str!("../../../taxel-store/src/tests/disk_faults.c"));
        command.env("LD_PRELOAD", library).env("FAULT", "slow").env("FAULT_MS", milliseconds);
        command.env("FAULT_DIR", folder.join("disk")).env("FAULT_WHEN", folder.join(when));
        with(folder);
    })
}

impl Daemon {
    async fn health(&self) -> v1::Health {
        let mut client = SkinServiceClient::connect(format!("http://{}", self.address)).await.unwrap();
        client.get_health(()).await.unwrap().into_inner()
    }

    async fn tare(&self) -> Result<(), Status> {
        let mut skin = SkinServiceClient::connect(format!("http://{}", self.address)).await.unwrap();
        let request = v1::TareRequest { confirmed_by: "Ann".to_owned(), ..v1::TareRequest::default() };
        skin.tare(request).await.map(|_| ())
    }

    /// Asks for a zero every ten samples until it is taken: at first the boards are being configured.
    async fn tared(&self, stream: &mut Streaming<v1::ForceSample>) {
        let begun = Instant::now();
        while let Err(status) = self.tare().await {
            assert!(status.code() == Code::FailedPrecondition && begun.elapsed() < PATIENCE, "{status}");
            for _ in 0..10 {
                stream.message().await.unwrap().unwrap();
            }
        }
    }

    fn audited(&self) -> String {
        succeeds(&["audit", "--server", &self.address.to_string()])
    }
}

/// Adds sections to the configuration in the folder.
fn configured(folder: &Path, sections: &str) {
    let path = folder.join("taxeld.toml");
    let config = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, format!("{config}{sections}")).unwrap();
}

/// A library that is made of this text, to be preloaded.
fn compiled(folder: &Path, text: &str) -> PathBuf {
    let (library, source) = (folder.join("faults.so"), folder.join("faults.c"));
    std::fs::write(&source, text).unwrap();
    let compiled =
        Command::new("cc").args(["-shared", "-fPIC", "-O1", "-o"]).args([&library, &source]).output().unwrap();
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    library
}

#[tokio::test]
async fn the_force_goes_on_while_the_disk_takes_long_for_each_write() {
    let milliseconds = std::env::var("TAXELD_SLOW_MS").unwrap_or_else(|_| "500".to_owned());
    let daemon = with_slow_disk(&milliseconds, "slow", |_| ());
    let mut stream = daemon.stream().await;
    daemon.tared(&mut stream).await;
    let slow = daemon.folder.join("slow");
    std::fs::write(&slow, "").unwrap();
    let answer = daemon.tare();
    tokio::pin!(answer);
    let (mut samples, mut stale) = (0, 0);
    let answer = loop {
        tokio::select! {
            answer = &mut answer => break answer,
            sample = stream.message() => {
                let sample = sample.unwrap().unwrap();
                samples += 1;
                stale += u32::from(sample.state() == v1::ForceState::Stale);
            }
        }
    };
    // It is taken, or its time is over, or the mass left the skin meanwhile. These are answers, too: nobody waits for the disk
    // for ever.
    let code = answer.as_ref().map_or_else(Status::code, |()| Code::Ok);
    let lost = answer.as_ref().is_err_and(|status| status.message().contains("the zero was lost while it was written"));
    assert!(matches!(code, Code::Ok | Code::DeadlineExceeded) || lost, "{answer:?}");
    assert!(samples >= 10, "only {samples} samples came while the disk was slow");
    assert_eq!(stale, 0);
    std::fs::remove_file(&slow).unwrap();
    let audited = daemon.audited();
    assert!(audited.contains("Tare") && audited.contains("Ann"), "{audited}");
}

/// The disk takes its time, so that an end that does not wait for the store comes before it is closed.
#[test]
fn a_start_that_fails_after_the_store_was_opened_closes_it() {
    let taken = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let mut daemon = with_slow_disk("20", "taxeld.toml", |folder| {
        configured(folder, &format!("[page]\nlisten = \"{}\"\n", taken.local_addr().unwrap()));
    });
    assert_eq!(daemon.child.0.wait().unwrap().code(), Some(1), "{}", daemon.log());
    assert!(daemon.log().contains("Address already in use"), "{}", daemon.log());
    let disk = daemon.folder.join("disk");
    assert!(disk.join("store.db").exists() && !disk.join("store.db-wal").exists(), "it is not closed");
}

/// Until somebody ends it: each call takes an hour.
#[tokio::test]
async fn a_disk_that_hangs_does_not_keep_the_process_and_its_exit_code_says_so() {
    let mut daemon = with_slow_disk("3600000", "hangs", |_| ());
    daemon.stream().await.message().await.unwrap().unwrap();
    std::fs::write(daemon.folder.join("hangs"), "").unwrap();
    daemon.child.signal("-TERM");
    assert_eq!(daemon.child.0.wait().unwrap().code(), Some(1), "{}", daemon.log());
    assert!(daemon.log().contains("some parts did not close in time"), "{}", daemon.log());
}

#[tokio::test]
async fn a_daemon_without_a_descriptor_left_goes_on_and_takes_connections_again_when_it_has_some() {
    let daemon = Daemon::start(|command, _| {
        command.env("DESCRIPTORS", "64").env("RUST_LOG", "wran");
    });
    until_logged(&daemon.folder, "RUST_LOG = \"wran\" is not used");
    let mut stream = daemon.stream().await;
    let crowd: Vec<_> = (0..100).map(|_| TcpStream::connect(daemon.address).unwrap()).collect();
    // Told once it has none, and the force goes on for all who are there.
    let begun = Instant::now();
    while !daemon.log().contains("a connection was not accepted") {
        assert!(begun.elapsed() < PATIENCE, "{}", daemon.log());
        stream.message().await.unwrap().unwrap();
    }
    for _ in 0..20 {
        stream.message().await.unwrap().unwrap();
    }
    drop(crowd);
    let mut other = daemon.stream().await;
    other.message().await.unwrap().unwrap();
}

/// With so much to say that the pipe and what waits for it are full within the first samples.
#[tokio::test]
async fn a_log_that_nobody_reads_holds_nothing_up_and_says_later_how_much_it_lacks() {
    let (unread, log) = std::io::pipe().unwrap();
    let daemon = Daemon::start(|command, _| _ = command.stderr(log).env("RUST_LOG", "trace,h2=trace"));
    let mut stream = daemon.stream().await;
    for _ in 0..100 {
        let sample = tokio::time::timeout(PATIENCE, stream.message()).await.expect("the force goes on");
        sample.unwrap().unwrap();
    }
    // The engine has its turns, too: it answers.
    tokio::time::timeout(PATIENCE, daemon.tared(&mut stream)).await.expect("a command is answered");
    let mut lines = BufReader::new(unread).lines().take(1_000_000).map_while(Result::ok);
    assert!(lines.any(|line| line.contains("lines of the log were dropped, since nobody read them")));
}

/// The tmpfs is full, or any account of the machine has put something in the place of a page or of its folder.
#[tokio::test]
async fn a_page_that_cannot_be_made_is_told_by_the_health_and_all_else_runs() {
    for (why, in_the_way) in [("No space left", ""), ("Is a directory", "forearm"), ("others could put pages", ".")] {
        let memory = tempfile::Builder::new().prefix("taxeld-test-").tempdir_in("/dev/shm").unwrap();
        let daemon = Daemon::start(|command, folder| {
            configured(folder, &format!("[shared_memory]\npath = \"{}\"\n", memory.path().display()));
            match in_the_way {
                "" => {
                    let library = compiled(folder, include_str!("../../../taxel-store/src/tests/disk_faults.c"));
                    command.env("LD_PRELOAD", library).env("FAULT", "enospc").env("FAULT_DIR", memory.path());
                }
                "." => std::fs::set_permissions(memory.path(), PermissionsExt::from_mode(0o777)).unwrap(),
                name => std::fs::create_dir(memory.path().join(name)).unwrap(),
            }
        });
        daemon.stream().await.message().await.unwrap().unwrap();
        let problems = daemon.health().await.problems;
        let said =
            |problem: &&String| problem.starts_with("no force of forearm in shared memory: ") && problem.contains(why);
        assert_eq!(problems.iter().filter(said).count(), 1, "{why}: {problems:?}");
        until_logged(&daemon.folder, why);
    }
}

/// Of a process that runs already, the limit on files is lowered below what its store has: no write gets through any more.
#[tokio::test]
async fn files_that_may_not_grow_are_a_full_disk_and_no_end() {
    let mut daemon = Daemon::start(|_, _| {});
    let mut stream = daemon.stream().await;
    daemon.tared(&mut stream).await;
    let limited = Command::new("prlimit").args(["--fsize=4096", "--pid", &daemon.child.0.id().to_string()]).status();
    assert!(limited.unwrap().success());
    // A skin may look unsteady for a second.
    let refused = loop {
        let refused = daemon.tare().await.unwrap_err();
        if refused.code() != Code::FailedPrecondition {
            break refused;
        }
    };
    assert_eq!(refused.code(), Code::Unavailable, "{refused}");
    for _ in 0..20 {
        stream.message().await.unwrap().unwrap();
    }
    let problems = daemon.health().await.problems;
    assert!(problems.iter().any(|problem| problem.contains("the store")), "{problems:?}");
    assert_eq!(daemon.child.0.try_wait().unwrap(), None);
}

/// The machine is suspended for an hour: by `CLOCK_BOOTTIME` the engine has not run for as long, and what the boards did
/// meanwhile nobody knows.
#[tokio::test]
async fn after_a_suspend_the_force_is_old_and_the_zero_is_in_doubt() {
    let daemon = Daemon::start(|command, folder| {
        let library = compiled(folder, include_str!("../suspend.c"));
        command.env("LD_PRELOAD", library).env("SUSPENDED_AN_HOUR", folder.join("suspended"));
    });
    let mut stream = daemon.stream().await;
    daemon.tared(&mut stream).await;
    std::fs::write(daemon.folder.join("suspended"), "").unwrap();
    let (begun, suspended) = (Instant::now(), SystemTime::now());
    loop {
        let sample = stream.message().await.unwrap().unwrap();
        // What was sent before may still be on its way; the wall clock is the one that goes on.
        let sent = SystemTime::try_from(sample.sent.unwrap()).unwrap();
        assert!(sample.total_n.is_none() || sent < suspended, "{sample:?}");
        let zero = daemon.health().await.patches[0].tare.clone().unwrap();
        if zero.reason.contains("the daemon did not run for 3600.") {
            assert!(!zero.valid, "{zero:?}");
            return;
        }
        assert!(begun.elapsed() < PATIENCE, "{zero:?}\n{}", daemon.log());
    }
}
