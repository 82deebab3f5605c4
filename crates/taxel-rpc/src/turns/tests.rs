//! Time stands still in these tests until nobody has anything to do: what would wait for ever fails at once.

use super::*;
use futures_util::FutureExt;
use std::sync::atomic::{AtomicBool, Ordering};
use tokio::sync::mpsc;
use tokio::time::timeout;

const EVER: Duration = Duration::from_secs(3600);

struct Scene {
    turns: Turns,
    engine: watch::Sender<Arc<PatchSnapshot>>,
    soon: watch::Sender<()>,
    again: watch::Sender<()>,
}

/// One patch of which nothing has been published.
fn scene() -> Scene {
    let [soon, again] = [watch::Sender::default(), watch::Sender::default()];
    let engine = watch::Sender::default();
    Scene {
        turns: Turns::begin([(engine.subscribe(), soon.subscribe())].into_iter(), &again.subscribe()),
        engine,
        soon,
        again,
    }
}

fn waiting(turns: &Turns) -> Option<usize> {
    turns.0[0].subscribers().as_ref().map(|subscribers| subscribers.all.len())
}

/// The next turn of a subscriber; false at the end of all turns.
async fn turn(subscriber: &mut watch::Receiver<()>) -> bool {
    timeout(EVER, subscriber.changed()).await.expect("it is never told").is_ok()
}

/// Told once, and not again.
async fn is_told_once(subscriber: &mut watch::Receiver<()>) -> bool {
    turn(subscriber).await && timeout(EVER, subscriber.changed()).await.is_err()
}

