//! Each call that answers once: what goes in arrives at the engine, what the engine has comes out.

use taxel_engine::snapshot::{
    BoardHealth, Budget, Contact, DriftView, RangeFlag, Reason, ReasonCode, StoreHealth, TareView, Term, Undetected,
};

use crate::fixture::*;

fn vector(x: f64, y: f64, z: f64) -> Option<v1::Vector3> {
    Some(v1::Vector3 { x, y, z })
}

/// A contact, and as it is told.
fn contact() -> (Contact, v1::Contact) {
    let (centre, resultant, moment, taxels) = ([0.01, 0.02, 0.03], [0.0, 0.0, -4.5], [0.1, 0.2, 0.3], vec![3, 5]);
    let told = v1::Contact {
        id: 3,
        area_mm2: 84.0,
        peak_kpa: 60.0,
        force_n: 4.5,
        centre_m: vector(0.01, 0.02, 0.03),
        resultant_n: vector(0.0, 0.0, -4.5),
        moment_nm: vector(0.1, 0.2, 0.3),
        taxels: vec![3, 5],
    };
    (Contact { id: 3, area_mm2: 84.0, peak_kpa: 60.0, force_n: 4.5, centre, resultant, moment, taxels }, told)
}

#[tokio::test]
async fn a_force_carries_everything_that_the_engine_knows() {
    let daemon = start().await;
    let (contact, expected_contact) = contact();
    let sample = ForceSample {
        state: ForceState::Degraded,
        reasons: vec![Reason::about([4, 5, 9], ReasonCode::TaxelsSilent, "3 taxels are silent")],
        total: Some(Newton(4.5)),
        total_sigma: Some(Newton(0.25)),
        budget: Budget::default().with(Term::Sampling, 0.25),
        undetected: Some(Undetected { newton: 0.75, sigma_n: 0.0 }),
        unbounded: false,
        zero_epoch: 7,
        step: Some(Newton(-0.5)),
        resultant: Some([0.1, 0.2, 4.4]),
        moment: Some([1.0, 2.0, 3.0]),
        centre_of_pressure: Some([0.01, 0.02, 0.03]),
        contacts: vec![contact],
        active: 5,
        excluded: 2,
        stale: 3,
        out_of_range: 1,
        model_set: Some("m-1".into()),
    };
    let published =
        PatchSnapshot { force: sample, simulated: true, ..PatchSnapshot::clone(&snapshot(9, Time::from_nanos(1_000))) };
    daemon.engine().patch(0, Arc::new(published));
    daemon.set_clock(Time::from_nanos(2_000_001_000));
    let channel = daemon.connect().await;
    let got = get_force(channel.clone()).await.unwrap();
    let expected = v1::ForceSample {
        sequence: 9,
        state: v1::ForceState::Degraded.into(),
        total_n: Some(4.5),
        total_sigma_n: Some(0.25),
        age_s: Some(2.0),
        monotonic_ns: Some(1_000),
        time: Some(taxel_proto::Timestamp { seconds: 1_700_000_000, nanos: 500_000_000 }),
        skipped: 0,
        simulated: true,
        max_age_s: crate::fixture::STALE_AFTER.as_secs_f64(),
        active: 5,
        excluded: 2,
        stale: 3,
        out_of_range: 1,
        model_set: "m-1".to_owned(),
        reasons: vec!["3 taxels are silent".to_owned()],
        causes: vec![v1::ForceReason { code: v1::ReasonCode::TaxelsSilent.into(), taxels: 3, which: vec![4, 5, 9] }],
        patch: FOREARM.to_owned(),
        resultant_n: vector(0.1, 0.2, 4.4),
        moment_nm: vector(1.0, 2.0, 3.0),
        centre_of_pressure_m: vector(0.01, 0.02, 0.03),
        contacts: vec![expected_contact],
        low_n: Some(4.5 - 1.96 * 0.25),
        high_n: Some(4.5 + 0.75 + 1.96 * 0.25),
        undetected_n: Some(0.75),
        budget: vec![v1::Uncertainty { term: "sampling".to_owned(), sigma_n: 0.25 }],
        zero_epoch: 7,
        step_n: Some(-0.5),
        sent: got.sent,
    };
    assert!(got.sent.is_some());
    assert_eq!(got, expected);
    let mut stream = stream(channel, None).await.unwrap();
    let streamed = stream.message().await.unwrap().unwrap();
    let counted = v1::ForceReason { which: Vec::new(), ..expected.causes[0].clone() };
    let sent = streamed.sent;
    assert_eq!(
        streamed,
        v1::ForceSample { causes: vec![counted], sent, budget: Vec::new(), ..expected },
        "a stream has no lists"
    );
}

