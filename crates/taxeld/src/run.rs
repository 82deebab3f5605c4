//! `taxeld run`: buses, engine, store and service, wired together until a signal ends them.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Context;
use taxel_can::{Batch, FrameSource, Pause, Remote, RemoteBus, SocketCan, SocketCanOptions};
use taxel_engine::Restored;
use taxel_engine::engine::routes::Routes;
use taxel_engine::plan::{PatchPlan, Plan};
use taxel_rpc::push_line::push_line;
use taxel_rpc::{Handle, Limits, Server, handle::channel};
use taxel_skin::BusIndex;
use taxel_store::Store;
use taxel_wire::Frame;
use taxel_yarp::port_bus;
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::mpsc;

use crate::backend::DaemonBackend;
use crate::bus::{self, BATCHES_WAITING_MAX, Ends, FRAMES_WAITING_MAX};
use crate::config::{self, BusSource, Config, Scene, StoreSection};
use crate::doors;
use crate::driver::{Driver, boottime};
use crate::page::serve_page;
use crate::queues::{BusBatch, Queues, TellDone};
use crate::record::{self, Tap};
use crate::reload::{self, Credentials};
use crate::rig::line_bus;
use crate::runtime::{on_a_thread, runtime};
use crate::shared_memory::Pages;
use crate::systemd;
use crate::tasks::{Tasks, next_end};
use crate::upkeep;

/// Everything of a daemon but its buses.
pub struct Daemon {
    /// What it does.
    pub plan: Arc<Plan>,
    /// The way to its engine, for the simulator and the demo.
    #[cfg_attr(not(feature = "sim"), allow(dead_code))]
    pub handle: Handle,
    to_engine: mpsc::Sender<BusBatch>,
    to_buses: Vec<Option<(mpsc::Receiver<Frame>, Tap)>>,
    credentials: Credentials,
    tasks: Tasks,
    /// Listened to since before anybody could see that it serves: until then SIGTERM ends the process as it is.
    terminate: Signal,
}

impl Daemon {
    /// Starts engine, store and service; the engine on the present runtime, the other two on threads of their own. Without a `store`
    /// nothing outlives the process.
    ///
    /// # Errors
    /// If the store cannot be opened or the address cannot be bound; what was started is closed then.
    pub async fn start(config: &Config, scene: Scene, store: Option<&StoreSection>) -> anyhow::Result<Self> {
        let mut tasks = Tasks::default();
        let begun = Self::begin(config, scene, store, &mut tasks);
        if begun.is_err() {
            tasks.close().await.unwrap_or_else(|late| tracing::error!("{late:#}"));
        }
        begun
    }

    /// Starts all of it; the tasks are left with the caller unless all is well.
    fn begin(config: &Config, scene: Scene, store: Option<&StoreSection>, tasks: &mut Tasks) -> anyhow::Result<Self> {
        let plan = Arc::new(scene.plan);
        let (tell_done, done) = TellDone::new();
        let (pages, lacks) = Pages::make(config.shared_memory.as_ref(), &plan)?;
        pages.paths().for_each(|page| tracing::info!(page = %page.display(), "in shared memory"));
        lacks.iter().for_each(|problem| tracing::error!("{problem}"));
        let budget = store.map(|store| (store.path.clone(), store.budget_mb()));
        let kept = store.and_then(StoreSection::kept_bytes);
        let (store, restored) = open_store(store, &tell_done)?;
        let (clock, now, patches) = (boottime(), boottime(), plan.patches.len());
        let (handle, publisher, commands) =
            channel(Arc::clone(&plan), Arc::new(move || now().time), tasks.cancel.clone());
        let reader = store.reader();
        let (to_engine, batches) = mpsc::channel(BATCHES_WAITING_MAX);
        let (senders, receivers): (Vec<_>, Vec<_>) = (0..plan.buses).map(|_| mpsc::channel(FRAMES_WAITING_MAX)).unzip();
        let pushes =
            |patch: &PatchPlan| patch.pushed.is_some() || patch.gauge.as_ref().is_some_and(|gauge| gauge.pushed);
        let is_pushed = plan.patches.iter().any(pushes);
        let (push, pushed) = push_line(patches);
        let push = is_pushed.then_some(push);
        let mut driver = Driver::new(Arc::clone(&plan), restored, clock, publisher, (store, tell_done), senders);
        driver.pages = pages;
        let driver = driver.begun();
        tasks.parts.spawn(driver.run(Queues { batches, pushed, commands, done }, tasks.cancel.clone()));
        if let Some(kept) = kept {
            tasks.parts.spawn(upkeep::keep(handle.clone(), reader.clone(), kept, tasks.cancel.clone()));
        }
        let (listeners, credentials) = doors::open(&scene.doors)?;
        let (recording, taps) = record::begin(config, &plan, &handle, tasks)?;
        let backend = DaemonBackend { store: reader, budget, push, recording, lacks };
        let terminate = signal(SignalKind::terminate())?;
        let server = Server::new(handle.clone(), Arc::new(backend), credentials.access.clone(), Limits::default())?;
        serve_page(config, &server, &handle, tasks)?;
        let lives = handle.clone();
        let ended = on_a_thread("service", async move {
            tokio::select! {
                served = server.serve(listeners) => served.context("the service ended"),
                never = systemd::keep(lives) => match never {},
            }
        })?;
        tasks.parts.spawn(async { ended.await? });
        let listen: Vec<String> = scene.doors.doors.iter().map(ToString::to_string).collect();
        tracing::info!(patches, listen = listen.join(", "), "taxeld is up");
        let to_buses = receivers.into_iter().zip(taps).map(Some).collect();
        let tasks = std::mem::take(tasks);
        Ok(Self { plan, handle, to_engine, to_buses, credentials, tasks, terminate })
    }

