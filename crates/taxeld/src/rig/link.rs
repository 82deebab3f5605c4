//! The way to a gauge that talks in text: a serial device or a connection over TCP.

use std::fmt;
use std::fs::{OpenOptions, TryLockError};
use std::io;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use nix::fcntl::OFlag;
use nix::sys::termios::{
    BaudRate, ControlFlags, FlushArg, SetArg, cfmakeraw, cfsetspeed, tcflush, tcgetattr, tcsetattr,
};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::net::unix::pipe::{Receiver, Sender};
use tokio::time::timeout;

/// What micro boards on USB have, most often.
const BAUD_USUAL: u32 = 115_200;
/// What a serial device can be set to.
const BAUD_RATES: [u32; 10] = [1_200, 2_400, 4_800, 9_600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800];

/// A host that is there answers sooner.
const CONNECT_WITHIN: Duration = Duration::from_secs(3);
/// A question has a few bytes.
const WRITE_WITHIN: Duration = Duration::from_secs(1);

/// Where a gauge is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum At {
    /// A device, and its rate.
    Serial(PathBuf, u32),
    /// A host and a port.
    Tcp(String),
}

impl At {
    /// As a configuration writes it.
    ///
    /// # Errors
    /// What was expected.
    pub fn new(text: &str) -> Result<Self, String> {
        let port = |address: &str| address.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_ok());
        match text.strip_prefix("tcp:") {
            Some(address) if port(address) && !address.starts_with(':') => Ok(Self::Tcp(address.to_owned())),
            None if text.starts_with('/') => {
                let (path, baud) = text.rsplit_once('@').unwrap_or((text, ""));
                let baud = if baud.is_empty() { Some(BAUD_USUAL) } else { baud.parse().ok() };
                let known = baud.filter(|baud| BAUD_RATES.contains(baud));
                known
                    .map(|baud| Self::Serial(path.into(), baud))
                    .ok_or_else(|| format!("expected a rate of {BAUD_RATES:?}"))
            }
            _ => {
                Err("expected a device, as in \"/dev/ttyACM0\" or \"/dev/ttyACM0@9600\", or \"tcp:HOST:PORT\""
                    .to_owned())
            }
        }
    }

    /// Opens it.
    ///
    /// # Errors
    /// What the system answers, in words.
    pub async fn open(&self) -> Result<Link, String> {
        let opened = match self {
            Self::Serial(path, baud) => serial(path, *baud),
            Self::Tcp(address) => match timeout(CONNECT_WITHIN, TcpStream::connect(address)).await {
                Ok(connected) => connected.map(|stream| {
                    let (reader, writer) = stream.into_split();
                    Link { reader: Box::new(reader), writer: Box::new(writer) }
                }),
                Err(_) => Err(io::ErrorKind::TimedOut.into()),
            },
        };
        opened.map_err(|error| format!("{self}: {error}"))
    }
}

impl fmt::Display for At {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Serial(path, baud) => write!(f, "{}@{baud}", path.display()),
            Self::Tcp(address) => write!(f, "tcp:{address}"),
        }
    }
}

fn serial(path: &Path, baud: u32) -> io::Result<Link> {
    let flags = OFlag::O_NONBLOCK | OFlag::O_NOCTTY;
    let file = OpenOptions::new().read(true).write(true).custom_flags(flags.bits()).open(path)?;
    // Two readers would have half of the bytes each.
    file.try_lock().map_err(|locked| match locked {
        TryLockError::WouldBlock => io::Error::other("another program has it open"),
        TryLockError::Error(error) => error,
    })?;
    let mut settings = tcgetattr(&file).map_err(|_| io::Error::other("it is no serial device"))?;
    cfmakeraw(&mut settings);
    settings.control_flags |= ControlFlags::CLOCAL | ControlFlags::CREAD;
    // Without a hang-up at the end a micro board does not begin anew each time that it is opened.
    settings.control_flags -= ControlFlags::HUPCL | ControlFlags::CRTSCTS | ControlFlags::CSTOPB | ControlFlags::PARENB;
    cfsetspeed(&mut settings, rate(baud))?;
    tcsetattr(&file, SetArg::TCSANOW, &settings)?;
    tcflush(&file, FlushArg::TCIFLUSH)?; // what came before anybody listened has no time
    // Tokio's pipes take anything that can be waited for, and a serial device can.
    let (reader, writer) = (Receiver::from_file_unchecked(file.try_clone()?)?, Sender::from_file_unchecked(file)?);
    Ok(Link { reader: Box::new(reader), writer: Box::new(writer) })
}

const fn rate(baud: u32) -> BaudRate {
    match baud {
        1_200 => BaudRate::B1200,
        2_400 => BaudRate::B2400,
        4_800 => BaudRate::B4800,
        9_600 => BaudRate::B9600,
        19_200 => BaudRate::B19200,
        38_400 => BaudRate::B38400,
        57_600 => BaudRate::B57600,
        230_400 => BaudRate::B230400,
        460_800 => BaudRate::B460800,
        _ => BaudRate::B115200,
    }
}

/// An open way to a gauge.
pub struct Link {
    reader: Box<dyn AsyncRead + Send + Unpin>,
    writer: Box<dyn AsyncWrite + Send + Unpin>,
}

impl Link {
    /// Waits for bytes. May be cancelled at any time.
    ///
    /// # Errors
    /// What the system answers; also the end of what comes.
    pub async fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.reader.read(buffer).await? {
            0 => Err(io::Error::other("the line has ended: was it unplugged?")),
            count => Ok(count),
        }
    }

    /// Sends a question.
    ///
    /// # Errors
    /// What the system answers, or that nobody takes it.
    pub async fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let written = timeout(WRITE_WITHIN, self.writer.write_all(bytes)).await;
        written.unwrap_or_else(|_| Err(io::ErrorKind::TimedOut.into()))
    }
}
