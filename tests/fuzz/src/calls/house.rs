//! A service whose engine notes what it is asked and refuses nearly all of it.

use std::collections::HashMap;
use std::sync::{Arc, mpsc};
use std::time::Duration;

use prost::Message as _;
use prost_types::FileDescriptorSet;
use taxel_engine::audit::AuditEntry;
use taxel_engine::calibration::SessionView;
use taxel_engine::command::{Command, Done, ErrorReason, Rejection, Reply};
use taxel_engine::known_set::KnownSet;
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::{DevicePlan, PatchPlan, Plan, PushPlan};
use taxel_engine::snapshot::{Catalogue, PatchSnapshot};
use taxel_rpc::handle::{Request, channel};
use taxel_rpc::push_line::{PushLine, Pushed, push_line};
use taxel_rpc::{Access, Backend, Clock, Limits, Listener, Publisher, Rules, Server, SharedServices, Told};
use taxel_skin::{Board, BoardAddress, BusIndex, CountRange, Module, ModuleKind, Patch, Time};
use taxel_store::models_json::{content_id, from_elsewhere, from_json, to_json};
use tokio::runtime::Runtime;
use tokio_util::sync::CancellationToken;

const FOREARM: &str = "left_forearm";
/// A patch whose scans are pushed, twelve bits each.
const GLOVE: &str = "glove";

/// A service that is called without its socket.
pub struct House {
    pub runtime: Runtime,
    pub services: SharedServices,
    /// What reached the engine.
    pub commands: mpsc::Receiver<Command>,
    /// By their names without package and service.
    pub methods: HashMap<String, Method>,
    /// Streams end when it is gone.
    _publisher: Publisher,
}

/// A call of the service.
pub struct Method {
    pub path: String,
    pub asks_stream: bool,
    pub answers_stream: bool,
}

impl House {
    pub fn build() -> Self {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
        let (commands, publisher, services) = runtime.block_on(begin());
        Self { runtime, services, commands, methods: methods(), _publisher: publisher }
    }
}

/// The engine was handed the name of a patch that there is.
pub fn is_patch(name: &str) {
    assert!([FOREARM, GLOVE].contains(&name), "{name:?}");
}

async fn begin() -> (mpsc::Receiver<Command>, Publisher, SharedServices) {
    let plan =
        Arc::new(Plan { buses: 1, patches: vec![PatchPlan::new(patch(FOREARM, 13, ModuleKind::Triangle)), glove()] });
    let clock: Clock = Arc::new(Time::default);
    let (line, pushed) = push_line(plan.patches.len());
    let (handle, publisher, requests) = channel(plan, clock, CancellationToken::new());
    (0..2).for_each(|patch| publisher.patch(patch, Arc::new(PatchSnapshot::default())));
    publisher.catalogue(Arc::new(catalogue()));
    let (note, noted) = mpsc::channel();
    tokio::spawn(answer_all(requests, note));
    tokio::spawn(take_all(pushed));
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let hour = Duration::from_secs(3600); // no clock cuts anything off
    let limits = Limits { command: hour, push_pause: hour, check_every: hour, ..Limits::default() };
    let server = Server::new(handle, Arc::new(Store(line)), Access::new(Rules::open()), limits).expect("a server");
    let services = server.shared();
    tokio::spawn(server.serve(vec![Listener::Tcp(listener)]));
    (noted, publisher, services)
}

/// One session, and one model set, which is in use.
fn catalogue() -> Catalogue {
    let set = from_json(include_str!("../../corpus/models/one")).expect("a model set");
    let set = ModelSet { patch: FOREARM.to_owned(), ..set };
    let set = Arc::new(ModelSet { id: content_id(&set), ..set });
    let session = SessionView { number: 1, patch: FOREARM.to_owned(), ..SessionView::default() };
    Catalogue {
        model_sets: vec![KnownSet::from(Arc::clone(&set))],
        sessions: vec![Arc::new(session)],
        active: vec![(FOREARM.to_owned(), Some(set.id.clone())), (GLOVE.to_owned(), None)],
        ..Catalogue::default()
    }
}

/// An empty store, and the way of pushed scans.
struct Store(PushLine);

impl Backend for Store {
    fn audit(&self, _: u64, _: u32, told: Told<Vec<AuditEntry>>) {
        told(Ok(Vec::new()));
    }

    fn content_id(&self, set: &ModelSet) -> String {
        content_id(set)
    }

    fn to_json(&self, set: &ModelSet) -> Result<String, String> {
        to_json(set).map_err(|error| error.to_string())
    }

    fn read_json(&self, text: &str) -> Result<ModelSet, String> {
        from_json(text).map_err(|error| error.to_string())
    }

    fn read_foreign_json(&self, text: &str) -> Result<ModelSet, String> {
        from_elsewhere(text).map_err(|error| error.to_string())
    }

    fn push_line(&self) -> Option<&PushLine> {
        Some(&self.0)
    }
}

async fn answer_all(mut requests: tokio::sync::mpsc::Receiver<Request>, note: mpsc::Sender<Command>) {
    while let Some(Request { command, reply, .. }) = requests.recv().await {
        let answer = answer(&command);
        if note.send(command).is_err() || reply.send(answer).is_err() {
            tracing::debug!("nobody waits for an answer any more");
        }
    }
}

fn answer(command: &Command) -> Reply {
    match command {
        Command::BeginPush { .. } => Ok(Done::PushBegun),
        Command::Import { model_set, .. } => Ok(Done::Kept { model_set: Arc::clone(model_set).into(), known: false }),
        Command::DeleteSession { .. } | Command::DeleteModelSet { .. } => Ok(Done::Deleted),
        _ => Err(Rejection::FailedPrecondition(ErrorReason::ListenOnly, "nothing is done here".to_owned())),
    }
}

async fn take_all(mut pushed: tokio::sync::mpsc::Receiver<Pushed>) {
    while pushed.recv().await.is_some() {}
}

fn glove() -> PatchPlan {
    let counts = CountRange::to(4095).expect("twelve bits");
    PatchPlan {
        devices: vec![DevicePlan::without_frames()],
        pushed: Some(PushPlan { pressure: true }),
        ..PatchPlan::new(patch(GLOVE, 1, ModuleKind::Cells(2)).with_counts(counts))
    }
}

/// One module of this kind.
fn patch(name: &str, address: u8, kind: ModuleKind) -> Patch {
    let address = BoardAddress::new(address).expect("an address");
    let board = Board { bus: BusIndex(0), address, modules: vec![(Module::from_nibble(0), kind)] };
    Patch::new(name, vec![board]).expect("a patch")
}

/// Every call that the service describes.
fn methods() -> HashMap<String, Method> {
    let files = FileDescriptorSet::decode(taxel_proto::DESCRIPTORS).expect("descriptors").file;
    let services = files.iter().flat_map(|file| file.service.iter().map(|service| (file.package(), service)));
    let of_service = services.flat_map(|(package, service)| {
        service.method.iter().map(move |method| {
            let path = format!("{package}.{}/{}", service.name(), method.name());
            let (asks_stream, answers_stream) = (method.client_streaming(), method.server_streaming());
            (method.name().to_owned(), Method { path, asks_stream, answers_stream })
        })
    });
    of_service.collect()
}
