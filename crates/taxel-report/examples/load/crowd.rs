//! Clients of whoever serves `taxel.v1.ForceService`, all on the present thread, and what they see.

use std::ops::Range;
use std::time::{Duration, Instant};

use anyhow::Context;
use taxel_can::ClockReading;
use taxel_proto::v1::force_service_client::ForceServiceClient;
use taxel_proto::v1::{ForceSample, ForceState, GetForceRequest, StreamForceRequest};
use tokio::task::JoinSet;
use tonic::Streaming;
use tonic::transport::{Channel, Endpoint};

use crate::histogram::Histogram;

/// Whoever gets nothing for so long has found a fault.
const PATIENCE: Duration = Duration::from_secs(15);

/// So many messages show where the deadlines of a rate lie.
const TO_FIND_THE_GRID: usize = 300;

/// The window of a client that never reads: as small as `taxel-client`'s, so that it is soon full.
const SMALL_WINDOW_BYTES: u32 = 4 << 10;

/// Subscribers that do the same.
#[derive(Clone)]
pub struct Crowd {
    /// `http://HOST:PORT` or `unix:PATH`.
    pub address: String,
    /// Shared out in turn.
    pub patches: Vec<String>,
    pub subscribers: usize,
    pub per_connection: usize,
    /// Absent: each value as it comes.
    pub rate_hz: Option<f64>,
}

/// What they saw together.
#[derive(Default)]
pub struct Seen {
    /// Values as they come: from the stamp of the newest frame into a client's hands. At a rate, where values are held:
    /// from the making of the message.
    pub way: Histogram,
    /// At a rate: from the deadline of the message into a client's hands.
    pub from_due: Histogram,
    /// Messages that came, and messages that were due at a rate.
    pub messages: u64,
    pub due: f64,
    /// Messages without a force.
    pub no_force: u64,
}

impl Seen {
    pub fn add(&mut self, other: &Self) {
        self.way.add(&other.way);
        self.from_due.add(&other.from_due);
        self.messages += other.messages;
        self.due += other.due;
        self.no_force += other.no_force;
    }
}

/// Deadlines at multiples of a period from an origin, in ns.
#[derive(Clone, Copy)]
struct Grid {
    origin: i64,
    period: i64,
}

fn now_ns() -> i64 {
    ClockReading::now().time.as_nanos()
}

pub fn endpoint(address: &str) -> anyhow::Result<Endpoint> {
    Ok(Endpoint::from_shared(address.to_owned())?.tcp_nodelay(true).connect_timeout(PATIENCE))
}

pub async fn stream(channel: Channel, patch: &str, rate_hz: Option<f64>) -> anyhow::Result<Streaming<ForceSample>> {
    let request = StreamForceRequest { patch: patch.to_owned(), rate_hz };
    Ok(ForceServiceClient::new(channel).stream_force(request).await?.into_inner())
}

/// The next sample of a stream, and when a message was made, in ns, if there is any frame in it.
async fn next(stream: &mut Streaming<ForceSample>) -> anyhow::Result<(ForceSample, Option<i64>)> {
    let sample = stream.message().await?.context("the stream ended")?;
    let made = sample.monotonic_ns.zip(sample.age_s).map(|(stamp_ns, age_s)| stamp_ns + (age_s * 1e9) as i64);
    Ok((sample, made))
}

