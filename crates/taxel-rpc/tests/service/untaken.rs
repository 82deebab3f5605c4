//! Requests that do not come on and answers that nobody takes: what they hold is bounded, and free again.

use std::sync::Arc;
use std::time::Duration;

use http_body_util::StreamBody;
use prost::Message;
use taxel_engine::calibration::{Sample, SessionSamples, SessionState, SessionView};
use taxel_engine::command::{Command, Done};
use taxel_engine::loads::{JudgedLoad, Validation};
use taxel_engine::snapshot::Catalogue;
use taxel_proto::refusal::reason_of;
use taxel_proto::v1;
use taxel_proto::v1::audit_service_client::AuditServiceClient;
use taxel_proto::v1::calibration_service_client::CalibrationServiceClient;
use taxel_proto::v1::force_service_client::ForceServiceClient;
use taxel_proto::v1::model_service_client::ModelServiceClient;
use taxel_proto::v1::skin_service_client::SkinServiceClient;
use taxel_proto::v1::validation_service_client::ValidationServiceClient;
use taxel_rpc::Limits;
use taxel_skin::Time;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use tokio_stream::wrappers::ReceiverStream;
use tonic::body::Body;
use tonic::codegen::{Bytes, Service, http};
use tonic::transport::Channel;
use tonic::{Code, Status};

use crate::fixture::{
    Daemon, FOREARM, TAXELS, model_set, patient, snapshot, start, start_audited, start_with, start_with_samples,
};

const GET_FORCE: &str = "/taxel.v1.ForceService/GetForce";
/// Calls that are made until something has to have come about that takes milliseconds.
const TRIES: u32 = 100_000;
const STREAM_FORCE: &str = "/taxel.v1.ForceService/StreamForce";
const IMPORT: &str = "/taxel.v1.ModelService/ImportModelSet";

/// A request of which the rest never comes: five bytes say that a message of 100 follows, and one of these is sent.
struct HalfSent {
    answer: JoinHandle<http::Response<Body>>,
    _rest: mpsc::Sender<Result<http_body::Frame<Bytes>, Status>>,
}

async fn half_sent(channel: &Channel, path: &str) -> HalfSent {
    let (rest, body) = mpsc::channel(1);
    rest.send(Ok(http_body::Frame::data(Bytes::from_static(&[0, 0, 0, 0, 100, 1])))).await.unwrap();
    let request = http::Request::post(path)
        .header("content-type", "application/grpc")
        .body(Body::new(StreamBody::new(ReceiverStream::new(body))))
        .unwrap();
    let mut channel = channel.clone();
    std::future::poll_fn(|cx| Service::<http::Request<Body>>::poll_ready(&mut channel, cx)).await.unwrap();
    let answer = channel.call(request); // in line from here on, before whatever is asked next
    HalfSent { answer: tokio::spawn(async move { answer.await.unwrap() }), _rest: rest }
}

async fn get_force(channel: &Channel) -> Result<v1::ForceSample, Status> {
    let mut client = ForceServiceClient::new(channel.clone());
    client.get_force(v1::GetForceRequest::default()).await.map(tonic::Response::into_inner)
}

/// Asks again until it is so. Tries are counted, so that a fault ends the test.
async fn until(mut is_so: impl AsyncFnMut() -> bool) {
    for _ in 0..TRIES {
        if is_so().await {
            return;
        }
    }
    panic!("it is not so after {TRIES} calls");
}

/// A client that makes room for no byte of any answer.
pub async fn without_room(daemon: &Daemon) -> Channel {
    daemon.endpoint().initial_stream_window_size(0).connect().await.unwrap()
}

async fn untaken_force(channel: &Channel) -> http::Response<Body> {
    untaken(channel, GET_FORCE, &v1::GetForceRequest::default()).await
}

/// The answer to a call, of which only the head has come.
pub async fn untaken(channel: &Channel, path: &str, message: &impl Message) -> http::Response<Body> {
    let mut channel = channel.clone();
    let mut bytes = vec![0]; // not compressed
    bytes.extend(u32::try_from(message.encoded_len()).unwrap().to_be_bytes());
    bytes.extend(message.encode_to_vec());
    let request = http::Request::post(path)
        .header("content-type", "application/grpc")
        .body(Body::new(http_body_util::Full::new(Bytes::from(bytes))))
        .unwrap();
    std::future::poll_fn(|cx| Service::<http::Request<Body>>::poll_ready(&mut channel, cx)).await.unwrap();
    channel.call(request).await.unwrap()
}

