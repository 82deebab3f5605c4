//! What one peer can take, what is left for others, and what is kept for operators.

use taxel_proto::refusal::reason_of;

use crate::fixture::*;

#[tokio::test]
async fn the_stream_beyond_a_peers_share_is_refused_on_its_channel_and_calls_beside_it_go_on() {
    let limits = Limits { streams: 128, ..patient() };
    let (daemon, _folder, unix) = on_two_doors(limits);
    let channel = daemon.connect().await;
    let mut held = Vec::new();
    for _ in 0..64 {
        held.push(stream(channel.clone(), None).await.unwrap());
    }
    for _ in 0..300 {
        let status = stream(channel.clone(), None).await.unwrap_err();
        assert_eq!(status.code(), Code::ResourceExhausted);
        assert!(status.message().contains("64 streams of loopback TCP are being served"), "{status:?}");
    }
    get_force(channel.clone()).await.unwrap();
    // All streams of the channel still run, and another peer has its own share.
    for stream in &mut held {
        stream.message().await.unwrap().unwrap();
    }
    stream(unix.connect().await.unwrap(), None).await.unwrap();
    drop(held);
    let mut skin = SkinServiceClient::new(channel.clone());
    while skin.get_health(()).await.unwrap().into_inner().streams > 0 {}
    stream(channel.clone(), None).await.unwrap();
}

#[tokio::test]
async fn a_watch_of_the_health_takes_a_place_and_gives_it_back() {
    let daemon = start_with(&[FOREARM], Limits { streams: 2, ..patient() }).await;
    let channel = daemon.connect().await;
    let mut health = HealthClient::new(channel.clone());
    let request = || HealthCheckRequest { service: String::new() };
    let first = health.watch(request()).await.unwrap();
    let _second = stream(channel.clone(), None).await.unwrap();
    assert_eq!(health.watch(request()).await.unwrap_err().code(), Code::ResourceExhausted);
    health.check(request()).await.unwrap();
    drop(first);
    while health.watch(request()).await.is_err() {}
}

/// What it takes to make it is held until its reader has it, or has gone.
#[tokio::test]
async fn a_large_answer_has_its_place_until_it_is_taken() {
    let daemon = start_with(&[FOREARM], Limits { long_calls_per_peer: 1, ..patient() }).await;
    let model_sets = vec![model_set("m-1", FOREARM).into()];
    daemon.engine().catalogue(Arc::new(Catalogue { model_sets, ..Catalogue::default() }));
    let request = || v1::ExportModelSetRequest { model_set: "m-1".to_owned(), ..Default::default() };
    let mute = daemon.endpoint().initial_stream_window_size(0).connect().await.unwrap();
    let untaken = tokio::spawn(async move { ModelServiceClient::new(mute).export_model_set(request()).await });
    let mut client = ModelServiceClient::new(daemon.connect().await);
    let status = loop {
        if let Err(status) = client.export_model_set(request()).await {
            break status;
        }
    };
    assert_eq!((status.code(), reason_of(&status).as_deref()), (Code::ResourceExhausted, Some("DAEMON_BUSY")));
    assert!(status.message().contains("1 long calls of loopback TCP are being served"), "{status:?}");
    get_force(daemon.connect().await).await.unwrap();
    untaken.abort();
    while client.export_model_set(request()).await.is_err() {}
}
