//! How long a value takes to a reader beside peers that do nothing. Prints figures and judges none.

use std::time::Instant;

use crate::attacks::mute;
use crate::fixture::*;

const ROUNDS: usize = 3;
const VALUES: usize = 300;
const EVERY: Duration = Duration::from_millis(10);
const MUTE: usize = 50;
/// Each takes two files: `ulimit -n 8192`.
const IDLE: usize = 2_000;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "prints figures: cargo test --release -p taxel-rpc --test service -- --ignored --nocapture latency"]
async fn latency_beside_peers_that_do_nothing() {
    let daemon = start_with(&[FOREARM], Limits::default()).await;
    daemon.engine().patch(0, snapshot(1, Time::default()));
    let mut reader = stream(daemon.connect().await, None).await.unwrap();
    let (mut taken, mut sequence) = ([const { Vec::new() }; 3], 1);
    for _ in 0..ROUNDS {
        for (beside, taken) in taken.iter_mut().enumerate() {
            let mut peers = Vec::new();
            for _ in 0..[0, MUTE, 0][beside] {
                peers.push(mute(&daemon).await);
            }
            for _ in 0..[0, 0, IDLE][beside] {
                peers.push(TcpStream::connect(daemon.address).await.unwrap());
            }
            values(&daemon, &mut reader, &mut sequence, taken).await;
        }
    }
    let names = ["alone".to_owned(), format!("beside {MUTE} that never read"), format!("beside {IDLE} idle sockets")];
    for (name, mut taken) in names.into_iter().zip(taken) {
        taken.sort();
        let [p50, p99] = [50, 99].map(|percent| taken[taken.len() * percent / 100].as_secs_f64() * 1e3);
        println!("{name}: p50 {p50:.2} ms, p99 {p99:.2} ms");
    }
}

/// From the engine's publication to the reader's hand.
async fn values(
    daemon: &Daemon,
    reader: &mut Streaming<v1::ForceSample>,
    sequence: &mut u64,
    taken: &mut Vec<Duration>,
) {
    let mut ticks = tokio::time::interval(EVERY);
    for _ in 0..VALUES {
        ticks.tick().await;
        *sequence += 1;
        let published = Instant::now();
        daemon.engine().patch(0, snapshot(*sequence, Time::default()));
        while reader.message().await.unwrap().unwrap().sequence < *sequence {}
        taken.push(published.elapsed());
    }
}
