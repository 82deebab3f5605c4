//! The two ends between the services and the engine's task: commands go one way, snapshots the other.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::Duration;
use taxel_engine::audit::Asked;
use taxel_engine::calibration::SessionView;
use taxel_engine::command::{Command, Reply};
use taxel_engine::events::Event;
use taxel_engine::plan::Plan;
use taxel_engine::snapshot::{Catalogue, GaugeReading, Health, PatchSnapshot};
use taxel_skin::Time;
use tokio::sync::{Semaphore, mpsc, oneshot, watch};
use tokio_util::sync::CancellationToken;

use crate::convert::Sending;
use crate::event_log::EventLog;
use crate::freshness::Freshness;

/// Commands that may wait for the engine's task. Commands come from people and the engine takes one in microseconds, so
/// more than a few waiting means that the task hangs; then it is better to refuse than to queue.
pub const COMMANDS_WAITING_MAX: usize = 16;

/// The first turn comes within milliseconds of the start.
const FIRST_TURN_LOOK: Duration = Duration::from_millis(1);

/// The run's clock, the same that stamps the frames. It never steps. Handed in, so that tests give time as they like.
pub type Clock = Arc<dyn Fn() -> Time + Send + Sync>;

/// A command on its way to the engine.
#[derive(Debug)]
pub struct Request {
    /// What to do.
    pub command: Command,
    /// Where the answer goes. Dropped without an answer, the caller is told that the engine has stopped; nobody may be
    /// listening any more, which changes nothing about the command.
    pub reply: oneshot::Sender<Reply>,
    /// For the audit log: who asks for what. Absent, nothing is written there.
    pub asked: Option<Box<Asked>>,
}

/// What every service holds: the newest snapshots, and the way to the engine. Cheap to clone.
#[derive(Clone)]
pub struct Handle {
    pub(crate) commands: mpsc::Sender<Request>,
    pub(crate) patches: Arc<[PatchFeed]>,
    pub(crate) health: watch::Receiver<Arc<Health>>,
    pub(crate) catalogue: watch::Receiver<Arc<Catalogue>>,
    pub(crate) plan: Arc<Plan>,
    pub(crate) clock: Clock,
    pub(crate) heartbeat: Arc<Heartbeat>,
    pub(crate) shutdown: CancellationToken,
    /// Held by the fit that runs: one fit takes up to 150 MB.
    pub(crate) fits: Arc<Semaphore>,
    pub(crate) events: watch::Receiver<EventLog>,
}

/// What comes from one patch.
#[derive(Clone, Debug)]
pub(crate) struct PatchFeed {
    pub(crate) snapshot: watch::Receiver<Arc<PatchSnapshot>>,
    pub(crate) session: watch::Receiver<Option<Arc<SessionView>>>,
    pub(crate) gauge: watch::Receiver<Option<GaugeReading>>,
}

/// The engine's ends of a [`PatchFeed`].
struct PatchEnds {
    snapshot: watch::Sender<Arc<PatchSnapshot>>,
    session: watch::Sender<Option<Arc<SessionView>>>,
    gauge: watch::Sender<Option<GaugeReading>>,
}

/// The engine's end: publishes snapshots, never waits. When it is dropped every stream ends with UNAVAILABLE.
pub struct Publisher {
    heartbeat: Arc<Heartbeat>,
    patches: Vec<PatchEnds>,
    health: watch::Sender<Arc<Health>>,
    catalogue: watch::Sender<Arc<Catalogue>>,
    fits: Arc<Semaphore>,
    events: watch::Sender<EventLog>,
}

