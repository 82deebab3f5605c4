//! A page on a free port whose engine is the test itself, and a client that writes requests by hand.

pub use std::net::SocketAddr;
pub use std::sync::Arc;
pub use std::sync::atomic::{AtomicI64, Ordering};
pub use std::time::Duration;
pub use taxel_engine::model_set::ModelSet;
pub use taxel_engine::plan::{PatchPlan, Plan};
pub use taxel_engine::snapshot::{BusHealth, ForceSample, ForceState, Health, PatchSnapshot, TaxelState};
pub use taxel_page::{Limits, Options, bind, serve};
pub use taxel_rpc::handle::channel;
pub use taxel_rpc::{Access, Backend, Publisher, Request, Rules, Server};
pub use taxel_skin::{Board, BoardAddress, BusIndex, Module, ModuleKind, Newton, Patch, Time};
pub use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader};
pub use tokio::net::TcpStream;
pub use tokio::sync::mpsc;
pub use tokio_util::sync::CancellationToken;

pub const TAXELS: usize = 20;

/// A running page and all its ends.
pub struct Daemon {
    pub engine: Publisher,
    /// The time by which the engine is judged, in ms.
    pub now_ms: Arc<AtomicI64>,
    pub requests: mpsc::Receiver<Request>,
    pub shutdown: CancellationToken,
    pub address: SocketAddr,
}

/// Limits of which no clock is one: however slow the machine is, nothing is cut off that a test did not ask for.
pub fn patient() -> Limits {
    let hour = Duration::from_secs(3600);
    let connections = taxel_rpc::Limits { check_every: hour, ..Limits::default().connections };
    Limits { connections, head: hour, body: hour, comment: hour, ..Limits::default() }
}

/// The same with so many connections.
pub fn patient_with(connections: usize) -> Limits {
    let connections = taxel_rpc::Limits { connections, ..patient().connections };
    Limits { connections, ..patient() }
}

/// A daemon without a store.
struct NoStore;

impl Backend for NoStore {
    fn read_json(&self, text: &str) -> Result<ModelSet, String> {
        Err(format!("{} bytes", text.len()))
    }
}

pub async fn start() -> Daemon {
    start_with(patient()).await
}

pub async fn start_with(limits: Limits) -> Daemon {
    start_as(limits, Rules::open()).await
}

/// A page whose clients may do what the rules say.
pub async fn start_as(limits: Limits, rules: Rules) -> Daemon {
    let modules = (0..2).map(|m| (Module::from_nibble(m), ModuleKind::Triangle)).collect();
    let board = Board { bus: BusIndex(0), address: BoardAddress::new(13).unwrap(), modules };
    let patch = PatchPlan::new(Patch::new("left_forearm", vec![board]).unwrap());
    let plan = Arc::new(Plan { buses: 1, patches: vec![patch] });
    let now = Arc::new(AtomicI64::new(0));
    let reads = Arc::clone(&now);
    let clock = Arc::new(move || Time::from_nanos(1_000_000 * reads.load(Ordering::Relaxed)));
    let shutdown = CancellationToken::new();
    let (handle, engine, requests) = channel(plan, clock, shutdown.clone());
    let service_limits = taxel_rpc::Limits { command: Duration::from_secs(3600), ..taxel_rpc::Limits::default() };
    let server = Server::new(handle.clone(), Arc::new(NoStore), Access::new(rules), service_limits).unwrap();
    let listener = bind("127.0.0.1:0".parse().unwrap()).unwrap();
    let address = listener.local_addr().unwrap();
    let (services, names) = (server.shared(), vec!["robot.lab".to_owned()]);
    let options = Options { services, handle, names, limits };
    tokio::spawn(server.serve(Vec::new()));
    tokio::spawn(serve(listener, options, shutdown.clone()));
    Daemon { engine, requests, shutdown, address, now_ms: now }
}

/// A snapshot with this number, its total as many newtons.
pub fn snapshot(sequence: u64) -> Arc<PatchSnapshot> {
    let taxel = TaxelState { count: 200, seen: true, calibrated: true, ..TaxelState::default() };
    let force = ForceSample { state: ForceState::Ok, total: Some(Newton(sequence as f64)), ..ForceSample::default() };
    let taxels = vec![taxel; TAXELS].into();
    Arc::new(PatchSnapshot { sequence, seen: true, simulated: true, force, taxels, ..PatchSnapshot::default() })
}

/// What came back.
#[derive(Debug)]
pub struct Answer {
    pub status: u16,
    pub head: String,
    pub body: String,
}

impl Answer {
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(self.body.trim_end_matches("\r\n")).unwrap()
    }
}

impl Daemon {
    pub async fn connect(&self) -> TcpStream {
        TcpStream::connect(self.address).await.unwrap()
    }

    /// Sends these bytes on a connection of their own and reads until the server closes it.
    pub async fn raw(&self, request: &[u8]) -> Answer {
        let mut peer = self.connect().await;
        let _ = peer.write_all(request).await; // the server may answer and close before it has read all
        let mut all = Vec::new();
        let _ = peer.read_to_end(&mut all).await;
        let text = String::from_utf8_lossy(&all).into_owned();
        let (head, body) = text.split_once("\r\n\r\n").unwrap_or((&text, ""));
        let status = head.split(' ').nth(1).and_then(|word| word.parse().ok()).unwrap_or_default();
        Answer { status, head: head.to_ascii_lowercase(), body: body.to_owned() }
    }

    pub async fn get(&self, path: &str) -> Answer {
        self.get_with(path, "").await
    }

    /// `headers` are whole lines.
    pub async fn get_with(&self, path: &str, headers: &str) -> Answer {
        let request = format!("GET {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n{headers}\r\n", self.address);
        self.raw(request.as_bytes()).await
    }

    pub async fn post(&self, path: &str, body: &str) -> Answer {
        self.post_with(path, body, "Content-Type: application/json\r\n").await
    }

    pub async fn post_with(&self, path: &str, body: &str, headers: &str) -> Answer {
        let (address, length) = (self.address, body.len());
        let head = format!("POST {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\nContent-Length: {length}");
        self.raw(format!("{head}\r\n{headers}\r\n{body}").as_bytes()).await
    }

    /// Opens a stream and reads past the head of its answer.
    pub async fn stream(&self, path: &str) -> Events {
        let mut io = self.connect().await;
        let request = format!("GET {path} HTTP/1.1\r\nHost: {}\r\n\r\n", self.address);
        io.write_all(request.as_bytes()).await.unwrap();
        let mut lines = BufReader::new(io);
        let mut head = String::new();
        while !head.ends_with("\r\n\r\n") {
            assert_ne!(lines.read_line(&mut head).await.unwrap(), 0, "{head}");
        }
        Events { head, lines }
    }
}

/// A stream of server-sent events.
pub struct Events {
    pub head: String,
    pub lines: BufReader<TcpStream>,
}

impl Events {
    /// Name and data of the next event.
    pub async fn next(&mut self) -> (String, serde_json::Value) {
        let mut name = String::new();
        loop {
            let mut line = String::new();
            assert_ne!(self.lines.read_line(&mut line).await.unwrap(), 0, "the stream ended");
            if let Some(text) = line.strip_prefix("event: ") {
                name = text.trim().to_owned();
            } else if let Some(data) = line.strip_prefix("data: ") {
                return (name, serde_json::from_str(data).unwrap());
            }
        }
    }
}
