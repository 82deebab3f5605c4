//! Clients of the daemon, all on one thread of this process.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use prost::Message;
use taxel_can::ClockReading;
use taxel_proto::v1;
use taxel_proto::v1::force_service_client::ForceServiceClient;
use taxel_proto::v1::model_service_client::ModelServiceClient;
use taxel_proto::v1::skin_service_client::SkinServiceClient;
use tonic::transport::{Channel, Endpoint};

use super::process::Daemon;

/// A daemon that does not answer by then has failed.
const PATIENCE: Duration = Duration::from_secs(15);

/// Subscribers of one connection; a connection carries at most 256 calls, and one peer 100 streams.
const STREAMS_PER_CONNECTION: usize = 25;

/// A stream's message is preceded by a byte of flags and four of length.
const MESSAGE_HEAD_BYTES: usize = 5;

/// One message's way.
#[derive(Clone, Copy, Debug)]
pub struct Delay {
    /// Which value.
    pub sequence: u64,
    /// From the newest frame's stamp to the making of the message, in us: its age.
    pub to_send_us: f64,
    /// From there into the client's hands, in us.
    pub on_the_way_us: f64,
}

/// What subscribers do together.
#[derive(Clone, Copy, Debug)]
pub struct Crowd {
    /// How many.
    pub subscribers: usize,
    /// Absent: each value as it comes.
    pub rate_hz: Option<f64>,
}

fn endpoint(address: SocketAddr) -> anyhow::Result<Endpoint> {
    Ok(Endpoint::from_shared(format!("http://{address}"))?.tcp_nodelay(true).connect_timeout(PATIENCE))
}

/// A connection to a daemon that may still be starting.
///
/// # Errors
/// If it ends, or does not listen in time.
pub async fn connect(daemon: &mut Daemon) -> anyhow::Result<Channel> {
    let (begun, endpoint) = (Instant::now(), endpoint(daemon.address)?);
    loop {
        match endpoint.connect().await {
            Ok(channel) => return Ok(channel),
            Err(error) if begun.elapsed() > PATIENCE => bail!("{}: {error}", daemon.address),
            Err(_) => daemon.alive()?,
        }
        tokio::time::sleep(Duration::from_millis(2)).await;
    }
}

/// Imports and activates a model set of this patch, whose name is empty if there is only one.
///
/// # Errors
/// If the daemon refuses.
pub async fn give_models(channel: &Channel, json: String, patch: &str) -> anyhow::Result<()> {
    let mut models = ModelServiceClient::new(channel.clone()).max_decoding_message_size(16 << 20);
    let imported = models.import_model_set(v1::ImportModelSetRequest { json, insist: false }).await?.into_inner();
    let (patch, model_set) = (patch.to_owned(), imported.model_set);
    let activate = v1::ActivateModelSetRequest { patch, model_set, expected: None };
    models.activate_model_set(activate).await?;
    Ok(())
}

/// From the first complete scan to the first force, by the frames' own stamps.
///
/// # Errors
/// If no force comes in time.
pub async fn first_force(channel: &Channel) -> anyhow::Result<Duration> {
    let request = v1::StreamForceRequest { patch: String::new(), rate_hz: None };
    let mut stream = ForceServiceClient::new(channel.clone()).stream_force(request).await?.into_inner();
    let (mut first_scan_ns, mut last) = (None, String::new());
    let until = tokio::time::Instant::now() + PATIENCE;
    while let Ok(message) = tokio::time::timeout_at(until, stream.message()).await {
        let sample = message?.context("the stream ended")?;
        if let Some(ns) = sample.monotonic_ns.filter(|_| sample.stale == 0) {
            let first_ns = *first_scan_ns.get_or_insert(ns);
            if matches!(sample.state(), v1::ForceState::Ok | v1::ForceState::Degraded) {
                return Ok(Duration::from_nanos(ns.abs_diff(first_ns)));
            }
        }
        last = format!("{}: {}", sample.state().as_str_name(), sample.reasons.join("; "));
    }
    bail!("no force within {} s; the last sample was {last}", PATIENCE.as_secs())
}

