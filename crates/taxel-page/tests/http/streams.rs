//! Streams as server-sent events.

use serde_json::json;

use crate::fixture::*;

const FORCE: &str = "taxel.v1.ForceService/StreamForce";
const TAXELS: &str = "taxel.v1.SkinService/StreamTaxels";

#[tokio::test]
async fn several_streams_share_one_answer_under_the_names_of_their_calls() {
    let daemon = start().await;
    daemon.engine.patch(0, snapshot(1));
    let mut events = daemon.stream(&format!("/streams?call={FORCE}&call={TAXELS}&rateHz=100")).await;
    assert!(events.head.contains("200") && events.head.contains("text/event-stream"), "{}", events.head);
    let (mut forces, mut taxels) = (0, 0);
    while forces == 0 || taxels < 3 {
        match events.next().await {
            (name, message) if name == FORCE => {
                assert_eq!(message["totalN"], 1.0);
                forces += 1;
            }
            (name, message) if name == TAXELS => {
                assert_eq!(message["taxels"].as_array().unwrap().len(), crate::fixture::TAXELS);
                taxels += 1;
            }
            other => panic!("{other:?}"),
        }
    }
}

#[tokio::test]
async fn the_end_of_a_stream_says_why() {
    let daemon = start().await;
    daemon.engine.patch(0, snapshot(1));
    let mut events = daemon.stream(&format!("/{FORCE}")).await;
    assert_eq!(events.next().await.0, "", "the only call has no name");
    daemon.shutdown.cancel();
    let (name, end) = events.next().await;
    assert_eq!((name.as_str(), &end["code"]), ("end", &"UNAVAILABLE".into()));
    assert_eq!(end["reason"], "DAEMON_UNAVAILABLE");
    assert_eq!(end["call"], FORCE);
    assert!(end["message"].as_str().unwrap().contains("shutting down"));
    let mut rest = String::new();
    events.lines.read_to_string(&mut rest).await.unwrap(); // and the connection ends
}

#[tokio::test]
async fn a_slow_reader_skips_to_the_newest_value_and_is_told_how_many() {
    let daemon = start().await;
    daemon.engine.patch(0, snapshot(1));
    let mut events = daemon.stream(&format!("/{TAXELS}")).await;
    events.next().await;
    // More than all buffers between hold: the messages of so many values.
    let mut last = 1;
    let mut stalled = events.lines.into_inner();
    for _ in 0..20_000 {
        last += 1;
        daemon.engine.patch(0, snapshot(last));
        tokio::task::yield_now().await;
    }
    let mut text = String::new();
    let newest = format!("\"sequence\":\"{last}\"");
    let mut bytes = [0; 65_536];
    while !text.contains(&newest) {
        let read = stalled.read(&mut bytes).await.unwrap();
        assert_ne!(read, 0);
        text.push_str(&String::from_utf8_lossy(&bytes[..read]));
    }
    let messages = text.matches("data: ").count() as u64;
    assert!(messages < last / 2, "{messages} messages of {last} values");
    assert!(text.contains("\"skipped\":"));
}

#[tokio::test]
async fn streams_beyond_the_limit_are_refused_until_one_ends() {
    let daemon = start_with(Limits { streams: 2, ..patient() }).await;
    daemon.engine.patch(0, snapshot(1));
    let path = format!("/{FORCE}?rateHz=1000");
    let (mut first, mut second) = (daemon.stream(&path).await, daemon.stream(&path).await);
    first.next().await;
    second.next().await;
    let refused = daemon.get(&path).await;
    assert_eq!(refused.status, 429, "{refused:?}");
    assert!(refused.body.contains("2 streams are open over HTTP"), "{refused:?}");
    drop(first);
    // The place is free when the server finds that the peer is gone.
    loop {
        let mut again = daemon.stream(&path).await;
        if again.head.contains("200") {
            again.next().await;
            break;
        }
    }
    let many = format!("/streams?{}", vec![format!("call={FORCE}"); 9].join("&"));
    assert_eq!(daemon.get(&many).await.status, 400);
}

#[tokio::test]
async fn a_refused_stream_is_refused_before_it_begins() {
    let daemon = start().await;
    for (path, status) in [
        (format!("/{FORCE}?rateHz=0"), 400),
        (format!("/{FORCE}?rateHz=fast"), 400),
        (format!("/{FORCE}?speed=1"), 400),
        (format!("/{FORCE}?patch=nose"), 404),
        (format!("/streams?call={FORCE}&call=taxel.v1.ForceService/GetForce"), 400),
        ("/streams".to_owned(), 400),
        (format!("/streams?rateHz=30&call={FORCE}"), 400),
        ("/streams?call=no/such".to_owned(), 404),
    ] {
        let answer = daemon.get(&path).await;
        assert_eq!(answer.status, status, "{path}: {answer:?}");
        assert!(answer.body.contains("\"message\""), "{answer:?}");
    }
}

#[tokio::test]
async fn a_page_that_opens_later_gets_the_forces_of_the_last_ten_minutes() {
    let daemon = start().await;
    let force_at = |ms: i64, newton| {
        daemon.now_ms.store(ms, Ordering::Relaxed);
        daemon.engine.patch(
            0,
            Arc::new(PatchSnapshot { time: Time::from_nanos(1_000_000 * ms), ..(*snapshot(newton)).clone() }),
        );
    };
    let until = async |want: serde_json::Value| loop {
        let answer = daemon.get("/history?patch=left_forearm").await;
        let kept: serde_json::Value = serde_json::from_str(&answer.body).unwrap();
        let kept: Vec<_> = kept.as_array().unwrap().iter().map(|point| (point[1].clone(), point[2].clone())).collect();
        if json!(kept) == want {
            break answer.body;
        }
        tokio::time::sleep(Duration::from_millis(5)).await;
    };
    force_at(0, 5);
    until(json!([["OK", 5.0]])).await;
    force_at(200, 3); // of half a second the greatest
    force_at(600, 2);
    until(json!([["OK", 5.0], ["OK", 2.0]])).await;
    daemon.now_ms.store(2_000, Ordering::Relaxed); // no frame comes any more
    until(json!([["OK", 5.0], ["OK", 2.0], ["STALE", null]])).await;
    force_at(601_000, 4);
    let body = until(json!([["STALE", null], ["OK", 4.0]])).await;
    assert!(body.starts_with(r#"[[599.0,"STALE",null,null,null],[0.0,"OK",4.0,"#), "{body}");
    assert_eq!(daemon.get("/history?patch=nose").await.status, 404);
}

#[tokio::test]
async fn who_may_not_read_the_force_may_not_read_those_before_it() {
    let daemon = start_as(patient(), Rules::default()).await;
    daemon.engine.patch(0, snapshot(1));
    let answer = daemon.get("/history").await;
    assert_eq!((answer.status, answer.body.contains("needs the role")), (401, true), "{answer:?}");
}
