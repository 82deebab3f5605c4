//! Clients of the daemon, all on one thread of this process.

use std::cell::RefCell;
use std::ops::Range;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use futures_util::future::try_join_all;
use prost::Message;
use taxel_can::ClockReading;
use taxel_proto::v1::force_service_client::ForceServiceClient;
use taxel_proto::v1::model_service_client::ModelServiceClient;
use taxel_proto::v1::skin_service_client::SkinServiceClient;
use taxel_proto::v1::{self, ForceSample, ForceState};
use tonic::Streaming;
use tonic::transport::{Channel, Endpoint};

use super::process::{Daemon, Home};

/// A daemon that does not answer by then has failed.
pub const PATIENCE: Duration = Duration::from_secs(15);

/// Subscribers of one connection, where nothing else is wanted; a connection carries at most 256 calls, and one peer 100
/// streams.
pub const STREAMS_PER_CONNECTION: usize = 25;

/// A stream's message is preceded by a byte of flags and four of length.
const MESSAGE_HEAD_BYTES: usize = 5;

/// Subscribers that do the same.
#[derive(Clone, Debug)]
pub struct Crowd {
    /// `http://HOST:PORT` or `unix:PATH`.
    pub address: String,
    /// Shared out in turn; the empty name is the only patch there is.
    pub patches: Vec<String>,
    /// How many.
    pub subscribers: usize,
    /// How many of them share a connection.
    pub per_connection: usize,
    /// Absent: each value as it comes.
    pub rate_hz: Option<f64>,
}

/// A message in a client's hands. All times are of `CLOCK_MONOTONIC`, in ns.
#[derive(Clone, Copy, Debug)]
pub struct Arrival {
    /// Which value.
    pub sequence: u64,
    /// The subscriber's message before had another value.
    pub is_new: bool,
    /// Whether it is a force.
    pub is_force: bool,
    /// When the newest frame in it was received.
    pub stamp_ns: i64,
    /// When the message was made: the stamp and the age.
    pub made_ns: i64,
    /// Now.
    pub at_ns: i64,
}

/// The present of `CLOCK_MONOTONIC`, ns.
#[must_use]
pub fn now_ns() -> i64 {
    ClockReading::now().time.as_nanos()
}

/// Where to connect.
///
/// # Errors
/// If it is no address.
pub fn endpoint(address: &str) -> anyhow::Result<Endpoint> {
    Ok(Endpoint::from_shared(address.to_owned())?.tcp_nodelay(true).connect_timeout(PATIENCE))
}

/// The forces of a patch, whose name is empty if there is only one.
///
/// # Errors
/// If the server refuses.
pub async fn stream(channel: Channel, patch: &str, rate_hz: Option<f64>) -> anyhow::Result<Streaming<ForceSample>> {
    let request = v1::StreamForceRequest { patch: patch.to_owned(), rate_hz };
    Ok(ForceServiceClient::new(channel).stream_force(request).await?.into_inner())
}

/// When a message was made, ns, if there is any frame in it.
#[must_use]
pub fn made_ns(sample: &ForceSample) -> Option<i64> {
    sample.monotonic_ns.zip(sample.age_s).map(|(stamp_ns, age_s)| stamp_ns + (age_s * 1e9) as i64)
}

/// A connection to a daemon that may still be starting.
///
/// # Errors
/// If it ends, or does not listen in time.
pub async fn connect(daemon: &mut Daemon) -> anyhow::Result<Channel> {
    let (begun, endpoint) = (Instant::now(), endpoint(&daemon.address())?);
    loop {
        match endpoint.connect().await {
            Ok(channel) => return Ok(channel),
            Err(error) if begun.elapsed() > PATIENCE => bail!("{}: {error}", daemon.address()),
            Err(_) => daemon.alive()?,
        }
        tokio::time::sleep(Duration::from_millis(2)).await;
    }
}

/// Imports and activates a model set of this patch, whose name is empty if there is only one, and vouches for its boards, which
/// nothing touches: they were configured before there was a set that would show it.
///
/// # Errors
/// If the daemon refuses.
pub async fn give_models(channel: &Channel, json: String, patch: &str) -> anyhow::Result<()> {
    let mut models = ModelServiceClient::new(channel.clone()).max_decoding_message_size(16 << 20);
    let imported = models.import_model_set(v1::ImportModelSetRequest { json, insist: false }).await?.into_inner();
    let (patch, model_set) = (patch.to_owned(), imported.model_set);
    let activate = v1::ActivateModelSetRequest { patch: patch.clone(), model_set, expected: None };
    models.activate_model_set(activate).await?;
    let vouched = v1::BringUpRequest { patch, confirmed_by: "taxel-report".to_owned() };
    match SkinServiceClient::new(channel.clone()).bring_up(vouched).await {
        Err(status) if !status.message().contains("listen_only") => Err(status.into()),
        _ => Ok(()), // a daemon that only listens configures nothing
    }
}

