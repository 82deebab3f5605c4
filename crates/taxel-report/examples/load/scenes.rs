//! Each scene: who is there, and what is printed of it.

use std::net::TcpStream;
use std::path::Path;
use std::time::Duration;

use anyhow::Context;
use taxel_proto::v1::ForceSample;
use taxel_report::daemon::client::{Crowd, STREAMS_PER_CONNECTION, endpoint, stream};
use taxel_report::daemon::process::Used;

use crate::crowd::{self, Seen};
use crate::histogram::Histogram;
use crate::jitter::Jitter;
use crate::live::Live;
use crate::raw::Raw;
use crate::rows;

/// Streams settle before a window begins.
const WARM_UP: Duration = Duration::from_secs(1);

/// What is compared is watched in turns, so that what else the machine does concerns all alike.
const ROUNDS: usize = 3;

/// The hand that plays the operator does the same again after so long.
const HAND: Duration = Duration::from_secs(10);

/// Two daemons are started each time.
const RAW_ROUNDS: usize = 2;

fn crowd(live: &Live, subscribers: usize, rate_hz: Option<f64>) -> Crowd {
    let (address, patches) = (live.daemon.address(), live.patches.clone());
    Crowd { address, patches, subscribers, per_connection: STREAMS_PER_CONNECTION, rate_hz }
}

/// What was seen of a case, and how late a bare timer was meanwhile.
#[derive(Default)]
struct Case {
    seen: Seen,
    timer: Histogram,
}

impl Case {
    async fn watch(&mut self, crowd: &Crowd, span: Duration) -> anyhow::Result<()> {
        let jitter = Jitter::begin();
        self.seen.watch(crowd, WARM_UP, span).await?;
        self.timer.add(&jitter.end());
        Ok(())
    }

    fn print(&self, name: &str) {
        rows::seen(name, &self.seen, &self.timer);
    }
}

/// One crowd, and what the daemon's process was at the beginning and at the end of the span.
async fn soak(name: &str, live: &Live, crowd: &Crowd, span: Duration) -> anyhow::Result<()> {
    let used = async {
        tokio::time::sleep(2 * WARM_UP).await;
        let begin = live.daemon.used()?;
        tokio::time::sleep(span.saturating_sub(2 * WARM_UP)).await;
        anyhow::Ok::<[Used; 2]>([begin, live.daemon.used()?])
    };
    let mut case = Case::default();
    let (watched, used) = tokio::join!(case.watch(crowd, span), used);
    watched.with_context(|| live.daemon.complaints())?;
    rows::head();
    case.print(name);
    rows::process(name, &used?, span.saturating_sub(2 * WARM_UP).as_secs_f64());
    Ok(())
}

/// 64 subscribers at 1 kHz.
pub async fn rates(taxeld: &Path, span: Duration) -> anyhow::Result<()> {
    let live = Live::forearm(taxeld, "").await?;
    soak("64 subscribers at 1 kHz", &live, &crowd(&live, 64, Some(1_000.0)), span).await
}

/// Ten simulated buses with 5,000 taxels and 100 subscribers.
pub async fn buses(taxeld: &Path, span: Duration) -> anyhow::Result<()> {
    let live = Live::ten_buses(taxeld).await?;
    soak("10 buses, 5,000 taxels, 100 subscribers", &live, &crowd(&live, 100, None), span).await
}

/// Ten who read, without and beside fifty who never do.
pub async fn unread(taxeld: &Path, span: Duration) -> anyhow::Result<()> {
    let live = Live::forearm(taxeld, "").await?;
    let ten = crowd(&live, 10, Some(100.0));
    let (mut alone, mut beside) = (Case::default(), Case::default());
    for _ in 0..ROUNDS {
        alone.watch(&ten, span).await?;
        let held = crowd::unread(&ten.address, &ten.patches[0], 50).await?;
        beside.watch(&ten, span).await.with_context(|| live.daemon.complaints())?;
        drop(held);
    }
    rows::head();
    alone.print("10 at 100 Hz, alone");
    beside.print("10 at 100 Hz, beside 50 who never read");
    ratios(&beside, &alone);
    Ok(())
}

