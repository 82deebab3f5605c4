//! Lists come newest first, in pages, by patch.

use crate::fixture::*;

#[tokio::test]
async fn sessions_come_newest_first_in_pages_with_the_live_state() {
    let daemon = start_with(&[FOREARM, HAND], patient()).await;
    let view = |number, patch: &str, state| {
        Arc::new(SessionView { number, patch: patch.to_owned(), state, ..SessionView::default() })
    };
    let patch_of = |number| if number % 2 == 0 { FOREARM } else { HAND };
    let sessions = (1..=5).map(|n| view(n, patch_of(n), SessionState::Discarded)).collect();
    daemon.engine().catalogue(Arc::new(Catalogue { sessions, ..Catalogue::default() }));
    daemon.engine().session(0, Some(view(4, FOREARM, SessionState::Review)));
    daemon.engine().session(1, Some(view(6, HAND, SessionState::Ramping)));
    let mut client = CalibrationServiceClient::new(daemon.connect().await);

    let (mut numbers, mut before) = (Vec::new(), 0);
    for sessions in [4, 2] {
        let request = v1::ListRequest { most: 4, before, ..Default::default() };
        let page = client.list_sessions(request).await.unwrap().into_inner();
        assert_eq!(page.sessions.len(), sessions);
        numbers.extend(page.sessions.iter().map(|s| (s.session, s.state())));
        before = page.sessions[sessions - 1].session;
    }
    use v1::SessionState::{Discarded, Ramping, Review};
    let expected = [(6, Ramping), (5, Discarded), (4, Review), (3, Discarded), (2, Discarded), (1, Discarded)];
    assert_eq!(numbers, expected);

    let request = v1::ListRequest { patch: FOREARM.to_owned(), ..Default::default() };
    let page = client.list_sessions(request).await.unwrap().into_inner();
    assert_eq!(page.sessions.iter().map(|s| s.session).collect::<Vec<_>>(), [4, 2]);
    let request = v1::ListRequest { most: 1_001, ..Default::default() };
    let status = client.list_sessions(request).await.unwrap_err();
    assert!(status.message().contains("most: 1001 is not in 0 to 1000"), "{status:?}");
}
