//! The two ends between the services and the engine's task: commands go one way, snapshots the other.

use std::sync::Arc;
use std::time::Duration;
use taxel_engine::calibration::SessionView;
use taxel_engine::command::{Command, Reply};
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::Plan;
use taxel_engine::snapshot::{Catalogue, Health, PatchSnapshot};
use taxel_skin::Time;
use tokio::sync::{mpsc, oneshot, watch};
use tokio_util::sync::CancellationToken;

use crate::clock::{Clock, Clocks};
use crate::freshness::{self, Freshness};
use crate::heartbeat::Heartbeat;

/// Commands that may wait for the engine's task. Commands come from people and the engine takes one in microseconds, so
/// more than a few waiting means that the task hangs; then it is better to refuse than to queue.
pub const COMMANDS_WAITING_MAX: usize = 16;

/// A command on its way to the engine.
#[derive(Debug)]
pub struct Request {
    /// What to do.
    pub command: Command,
    /// Where the answer goes. Dropped without an answer, the caller is told that the engine has stopped; nobody may be
    /// listening any more, which changes nothing about the command.
    pub reply: oneshot::Sender<Reply>,
}

/// How model sets become files and come back.
#[derive(Clone, Copy, Debug)]
pub struct ModelCodec {
    /// The text of MODELS.json, or what of the set cannot be written.
    pub to_json: fn(&ModelSet) -> Result<String, String>,
    /// The set that such a text describes, or where it is wrong, what was found and what was expected.
    pub from_json: fn(&str) -> Result<ModelSet, String>,
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
    pub(crate) codec: ModelCodec,
    pub(crate) shutdown: CancellationToken,
}

/// What comes from one patch.
#[derive(Clone, Debug)]
pub(crate) struct PatchFeed {
    pub(crate) snapshot: watch::Receiver<Arc<PatchSnapshot>>,
    pub(crate) session: watch::Receiver<Option<Arc<SessionView>>>,
}

/// The engine's end: publishes snapshots, never waits. When it is dropped every stream ends with UNAVAILABLE.
pub struct Publisher {
    heartbeat: Arc<Heartbeat>,
    snapshots: Vec<watch::Sender<Arc<PatchSnapshot>>>,
    sessions: Vec<watch::Sender<Option<Arc<SessionView>>>>,
    health: watch::Sender<Arc<Health>>,
    catalogue: watch::Sender<Arc<Catalogue>>,
}

/// Makes both ends for the patches of `plan`. Until the first publication readers see empty snapshots, which say so.
///
/// `shutdown` ends every stream and the server; the caller cancels it.
#[must_use]
pub fn channel(
    plan: Arc<Plan>,
    clocks: Clocks,
    codec: ModelCodec,
    shutdown: CancellationToken,
) -> (Handle, Publisher, mpsc::Receiver<Request>) {
    let Clocks { run: clock, process } = clocks;
    let heartbeat = Arc::new(Heartbeat::new(process));
    let (commands, requests) = mpsc::channel(COMMANDS_WAITING_MAX);
    let (health, health_seen) = watch::channel(Arc::default());
    let (catalogue, catalogue_seen) = watch::channel(Arc::default());
    let beats = Arc::clone(&heartbeat);
    let mut publisher = Publisher { heartbeat: beats, snapshots: Vec::new(), sessions: Vec::new(), health, catalogue };
    let mut patches = Vec::new();
    for _ in &plan.patches {
        let (to_snapshot, snapshot) = watch::channel(Arc::default());
        let (to_session, session) = watch::channel(None);
        publisher.snapshots.push(to_snapshot);
        publisher.sessions.push(to_session);
        patches.push(PatchFeed { snapshot, session });
    }
    let patches = patches.into();
    let (health, catalogue) = (health_seen, catalogue_seen);
    (Handle { commands, patches, health, catalogue, plan, clock, heartbeat, codec, shutdown }, publisher, requests)
}

impl Publisher {
    /// The engine's task has its turn now; due at least every [`BEAT_EVERY`](crate::BEAT_EVERY). Gives for how long the
    /// task had none if that was longer than [`STALLED_AFTER`](crate::STALLED_AFTER), for which readers were told that
    /// the engine is stalled.
    pub fn beat(&self) -> Option<Duration> {
        let gap = self.heartbeat.beat()?;
        tracing::info!("the engine runs again: it had not for {:.2} s", gap.as_secs_f64());
        Some(gap)
    }

    /// New live state of the patch at this position of the plan.
    pub fn patch(&self, position: usize, snapshot: Arc<PatchSnapshot>) {
        if let Some(sender) = self.snapshots.get(position) {
            sender.send_replace(snapshot);
        }
    }

    /// The session of the patch at this position of the plan changed.
    pub fn session(&self, position: usize, view: Arc<SessionView>) {
        if let Some(sender) = self.sessions.get(position) {
            sender.send_replace(Some(view));
        }
    }

    /// The patch at this position of the plan has no session any more: it was deleted.
    pub fn session_gone(&self, position: usize) {
        if let Some(sender) = self.sessions.get(position) {
            sender.send_replace(None);
        }
    }

    /// Buses, boards or modules changed.
    pub fn health(&self, health: Arc<Health>) {
        self.health.send_replace(health);
    }

    /// Sessions or model sets changed.
    pub fn catalogue(&self, catalogue: Arc<Catalogue>) {
        self.catalogue.send_replace(catalogue);
    }
}

impl Handle {
    /// The newest state of the patch at this position of the plan, as the engine published it.
    #[must_use]
    pub fn newest(&self, patch: usize) -> Option<Arc<PatchSnapshot>> {
        self.patches.get(patch).map(|feed| Arc::clone(&feed.snapshot.borrow()))
    }

    /// Whether this snapshot of the patch at this position of the plan may be believed when it is sent now.
    pub(crate) fn freshness(&self, patch: usize, snapshot: &PatchSnapshot) -> Freshness {
        self.freshness_at((self.clock)(), patch, snapshot)
    }

    /// The same at a moment on the run's clock that was just read.
    pub(crate) fn freshness_at(&self, now: Time, patch: usize, snapshot: &PatchSnapshot) -> Freshness {
        let newest = snapshot.seen.then_some(snapshot.time);
        freshness::judge(newest, self.stale_after(patch), now, self.heartbeat.stalled_for())
    }

    /// Whether there is an engine's task at the other end, running or not.
    pub(crate) fn is_connected(&self) -> bool {
        self.health.has_changed().is_ok()
    }

    /// The age up to which a value of the patch at this position of the plan may be believed.
    pub(crate) fn stale_after(&self, patch: usize) -> Duration {
        self.plan.patches[patch].live.stale_after
    }
}

impl std::fmt::Debug for Publisher {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Publisher").field("patches", &self.snapshots.len()).finish_non_exhaustive()
    }
}

impl std::fmt::Debug for Handle {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Handle").field("patches", &self.patches.len()).finish_non_exhaustive()
    }
}