/// Ten who read and others who come, without and beside sockets that say nothing.
pub async fn idle(taxeld: &Path, span: Duration) -> anyhow::Result<()> {
    const SOCKETS: usize = 2_000;
    const NEWCOMERS: usize = 50;
    let live = Live::forearm(taxeld, "").await?;
    let ten = crowd(&live, 10, Some(100.0));
    let host = ten.address.trim_start_matches("http://");
    let (mut alone, mut beside) = (Case::default(), Case::default());
    let [mut waits_alone, mut waits_beside] = [Histogram::default(), Histogram::default()];
    for _ in 0..ROUNDS {
        alone.watch(&ten, span).await?;
        waits_alone.add(&crowd::newcomers(&ten.address, "", NEWCOMERS).await?);
        let sockets = (0..SOCKETS).map(|_| TcpStream::connect(host)).collect::<Result<Vec<_>, _>>();
        let sockets = sockets.with_context(|| format!("{SOCKETS} sockets: see `ulimit -n`"))?;
        waits_beside.add(&crowd::newcomers(&ten.address, "", NEWCOMERS).await?);
        beside.watch(&ten, span).await.with_context(|| live.daemon.complaints())?;
        drop(sockets);
    }
    rows::head();
    alone.print("10 at 100 Hz, alone");
    beside.print(&format!("10 at 100 Hz, beside {SOCKETS} idle sockets"));
    rows::waits("a new client, alone", &waits_alone);
    rows::waits(&format!("a new client, beside {SOCKETS} idle sockets"), &waits_beside);
    ratios(&beside, &alone);
    Ok(())
}

fn ratios(beside: &Case, alone: &Case) {
    rows::ratio("beside them, of alone, message made to client", [&beside.seen.way, &alone.seen.way]);
    rows::ratio("beside them, of alone, due to client", [&beside.seen.from_due, &alone.seen.from_due]);
}

/// What the daemon sends while the hand that plays the operator lays something down and takes it away, message by message.
async fn messages(address: &str) -> anyhow::Result<Vec<ForceSample>> {
    let until = tokio::time::Instant::now() + HAND;
    let mut stream = stream(endpoint(address)?.connect().await?, "", None).await?;
    let mut messages = Vec::new();
    while tokio::time::Instant::now() < until {
        messages.push(stream.message().await?.context("the stream ended")?);
    }
    Ok(messages)
}

/// The daemon beside bare tonic.
pub async fn raw(taxeld: &Path, span: Duration) -> anyhow::Result<()> {
    let cases = [
        ("10 subscribers on one connection", 10, 10, None),
        ("10 subscribers on ten connections", 10, 1, None),
        ("1 subscriber at 1 kHz", 1, 1, Some(1_000.0)),
    ];
    let names = ["bare tonic", "taxeld", "taxeld, Unix socket"];
    let mut seen: Vec<[Case; 3]> = cases.iter().map(|_| Default::default()).collect();
    for _ in 0..RAW_ROUNDS {
        let live = Live::forearm(taxeld, "").await?;
        let raw = Raw::start(&messages(&live.daemon.address()).await?, &live.home.path(""))?;
        let servers = [raw.address.clone(), live.daemon.address(), live.home.socket_address()];
        for (&(_, subscribers, per_connection, rate_hz), seen) in cases.iter().zip(&mut seen) {
            for (address, seen) in servers.iter().zip(seen) {
                let (address, patches) = (address.clone(), live.patches.clone());
                seen.watch(&Crowd { address, patches, subscribers, per_connection, rate_hz }, span).await?;
            }
        }
    }
    rows::head();
    for ((case, ..), seen) in cases.iter().zip(&seen) {
        names.iter().zip(seen).for_each(|(name, seen)| seen.print(&format!("{name}: {case}")));
    }
    for ((case, ..), [bare, others @ ..]) in cases.iter().zip(&seen) {
        for (name, other) in names[1..].iter().zip(others) {
            rows::ratio(&format!("{name}, of bare tonic, {case}"), [&other.seen.way, &bare.seen.way]);
        }
    }
    Ok(())
}
