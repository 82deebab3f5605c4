//! How a subscriber gets values: pulled, newest first, with what it missed.
//!
//! A value is taken from the engine's `watch` only when HTTP/2 has room for a message, so nothing queues here and the
//! newest value always wins. What waits in HTTP/2 windows beyond is the client's; sequence and age in every message let
//! it see that. Whether a value may still be believed is judged at that moment, too; the watchdog wakes subscribers when
//! that changes without a new value.

use futures_util::stream::{self, Stream};
use std::pin::Pin;
use std::sync::{Arc, LazyLock};
use std::time::Duration;
use taxel_engine::plan::PatchPlan;
use taxel_engine::snapshot::PatchSnapshot;
use taxel_proto::refusal::Refusal;
use taxel_proto::v1::ErrorReason;
use tokio::sync::watch;
use tokio::time::{Instant, Interval, MissedTickBehavior};
use tokio_util::sync::WaitForCancellationFutureOwned;
use tonic::{Code, Status};

use crate::access::caller::Caller;
use crate::convert::Sending;
use crate::freshness::Freshness;
use crate::service::Service;
use crate::shares::Place;
use crate::status::{engine_stopped, invalid, shutting_down};

/// A stream of messages that ends with a status.
pub(crate) type MessageStream<M> = Pin<Box<dyn Stream<Item = Result<M, Status>> + Send>>;

/// Rates that a controller may ask for, in Hz.
const RATE_RANGE_HZ: std::ops::RangeInclusive<f64> = 1.0..=1_000.0;

/// Fixed rates tick at multiples of their period from here. So equal rates tick together, and one wake-up of the service
/// and one write a connection do for all of them.
static GRID: LazyLock<Instant> = LazyLock::new(Instant::now);

/// Makes the message of a snapshot: patch, snapshot, circumstances.
pub(crate) type Encode<M> = fn(&PatchPlan, &PatchSnapshot, Sending) -> M;

/// What a subscriber has been told last.
#[derive(Clone, Copy)]
struct Told {
    sequence: u64,
    freshness: Freshness,
    /// When the reader took it.
    taken: Instant,
}

/// One subscriber of one patch.
struct Subscription<M> {
    service: Service,
    patch: usize,
    snapshots: watch::Receiver<Arc<PatchSnapshot>>,
    /// `None`: each value as it comes, and once more when it is too old to be believed.
    ticks: Option<Interval>,
    encode: Encode<M>,
    /// Registered once, not for every message.
    shutdown: Pin<Box<WaitForCancellationFutureOwned>>,
    unread_limit: Duration,
    last: Option<Told>,
    ended: bool,
    /// Free again when the subscriber is gone.
    _place: Place,
}

/// A subscription to `patch`: `rate_hz` absent gives each new value, else the last one is held.
pub(crate) fn subscribe<M: Send + 'static>(
    service: &Service,
    caller: &Caller,
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
        shutdown: Box::pin(service.handle.shutdown.clone().cancelled_owned()),
        unread_limit: service.limits.unread,
        last: None,
        ended: false,
        _place: service.stream_place(caller)?,
        service: service.clone(),
    };
    Ok(Box::pin(stream::unfold(subscription, |mut subscription| async {
        let item = subscription.next().await?;
        subscription.ended = item.is_err();
        Some((item, subscription))
    })))
}

/// Ticks at multiples of the period after `origin`, from the next one on.
fn ticks(rate_hz: f64, origin: Instant) -> Result<Interval, Status> {
    if !RATE_RANGE_HZ.contains(&rate_hz) {
        let (low, high) = (RATE_RANGE_HZ.start(), RATE_RANGE_HZ.end());
        return Err(invalid("rate_hz", format_args!("{rate_hz} is not in {low} to {high}")));
    }
    let period = Duration::from_secs_f64(1.0 / rate_hz);
    let now = Instant::now();
    let since_last_ns = (now - origin).as_nanos() % period.as_nanos(); // less than a second
    let next = now + period - Duration::from_nanos(since_last_ns as u64);
    let mut ticks = tokio::time::interval_at(next, period);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
    Ok(ticks)
}