/// What a crowd sees within `window`, after `warm_up`.
pub async fn watch(crowd: &Crowd, warm_up: Duration, window: Duration) -> anyhow::Result<Seen> {
    let grid = match crowd.rate_hz {
        Some(hz) => Some(tokio::time::timeout(PATIENCE, grid(crowd, hz)).await.context("the grid")??),
        None => None,
    };
    let from_ns = now_ns() + warm_up.as_nanos() as i64;
    let during = from_ns..from_ns + window.as_nanos() as i64;
    let (mut readers, mut channel) = (JoinSet::new(), None);
    for subscriber in 0..crowd.subscribers {
        if subscriber % crowd.per_connection == 0 {
            channel = Some(endpoint(&crowd.address)?.connect().await?);
        }
        let channel = channel.clone().context("a connection")?;
        let patch = &crowd.patches[subscriber % crowd.patches.len()];
        let stream = stream(channel, patch, crowd.rate_hz).await?;
        readers.spawn(read(stream, during.clone(), grid));
    }
    let mut all = Seen::default();
    let gather = async {
        while let Some(seen) = readers.join_next().await {
            all.add(&seen??);
        }
        anyhow::Ok(())
    };
    tokio::time::timeout(warm_up + window + PATIENCE, gather).await.context("a subscriber got nothing any more")??;
    all.due = crowd.rate_hz.map_or(f64::NAN, |hz| crowd.subscribers as f64 * hz * window.as_secs_f64());
    Ok(all)
}

async fn read(mut stream: Streaming<ForceSample>, during: Range<i64>, grid: Option<Grid>) -> anyhow::Result<Seen> {
    let (mut seen, mut last) = (Seen::default(), None);
    loop {
        let (sample, made) = next(&mut stream).await?;
        let now = now_ns();
        if now >= during.end {
            return Ok(seen);
        }
        let is_new = last.replace(sample.sequence) != Some(sample.sequence);
        let (Some(stamp), Some(made), true) = (sample.monotonic_ns, made, now >= during.start) else { continue };
        seen.messages += 1;
        seen.no_force += u64::from(!matches!(sample.state(), ForceState::Ok | ForceState::Degraded));
        match grid {
            Some(Grid { origin, period }) => {
                seen.way.add_ns(now - made);
                seen.from_due.add_ns(now - made + (made - origin).rem_euclid(period));
            }
            // The same value once more says that it has grown too old.
            None if is_new => seen.way.add_ns(now - stamp),
            None => {}
        }
    }
}

/// Where the deadlines of a rate lie: messages to a lone subscriber are made shortly after them, and so behind the widest
/// gap between the places of any two of them in the period.
async fn grid(crowd: &Crowd, rate_hz: f64) -> anyhow::Result<Grid> {
    let period = (1e9 / rate_hz).round() as i64;
    let mut stream = stream(endpoint(&crowd.address)?.connect().await?, &crowd.patches[0], Some(rate_hz)).await?;
    let _at_once = next(&mut stream).await?; // on no deadline
    let mut places = Vec::new();
    while places.len() < TO_FIND_THE_GRID {
        places.extend(next(&mut stream).await?.1.map(|made| made.rem_euclid(period)));
    }
    places.sort_unstable();
    let before = places.last().map_or(0, |last| last - period);
    let gaps = std::iter::once(before).chain(places.iter().copied()).zip(&places);
    let behind = gaps.max_by_key(|(place, next)| *next - place).map(|(_, next)| *next);
    Ok(Grid { origin: behind.context("no message with a time")?, period })
}

/// Streams at this rate of which nobody reads a message.
pub async fn unread(address: &str, patch: &str, streams: usize) -> anyhow::Result<Vec<Streaming<ForceSample>>> {
    let mut held = Vec::new();
    for _ in 0..streams {
        let channel = endpoint(address)?.initial_stream_window_size(SMALL_WINDOW_BYTES).connect().await?;
        held.push(stream(channel, patch, Some(1_000.0)).await?);
    }
    Ok(held)
}

/// How long new clients, one after the other, wait for their first force.
pub async fn newcomers(address: &str, patch: &str, clients: usize) -> anyhow::Result<Histogram> {
    let mut waits = Histogram::default();
    for _ in 0..clients {
        let begun = Instant::now();
        let channel = endpoint(address)?.connect().await?;
        ForceServiceClient::new(channel).get_force(GetForceRequest { patch: patch.to_owned() }).await?;
        waits.add_ns(begun.elapsed().as_nanos() as i64);
    }
    Ok(waits)
}
