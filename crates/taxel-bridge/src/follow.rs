//! Follows streams of the daemon and keeps the newest message; a stream that ends is opened again.
//!
//! Readers take the newest from a `watch` channel, so that none of them holds up the stream or another reader: who is
//! slow misses samples, and sees by `Received::number` how many.

use std::sync::Arc;
use std::time::Duration;

use taxel_client::{DaemonClock, Moment};
use taxel_proto::v1::{ForceSample, GetForceRequest, StreamForceRequest, StreamTaxelsRequest, TaxelSample};
use tokio::sync::watch;
use tonic::{Status, Streaming};

use crate::daemon::{Daemon, words};

/// Between two attempts to open a stream.
const AGAIN_AFTER: Duration = Duration::from_millis(500);

/// How often the daemon's clock is looked at.
const ASK_EVERY: Duration = Duration::from_secs(10);
/// An answer that takes longer says little of the clock.
const ANSWER_WITHIN: Duration = Duration::from_secs(2);

/// What is followed: samples that say when they were sent.
pub trait Sample: Send + Sync + 'static {
    /// The daemon's own time of sending, in s; `None` if the sample has no time.
    fn sent_s(&self) -> Option<f64>;
}

impl Sample for ForceSample {
    fn sent_s(&self) -> Option<f64> {
        Some(self.monotonic_ns? as f64 * 1e-9 + self.age_s?)
    }
}

impl Sample for TaxelSample {
    fn sent_s(&self) -> Option<f64> {
        Some(self.monotonic_ns? as f64 * 1e-9 + self.age_s?)
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
        let asked = Asked::first(&daemon, &patch).await;
        let stream = daemon.force().stream_force(request).await;
        take(stream.map(tonic::Response::into_inner), asked, &newest).await;
    }
}

/// Follows the taxels of a patch for ever.
pub async fn taxels(daemon: Daemon, patch: String, rate_hz: f64, newest: watch::Sender<Newest<TaxelSample>>) {
    loop {
        let request = StreamTaxelsRequest { patch: patch.clone(), rate_hz: Some(rate_hz) };
        let asked = Asked::first(&daemon, &patch).await;
        let stream = daemon.skin().stream_taxels(request).await;
        take(stream.map(tonic::Response::into_inner), asked, &newest).await;
    }
}

/// The daemon's clock, asked for beside a stream.
struct Asked<'a> {
    daemon: &'a Daemon,
    patch: &'a str,
    clock: DaemonClock,
    last: Moment,
}

impl<'a> Asked<'a> {
    /// Before a stream begins, so that a first message which waited on its way is known as old. A daemon that does not
    /// answer will not stream either, which tells more.
    async fn first(daemon: &'a Daemon, patch: &'a str) -> Self {
        let mut asked = Self { daemon, patch, clock: DaemonClock::default(), last: Moment::now() };
        let _ = asked.ask().await;
        asked
    }

    /// How long a message was on its way that came at `at`; asks the daemon first if that is due.
    async fn delay(&mut self, at: Moment, sent_s: Option<f64>) -> Result<Duration, Status> {
        // The first frame that the daemon ever received shows its clock only now.
        let unknown = !self.clock.is_known() && sent_s.is_some();
        if unknown || self.last.elapsed() > ASK_EVERY {
            self.ask().await?;
        }
        Ok(self.clock.delay(at, sent_s))
    }

    async fn ask(&mut self) -> Result<(), Status> {
        self.last = Moment::now();
        let mut force = self.daemon.force();
        let question = force.get_force(GetForceRequest { patch: self.patch.to_owned() });
        let late = |_| Status::deadline_exceeded(format!("no answer within {} s", ANSWER_WITHIN.as_secs()));
        let answer = tokio::time::timeout(ANSWER_WITHIN, question).await.map_err(late)??;
        self.clock.asked(self.last, answer.get_ref().sent_s());
        Ok(())
    }
}

/// Takes a stream to its end, tells why it ended, and waits a little.
async fn take<T: Sample>(stream: Result<Streaming<T>, Status>, asked: Asked<'_>, newest: &watch::Sender<Newest<T>>) {
    let patch = asked.patch;
    let end = match stream {
        Ok(stream) => read(stream, asked, newest).await,
        Err(status) => words(&status),
    };
    if newest.borrow().lost.as_ref() != Some(&end) {
        tracing::warn!(patch, "no stream from the daemon: {end}");
    }
    newest.send_modify(|newest| newest.lost = Some(end));
    tokio::time::sleep(AGAIN_AFTER).await;
}

async fn read<T: Sample>(mut stream: Streaming<T>, mut asked: Asked<'_>, newest: &watch::Sender<Newest<T>>) -> String {
    loop {
        let sample = match stream.message().await {
            Ok(Some(sample)) => sample,
            Ok(None) => return "the daemon ended the stream".to_owned(),
            Err(status) => return words(&status),
        };
        let at = Moment::now();
        let delayed = match asked.delay(at, sample.sent_s()).await {
            Ok(delayed) => delayed,
            Err(status) => return words(&status),
        };
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
