//! `taxeld run`: buses, engine, store and service, wired together until a signal ends them.

use std::sync::Arc;
use std::time::Duration;

use anyhow::Context;
use taxel_can::{FrameSource, SocketCan, SocketCanOptions};
use taxel_engine::Restored;
use taxel_engine::engine::routes::Routes;
use taxel_engine::plan::{PatchPlan, Plan};
use taxel_rpc::{Clocks, Handle, Limits, Listener, ModelCodec, handle::channel, serve};
use taxel_skin::BusIndex;
use taxel_store::{Store, models_json};
use taxel_wire::Frame;
use tokio::net::TcpListener;
use tokio::runtime::Runtime;
use tokio::sync::{mpsc, oneshot, watch};
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

use crate::bus::{self, BATCHES_WAITING_MAX, BusEnd, FRAMES_WAITING_MAX};
use crate::clock::{RunClock, process_clock};
use crate::config::{BusSource, Config, Scene};
use crate::driver::{Driver, Stage};
use crate::queues::{BusBatch, Queues, TellDone};

/// After the end was asked for, the parts have this long to close.
const CLOSE_WITHIN: Duration = Duration::from_secs(5);

/// How model sets become text, for the service.
pub const CODEC: ModelCodec = ModelCodec {
    to_json: |set| models_json::to_json(set).map_err(|error| error.to_string()),
    from_json: |text| models_json::from_json(text).map_err(|error| error.to_string()),
};

/// Everything of a daemon but its buses.
pub struct Daemon {
    plan: Arc<Plan>,
    cancel: CancellationToken,
    to_engine: mpsc::Sender<BusBatch>,
    to_buses: Vec<Option<mpsc::Receiver<Frame>>>,
    #[cfg_attr(not(feature = "sim"), allow(dead_code))] // read by the simulator alone
    session: watch::Receiver<Option<Stage>>,
    tasks: JoinSet<()>,
    buses: JoinSet<BusEnd>,
}

impl Daemon {
    /// Starts engine, store and service; the engine on the present runtime, the other two on threads of their own.
    ///
    /// # Errors
    /// If the store cannot be opened or the address cannot be bound.
    pub async fn start(config: &Config, scene: Scene, store: StoreAt<'_>, clock: RunClock) -> anyhow::Result<Self> {
        let plan = Arc::new(scene.plan);
        let cancel = CancellationToken::new();
        let (tell_done, done) = TellDone::new();
        let (store, restored) = open_store(store, &tell_done)?;
        let (now, patches) = (clock.clone(), plan.patches.len());
        let clocks = Clocks { run: Arc::new(move || now.now().time), process: Arc::new(process_clock()) };
        let (handle, publisher, commands) = channel(Arc::clone(&plan), clocks, CODEC, cancel.clone());
        let (to_engine, batches) = mpsc::channel(BATCHES_WAITING_MAX);
        let (senders, receivers): (Vec<_>, Vec<_>) =
            (0..plan.buses).map(|_| mpsc::channel(FRAMES_WAITING_MAX)).map(|(s, r)| (s, Some(r))).unzip();
        let (session_state, session) = watch::channel(None);
        let driver = Driver::new(Arc::clone(&plan), restored, clock, publisher, (store, tell_done), senders)
            .telling(session_state);
        let queues = Queues::new(batches, commands, done);
        let mut tasks = JoinSet::new();
        tasks.spawn(driver.run(queues, cancel.clone()));
        tasks.spawn(service(handle, listen(config)?, limits(config))?);
        tracing::info!(patches, listen = %config.service.listen, "taxeld is up");
        Ok(Self { plan, cancel, to_engine, to_buses: receivers, session, tasks, buses: JoinSet::new() })
    }

    /// Adds the source of a bus.
    pub fn add_bus(&mut self, bus: BusIndex, source: impl FrameSource + 'static) {
        let Some(to_send) = self.to_buses.get_mut(bus.0 as usize).and_then(Option::take) else { return };
        self.buses.spawn(bus::run(bus, source, self.to_engine.clone(), to_send, self.cancel.clone()));
    }

    /// What the calibration is at, for whoever plays the operator's hand.
    #[cfg_attr(not(feature = "sim"), allow(dead_code))] // read by the simulator alone
    pub fn session(&self) -> watch::Receiver<Option<Stage>> {
        self.session.clone()
    }

    /// Which identifiers each bus needs.
    pub fn routes(&self) -> Routes {
        Routes::new(&self.plan)
    }

