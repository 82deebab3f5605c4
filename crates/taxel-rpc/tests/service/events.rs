//! The event log: what is kept, and as it goes on.

use taxel_engine::events::{Event, EventKind};

use crate::fixture::*;

fn happens(daemon: &Daemon, patch: &str, text: &str) {
    daemon.engine().event(Event {
        wall_ns: 1_700_000_000_500_000_000,
        kind: EventKind::FaultsCame,
        patch: patch.to_owned(),
        text: text.to_owned(),
        taxels: vec![3, 4],
        session: Some(2),
        model_set: None,
        bus: None,
    });
}

#[tokio::test]
async fn what_is_kept_comes_oldest_first_and_by_patch_and_then_the_stream_ends() {
    let daemon = start_with(&[FOREARM, HAND], patient()).await;
    for (patch, text) in [(FOREARM, "a"), (HAND, "b"), ("", "bus"), (FOREARM, "c")] {
        happens(&daemon, patch, text);
    }
    let mut client = SkinServiceClient::new(daemon.connect().await);
    for (patch, after, texts) in [("", 0, &["a", "b", "bus", "c"][..]), (HAND, 0, &["b", "bus"]), (HAND, 2, &["bus"])] {
        let request = v1::WatchEventsRequest { patch: patch.to_owned(), after, follow: false };
        let mut stream = client.watch_events(request).await.unwrap().into_inner();
        let mut events = Vec::new();
        while let Some(event) = stream.message().await.unwrap() {
            events.push(event);
        }
        assert_eq!(events.iter().map(|event| event.text.as_str()).collect::<Vec<_>>(), texts);
        let event = &events[0];
        assert_eq!((event.kind.as_str(), &event.taxels[..]), ("faults came", &[3, 4][..]));
        assert_eq!((event.time.as_ref().unwrap().seconds, event.session, event.skipped), (1_700_000_000, Some(2), 0));
    }
}

#[tokio::test]
async fn a_watcher_gets_each_event_and_is_told_what_is_no_longer_kept_and_of_the_shutdown() {
    let daemon = start_with(&[FOREARM, HAND], patient()).await;
    happens(&daemon, FOREARM, "before");
    let mut client = SkinServiceClient::new(daemon.connect().await);
    let watch = |patch: &str, after| v1::WatchEventsRequest { patch: patch.to_owned(), after, follow: true };
    let mut live = client.watch_events(watch(FOREARM, 1)).await.unwrap().into_inner();
    let mut all = client.watch_events(watch("", 0)).await.unwrap().into_inner();
    assert_eq!(all.message().await.unwrap().unwrap().text, "before");
    happens(&daemon, HAND, "elsewhere");
    happens(&daemon, FOREARM, "here");
    assert_eq!(live.message().await.unwrap().unwrap().text, "here", "neither what was before nor what is elsewhere");
    assert_eq!(all.message().await.unwrap().unwrap().text, "elsewhere");
    assert_eq!(all.message().await.unwrap().unwrap().text, "here");
    (0..4_096).for_each(|_| happens(&daemon, HAND, "flood"));
    let mut late = client.watch_events(watch("", 0)).await.unwrap().into_inner();
    let first = late.message().await.unwrap().unwrap();
    assert_eq!((first.number, first.skipped), (4, 3));
    assert_eq!(late.message().await.unwrap().unwrap().skipped, 0);
    let status = client.watch_events(watch("foot", 0)).await.unwrap_err();
    assert_eq!(status.code(), Code::NotFound);
    let status = client.watch_events(watch("", 9_999)).await.unwrap_err();
    assert!(status.code() == Code::InvalidArgument && status.message().contains("started anew"), "{status}");
    daemon.shutdown.cancel();
    let status = live.message().await.unwrap_err();
    assert_eq!((status.code(), status.message()), (Code::Unavailable, "the daemon is shutting down"));
}
