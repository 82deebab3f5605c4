//! Known loads: what a client says arrives at the engine, what the engine has comes out.

use taxel_engine::command::ErrorReason;
use taxel_engine::loads::{JudgedLoad, Load, Reading, Validation, Weight};
use taxel_proto::v1::record_load_request::Load as Laid;

use crate::fixture::*;

fn load(number: u64, error: f64) -> Arc<Load> {
    let read = Reading {
        scans: 20,
        mean_n: 5.0 * (1.0 + error),
        scatter_n: 0.02,
        sigma_n: 0.2,
        out_of_range: 1,
        reasons: vec!["1 taxels have a fault".to_owned()],
        taxels: vec![3, 4, 230],
    };
    Arc::new(Load {
        number,
        patch: FOREARM.to_owned(),
        wall_ns: 1_700_000_000_000_000_000,
        by: "Ada".to_owned(),
        note: "brass".to_owned(),
        mass_kg: Some(0.5),
        force_n: 5.0,
        force_sigma_n: 0.05,
        replaces: Some(2),
        read,
        model_set: "m-1".to_owned(),
        mean_area_mm2: 32.4,
        filled: true,
    })
}

fn request(laid: Option<Laid>) -> v1::RecordLoadRequest {
    v1::RecordLoadRequest { load: laid, ..v1::RecordLoadRequest::default() }
}

#[tokio::test]
async fn a_load_reaches_the_engine_and_its_reading_comes_back() {
    let mut daemon = start().await;
    let mut client = ValidationServiceClient::new(daemon.connect().await);
    let asked = v1::RecordLoadRequest {
        note: " brass ".to_owned(),
        by: "Ada".to_owned(),
        replaces: 2,
        ..request(Some(Laid::MassKg(0.5)))
    };
    let got = daemon.replied(client.record_load(asked), Ok(Done::LoadRecorded(load(7, -0.1))), |command| {
        let Command::RecordLoad { patch, load } = command else { panic!("{command:?}") };
        assert_eq!((patch.as_str(), load.weight, load.replaces), (FOREARM, Weight::Kilogram(0.5), Some(2)));
        assert_eq!((load.note.as_str(), load.by.as_str()), ("brass", "Ada"));
        assert!((load.relative_sigma - 0.01).abs() < 1e-15, "the default");
    });
    let got = got.await.unwrap();
    assert!((got.error_percent + 10.0).abs() < 1e-9 && !got.within_two_sigma, "{got:?}");
    let expected = v1::Load {
        load: 7,
        patch: FOREARM.to_owned(),
        time: Some(taxel_proto::Timestamp { seconds: 1_700_000_000, nanos: 0 }),
        by: "Ada".to_owned(),
        note: "brass".to_owned(),
        mass_kg: Some(0.5),
        force_n: 5.0,
        force_sigma_n: 0.05,
        read_n: 4.5,
        read_sigma_n: 0.2,
        read_scatter_n: 0.02,
        scans: 20,
        error_percent: got.error_percent,
        within_two_sigma: false,
        reasons: vec!["1 taxels have a fault".to_owned()],
        model_set: "m-1".to_owned(),
        replaces: 2,
        outdated_because: String::new(),
        left_out_because: String::new(),
        taxels: vec![3, 4, 230],
    };
    assert_eq!(got, expected);

    let why = "the force is unsteady: it moved from 4.00 N to 5.00 N";
    let asked = v1::RecordLoadRequest { relative_uncertainty: Some(0.0), ..request(Some(Laid::ForceN(4.9))) };
    let unsteady = Err(Rejection::FailedPrecondition(ErrorReason::SessionWrongState, why.to_owned()));
    let refused = daemon.replied(client.record_load(asked), unsteady, |command| {
        let Command::RecordLoad { load, .. } = command else { panic!("{command:?}") };
        assert!(matches!(load.weight, Weight::Force(force) if force.0.to_bits() == 4.9_f64.to_bits()));
        assert_eq!((load.relative_sigma.to_bits(), load.replaces), (0, None));
    });
    let refused = refused.await.unwrap_err();
    assert_eq!((refused.code(), refused.message()), (Code::FailedPrecondition, why));
}

#[tokio::test]
async fn what_is_no_load_is_refused_before_the_engine() {
    let mut daemon = start_with(&[FOREARM, HAND], patient()).await;
    let mut client = ValidationServiceClient::new(daemon.connect().await);
    let of = |patch: &str, asked: v1::RecordLoadRequest| v1::RecordLoadRequest { patch: patch.to_owned(), ..asked };
    let kilogram = || request(Some(Laid::MassKg(1.0)));
    let long = v1::RecordLoadRequest { note: "x".repeat(1025), ..kilogram() };
    let two_lines = v1::RecordLoadRequest { note: "brass\nsteel".to_owned(), ..kilogram() };
    for (asked, code, says) in [
        (of(FOREARM, request(None)), Code::InvalidArgument, "load: neither mass_kg nor force_n"),
        (of(FOREARM, long), Code::InvalidArgument, "note: 1025 bytes, at most 1024"),
        (of(FOREARM, two_lines), Code::InvalidArgument, "U+000A, expected one line of text"),
        (of("", kilogram()), Code::InvalidArgument, "patch: must name one"),
        (of("leg", kilogram()), Code::NotFound, "no patch `leg`"),
    ] {
        let refused = client.record_load(asked).await.unwrap_err();
        assert_eq!(refused.code(), code, "{refused:?}");
        assert!(refused.message().contains(says), "expected `{says}` in: {}", refused.message());
    }
    assert!(daemon.requests.try_recv().is_err(), "nothing of it reached the engine");
}

#[tokio::test]
async fn a_validation_shows_loads_and_errors() {
    let daemon = start().await;
    let mut client = ValidationServiceClient::new(daemon.connect().await);
    let empty = client.get_validation(v1::PatchRequest::default()).await.unwrap().into_inner();
    assert_eq!(empty, v1::Validation { patch: FOREARM.to_owned(), ..v1::Validation::default() });

    let judged = |number, why: &str| JudgedLoad {
        load: load(number, if number == 1_300 { 8.98 } else { 0.02 }),
        outdated_because: why.to_owned(),
        left_out_because: String::new(),
    };
    let mut loads: Vec<JudgedLoad> = (2..=1_300).rev().map(|number| judged(number, "")).collect();
    loads.push(judged(1, "another model set is active now"));
    let view = Validation {
        patch: FOREARM.to_owned(),
        model_set: Some("m-1".to_owned()),
        loads,
        mean_absolute_error: Some(0.02),
    };
    daemon.engine().catalogue(Arc::new(Catalogue { validations: vec![Arc::new(view)], ..Catalogue::default() }));
    let got = client.get_validation(v1::PatchRequest::default()).await.unwrap().into_inner();
    assert_eq!((got.model_set.as_str(), got.loads.len()), ("m-1", 1_000));
    assert_eq!(got.mean_absolute_error_percent, Some(2.0));
    let (newest, before) = (&got.loads[0], &got.loads[1]);
    assert!(before.load == 1_299 && before.within_two_sigma && before.reasons.len() == 1, "{before:?}");
    let [_, doubt] = newest.reasons.as_slice() else { panic!("{newest:?}") };
    assert!(doubt.starts_with("+898 % is far off: was it another mass") && doubt.ends_with("--replaces 1300`"));
}
