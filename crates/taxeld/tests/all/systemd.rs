//! The daemon as a service: what it tells the service manager, and what signals do. A real process, and a socket that
//! plays the service manager.

use std::os::unix::net::UnixDatagram;

use crate::common::*;
use crate::daemon::{Daemon, configure};

struct Service {
    daemon: Daemon,
    manager: UnixDatagram,
}

impl Service {
    fn start(arguments: &[&str]) -> Self {
        let mut manager = None;
        let daemon = Daemon::start(|command, folder| {
            let socket = folder.join("notify");
            manager = Some(UnixDatagram::bind(&socket).unwrap());
            command.args(arguments).env("NOTIFY_SOCKET", socket);
            command.env_remove("WATCHDOG_USEC").env_remove("RUST_LOG").env_remove("JOURNAL_STREAM");
        });
        let manager = manager.unwrap();
        manager.set_read_timeout(Some(PATIENCE)).unwrap();
        Self { daemon, manager }
    }

    fn until_logged(&self, text: &str) -> String {
        until_logged(&self.daemon.folder, text)
    }

    /// What the manager is told next.
    fn told(&self) -> String {
        let mut message = [0; 4096];
        let length = self.manager.recv(&mut message).unwrap_or_else(|error| panic!("{error}; {}", self.daemon.log()));
        String::from_utf8(message[..length].to_vec()).unwrap()
    }

    /// Waits for a message with this line, and gives it.
    fn until_told(&self, line: &str) -> String {
        loop {
            let told = self.told();
            if told.lines().any(|found| found == line) {
                return told;
            }
        }
    }
}

/// The next sample of a stream that goes on.
async fn next(stream: &mut Streaming<v1::ForceSample>) -> v1::ForceSample {
    tokio::time::timeout(PATIENCE, stream.message()).await.unwrap().unwrap().unwrap()
}

#[tokio::test]
async fn without_a_watchdog_none_is_fed() {
    let service = Service::start(&[]);
    service.until_told("READY=1");
    service.daemon.child.signal("-TERM");
    let mut told = service.told();
    while !told.contains("STOPPING=1") {
        assert!(!told.contains("WATCHDOG"), "{told}");
        told = service.told();
    }
}

#[tokio::test]
async fn a_hangup_reloads_what_can_be_refuses_the_rest_with_reasons_and_keeps_the_streams() {
    let service = Service::start(&[]);
    service.until_told("READY=1");
    service.until_logged("EVERYBODY ON THIS MACHINE IS ADMINISTRATOR"); // there is no section of access
    let mut stream = service.daemon.stream().await;
    let mut before = next(&mut stream).await.sequence;
    let more = "socket_group = \"skin\"\n";
    configure(&service.daemon.folder, service.daemon.address, more);
    service.daemon.child.signal("-HUP");
    let reloading = service.until_told("RELOADING=1");
    assert!(reloading.contains("MONOTONIC_USEC="), "{reloading}");
    service.until_told("READY=1");
    for _ in 0..20 {
        let sample = next(&mut stream).await;
        // A value that has become too old meanwhile is told once more, as what it is then.
        let (sequence, skipped) = (sample.sequence, sample.skipped);
        let adds_up = sequence == before + 1 + skipped || (sequence, skipped) == (before, 0);
        assert!(adds_up, "{sequence} after {before}, {skipped} skipped: no sample is missing that is not told");
        before = sample.sequence;
    }
    service.until_logged("other keys need a restart");
    // Rules that grant nothing to anybody are rules, too.
    configure(&service.daemon.folder, service.daemon.address, &format!("{more}[access]\n"));
    service.daemon.child.signal("-HUP");
    service.until_told("RELOADING=1");
    service.until_told("READY=1");
    service.until_logged("not reloaded: whether there is an [access] section needs a restart");
    // A file that cannot be used changes nothing.
    std::fs::write(service.daemon.folder.join("taxeld.toml"), "[store]\npath = 5\n").unwrap();
    service.daemon.child.signal("-HUP");
    service.until_told("RELOADING=1");
    service.until_told("READY=1");
    next(&mut stream).await;
    service.until_logged("nothing is reloaded: ");
}

#[tokio::test]
async fn the_log_has_no_colours_in_a_file_and_one_object_a_line_where_that_is_asked_for() {
    let text = Service::start(&[]);
    text.until_told("READY=1");
    let log = text.until_logged("taxeld is up");
    assert!(!log.contains('\u{1b}'), "{log}");
    let json = Service::start(&["--log-format", "json"]);
    json.until_told("READY=1");
    let log = json.until_logged("taxeld is up");
    let objects: Vec<serde_json::Value> = log.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(objects.iter().any(|object| object["fields"]["message"] == "taxeld is up"), "{log}");
    assert!(objects.iter().all(|object| object["timestamp"].is_string()), "{log}");
}

#[test]
fn why_a_daemon_does_not_start_is_a_line_of_its_log() {
    let fails = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_taxeld")).args(arguments).output().unwrap();
        assert!(!output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    let run = ["run", "--config", "/nowhere/taxeld.toml"];
    let why = "/nowhere/taxeld.toml: No such file or directory (os error 2); `taxeld setup` writes one";
    assert_eq!(fails(&run), format!("taxeld: {why}\n"));
    let line: serde_json::Value =
        serde_json::from_str(&fails(&[&run[..], &["--log-format", "json"]].concat())).unwrap();
    assert_eq!((&line["level"], &line["fields"]["message"]), (&"ERROR".into(), &why.into()));
}