/// Waits until a message is due. Gives how long it has been due if that is known, which is long only when the reader made
/// no room for it.
async fn due(
    first: bool,
    ticks: Option<&mut Interval>,
    snapshots: &mut watch::Receiver<Arc<PatchSnapshot>>,
) -> Result<Option<Duration>, Status> {
    match ticks {
        _ if first => Ok(None), // at once
        Some(ticks) => {
            let due = ticks.tick().await;
            snapshots.has_changed().map_err(|_| engine_stopped())?;
            Ok(Some(due.elapsed()))
        }
        None => {
            snapshots.changed().await.map_err(|_| engine_stopped())?;
            Ok(None)
        }
    }
}

impl<M> Subscription<M> {
    async fn next(&mut self) -> Option<Result<M, Status>> {
        if self.ended {
            return None;
        }
        loop {
            let waited = tokio::select! {
                biased;
                () = &mut self.shutdown => Err(shutting_down()),
                unread = due(self.last.is_none(), self.ticks.as_mut(), &mut self.snapshots) => unread,
            };
            if let Some(message) = waited.and_then(|unread| self.take(unread)).transpose() {
                return Some(message);
            }
        }
    }

    /// The message of the newest value; nothing if the reader was told all that it says.
    fn take(&mut self, due_for: Option<Duration>) -> Result<Option<M>, Status> {
        let snapshot = Arc::clone(&self.snapshots.borrow_and_update());
        let skipped = self.last.map_or(0, |last| snapshot.sequence.saturating_sub(last.sequence + 1));
        let unread = due_for.unwrap_or_else(|| self.unread(skipped));
        if unread > self.unread_limit {
            let (unread, limit) = (unread.as_secs_f64(), self.unread_limit.as_secs_f64());
            let text = format!("a value was left unread for {unread:.1} s, the limit is {limit} s; subscribe again");
            tracing::warn!(patch = self.service.plan(self.patch).patch.name(), "subscriber cut off: {text}");
            return Err(Refusal::new(Code::Aborted, ErrorReason::ReaderTooSlow, text).into());
        }
        let sending = self.service.sending(self.patch, &snapshot, skipped);
        let (sequence, freshness) = (snapshot.sequence, sending.freshness);
        let same = |last: Told| last.sequence == sequence && last.freshness.is_like(freshness);
        if self.ticks.is_none() && self.last.is_some_and(same) {
            return Ok(None);
        }
        self.last = Some(Told { sequence, freshness, taken: Instant::now() });
        Ok(Some((self.encode)(self.service.plan(self.patch), &snapshot, sending)))
    }

    /// How long the oldest of `skipped` values and the present one has waited, when they came evenly since the last
    /// message was taken. Exact times would cost the engine a log of them; this is right for boards that send
    /// periodically, and 0 for a reader that skips nothing.
    fn unread(&self, skipped: u64) -> Duration {
        let since_last = self.last.map_or(Duration::ZERO, |last| last.taken.elapsed());
        since_last.mul_f64(skipped as f64 / (skipped as f64 + 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test(start_paused = true)]
    async fn a_rate_is_kept_although_the_timer_counts_whole_milliseconds() {
        let origin = Instant::now();
        for rate_hz in [1.0, 3.0, 50.0, 333.0, 700.0, 1_000.0] {
            tokio::time::advance(Duration::from_micros(12_345)).await;
            let mut ticks = ticks(rate_hz, origin).unwrap();
            let begun = ticks.tick().await;
            let count = 2.0 * rate_hz;
            for _ in 0..count as u32 {
                ticks.tick().await;
            }
            let late = begun.elapsed().as_secs_f64() - 2.0;
            assert!((-1e-6..2e-3).contains(&late), "{rate_hz} Hz: {count} ticks took {late} s more than 2 s");
        }
    }

    #[tokio::test(start_paused = true)]
    async fn equal_rates_tick_together_whenever_they_began() {
        let origin = Instant::now();
        // Not 1,000 Hz, where the timer's millisecond is a whole period.
        for rate_hz in [1.0, 3.0, 50.0, 100.0, 333.0] {
            let period = Duration::from_secs_f64(1.0 / rate_hz);
            let mut early = ticks(rate_hz, origin).unwrap();
            early.tick().await;
            tokio::time::advance(period.mul_f64(0.3)).await;
            let mut late = ticks(rate_hz, origin).unwrap();
            let (shared, first) = tokio::join!(early.tick(), late.tick());
            assert_eq!(shared, first, "{rate_hz} Hz");
            assert_eq!((shared - origin).as_nanos() % period.as_nanos(), 0, "{rate_hz} Hz: on the grid");
        }
    }
}
