//! Every method of every service, with every role and every credential: nothing is let through that should not be, and
//! nothing is kept out that should not be. What is expected is written down here once more, and not read from the table.

use std::sync::atomic::AtomicUsize;

use prost::Message;
use prost_types::FileDescriptorSet;
use rcgen::SanType;
use taxel_rpc::{Grant, Role, Subject, Tls, Tokens};
use tonic::body::Body;
use tonic::codegen::{Bytes, Service, http};
use tonic::transport::{Certificate, ClientTlsConfig};

use crate::certificates::{Authority, Leaf, files};
use crate::fixture::*;
use crate::reasons::reason;

/// Methods that need more than an observer.
const OPERATOR: [&str; 10] = [
    "taxel.v1.AuditService/ListAudit",
    "taxel.v1.SkinService/Tare",
    "taxel.v1.SkinService/BringUp",
    "taxel.v1.CalibrationService/StartSession",
    "taxel.v1.ModelService/ActivateModelSet",
    "taxel.v1.ValidationService/RecordLoad",
    "taxel.v1.CalibrationService/AdvanceSession",
    "taxel.v1.CalibrationService/RefitSessions",
    "taxel.v1.ValidationService/Recalibrate",
    "taxel.v1.IngestService/PushScans",
];
const ADMIN: [&str; 3] = [
    "taxel.v1.CalibrationService/DeleteSession",
    "taxel.v1.ModelService/ImportModelSet",
    "taxel.v1.ModelService/DeleteModelSet",
];

/// Full names of all methods that reflection tells of.
fn methods() -> Vec<String> {
    let sets = [
        taxel_proto::DESCRIPTORS,
        tonic_health::pb::FILE_DESCRIPTOR_SET,
        tonic_reflection::pb::v1::FILE_DESCRIPTOR_SET,
        tonic_reflection::pb::v1alpha::FILE_DESCRIPTOR_SET,
    ];
    let files = sets.iter().flat_map(|set| FileDescriptorSet::decode(*set).unwrap().file);
    let names = files.flat_map(|file| {
        let package = file.package().to_owned();
        let of_service = move |service: prost_types::ServiceDescriptorProto| {
            let prefix = format!("{package}.{}", service.name());
            service.method.into_iter().map(move |method| format!("{prefix}/{}", method.name())).collect::<Vec<_>>()
        };
        file.service.into_iter().flat_map(of_service).collect::<Vec<_>>()
    });
    let mut names: Vec<String> = names.collect();
    names.sort();
    names.dedup();
    names
}

fn needed(method: &str) -> Role {
    match method {
        method if ADMIN.contains(&method) => Role::Admin,
        method if OPERATOR.contains(&method) => Role::Operator,
        _ => Role::Observer,
    }
}

/// Calls a method with an empty request. `None`: it was let through and answers something.
async fn call(channel: &mut Channel, method: &str, token: Option<&str>) -> Result<Option<Status>, String> {
    let mut request = http::Request::post(format!("http://localhost/{method}"))
        .header("content-type", "application/grpc")
        .header("te", "trailers");
    if let Some(token) = token {
        request = request.header("authorization", format!("Bearer {token}"));
    }
    let request = request.body(Body::new(http_body_util::Full::new(Bytes::from_static(&[0; 5])))).unwrap();
    std::future::poll_fn(|cx| channel.poll_ready(cx)).await.map_err(|error| format!("{error:?}"))?;
    let answer = channel.call(request).await.map_err(|error| format!("{error:?}"))?;
    Ok(Status::from_header_map(answer.headers()))
}

/// What a credential should come to.
#[derive(Clone, Copy, Debug)]
enum Expected {
    /// This role, by name or nameless.
    Role(Option<Role>, Code),
    /// Nothing at all is let through, as nobody knows who it is.
    Nobody,
}

/// Whether the answer to one call is what it should be.
fn judge(method: &str, expected: Expected, answer: Option<&Status>) {
    let shown = format!("{method} with {expected:?}: {answer:?}");
    let code = answer.map_or(Code::Ok, Status::code);
    let reason = answer.filter(|_| code != Code::Ok).map(reason);
    match expected {
        Expected::Nobody => {
            assert_eq!(code, Code::Unauthenticated, "{shown}");
            assert_eq!(reason, Some(ErrorReason::CredentialsRefused), "{shown}");
        }
        Expected::Role(role, _) if role >= Some(needed(method)) => {
            let refused = [Code::Unauthenticated, Code::PermissionDenied, Code::Unimplemented, Code::ResourceExhausted];
            assert!(!refused.contains(&code), "{shown}");
        }
        Expected::Role(role, refusal) => {
            assert_eq!((code, reason), (refusal, Some(ErrorReason::RoleTooLow)), "{shown}");
            let text = answer.unwrap().message();
            assert!(text.contains(method) && text.contains(needed(method).name()), "{shown}");
            assert!(text.contains(role.map_or("no role", Role::name)), "{shown}");
        }
    }
}

