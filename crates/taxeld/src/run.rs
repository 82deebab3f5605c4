//! `taxeld run`: buses, engine, store and service, wired together until a signal ends them.

use std::future::pending;
use std::sync::Arc;

use anyhow::Context;
use taxel_can::{FrameSource, SocketCan, SocketCanOptions};
use taxel_engine::BusNotice;
use taxel_engine::command::Command;
use taxel_engine::engine::routes::Routes;
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::{PatchPlan, Plan};
use taxel_engine::snapshot::Health;
use taxel_rpc::push_line::{PushLine, Pushed, push_line};
use taxel_rpc::{Clocks, Handle, ModelCodec, handle::channel};
use taxel_skin::BusIndex;
use taxel_store::{Retention, models_json};
use taxel_wire::Frame;
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::{mpsc, watch};
use tokio_util::sync::CancellationToken;

use crate::bus::{self, BATCHES_WAITING_MAX, BusEnd, Ends, FRAMES_WAITING_MAX, Rest, Rhythm};
use crate::clock::RunClock;
use crate::config::{BusSource, Config, Scene};
use crate::doors::{self, Open, Reloader};
use crate::driver::{Driver, Stage};
use crate::logs;
use crate::looking::Problems;
use crate::low_latency::{self, Awake};
use crate::parts::Parts;
use crate::queues::{BusBatch, Queues, TellDone};
use crate::record::{self, Tap};
use crate::reload::Reload;
use crate::reloading::Reloading;
use crate::serving::{limits, on_a_thread, service, share_with_pages};
use crate::shared_memory::{Keeper, Pages};
use crate::sockets::Sockets;
use crate::store_at::{StoreAt, audit_source, model_sets_of, open_store, room_of, samples_of};
use crate::systemd;
use crate::tasks::Tasks;
use crate::upkeep;

/// How model sets become text, for the service.
pub const CODEC: ModelCodec = ModelCodec {
    to_json: |set| models_json::to_json(set).map_err(|error| error.to_string()),
    from_json: |text| models_json::from_json(text).map_err(|error| error.to_string()),
    from_elsewhere: |text| models_json::from_elsewhere(text).map_err(|error| error.to_string()),
};

/// Everything of a daemon but its buses.
pub struct Daemon {
    plan: Arc<Plan>,
    /// Whether buses rest between the bursts of their boards: where time is the machine's, and nobody reads the force
    /// through shared memory, where a caller counts tens of microseconds and the first frames of a burst warm the caches.
    rests: bool,
    #[cfg_attr(not(feature = "sim"), allow(dead_code))] // asked by the demo alone
    handle: Handle,
    to_engine: mpsc::Sender<BusBatch>,
    to_buses: Vec<Option<(mpsc::Receiver<Frame>, Tap)>>,
    #[cfg_attr(not(feature = "sim"), allow(dead_code))] // read by the simulator alone
    session: watch::Receiver<Option<Stage>>,
    reloader: Reloader,
    tasks: Tasks,
    /// Listened to since before anybody could see that it serves: until then SIGTERM ends the process as it is.
    terminate: Signal,
    /// Held where latency has to be low.
    _awake: Option<Awake>,
    /// What SIGHUP reloads; without it SIGHUP ends the process, as it does by itself.
    reload: Option<(Signal, Reload)>,
}

impl Daemon {
    /// Starts engine, store and service; the engine on the present runtime, the other two on threads of their own, but the
    /// service beside the engine where latency has to be low.
    ///
    /// # Errors
    /// If the store cannot be opened or the address cannot be bound; what was started is closed then.
    pub async fn start(config: &Config, scene: Scene, store: StoreAt<'_>, clock: RunClock) -> anyhow::Result<Self> {
        let mut tasks = Tasks::default();
        let begun = Self::begin(config, scene, store, clock, &mut tasks);
        if begun.is_err() {
            tasks.close().await.unwrap_or_else(|late| tracing::error!("{late:#}"));
        }
        begun
    }

