//! What clients of whoever serves `taxel.v1.ForceService` see, all of them on the present thread.

use std::time::{Duration, Instant};

use anyhow::Context;
use taxel_proto::v1::force_service_client::ForceServiceClient;
use taxel_proto::v1::{ForceSample, GetForceRequest};
use taxel_report::daemon::client::{Arrival, Crowd, PATIENCE, endpoint, made_ns, stream, watch};
use tonic::Streaming;

use crate::histogram::Histogram;

/// So many messages show where the deadlines of a rate lie.
const TO_FIND_THE_GRID: usize = 300;

/// The window of a client that never reads: as small as `taxel-client`'s, so that it is soon full.
const SMALL_WINDOW_BYTES: u32 = 4 << 10;

/// What a crowd saw together.
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

/// Deadlines at multiples of a period from an origin, in ns.
#[derive(Clone, Copy)]
struct Grid {
    origin: i64,
    period: i64,
}

impl Seen {
    /// Adds what a crowd sees within `window`, after `warm_up`.
    pub async fn watch(&mut self, crowd: &Crowd, warm_up: Duration, window: Duration) -> anyhow::Result<()> {
        let grid = match crowd.rate_hz {
            Some(hz) => Some(tokio::time::timeout(PATIENCE, grid(crowd, hz)).await.context("the grid")??),
            None => None,
        };
        watch(crowd, warm_up, window, |arrival| self.take(arrival, grid)).await?;
        self.due += crowd.rate_hz.map_or(f64::NAN, |hz| crowd.subscribers as f64 * hz * window.as_secs_f64());
        Ok(())
    }

    fn take(&mut self, Arrival { is_new, is_force, stamp_ns, made_ns, at_ns, .. }: Arrival, grid: Option<Grid>) {
        self.messages += 1;
        self.no_force += u64::from(!is_force);
        match grid {
            Some(Grid { origin, period }) => {
                self.way.add_ns(at_ns - made_ns);
                self.from_due.add_ns(at_ns - made_ns + (made_ns - origin).rem_euclid(period));
            }
            // The same value once more says that it has grown too old.
            None if is_new => self.way.add_ns(at_ns - stamp_ns),
            None => {}
        }
    }
}

/// Where the deadlines of a rate lie: messages to a lone subscriber are made shortly after them, and so behind the widest
/// gap between the places of any two of them in the period.
async fn grid(crowd: &Crowd, rate_hz: f64) -> anyhow::Result<Grid> {
    let period = (1e9 / rate_hz).round() as i64;
    let mut stream = stream(endpoint(&crowd.address)?.connect().await?, &crowd.patches[0], Some(rate_hz)).await?;
    let _at_once = stream.message().await?; // on no deadline
    let mut places = Vec::new();
    while places.len() < TO_FIND_THE_GRID {
        let sample = stream.message().await?.context("the stream ended")?;
        places.extend(made_ns(&sample).map(|made| made.rem_euclid(period)));
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
