//! `ForceService`, and how a subscriber of any kind gets values: pulled, newest first, with what it missed.
//!
//! A value is taken from the engine's `watch` only when HTTP/2 asks for a message, so nothing queues here and the newest
//! value always wins. hyper asks for one before it knows that there is room (since 1.10): one message may wait there, and
//! what waits in HTTP/2 windows beyond is the client's; sequence and time in every message let it see that. Whether a value
//! may still be used is judged at that moment, too, and every few milliseconds while none comes. A reader that takes
//! nothing for too long is ended by the watch over connections.

use futures_util::stream::{self, Stream};
use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;
use taxel_engine::plan::PatchPlan;
use taxel_engine::snapshot::PatchSnapshot;
use taxel_proto::refusal::Refusal;
use taxel_proto::v1;
use taxel_proto::v1::force_service_server::ForceService;
use taxel_ticks::Ticks;
use tokio::sync::watch;
use tokio_util::sync::WaitForCancellationFutureOwned;
use tonic::{Request, Response, Status};

use crate::convert::{self, Sending};
use crate::freshness::Freshness;
use crate::handle::Handle;
use crate::service::{Reply, Service};
use crate::status::{SHUTTING_DOWN, STOPPED, invalid, no_timer, unavailable};

/// A stream of messages that ends with a status.
pub(crate) type MessageStream<M> = Pin<Box<dyn Stream<Item = Result<M, Status>> + Send>>;

/// Rates that a controller may ask for, in Hz.
const RATE_RANGE_HZ: std::ops::RangeInclusive<f64> = 1.0..=1_000.0;

/// While no value comes it is judged so often whether the last one is still what it was: a stream without a rate would be
/// silent otherwise, and a silent stream looks healthy. By so much at most its reader is told too late.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Makes the message of a snapshot: patch, snapshot, circumstances.
pub(crate) type Encode<M> = fn(&PatchPlan, &PatchSnapshot, Sending) -> M;

#[tonic::async_trait]
impl ForceService for Service {
    async fn get_force(&self, request: Request<v1::PatchRequest>) -> Reply<v1::ForceSample> {
        let patch = self.patch(&request.get_ref().patch)?;
        let snapshot = self.snapshot(patch);
        let sending = self.handle.sending(patch, &snapshot, 0);
        Ok(Response::new(convert::force(self.plan(patch), &snapshot, sending, true)))
    }

    type StreamForceStream = MessageStream<v1::ForceSample>;

    async fn stream_force(&self, request: Request<v1::StreamRequest>) -> Reply<Self::StreamForceStream> {
        let request = request.into_inner();
        let patch = self.patch(&request.patch)?;
        let encode: Encode<_> = |plan, snapshot, sending| convert::force(plan, snapshot, sending, false);
        subscribe(self, patch, request.rate_hz, encode).map(Response::new)
    }
}

/// The states of one patch as they come, the newest first. The recording follows them by itself: it gets what a subscriber
/// gets, and needs neither a role nor a place among the streams.
pub struct PatchFollower {
    handle: Handle,
    patch: usize,
    snapshots: watch::Receiver<Arc<PatchSnapshot>>,
    /// Number of the state that was taken last, and whether it was fresh then.
    last: Option<(u64, Freshness)>,
}

impl PatchFollower {
    /// Follows the patch at this position of the plan; `None` if there is none.
    #[must_use]
    pub fn new(handle: &Handle, patch: usize) -> Option<Self> {
        let snapshots = handle.patches.get(patch)?.snapshot.clone();
        Some(Self { handle: handle.clone(), patch, snapshots, last: None })
    }

    /// The force of the next state, and its taxels where they are wanted. `None` when the engine has stopped.
    pub async fn next(&mut self, taxels: bool) -> Option<(v1::ForceSample, Option<v1::TaxelSample>)> {
        loop {
            self.due().await.ok()?;
            if let Some((snapshot, sending)) = self.take(false) {
                let plan = &self.handle.plan.patches[self.patch];
                let readings = taxels.then(|| convert::taxels(plan, &snapshot, sending));
                return Some((convert::force(plan, &snapshot, sending, false), readings));
            }
        }
    }

    /// Waits for a new state, or until the last one has to be judged again.
    async fn due(&mut self) -> Result<(), Refusal> {
        let changed = tokio::time::timeout(LOOK_EVERY, self.snapshots.changed()).await;
        changed.unwrap_or(Ok(())).map_err(|_| unavailable(STOPPED))
    }

    /// The newest state and how it goes out; unless it is `held`, only if the last one did not say all that.
    fn take(&mut self, held: bool) -> Option<(Arc<PatchSnapshot>, Sending)> {
        let snapshot = Arc::clone(&self.snapshots.borrow_and_update());
        let (sequence, last) = (snapshot.sequence, self.last);
        let skipped = last.map_or(0, |(last, _)| sequence.saturating_sub(last + 1));
        let sending = self.handle.sending(self.patch, &snapshot, skipped);
        if !held && last.is_some_and(|(last, was)| last == sequence && was.is_like(sending.freshness)) {
            return None;
        }
        self.last = Some((sequence, sending.freshness));
        Some((snapshot, sending))
    }
}

/// One subscriber of one patch.
struct Subscription<M> {
    states: PatchFollower,
    /// At a rate of the subscriber's own, at which the last value is held. Without one a message is due with each new value,
    /// and once more when it is too old to be used.
    ticks: Option<Ticks>,
    encode: Encode<M>,
    /// Registered once, not for every message.
    shutdown: Pin<Box<WaitForCancellationFutureOwned>>,
}

/// A subscription to `patch`: `rate_hz` absent gives each new value, else the last one is held.
pub(crate) fn subscribe<M: Send + 'static>(
    service: &Service,
    patch: usize,
    rate_hz: Option<f64>,
    encode: Encode<M>,
) -> Result<MessageStream<M>, Status> {
    let handle = &service.handle;
    let states =
        PatchFollower { handle: handle.clone(), patch, snapshots: handle.patches[patch].snapshot.clone(), last: None };
    let shutdown = Box::pin(handle.shutdown.clone().cancelled_owned());
    let subscription = Subscription { states, ticks: rate_hz.map(ticks).transpose()?, encode, shutdown };
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
            if self.states.last.is_some() {
                self.due().await?;
            }
            if let Some((snapshot, sending)) = self.states.take(self.ticks.is_some()) {
                let plan = &self.states.handle.plan.patches[self.states.patch];
                return Ok((self.encode)(plan, &snapshot, sending));
            }
        }
    }

    /// Waits until a message may be due.
    async fn due(&mut self) -> Result<(), Refusal> {
        let Self { states, ticks, shutdown, .. } = self;
        let due = async {
            let Some(ticks) = ticks else { return states.due().await };
            ticks.tick().await.map_err(|error| no_timer(&error))?;
            states.snapshots.has_changed().map(drop).map_err(|_| unavailable(STOPPED))
        };
        tokio::select! {
            biased;
            () = shutdown => Err(unavailable(SHUTTING_DOWN)),
            due = due => due,
        }
    }
}
