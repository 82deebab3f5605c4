//! A port as a bus: found by the name server, read, and found again when it ends.

use taxel_can::{Batch, ClockReading, Pause, Remote, RemoteBus};
use taxel_skin::Time;
use taxel_wire::TimedFrame;

use crate::gauge;
use crate::names::{NameServer, PortError};
use crate::reader::PortReader;
use crate::rows::Rows;
use crate::sender_clock::SenderClock;

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

/// A port that is read.
#[derive(Debug)]
pub struct Port {
    server: Option<String>,
    name: String,
    content: Content,
    reader: Option<(PortReader, SenderClock)>,
}

/// A port as a bus. `server`: `ADDRESS:PORT`; without one YARP's own files say it.
#[must_use]
pub fn port_bus(server: Option<&str>, port: String, content: Content) -> RemoteBus<Port> {
    RemoteBus::new(Port { server: server.map(str::to_owned), name: port, content, reader: None })
}

impl Port {
    async fn connect(&mut self, pause: &mut Pause) -> Result<PortReader, PortError> {
        pause.wait().await;
        PortReader::open(&NameServer::of(self.server.as_deref())?, &self.name).await
    }
}

impl Remote for Port {
    /// One message that does not fit says nothing against the connection: a port that sends such a vector would send it again, and
    /// YARP's ports can hang when connections come and go many times a second.
    async fn more(&mut self, pause: &mut Pause, batch: &mut Batch) -> Result<(), String> {
        if self.reader.is_none() {
            let reader = self.connect(pause).await.map_err(|error| error.to_string())?;
            self.reader = Some((reader, SenderClock::default()));
            if let Content::Skin(rows) = &mut self.content {
                rows.restart();
            }
        }
        let Some((reader, clock)) = &mut self.reader else { return Ok(()) };
        match reader.next().await {
            Ok(message) => {
                pause.end();
                let time = clock.time_of(ClockReading::now().time, message.stamp_s);
                let taken = self.content.take(time, message.line, &mut batch.frames);
                taken.map_err(|unfit| format!("port {}: {unfit}", self.name))
            }
            Err(lost) => {
                self.reader = None;
                Err(lost.to_string())
            }
        }
    }
}
