//! A TCP connection of lines of text, of a bounded length, with a stranger.

use std::io;
use std::time::Duration;

use tokio::io::{AsyncBufReadExt, AsyncWriteExt, BufReader};
use tokio::net::TcpStream;
use tokio::time::timeout;

/// A name server or a port in the same network answers sooner.
pub(crate) const ANSWER_WITHIN: Duration = Duration::from_secs(3);
/// Longest line: the longest vector of a robot's skin has 1,344 numbers of up to eight bytes.
const LINE_BYTES_MAX: usize = 64 * 1024;

/// One connection.
#[derive(Debug)]
pub(crate) struct Connection {
    stream: BufReader<TcpStream>,
    line: Vec<u8>,
}

impl Connection {
    /// Connects within [`ANSWER_WITHIN`].
    pub async fn open(host: &str, port: u16) -> io::Result<Self> {
        Self::of(within(ANSWER_WITHIN, TcpStream::connect((host, port))).await?)
    }

    /// Of a stream; small messages go at once.
    pub fn of(stream: TcpStream) -> io::Result<Self> {
        stream.set_nodelay(true)?;
        Ok(Self { stream: BufReader::new(stream), line: Vec::new() })
    }

    /// The next line, without its end. A call that is given up may lose a part of it.
    ///
    /// # Errors
    /// What the system says; `UnexpectedEof` at the end, `InvalidData` for a line that is too long.
    pub async fn line(&mut self) -> io::Result<&[u8]> {
        self.line.clear();
        loop {
            let buffer = self.stream.fill_buf().await?;
            if buffer.is_empty() {
                return Err(io::Error::new(io::ErrorKind::UnexpectedEof, "the connection was ended"));
            }
            let end = buffer.iter().position(|&byte| byte == b'\n');
            let used = end.map_or(buffer.len(), |end| end + 1);
            self.line.extend_from_slice(&buffer[..used]);
            self.stream.consume(used);
            if self.line.len() > LINE_BYTES_MAX {
                return Err(invalid("a line of more than 64 KiB"));
            }
            if end.is_some() {
                return Ok(self.line.trim_ascii_end());
            }
        }
    }

    /// The next line as text; what is no UTF-8 is shown as such.
    pub async fn text(&mut self) -> io::Result<String> {
        self.line().await.map(|line| String::from_utf8_lossy(line).into_owned())
    }

    /// Writes a text.
    pub async fn write(&mut self, text: &str) -> io::Result<()> {
        self.stream.write_all(text.as_bytes()).await
    }

    /// The stream, for callers that only write from now on.
    pub fn into_stream(self) -> TcpStream {
        self.stream.into_inner()
    }
}

/// Waits for so long.
pub(crate) async fn within<T>(limit: Duration, what: impl Future<Output = io::Result<T>>) -> io::Result<T> {
    timeout(limit, what).await.unwrap_or_else(|_| Err(io::ErrorKind::TimedOut.into()))
}

/// What came makes no sense.
pub(crate) fn invalid(what: impl Into<String>) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, what.into())
}
