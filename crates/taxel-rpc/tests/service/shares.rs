//! What one peer can take, what is left for others, and what is kept for operators.

use std::time::Duration;

use taxel_engine::command::{ErrorReason, Rejection};
use taxel_proto::v1;
use taxel_proto::v1::calibration_service_client::CalibrationServiceClient;
use taxel_proto::v1::force_service_client::ForceServiceClient;
use taxel_proto::v1::skin_service_client::SkinServiceClient;
use taxel_rpc::{Access, Limits, Listener, Rate, Role, Rules};
use tokio::net::TcpStream;
use tonic::transport::{Channel, Endpoint};
use tonic::{Code, Status, Streaming};
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_client::HealthClient;

use crate::fixture::{Daemon, FOREARM, patient, serve_on, start_with};

type Force = Streaming<v1::ForceSample>;

async fn stream(channel: &Channel) -> Result<Force, Status> {
    let request = v1::StreamForceRequest::default();
    ForceServiceClient::new(channel.clone()).stream_force(request).await.map(tonic::Response::into_inner)
}

/// A daemon on loopback and on a Unix socket, two peers for one test.
fn on_two_doors(rules: Rules, limits: Limits) -> (Daemon, tempfile::TempDir, Endpoint) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("socket");
    let tcp = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = tcp.local_addr().unwrap();
    let unix = std::os::unix::net::UnixListener::bind(&path).unwrap();
    let listeners = vec![Listener::Tcp(tcp), Listener::Unix(unix)];
    let daemon = serve_on(listeners, Access::new(rules), (&[FOREARM], limits), address);
    let endpoint = Endpoint::from_shared(format!("unix:{}", path.display())).unwrap();
    (daemon, folder, endpoint)
}

#[tokio::test]
async fn the_stream_beyond_a_peers_share_is_refused_on_its_channel_and_calls_beside_it_go_on() {
    let limits = Limits { streams: 128, ..patient() };
    let (daemon, _folder, unix) = on_two_doors(Rules::open(), limits);
    let channel = daemon.connect().await;
    let mut held = Vec::new();
    for _ in 0..100 {
        held.push(stream(&channel).await.unwrap());
    }
    for _ in 0..300 {
        let status = stream(&channel).await.unwrap_err();
        assert_eq!(status.code(), Code::ResourceExhausted);
        assert!(status.message().contains("100 streams of loopback TCP are being served"), "{status:?}");
    }
    ForceServiceClient::new(channel.clone()).get_force(v1::GetForceRequest::default()).await.unwrap();
    // All streams of the channel still run, and another peer has its own share.
    for stream in &mut held {
        stream.message().await.unwrap().unwrap();
    }
    stream(&unix.connect().await.unwrap()).await.unwrap();
    drop(held);
    let mut skin = SkinServiceClient::new(channel.clone());
    while skin.get_health(v1::GetHealthRequest {}).await.unwrap().into_inner().streams > 0 {}
    stream(&channel).await.unwrap();
}

#[tokio::test]
async fn observers_leave_streams_for_operators() {
    let limits = Limits { streams: 10, streams_reserved: 3, ..patient() };
    let rules = Rules { loopback: Some(Role::Observer), unix: Some(Role::Operator), ..Rules::default() };
    let (daemon, _folder, unix) = on_two_doors(rules, limits);
    let (observer, operator) = (daemon.connect().await, unix.connect().await.unwrap());
    let mut held = Vec::new();
    for _ in 0..7 {
        held.push(stream(&observer).await.unwrap());
    }
    let status = stream(&observer).await.unwrap_err();
    assert_eq!(status.code(), Code::ResourceExhausted);
    assert!(status.message().contains("the last 3 streams are kept for operators"), "{status:?}");
    for _ in 0..3 {
        held.push(stream(&operator).await.unwrap());
    }
    assert!(stream(&operator).await.unwrap_err().message().contains("10 streams are being served"));
}