#[tokio::test]
async fn only_a_model_set_may_be_large() {
    let daemon = start().await;
    let mut client = ModelServiceClient::new(daemon.connect().await);
    let long = "x".repeat(100_000);
    let request = v1::GetModelSetRequest { model_set: long.clone(), ..Default::default() };
    let status = client.get_model_set(request).await.unwrap_err();
    assert_eq!((status.code(), reason_of(&status).as_deref()), (Code::OutOfRange, Some("REQUEST_UNREADABLE")));
    let request = v1::ImportModelSetRequest { json: long, ..Default::default() };
    let status = client.import_model_set(request).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument, "it is read: {status:?}");
}

#[tokio::test]
async fn a_model_set_is_taken_in_when_the_one_before_it_is_read_or_given_up() {
    let mut daemon = start().await;
    let channel = daemon.connect().await;
    let first = half_sent(&channel, IMPORT).await;
    let mut client = ModelServiceClient::new(daemon.connect().await);
    let import = async move {
        client.import_model_set(v1::ImportModelSetRequest { json: "set m-1".to_owned(), ..Default::default() }).await
    };
    tokio::pin!(import);
    let others = async {
        for _ in 0..20 {
            let _ = get_force(&channel).await;
        }
    };
    tokio::select! {
        _ = &mut import => panic!("two were taken in at once"),
        () = others => {}
    }
    assert!(daemon.requests.try_recv().is_err(), "nothing has reached the engine");
    first.answer.abort();
    drop(first);
    let imported = |command| assert!(matches!(command, Command::Import { .. }), "{command:?}");
    let done = Ok(Done::Imported { model_set: "m-1".to_owned() });
    let (answer, ()) = tokio::join!(import, daemon.answer(done, imported));
    assert_eq!(answer.unwrap().into_inner().model_set, "m-1");
}

#[tokio::test]
async fn a_request_that_does_not_come_on_ends_and_its_turn_and_place_are_free() {
    let (calls, opening) = (1, 1);
    let limits = Limits { body_pause: Duration::from_millis(20), calls, opening, ..patient() };
    let limits = Limits { calls_reserved: 0, opening_reserved: 0, ..limits };
    let daemon = start_with(&[FOREARM], limits).await;
    let channel = daemon.connect().await;
    for path in [GET_FORCE, IMPORT, IMPORT, STREAM_FORCE, STREAM_FORCE] {
        let answer = half_sent(&channel, path).await.answer.await.unwrap();
        let status = Status::from_header_map(answer.headers()).unwrap();
        assert_eq!(status.code(), Code::DeadlineExceeded, "{path}: {status:?}");
        assert_eq!(reason_of(&status).as_deref(), Some("BODY_REFUSED"), "{path}");
    }
}

#[tokio::test]
async fn calls_beyond_a_peers_share_are_refused_until_one_has_ended() {
    let limits = Limits { calls: 8, calls_per_peer: 2, calls_reserved: 0, ..patient() };
    let daemon = start_with(&[FOREARM], limits).await;
    let channel = daemon.connect().await;
    let held = [half_sent(&channel, GET_FORCE).await, half_sent(&channel, GET_FORCE).await];
    let status = get_force(&channel).await.unwrap_err();
    assert_eq!((status.code(), reason_of(&status).as_deref()), (Code::ResourceExhausted, Some("NO_PLACE")));
    assert!(status.message().contains("2 calls of loopback TCP are being served"), "{status:?}");
    held.iter().for_each(|call| call.answer.abort());
    drop(held);
    until(async || get_force(&channel).await.is_ok()).await;
}

/// A stream has its place only once its request is there; until then it has one of another sort.
#[tokio::test]
async fn requests_for_streams_beyond_a_peers_share_are_refused_until_one_has_come_or_ended() {
    let limits = Limits { opening: 8, opening_per_peer: 2, opening_reserved: 0, ..patient() };
    let daemon = start_with(&[FOREARM], limits).await;
    daemon.engine().patch(0, snapshot(1, Time::default()));
    let channel = daemon.connect().await;
    let mut client = ForceServiceClient::new(channel.clone());
    let mut open = async || client.stream_force(v1::StreamForceRequest::default()).await;
    let streams = [open().await.unwrap(), open().await.unwrap(), open().await.unwrap()];
    let held = [half_sent(&channel, STREAM_FORCE).await, half_sent(&channel, STREAM_FORCE).await];
    let status = open().await.unwrap_err();
    assert_eq!((status.code(), reason_of(&status).as_deref()), (Code::ResourceExhausted, Some("NO_PLACE")));
    assert!(status.message().contains("2 requests for streams of loopback TCP are being served"), "{status:?}");
    held.iter().for_each(|call| call.answer.abort());
    drop((held, streams));
    until(async || open().await.is_ok()).await;
}

