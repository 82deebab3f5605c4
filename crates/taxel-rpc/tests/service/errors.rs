//! Each refusal: its code, and that its text names the thing, the value and what was expected.

use futures_util::StreamExt;
use futures_util::stream::FuturesUnordered;
use taxel_rpc::handle::COMMANDS_WAITING_MAX;

use crate::fixture::*;
use crate::reasons::reason;

fn expect(status: Status, code: Code, words: &[&str]) {
    assert_eq!(status.code(), code, "{status:?}");
    for word in words {
        assert!(status.message().contains(word), "`{}` does not say `{word}`", status.message());
    }
    reason(&status);
}

#[tokio::test]
async fn a_patch_must_be_named_where_there_are_several_and_must_exist() {
    let daemon = start_with(&[FOREARM, HAND], patient()).await;
    let channel = daemon.connect().await;
    let mut force = ForceServiceClient::new(channel.clone());
    let status = force.get_force(v1::PatchRequest::default()).await.unwrap_err();
    expect(status, Code::InvalidArgument, &["patch", FOREARM, HAND]);
    let nose = || "nose".to_owned();
    let status = force.get_force(v1::PatchRequest { patch: nose() }).await.unwrap_err();
    expect(status, Code::NotFound, &["patch `nose`", FOREARM, HAND]);
    let (mut skin, mut models) = (SkinServiceClient::new(channel.clone()), ModelServiceClient::new(channel.clone()));
    let tare = || v1::TareRequest { patch: nose(), ..Default::default() };
    let unknown = [
        force.stream_force(v1::StreamRequest { patch: nose(), rate_hz: None }).await.map(drop),
        skin.get_skin(v1::PatchRequest { patch: nose() }).await.map(drop),
        skin.tare(tare()).await.map(drop),
        skin.bring_up(tare()).await.map(drop),
        models.list_model_sets(v1::ListRequest { patch: nose(), ..Default::default() }).await.map(drop),
    ];
    for answer in unknown {
        expect(answer.unwrap_err(), Code::NotFound, &["nose"]);
    }
    let status = models.get_model_set(v1::GetModelSetRequest::default()).await.unwrap_err();
    expect(status, Code::InvalidArgument, &["patch"]);
    let mut sessions = CalibrationServiceClient::new(channel);
    let status = sessions.start_session(v1::StartSessionRequest::default()).await.unwrap_err();
    expect(status, Code::InvalidArgument, &["patch", HAND]);
}

#[tokio::test]
async fn rates_outside_1_to_1000_hz_are_refused() {
    let daemon = start().await;
    let channel = daemon.connect().await;
    for rate_hz in [0.0, 0.99, 1000.1, -5.0, f64::NAN, f64::INFINITY] {
        let status = stream(channel.clone(), Some(rate_hz)).await.unwrap_err();
        expect(status, Code::InvalidArgument, &["rate_hz", "1 to 1000", &rate_hz.to_string()]);
    }
}