/// A daemon behind all sorts of doors, whose engine refuses every command and counts them.
struct House {
    daemon: Daemon,
    commands: Arc<AtomicUsize>,
    access: Access,
    rules: Rules,
    authority: Authority,
    stranger: Authority,
    tls: std::net::SocketAddr,
    unix: std::path::PathBuf,
    _folder: tempfile::TempDir,
}

fn rules() -> Rules {
    let name = |role: Role| format!("spiffe://robot/{role}");
    let hash = |token: &str| {
        use sha2::Digest;
        sha2::Sha256::digest(token).iter().map(|byte| format!("{byte:02x}")).collect::<String>()
    };
    let line = |role: &Role| format!("{role} {role} {}\n", hash(&format!("{role}-token")));
    Rules {
        grants: Role::ALL.map(|role| Grant { subject: Subject::Certificate(name(role)), role }).into(),
        tokens: Tokens::parse(&Role::ALL.iter().map(line).collect::<String>()).unwrap(),
        ..Rules::default()
    }
}

async fn house() -> House {
    let folder = tempfile::tempdir().unwrap();
    let (authority, stranger) = (Authority::new(), Authority::new());
    let tls = Tls::load(files(folder.path(), &authority.server(), &authority)).unwrap();
    let bind = || std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let (plain, encrypted, unix) = (bind(), bind(), folder.path().join("socket"));
    let (address, tls_address) = (plain.local_addr().unwrap(), encrypted.local_addr().unwrap());
    let listeners = vec![
        Listener::Tcp(plain),
        Listener::Tls(encrypted, tls),
        Listener::Unix(std::os::unix::net::UnixListener::bind(&unix).unwrap()),
    ];
    let access = Access::new(rules());
    let mut daemon = serve_on(listeners, access.clone(), (&[FOREARM], patient()), address);
    let commands = Arc::new(AtomicUsize::new(0));
    let (counted, mut requests) = (Arc::clone(&commands), daemon.take_requests());
    tokio::spawn(async move {
        while let Some(request) = requests.recv().await {
            counted.fetch_add(1, Ordering::SeqCst);
            let _ = request.reply.send(Err(Rejection::FailedPrecondition(
                taxel_engine::command::ErrorReason::SessionWrongState,
                "not in this test".to_owned(),
            )));
        }
    });
    House { daemon, commands, access, rules: rules(), authority, stranger, tls: tls_address, unix, _folder: folder }
}

impl House {
    /// Calls every method and looks at each answer.
    async fn walk(&self, channel: &mut Channel, token: Option<&str>, expected: Expected) {
        for method in methods() {
            let before = self.commands.load(Ordering::SeqCst);
            let answer = call(channel, &method, token).await.unwrap();
            judge(&method, expected, answer.as_ref());
            let let_through = matches!(expected, Expected::Role(role, _) if role >= Some(needed(&method)));
            let reached = self.commands.load(Ordering::SeqCst) > before;
            assert!(let_through || !reached, "{method} reached the engine with {expected:?}");
        }
    }

    fn with_certificate(&self, leaf: Option<&Leaf>) -> Channel {
        let mut config =
            ClientTlsConfig::new().ca_certificate(Certificate::from_pem(self.authority.pem())).domain_name("localhost");
        if let Some(leaf) = leaf {
            config = config.identity(leaf.identity());
        }
        let endpoint = Endpoint::from_shared(format!("https://{}", self.tls)).unwrap();
        endpoint.tls_config(config).unwrap().connect_lazy()
    }
}

#[tokio::test]
async fn over_loopback_each_role_may_do_what_the_table_says_and_nothing_else() {
    let house = house().await;
    let mut channel = house.daemon.connect().await;
    for role in [None, Some(Role::Observer), Some(Role::Operator), Some(Role::Admin)] {
        house.access.update(|_| Rules { loopback: role, ..house.rules.clone() });
        house.walk(&mut channel, None, Expected::Role(role, Code::Unauthenticated)).await;
    }
}

#[tokio::test]
async fn with_a_token_each_role_may_do_what_the_table_says_and_a_wrong_one_is_nobody() {
    let house = house().await;
    // A wrong token is not let through as somebody without one, either.
    house.access.update(|_| Rules { loopback: Some(Role::Admin), ..house.rules.clone() });
    let mut channel = house.daemon.connect().await;
    for role in Role::ALL {
        let token = format!("{role}-token");
        house.walk(&mut channel, Some(&token), Expected::Role(Some(role), Code::PermissionDenied)).await;
    }
    for wrong in ["", "x", "admin-token2", "admin-toke"] {
        house.walk(&mut channel, Some(wrong), Expected::Nobody).await;
    }
}

