//! A port as a bus: found by the name server, read, and found again when it ends.

use std::time::Duration;

use taxel_can::{Batch, BusEvent, ClockReading, FrameSource, NotSent, SendError, SourceError};
use taxel_skin::Time;
use taxel_wire::{Frame, TimedFrame};
use tokio::time::sleep;

use crate::gauge;
use crate::names::{NameServer, PortError};
use crate::reader::PortReader;
use crate::rows::Rows;
use crate::sender_clock::SenderClock;

/// Pauses between attempts grow from the first to the second, so that a robot that starts is found soon and a name server
/// that is gone costs nothing.
const PAUSES: [Duration; 2] = [Duration::from_millis(250), Duration::from_secs(5)];

/// What is on a port.
#[derive(Clone, Debug)]
pub enum Content {
    /// Counts of boards.
    Skin(Rows),
    /// Pressures, at these places of its vector.
    Gauge(Vec<usize>),
}

impl Content {
    /// Takes a message that was received at `time`, and appends the frames that it makes.
    ///
    /// # Errors
    /// Why it makes none.
    pub fn take(&mut self, time: Time, line: &[u8], frames: &mut Vec<TimedFrame>) -> Result<(), String> {
        match self {
            Self::Skin(rows) => rows.take(time, line, frames).map_err(|unfit| unfit.to_string()),
            Self::Gauge(indices) => gauge::take(indices, time, line, frames),
        }
    }
}

/// A port as a bus. Nothing can be sent to it.
#[derive(Debug)]
pub struct PortBus {
    server: Option<String>,
    port: String,
    content: Content,
    reader: Option<(PortReader, SenderClock)>,
    /// Before the next attempt to find it.
    pause: Duration,
    /// What was told last: that frames can come, or why not.
    told: Option<BusEvent>,
}

impl PortBus {
    /// Reads this port. `server`: `ADDRESS:PORT`; without one YARP's own files say it.
    #[must_use]
    pub fn new(server: Option<&str>, port: String, content: Content) -> Self {
        Self { server: server.map(str::to_owned), port, content, reader: None, pause: Duration::ZERO, told: None }
    }

    /// After a pause that grows until a message comes.
    async fn connect(&mut self) -> Result<PortReader, PortError> {
        sleep(self.pause).await;
        self.pause = (2 * self.pause).clamp(PAUSES[0], PAUSES[1]);
        PortReader::open(&NameServer::of(self.server.as_deref())?, &self.port).await
    }

    /// Reads a message; or why none came that makes sense. One that does not fit says nothing against the connection: a port that
    /// sends such a vector would send it again, and YARP's ports can hang when connections come and go many times a second.
    async fn message(&mut self, frames: &mut Vec<TimedFrame>) -> Result<(), String> {
        if self.reader.is_none() {
            let reader = self.connect().await.map_err(|error| error.to_string())?;
            self.reader = Some((reader, SenderClock::default()));
            if let Content::Skin(rows) = &mut self.content {
                rows.restart();
            }
        }
        let Some((reader, clock)) = &mut self.reader else { return Ok(()) };
        match reader.next().await {
            Ok(message) => {
                self.pause = Duration::ZERO;
                let time = clock.time_of(ClockReading::now().time, message.stamp_s);
                self.content.take(time, message.line, frames).map_err(|unfit| format!("port {}: {unfit}", self.port))
            }
            Err(lost) => {
                self.reader = None;
                Err(lost.to_string())
            }
        }
    }
}

impl FrameSource for PortBus {
    async fn next(&mut self, batch: &mut Batch) -> Result<(), SourceError> {
        batch.clear();
        while batch.is_empty() {
            let event = match self.message(&mut batch.frames).await {
                Ok(()) => BusEvent::Up,
                Err(why) => BusEvent::SourceDown { why },
            };
            if self.told.as_ref() != Some(&event) {
                self.told = Some(event.clone());
                batch.events.push(event);
            }
        }
        Ok(())
    }

    async fn send(&mut self, frame: &Frame) -> Result<(), SendError> {
        Err(SendError { id: frame.id, why: NotSent::ListenOnly })
    }
}
