//! The documented way to certificates and tokens, word for word, and a daemon that lives by them.

use taxel_proto::v1::audit_service_client::AuditServiceClient;
use tonic::Request;
use tonic::transport::{Certificate, Channel, ClientTlsConfig, Endpoint, Identity};

use crate::common::*;
use crate::daemon::Daemon;

/// The lines of deploy/security.md that make authority, certificates and a token.
fn documented_lines() -> &'static str {
    let text = include_str!("../../../../deploy/security.md");
    let (_, rest) = text.split_once("```sh\n").unwrap();
    rest.split_once("```").unwrap().0
}

/// A folder with certificates and tokens; `None` without openssl, of which tests/run sees to it that it is there.
fn certified() -> Option<TempDir> {
    let folder = tempfile::tempdir().unwrap();
    let script = format!("set -eu\nopenssl version\n{}", documented_lines());
    let output = Command::new("sh").args(["-c", &script]).current_dir(folder.path()).output().unwrap();
    if output.status.code() == Some(127) {
        println!("skipped: openssl is not installed");
        return None;
    }
    assert!(output.status.success(), "{}", text(&output.stderr));
    Some(folder)
}

/// What the certificate of the documented lines may do.
const GRANT: &str = r#"operators = ["certificate:spiffe://robot/skin/operator"]"#;

/// Writes the configuration of a daemon that lives by the certificates and tokens in this folder.
fn secure(folder: &Path, key: &str) {
    let path = folder.join("taxeld.toml");
    let tls = format!("tls = {{ cert = \"server.pem\", key = \"{key}\", client_ca = \"ca.pem\" }}");
    let text = std::fs::read_to_string(&path).unwrap().replace("tcp:", "tls:");
    let secured = format!("{tls}\n[access]\ntokens = \"tokens\"\n{GRANT}\n[store]");
    std::fs::write(path, text.replace("[store]", &secured)).unwrap();
}

fn start(folder: &Path) -> Daemon {
    Daemon::start_in(folder, |_, folder| secure(folder, "server.key"))
}

impl Daemon {
    fn socket(&self) -> String {
        format!("unix:{}", self.folder.join("socket").display())
    }

    /// The Unix socket, as soon as the daemon answers on it, whatever it says: all its doors are open then. That the socket
    /// takes a connection says less, since it is there earlier.
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
        Endpoint::from_shared(format!("https://{}", self.address)).unwrap().tls_config(config).unwrap().connect_lazy()
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
    let Some(folder) = certified() else { return };
    let mut daemon = Daemon::start_in(folder.path(), |_, folder| secure(folder, "operator.key"));
    assert!(!daemon.child.0.wait().unwrap().success());
    assert!(daemon.log().contains("server.pem: does not go with the key"), "{}", daemon.log());
}

#[tokio::test]
async fn a_daemon_lives_by_the_documented_certificates_and_tokens_and_its_audit_log_names_who_came() {
    let Some(folder) = certified() else { return };
    let daemon = start(folder.path());
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

    for line in ["a call was refused: taxel.v1.SkinService/Tare from ", "command=\"Tare\""] {
        until_logged(folder.path(), line);
    }

    let token_file = path(folder.path(), "bench.token");
    let audit = |daemon: &Daemon, more: &[&str]| {
        succeeds(&[&["audit", "--server", &daemon.socket(), "--token", &token_file], more].concat())
    };
    let text = audit(&daemon, &[]);
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 2, "{text}");
    assert!(lines[0].contains("token bench (operator, unix uid "), "{text}");
    assert!(lines[1].contains("spiffe://robot/skin/operator (operator, tls 127.0.0.1:"), "{text}");
    assert_eq!(audit(&daemon, &["--patch", "no-such-patch"]), "the audit log is empty\n");
    assert_eq!(audit(&daemon, &["--patch", "forearm"]), text);

    // Killed and started again on the socket that it left.
    drop(daemon);
    let daemon = start(folder.path());
    tare(&daemon.unix().await, Some(token.trim()), "Ann").await.unwrap();
    let text = audit(&daemon, &[]);
    assert_eq!(text.lines().count(), 3, "what was answered is there");
}

#[tokio::test]
async fn on_a_signal_other_certificates_and_tokens_count_and_useless_ones_change_nothing() {
    let (Some(folder), Some(other)) = (certified(), certified()) else { return };
    let old = tempfile::tempdir().unwrap();
    for name in ["ca.pem", "operator.pem", "operator.key"] {
        std::fs::copy(folder.path().join(name), old.path().join(name)).unwrap();
    }
    let daemon = start(folder.path());
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
    let certificate = path(folder.path(), "server.pem");
    std::fs::remove_file(&certificate).unwrap();
    assert!(Command::new("mkfifo").arg(certificate).status().unwrap().success());
    std::fs::write(folder.path().join("tokens"), "").unwrap();
    daemon.child.signal("-HUP");
    let begun = Instant::now();
    while tare(&unix, Some(token.trim()), "Ann").await.is_ok() {
        assert!(begun.elapsed() < PATIENCE, "the token counts for ever");
    }
    tare(&daemon.with_certificates(other.path()), None, "Ann").await.unwrap();
}

#[tokio::test]
async fn on_a_signal_other_grants_count_at_once_and_calls_that_came_before_go_on() {
    let Some(folder) = certified() else { return };
    let daemon = start(folder.path());
    let (unix, operator) = (daemon.unix().await, daemon.with_certificates(folder.path()));
    let mut skin = SkinServiceClient::new(unix.clone());
    let request = v1::StreamRequest { patch: "forearm".to_owned(), ..v1::StreamRequest::default() };
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
    let (Some(folder), Some(other)) = (certified(), certified()) else { return };
    let daemon = start(folder.path());
    daemon.unix().await;
    let list = |arguments: &[&str], folder: &Path| {
        let command = ["sessions", "list", "--server", &format!("https://{}", daemon.address)];
        let mut taxeld = Command::new(env!("CARGO_BIN_EXE_taxeld"));
        let output = taxeld.args(command).args(arguments).current_dir(folder).output().unwrap();
        (output.status.success(), text(&output.stderr))
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