#[tokio::test]
async fn one_peers_connections_leave_room_for_others() {
    let limits = Limits { connections: 6, connections_per_peer: 4, connections_reserved: 0, ..patient() };
    let (daemon, _folder, unix) = on_two_doors(Rules::open(), limits);
    let mut held = Vec::new();
    for _ in 0..4 {
        let channel = daemon.connect().await;
        ForceServiceClient::new(channel.clone()).get_force(v1::GetForceRequest::default()).await.unwrap();
        held.push(channel);
    }
    let fifth = daemon.endpoint().connect_lazy();
    ForceServiceClient::new(fifth).get_force(v1::GetForceRequest::default()).await.unwrap_err();
    let other = unix.connect().await.unwrap();
    ForceServiceClient::new(other).get_force(v1::GetForceRequest::default()).await.unwrap();
}

#[tokio::test]
async fn a_thousand_idle_sockets_keep_no_client_out() {
    let daemon = start_with(&[FOREARM], patient()).await;
    let mut idle = Vec::new();
    for _ in 0..900 {
        idle.push(TcpStream::connect(daemon.address).await.unwrap());
    }
    for _ in 0..20 {
        let channel = daemon.connect().await;
        ForceServiceClient::new(channel).get_force(v1::GetForceRequest::default()).await.unwrap();
    }
    // The oldest were closed for the newer ones.
    crate::server::read_to_end(&mut idle[0]).await;
}

/// A measurement, not a check: how long a new client waits beside idle sockets.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "prints figures; run it alone with --release -- --ignored --nocapture, after ulimit -n 8192"]
async fn figures_of_a_new_client_beside_two_thousand_idle_sockets() {
    let daemon = start_with(&[FOREARM], Limits { preface: Duration::from_secs(3), ..patient() }).await;
    let (address, mut idle) = (daemon.address, Vec::new());
    for _ in 0..2_000 {
        idle.push(TcpStream::connect(address).await.unwrap());
    }
    let mut waits = Vec::new();
    for _ in 0..50 {
        let begun = std::time::Instant::now();
        let channel = daemon.connect().await;
        ForceServiceClient::new(channel).get_force(v1::GetForceRequest::default()).await.unwrap();
        waits.push(begun.elapsed());
    }
    waits.sort();
    println!("a new client waits beside 2000 idle sockets: median {:?}, most {:?}", waits[25], waits[49]);
}

#[tokio::test]
async fn a_flood_of_sessions_is_bounded_and_says_when_one_more_may_start() {
    let session_starts = Rate { burst: 5, every: Duration::from_secs(3600) };
    let (mut daemon, _folder, unix) = on_two_doors(Rules::open(), Limits { session_starts, ..patient() });
    let mut requests = daemon.take_requests();
    let engine = tokio::spawn(async move {
        let mut reached = 0;
        while let Some(request) = requests.recv().await {
            reached += 1;
            let _ = request.reply.send(Err(Rejection::FailedPrecondition(
                ErrorReason::SessionWrongState,
                "not in this test".to_owned(),
            )));
            if reached == 6 {
                break;
            }
        }
        reached
    });
    let mut client = CalibrationServiceClient::new(daemon.connect().await);
    let mut refused = 0;
    for _ in 0..1_000 {
        let status = client.start_session(v1::StartSessionRequest::default()).await.unwrap_err();
        if status.code() == Code::ResourceExhausted {
            let text = status.message();
            assert!(text.contains("loopback TCP asked for more than") && text.contains("try again in"), "{text}");
            refused += 1;
        }
    }
    assert_eq!(refused, 995);
    // Another peer is not kept out by it.
    let mut other = CalibrationServiceClient::new(unix.connect().await.unwrap());
    let status = other.start_session(v1::StartSessionRequest::default()).await.unwrap_err();
    assert_eq!(status.code(), Code::FailedPrecondition);
    assert_eq!(engine.await.unwrap(), 6);
}

#[tokio::test]
async fn a_watch_of_the_health_takes_a_place_and_gives_it_back() {
    let daemon = start_with(&[FOREARM], Limits { streams: 2, ..patient() }).await;
    let channel = daemon.connect().await;
    let mut health = HealthClient::new(channel.clone());
    let request = || HealthCheckRequest { service: String::new() };
    let first = health.watch(request()).await.unwrap();
    let _second = stream(&channel).await.unwrap();
    assert_eq!(health.watch(request()).await.unwrap_err().code(), Code::ResourceExhausted);
    health.check(request()).await.unwrap();
    drop(first);
    while health.watch(request()).await.is_err() {}
}