/// Makes both ends for the patches of `plan`. Until the first publication readers see empty snapshots, which say so.
///
/// `shutdown` ends every stream and the server; the caller cancels it.
#[must_use]
pub fn channel(
    plan: Arc<Plan>,
    clock: Clock,
    shutdown: CancellationToken,
) -> (Handle, Publisher, mpsc::Receiver<Request>) {
    let heartbeat = Arc::new(Heartbeat::new(Arc::clone(&clock)));
    let (commands, requests) = mpsc::channel(COMMANDS_WAITING_MAX);
    let (to_health, health) = watch::channel(Arc::default());
    let (to_catalogue, catalogue) = watch::channel(Arc::default());
    let (to_events, events) = watch::channel(EventLog::default());
    let fits = Arc::new(Semaphore::new(1));
    let patch = |_| {
        let (to_snapshot, snapshot) = watch::channel(Arc::default());
        let ((to_session, session), (to_gauge, gauge)) = (watch::channel(None), watch::channel(None));
        let ends = PatchEnds { snapshot: to_snapshot, session: to_session, gauge: to_gauge };
        (ends, PatchFeed { snapshot, session, gauge })
    };
    let (patches, feeds): (Vec<_>, Vec<_>) = plan.patches.iter().map(patch).unzip();
    let handle = Handle {
        commands,
        patches: feeds.into(),
        health,
        catalogue,
        plan,
        clock,
        heartbeat: Arc::clone(&heartbeat),
        shutdown,
        fits: Arc::clone(&fits),
        events,
    };
    let (health, catalogue, events) = (to_health, to_catalogue, to_events);
    let publisher = Publisher { heartbeat, patches, health, catalogue, fits, events };
    (handle, publisher, requests)
}

impl Publisher {
    /// What a fit has to hold meanwhile: the fits of sessions and those that clients ask for take turns.
    #[must_use]
    pub fn fits(&self) -> Arc<Semaphore> {
        Arc::clone(&self.fits)
    }

    /// The engine's task has its turn now; due at least every [`BEAT_EVERY`]. Gives for how long the
    /// task had none if that was longer than [`STALLED_AFTER`], for which readers were told that
    /// the engine is stalled.
    pub fn beat(&self) -> Option<Duration> {
        let gap = self.heartbeat.beat()?;
        tracing::info!("the engine runs again: it had not for {:.2} s", gap.as_secs_f64());
        Some(gap)
    }

    /// New live state of the patch at this position of the plan.
    pub fn patch(&self, position: usize, snapshot: Arc<PatchSnapshot>) {
        self.patches[position].snapshot.send_replace(snapshot);
    }

    /// The session of the patch at this position of the plan changed; `None`: it was deleted.
    pub fn session(&self, position: usize, view: Option<Arc<SessionView>>) {
        self.patches[position].session.send_replace(view);
    }

    /// What the gauge of the patch at this position of the plan reads now.
    pub fn gauge(&self, position: usize, reading: GaugeReading) {
        self.patches[position].gauge.send_replace(Some(reading));
    }

    /// Buses, boards or modules changed.
    pub fn health(&self, health: Arc<Health>) {
        self.health.send_replace(health);
    }

    /// Something happened that an operator may ask for later.
    pub fn event(&self, event: Event) {
        self.events.send_modify(|log| log.push(event));
    }

    /// Sessions or model sets changed.
    pub fn catalogue(&self, catalogue: Arc<Catalogue>) {
        self.catalogue.send_replace(catalogue);
    }
}

impl Handle {
    /// Gives the engine a command from within the process, as the services do for their clients, and waits for its answer.
    /// `None` if the engine has stopped.
    pub async fn ask(&self, command: Command) -> Option<Reply> {
        let (reply, answer) = oneshot::channel();
        self.commands.send(Request { command, reply, asked: None }).await.ok()?;
        answer.await.ok()
    }

    /// The newest state of the patch at this position of the plan, as the engine published it.
    #[must_use]
    pub fn newest(&self, patch: usize) -> Option<Arc<PatchSnapshot>> {
        self.patches.get(patch).map(|feed| Arc::clone(&feed.snapshot.borrow()))
    }

