//! The two ends between the services and the engine's task: commands go one way, snapshots the other.

use std::sync::Arc;
use std::time::Duration;
use taxel_engine::audit::{Asked, AuditEntry};
use taxel_engine::calibration::{SessionSamples, SessionView};
use taxel_engine::command::{Command, Reply};
use taxel_engine::events::Event;
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::Plan;
use taxel_engine::snapshot::{Catalogue, Health, PatchSnapshot};
use taxel_proto::v1::RecordingHealth;
use taxel_skin::Time;
use tokio::sync::{Semaphore, mpsc, oneshot, watch};
use tokio_util::sync::CancellationToken;

use crate::clock::{Clock, Clocks};
use crate::codec::ModelCodec;
use crate::event_log::EventLog;
use crate::freshness::{self, Freshness};
use crate::heartbeat::Heartbeat;
use crate::push_line::PushLine;
use crate::stored_sets::{ModelSetSource, StoredSets};

/// Commands that may wait for the engine's task. Commands come from people and the engine takes one in microseconds, so
/// more than a few waiting means that the task hangs; then it is better to refuse than to queue.
pub const COMMANDS_WAITING_MAX: usize = 16;

/// The first turn comes within milliseconds of the start.
const FIRST_TURN_LOOK: Duration = Duration::from_millis(1);

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

/// Told entries of the audit log, or why they cannot be had.
pub type OnEntries = Box<dyn FnOnce(Result<Vec<AuditEntry>, String>) + Send>;

/// Reads the audit log: entries with numbers below the first argument, at most so many, newest first.
pub type AuditSource = Arc<dyn Fn(u64, u32, OnEntries) + Send + Sync>;

/// Where the samples of a stored session come from: called with its number and what to do with the answer. It must not
/// wait, and the answer may come from any thread.
pub type SamplesSource = Arc<dyn Fn(u64, OnSamples) + Send + Sync>;

/// What is done with the samples, or with the reason why there are none.
pub type OnSamples = Box<dyn FnOnce(Result<SessionSamples, String>) + Send>;
/// Whether the disk has room for what is kept for ever, or why not.
pub type Room = Arc<dyn Fn() -> Result<(), String> + Send + Sync>;

/// What the daemon lacks at present, in words; asked for each health.
pub type LacksSource = Arc<dyn Fn() -> Vec<String> + Send + Sync>;

/// What the recording is at; asked for each health.
pub type RecordingSource = Arc<dyn Fn() -> RecordingHealth + Send + Sync>;

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
    pub(crate) samples: Option<SamplesSource>,
    /// Without it only sets that are in the engine's memory can be had.
    pub(crate) stored_sets: Option<StoredSets>,
    /// Makes the id of a model set from its content.
    pub(crate) id_of: Option<fn(&ModelSet) -> String>,
    pub(crate) audit: Option<AuditSource>,
    pub(crate) room: Option<Room>,
    pub(crate) push: Option<PushLine>,
    pub(crate) recording: Option<RecordingSource>,
    /// What the daemon could not have when it started, in words.
    lacks: Arc<[String]>,
    /// What it cannot have at present.
    lacks_now: Option<LacksSource>,
    pub(crate) shutdown: CancellationToken,
    /// Held by whoever fits: one fit takes up to 150 MB.
    pub(crate) fits: Arc<Semaphore>,
    pub(crate) events: Arc<EventLog>,
}

/// What comes from one patch.
#[derive(Clone, Debug)]
pub(crate) struct PatchFeed {
    pub(crate) snapshot: watch::Receiver<Arc<PatchSnapshot>>,
    /// That the next one is about to come.
    pub(crate) soon: watch::Receiver<()>,
    pub(crate) session: watch::Receiver<Option<Arc<SessionView>>>,
}

/// The engine's end: publishes snapshots, never waits. When it is dropped every stream ends with UNAVAILABLE.
pub struct Publisher {
    heartbeat: Arc<Heartbeat>,
    snapshots: Vec<watch::Sender<Arc<PatchSnapshot>>>,
    soon: Vec<watch::Sender<()>>,
    sessions: Vec<watch::Sender<Option<Arc<SessionView>>>>,
    health: watch::Sender<Arc<Health>>,
    catalogue: watch::Sender<Arc<Catalogue>>,
    fits: Arc<Semaphore>,
    events: Arc<EventLog>,
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
    let (fits, events) = (Arc::new(Semaphore::new(1)), Arc::new(EventLog::new()));
    let mut publisher = Publisher {
        heartbeat: beats,
        snapshots: Vec::new(),
        soon: Vec::new(),
        sessions: Vec::new(),
        health,
        catalogue,
        fits: Arc::clone(&fits),
        events: Arc::clone(&events),
    };
    let mut patches = Vec::new();
    for _ in &plan.patches {
        let (to_snapshot, snapshot) = watch::channel(Arc::default());
        let (to_soon, soon) = watch::channel(());
        let (to_session, session) = watch::channel(None);
        publisher.snapshots.push(to_snapshot);
        publisher.soon.push(to_soon);
        publisher.sessions.push(to_session);
        patches.push(PatchFeed { snapshot, soon, session });
    }
    let patches = patches.into();
    let (health, catalogue) = (health_seen, catalogue_seen);
    let (audit, room) = (None, None);
    (
        Handle {
            commands,
            patches,
            health,
            catalogue,
            plan,
            clock,
            heartbeat,
            codec,
            samples: None,
            stored_sets: None,
            id_of: None,
            audit,
            room,
            push: None,
            recording: None,
            lacks: Arc::default(),
            lacks_now: None,
            shutdown,
            fits,
            events,
        },
        publisher,
        requests,
    )
}

