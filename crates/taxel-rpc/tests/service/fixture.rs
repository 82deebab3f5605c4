//! A server on a free port whose engine is the test itself.

pub use std::net::{SocketAddr, TcpListener};
pub use std::sync::Arc;
pub use std::sync::atomic::{AtomicI64, Ordering};
pub use std::time::Duration;
pub use taxel_engine::audit::AuditEntry;
pub use taxel_engine::baseline::TaxelBaseline;
pub use taxel_engine::calibration::{SessionSamples, SessionState, SessionView};
pub use taxel_engine::command::{Command, Done, Rejection, Reply};
pub use taxel_engine::model_set::{ModelSet, Recorded, RecordedTaxel};
pub use taxel_engine::plan::{DevicePlan, Gauge, LiveLimits, PatchPlan, Plan, PushPlan, TarePlan};
pub use taxel_engine::snapshot::{BusHealth, Catalogue, ForceSample, ForceState, Health, PatchSnapshot, TaxelState};
pub use taxel_model::{FitOptions, GaugeUncertainty, Samples, Status as ModelStatus, TaxelModel, fit};
pub use taxel_proto::refusal::Refusal;
pub use taxel_proto::v1;
pub use taxel_proto::v1::ErrorReason;
pub use taxel_proto::v1::calibration_service_client::CalibrationServiceClient;
pub use taxel_proto::v1::force_service_client::ForceServiceClient;
pub use taxel_proto::v1::model_service_client::ModelServiceClient;
pub use taxel_proto::v1::skin_service_client::SkinServiceClient;
pub use taxel_proto::v1::validation_service_client::ValidationServiceClient;
pub use taxel_rpc::handle::channel;
pub use taxel_rpc::push_line::{PushLine, Pushed, push_line};
pub use taxel_rpc::{Access, Backend, Clock, Limits, Listener, Publisher, Request, Rules, Server, Told};
pub use taxel_skin::{
    Board, BoardAddress, BusIndex, CountRange, Geometry, Kilopascal, Module, ModuleKind, Newton, Patch, TaxelPose, Time,
};
pub use taxel_wire::reading;
pub use taxel_wire::signal::{PressureMeaning, PressureUnit, SignalSpec};
pub use tokio::net::TcpStream;
pub use tokio::sync::mpsc;
pub use tokio::task::JoinHandle;
pub use tokio_util::sync::CancellationToken;
pub use tonic::transport::{Channel, Endpoint};
pub use tonic::{Code, Response, Status, Streaming};
pub use tonic_health::pb::HealthCheckRequest;
pub use tonic_health::pb::health_client::HealthClient;

pub const FOREARM: &str = "left_forearm";
pub const HAND: &str = "left_hand";
/// A patch whose scans are pushed, twelve bits each.
pub const GLOVE: &str = "glove";
/// A patch on a bus whose gauge is pushed.
pub const ARM: &str = "left_arm";
pub const TAXELS: usize = 20;
/// Far from the time after which the engine counts as stalled, so that the two cannot be taken for each other.
pub const STALE_AFTER: Duration = Duration::from_secs(5);

/// A running server and all its ends.
pub struct Daemon {
    pub publisher: Option<Publisher>,
    pub requests: mpsc::Receiver<Request>,
    pub pushed: mpsc::Receiver<Pushed>,
    pub shutdown: CancellationToken,
    pub address: SocketAddr,
    pub server: JoinHandle<std::io::Result<()>>,
    clock: Arc<AtomicI64>,
}

/// Limits of which no clock is one: however slow the machine is, nothing is cut off that a test did not ask for.
pub fn patient() -> Limits {
    let hour = Duration::from_secs(3600);
    Limits {
        check_every: hour,
        command: hour,
        push_pause: hour,
        keepalive_interval: hour,
        drain: hour,
        ..Limits::default()
    }
}

pub async fn start() -> Daemon {
    start_with(&[FOREARM], patient()).await
}

pub async fn start_with(patches: &[&str], limits: Limits) -> Daemon {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    serve_on(vec![Listener::Tcp(listener)], Access::new(Rules::open()), (patches, limits), address)
}

/// A daemon with this behind it.
pub async fn start_backed(store: Store, limits: Limits) -> Daemon {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    serve_all((vec![Listener::Tcp(listener)], Access::new(Rules::open())), (&[FOREARM], limits), address, store)
}

/// Answers a question of the service.
type Answers<Q, T> = Option<Box<dyn Fn(Q, Told<T>) + Send + Sync>>;

/// What the daemon has beside the engine: what is absent answers that it is not there.
#[derive(Default)]
pub struct Store {
    pub samples: Answers<u64, SessionSamples>,
    pub model_sets: Answers<String, String>,
    /// Asked for entries below the first number, at most so many.
    pub audit: Answers<(u64, u32), Vec<AuditEntry>>,
    pub push: Option<PushLine>,
}

