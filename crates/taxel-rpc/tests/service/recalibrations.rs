//! Recalibration by known loads: a proposal changes nothing, and what is accepted is what was proposed.

use taxel_engine::loads::{JudgedLoad, Load, Reading, Validation};

use crate::fixture::*;

type Client = ValidationServiceClient<tonic::transport::Channel>;

/// A load under which a skin reads a tenth too little.
fn load(number: u64, noted_times: f64) -> JudgedLoad {
    let laid_n = number as f64 + 2.0;
    let taxels = vec![number as u16]; // each at another place
    let read = Reading { scans: 20, mean_n: laid_n / 1.1, sigma_n: 0.2, taxels, ..Reading::default() };
    let load = Load {
        number,
        patch: FOREARM.to_owned(),
        force_n: noted_times * laid_n,
        force_sigma_n: 0.01 * laid_n,
        read,
        model_set: "m-1".to_owned(),
        mean_area_mm2: 32.4,
        ..Load::default()
    };
    JudgedLoad { load: Arc::new(load), outdated_because: String::new(), left_out_because: String::new() }
}

/// A daemon with this set in use and these loads.
async fn daemon(loads: Vec<JudgedLoad>) -> (Daemon, Client) {
    let daemon = start().await;
    let client = ValidationServiceClient::new(daemon.connect().await);
    publish(&daemon, loads);
    (daemon, client)
}

fn publish(daemon: &Daemon, loads: Vec<JudgedLoad>) {
    let view =
        Validation { patch: FOREARM.to_owned(), model_set: Some("m-1".to_owned()), loads, ..Validation::default() };
    daemon.engine().catalogue(Arc::new(Catalogue {
        model_sets: vec![model_set("m-1", FOREARM).into()],
        active: vec![(FOREARM.to_owned(), Some("m-1".to_owned()))],
        validations: vec![Arc::new(view)],
        ..Catalogue::default()
    }));
}

fn sound() -> Vec<JudgedLoad> {
    (1..=6).map(|number| load(number, 1.0)).collect()
}

fn accept(model_set: &str) -> v1::RecalibrateRequest {
    v1::RecalibrateRequest { model_set: model_set.to_owned(), ..Default::default() }
}

/// Only what would come of it.
fn dry_run() -> v1::RecalibrateRequest {
    v1::RecalibrateRequest { dry_run: true, ..Default::default() }
}

#[tokio::test]
async fn what_is_accepted_is_what_was_proposed_and_reaches_the_engine_once() {
    let (mut daemon, mut client) = daemon(sound()).await;
    let request = dry_run();
    let got = client.recalibrate(request).await.unwrap().into_inner();
    assert!(daemon.requests.try_recv().is_err(), "a proposal asks nothing of the engine");
    assert!((got.gain - 1.1).abs() < 1e-9, "of the configured areas: {got:?}");
    assert_eq!((got.source.as_str(), got.contradicts, got.needed), ("m-1", 0, true));
    assert!(got.refused_because.is_empty() && got.points.len() == 6, "{got:?}");
    assert!(got.relative_sigma > 0.03 && got.gain_sigma < 0.03, "{got:?}");
    let (answer, ()) = tokio::join!(client.recalibrate(accept(&got.model_set)), async {
        let request = daemon.requests.recv().await.unwrap();
        let Command::KeepRecalibration { model_set } = request.command else { panic!("{:?}", request.command) };
        let asked = request.asked.unwrap();
        assert!(asked.what.contains("RecalibrateRequest {"), "{asked:?}");
        assert_eq!((asked.patch.as_str(), asked.method.as_str()), (FOREARM, "Recalibrate"));
        assert_eq!((model_set.id.as_str(), model_set.derived_from()), (got.model_set.as_str(), Some("m-1")));
        let count = 200.0;
        let was = crate::fixture::model_set("m-1", FOREARM).taxels[0].evaluate(count).unwrap().kpa;
        assert!((model_set.taxels[0].evaluate(count).unwrap().kpa / was - got.gain).abs() < 1e-9);
        request.reply.send(Ok(Done::Kept { model_set: model_set.into(), known: false })).unwrap();
    });
    let answer = answer.unwrap().into_inner();
    assert_eq!((answer.model_set, answer.source), (got.model_set.clone(), "m-1".to_owned()));
    // Another load has come meanwhile: what was proposed is not what would be kept.
    let mut more = sound();
    more.push(load(7, 1.02));
    publish(&daemon, more);
    let refused = client.recalibrate(accept(&got.model_set)).await.unwrap_err();
    assert!(refused.code() == Code::FailedPrecondition && refused.message().contains("look at a new proposal"));
    assert!(daemon.requests.try_recv().is_err());
}

#[tokio::test]
async fn what_cannot_be_proposed_is_refused_with_the_reason() {
    let (daemon, mut client) = daemon(sound()).await;
    let request = |change: fn(&mut v1::RecalibrateRequest)| {
        let mut request = dry_run();
        change(&mut request);
        request
    };
    for (asked, code, says) in [
        (request(|r| r.patch = "leg".to_owned()), Code::NotFound, "no patch `leg`"),
        (request(|r| r.loads = vec![1; 101]), Code::InvalidArgument, "loads: 101 numbers"),
        (request(|r| r.place_uncertainty = Some(0.0)), Code::InvalidArgument, "place_uncertainty: 0"),
        (request(|r| r.place_uncertainty = Some(f64::NAN)), Code::InvalidArgument, "place_uncertainty: NaN"),
        (request(|r| r.loads = vec![1, 99]), Code::FailedPrecondition, "no load 99"),
        (request(|r| r.loads = vec![1, 2, 3]), Code::FailedPrecondition, "3 known loads so far; at least 5"),
    ] {
        let refused = client.recalibrate(asked).await.unwrap_err();
        assert!(refused.code() == code && refused.message().contains(says), "{refused}");
    }
    let refused = client.recalibrate(accept("")).await.unwrap_err();
    assert!(refused.code() == Code::InvalidArgument && refused.message().contains("model_set"), "{refused}");
    let contradicts = (1..=6).map(|number| load(number, if number == 4 { 2.0 } else { 1.0 }));
    publish(&daemon, contradicts.collect());
    let got = client.recalibrate(dry_run()).await.unwrap().into_inner();
    assert_eq!((got.contradicts, got.model_set.as_str()), (4, ""));
    assert!(got.refused_because[0].contains("point 4 contradicts the others"), "{got:?}");
    let refused = client.recalibrate(accept("m-any")).await.unwrap_err();
    assert!(refused.code() == Code::FailedPrecondition && refused.message().contains("point 4"), "{refused}");
    daemon.engine().catalogue(Arc::default());
    let refused = client.recalibrate(dry_run()).await.unwrap_err();
    assert!(refused.code() == Code::FailedPrecondition && refused.message().contains("is active"), "{refused}");
}
