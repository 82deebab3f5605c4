//! The documented way to certificates and tokens, word for word, and a daemon that lives by them.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use taxel_proto::v1;
use taxel_proto::v1::audit_service_client::AuditServiceClient;
use taxel_proto::v1::skin_service_client::SkinServiceClient;
use tonic::transport::{Certificate, Channel, ClientTlsConfig, Endpoint, Identity};
use tonic::{Code, Request, Status};

use crate::common::{Ended, PATIENCE, free_address};

/// The lines of deploy/security.md that make authority, certificates and a token.
fn documented_lines() -> &'static str {
    let text = include_str!("../../../../deploy/security.md");
    let (_, rest) = text.split_once("```sh\n").unwrap();
    rest.split_once("```").unwrap().0
}

/// Whether there is an openssl; tests/run sees to it that there is.
fn openssl() -> bool {
    let there = Command::new("openssl").arg("version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok();
    if !there {
        println!("skipped: openssl is not installed");
    }
    there
}

fn make_certificates(folder: &Path) {
    let script = format!("set -eu\n{}", documented_lines());
    let output = Command::new("sh").args(["-c", &script]).current_dir(folder).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

struct Daemon {
    child: Ended,
    folder: PathBuf,
    tls: String,
}

const SCENE: &str = r#"
[[bus]]
name = "skin"
source = "sim"
[[patch]]
name = "left_forearm"
bus = "skin"
boards = [{ address = 13, modules = "0-15" }, { address = 12, modules = "0-6" }]
"#;

/// What the certificate of the documented lines may do.
const GRANT: &str = r#"operators = ["certificate:spiffe://robot/skin/operator"]"#;

impl Daemon {
    fn start(folder: &Path) -> Self {
        let port = free_address().port();
        let config = format!(
            r#"
            listen = ["unix:socket", "tls:127.0.0.1:{port}"]
            tls = {{ cert = "server.pem", key = "server.key", client_ca = "ca.pem" }}
            store.path = "{}/store.db"
            [access]
            tokens = "tokens"
            {GRANT}{SCENE}"#,
            folder.display()
        );
        std::fs::write(folder.join("taxeld.toml"), config).unwrap();
        let child = Command::new(env!("CARGO_BIN_EXE_taxeld"))
            .args(["run", "--config"])
            .arg(folder.join("taxeld.toml"))
            .stderr(Stdio::inherit())
            .spawn()
            .unwrap();
        let child = Ended(child);
        Self { child, folder: folder.to_path_buf(), tls: format!("https://127.0.0.1:{port}") }
    }

    fn socket(&self) -> String {
        format!("unix:{}", self.folder.join("socket").display())
    }

    /// The Unix socket, as soon as the daemon answers on it, whatever it says: all its doors are open then. That the socket
    /// takes a connection says less, since it is the first of them.
    async fn unix(&self) -> Channel {
        let (begun, endpoint) = (Instant::now(), Endpoint::from_shared(self.socket()).unwrap());
        let channel = endpoint.connect_lazy();
        loop {
            match SkinServiceClient::new(channel.clone()).get_health(()).await {
                Err(error) if error.code() == Code::Unavailable => {
                    assert!(begun.elapsed() < PATIENCE, "the daemon does not come up: {error}");
                }
                _answered => return channel,
            }
            tokio::task::yield_now().await;
        }
    }

    /// A connection with the certificates of a folder.
    fn with_certificates(&self, folder: &Path) -> Channel {
        let read = |name: &str| std::fs::read(folder.join(name)).unwrap();
        let config = ClientTlsConfig::new()
            .ca_certificate(Certificate::from_pem(read("ca.pem")))
            .identity(Identity::from_pem(read("operator.pem"), read("operator.key")))
            .domain_name("robot.example");
        Endpoint::from_shared(self.tls.clone()).unwrap().tls_config(config).unwrap().connect_lazy()
    }

    fn audit(&self, arguments: &[&str]) -> String {
        let output = Command::new(env!("CARGO_BIN_EXE_taxeld")).arg("audit").args(arguments).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }
}

/// Asks for a tare, which the engine may refuse; gives what the gate said.
async fn tare(channel: &Channel, token: Option<&str>, name: &str) -> Result<(), Status> {
    let mut request = Request::new(v1::TareRequest { confirmed_by: name.to_owned(), ..Default::default() });
    if let Some(token) = token {
        request.metadata_mut().insert("authorization", format!("Bearer {token}").parse().unwrap());
    }
    match SkinServiceClient::new(channel.clone()).tare(request).await {
        Err(status) if status.code() == Code::FailedPrecondition => Ok(()), // by the engine, so it was let through
        other => other.map(|_| ()),
    }
}

#[test]
fn a_key_and_a_certificate_that_do_not_go_together_are_refused_at_the_start() {
    if !openssl() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    make_certificates(folder.path());
    let taxeld = |command: &str, key: &str| {
        let listen = "listen = [\"tls:127.0.0.1:0\"]";
        let tls = format!("tls = {{ cert = \"server.pem\", key = \"{key}\", client_ca = \"ca.pem\" }}");
        let text = format!("{listen}\n{tls}\nstore.path = \"store.db\"\n[access]\n{SCENE}");
        std::fs::write(folder.path().join("taxeld.toml"), text).unwrap();
        let mut taxeld = Command::new(env!("CARGO_BIN_EXE_taxeld"));
        taxeld.args([command, "--config", "taxeld.toml"]).current_dir(folder.path()).output().unwrap()
    };
    assert!(taxeld("check", "server.key").status.success());
    let output = taxeld("run", "operator.key");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && said.contains("server.pem: does not go with the key"), "{said}");
}

#[tokio::test]
async fn a_daemon_lives_by_the_documented_certificates_and_tokens_and_its_audit_log_names_who_came() {
    if !openssl() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    make_certificates(folder.path());
    let daemon = Daemon::start(folder.path());
    let unix = daemon.unix().await;

    let status = tare(&unix, None, "Nobody").await.unwrap_err();
    assert_eq!(status.code(), Code::PermissionDenied, "{status:?}");
    let token = std::fs::read_to_string(folder.path().join("bench.token")).unwrap();
    tare(&unix, Some(token.trim()), "Ann").await.unwrap();
    let remote = daemon.with_certificates(folder.path());
    tare(&remote, None, "Bob").await.unwrap();

    let page = AuditServiceClient::new(remote.clone()).list_audit(v1::ListRequest::default()).await.unwrap();
    let entries = page.into_inner().entries;
    let shown: Vec<_> =
        entries.iter().map(|e| (e.who.as_str(), e.transport.as_str(), e.claimed_name.as_str())).collect();
    assert_eq!(shown, [("spiffe://robot/skin/operator", "tls", "Bob"), ("token bench", "unix", "Ann")]);
    assert!(entries.iter().all(|entry| entry.method == "Tare" && !entry.result.is_empty()), "{entries:?}");

    let token_file = folder.path().join("bench.token");
    let text = daemon.audit(&["--server", &daemon.socket(), "--token", token_file.to_str().unwrap()]);
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 2, "{text}");
    assert!(lines[0].contains("token bench (operator, unix uid "), "{text}");
    assert!(lines[1].contains("spiffe://robot/skin/operator (operator, tls 127.0.0.1:"), "{text}");

    let of_patch = |patch: &str| {
        daemon.audit(&["--server", &daemon.socket(), "--token", token_file.to_str().unwrap(), "--patch", patch])
    };
    assert_eq!(of_patch("no-such-patch"), "the audit log is empty\n");
    assert_eq!(of_patch("left_forearm"), text);

    // Killed and started again on the socket that it left.
    drop(daemon);
    let daemon = Daemon::start(folder.path());
    tare(&daemon.unix().await, Some(token.trim()), "Ann").await.unwrap();
    let text = daemon.audit(&["--server", &daemon.socket(), "--token", token_file.to_str().unwrap()]);
    assert_eq!(text.lines().count(), 3, "what was answered is there");
}