impl Publisher {
    /// What whoever fits has to hold meanwhile: the fits of sessions and those that clients ask for take turns.
    #[must_use]
    pub fn fits(&self) -> Arc<Semaphore> {
        Arc::clone(&self.fits)
    }

    /// The engine's task has its turn now; due at least every [`BEAT_EVERY`](crate::BEAT_EVERY). Gives for how long the
    /// task had none if that was longer than [`STALLED_AFTER`](crate::STALLED_AFTER), for which readers were told that
    /// the engine is stalled.
    pub fn beat(&self) -> Option<Duration> {
        let gap = self.heartbeat.beat()?;
        tracing::info!("the engine runs again: it had not for {:.2} s", gap.as_secs_f64());
        Some(gap)
    }

    /// New live state of the patch at this position of the plan is about to come: the first of its subscribers has a turn
    /// in which it sends nothing, so that the way to them is in the processor's caches then.
    pub fn warm_up(&self, position: usize) {
        if let Some(sender) = self.soon.get(position) {
            sender.send_replace(());
        }
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

    /// Something happened that an operator may ask for later.
    pub fn event(&self, event: Event) {
        self.events.push(event);
    }

    /// Sessions or model sets changed.
    pub fn catalogue(&self, catalogue: Arc<Catalogue>) {
        self.catalogue.send_replace(catalogue);
    }
}

impl Handle {
    /// The newest health, as the engine put it out.
    #[must_use]
    pub fn health(&self) -> watch::Receiver<Arc<Health>> {
        self.health.clone()
    }

    /// The same with the samples of stored sessions, which `ExportSamples` then serves.
    #[must_use]
    pub fn with_samples(self, samples: SamplesSource) -> Self {
        Self { samples: Some(samples), ..self }
    }

    /// The same with the model sets that the store has and the engine has not in memory.
    #[must_use]
    pub fn with_model_sets(self, source: ModelSetSource) -> Self {
        Self { stored_sets: Some(StoredSets::new(source, self.codec)), ..self }
    }

    /// The same that fits stored samples once more; `id_of` makes the id of a model set from its content.
    #[must_use]
    pub fn with_refits(self, id_of: fn(&ModelSet) -> String) -> Self {
        Self { id_of: Some(id_of), ..self }
    }

    /// Gives the engine a command from within the process, as the services do for their clients, and waits for its answer.
    /// `None` if the engine has stopped.
    pub async fn ask(&self, command: Command) -> Option<Reply> {
        let (reply, answer) = oneshot::channel();
        self.commands.send(Request { command, reply, asked: None }).await.ok()?;
        answer.await.ok()
    }

    /// The same handle with an audit log to read.
    #[must_use]
    pub fn with_audit(mut self, audit: AuditSource) -> Self {
        self.audit = Some(audit);
        self
    }

    /// The same handle that starts sessions and imports model sets only where there is room.
    #[must_use]
    pub fn with_room(mut self, room: Room) -> Self {
        self.room = Some(room);
        self
    }

    /// The same handle with a way for pushed scans.
    #[must_use]
    pub fn with_push(mut self, line: PushLine) -> Self {
        self.push = Some(line);
        self
    }

    /// The same handle whose health tells of a recording.
    #[must_use]
    pub fn with_recording(mut self, recording: RecordingSource) -> Self {
        self.recording = Some(recording);
        self
    }

    /// The same handle whose health tells of this, in words: something that was asked for and could not be had.
    #[must_use]
    pub fn lacking(mut self, what: impl IntoIterator<Item = String>) -> Self {
        self.lacks = self.lacks.iter().cloned().chain(what).collect();
        self
    }

    /// The same handle whose health also tells of what this gives, in words: something that comes and goes.
    #[must_use]
    pub fn lacking_now(mut self, what: LacksSource) -> Self {
        self.lacks_now = Some(what);
        self
    }

    /// All that was asked for and cannot be had.
    pub(crate) fn lacks(&self) -> impl Iterator<Item = String> {
        let now = self.lacks_now.iter().flat_map(|what| what());
        self.lacks.iter().cloned().chain(now)
    }

    /// The newest state of the patch at this position of the plan, as the engine published it.
    #[must_use]
    pub fn newest(&self, patch: usize) -> Option<Arc<PatchSnapshot>> {
        self.patches.get(patch).map(|feed| Arc::clone(&feed.snapshot.borrow()))
    }

    /// Sessions and model sets as the engine published them last.
    #[must_use]
    pub fn stored(&self) -> Arc<Catalogue> {
        Arc::clone(&self.catalogue.borrow())
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
