//! Follows streams of the daemon and keeps the newest message; a stream that ends is opened again.
//!
//! Readers take the newest from a `watch` channel, so that none of them holds up the stream or another reader: who is
//! slow misses samples, and sees by `Received::number` how many.

use std::sync::Arc;
use std::time::{Duration, SystemTime};

use taxel_client::Moment;
use taxel_proto::Timestamp;
use taxel_proto::judge::on_the_way;
use taxel_proto::v1::{ForceSample, StreamForceRequest, StreamTaxelsRequest, TaxelSample};
use tokio::sync::watch;
use tonic::{Status, Streaming};

use crate::daemon::{Daemon, words};

/// Between two attempts to open a stream.
const AGAIN_AFTER: Duration = Duration::from_millis(500);

/// What is followed: samples that say when they were sent.
pub trait Sample: Send + Sync + 'static {
    /// By the daemon's wall clock.
    fn sent(&self) -> Option<&Timestamp>;
}

impl Sample for ForceSample {
    fn sent(&self) -> Option<&Timestamp> {
        self.sent.as_ref()
    }
}

impl Sample for TaxelSample {
    fn sent(&self) -> Option<&Timestamp> {
        self.sent.as_ref()
    }
}

/// A message and when it came.
#[derive(Debug)]
pub struct Received<T> {
    /// The message.
    pub sample: T,
    /// One more with each message, from 1.
    pub number: u64,
    at: Moment,
    delayed: Duration,
}

impl<T> Received<T> {
    /// How long ago it was sent, rather too long than too short: since it came, and how long it was on its way.
    pub fn waited(&self) -> Duration {
        self.at.elapsed().saturating_add(self.delayed)
    }
}

/// What a reader finds.
#[derive(Debug)]
pub struct Newest<T> {
    /// The newest message; it stays when the stream ends, and grows old.
    pub received: Option<Arc<Received<T>>>,
    /// Why the stream does not run; `None` while it runs.
    pub lost: Option<String>,
}

impl<T> Newest<T> {
    /// Before the first message.
    pub fn nothing() -> Self {
        Self { received: None, lost: Some("not connected yet".to_owned()) }
    }
}

/// Follows the force of a patch for ever.
pub async fn force(daemon: Daemon, patch: String, rate_hz: Option<f64>, newest: watch::Sender<Newest<ForceSample>>) {
    loop {
        let request = StreamForceRequest { patch: patch.clone(), rate_hz };
        let stream = daemon.force().stream_force(request).await;
        take(stream.map(tonic::Response::into_inner), &patch, &newest).await;
    }
}

/// Follows the taxels of a patch for ever.
pub async fn taxels(daemon: Daemon, patch: String, rate_hz: f64, newest: watch::Sender<Newest<TaxelSample>>) {
    loop {
        let request = StreamTaxelsRequest { patch: patch.clone(), rate_hz: Some(rate_hz) };
        let stream = daemon.skin().stream_taxels(request).await;
        take(stream.map(tonic::Response::into_inner), &patch, &newest).await;
    }
}

/// Takes a stream to its end, tells why it ended, and waits a little.
async fn take<T: Sample>(stream: Result<Streaming<T>, Status>, patch: &str, newest: &watch::Sender<Newest<T>>) {
    let end = match stream {
        Ok(stream) => read(stream, newest).await,
        Err(status) => words(&status),
    };
    if newest.borrow().lost.as_ref() != Some(&end) {
        tracing::warn!(patch, "no stream from the daemon: {end}");
    }
    newest.send_modify(|newest| newest.lost = Some(end));
    tokio::time::sleep(AGAIN_AFTER).await;
}

async fn read<T: Sample>(mut stream: Streaming<T>, newest: &watch::Sender<Newest<T>>) -> String {
    loop {
        let sample = match stream.message().await {
            Ok(Some(sample)) => sample,
            Ok(None) => return "the daemon ended the stream".to_owned(),
            Err(status) => return words(&status),
        };
        let at = Moment::now();
        let delayed = on_the_way(sample.sent(), SystemTime::now());
        newest.send_modify(|newest| {
            if newest.lost.take().is_some() {
                tracing::info!("a stream from the daemon runs");
            }
            let number = newest.received.as_ref().map_or(0, |before| before.number) + 1;
            newest.received = Some(Arc::new(Received { sample, number, at, delayed }));
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_have_been_on_its_way_for_so_long_has_waited_for_ever() {
        let of = |delayed| Received { sample: (), number: 1, at: Moment::now(), delayed };
        assert_eq!(of(Duration::MAX).waited(), Duration::MAX);
        assert!(of(Duration::ZERO).waited() < Duration::from_secs(3_600));
    }
}
