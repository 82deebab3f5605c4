//! The messages of a port, as text: `CONNECT /me`, `r`, then for each a line `do SEQUENCE TIME`, or `d` or `D` alone, and a line of
//! values.

use std::time::Duration;

use tokio::io::{AsyncWriteExt, BufReader};
use tokio::net::TcpStream;
use tokio::time::timeout;

use crate::errors::PortError;
use crate::lines::{read_line, text};
use crate::names::{NameServer, connect};

/// Bytes read at once: several vectors of a whole leg.
const BUFFER_BYTES: usize = 128 * 1024;
/// A header and the values.
const LINES_OF_MESSAGE: usize = 2;

/// What a port sent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Message {
    /// The sender's time, in seconds since 1970; of most ports the time of sending.
    pub stamp_s: Option<f64>,
    /// The values.
    pub line: Vec<u8>,
}

/// A connection to a port that is read.
#[derive(Debug)]
pub struct PortReader {
    port: String,
    stream: BufReader<TcpStream>,
    /// What was read of the line that is being read.
    part: Vec<u8>,
    /// The header of a message whose line is still to come.
    header: Option<Option<f64>>,
}

impl PortReader {
    /// Finds the port and asks for what it sends. `me`: the name under which the port lists this reader.
    ///
    /// # Errors
    /// Why it cannot be read.
    pub async fn open(server: &NameServer, port: &str, me: &str) -> Result<Self, PortError> {
        let contact = server.query(port).await?;
        let opened = async {
            let mut stream = connect(&contact.host, contact.port).await?;
            stream.write_all(format!("CONNECT {me}\nr\n").as_bytes()).await?;
            Ok(BufReader::with_capacity(BUFFER_BYTES, stream))
        };
        match opened.await {
            Ok(stream) => Ok(Self { port: port.to_owned(), stream, part: Vec::new(), header: None }),
            Err(error) => Err(PortError::Unreachable(port.to_owned(), contact.to_string(), error)),
        }
    }

    /// The newest message; those before it that wait already are skipped. May be cancelled.
    ///
    /// # Errors
    /// [`PortError::Silent`] after `wait`, [`PortError::Ended`], [`PortError::NoMessage`].
    pub async fn newest(&mut self, wait: Duration, message: &mut Message) -> Result<(), PortError> {
        let Ok(read) = timeout(wait, self.read(message)).await else {
            return Err(PortError::Silent(self.port.clone(), wait));
        };
        read?;
        while self.stream.buffer().iter().filter(|&&byte| byte == b'\n').count() >= LINES_OF_MESSAGE {
            self.read(message).await?;
        }
        Ok(())
    }

    /// The next message.
    async fn read(&mut self, message: &mut Message) -> Result<(), PortError> {
        loop {
            match read_line(&mut self.stream, &mut self.part).await {
                Ok(true) => {}
                Ok(false) => return Err(PortError::Ended(self.port.clone())),
                Err(error) => return Err(self.no_message(&error.to_string())),
            }
            if let Some(stamp_s) = self.header.take() {
                message.stamp_s = stamp_s;
                std::mem::swap(&mut message.line, &mut self.part);
                self.part.clear();
                return Ok(());
            }
            let line = text(&self.part);
            self.part.clear();
            let mut words = line.split_whitespace();
            match words.next() {
                Some("d" | "D" | "do") => self.header = Some(words.nth(1).and_then(|stamp| stamp.parse().ok())),
                Some("Welcome") | None => {}
                Some(_) => return Err(self.no_message(&line.chars().take(40).collect::<String>())),
            }
        }
    }

    fn no_message(&self, found: &str) -> PortError {
        PortError::NoMessage(self.port.clone(), found.to_owned())
    }
}
