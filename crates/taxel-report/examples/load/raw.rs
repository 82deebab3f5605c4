//! A minimal server on bare tonic: what the daemon is compared with. It judges and computes nothing and has no limits. Its
//! layout is the daemon's own, which is the quickest without anything held: a thread for the bus, one for the engine, one
//! for the service, each asleep until it is woken.

use std::io::{BufRead, BufReader, Write};
use std::net::Ipv4Addr;
use std::path::Path;
use std::pin::Pin;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

use anyhow::Context;
use futures_util::stream::{self, Stream};
use prost::Message;
use taxel_can::ClockReading;
use taxel_proto::v1::force_service_server::{ForceService, ForceServiceServer};
use taxel_proto::v1::{ForceSample, GetForceRequest, StreamForceRequest};
use taxel_ticks::Ticks;
use tokio::sync::{mpsc, watch};
use tonic::transport::Server;
use tonic::transport::server::TcpIncoming;
use tonic::{Request, Response, Status};

/// Of the simulated forearm: so many frames a scan, so far apart, every 50 ms.
const FRAMES: u32 = 46;
const FRAME: Duration = Duration::from_micros(130);
const SCAN: Duration = Duration::from_millis(50);

/// The first argument of this program when it is the server.
pub const ARGUMENT: &str = "raw-server";

/// A scan that is whole: its number, and the stamp of its last frame in ns.
type Scan = Arc<(u64, i64)>;

/// The server as a process, which ends when this is dropped.
pub struct Raw {
    child: Child,
    pub address: String,
}

impl Raw {
    /// Starts it; it sends these messages again and again, with number, stamp and age of its own.
    pub fn start(messages: &[ForceSample], folder: &Path) -> anyhow::Result<Self> {
        let file = folder.join("messages");
        std::fs::write(&file, messages.iter().flat_map(Message::encode_length_delimited_to_vec).collect::<Vec<u8>>())?;
        let mut command = Command::new(std::env::current_exe()?);
        command.arg(ARGUMENT).arg(file).stdin(Stdio::null()).stdout(Stdio::piped());
        let mut child = command.spawn()?;
        let mut line = String::new();
        BufReader::new(child.stdout.take().context("no output")?).read_line(&mut line)?;
        Ok(Self { child, address: format!("http://{}", line.trim()) })
    }
}

impl Drop for Raw {
    fn drop(&mut self) {
        let _ = self.child.kill(); // it may have ended
        let _ = self.child.wait();
    }
}

/// The server itself.
pub fn serve(messages: &Path) -> anyhow::Result<()> {
    let messages = read(messages)?;
    let (to_engine, mut frames) = mpsc::channel(4_505);
    std::thread::spawn(move || bus(&to_engine));
    let (to_service, scans) = watch::channel(Scan::default());
    std::thread::spawn(move || -> anyhow::Result<()> {
        tokio::runtime::Builder::new_current_thread().enable_all().build()?.block_on(async move {
            let (mut batch, mut received) = (Vec::new(), 0);
            while frames.recv_many(&mut batch, 64).await > 0 {
                for stamp in batch.drain(..) {
                    received += 1;
                    if received % u64::from(FRAMES) == 0 {
                        to_service.send_replace(Arc::new((received / u64::from(FRAMES), stamp)));
                    }
                }
            }
        });
        Ok(())
    });
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(async move {
        let incoming = TcpIncoming::bind((Ipv4Addr::LOCALHOST, 0).into())?.with_nodelay(Some(true));
        let mut output = std::io::stdout();
        writeln!(output, "{}", incoming.local_addr()?)?;
        output.flush()?;
        let service = ForceServiceServer::new(Service { messages, scans });
        Server::builder().add_service(service).serve_with_incoming(incoming).await?;
        Ok(())
    })
}

fn read(file: &Path) -> anyhow::Result<Arc<[ForceSample]>> {
    let bytes = std::fs::read(file)?;
    let (mut rest, mut messages) = (bytes.as_slice(), Vec::new());
    while !rest.is_empty() {
        messages.push(ForceSample::decode_length_delimited(&mut rest)?);
    }
    anyhow::ensure!(!messages.is_empty(), "no message");
    Ok(messages.into())
}

/// Hands over frames, each stamped when it is, for ever.
fn bus(to_engine: &mpsc::Sender<i64>) {
    let begun = ClockReading::now().time;
    for scan in 0.. {
        for frame in 0..FRAMES {
            let due = begun + scan * SCAN + frame * FRAME;
            let now = ClockReading::now().time;
            if due > now {
                std::thread::sleep(due.since(now));
            }
            if to_engine.blocking_send(ClockReading::now().time.as_nanos()).is_err() {
                return;
            }
        }
    }
}

struct Service {
    messages: Arc<[ForceSample]>,
    scans: watch::Receiver<Scan>,
}

/// What one subscriber needs.
struct Subscription {
    messages: Arc<[ForceSample]>,
    scans: watch::Receiver<Scan>,
    ticks: Option<Ticks>,
}

impl Subscription {
    fn message(&mut self) -> ForceSample {
        let (sequence, stamp_ns) = **self.scans.borrow_and_update();
        let age_ns = ClockReading::now().time.as_nanos() - stamp_ns;
        let (age_s, monotonic_ns) = (Some(age_ns as f64 * 1e-9), Some(stamp_ns));
        let message = &self.messages[sequence as usize % self.messages.len()];
        ForceSample { sequence, age_s, monotonic_ns, ..message.clone() }
    }
}

#[tonic::async_trait]
impl ForceService for Service {
    async fn get_force(&self, _: Request<GetForceRequest>) -> Result<Response<ForceSample>, Status> {
        Ok(Response::new(self.messages[0].clone()))
    }

    type StreamForceStream = Pin<Box<dyn Stream<Item = Result<ForceSample, Status>> + Send>>;

    async fn stream_force(
        &self,
        request: Request<StreamForceRequest>,
    ) -> Result<Response<Self::StreamForceStream>, Status> {
        let rate_hz = request.into_inner().rate_hz;
        let ticks = rate_hz.map(|hz| Ticks::every(Duration::from_secs_f64(1.0 / hz)));
        let ticks = ticks.transpose().map_err(|error| Status::internal(error.to_string()))?;
        let subscription = Subscription { messages: Arc::clone(&self.messages), scans: self.scans.clone(), ticks };
        Ok(Response::new(Box::pin(stream::unfold(subscription, |mut subscription| async {
            match &mut subscription.ticks {
                Some(ticks) => drop(ticks.tick().await.ok()?),
                None => subscription.scans.changed().await.ok()?,
            }
            Some((Ok(subscription.message()), subscription))
        }))))
    }
}