/// What a crowd of subscribers sees within `window`, after `warm_up`.
///
/// # Errors
/// If a stream ends or nothing comes.
pub async fn watch(
    address: SocketAddr,
    crowd: Crowd,
    warm_up: Duration,
    window: Duration,
) -> anyhow::Result<Vec<Delay>> {
    let from_ns = now_ns() + warm_up.as_nanos() as i64;
    let until_ns = from_ns + window.as_nanos() as i64;
    let (mut tasks, mut channel) = (tokio::task::JoinSet::new(), None);
    // Controllers do not start at the same moment.
    let apart = crowd.rate_hz.map_or(Duration::ZERO, |hz| Duration::from_secs_f64(1.0 / hz / crowd.subscribers as f64));
    for subscriber in 0..crowd.subscribers {
        if subscriber % STREAMS_PER_CONNECTION == 0 {
            channel = Some(endpoint(address)?.connect().await?);
        }
        let channel = channel.clone().context("a connection")?;
        let after = apart * subscriber as u32;
        tasks.spawn(async move {
            tokio::time::sleep(after).await;
            read(channel, crowd.rate_hz, from_ns..until_ns).await
        });
    }
    let mut delays = Vec::new();
    let all = async {
        while let Some(task) = tasks.join_next().await {
            delays.extend(task??);
        }
        anyhow::Ok(())
    };
    tokio::time::timeout(warm_up + window + PATIENCE, all).await.context("a subscriber got nothing any more")??;
    anyhow::ensure!(!delays.is_empty(), "{} subscribers got no message", crowd.subscribers);
    Ok(delays)
}

fn now_ns() -> i64 {
    ClockReading::now().time.as_nanos()
}

async fn read(channel: Channel, rate_hz: Option<f64>, during_ns: std::ops::Range<i64>) -> anyhow::Result<Vec<Delay>> {
    let request = v1::StreamForceRequest { patch: String::new(), rate_hz };
    let mut stream = ForceServiceClient::new(channel).stream_force(request).await?.into_inner();
    let mut delays = Vec::new();
    loop {
        let sample = stream.message().await?.context("the stream ended")?;
        let now_ns = now_ns();
        if now_ns >= during_ns.end {
            return Ok(delays);
        }
        if let (Some(stamp_ns), Some(age_s), true) = (sample.monotonic_ns, sample.age_s, now_ns >= during_ns.start) {
            let on_the_way_us = (now_ns - stamp_ns) as f64 * 1e-3 - age_s * 1e6;
            delays.push(Delay { sequence: sample.sequence, to_send_us: age_s * 1e6, on_the_way_us });
        }
    }
}

/// What one subscriber is sent within `window`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Traffic {
    /// Messages.
    pub messages: u64,
    /// Their bytes, HTTP/2's own not counted.
    pub bytes: u64,
}

/// Which stream a subscriber reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StreamOf {
    /// Force samples as they come.
    Force,
    /// Every taxel as it comes.
    Taxels,
}

/// Reads a stream to the end of `window` and counts.
///
/// # Errors
/// If it ends early.
pub async fn count(channel: Channel, what: StreamOf, window: Duration) -> anyhow::Result<Traffic> {
    let mut traffic = Traffic::default();
    let mut take = |bytes: usize| {
        traffic.messages += 1;
        traffic.bytes += (bytes + MESSAGE_HEAD_BYTES) as u64;
    };
    let until = tokio::time::Instant::now() + window;
    if what == StreamOf::Force {
        let request = v1::StreamForceRequest { patch: String::new(), rate_hz: None };
        let mut stream = ForceServiceClient::new(channel).stream_force(request).await?.into_inner();
        while let Ok(message) = tokio::time::timeout_at(until, stream.message()).await {
            take(message?.context("the stream ended")?.encoded_len());
        }
    } else {
        let request = v1::StreamTaxelsRequest { patch: String::new(), rate_hz: None };
        let mut stream = SkinServiceClient::new(channel).stream_taxels(request).await?.into_inner();
        while let Ok(message) = tokio::time::timeout_at(until, stream.message()).await {
            take(message?.context("the stream ended")?.encoded_len());
        }
    }
    Ok(traffic)
}