#[tokio::test]
async fn before_the_first_frame_there_is_no_age_and_the_reason_says_so() {
    let daemon = start().await;
    let got = get_force(daemon.connect().await).await.unwrap();
    assert_eq!((got.sequence, got.age_s, got.monotonic_ns, got.time, got.total_n), (0, None, None, None, None));
    assert_eq!(got.state(), v1::ForceState::Uncalibrated);
    assert_eq!(got.reasons, ["no frame of this patch has come yet"]);
    assert_eq!(got.causes.iter().map(v1::ForceReason::code).collect::<Vec<_>>(), [v1::ReasonCode::NoFrame]);
}

#[tokio::test]
async fn a_sum_that_is_not_a_number_never_goes_out() {
    let daemon = start().await;
    let mut broken = PatchSnapshot::clone(&snapshot(1, Time::default()));
    broken.force.total = Some(Newton(f64::NAN));
    broken.force.total_sigma = Some(Newton(f64::INFINITY));
    daemon.engine().patch(0, Arc::new(broken));
    let got = get_force(daemon.connect().await).await.unwrap();
    assert_eq!((got.total_n, got.total_sigma_n), (None, None));
}

#[tokio::test]
async fn taxels_carry_their_own_age_and_only_what_is_known() {
    let daemon = start().await;
    let second = 1_000_000_000;
    let pressed = TaxelState {
        count: 180,
        time: Time::from_nanos(second),
        seen: true,
        active: true,
        calibrated: true,
        range: RangeFlag::Above,
        pressure_kpa: Some(71.5),
        sigma_kpa: Some(f32::INFINITY),
        ..TaxelState::default()
    };
    let mut published = PatchSnapshot::clone(&snapshot(4, Time::from_nanos(3 * second)));
    published.taxels = vec![pressed, TaxelState { stale: true, ..TaxelState::default() }].into();
    daemon.engine().patch(0, Arc::new(published));
    daemon.set_clock(Time::from_nanos(4 * second));
    let mut client = SkinServiceClient::new(daemon.connect().await);
    let mut stream = client.stream_taxels(v1::StreamRequest::default()).await.unwrap().into_inner();
    let got = stream.message().await.unwrap().unwrap();
    assert_eq!((got.sequence, got.age_s, got.patch.as_str()), (4, Some(1.0), FOREARM));
    let expected = v1::TaxelReading {
        count: Some(180),
        age_s: Some(3.0),
        active: true,
        calibrated: true,
        range: v1::Range::Above.into(),
        pressure_kpa: Some(71.5),
        ..v1::TaxelReading::default()
    };
    assert_eq!(got.taxels, [expected, v1::TaxelReading { stale: true, ..v1::TaxelReading::default() }]);
}

#[tokio::test]
async fn the_skin_tells_its_layout_and_why_taxels_are_excluded() {
    let daemon = start_with(&[FOREARM, HAND], patient()).await;
    let mut client = SkinServiceClient::new(daemon.connect().await);
    let request = || v1::PatchRequest { patch: FOREARM.to_owned() };
    let bare = client.get_skin(request()).await.unwrap().into_inner();
    assert_eq!(bare.patches, [FOREARM, HAND]);
    assert_eq!((bare.taxels.len(), bare.model_set.as_str()), (TAXELS, ""));
    assert!(bare.taxels.iter().all(|taxel| !taxel.calibrated && taxel.exclusion == "no model set is in use"));

    let active = vec![(FOREARM.to_owned(), Some("m-a".to_owned()))];
    let model_sets = vec![model_set("m-a", FOREARM).into()];
    daemon.engine().catalogue(Arc::new(Catalogue { model_sets, active, ..Catalogue::default() }));
    let skin = client.get_skin(request()).await.unwrap().into_inner();
    assert_eq!(skin.model_set, "m-a");
    assert!(skin.taxels[0].calibrated && skin.taxels[0].exclusion.is_empty());
    assert!(!skin.taxels[1].calibrated);
    assert_eq!(skin.taxels[1].exclusion, "the count stayed at 7");
    assert_eq!((skin.taxels[16].module, skin.taxels[16].slot), (1, 7), "a thermal pad lies before it");
    assert_eq!(skin.taxels[3].position_m, None);
    assert_eq!(skin.taxels[4].position_m, Some(v1::Vector3 { x: 0.004, y: 0.0, z: 0.0 }));
    assert!(skin.taxels[4].normal.is_some());
    assert_eq!((skin.taxels[16].bus, skin.taxels[16].board), (0, 13));
    assert_eq!(skin.geometry_remarks, ["1 of 20 taxels have no position"]);
}