    /// Adds the source of a bus.
    pub fn add_bus(&mut self, bus: BusIndex, source: impl FrameSource + 'static) {
        let Some((to_send, tap)) = self.to_buses.get_mut(bus.0 as usize).and_then(Option::take) else { return };
        let ends = Ends { to_engine: self.to_engine.clone(), to_send, tap };
        self.tasks.buses.spawn(bus::run(bus, source, ends, self.tasks.cancel.clone()));
    }

    /// Adds all buses of the configuration.
    ///
    /// # Errors
    /// What keeps one of them from being read.
    fn add_buses(&mut self, config: &Config) -> anyhow::Result<()> {
        let routes = Routes::new(&self.plan);
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
                BusSource::Push => self.add_bus(bus, RemoteBus::new(Pushed)),
                BusSource::Line => {
                    if let Some(line) = config::line_of(config, section) {
                        self.add_bus(bus, line_bus(line));
                    }
                }
                BusSource::Yarp => {
                    if let Some((port, content)) = config::port_of(config, &self.plan, bus) {
                        self.add_bus(bus, port_bus(section.server.as_deref(), port, content));
                    }
                }
                #[cfg(feature = "sim")]
                BusSource::Sim => {
                    let (seed, handle) = (section.seed.unwrap_or(1), self.handle.clone());
                    self.add_bus(bus, crate::sim_bus::SimBus::new(seed, (&self.plan, bus), handle, None)?);
                }
                #[cfg(not(feature = "sim"))]
                BusSource::Sim => {} // the check of the configuration has refused it
            }
        }
        Ok(())
    }

    /// Runs until a signal comes, if all has `begun`, then closes.
    ///
    /// # Errors
    /// What has not begun, if signals cannot be waited for, or if not all closes in time.
    pub async fn until_the_end(self, begun: anyhow::Result<()>) -> anyhow::Result<()> {
        let Self { mut tasks, mut terminate, .. } = self;
        let ended = if begun.is_ok() { end(&mut tasks, &mut terminate).await } else { begun };
        systemd::stopping();
        tracing::info!("taxeld stops");
        let closed = tasks.close().await;
        if let (Err(_), Err(late)) = (&ended, &closed) {
            tracing::error!("{late:#}"); // the other one is told at the end
        }
        ended.and(closed)
    }
}

/// A bus whose scans or readings are pushed: there is nothing to read, and nobody has pushed any yet.
struct Pushed;

impl Remote for Pushed {
    async fn more(&mut self, pause: &mut Pause, _: &mut Batch) -> Result<(), String> {
        pause.wait().await;
        Err("nobody has pushed anything yet".to_owned())
    }
}

/// Waits for what ends the daemon.
async fn end(tasks: &mut Tasks, terminate: &mut Signal) -> anyhow::Result<()> {
    loop {
        tokio::select! {
            interrupted = tokio::signal::ctrl_c() => { interrupted?; break; }
            _ = terminate.recv() => break,
            ended = tasks.buses.join_next() => match ended {
                Some(Ok(())) => {} // the others go on; the health says it
                None => break,
                // Nobody would serve that bus any more, nor say so: the service manager starts all anew.
                Some(Err(error)) => anyhow::bail!("the task of a bus ended by a fault of this program: {error}"),
            },
            Some(ended) = next_end(&mut tasks.parts) => return ended,
        }
    }
    Ok(())
}

/// The store in its file, which is made if absent, or in memory.
fn open_store(section: Option<&StoreSection>, tell_done: &TellDone) -> anyhow::Result<(Store, Restored)> {
    let Some(StoreSection { path, .. }) = section else {
        return Ok((Store::in_memory(tell_done.of_store())?, Restored::default()));
    };
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
    }
    // What was found damaged is in the log already, and in `restored` for the health.
    let opened = Store::open(path, tell_done.of_store()).with_context(|| format!("opening {}", path.display()));
    opened.map(|(store, restored, _)| (store, restored))
}

/// The daemon of the configuration in the file `path`, until it is ended.
///
/// # Errors
/// Whatever keeps it from starting, or from ending well.
pub fn run(path: PathBuf) -> anyhow::Result<()> {
    let (config, scene) = config::examine(&path)?;
    let runtime = runtime()?;
    let ended = runtime.block_on(on_all_buses(config, scene, path));
    runtime.shutdown_background(); // dropped, it would wait for calls into a disk that hangs
    ended
}

async fn on_all_buses(config: Config, scene: Scene, path: PathBuf) -> anyhow::Result<()> {
    // Where a file may not grow any more (`ulimit -f`) this signal would end the process. It does not any more once it was
    // listened to: then the write fails, as on a full disk.
    let _heard = signal(SignalKind::from_raw(nix::libc::SIGXFSZ))?;
    let hangup = signal(SignalKind::hangup())?; // before the daemon is ready, after which it may come
    let mut daemon = Daemon::start(&config, scene, Some(&config.store)).await?;
    let begun = daemon.add_buses(&config);
    let reload = reload::keep(daemon.credentials.clone(), hangup, path, daemon.tasks.cancel.clone());
    daemon.tasks.parts.spawn(reload);
    daemon.until_the_end(begun).await
}
