//! The messages of a port, as text: `CONNECT /me`, `r`, then for each a line `do SEQUENCE TIME`, or `d` or `D` alone, and a line of
//! values. Every one is read: a stall of this process leaves them in the socket's buffer, and none is lost.

use std::io;
use std::time::Duration;

use crate::connection::{Connection, invalid, within};
use crate::names::{NameServer, PortError};

/// A port of skin or of a gauge sends many times a second.
const SILENT_AFTER: Duration = Duration::from_secs(2);

/// What a port sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Message<'a> {
    /// The sender's time, in seconds since 1970; of most ports the time of sending.
    pub stamp_s: Option<f64>,
    /// The values.
    pub line: &'a [u8],
}

/// A connection to a port that is read.
#[derive(Debug)]
pub struct PortReader {
    port: String,
    connection: Connection,
}

impl PortReader {
    /// Finds the port and asks for what it sends. The port lists this reader as `/taxeld` and its own name.
    ///
    /// # Errors
    /// Why it cannot be read.
    pub async fn open(server: &NameServer, port: &str) -> Result<Self, PortError> {
        let contact = server.query(port).await?;
        let opened = async {
            let mut connection = Connection::open(&contact.host, contact.port).await?;
            connection.write(&format!("CONNECT /taxeld{port}\nr\n")).await?;
            Ok(connection)
        };
        let unreachable = |error| PortError::Unreachable(port.to_owned(), contact.to_string(), error);
        Ok(Self { port: port.to_owned(), connection: opened.await.map_err(unreachable)? })
    }

    /// The next message.
    ///
    /// # Errors
    /// [`PortError::Lost`]: the connection is of no use any more.
    pub async fn next(&mut self) -> Result<Message<'_>, PortError> {
        within(SILENT_AFTER, message(&mut self.connection)).await.map_err(|error| {
            let why = match error.kind() {
                io::ErrorKind::TimedOut => io::Error::other(format!("nothing came for {} s", SILENT_AFTER.as_secs())),
                _ => error,
            };
            PortError::Lost(self.port.clone(), why)
        })
    }
}

async fn message(connection: &mut Connection) -> io::Result<Message<'_>> {
    let stamp_s = loop {
        let line = connection.text().await?;
        let mut words = line.split_whitespace();
        match words.next() {
            Some("d" | "D" | "do") => break words.nth(1).and_then(|stamp| stamp.parse().ok()),
            Some("Welcome") | None => {}
            Some("q") => return Err(io::ErrorKind::ConnectionAborted.into()), // the port closes
            Some(_) => return Err(invalid(format!("no text of YARP: {}", line.chars().take(40).collect::<String>()))),
        }
    };
    Ok(Message { stamp_s, line: connection.line().await? })
}