#[tokio::test]
async fn health_names_buses_boards_zeros_and_faults() {
    let daemon = start().await;
    let bus =
        BusHealth { up: true, frames: 10, malformed: 1, last_malformed: "bad".to_owned(), ..BusHealth::default() };
    let board = BoardHealth { patch: FOREARM.to_owned(), address: 13, modules: (16, 15), ..BoardHealth::default() };
    let problems = vec!["the disk is full".to_owned()];
    daemon.engine().health(Arc::new(Health {
        buses: vec![bus],
        boards: vec![board],
        problems,
        store: StoreHealth { problem: Some("full".to_owned()), damage: vec!["session 3 is damaged".to_owned()] },
    }));
    let mut published = PatchSnapshot::clone(&snapshot(1, Time::default()));
    let reason = "rest shown".to_owned();
    let drift = DriftView { median_counts: -3.0, ..DriftView::default() };
    let noise_median = f64::NAN;
    published.tare = Some(TareView { epoch: 2, valid: true, reason, noise_median, drift, ..TareView::default() });
    daemon.engine().patch(0, Arc::new(published));
    let mut client = SkinServiceClient::new(daemon.connect().await);
    let health = client.get_health(()).await.unwrap().into_inner();
    assert!(health.buses[0].up && health.buses[0].last_malformed == "bad");
    assert_eq!((health.boards[0].modules_enabled, health.boards[0].modules_fresh), (16, 15));
    assert_eq!(health.problems, ["the disk is full"]);
    let store = health.store.unwrap();
    assert_eq!(store.problem, "full");
    assert_eq!(store.damage, ["session 3 is damaged"]);
    let tare = health.patches[0].tare.as_ref().unwrap();
    assert_eq!((tare.epoch, tare.valid, tare.reason.as_str()), (2, true, "rest shown"));
    assert_eq!(tare.reason_code(), v1::ReasonCode::Unspecified);
    assert_eq!(tare.noise_median_counts.to_bits(), 0.0_f64.to_bits(), "not a number stays inside");
    assert!(tare.drift_median_counts == -3.0);
    assert_eq!((health.streams, health.streams_max), (0, taxel_rpc::Limits::default().streams as u32));
    let (code, reason) = (Some(ReasonCode::ZeroInCheck), "board 13 was silent".to_owned());
    let doubted =
        PatchSnapshot { tare: Some(TareView { code, reason, ..TareView::default() }), ..PatchSnapshot::default() };
    daemon.engine().patch(0, Arc::new(doubted));
    let health = client.get_health(()).await.unwrap().into_inner();
    assert_eq!(health.patches[0].tare.as_ref().unwrap().reason_code(), v1::ReasonCode::ZeroInCheck);
}

#[tokio::test]
async fn tare_and_bring_up_reach_the_engine() {
    let mut daemon = start().await;
    let mut client = SkinServiceClient::new(daemon.connect().await);
    let request = v1::TareRequest { patch: String::new(), confirmed_by: "  Ada  ".to_owned() };
    let done = Done::Tared(TareView { epoch: 3, valid: true, wall_ns: 5_000_000_000, ..TareView::default() });
    let tared = daemon.replied(client.tare(request), Ok(done), |command| {
        let Command::Tare { patch, confirmed_by } = command else { panic!("{command:?}") };
        assert_eq!((patch.as_str(), confirmed_by.as_deref()), (FOREARM, Some("Ada")));
    });
    let tared = tared.await.unwrap();
    assert_eq!((tared.epoch, tared.valid, tared.time.unwrap().seconds), (3, true, 5));

    let call = client.bring_up(v1::TareRequest::default());
    let begins = |command| assert!(matches!(command, Command::BringUp { .. }));
    daemon.replied(call, Ok(Done::BringUpStarted), begins).await.unwrap();
}

