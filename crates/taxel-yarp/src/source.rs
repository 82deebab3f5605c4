//! Ports as a bus: found by the name server, read, and found again when they end.
//!
//! Each port has a task of its own, so that one that does not answer holds no other up.

use std::time::Duration;

use taxel_can::{Batch, BusEvent, ClockReading, FrameSource, NotSent, SendError, SourceError};
use taxel_skin::Time;
use taxel_wire::{Frame, TimedFrame};
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tokio::time::sleep;

use crate::errors::PortError;
use crate::gauge::GaugeRow;
use crate::names::NameServer;
use crate::reader::{Message, PortReader};
use crate::rows::Rows;
use crate::sender_clock::SenderClock;

/// A port of skin or of a gauge sends many times a second.
const SILENT_AFTER: Duration = Duration::from_secs(2);
/// Pauses between attempts grow from the first to the second, so that a robot that starts is found soon and a name server
/// that is gone costs nothing.
const PAUSES: [Duration; 2] = [Duration::from_millis(250), Duration::from_secs(5)];
/// Messages that may wait for the bus's task. When they do, a port's own wait in its socket, of which the newest is taken.
const WAITING_MAX: usize = 8;

/// What is on a port.
#[derive(Clone, Debug)]
pub enum Content {
    /// Counts of boards.
    Skin(Rows),
    /// A pressure.
    Gauge(GaugeRow),
}

impl Content {
    /// Takes a message that was received at `time`, and appends the frames that it makes.
    ///
    /// # Errors
    /// Why it makes none.
    pub fn take(&mut self, time: Time, line: &[u8], frames: &mut Vec<TimedFrame>) -> Result<(), String> {
        match self {
            Self::Skin(rows) => rows.take(time, line, frames).map_err(|unfit| unfit.to_string()),
            Self::Gauge(row) => row.take(time, line).map(|frame| frames.push(frame)),
        }
    }
}

/// What a port's task tells.
enum Told {
    Counts(Vec<TimedFrame>),
    Pressure(Vec<TimedFrame>),
    Event(BusEvent),
}

/// The ports of a patch as a bus. Nothing can be sent to it.
#[derive(Debug)]
pub struct PortBus {
    told: mpsc::Receiver<Told>,
    /// There is a port of skin and it sends nothing of use: a pressure would say that the bus is up.
    is_down: bool,
    _tasks: JoinSet<()>,
}

impl PortBus {
    /// Reads these ports from now on; needs a running runtime. `server`: `ADDRESS:PORT`; without one YARP's own files say it.
    #[must_use]
    pub fn open(server: Option<&str>, ports: Vec<(String, Content)>) -> Self {
        let (to_bus, told) = mpsc::channel(WAITING_MAX);
        let is_down = ports.iter().any(|(_, content)| matches!(content, Content::Skin(_)));
        let mut tasks = JoinSet::new();
        for (port, content) in ports {
            let to_bus = to_bus.clone();
            let port =
                Port { server: server.map(str::to_owned), port, content, to_bus, is_up: false, told: String::new() };
            tasks.spawn(port.keep());
        }
        Self { told, is_down, _tasks: tasks }
    }
}

impl FrameSource for PortBus {
    async fn next(&mut self, batch: &mut Batch) -> Result<(), SourceError> {
        batch.clear();
        while batch.is_empty() {
            match self.told.recv().await {
                Some(Told::Pressure(_)) if self.is_down => {}
                Some(Told::Counts(frames) | Told::Pressure(frames)) => batch.frames = frames,
                Some(Told::Event(event)) => {
                    self.is_down = event != BusEvent::Up;
                    batch.events.push(event);
                }
                None => std::future::pending().await, // there are no ports
            }
        }
        Ok(())
    }

    async fn send(&mut self, frame: &Frame) -> Result<(), SendError> {
        Err(SendError { id: frame.id, why: NotSent::ListenOnly })
    }
}

/// One port.
struct Port {
    server: Option<String>,
    port: String,
    content: Content,
    to_bus: mpsc::Sender<Told>,
    is_up: bool,
    /// Why no frame can come, as it was told last.
    told: String,
}

/// The bus is dropped.
struct Over;

impl Port {
    async fn keep(mut self) {
        let mut pause = PAUSES[0];
        while !self.to_bus.is_closed() {
            let ended = match self.connect().await {
                Ok(reader) => self.read(reader, &mut pause).await,
                Err(error) => Ok(error),
            };
            let Ok(error) = ended else { return };
            if self.down(error.to_string()).await.is_err() {
                return;
            }
            sleep(pause).await;
            pause = (2 * pause).min(PAUSES[1]);
        }
    }

    async fn connect(&self) -> Result<PortReader, PortError> {
        let server = self.server.as_deref().map_or_else(NameServer::of_files, NameServer::at)?;
        PortReader::open(&server, &self.port, &format!("/taxeld{}", self.port)).await
    }

    /// Reads until the connection ends; gives why.
    async fn read(&mut self, mut reader: PortReader, pause: &mut Duration) -> Result<PortError, Over> {
        if let Content::Skin(rows) = &mut self.content {
            rows.restart();
        }
        let (mut message, mut frames, mut clock) = (Message::default(), Vec::new(), SenderClock::default());
        loop {
            if let Err(error) = reader.newest(SILENT_AFTER, &mut message).await {
                return Ok(error);
            }
            let time = clock.time_of(ClockReading::now().time, message.stamp_s);
            match self.content.take(time, &message.line, &mut frames) {
                Ok(()) => {
                    *pause = PAUSES[0];
                    self.up().await?;
                }
                Err(unfit) => self.down(format!("port {}: {unfit}", self.port)).await?,
            }
            if !frames.is_empty() {
                let frames = std::mem::take(&mut frames);
                self.tell(match self.content {
                    Content::Skin(_) => Told::Counts(frames),
                    Content::Gauge(_) => Told::Pressure(frames),
                })
                .await?;
            }
        }
    }

    async fn up(&mut self) -> Result<(), Over> {
        if std::mem::replace(&mut self.is_up, true) {
            return Ok(());
        }
        self.told.clear();
        if let Content::Skin(_) = self.content {
            return self.tell(Told::Event(BusEvent::Up)).await;
        }
        tracing::info!(port = self.port, "the gauge's port is read");
        Ok(())
    }

    /// Tells why no frame can come, once. A gauge that is silent is no bus that is down; its age is judged where it is used.
    async fn down(&mut self, why: String) -> Result<(), Over> {
        self.is_up = false;
        if why == self.told {
            return Ok(());
        }
        self.told.clone_from(&why);
        if let Content::Skin(_) = self.content {
            return self.tell(Told::Event(BusEvent::SourceDown { why })).await;
        }
        tracing::warn!("the gauge: {why}");
        Ok(())
    }

    async fn tell(&self, told: Told) -> Result<(), Over> {
        self.to_bus.send(told).await.map_err(|_| Over)
    }
}
