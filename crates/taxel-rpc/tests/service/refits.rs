//! Stored samples fitted once more: read, fitted, and handed to the engine to be kept.

use taxel_engine::calibration::{RampBaseline, Sample};
use taxel_engine::command::ErrorReason;

use crate::fixture::*;

type Client = CalibrationServiceClient<tonic::transport::Channel>;

/// A ramp to 70 kPa of taxels that lose counts as they are pressed; session 3 has damaged samples.
fn samples() -> Store {
    let samples = |session: u64, told: Told<SessionSamples>| {
        let count = |kpa: f64| (240.0 - 80.0 * kpa / (kpa + 40.0)).round() as u16;
        let sample = |k: i64| Sample {
            ramp: 0,
            time_ns: 50_000_000 * k,
            pressure_kpa: k as f64 / 10.0,
            counts: [count(k as f64 / 10.0); TAXELS].into(),
        };
        let rest = vec![TaxelBaseline { mean: 240.0, noise: 0.5 }; TAXELS];
        told(match session {
            3 => Err(Refusal::failed_precondition(v1::ErrorReason::DataDamaged, "session 3: row 7")),
            _ => Ok(SessionSamples {
                ramps: vec![RampBaseline { ramp: 0, taxels: rest, gauge_kpa: Some(0.0) }],
                samples: (0..=700).map(sample).collect(),
            }),
        });
    };
    Store { samples: Some(Box::new(samples)), ..Store::default() }
}

async fn daemon() -> (Daemon, Client) {
    let daemon = start_backed(samples(), patient()).await;
    let view = |number, state| {
        let patch = FOREARM.to_owned();
        Arc::new(SessionView { number, patch, state, accepted: 701, ..SessionView::default() })
    };
    let sessions = vec![
        view(1, SessionState::Active),
        view(2, SessionState::Review),
        view(3, SessionState::Aborted),
        view(4, SessionState::Ramping),
        view(5, SessionState::Discarded),
    ];
    daemon.engine().catalogue(Arc::new(Catalogue { sessions, ..Catalogue::default() }));
    let client = CalibrationServiceClient::new(daemon.connect().await);
    (daemon, client)
}

fn refit(sessions: &[u64]) -> v1::RefitSessionsRequest {
    v1::RefitSessionsRequest { sessions: sessions.to_vec() }
}

/// Takes the next command, which must keep a set, and answers that this is done.
async fn kept(daemon: &mut Daemon, sessions: &[u64], known: bool) {
    let request = daemon.requests.recv().await.unwrap();
    let Command::KeepRefit { model_set, sessions: named } = request.command else { panic!("{:?}", request.command) };
    assert_eq!(named, sessions);
    let asked = request.asked.unwrap();
    assert!(asked.what.contains(&model_set.id) && asked.patch == FOREARM, "{asked:?}");
    request.reply.send(Ok(Done::Kept { model_set: model_set.into(), known })).unwrap();
}

#[tokio::test]
async fn a_refit_is_fitted_kept_and_told() {
    let (mut daemon, mut client) = daemon().await;
    let (answer, ()) = tokio::join!(client.refit_sessions(refit(&[1])), kept(&mut daemon, &[1], false));
    let once = answer.unwrap().into_inner();
    let set = once.model_set.unwrap();
    assert!(set.method.starts_with("monotone, order ") && set.session == Some(1) && !set.active, "{set:?}");
    assert_eq!((set.taxels, set.calibrated), (TAXELS as u32, TAXELS as u32));
    assert_eq!((once.known, once.scans), (false, 701));
    let (answer, ()) = tokio::join!(client.refit_sessions(refit(&[2, 1])), kept(&mut daemon, &[1, 2], true));
    let merged = answer.unwrap().into_inner();
    assert_eq!((merged.known, merged.scans), (true, 1402));
    let merged = merged.model_set.unwrap();
    assert!(merged.method.ends_with(", of sessions 1, 2 together"), "{}", merged.method);
}