#[tokio::test]
async fn model_sets_are_shown_activated_exported_imported_and_deleted() {
    let mut daemon = start().await;
    let active = vec![(FOREARM.to_owned(), Some("m-b".to_owned()))];
    let model_sets = ["m-a", "m-b"].map(|id| model_set(id, FOREARM).into()).to_vec();
    daemon.engine().catalogue(Arc::new(Catalogue { model_sets, active, ..Catalogue::default() }));
    let mut client = ModelServiceClient::new(daemon.connect().await);

    let set = client.get_model_set(v1::GetModelSetRequest::default()).await.unwrap().into_inner();
    let summary = set.summary.unwrap();
    assert_eq!((summary.model_set.as_str(), summary.active, summary.calibrated), ("m-b", true, 1));
    assert_eq!((summary.session, summary.created.unwrap().seconds), (Some(7), 1_700_000_000));
    assert_eq!((set.taxels[1].status.as_str(), set.taxels[1].figures.get("rmse_kpa")), ("dead", None));
    assert_eq!((set.in_use["smooth_s"], set.in_use["unloading_share"]), (0.5, 0.03));
    assert_eq!(set.taxels[0].figures["sensitivity_counts_per_kpa"], 0.9);

    let request = v1::GetModelSetRequest { model_set: "m-a".to_owned(), curves: vec![0], ..Default::default() };
    let model = client.get_model_set(request).await.unwrap().into_inner().curves.remove(0);
    assert_eq!(model.summary.as_ref().unwrap().status, "ok");
    assert_eq!(model.coefficients.len(), 6);
    let at_200 = model.points.iter().find(|point| point.count == 200).unwrap();
    assert!((at_200.pressure_kpa - 40.0).abs() < 1.0 && at_200.sigma_kpa.unwrap() > 0.0);
    let horner = model.coefficients.iter().rev().fold(0.0, |sum, c| sum * 200.0 + c);
    assert!((horner - at_200.pressure_kpa).abs() < 1e-3, "the constant term comes first");

    let exported = client.export_model_set(v1::ExportModelSetRequest::default()).await.unwrap().into_inner();
    assert_eq!(exported.json, "set m-b");

    let request = v1::ImportModelSetRequest { json: "set m-c".to_owned(), insist: false };
    let done = Done::Kept { model_set: model_set("m-c", FOREARM).into(), known: false };
    let imported = daemon.replied(client.import_model_set(request), Ok(done), |command| {
        assert!(matches!(command, Command::Import { model_set, insist: false } if model_set.id == "m-c"));
    });
    assert_eq!(imported.await.unwrap().model_set, "m-c");

    let (model_set, expected) = ("m-a".to_owned(), Some(String::new()));
    let request = v1::ActivateModelSetRequest { model_set, expected, ..Default::default() };
    let done = Done::Activated { model_set: "m-a".to_owned(), previous: Some("m-b".to_owned()) };
    let activated = daemon.replied(client.activate_model_set(request), Ok(done), |command| {
        let Command::Activate { patch, model_set, expected } = command else { panic!("{command:?}") };
        assert_eq!((patch.as_str(), model_set.as_str(), expected.as_deref()), (FOREARM, "m-a", Some("")));
    });
    assert_eq!(activated.await.unwrap().previous, "m-b");

    let request = v1::DeleteModelSetRequest { model_set: "m-a".to_owned() };
    let named = |command| assert!(matches!(command, Command::DeleteModelSet { model_set } if model_set == "m-a"));
    daemon.replied(client.delete_model_set(request), Ok(Done::Deleted), named).await.unwrap();
    let status = client.delete_model_set(v1::DeleteModelSetRequest::default()).await.unwrap_err();
    assert_eq!(status.code(), tonic::Code::InvalidArgument);
}