fn answer<Q, T>(answers: &Answers<Q, T>, question: Q, told: Told<T>) {
    match answers {
        Some(answer) => answer(question, told),
        None => told(Err(Refusal::unavailable(ErrorReason::StoreUnavailable, "there is none"))),
    }
}

impl Backend for Store {
    fn samples(&self, session: u64, told: Told<SessionSamples>) {
        answer(&self.samples, session, told);
    }

    fn model_set(&self, id: String, told: Told<String>) {
        answer(&self.model_sets, id, told);
    }

    fn audit(&self, before: u64, most: u32, told: Told<Vec<AuditEntry>>) {
        answer(&self.audit, (before, most), told);
    }

    fn content_id(&self, set: &ModelSet) -> String {
        format!("m-{}", set.method)
    }

    /// In the tests a set's file is its id.
    fn to_json(&self, set: &ModelSet) -> Result<String, String> {
        Ok(format!("set {}", set.id))
    }

    fn read_json(&self, text: &str) -> Result<ModelSet, String> {
        let id = text.strip_prefix("set ").ok_or_else(|| format!("line 1: `{text}`: expected `set ID`"))?;
        Ok(ModelSet::clone(&model_set(id, FOREARM)))
    }

    fn push_line(&self) -> Option<&PushLine> {
        self.push.as_ref()
    }
}

/// A daemon behind these listeners; `address` is where [`Daemon::connect`] goes.
pub fn serve_on(listeners: Vec<Listener>, access: Access, scene: (&[&str], Limits), address: SocketAddr) -> Daemon {
    serve_all((listeners, access), scene, address, Store::default())
}

/// A daemon on loopback and on a Unix socket, two peers for one test.
pub fn on_two_doors(limits: Limits) -> (Daemon, tempfile::TempDir, Endpoint) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("socket");
    let tcp = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = tcp.local_addr().unwrap();
    let unix = std::os::unix::net::UnixListener::bind(&path).unwrap();
    let listeners = vec![Listener::Tcp(tcp), Listener::Unix(unix)];
    let daemon = serve_on(listeners, Access::new(Rules::open()), (&[FOREARM], limits), address);
    let endpoint = Endpoint::from_shared(format!("unix:{}", path.display())).unwrap();
    (daemon, folder, endpoint)
}

fn serve_all(
    (listeners, access): (Vec<Listener>, Access),
    (patches, limits): (&[&str], Limits),
    address: SocketAddr,
    store: Store,
) -> Daemon {
    let plan = Arc::new(Plan { buses: 1, patches: patches.iter().map(|name| patch_plan(name)).collect() });
    let clock = Arc::new(AtomicI64::new(0));
    let reads = Arc::clone(&clock);
    let now: Clock = Arc::new(move || Time::from_nanos(reads.load(Ordering::SeqCst)));
    let shutdown = CancellationToken::new();
    let (line, pushed) = push_line(plan.patches.len());
    let (handle, publisher, requests) = channel(plan, now, shutdown.clone());
    let store = Store { push: Some(line), ..store };
    let server = Server::new(handle, Arc::new(store), access, limits).unwrap();
    let server = tokio::spawn(server.serve(listeners));
    Daemon { publisher: Some(publisher), requests, pushed, shutdown, address, server, clock }
}

/// Subscribes to the force of the only patch.
pub async fn stream(channel: Channel, rate_hz: Option<f64>) -> Result<Streaming<v1::ForceSample>, Status> {
    let request = v1::StreamRequest { rate_hz, ..Default::default() };
    ForceServiceClient::new(channel).stream_force(request).await.map(Response::into_inner)
}

pub async fn get_force(channel: Channel) -> Result<v1::ForceSample, Status> {
    ForceServiceClient::new(channel).get_force(v1::PatchRequest::default()).await.map(Response::into_inner)
}

impl Daemon {
    pub async fn connect(&self) -> Channel {
        self.endpoint().connect().await.unwrap()
    }

    pub fn endpoint(&self) -> Endpoint {
        Endpoint::from_shared(format!("http://{}", self.address)).unwrap()
    }

    /// What comes for the engine; from here on somebody else answers.
    pub fn take_requests(&mut self) -> mpsc::Receiver<Request> {
        std::mem::replace(&mut self.requests, mpsc::channel(1).1)
    }

    pub fn engine(&self) -> &Publisher {
        self.publisher.as_ref().unwrap()
    }

    /// The clock says this from now on, and the engine has its turn.
    pub fn set_clock(&self, time: Time) {
        self.clock.store(time.as_nanos(), Ordering::SeqCst);
        let _ = self.engine().beat(); // how long it had none concerns the engine alone
    }

    /// The clock says this from now on, and the engine is stuck.
    pub fn set_clock_without_a_beat(&self, time: Time) {
        self.clock.store(time.as_nanos(), Ordering::SeqCst);
    }

    /// What a call comes to whose command, which `expected` looks at, gets this reply.
    pub async fn replied<T>(
        &mut self,
        call: impl Future<Output = Result<Response<T>, Status>>,
        reply: Reply,
        expected: impl FnOnce(Command),
    ) -> Result<T, Status> {
        let (answer, ()) = tokio::join!(call, self.answer(reply, expected));
        answer.map(Response::into_inner)
    }

