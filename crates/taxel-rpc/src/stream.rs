//! How a subscriber gets values: pulled, newest first, with what it missed.
//!
//! A value is taken from the engine's `watch` only when HTTP/2 has room for a message, so nothing queues here and the
//! newest value always wins. What waits in HTTP/2 windows beyond is the client's; sequence and age in every message let
//! it see that.

use futures_util::stream::{self, Stream};
use std::pin::Pin;
use std::sync::{Arc, LazyLock};
use std::time::Duration;
use taxel_engine::snapshot::PatchSnapshot;
use tokio::sync::{OwnedSemaphorePermit, watch};
use tokio::time::{Instant, Interval, MissedTickBehavior};
use tokio_util::sync::CancellationToken;
use tonic::Status;

use crate::convert::Sending;
use crate::handle::Clock;
use crate::service::Service;
use crate::status::{engine_stopped, invalid, shutting_down};

/// A stream of messages that ends with a status.
pub(crate) type MessageStream<M> = Pin<Box<dyn Stream<Item = Result<M, Status>> + Send>>;

/// Rates that a controller may ask for, in Hz.
const RATE_RANGE_HZ: std::ops::RangeInclusive<f64> = 1.0..=1_000.0;

/// Fixed rates tick at multiples of their period from here. So equal rates tick together, and one wake-up of the service
/// and one write a connection serve all of them.
static GRID: LazyLock<Instant> = LazyLock::new(Instant::now);

/// Makes the message of a snapshot: patch name, snapshot, circumstances.
pub(crate) type Encode<M> = fn(&str, &PatchSnapshot, Sending) -> M;

/// One subscriber of one patch.
struct Subscription<M> {
    service: Service,
    patch: usize,
    snapshots: watch::Receiver<Arc<PatchSnapshot>>,
    /// `None`: each value as it comes.
    ticks: Option<Interval>,
    encode: Encode<M>,
    clock: Clock,
    shutdown: CancellationToken,
    unread_limit: Duration,
    /// Sequence of the last message, and when the reader took it.
    last: Option<(u64, Instant)>,
    ended: bool,
    /// Free again when the subscriber is gone.
    _place: OwnedSemaphorePermit,
}

/// A subscription to `patch`: `rate_hz` absent gives each new value, else the last one is held.
pub(crate) fn subscribe<M: Send + 'static>(
    service: &Service,
    patch: usize,
    rate_hz: Option<f64>,
    encode: Encode<M>,
) -> Result<MessageStream<M>, Status> {
    let ticks = rate_hz.map(|rate_hz| ticks(rate_hz, *GRID)).transpose()?;
    let subscription = Subscription {
        patch,
        snapshots: service.handle.patches[patch].snapshot.clone(),
        ticks,
        encode,
        clock: Arc::clone(&service.handle.clock),
        shutdown: service.handle.shutdown.clone(),
        unread_limit: service.limits.unread,
        last: None,
        ended: false,
        _place: service.stream_place()?,
        service: service.clone(),
    };
    Ok(Box::pin(stream::unfold(subscription, |mut subscription| async {
        let item = subscription.next().await?;
        subscription.ended = item.is_err();
        Some((item, subscription))
    })))
}

/// Ticks at multiples of the period from `origin`; the next one first.
fn ticks(rate_hz: f64, origin: Instant) -> Result<Interval, Status> {
    if !RATE_RANGE_HZ.contains(&rate_hz) {
        let (low, high) = (RATE_RANGE_HZ.start(), RATE_RANGE_HZ.end());
        return Err(invalid("rate_hz", format_args!("{rate_hz} is not in {low} to {high}")));
    }
    let period = Duration::from_secs_f64(1.0 / rate_hz);
    let now = Instant::now();
    let since_last_ns = (now - origin).as_nanos() % period.as_nanos(); // less than the period, which is a second at most
    let next = now + period - Duration::from_nanos(since_last_ns as u64);
    let next = if std::env::var_os("L_NOGRID").is_some() { now + period } else { next };
    let mut ticks = tokio::time::interval_at(next, period);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
    Ok(ticks)
}

impl<M> Subscription<M> {
    async fn next(&mut self) -> Option<Result<M, Status>> {
        if self.ended {
            return None;
        }
        let shutdown = self.shutdown.clone();
        let waited = tokio::select! {
            biased;
            () = shutdown.cancelled() => Err(shutting_down()),
            unread = self.due() => unread,
        };
        Some(waited.and_then(|unread| self.take(unread)))
    }

    /// Waits until a message is due. Gives how long it has been due if that is known, which is long only when the
    /// reader made no room for it.
    async fn due(&mut self) -> Result<Option<Duration>, Status> {
        if self.last.is_none() {
            return Ok(None); // the first one goes out at once
        }
        if let Some(ticks) = &mut self.ticks {
            let due = ticks.tick().await;
            self.snapshots.has_changed().map_err(|_| engine_stopped())?;
            return Ok(Some(due.elapsed()));
        }
        self.snapshots.changed().await.map_err(|_| engine_stopped())?;
        Ok(None)
    }

    /// The message of the newest value.
    fn take(&mut self, due_for: Option<Duration>) -> Result<M, Status> {
        let snapshot = Arc::clone(&self.snapshots.borrow_and_update());
        let skipped = self.last.map_or(0, |(sequence, _)| snapshot.sequence.saturating_sub(sequence + 1));
        let unread = due_for.unwrap_or_else(|| self.unread(skipped));
        if unread > self.unread_limit {
            let (unread, limit) = (unread.as_secs_f64(), self.unread_limit.as_secs_f64());
            let text = format!("a value was left unread for {unread:.1} s, the limit is {limit} s; subscribe again");
            tracing::warn!(patch = self.service.plan(self.patch).patch.name(), "subscriber cut off: {text}");
            return Err(Status::aborted(text));
        }
        self.last = Some((snapshot.sequence, Instant::now()));
        let sending = Sending { now: (self.clock)(), skipped };
        Ok((self.encode)(self.service.plan(self.patch).patch.name(), &snapshot, sending))
    }

    /// How long the oldest of `skipped` values and the present one has waited, when they came evenly since the last
    /// message was taken. Exact times would cost the engine a log of them; this is right for boards that send
    /// periodically, and 0 for a reader that skips nothing.
    fn unread(&self, skipped: u64) -> Duration {
        let since_last = self.last.map_or(Duration::ZERO, |(_, taken)| taken.elapsed());
        since_last.mul_f64(skipped as f64 / (skipped as f64 + 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test(start_paused = true)]
    async fn a_rate_is_kept_although_the_timer_counts_whole_milliseconds() {
        for rate_hz in [1.0, 3.0, 50.0, 333.0, 700.0, 1_000.0] {
            let mut ticks = ticks(rate_hz).unwrap();
            let begun = ticks.tick().await;
            assert_eq!(begun.elapsed(), Duration::ZERO, "the first tick is at once");
            let count = 2.0 * rate_hz;
            for _ in 0..count as u32 {
                ticks.tick().await;
            }
            let late = begun.elapsed().as_secs_f64() - 2.0;
            assert!((-1e-6..2e-3).contains(&late), "{rate_hz} Hz: {count} ticks took {late} s more than 2 s");
        }
    }
}