#[tokio::test]
async fn on_a_signal_other_certificates_and_tokens_count_and_useless_ones_change_nothing() {
    if !openssl() {
        return;
    }
    let (folder, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    make_certificates(folder.path());
    make_certificates(other.path());
    let old = tempfile::tempdir().unwrap();
    for name in ["ca.pem", "operator.pem", "operator.key"] {
        std::fs::copy(folder.path().join(name), old.path().join(name)).unwrap();
    }
    let daemon = Daemon::start(folder.path());
    let unix = daemon.unix().await;
    tare(&daemon.with_certificates(old.path()), None, "Ann").await.unwrap();
    tare(&daemon.with_certificates(other.path()), None, "Ann").await.unwrap_err();
    let token = std::fs::read_to_string(other.path().join("bench.token")).unwrap();
    assert_eq!(tare(&unix, Some(token.trim()), "Ann").await.unwrap_err().code(), Code::Unauthenticated);

    for name in ["ca.pem", "server.pem", "server.key", "tokens"] {
        std::fs::copy(other.path().join(name), folder.path().join(name)).unwrap();
    }
    daemon.child.signal("-HUP");
    let begun = Instant::now();
    while tare(&daemon.with_certificates(other.path()), None, "Ann").await.is_err() {
        assert!(begun.elapsed() < PATIENCE, "the new certificates do not count");
    }
    tare(&daemon.with_certificates(old.path()), None, "Ann").await.unwrap_err();
    // The tokens are read after the certificates.
    while tare(&unix, Some(token.trim()), "Ann").await.is_err() {
        assert!(begun.elapsed() < PATIENCE, "the new tokens do not count");
    }

    std::fs::write(folder.path().join("server.pem"), "no certificate").unwrap();
    daemon.child.signal("-HUP");
    tare(&daemon.with_certificates(other.path()), None, "Ann").await.unwrap();

    // A pipe in its place is never read to its end.
    make_pipe(&folder.path().join("server.pem"));
    std::fs::write(folder.path().join("tokens"), "").unwrap();
    daemon.child.signal("-HUP");
    until_refused(&unix, token.trim()).await;
    tare(&daemon.with_certificates(other.path()), None, "Ann").await.unwrap();
}

/// Puts a pipe that nobody writes to in the place of a file.
fn make_pipe(path: &Path) {
    std::fs::remove_file(path).unwrap();
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
}

async fn until_refused(channel: &Channel, token: &str) {
    let begun = Instant::now();
    while tare(channel, Some(token), "Ann").await.is_ok() {
        assert!(begun.elapsed() < PATIENCE, "the token counts for ever");
        tokio::task::yield_now().await;
    }
}

#[tokio::test]
async fn on_a_signal_other_grants_count_at_once_and_calls_that_came_before_go_on() {
    if !openssl() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    make_certificates(folder.path());
    let daemon = Daemon::start(folder.path());
    let (unix, operator) = (daemon.unix().await, daemon.with_certificates(folder.path()));
    let mut skin = SkinServiceClient::new(unix.clone());
    let request = v1::StreamRequest { patch: "left_forearm".to_owned(), ..v1::StreamRequest::default() };
    let mut stream = skin.stream_taxels(request).await.unwrap().into_inner();
    assert_eq!(tare(&unix, None, "Ann").await.unwrap_err().code(), Code::PermissionDenied);
    tare(&operator, None, "Ann").await.unwrap();

    let path = folder.path().join("taxeld.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let hang_up_with = |text: &str| {
        std::fs::write(&path, text).unwrap();
        daemon.child.signal("-HUP");
    };
    // Who comes by the socket may, and the certificate's grant is gone.
    hang_up_with(
        &text.replace(GRANT, "operators = [\"unix\"]\nobservers = [\"certificate:spiffe://robot/skin/operator\"]"),
    );
    let begun = Instant::now();
    while tare(&unix, None, "Ann").await.is_err_and(|error| error.code() == Code::PermissionDenied) {
        assert!(begun.elapsed() < PATIENCE, "the new grants do not count");
    }
    assert_eq!(tare(&operator, None, "Ann").await.unwrap_err().code(), Code::PermissionDenied);
    assert!(stream.message().await.unwrap().is_some(), "the stream goes on");

    // A file that cannot be used changes nothing.
    hang_up_with(&text.replace(GRANT, "operators = [\"nobody\"]"));
    tare(&unix, None, "Ann").await.unwrap();
}

#[tokio::test]
async fn the_commands_come_over_tls_with_certificates_and_not_without() {
    if !openssl() {
        return;
    }
    let (folder, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    make_certificates(folder.path());
    make_certificates(other.path());
    let daemon = Daemon::start(folder.path());
    daemon.unix().await;
    let list = |arguments: &[&str], folder: &Path| {
        let command = ["sessions", "list", "--server", &daemon.tls];
        let output =
            Command::new(env!("CARGO_BIN_EXE_taxeld")).args(command).args(arguments).current_dir(folder).output();
        let output = output.unwrap();
        (output.status.success(), String::from_utf8(output.stderr).unwrap())
    };
    for folder in [&folder, &other] {
        for (made, name) in [("operator.pem", "client.pem"), ("operator.key", "client.key")] {
            std::fs::copy(folder.path().join(made), folder.path().join(name)).unwrap();
        }
    }
    let nothing = tempfile::tempdir().unwrap();
    let shown = ["--tls", ".", "--tls-name", "robot.example"];
    assert_eq!(list(&shown, folder.path()), (true, String::new()));

    // Of another authority, for another name, from a folder without them, and with none at all.
    for (arguments, folder, word) in [
        (&shown[..], other.path(), "certificate"),
        (&["--tls", ".", "--tls-name", "robot.elsewhere"], folder.path(), "robot.elsewhere"),
        (&shown[..], nothing.path(), "ca.pem"),
        (&[], folder.path(), "no daemon answers"),
    ] {
        let (done, said) = list(arguments, folder);
        assert!(!done && said.contains(word), "{arguments:?}: {said}");
    }
}
