//! How a subscriber gets values: pulled, newest first, with what it missed.
//!
//! A value is taken from the engine's `watch` only when HTTP/2 asks for a message, so nothing queues here and the newest
//! value always wins. hyper asks for one before it knows that there is room (since 1.10): one message may wait there, and
//! what waits in HTTP/2 windows beyond is the client's; sequence and time in every message let it see that. Whether a value
//! may still be believed is judged at that moment, too; the watchdog wakes subscribers when that changes without a new
//! value. A reader that takes nothing for too long is ended by the watch over connections.

use futures_util::stream::{self, Stream};
use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;
use taxel_engine::plan::PatchPlan;
use taxel_engine::snapshot::PatchSnapshot;
use taxel_proto::refusal::Refusal;
use taxel_ticks::Ticks;
use tokio::sync::watch;
use tokio_util::sync::WaitForCancellationFutureOwned;
use tonic::Status;

use crate::convert::Sending;
use crate::freshness::Freshness;
use crate::service::Service;
use crate::status::{SHUTTING_DOWN, STOPPED, invalid, no_timer, unavailable};

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
}

/// One subscriber of one patch.
struct Subscription<M> {
    service: Service,
    patch: usize,
    snapshots: watch::Receiver<Arc<PatchSnapshot>>,
    /// At a rate of the subscriber's own, at which the last value is held. Without one a message is due with each new value,
    /// and once more when it is too old to be believed.
    ticks: Option<Ticks>,
    wake: watch::Receiver<()>,
    encode: Encode<M>,
    /// Registered once, not for every message.
    shutdown: Pin<Box<WaitForCancellationFutureOwned>>,
    last: Option<Told>,
}

/// A subscription to `patch`: `rate_hz` absent gives each new value, else the last one is held.
pub(crate) fn subscribe<M: Send + 'static>(
    service: &Service,
    patch: usize,
    rate_hz: Option<f64>,
    encode: Encode<M>,
) -> Result<MessageStream<M>, Status> {
    let subscription = Subscription {
        patch,
        snapshots: service.handle.patches[patch].snapshot.clone(),
        ticks: rate_hz.map(ticks).transpose()?,
        wake: service.wake.clone(),
        encode,
        shutdown: Box::pin(service.handle.shutdown.clone().cancelled_owned()),
        last: None,
        service: service.clone(),
    };
    // tonic asks for nothing after an error.
    Ok(Box::pin(stream::unfold(subscription, |mut subscription| async {
        let message = subscription.next().await.map_err(Status::from);
        Some((message, subscription))
    })))
}

/// Ticks of this rate. Those of equal rates come together, so that one wake-up of the service and one write a connection
/// do for all of them.
fn ticks(rate_hz: f64) -> Result<Ticks, Status> {
    if !RATE_RANGE_HZ.contains(&rate_hz) {
        let (low, high) = (RATE_RANGE_HZ.start(), RATE_RANGE_HZ.end());
        return Err(invalid("rate_hz", format_args!("{rate_hz} is not in {low} to {high}")));
    }
    Ok(Ticks::every(Duration::from_secs_f64(1.0 / rate_hz)).map_err(|error| no_timer(&error))?)
}

impl<M> Subscription<M> {
    async fn next(&mut self) -> Result<M, Refusal> {
        loop {
            if self.last.is_some() {
                self.due().await?;
            }
            if let Some(message) = self.take() {
                return Ok(message);
            }
        }
    }

    /// Waits until a message is due.
    async fn due(&mut self) -> Result<(), Refusal> {
        let (snapshots, wake) = (&mut self.snapshots, &mut self.wake);
        tokio::select! {
            biased;
            () = &mut self.shutdown => Err(unavailable(SHUTTING_DOWN)),
            tick = tick(self.ticks.as_mut()) => {
                tick.map_err(|error| no_timer(&error))?;
                snapshots.has_changed().map(drop).map_err(|_| unavailable(STOPPED))
            }
            changed = snapshots.changed(), if self.ticks.is_none() => changed.map_err(|_| unavailable(STOPPED)),
            Ok(()) = wake.changed(), if self.ticks.is_none() => Ok(()),
        }
    }

    /// The message of the newest value; nothing if the reader was told all that it says.
    fn take(&mut self) -> Option<M> {
        let snapshot = Arc::clone(&self.snapshots.borrow_and_update());
        let skipped = self.last.map_or(0, |last| snapshot.sequence.saturating_sub(last.sequence + 1));
        let sending = self.service.handle.sending(self.patch, &snapshot, skipped);
        let told = Told { sequence: snapshot.sequence, freshness: sending.freshness };
        let same = |last: Told| last.sequence == told.sequence && last.freshness.is_like(told.freshness);
        if self.ticks.is_none() && self.last.is_some_and(same) {
            return None;
        }
        self.last = Some(told);
        Some((self.encode)(self.service.plan(self.patch), &snapshot, sending))
    }
}

/// The next tick; never without ticks.
async fn tick(ticks: Option<&mut Ticks>) -> std::io::Result<()> {
    match ticks {
        Some(ticks) => ticks.tick().await,
        None => std::future::pending().await,
    }
}
