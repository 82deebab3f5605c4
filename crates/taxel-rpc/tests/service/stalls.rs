//! An engine that is stuck and a value that has grown too old: every way out says so, without figures, and recovers.
//! The clock is data here; nothing depends on how fast the test runs.

use taxel_proto::v1::ForceState::{Ok as Good, Stale};
use taxel_rpc::STALLED_AFTER;
use tonic_health::pb::HealthCheckResponse;
use tonic_health::pb::health_check_response::ServingStatus;

use crate::fixture::*;

const BEGUN: Time = Time::from_nanos(10_000_000_000);
const MS: Duration = Duration::from_millis(1);

/// The next message; whatever it is, one that is not good carries no figure of the force.
async fn next(stream: &mut Streaming<v1::ForceSample>) -> v1::ForceSample {
    let got = stream.message().await.unwrap().unwrap();
    let figures = got.total_n.is_some() || got.total_sigma_n.is_some() || got.resultant_n.is_some() || got.active > 0;
    assert!(!figures || got.state() == Good, "{got:?}");
    got
}

/// Reads until a message was sent at this age or later.
async fn at_age(stream: &mut Streaming<v1::ForceSample>, age: Duration) -> v1::ForceSample {
    loop {
        let got = next(stream).await;
        if got.age_s.unwrap() >= age.as_secs_f64() {
            return got;
        }
    }
}

pub async fn watch(channel: &Channel, service: &str) -> Streaming<HealthCheckResponse> {
    let request = HealthCheckRequest { service: service.to_owned() };
    HealthClient::new(channel.clone()).watch(request).await.unwrap().into_inner()
}

pub async fn until(stream: &mut Streaming<HealthCheckResponse>, wanted: ServingStatus) {
    while stream.message().await.unwrap().unwrap().status() != wanted {}
}

#[tokio::test]
async fn a_stalled_engine_is_told_by_every_stream_and_every_health_and_recovers() {
    let daemon = start().await;
    daemon.set_clock(BEGUN);
    daemon.engine().health(Arc::new(with_a_bus(true)));
    daemon.engine().patch(0, snapshot(5, BEGUN));
    let channel = daemon.connect().await;
    let (mut each, mut held) =
        (stream(channel.clone(), None).await.unwrap(), stream(channel.clone(), Some(100.0)).await.unwrap());
    let mut skin = SkinServiceClient::new(channel.clone());
    let mut taxels = skin.stream_taxels(v1::StreamRequest::default()).await.unwrap().into_inner();
    assert!(!taxels.message().await.unwrap().unwrap().taxels[0].stale);
    let mut watched = Vec::new();
    for service in ["", "taxel.v1.ForceService", "taxel.v1.SkinService", "taxel.v1.CalibrationService"] {
        let mut stream = watch(&channel, service).await;
        until(&mut stream, ServingStatus::Serving).await;
        watched.push(stream);
    }
    assert_eq!(next(&mut each).await.state(), Good);

    daemon.set_clock_without_a_beat(BEGUN + STALLED_AFTER);
    let got = at_age(&mut held, STALLED_AFTER).await;
    assert_eq!((got.state(), got.total_n), (Good, Some(5.0)), "not yet");
    daemon.set_clock_without_a_beat(BEGUN + STALLED_AFTER + 10 * MS);
    for stream in [&mut each, &mut held] {
        let got = at_age(stream, STALLED_AFTER + 10 * MS).await;
        assert_eq!((got.state(), got.sequence, got.skipped, got.stale), (Stale, 5, 0, TAXELS as u32));
        assert_eq!(got.reasons, ["the engine has not run for 0.11 s"]);
    }
    let got = taxels.message().await.unwrap().unwrap();
    assert!(got.taxels.iter().all(|taxel| taxel.stale && taxel.pressure_kpa.is_none()), "{got:?}");
    let got = get_force(channel.clone()).await.unwrap();
    assert_eq!((got.state(), got.total_n), (Stale, None));
    let health = skin.get_health(()).await.unwrap().into_inner();
    assert_eq!(health.problems, ["the engine has not run for 0.11 s"]);
    assert_eq!(health.engine_stalled_s, Some(0.11));
    for stream in &mut watched {
        until(stream, ServingStatus::NotServing).await;
    }

    let back = BEGUN + Duration::from_secs(6);
    daemon.set_clock_without_a_beat(back);
    let got = at_age(&mut held, Duration::from_secs(6)).await;
    assert_eq!((got.state(), got.reasons), (Stale, vec!["the engine has not run for 6.00 s".to_owned()]));
    assert_eq!(daemon.engine().beat(), Some(Duration::from_secs(6)), "the engine's task learns of it");
    daemon.engine().patch(0, snapshot(6, back));
    for stream in [&mut each, &mut held] {
        let got = loop {
            let got = next(stream).await;
            if got.state() == Good {
                break got;
            }
        };
        assert_eq!((got.sequence, got.total_n, got.reasons), (6, Some(6.0), vec![]));
    }
    for stream in &mut watched {
        until(stream, ServingStatus::Serving).await;
    }
    let health = skin.get_health(()).await.unwrap().into_inner();
    assert!(health.problems.is_empty() && health.engine_stalled_s.is_none(), "{health:?}");
}

#[tokio::test]
async fn a_value_that_grows_too_old_is_told_once_by_a_stream_without_a_rate() {
    let daemon = start().await;
    daemon.set_clock(BEGUN);
    daemon.engine().patch(0, snapshot(5, BEGUN));
    let channel = daemon.connect().await;
    let (mut each, mut held) =
        (stream(channel.clone(), None).await.unwrap(), stream(channel.clone(), Some(100.0)).await.unwrap());
    assert_eq!((next(&mut each).await.state(), next(&mut held).await.state()), (Good, Good));
    daemon.set_clock(BEGUN + STALE_AFTER);
    assert_eq!(at_age(&mut held, STALE_AFTER).await.state(), Good, "not yet");
    // The engine runs, and yet has not published anything newer.
    daemon.set_clock(BEGUN + STALE_AFTER + 10 * MS);
    for stream in [&mut held, &mut each] {
        let got = at_age(stream, STALE_AFTER + 10 * MS).await;
        assert_eq!((got.state(), got.sequence, got.skipped), (Stale, 5, 0));
        assert_eq!(got.reasons, ["the newest frame is 5010 ms old, more than 5000 ms"]);
    }
    daemon.set_clock(BEGUN + 2 * STALE_AFTER);
    assert_eq!(at_age(&mut held, 2 * STALE_AFTER).await.state(), Stale);
    daemon.engine().patch(0, snapshot(8, BEGUN + 2 * STALE_AFTER));
    let got = next(&mut each).await;
    assert_eq!((got.state(), got.sequence, got.skipped), (Good, 8, 2), "nothing was said twice");
}