/// Starts a daemon and, where there are any, gives it models for its only patch. With how long its first force took.
///
/// # Errors
/// If it cannot be started, refuses the models or comes to no force.
pub async fn start(home: &Home, models: Option<String>) -> anyhow::Result<(Daemon, Channel, Duration)> {
    let mut daemon = home.start()?;
    let channel = connect(&mut daemon).await?;
    if let Some(models) = models {
        give_models(&channel, models, "").await?;
    }
    let took = first_force(&channel).await.with_context(|| daemon.complaints())?;
    Ok((daemon, channel, took))
}

/// From the first complete scan to the first force, by the frames' own stamps.
async fn first_force(channel: &Channel) -> anyhow::Result<Duration> {
    let mut stream = stream(channel.clone(), "", None).await?;
    let (mut first_scan_ns, mut last) = (None, String::new());
    let until = tokio::time::Instant::now() + PATIENCE;
    while let Ok(message) = tokio::time::timeout_at(until, stream.message()).await {
        let sample = message?.context("the stream ended")?;
        if let Some(ns) = sample.monotonic_ns.filter(|_| sample.stale == 0) {
            let first_ns = *first_scan_ns.get_or_insert(ns);
            if is_force(&sample) {
                return Ok(Duration::from_nanos(ns.abs_diff(first_ns)));
            }
        }
        last = format!("{}: {}", sample.state().as_str_name(), sample.reasons.join("; "));
    }
    bail!("no force within {} s; the last sample was {last}", PATIENCE.as_secs())
}

fn is_force(sample: &ForceSample) -> bool {
    matches!(sample.state(), ForceState::Ok | ForceState::Degraded)
}

/// Shows `see` every message that a crowd gets within `window`, after `warm_up`.
///
/// # Errors
/// If a stream ends, or a subscriber gets nothing any more.
pub async fn watch(crowd: &Crowd, warm_up: Duration, window: Duration, see: impl FnMut(Arrival)) -> anyhow::Result<()> {
    let from_ns = now_ns() + warm_up.as_nanos() as i64;
    let during_ns = from_ns..from_ns + window.as_nanos() as i64;
    let (see, mut readers, mut channel) = (RefCell::new(see), Vec::new(), None);
    for subscriber in 0..crowd.subscribers {
        if subscriber % crowd.per_connection == 0 {
            channel = Some(endpoint(&crowd.address)?.connect().await?);
        }
        let channel = channel.clone().context("a connection")?;
        let patch = &crowd.patches[subscriber % crowd.patches.len()];
        readers.push(read(stream(channel, patch, crowd.rate_hz).await?, during_ns.clone(), &see));
    }
    let all = tokio::time::timeout(warm_up + window + PATIENCE, try_join_all(readers));
    all.await.context("a subscriber got nothing any more")??;
    Ok(())
}

/// Reads a stream to the end of a span.
async fn read(
    mut stream: Streaming<ForceSample>,
    during_ns: Range<i64>,
    see: &RefCell<impl FnMut(Arrival)>,
) -> anyhow::Result<()> {
    let mut last = None;
    loop {
        let sample = stream.message().await?.context("the stream ended")?;
        let at_ns = now_ns();
        if at_ns >= during_ns.end {
            return Ok(());
        }
        let (sequence, is_force) = (sample.sequence, is_force(&sample));
        let is_new = last.replace(sequence) != Some(sequence);
        if let (Some(stamp_ns), Some(made_ns), true) = (sample.monotonic_ns, made_ns(&sample), at_ns >= during_ns.start)
        {
            (see.borrow_mut())(Arrival { sequence, is_new, is_force, stamp_ns, made_ns, at_ns });
        }
    }
}

/// What one subscriber is sent within a window.
#[derive(Clone, Copy, Debug, Default)]
pub struct Traffic {
    /// Messages.
    pub messages: u64,
    /// Their bytes, HTTP/2's own not counted.
    pub bytes: u64,
}

/// Reads a stream to the end of `window` and counts.
///
/// # Errors
/// If it ends early.
pub async fn count(mut stream: Streaming<impl Message + Default>, window: Duration) -> anyhow::Result<Traffic> {
    let (mut traffic, until) = (Traffic::default(), tokio::time::Instant::now() + window);
    while let Ok(message) = tokio::time::timeout_at(until, stream.message()).await {
        traffic.messages += 1;
        traffic.bytes += (message?.context("the stream ended")?.encoded_len() + MESSAGE_HEAD_BYTES) as u64;
    }
    Ok(traffic)
}
