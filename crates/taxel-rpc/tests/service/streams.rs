//! The policy of streams: the first message at once, the newest value wins, what is skipped is counted, a true age
//! always, and an end that names its reason.

use crate::fixture::*;

type Forces = Streaming<v1::ForceSample>;

async fn next(stream: &mut Forces) -> v1::ForceSample {
    stream.message().await.unwrap().unwrap()
}

#[tokio::test]
async fn the_first_message_comes_at_once_and_then_each_value() {
    let daemon = start().await;
    daemon.engine().patch(0, snapshot(41, Time::default()));
    let mut stream = stream(daemon.connect().await, None).await.unwrap();
    assert_eq!(next(&mut stream).await.sequence, 41);
    for sequence in 42..60 {
        daemon.engine().patch(0, snapshot(sequence, Time::default()));
        let got = next(&mut stream).await;
        assert_eq!((got.sequence, got.skipped, got.total_n), (sequence, 0, Some(sequence as f64)));
    }
    let mut taxels = SkinServiceClient::new(daemon.connect().await);
    let mut taxels = taxels.stream_taxels(v1::StreamRequest::default()).await.unwrap().into_inner();
    let first = taxels.message().await.unwrap().unwrap();
    assert_eq!((first.sequence, first.taxels.len()), (59, TAXELS));
    daemon.engine().patch(0, snapshot(63, Time::default()));
    let second = taxels.message().await.unwrap().unwrap();
    assert_eq!((second.sequence, second.skipped), (63, 3));
}

/// Publishes 2,000 values while a reader with a tiny window sleeps; another client's calls in between prove that the
/// server had its chance to send.
async fn stall(daemon: &Daemon) -> (Forces, u64) {
    daemon.engine().patch(0, snapshot(1, Time::default()));
    let endpoint = daemon.endpoint().initial_stream_window_size(256);
    let mut stream = stream(endpoint.connect().await.unwrap(), None).await.unwrap();
    assert_eq!(next(&mut stream).await.sequence, 1);
    let other = daemon.connect().await;
    let last = 2_001;
    for sequence in 2..=last {
        daemon.engine().patch(0, snapshot(sequence, Time::default()));
        if sequence % 20 == 0 {
            get_force(other.clone()).await.unwrap();
        }
    }
    (stream, last)
}

#[tokio::test]
async fn a_reader_that_stalls_skips_to_the_newest_value_and_is_told_how_many() {
    let daemon = start_with(&[FOREARM], patient()).await;
    let (mut stream, last) = stall(&daemon).await;
    let (mut sequence, mut messages) = (1, 0);
    while sequence < last {
        let got = next(&mut stream).await;
        assert_eq!(got.sequence, sequence + 1 + got.skipped, "the count of skipped values adds up");
        sequence = got.sequence;
        messages += 1;
    }
    assert!(messages < 100, "{messages} messages waited for a reader that slept: nothing may queue in the server");
}

#[tokio::test]
async fn a_fixed_rate_holds_the_value_with_its_true_age() {
    let daemon = start().await;
    let received = Time::from_seconds(10.0);
    daemon.engine().patch(0, snapshot(5, received));
    daemon.set_clock(received);
    let mut stream = stream(daemon.connect().await, Some(1000.0)).await.unwrap();
    let (mut clock, mut age) = (received, 0.0);
    for _ in 0..50 {
        let got = next(&mut stream).await;
        let now = got.age_s.unwrap();
        assert!(now >= age && now <= clock.seconds_since(received), "an age of {now} s after {age} s");
        assert_eq!((got.sequence, got.skipped, got.monotonic_ns), (5, 0, Some(received.as_nanos())));
        age = now;
        clock = clock + Duration::from_millis(7);
        daemon.set_clock(clock);
    }
    assert!(age > 0.0, "the age has grown");
    daemon.engine().patch(0, snapshot(9, clock));
    let got = loop {
        let got = next(&mut stream).await;
        if got.sequence == 9 {
            break got;
        }
    };
    assert_eq!((got.skipped, got.age_s), (3, Some(0.0)));
}

#[tokio::test]
async fn every_stream_ends_with_the_reason_when_the_daemon_or_the_engine_stops() {
    for (stops, why) in [(true, "the daemon is shutting down"), (false, "the engine has stopped")] {
        let mut daemon = start().await;
        let (mut each, mut held) = (
            stream(daemon.connect().await, None).await.unwrap(),
            stream(daemon.connect().await, Some(500.0)).await.unwrap(),
        );
        next(&mut each).await;
        next(&mut held).await;
        if stops {
            daemon.shutdown.cancel();
        } else {
            daemon.publisher = None;
        }
        for stream in [&mut each, &mut held] {
            let status = loop {
                if let Err(status) = stream.message().await {
                    break status;
                }
            };
            assert_eq!((status.code(), status.message()), (Code::Unavailable, why));
        }
        if stops {
            daemon.server.await.unwrap().unwrap(); // within the drain, which is an hour here
        }
    }
}
