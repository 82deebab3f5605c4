//! How a subscriber gets values: pulled, newest first, with what it missed.
//!
//! A value is taken from the engine's `watch` only when HTTP/2 asks for a message, so nothing queues here and the newest
//! value always wins. hyper asks for one before it knows that there is room (since 1.10): one message may wait there, and
//! what waits in HTTP/2 windows beyond is the client's; sequence and time in every message let it see that. Whether a value may still be believed is judged at that moment, too; the watchdog wakes subscribers when
//! that changes without a new value.

use futures_util::stream::{self, Stream};
use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;
use taxel_engine::plan::PatchPlan;
use taxel_engine::snapshot::PatchSnapshot;
use taxel_proto::refusal::Refusal;
use taxel_proto::v1::ErrorReason;
use taxel_ticks::Ticks;
use tokio::sync::watch;
use tokio::time::Instant;
use tokio_util::sync::WaitForCancellationFutureOwned;
use tonic::{Code, Status};

use crate::access::caller::Caller;
use crate::access::origin::PeerKey;
use crate::convert::Sending;
use crate::freshness::Freshness;
use crate::service::Service;
use crate::shares::Place;
use crate::status::{engine_stopped, invalid, no_timer, shutting_down};

/// A stream of messages that ends with a status.
pub(crate) type MessageStream<M> = Pin<Box<dyn Stream<Item = Result<M, Status>> + Send>>;

/// Rates that a controller may ask for, in Hz.
const RATE_RANGE_HZ: std::ops::RangeInclusive<f64> = 1.0..=1_000.0;

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

/// When a message is due.
enum Pace {
    /// At a rate of the subscriber's own; the last value is held.
    Ticks(Ticks),
    /// With each new value, and once more when it is too old to be believed.
    Turns(watch::Receiver<()>),
}

/// One subscriber of one patch.
struct Subscription<M> {
    service: Service,
    patch: usize,
    snapshots: watch::Receiver<Arc<PatchSnapshot>>,
    pace: Pace,
    encode: Encode<M>,
    /// Registered once, not for every message.
    shutdown: Pin<Box<WaitForCancellationFutureOwned>>,
    unread_limit: Duration,
    last: Option<Told>,
    ended: bool,
    /// Whose it is.
    peer: PeerKey,
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
    let pace = match rate_hz {
        Some(rate_hz) => Pace::Ticks(ticks(rate_hz)?),
        None => Pace::Turns(service.turns.join(patch)),
    };
    let subscription = Subscription {
        patch,
        snapshots: service.handle.patches[patch].snapshot.clone(),
        pace,
        encode,
        shutdown: Box::pin(service.handle.shutdown.clone().cancelled_owned()),
        unread_limit: service.limits.unread,
        last: None,
        ended: false,
        _place: service.stream_place(caller)?,
        peer: caller.key(),
        service: service.clone(),
    };
    Ok(Box::pin(stream::unfold(subscription, |mut subscription| async {
        let item = subscription.next().await?;
        subscription.ended = item.is_err();
        Some((item, subscription))
    })))
}

/// Ticks of this rate. Those of equal rates come together, so that one wake-up of the service and one write a connection
/// do for all of them.
fn ticks(rate_hz: f64) -> Result<Ticks, Status> {
    if !RATE_RANGE_HZ.contains(&rate_hz) {
        let (low, high) = (RATE_RANGE_HZ.start(), RATE_RANGE_HZ.end());
        return Err(invalid("rate_hz", format_args!("{rate_hz} is not in {low} to {high}")));
    }
    Ticks::every(Duration::from_secs_f64(1.0 / rate_hz)).map_err(|error| no_timer(&error))
}

/// Waits until a message is due. Gives how long it has been due if that is known, which is long only when the reader made
/// no room for it.
async fn due(
    first: bool,
    pace: &mut Pace,
    snapshots: &watch::Receiver<Arc<PatchSnapshot>>,
) -> Result<Option<Duration>, Status> {
    match pace {
        _ if first => Ok(None), // at once
        Pace::Ticks(ticks) => {
            let tick = ticks.tick().await.map_err(|error| no_timer(&error))?;
            snapshots.has_changed().map_err(|_| engine_stopped())?;
            Ok(Some(tick.late))
        }
        Pace::Turns(turn) => {
            turn.changed().await.map_err(|_| engine_stopped())?;
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
                unread = due(self.last.is_none(), &mut self.pace, &self.snapshots) => unread,
            };
            if let Some(message) = waited.and_then(|unread| self.take(unread)).transpose() {
                return Some(message);
            }
        }
    }

    /// The message of the newest value; nothing if the reader was told all that it says.
    fn take(&mut self, due_for: Option<Duration>) -> Result<Option<M>, Status> {
        let snapshot = Arc::clone(&self.snapshots.borrow());
        let skipped = self.last.map_or(0, |last| snapshot.sequence.saturating_sub(last.sequence + 1));
        let unread = due_for.unwrap_or_else(|| self.unread(skipped));
        let waited = |unread: Duration| unread - self.service.handle.heartbeat.stalled_within(unread);
        if unread > self.unread_limit && waited(unread) > self.unread_limit {
            let (unread, limit) = (unread.as_secs_f64(), self.unread_limit.as_secs_f64());
            let text = format!("a value was left unread for {unread:.1} s, the limit is {limit} s; subscribe again");
            let patch = self.service.plan(self.patch).patch.name();
            self.service
                .refusals
                .tell(("cut off", &self.peer), || format!("{}: subscriber to {patch} cut off: {text}", self.peer));
            return Err(Refusal::new(Code::Aborted, ErrorReason::ReaderTooSlow, text).into());
        }
        let sending = self.service.sending(self.patch, &snapshot, skipped);
        // Also where it is not sent: a turn without a new value is there to have all in the processor's caches for the next.
        let message = std::hint::black_box((self.encode)(self.service.plan(self.patch), &snapshot, sending));
        let (sequence, freshness) = (snapshot.sequence, sending.freshness);
        let same = |last: Told| last.sequence == sequence && last.freshness.is_like(freshness);
        if matches!(self.pace, Pace::Turns(_)) && self.last.is_some_and(same) {
            return Ok(None);
        }
        self.last = Some(Told { sequence, freshness, taken: Instant::now() });
        Ok(Some(message))
    }

    /// How long the oldest of `skipped` values and the present one has waited, when they came evenly since the last
    /// message was taken. Exact times would cost the engine a log of them; this is right for boards that send
    /// periodically, and 0 for a reader that skips nothing.
    fn unread(&self, skipped: u64) -> Duration {
        let since_last = self.last.map_or(Duration::ZERO, |last| last.taken.elapsed());
        since_last.mul_f64(skipped as f64 / (skipped as f64 + 1.0))
    }
}