    /// Starts all of it; the tasks are left with the caller unless all is well.
    fn begin(
        config: &Config,
        scene: Scene,
        store: StoreAt<'_>,
        clock: RunClock,
        started: &mut Tasks,
    ) -> anyhow::Result<Self> {
        let Tasks { cancel, parts, .. } = &mut *started;
        #[cfg(feature = "certificate")]
        let certificates = crate::certificate::maker(config, &scene);
        let plan = Arc::new(scene.plan);
        let (tell_done, done) = TellDone::new();
        let room = room_of(&store, config.store.budget_mb());
        let (pages, keeper) = pages(config, &plan, &clock)?;
        let kept = match &store {
            StoreAt::File(_, kept) => *kept,
            StoreAt::Memory => Retention::default(),
        };
        let (store, restored) = open_store(store, &tell_done)?;
        let low_latency = false;
        let (now, live, patches) = (clock.clone(), matches!(clock, RunClock::Live), plan.patches.len());
        let clocks = Clocks { process: now.of_process(), run: Arc::new(move || now.now().time) };
        let (handle, publisher, commands) = channel(Arc::clone(&plan), clocks, CODEC, cancel.clone());
        let handle = handle.with_samples(samples_of(store.reader())).with_refits(models_json::content_id);
        let handle = handle.with_model_sets(model_sets_of(store.set_reader()));
        let handle = handle.with_audit(audit_source(store.audit_reader())).with_room(room);
        let size = store.size_reader();
        #[cfg(feature = "certificate")]
        let handle = handle.with_certificates(certificates);
        let (to_engine, batches) = mpsc::channel(BATCHES_WAITING_MAX);
        let (senders, receivers): (Vec<_>, Vec<_>) = (0..plan.buses).map(|_| mpsc::channel(FRAMES_WAITING_MAX)).unzip();
        let (session_state, session) = watch::channel(None);
        let (push, pushed) = push_ways(&plan);
        let handle = if let Some(line) = push { handle.with_push(line) } else { handle };
        let driver = Driver::new(Arc::clone(&plan), restored, clock, publisher, (store, tell_done), senders)
            .telling(session_state)
            .writing(pages);
        let queues = Queues::new(batches, commands, done).with_pushed(pushed);
        parts.spawn(driver.run(queues, cancel.clone()));
        parts.spawn(upkeep::keep(handle.clone(), size, kept, cancel.clone()));
        let share = share_with_pages(config, cancel, parts)?;
        let Open { listeners, sockets, access, reloader } = doors::open(&scene.doors)?;
        let handle = looked_after((keeper, sockets), handle, (parts, cancel))?;
        let (handle, taps) = record::begin((config, live), &plan, handle, (parts, cancel))?;
        let (handle, awake) = if low_latency { awake(handle) } else { (handle, None) };
        let terminate = signal(SignalKind::terminate())?;
        let service = service(handle.clone(), listeners, access, limits(), share);
        if low_latency {
            parts.spawn_fallible(service);
        } else {
            parts.spawn_fallible(on_a_thread(service)?);
        }
        let listen: Vec<String> = scene.doors.doors.iter().map(ToString::to_string).collect();
        tracing::info!(patches, listen = listen.join(", "), "taxeld is up");
        let to_buses = taps.beside(receivers);
        let rests = live && config.shared_memory.is_none() && !low_latency;
        let (tasks, reload, _awake) = (std::mem::take(started), None, awake);
        Ok(Self { plan, rests, handle, to_engine, to_buses, session, reloader, tasks, terminate, reload, _awake })
    }

    /// Adds the source of a bus.
    pub fn add_bus(&mut self, bus: BusIndex, source: impl FrameSource + 'static) {
        let Some((to_send, tap)) = self.to_buses.get_mut(bus.0 as usize).and_then(Option::take) else { return };
        let ends = Ends { to_engine: self.to_engine.clone(), to_send, tap };
        let rest = if self.rests { Rest::by(Rhythm::new(&self.plan, &self.routes(), bus)) } else { Rest::never() };
        self.tasks.buses.spawn(bus::run(bus, source, ends, rest, self.tasks.cancel.clone()));
    }

    /// Adds a bus whose scans are pushed: there is nothing to read, and nobody has pushed any yet.
    fn add_push_bus(&mut self, bus: BusIndex) {
        let notices = vec![BusNotice::Down("nobody has pushed a scan yet".to_owned())];
        let (to_engine, cancel) = (self.to_engine.clone(), self.tasks.cancel.clone());
        self.tasks.buses.spawn(async move {
            let _ = to_engine.send(BusBatch { bus, frames: Vec::new(), notices }).await; // the engine has stopped
            cancel.cancelled().await;
            BusEnd::Cancelled
        });
    }