/// What has been done so far, in order.
async fn done(seen: &mut mpsc::UnboundedReceiver<(&'static str, usize)>) -> Vec<(&'static str, usize)> {
    let mut all = Vec::new();
    while let Ok(Some(one)) = timeout(EVER, seen.recv()).await {
        all.push(one);
    }
    all
}

/// Subscribers that each make a message at their turn, and each have another task that writes it. `slow` is how long making
/// one takes.
fn readers(turns: &Turns, many: usize, slow: Duration) -> mpsc::UnboundedReceiver<(&'static str, usize)> {
    let (note, seen) = mpsc::unbounded_channel();
    for subscriber in 0..many {
        let (to_write, mut made) = mpsc::unbounded_channel();
        let (mut at_turn, noted) = (turns.join(0), note.clone());
        tokio::spawn(async move {
            while at_turn.changed().await.is_ok() {
                let _advanced = tokio::time::advance(slow).now_or_never(); // others wait meanwhile
                let sent = noted.send(("made", subscriber)).is_ok() && to_write.send(()).is_ok();
                assert!(sent, "somebody looks on");
            }
        });
        let noted = note.clone();
        tokio::spawn(async move {
            while made.recv().await.is_some() {
                noted.send(("written", subscriber)).expect("somebody looks on");
            }
        });
    }
    seen
}

#[tokio::test(start_paused = true)]
async fn a_message_is_written_before_the_next_but_one_is_made() {
    let Scene { turns, engine, .. } = scene();
    let mut seen = readers(&turns, 4, Duration::ZERO);
    for _ in 0..2 {
        engine.send_replace(Arc::default());
        let done = done(&mut seen).await;
        assert_eq!(done.len(), 8, "{done:?}");
        let at = |what| done.iter().position(|one| *one == what).expect("it was done");
        for subscriber in 0..3 {
            assert!(at(("made", subscriber)) < at(("made", subscriber + 1)), "{done:?}");
        }
        for subscriber in 0..2 {
            assert!(at(("written", subscriber)) < at(("made", subscriber + 2)), "{done:?}");
        }
    }
}

#[tokio::test(start_paused = true)]
async fn when_a_round_takes_long_all_others_are_told_at_once() {
    let Scene { turns, engine, .. } = scene();
    let mut seen = readers(&turns, 6, ROUND_MAX / 3);
    engine.send_replace(Arc::default());
    let done = done(&mut seen).await;
    assert_eq!(done.len(), 12, "{done:?}");
    let last_made = done.iter().rposition(|(what, _)| *what == "made").expect("it was done");
    let written_by_then = done[..last_made].iter().filter(|(what, _)| *what == "written").count();
    assert!((2..5).contains(&written_by_then), "{done:?}");
}

#[tokio::test(start_paused = true)]
async fn a_turn_comes_with_each_value_to_the_first_also_before_it_and_when_it_is_to_be_judged_again() {
    let Scene { turns, engine, soon, again } = scene();
    let mut subscriber = turns.join(0);
    assert!(timeout(EVER, subscriber.changed()).await.is_err(), "nothing has happened yet");
    let mut second = turns.join(0);
    soon.send_replace(());
    assert!(is_told_once(&mut subscriber).await);
    assert!(timeout(EVER, second.changed()).await.is_err(), "the first alone");
    engine.send_replace(Arc::default());
    assert!(is_told_once(&mut subscriber).await);
    again.send_replace(());
    assert!(is_told_once(&mut subscriber).await);
}

/// The first to be told leaves at once and comes anew, as a client does that is told that the force is stale.
#[tokio::test(start_paused = true)]
async fn nobody_is_passed_over_where_others_leave_and_come_in_a_round() {
    let Scene { turns, again, engine: _engine, .. } = scene();
    let mut first = turns.join(0);
    let mut others: Vec<_> = (0..5).map(|_| turns.join(0)).collect();
    let (came, turns_of_first) = (Arc::new(AtomicBool::new(false)), turns.clone());
    let has_come = Arc::clone(&came);
    tokio::spawn(async move {
        assert!(turn(&mut first).await);
        drop(first);
        let mut anew = turns_of_first.join(0);
        has_come.store(true, Ordering::Relaxed);
        assert!(timeout(EVER, anew.changed()).await.is_err(), "it has not been told since it came");
    });
    again.send_replace(());
    for (number, other) in others.iter_mut().enumerate() {
        assert!(is_told_once(other).await, "{number}");
    }
    assert!(came.load(Ordering::Relaxed));
}

/// A round ends, however fast others come.
#[tokio::test(start_paused = true)]
async fn whoever_comes_during_a_round_waits_for_the_next() {
    let Scene { turns, engine, .. } = scene();
    let mut held = vec![turns.join(0)];
    for _ in 0..100 {
        engine.send_replace(Arc::default());
        assert!(turn(held.last_mut().expect("one at least")).await);
        held.push(turns.join(0)); // the round is not over yet
    }
    let mut last = turns.join(0);
    assert!(timeout(EVER, last.changed()).await.is_err());
}

#[tokio::test(start_paused = true)]
async fn whoever_has_gone_takes_no_memory() {
    let Scene { turns, engine, .. } = scene();
    let (first, mut second, third) = (turns.join(0), turns.join(0), turns.join(0));
    drop((first, third));
    engine.send_replace(Arc::default());
    assert!(is_told_once(&mut second).await);
    assert_eq!(waiting(&turns), Some(1));
    // Also where nothing is published meanwhile.
    (0..1_000).for_each(|_| drop(turns.join(0)));
    assert_eq!(waiting(&turns), Some(2), "the one that waits, and the last that came and went");
}

#[tokio::test(start_paused = true)]
async fn when_the_engine_has_stopped_nobody_waits() {
    let Scene { turns, engine, .. } = scene();
    let mut before = turns.join(0);
    engine.send_replace(Arc::default());
    drop(engine);
    assert!(turn(&mut before).await, "the last value comes before the end");
    assert!(!turn(&mut before).await);
    assert!(!turn(&mut turns.join(0)).await);
}

/// Calls may be made from another runtime than the server's.
#[test]
fn when_the_server_has_stopped_nobody_waits() {
    let server = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let Scene { turns, engine, .. } = server.block_on(async { scene() });
    let mut before = turns.join(0);
    drop(server);
    let other = tokio::runtime::Builder::new_current_thread().enable_all().start_paused(true).build().unwrap();
    other.block_on(async {
        assert!(!turn(&mut before).await);
        assert!(!turn(&mut turns.join(0)).await);
    });
    drop(engine);
}