#[tokio::test]
async fn on_the_unix_socket_each_account_may_do_what_its_grant_says() {
    let house = house().await;
    let endpoint = Endpoint::from_shared(format!("unix:{}", house.unix.display())).unwrap();
    let mut channel = endpoint.connect().await.unwrap();
    let own = nix::unistd::geteuid().to_string();
    for role in Role::ALL {
        let mut rules = house.rules.clone();
        rules.grants.push(Grant { subject: Subject::User(own.clone()), role });
        house.access.update(|_| rules);
        house.walk(&mut channel, None, Expected::Role(Some(role), Code::PermissionDenied)).await;
    }
    house.access.update(|_| house.rules.clone());
    house.walk(&mut channel, None, Expected::Role(None, Code::PermissionDenied)).await;
}

#[tokio::test]
async fn with_a_certificate_each_name_may_do_what_its_grant_says() {
    let house = house().await;
    for role in Role::ALL {
        let leaf = house.authority.client(&format!("spiffe://robot/{role}"));
        let mut channel = house.with_certificate(Some(&leaf));
        house.walk(&mut channel, None, Expected::Role(Some(role), Code::PermissionDenied)).await;
    }
    let leaf = house.authority.client("spiffe://robot/somebody-else");
    let mut channel = house.with_certificate(Some(&leaf));
    house.walk(&mut channel, None, Expected::Role(None, Code::PermissionDenied)).await;
    house
        .walk(&mut channel, Some("operator-token"), Expected::Role(Some(Role::Operator), Code::PermissionDenied))
        .await;
}

#[tokio::test]
async fn a_name_of_a_certificate_has_no_role_of_a_name_of_another_kind() {
    let house = house().await;
    let mut rules = house.rules.clone();
    let boss = ["CN=boss".to_owned(), "DNS:boss.example".to_owned()];
    rules.grants.extend(boss.map(|name| Grant { subject: Subject::Certificate(name), role: Role::Admin }));
    house.access.update(|_| rules);
    let dns = |name: &str| SanType::DnsName(name.try_into().unwrap());
    let uri = |text: &str| SanType::URI(text.try_into().unwrap());
    let cases = [
        (["boss"].as_slice(), uri("spiffe://robot/somebody"), Some(Role::Admin)),
        (&["nobody"], dns("boss.example"), Some(Role::Admin)),
        (&["nobody"], uri("CN=boss"), None),
        (&["nobody"], uri("DNS:boss.example"), None),
        (&["nobody"], dns("CN=boss"), None),
        (&["CN=boss"], dns("boss"), None),
        (&["DNS:boss.example"], uri("boss"), None),
        (&["spiffe://robot/admin"], dns("spiffe://robot/admin"), None),
        (&["boss", "nobody"], uri("spiffe://robot/somebody"), None),
        (&["nobody", "boss"], uri("spiffe://robot/somebody"), None),
        (&["boss", "nobody"], uri("spiffe://robot/operator"), Some(Role::Operator)),
    ];
    for (common, alternative, role) in cases {
        println!("{common:?}, {alternative:?}");
        let leaf = house.authority.named_client(common, alternative);
        let mut channel = house.with_certificate(Some(&leaf));
        for method in ["taxel.v1.SkinService/Tare", "taxel.v1.ModelService/DeleteModelSet"] {
            let answer = call(&mut channel, method, None).await.unwrap();
            judge(method, Expected::Role(role, Code::PermissionDenied), answer.as_ref());
        }
    }
}

#[tokio::test]
async fn with_no_certificate_an_expired_one_or_one_of_another_authority_no_call_gets_through() {
    let house = house().await;
    let expired = house.authority.expired_client("spiffe://robot/admin");
    let strange = house.stranger.client("spiffe://robot/admin");
    for leaf in [None, Some(&expired), Some(&strange)] {
        for method in methods() {
            // A connection of its own for each: not one of them may be let in.
            let mut channel = house.with_certificate(leaf);
            let answer = call(&mut channel, &method, Some("admin-token")).await;
            assert!(answer.is_err(), "{method}: {answer:?}");
        }
    }
    let plain = Endpoint::from_shared(format!("http://{}", house.tls)).unwrap().connect_lazy();
    let answer = call(&mut plain.clone(), "taxel.v1.ForceService/GetForce", None).await;
    assert!(answer.is_err(), "{answer:?}");
    assert_eq!(house.commands.load(Ordering::SeqCst), 0);
}

#[tokio::test]
async fn what_is_not_served_is_not_found_whoever_asks() {
    let house = house().await;
    house.access.update(|_| Rules { loopback: Some(Role::Admin), ..house.rules.clone() });
    let mut channel = house.daemon.connect().await;
    for method in ["", "/", "taxel.v1.SkinService", "taxel.v1.SkinService/tare", "taxel.v1.SkinService/Tare/", "x/y"] {
        let answer = call(&mut channel, method, None).await.unwrap();
        assert_eq!(answer.as_ref().map(Status::code), Some(Code::Unimplemented), "{method}");
        assert_eq!(answer.as_ref().map(reason), Some(ErrorReason::MethodUnknown), "{method}");
    }
}