    /// Adds all buses of the configuration.
    ///
    /// # Errors
    /// What keeps one of them from being read.
    fn add_buses(&mut self, config: &Config) -> anyhow::Result<()> {
        let routes = self.routes();
        for (position, section) in config.bus.iter().enumerate() {
            let bus = BusIndex(position as u8);
            match section.source {
                BusSource::SocketCan => {
                    let interface = section.interface.clone().unwrap_or_default();
                    let speaks = |p: &PatchPlan| p.configures() && p.patch.is_on(bus);
                    let tx = self.plan.patches.iter().any(speaks);
                    let options = SocketCanOptions { interface, ids: Some(routes.wanted(bus)), tx };
                    self.add_bus(bus, SocketCan::open(options)?);
                }
                BusSource::Push => self.add_push_bus(bus),
                #[cfg(feature = "sim")]
                BusSource::Sim => self.add_sim_bus(bus, section.seed)?,
                #[cfg(not(feature = "sim"))]
                BusSource::Sim => {
                    anyhow::bail!("bus `{}`: this build has no simulator (cargo feature `sim`)", section.name)
                }
            }
        }
        Ok(())
    }

    /// Adds a simulated bus, with what the plan expects on it.
    ///
    /// # Errors
    /// If there is no thread to be had.
    #[cfg(feature = "sim")]
    pub fn add_sim_bus(&mut self, bus: BusIndex, seed: u64) -> anyhow::Result<()> {
        // What the calibration is at concerns whoever plays the operator's hand.
        let source = crate::sim_bus::SimBus::new(seed, (&self.plan, bus), self.session.clone())?;
        self.add_bus(bus, source);
        Ok(())
    }

    /// Uses a model set from now on.
    ///
    /// # Errors
    /// What the engine has against it.
    #[cfg_attr(not(feature = "sim"), allow(dead_code))] // asked by the demo alone
    pub async fn use_models(&self, model_set: Arc<ModelSet>) -> anyhow::Result<()> {
        let (patch, id) = (model_set.patch.clone(), model_set.id.clone());
        let activate = Command::Activate { patch, model_set: id, expected: None };
        self.ask(Command::Import { model_set, insist: false }).await?;
        self.ask(activate).await
    }

    /// Has the boards configured by the word of `who` that nothing touches the skin.
    ///
    /// # Errors
    /// What the engine has against it.
    #[cfg_attr(not(feature = "sim"), allow(dead_code))] // asked by the demo alone
    pub async fn vouch_for_boards(&self, who: &str) -> anyhow::Result<()> {
        self.ask(Command::BringUp { patch: String::new(), confirmed_by: Some(who.to_owned()) }).await
    }

    #[cfg_attr(not(feature = "sim"), allow(dead_code))] // asked by the demo alone
    async fn ask(&self, command: Command) -> anyhow::Result<()> {
        let reply = self.handle.ask(command).await.context("the engine has stopped")?;
        reply.map(drop).map_err(|rejection| anyhow::anyhow!("{rejection}"))
    }

    /// Which identifiers each bus needs.
    pub fn routes(&self) -> Routes {
        Routes::new(&self.plan)
    }

    /// The newest health; it can be looked at after the daemon's end, too.
    #[must_use]
    pub fn health(&self) -> watch::Receiver<Arc<Health>> {
        self.handle.health()
    }

    /// Runs until a signal comes or every bus has ended, then closes.
    ///
    /// # Errors
    /// If signals cannot be waited for, or if not all closes in time.
    pub async fn until_the_end(mut self) -> anyhow::Result<()> {
        let ended = self.end().await;
        let closed = self.close().await;
        if let (Err(_), Err(late)) = (&ended, &closed) {
            tracing::error!("{late:#}"); // the other one is told at the end
        }
        ended.and(closed)
    }

    /// Waits for what ends it.
    async fn end(&mut self) -> anyhow::Result<()> {
        let (mut hangup, reload) = self.reload.take().unzip();
        let reloading = Reloading::begin(self.reloader.clone(), reload)?;
        loop {
            tokio::select! {
                interrupted = tokio::signal::ctrl_c() => { interrupted?; break; }
                _ = self.terminate.recv() => break,
                () = hung_up(hangup.as_mut()) => reloading.ask(),
                ended = self.tasks.buses.join_next() => match ended {
                    Some(Ok(BusEnd::Failed)) => {} // the others go on; the health says it
                    Some(Ok(BusEnd::LogOver)) if !self.tasks.buses.is_empty() => {}
                    Some(Ok(_)) | None => break,
                    // Nobody would serve that bus any more, nor say so: the service manager starts all anew.
                    Some(Err(error)) => anyhow::bail!("the task of a bus ended by a fault of this program: {error}"),
                },
                Some(ended) = self.tasks.parts.next_end() => return ended,
            }
        }
        Ok(())
    }