#[tokio::test]
async fn what_cannot_be_fitted_is_refused_and_never_reaches_the_engine() {
    let (mut daemon, mut client) = daemon().await;
    let says = |status: Status, code: Code, words: &str| {
        assert!(status.code() == code && status.message().contains(words), "{status}");
    };
    says(client.refit_sessions(refit(&[0])).await.unwrap_err(), Code::InvalidArgument, "0 is not a session");
    says(client.refit_sessions(refit(&[9])).await.unwrap_err(), Code::NotFound, "no session 9");
    says(client.refit_sessions(refit(&[4])).await.unwrap_err(), Code::FailedPrecondition, "session 4 is RAMPING");
    says(client.refit_sessions(refit(&[3])).await.unwrap_err(), Code::FailedPrecondition, "session 3: row 7");
    let laid_aside = client.refit_sessions(refit(&[1, 5])).await.unwrap_err();
    says(laid_aside, Code::FailedPrecondition, "session 5 was discarded");
    says(client.refit_sessions(refit(&[])).await.unwrap_err(), Code::InvalidArgument, "sessions: none is named");
    // As many as a request holds, and refused before one of them is looked up.
    let many = refit(&[9; 60_000]);
    says(client.refit_sessions(many).await.unwrap_err(), Code::InvalidArgument, "60000 are named, expected 1 to 32");
    says(client.refit_sessions(refit(&[1, 1])).await.unwrap_err(), Code::InvalidArgument, "named twice");
    assert!(daemon.requests.try_recv().is_err());
}

#[tokio::test]
async fn one_fit_runs_at_a_time_and_the_engine_has_the_last_word() {
    let (mut daemon, mut client) = daemon().await;
    let turn = daemon.engine().fits().try_acquire_owned().unwrap();
    let status = client.refit_sessions(refit(&[1])).await.unwrap_err();
    assert_eq!(status.code(), Code::ResourceExhausted, "{status}");
    drop(turn);
    let refused =
        Err(Rejection::Unavailable(ErrorReason::ChangeUnderWay, "session 1 is being deleted: ask again".to_owned()));
    let answer = daemon.replied(client.refit_sessions(refit(&[1])), refused, |_| ()).await;
    assert_eq!(answer.unwrap_err().message(), "session 1 is being deleted: ask again");
}

#[tokio::test]
async fn calls_that_are_given_up_do_not_pile_up_in_the_store() {
    let (ask, mut asked) = tokio::sync::mpsc::unbounded_channel();
    let busy = move |session: u64, told: Told<SessionSamples>| drop(ask.send((session, told)));
    let store = Store { samples: Some(Box::new(busy)), ..Store::default() };
    let daemon = start_backed(store, Limits { long_calls_per_peer: 1, ..patient() }).await;
    let view = SessionView { number: 1, patch: FOREARM.into(), state: SessionState::Review, ..SessionView::default() };
    daemon.engine().catalogue(Arc::new(Catalogue { sessions: vec![Arc::new(view)], ..Catalogue::default() }));
    let mut client = CalibrationServiceClient::new(daemon.connect().await);
    // It is given up when the store has been asked.
    let (_, told) = tokio::select! {
        answer = client.export_samples(v1::SessionRequest { session: 1 }) => panic!("{answer:?}"),
        question = asked.recv() => question.unwrap(),
    };
    let refused = client.export_samples(v1::SessionRequest { session: 1 }).await.unwrap_err();
    assert_eq!(refused.code(), Code::ResourceExhausted, "{refused}");
    let refused = client.refit_sessions(refit(&[1])).await.unwrap_err();
    assert_eq!(refused.code(), Code::ResourceExhausted, "{refused}");
    // The store answers whom nobody waits for, and there is room again.
    told(Ok(SessionSamples::default()));
    let export = client.export_samples(v1::SessionRequest { session: 1 });
    let answer = async {
        let (session, told): (u64, Told<SessionSamples>) = asked.recv().await.unwrap();
        assert_eq!(session, 1);
        told(Ok(SessionSamples::default()));
    };
    let (exported, ()) = tokio::join!(export, answer);
    assert!(exported.unwrap_err().message().contains("session 1 has no samples"));
}