#[tokio::test]
async fn an_answer_that_nobody_takes_is_a_call_in_its_peers_share() {
    let daemon = start_with(&[FOREARM], Limits { calls_per_peer: 1, ..patient() }).await;
    let (mute, channel) = (without_room(&daemon).await, daemon.connect().await);
    let untaken = untaken_force(&mute).await;
    let status = get_force(&channel).await.unwrap_err();
    assert!(status.message().contains("1 call of loopback TCP is being served"), "{status:?}");
    drop(untaken);
    until(async || get_force(&channel).await.is_ok()).await;
}

/// A page of more than a hundred is made beside the streams, by few at a time.
#[tokio::test]
async fn a_long_list_has_a_place_until_it_is_taken_and_a_short_one_needs_none() {
    let limits = Limits { large_answers: 1, large_answers_reserved: 0, ..patient() };
    let daemon = start_with(&[FOREARM], limits).await;
    let sessions = vec![Arc::new(SessionView { number: 1, patch: FOREARM.to_owned(), ..SessionView::default() })];
    daemon.engine().catalogue(Arc::new(Catalogue { sessions, ..Catalogue::default() }));
    let of_size = |page_size| v1::ListSessionsRequest { page_size, ..Default::default() };
    let mute = without_room(&daemon).await;
    let untaken = untaken(&mute, "/taxel.v1.CalibrationService/ListSessions", &of_size(101)).await;
    let client = CalibrationServiceClient::new(daemon.connect().await);
    let list = async |page_size| client.clone().list_sessions(of_size(page_size)).await;
    let status = list(101).await.unwrap_err();
    assert_eq!((status.code(), reason_of(&status).as_deref()), (Code::ResourceExhausted, Some("NO_PLACE")));
    assert_eq!(list(100).await.unwrap().into_inner().sessions.len(), 1);
    drop(untaken);
    until(async || list(101).await.is_ok()).await;
}

/// A daemon with a hundred and one known loads and two sets, and an audit log of nothing.
async fn with_long_lists() -> Daemon {
    let daemon = start_audited(Arc::new(|_, _, tell| tell(Ok(Vec::new())))).await;
    let judged =
        |_| JudgedLoad { load: Arc::default(), outdated_because: String::new(), left_out_because: String::new() };
    let loads = (0..=100).map(judged).collect();
    let validations = vec![Arc::new(Validation { patch: FOREARM.to_owned(), loads, ..Validation::default() })];
    let model_sets = ["m-1", "m-2"].map(|id| model_set(id, FOREARM).into()).to_vec();
    daemon.engine().catalogue(Arc::new(Catalogue { model_sets, validations, ..Catalogue::default() }));
    daemon
}

/// One peer has four of them, of whichever sort they are.
#[tokio::test]
async fn long_pages_of_events_and_of_the_audit_log_many_loads_and_exports_are_large_answers() {
    let daemon = with_long_lists().await;
    let audit = |page_size| v1::ListAuditRequest { page_size, ..Default::default() };
    let events = |page_size| v1::ListEventsRequest { page_size, ..Default::default() };
    let set = v1::ExportModelSetRequest { model_set: "m-1".to_owned(), ..Default::default() };
    let mute = without_room(&daemon).await;
    let held = [
        untaken(&mute, "/taxel.v1.AuditService/ListAudit", &audit(101)).await,
        untaken(&mute, "/taxel.v1.SkinService/ListEvents", &events(101)).await,
        untaken(&mute, "/taxel.v1.ValidationService/GetValidation", &v1::GetValidationRequest::default()).await,
        untaken(&mute, "/taxel.v1.ModelService/ExportModelSet", &set).await,
    ];
    let channel = daemon.connect().await;
    let list_audit = async |size| AuditServiceClient::new(channel.clone()).list_audit(audit(size)).await;
    let list_events = async |size| SkinServiceClient::new(channel.clone()).list_events(events(size)).await;
    let mut validation = ValidationServiceClient::new(channel.clone());
    let mut models = ModelServiceClient::new(channel.clone());
    for refused in [
        list_audit(101).await.unwrap_err(),
        list_events(101).await.unwrap_err(),
        validation.get_validation(v1::GetValidationRequest::default()).await.unwrap_err(),
        models.export_model_set(set.clone()).await.unwrap_err(),
    ] {
        assert_eq!((refused.code(), reason_of(&refused).as_deref()), (Code::ResourceExhausted, Some("NO_PLACE")));
        let why = "4 large answers of loopback TCP are being served, which is the limit for one: end another first";
        assert_eq!(refused.message(), why);
    }
    list_audit(100).await.unwrap();
    list_events(100).await.unwrap();
    drop(held);
    until(async || list_audit(101).await.is_ok()).await;
    until(async || list_events(101).await.is_ok()).await;
    until(async || validation.get_validation(v1::GetValidationRequest::default()).await.is_ok()).await;
    until(async || models.export_model_set(set.clone()).await.is_ok()).await;
}

