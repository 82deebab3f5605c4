//! Sessions: commands go to the engine, views come back, and a watcher sees the session to its end.

use taxel_engine::calibration::fit::Branch;
use taxel_engine::calibration::{Direction, RefusalCounts, SampleRefusal};

use crate::fixture::*;

fn view(number: u64, state: SessionState) -> SessionView {
    SessionView { number, patch: FOREARM.to_owned(), state, ..SessionView::default() }
}

fn publish(daemon: &Daemon, number: u64, state: SessionState) {
    daemon.engine().session(0, Some(Arc::new(view(number, state))));
}

fn advance(session: u64, action: v1::SessionAction) -> v1::AdvanceSessionRequest {
    v1::AdvanceSessionRequest { session, action: action.into(), ..v1::AdvanceSessionRequest::default() }
}

#[tokio::test]
async fn every_session_command_reaches_the_engine_and_shows_the_session() {
    let mut daemon = start().await;
    let mut client = CalibrationServiceClient::new(daemon.connect().await);
    let mut refused = RefusalCounts::default();
    refused.add(SampleRefusal::TooFast, 1);
    let full = SessionView {
        refused,
        confirmed_by: Some("Ada".to_owned()),
        target_kpa: 60.0,
        branches: Branch::Both,
        direction: Direction::Falling,
        accepted: 12,
        durable: 10,
        pressure_kpa: Some(3.5),
        remaining_s: Some(f64::INFINITY),
        responding: (18, 20),
        model_set: Some("m-1".into()),
        ..view(8, SessionState::Taring)
    };
    let request = v1::StartSessionRequest {
        target_kpa: Some(60.0),
        confirmed_by: "Ada".to_owned(),
        branches: v1::Branches::Both.into(),
        ..v1::StartSessionRequest::default()
    };
    let done = || Ok(Done::Session(Arc::new(full.clone())));
    let session = daemon.replied(client.start_session(request), done(), |command| {
        let Command::StartSession { patch, target, branches, confirmed_by, .. } = command else {
            panic!("{command:?}")
        };
        assert_eq!((patch.as_str(), confirmed_by.as_deref()), (FOREARM, Some("Ada")));
        assert_eq!((target, branches), (Some(Kilopascal(60.0)), Some(Branch::Both)));
    });
    let session = session.await.unwrap();
    assert_eq!((session.session, session.state()), (8, v1::SessionState::Taring));
    assert_eq!((session.accepted, session.durable, session.refused["too_fast"]), (12, 10, 1));
    assert_eq!((session.pressure_kpa, session.remaining_s), (Some(3.5), None), "no infinity goes out");
    assert_eq!((session.taxels_responding, session.taxels), (18, 20));
    assert_eq!((session.branches(), session.falling), (v1::Branches::Both, true));

    use v1::SessionAction::{Abort, Discard, FinishRamp, StartRamp};
    let commands = [
        (StartRamp, Command::StartRamp { session: 8 }),
        (FinishRamp, Command::FinishRamp { session: 8 }),
        (Abort, Command::AbortSession { session: 8, reason: None }),
        (Discard, Command::DiscardSession { session: 8 }),
    ];
    for (action, expected) in commands {
        let call = client.advance_session(advance(8, action));
        let same = |command| assert_eq!(format!("{command:?}"), format!("{expected:?}"));
        daemon.replied(call, done(), same).await.unwrap();
    }
    let call = client.delete_session(v1::SessionRequest { session: 8 });
    let named = |command| assert!(matches!(command, Command::DeleteSession { session: 8 }));
    daemon.replied(call, Ok(Done::Deleted), named).await.unwrap();
    let status = client.delete_session(v1::SessionRequest::default()).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
}