    /// Runs until a signal comes or every bus has ended, then closes.
    ///
    /// # Errors
    /// If signals cannot be waited for.
    pub async fn until_the_end(mut self) -> anyhow::Result<()> {
        let mut terminate = tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate())?;
        loop {
            tokio::select! {
                interrupted = tokio::signal::ctrl_c() => { interrupted?; break; }
                _ = terminate.recv() => break,
                ended = self.buses.join_next() => match ended {
                    Some(Ok(BusEnd::Failed)) => {} // the others go on; the health says it
                    Some(Ok(BusEnd::LogOver)) if !self.buses.is_empty() => {}
                    Some(Ok(_)) | None => break,
                    Some(Err(error)) => tracing::error!(%error, "a bus task"),
                },
                Some(ended) = self.tasks.join_next() => {
                    if let Err(error) = ended {
                        tracing::error!(%error, "a task of the daemon");
                    }
                    break;
                }
            }
        }
        self.close().await;
        Ok(())
    }

    async fn close(mut self) {
        tracing::info!("taxeld stops");
        self.cancel.cancel();
        let all = async {
            while self.buses.join_next().await.is_some() {}
            while self.tasks.join_next().await.is_some() {}
        };
        if tokio::time::timeout(CLOSE_WITHIN, all).await.is_err() {
            tracing::warn!(seconds = CLOSE_WITHIN.as_secs(), "some parts did not close in time");
        }
    }
}

/// Where records go.
pub enum StoreAt<'a> {
    /// A file.
    File(&'a std::path::Path),
    /// Nowhere that outlives the process.
    Memory,
}

fn open_store(at: StoreAt<'_>, tell_done: &TellDone) -> anyhow::Result<(Store, Restored)> {
    match at {
        StoreAt::Memory => Ok((Store::in_memory(tell_done.of_store())?, Restored::default())),
        StoreAt::File(path) => {
            if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
                std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
            }
            let opened = Store::open(path, tell_done.of_store());
            // What was found damaged is in the log already, and in `restored` for the health.
            let (store, restored, _) = opened.with_context(|| format!("opening {}", path.display()))?;
            Ok((store, restored))
        }
    }
}

fn listen(config: &Config) -> anyhow::Result<std::net::TcpListener> {
    let address = config.service.listen;
    let listener = std::net::TcpListener::bind(address).with_context(|| format!("service.listen = {address}"))?;
    listener.set_nonblocking(true)?;
    Ok(listener)
}

fn limits(config: &Config) -> Limits {
    let service = &config.service;
    Limits { streams: service.subscribers_max, connections: service.connections_max, ..Limits::default() }
}

/// Starts the service on a thread of its own, so that what subscribers cost never delays a frame. Gives its end.
fn service(
    handle: Handle,
    listener: std::net::TcpListener,
    limits: Limits,
) -> anyhow::Result<impl Future<Output = ()> + use<>> {
    let runtime = runtime()?;
    let (ended, end) = oneshot::channel();
    let serving = async move {
        let listener = Listener::Tcp(TcpListener::from_std(listener)?);
        anyhow::Ok(serve(handle, listener, limits).await?)
    };
    let run = move || {
        if let Err(error) = runtime.block_on(serving) {
            tracing::error!("the service ended: {error:#}");
        }
        let _ = ended.send(()); // the daemon did not wait for it
    };
    std::thread::Builder::new().name("service".to_owned()).spawn(run).context("a thread for the service")?;
    Ok(async move {
        if end.await.is_err() {
            tracing::error!("the service's thread panicked");
        }
    })
}

/// A runtime on the thread that drives it. One thread wakes tasks without waking another thread, and takes them in the
/// order in which they were woken: a connection is written to when all of its streams have had their turn.
///
/// # Errors
/// If the system has no more descriptors.
pub fn runtime() -> std::io::Result<Runtime> {
    tokio::runtime::Builder::new_current_thread().enable_all().build()
}

/// The daemon on the buses of its configuration.
///
/// # Errors
/// Whatever keeps it from starting.
pub async fn run(config: Config, scene: Scene) -> anyhow::Result<()> {
    let mut daemon = Daemon::start(&config, scene, StoreAt::File(&config.store.path), RunClock::Live).await?;
    let routes = daemon.routes();
    for (position, section) in config.bus.iter().enumerate() {
        let bus = BusIndex(position as u8);
        match section.source {
            BusSource::SocketCan => {
                let interface = section.interface.clone().unwrap_or_default();
                let speaks = |p: &PatchPlan| !p.bring_up.is_empty() && p.patch.boards().iter().any(|b| b.bus == bus);
                let tx = daemon.plan.patches.iter().any(speaks);
                let options = SocketCanOptions { interface, ids: Some(routes.wanted(bus)), tx };
                daemon.add_bus(bus, SocketCan::open(options)?);
            }
            #[cfg(feature = "sim")]
            BusSource::Sim => daemon.add_bus(bus, crate::sim_bus::SimBus::new(section.seed, daemon.session())?),
            #[cfg(not(feature = "sim"))]
            BusSource::Sim => {
                anyhow::bail!("bus `{}`: this build has no simulator (cargo feature `sim`)", section.name)
            }
        }
    }
    daemon.until_the_end().await
}