    /// The session of the patch at this position of the plan.
    #[must_use]
    pub fn session(&self, patch: usize) -> Option<Arc<SessionView>> {
        self.patches.get(patch)?.session.borrow().clone()
    }

    /// Sessions and model sets as the engine published them last.
    #[must_use]
    pub fn stored(&self) -> Arc<Catalogue> {
        Arc::clone(&self.catalogue.borrow())
    }

    /// The run's clock.
    #[must_use]
    pub fn now(&self) -> Time {
        (self.clock)()
    }

    /// Position of the patch of this name.
    #[must_use]
    pub fn position(&self, name: &str) -> Option<usize> {
        self.plan.patches.iter().position(|plan| plan.patch.name() == name)
    }

    /// How many patches there are.
    #[must_use]
    pub fn patches(&self) -> usize {
        self.patches.len()
    }

    /// For how long the engine has had no turn, if that is longer than it may be. An engine that is gone has none.
    #[must_use]
    pub fn stalled_for(&self) -> Option<Duration> {
        if self.is_connected() { self.heartbeat.stalled_for() } else { Some(self.heartbeat.silence()) }
    }

    /// Waits until the engine has had its first turn.
    pub async fn first_turn(&self) {
        while !self.heartbeat.has_begun() && !self.is_over() {
            tokio::time::sleep(FIRST_TURN_LOOK).await;
        }
    }

    /// Whether the shutdown has begun.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.shutdown.is_cancelled()
    }

    /// What sending this snapshot of the patch at this position of the plan now comes to, for a reader that did not get
    /// `skipped` values before it.
    pub(crate) fn sending(&self, patch: usize, snapshot: &PatchSnapshot, skipped: u64) -> Sending {
        let (now, limit) = (self.now(), self.plan.patches[patch].live.stale_after);
        let newest = snapshot.seen.then_some(snapshot.time);
        Sending { now, freshness: Freshness::of(newest, limit, now, self.stalled_for()), skipped }
    }

    /// Whether there is an engine's task at the other end, running or not.
    pub(crate) fn is_connected(&self) -> bool {
        self.health.has_changed().is_ok()
    }
}

/// The engine's task has its turn at least this often, also when nothing happens.
pub const BEAT_EVERY: Duration = Duration::from_millis(50);

/// An engine that had no turn for longer is stalled: what it published last may not be true any more. Two beats, so
/// that one late wake-up is no alarm.
pub const STALLED_AFTER: Duration = Duration::from_millis(100);

/// Before the first turn. Nothing can be published yet, so nothing can be wrong.
const NEVER: i64 = i64::MIN;

/// The time of the engine's last turn.
pub(crate) struct Heartbeat {
    clock: Clock,
    last_ns: AtomicI64,
}

impl Heartbeat {
    /// None yet.
    pub(crate) fn new(clock: Clock) -> Self {
        Self { clock, last_ns: AtomicI64::new(NEVER) }
    }

    /// The engine has its turn now. Gives for how long it had none, if it was stalled.
    pub(crate) fn beat(&self) -> Option<Duration> {
        let gap = self.stalled_for();
        self.last_ns.store((self.clock)().as_nanos(), Ordering::Relaxed);
        gap
    }

    /// For how long the engine has not run, if it is stalled.
    pub(crate) fn stalled_for(&self) -> Option<Duration> {
        Some(self.silence()).filter(|silence| *silence > STALLED_AFTER)
    }

    /// Whether there was a first turn.
    pub(crate) fn has_begun(&self) -> bool {
        self.last_ns.load(Ordering::Relaxed) != NEVER
    }

    /// How long ago the last turn was; nothing before the first.
    pub(crate) fn silence(&self) -> Duration {
        // Read before the clock: a beat in between would be taken for one of the future, which is no silence either.
        let last_ns = self.last_ns.load(Ordering::Relaxed);
        if last_ns == NEVER { Duration::ZERO } else { (self.clock)().since(Time::from_nanos(last_ns)) }
    }
}