#[tokio::test]
async fn an_abort_says_why_and_no_other_step_does() {
    use v1::SessionAction::{Abort, Discard};
    let mut daemon = start().await;
    let mut client = CalibrationServiceClient::new(daemon.connect().await);
    let done = || Ok(Done::Session(Arc::new(view(8, SessionState::Aborted))));
    let because = |action, why: &str| v1::AdvanceSessionRequest { reason: why.to_owned(), ..advance(8, action) };
    let call = client.advance_session(because(Abort, "the gauge is silent"));
    let has_reason = |command| {
        assert!(
            matches!(command, Command::AbortSession { reason, .. } if reason.as_deref() == Some("the gauge is silent"))
        );
    };
    daemon.replied(call, done(), has_reason).await.unwrap();
    for (action, why) in [(Discard, "why".to_owned()), (Abort, "\u{1b}".to_owned()), (Abort, "x".repeat(2001))] {
        let status = client.advance_session(because(action, &why)).await.unwrap_err();
        assert_eq!(status.code(), Code::InvalidArgument, "{why}");
    }
}

#[tokio::test]
async fn a_session_that_is_deleted_is_found_no_more_and_its_watcher_is_told() {
    let daemon = start().await;
    let listed = |sessions| daemon.engine().catalogue(Arc::new(Catalogue { sessions, ..Catalogue::default() }));
    listed(vec![Arc::new(view(2, SessionState::Review))]);
    publish(&daemon, 2, SessionState::Review);
    let mut client = CalibrationServiceClient::new(daemon.connect().await);
    let mut watch = client.watch_session(v1::SessionRequest { session: 2 }).await.unwrap().into_inner();
    assert_eq!(watch.message().await.unwrap().unwrap().state(), v1::SessionState::Review);
    daemon.engine().session(0, None);
    listed(Vec::new());
    let status = watch.message().await.unwrap_err();
    assert_eq!((status.code(), status.message()), (Code::NotFound, "there is no session 2"));
    let status = client.get_session(v1::SessionRequest { session: 2 }).await.unwrap_err();
    assert_eq!(status.code(), Code::NotFound);
    let list = client.list_sessions(v1::ListRequest::default()).await.unwrap().into_inner();
    assert_eq!(list.sessions, []);
}

#[tokio::test]
async fn a_watcher_sees_the_session_at_once_and_to_its_end() {
    let daemon = start().await;
    publish(&daemon, 2, SessionState::Taring);
    let mut client = CalibrationServiceClient::new(daemon.connect().await);
    let request = v1::SessionRequest { session: 2 };
    let mut watch = client.watch_session(request).await.unwrap().into_inner();
    let first = watch.message().await.unwrap().unwrap();
    assert_eq!(first.state(), v1::SessionState::Taring);
    for state in [SessionState::Ramping, SessionState::Fitting, SessionState::Review] {
        publish(&daemon, 2, state);
        let next = watch.message().await.unwrap().unwrap();
        assert_eq!(next.state().as_str_name(), format!("SESSION_STATE_{}", state.name()));
    }
    // Another session takes the patch; what becomes of this one then is in the catalogue.
    let sessions = vec![Arc::new(view(2, SessionState::Review))];
    daemon.engine().catalogue(Arc::new(Catalogue { sessions, ..Catalogue::default() }));
    publish(&daemon, 3, SessionState::Taring);
    let sessions = vec![Arc::new(view(2, SessionState::Discarded))];
    daemon.engine().catalogue(Arc::new(Catalogue { sessions, ..Catalogue::default() }));
    let last = watch.message().await.unwrap().unwrap();
    assert_eq!(last.state(), v1::SessionState::Discarded);
    assert!(watch.message().await.unwrap().is_none(), "the stream ends with OK");
    let mut late = client.watch_session(request).await.unwrap().into_inner();
    assert_eq!(late.message().await.unwrap().unwrap(), last, "one that has ended is shown once");
    assert!(late.message().await.unwrap().is_none());
    assert_eq!(client.get_session(request).await.unwrap().into_inner(), last);
    // One that is not at its end is told of the daemon's.
    let mut watch = client.watch_session(v1::SessionRequest { session: 3 }).await.unwrap().into_inner();
    watch.message().await.unwrap().unwrap();
    daemon.shutdown.cancel();
    let status = watch.message().await.unwrap_err();
    assert_eq!((status.code(), status.message()), (Code::Unavailable, "the daemon is shutting down"));
}
