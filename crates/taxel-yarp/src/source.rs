//! A port as a bus: found by the name server, read, and found again when it ends.

use std::time::Duration;

use taxel_can::{Batch, BusEvent, ClockReading, FrameSource, SendError, SourceError};
use taxel_wire::Frame;
use tokio::time::{Instant, sleep_until};

use crate::errors::PortError;
use crate::gauge::GaugeRow;
use crate::names::NameServer;
use crate::reader::{Message, PortReader};
use crate::rows::Rows;

/// A port of skin or of a gauge sends many times a second.
const SILENT_AFTER: Duration = Duration::from_secs(2);
/// Pauses between attempts grow from the first to the second, so that a robot that starts is found soon and a name server
/// that is gone costs nothing.
const PAUSES: [Duration; 2] = [Duration::from_millis(250), Duration::from_secs(5)];

/// What is on a port.
#[derive(Clone, Debug)]
pub enum Content {
    /// Counts of boards.
    Skin(Rows),
    /// A pressure.
    Gauge(GaugeRow),
}

/// A port that is read as a bus. Nothing can be sent to it.
#[derive(Debug)]
pub struct PortSource {
    /// `ADDRESS:PORT`; without one YARP's own files say it.
    server: Option<String>,
    port: String,
    content: Content,
    reader: Option<PortReader>,
    message: Message,
    is_up: bool,
    /// Why no frame can come, as it was told last.
    told: String,
    pause: Duration,
    not_before: Option<Instant>,
}

impl PortSource {
    /// Nothing is asked before the first call of `next`.
    #[must_use]
    pub fn new(server: Option<String>, port: String, content: Content) -> Self {
        Self {
            server,
            port,
            content,
            reader: None,
            message: Message::default(),
            is_up: false,
            told: String::new(),
            pause: PAUSES[0],
            not_before: None,
        }
    }

    async fn connect(&self) -> Result<PortReader, PortError> {
        let server = match &self.server {
            Some(address) => NameServer::at(address)?,
            None => NameServer::of_files()?,
        };
        PortReader::open(&server, &self.port, &format!("/taxeld{}", self.port)).await
    }

    /// Takes the newest message; connects first if there is no connection.
    async fn step(&mut self, batch: &mut Batch) -> Result<(), PortError> {
        if let Some(at) = self.not_before {
            sleep_until(at).await;
            self.not_before = None;
        }
        let reader = match &mut self.reader {
            Some(reader) => reader,
            None => {
                let reader = self.connect().await?;
                if let Content::Skin(rows) = &mut self.content {
                    rows.restart();
                }
                self.reader.insert(reader)
            }
        };
        reader.newest(SILENT_AFTER, &mut self.message).await?;
        let (time, line) = (ClockReading::now().time, &self.message.line);
        let taken = match &mut self.content {
            Content::Skin(rows) => rows.take(time, line, &mut batch.frames).map_err(|unfit| unfit.to_string()),
            Content::Gauge(row) => row.take(time, line).map(|frame| batch.frames.push(frame)),
        };
        match taken {
            Ok(()) => {
                self.pause = PAUSES[0];
                if !std::mem::replace(&mut self.is_up, true) {
                    self.told.clear();
                    batch.events.push(BusEvent::Up);
                }
            }
            Err(unfit) => self.down(format!("port {}: {unfit}", self.port), batch),
        }
        Ok(())
    }

    /// Tells why no frame can come, once.
    fn down(&mut self, why: String, batch: &mut Batch) {
        self.is_up = false;
        if why != self.told {
            self.told.clone_from(&why);
            batch.events.push(BusEvent::SourceDown { why });
        }
    }
}

impl FrameSource for PortSource {
    async fn next(&mut self, batch: &mut Batch) -> Result<(), SourceError> {
        batch.clear();
        while batch.is_empty() {
            if let Err(error) = self.step(batch).await {
                self.reader = None;
                self.not_before = Some(Instant::now() + self.pause);
                self.pause = (2 * self.pause).min(PAUSES[1]);
                self.down(error.to_string(), batch);
            }
        }
        Ok(())
    }

    async fn send(&mut self, frame: &Frame) -> Result<(), SendError> {
        Err(SendError::ListenOnly { interface: self.port.clone(), id: frame.id })
    }
}