    /// Answers the next command, which `expected` looks at.
    pub async fn answer(&mut self, reply: Reply, expected: impl FnOnce(Command)) {
        let request = self.requests.recv().await.unwrap();
        expected(request.command);
        request.reply.send(reply).unwrap();
    }
}

/// Two modules of ten taxels.
fn pushed_plan() -> PatchPlan {
    let modules = (0..2).map(|m| (Module::from_nibble(m), ModuleKind::Cells(10))).collect();
    let board = Board { bus: BusIndex(0), address: BoardAddress::new(1).unwrap(), modules };
    let patch = Patch::new(GLOVE, vec![board]).unwrap().with_counts(CountRange::to(4095).unwrap());
    PatchPlan {
        devices: vec![DevicePlan::without_frames()],
        pushed: Some(PushPlan { pressure: true }),
        ..PatchPlan::new(patch)
    }
}

/// How the readings that are pushed are read.
pub fn pushed_gauge() -> SignalSpec {
    reading::signal(0, PressureUnit::Kilopascal, PressureMeaning::Differential)
}

fn patch_plan(name: &str) -> PatchPlan {
    if name == GLOVE {
        return pushed_plan();
    }
    let modules = (0..2).map(|m| (Module::from_nibble(m), ModuleKind::Triangle)).collect();
    let board = Board { bus: BusIndex(0), address: BoardAddress::new(13).unwrap(), modules };
    let pose = |taxel: usize| TaxelPose { position: [0.001 * taxel as f64, 0.0, 0.0], normal: [0.0, 0.6, 0.8] };
    let mut poses: Vec<_> = (0..TAXELS).map(|taxel| Some(pose(taxel))).collect();
    poses[3] = None;
    poses[0] = Some(TaxelPose { position: [0.0, 0.0, 0.0], normal: [1.0, 0.0, 0.0] });
    PatchPlan {
        geometry: Some(Geometry::from_poses(poses)),
        area_uncertainty: 0.0,
        live: LiveLimits { stale_after: STALE_AFTER, ..LiveLimits::default() },
        gauge: (name == ARM).then(|| Gauge { pushed: true, ..Gauge::new(BusIndex(1), pushed_gauge()) }),
        tare: TarePlan { duration: Duration::from_secs(2), at_start: false },
        ..PatchPlan::new(Patch::new(name, vec![board]).unwrap())
    }
}

/// A snapshot with this number, its newest frame received at `time`, its total `sequence` newtons.
pub fn snapshot(sequence: u64, time: Time) -> Arc<PatchSnapshot> {
    let taxel = TaxelState { count: 200, time, seen: true, calibrated: true, ..TaxelState::default() };
    let force = ForceSample { state: ForceState::Ok, total: Some(Newton(sequence as f64)), ..ForceSample::default() };
    let taxels = vec![taxel; TAXELS].into();
    let wall_ns = 1_700_000_000_500_000_000;
    Arc::new(PatchSnapshot { sequence, time, wall_ns, seen: true, simulated: false, force, taxels, tare: None })
}

/// The health of an engine with one bus.
pub fn with_a_bus(up: bool) -> Health {
    Health { buses: vec![BusHealth { up, ..BusHealth::default() }], ..Health::default() }
}

/// A set of one true model and otherwise excluded taxels.
pub fn model_set(id: &str, patch: &str) -> Arc<ModelSet> {
    let kpa: Vec<f64> = (0..700).map(|k| f64::from(k) / 10.0).collect();
    let counts: Vec<f64> = kpa.iter().map(|kpa| (240.0 - 80.0 * kpa / (kpa + 40.0)).round()).collect();
    let dead = TaxelModel::without_curve(ModelStatus::Dead { count: 7.0 }, GaugeUncertainty::default());
    let mut taxels = vec![dead; TAXELS];
    taxels[0] = fit(&Samples::new(&counts, &kpa), &FitOptions::default());
    let mut of_taxels = vec![None; TAXELS];
    of_taxels[0] = Some(RecordedTaxel { sensitivity: 0.9, plays: None });
    let recorded = Recorded { smooth_s: 0.5, unloading_share: Some(0.03), taxels: of_taxels, ..Recorded::default() };
    Arc::new(ModelSet {
        id: id.to_owned(),
        patch: patch.to_owned(),
        created_wall_ns: 1_700_000_000_000_000_000,
        session: Some(7),
        method: "order 5, paper".to_owned(),
        board_settings: vec!["board 13".to_owned()],
        baseline: vec![TaxelBaseline { mean: 240.0, noise: 0.5 }; TAXELS],
        pressure_max_kpa: 70.0,
        gauge_gain_rel: 0.01,
        gauge_offset_kpa: 0.1,
        taxels,
        recorded: Some(recorded),
        ..ModelSet::default()
    })
}