#[tokio::test]
async fn an_answer_that_nobody_takes_gives_its_place_back() {
    let unread = Duration::from_millis(5);
    let daemon = start_with(&[FOREARM], Limits { calls_per_peer: 1, unread, ..patient() }).await;
    let mute = without_room(&daemon).await;
    let channel = daemon.connect().await;
    let untaken = untaken_force(&mute).await;
    until(async || get_force(&channel).await.is_ok()).await;
    drop(untaken);
}

#[tokio::test]
async fn a_stream_whose_reader_makes_no_room_gives_its_place_back() {
    let limits = Limits { streams: 1, unread: Duration::from_millis(5), ..patient() };
    let daemon = start_with(&[FOREARM], limits).await;
    daemon.engine().patch(0, snapshot(1, Time::default()));
    let mut mute = ForceServiceClient::new(without_room(&daemon).await);
    let _untaken = mute.stream_force(v1::StreamForceRequest::default()).await.unwrap();
    let mut other = ForceServiceClient::new(daemon.connect().await);
    until(async || other.stream_force(v1::StreamForceRequest::default()).await.is_ok()).await;
}

#[tokio::test]
async fn a_connection_that_leaves_answer_after_answer_is_closed() {
    let limits = Limits { unread: Duration::from_millis(5), untaken: 2, ..patient() };
    let daemon = start_with(&[FOREARM], limits).await;
    let mute = without_room(&daemon).await;
    let _untaken = [untaken_force(&mute).await, untaken_force(&mute).await, untaken_force(&mute).await];
    // Further calls find that it is gone.
    let mut client = ForceServiceClient::new(mute.clone());
    let request = v1::StreamForceRequest::default;
    until(async || client.stream_force(request()).await.is_err_and(|status| is_gone(&status))).await;
}

/// Whether the connection failed, and not the call.
fn is_gone(status: &Status) -> bool {
    reason_of(status).is_none()
}

#[tokio::test]
async fn one_peer_has_one_export_at_a_time() {
    let session = |number| {
        Arc::new(SessionView {
            number,
            patch: FOREARM.to_owned(),
            state: SessionState::Active,
            ..SessionView::default()
        })
    };
    // Several blocks, so that one waits for room and others for it.
    let sample = |time_ns| Sample { ramp: 0, time_ns, pressure_kpa: 1.0, counts: vec![200; TAXELS].as_slice().into() };
    let samples = Arc::new(move |_: u64, told: taxel_rpc::OnSamples| {
        told(Ok(SessionSamples { ramps: Vec::new(), samples: (0..5_000).map(sample).collect() }));
    });
    let daemon = start_with_samples(samples).await;
    daemon.engine().catalogue(Arc::new(Catalogue { sessions: vec![session(7)], ..Catalogue::default() }));
    let request = || v1::ExportSamplesRequest { session: 7 };
    let mut mute = CalibrationServiceClient::new(without_room(&daemon).await);
    let untaken = mute.export_samples(request()).await.unwrap();
    let mut client = CalibrationServiceClient::new(daemon.connect().await);
    let status = client.export_samples(request()).await.unwrap_err();
    assert!(status.message().contains("1 reading of stored samples of loopback TCP is being served"), "{status:?}");
    drop(untaken);
    until(async || client.export_samples(request()).await.is_ok()).await;
}