    async fn close(self) -> anyhow::Result<()> {
        systemd::stopping();
        tracing::info!("taxeld stops");
        self.tasks.close().await
    }
}

/// Both ends of the way of pushed scans, where there is a patch that has any.
fn push_ways(plan: &Plan) -> (Option<PushLine>, Option<mpsc::Receiver<Pushed>>) {
    if plan.patches.iter().all(|patch| patch.pushed.is_none()) {
        return (None, None);
    }
    let (line, pushed) = push_line(plan.patches.len());
    (Some(line), Some(pushed))
}

/// The pages in shared memory, where they are configured. Readers judge ages by the machine's clock, so that a log, which
/// has its own, has none.
fn pages(config: &Config, plan: &Plan, clock: &RunClock) -> anyhow::Result<(Pages, Option<Keeper>)> {
    let section = config.shared_memory.as_ref();
    if section.is_some() && !matches!(clock, RunClock::Live) {
        tracing::info!("no pages in shared memory: a log has a clock of its own");
        return Ok((Pages::default(), None));
    }
    let (pages, keeper) = Pages::make(section, plan)?;
    pages.paths().for_each(|page| tracing::info!(page = %page.display(), "in shared memory"));
    Ok((pages, keeper))
}

/// Starts those who look after the pages and the sockets; the health tells what is wrong with them.
fn looked_after(
    (keeper, sockets): (Option<Keeper>, Sockets),
    handle: Handle,
    (parts, cancel): (&mut Parts, &CancellationToken),
) -> anyhow::Result<Handle> {
    let problems: Vec<Problems> = keeper.iter().map(Keeper::problems).chain([sockets.problems()]).collect();
    if let Some(keeper) = keeper {
        parts.spawn(keeper.keep(cancel.clone())?);
    }
    if let Some(end) = sockets.keep(cancel.clone())? {
        parts.spawn(end);
    }
    Ok(handle.lacking_now(Arc::new(move || problems.iter().flat_map(Problems::get).collect())))
}

/// Keeps the machine's processors awake where that can be had; where not, the health says why.
fn awake(handle: Handle) -> (Handle, Option<Awake>) {
    match low_latency::keep_awake() {
        Ok(awake) => {
            tracing::info!("low latency: the processors of this machine are kept awake");
            (handle, Some(awake))
        }
        Err(why) => {
            tracing::warn!("{why}");
            (handle.lacking([why]), None)
        }
    }
}

/// Waits for SIGHUP, where that reloads.
async fn hung_up(hangup: Option<&mut Signal>) {
    let Some(signal) = hangup else { return pending().await };
    if signal.recv().await.is_none() {
        pending().await // there are no more
    }
}

/// The daemon on the buses of its configuration, of which `reload` knows the text.
///
/// # Errors
/// Whatever keeps it from starting.
pub async fn run(config: Config, scene: Scene, reload: Reload) -> anyhow::Result<()> {
    // Where a file may not grow any more (`ulimit -f`) this signal would end the process. It does not any more once it was
    // listened to: then the write fails, as on a full disk.
    let _heard = signal(SignalKind::from_raw(nix::libc::SIGXFSZ))?;
    logs::filter(config.log.filter.as_deref()).map_err(anyhow::Error::msg)?;
    let hangup = signal(SignalKind::hangup())?; // before the daemon is ready, after which it may come
    let store = &config.store;
    let bytes = store.keep_mb.map(|mb| mb.saturating_mul(1_000_000));
    let retention = Retention { bytes, ..Retention::default() };
    let mut daemon = Daemon::start(&config, scene, StoreAt::File(&store.path, retention), RunClock::Live).await?;
    daemon.reload = Some((hangup, reload));
    match daemon.add_buses(&config) {
        Ok(()) => daemon.until_the_end().await,
        Err(error) => {
            daemon.close().await.unwrap_or_else(|late| tracing::error!("{late:#}"));
            Err(error)
        }
    }
}