#[tokio::test]
async fn sets_taxels_and_sessions_that_are_not_there_are_named() {
    let daemon = start().await;
    let channel = daemon.connect().await;
    let mut models = ModelServiceClient::new(channel.clone());
    let unknown = || "m-0".to_owned();
    let request = v1::GetModelSetRequest { model_set: unknown(), ..Default::default() };
    expect(models.get_model_set(request).await.unwrap_err(), Code::NotFound, &["m-0"]);
    let request = v1::ExportModelSetRequest::default();
    expect(models.export_model_set(request).await.unwrap_err(), Code::NotFound, &["active model set", FOREARM]);
    let status = models.list_model_sets(v1::ListRequest { before: 2, ..Default::default() }).await.unwrap_err();
    expect(status, Code::InvalidArgument, &["model sets have no numbers"]);
    let status = models.activate_model_set(v1::ActivateModelSetRequest::default()).await.unwrap_err();
    expect(status, Code::InvalidArgument, &["model_set"]);
    let request = v1::ImportModelSetRequest { json: "[]".to_owned(), insist: false };
    expect(models.import_model_set(request).await.unwrap_err(), Code::InvalidArgument, &["json", "line 1", "`[]`"]);
    let model_sets = vec![crate::fixture::model_set("m-a", FOREARM).into()];
    let catalogue = taxel_engine::snapshot::Catalogue { model_sets, ..Default::default() };
    daemon.engine().catalogue(std::sync::Arc::new(catalogue));
    let request = v1::GetModelSetRequest { model_set: "m-a".to_owned(), curves: vec![20], ..Default::default() };
    expect(models.get_model_set(request).await.unwrap_err(), Code::InvalidArgument, &["curves", "20", "0 to 19"]);

    let mut sessions = CalibrationServiceClient::new(channel);
    let status = sessions.get_session(v1::SessionRequest { session: 5 }).await.unwrap_err();
    expect(status, Code::NotFound, &["session 5"]);
    let status = sessions.watch_session(v1::SessionRequest { session: 5 }).await.unwrap_err();
    expect(status, Code::NotFound, &["session 5"]);
    let status = sessions.advance_session(v1::AdvanceSessionRequest::default()).await.unwrap_err();
    expect(status, Code::InvalidArgument, &["session", "from 1"]);
    let status = sessions.get_session(v1::SessionRequest::default()).await.unwrap_err();
    expect(status, Code::InvalidArgument, &["session"]);
    let request = v1::StartSessionRequest { confirmed_by: "x".repeat(257), ..Default::default() };
    let status = sessions.start_session(request).await.unwrap_err();
    expect(status, Code::InvalidArgument, &["confirmed_by", "257", "256"]);
}

async fn refused_tare(client: &SkinServiceClient<Channel>) -> Status {
    client.clone().tare(v1::TareRequest::default()).await.unwrap_err()
}

#[tokio::test]
async fn a_command_ends_when_the_engine_is_slow() {
    let limits = Limits { command: Duration::from_millis(20), ..patient() };
    let daemon = start_with(&[FOREARM], limits).await;
    let client = SkinServiceClient::new(daemon.connect().await);
    expect(refused_tare(&client).await, Code::DeadlineExceeded, &["0.02 s", "may still come to pass"]);
}

#[tokio::test]
async fn a_command_ends_when_the_engine_is_gone() {
    let mut daemon = start().await;
    let client = SkinServiceClient::new(daemon.connect().await);
    let dropped = async { drop(daemon.requests.recv().await) };
    let (answer, ()) = tokio::join!(refused_tare(&client), dropped);
    expect(answer, Code::Unavailable, &["the engine has stopped", "may still come to pass"]);
    daemon.requests.close();
    expect(refused_tare(&client).await, Code::Unavailable, &["the engine has stopped"]);
}

#[tokio::test]
async fn commands_beyond_the_queue_are_refused_at_once() {
    let daemon = start().await;
    let client = SkinServiceClient::new(daemon.connect().await);
    let mut calls: FuturesUnordered<_> = (0..=COMMANDS_WAITING_MAX)
        .map(|_| {
            let mut client = client.clone();
            async move { client.tare(v1::TareRequest::default()).await }
        })
        .collect();
    let first = calls.next().await.unwrap().unwrap_err();
    expect(first, Code::ResourceExhausted, &["16 commands"]);
    // The others wait for the engine; the shutdown lets them go.
    daemon.shutdown.cancel();
    while let Some(answer) = calls.next().await {
        expect(answer.unwrap_err(), Code::Unavailable, &["shutting down", "may still come to pass"]);
    }
}

#[tokio::test]
async fn requests_beyond_their_size_are_refused() {
    let channel = start().await.connect().await;
    let patch = "x".repeat(5 << 20);
    let status = ForceServiceClient::new(channel.clone()).get_force(v1::PatchRequest { patch }).await.unwrap_err();
    expect(status, Code::OutOfRange, &[]);
    let request = |bytes| v1::ImportModelSetRequest { json: "x".repeat(bytes), insist: false };
    let mut models = ModelServiceClient::new(channel);
    expect(models.import_model_set(request(65 << 10)).await.unwrap_err(), Code::InvalidArgument, &["json"]);
    expect(models.import_model_set(request(17 << 20)).await.unwrap_err(), Code::OutOfRange, &[]);
}
