//! A port of ours that others read.
//!
//! Each reader has a task of its own, which writes the newest value: what came while a reader was busy is skipped, and one
//! that hangs holds nobody up. A reader comes in two ways: a command to this port has it connect to the reader (that is what
//! `yarp connect` does), or a connection to this port turns round.

use std::collections::BTreeMap;
use std::io;
use std::net::{IpAddr, SocketAddr};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Semaphore, watch};
use tokio::task::JoinSet;
use tokio::time::interval;

use crate::commands::Command;
use crate::connection::{Connection, invalid, within};
use crate::names::{NameServer, PortError};
use crate::value::Value;

/// Connections to a port at once; YARP's programs open one for a moment.
const CONNECTIONS_MAX: usize = 32;
/// Who connects says at once who it is: others would take the place of readers.
const GREETING_WITHIN: Duration = Duration::from_secs(5);
/// Programs that send commands send the next one soon, or connect again.
const COMMAND_WITHIN: Duration = Duration::from_secs(60);
/// A reader that takes nothing for so long is let go.
const WRITE_WITHIN: Duration = Duration::from_secs(10);
/// A name server that was started anew knows the port again after so long.
const REGISTER_EVERY: Duration = Duration::from_secs(5);

/// A message as it is written to a reader that reads text.
type Written = Arc<str>;

/// A port that is written.
#[derive(Debug)]
pub struct OutPort {
    newest: watch::Sender<Written>,
    sequence: u64,
    /// Its tasks end with it.
    _tasks: JoinSet<()>,
}

impl OutPort {
    /// Binds a TCP port, takes the name and serves it until this is dropped.
    ///
    /// # Errors
    /// [`PortError::Taken`] where another process answers under this name; what is wrong with the name server.
    pub async fn open(server: &NameServer, name: &str) -> Result<Self, PortError> {
        let ip = server.own_address().await?;
        take_name(server, name, None).await?;
        let unbound = |error| PortError::Unreachable(name.to_owned(), ip.to_string(), error);
        let listener = TcpListener::bind((ip, 0)).await.map_err(unbound)?;
        let at = listener.local_addr().map_err(unbound)?;
        server.register(name, at).await?;
        let (newest, to_readers) = watch::channel(Written::from(""));
        let port = Arc::new(Port {
            name: name.to_owned(),
            at,
            server: server.clone(),
            newest: to_readers,
            readers: Mutex::default(),
        });
        let mut tasks = JoinSet::new();
        tasks.spawn(Arc::clone(&port).accept(listener));
        tasks.spawn(port.stay_registered());
        Ok(Self { newest, sequence: 0, _tasks: tasks })
    }

    /// Sends a message to all readers. `stamp_s`: the time of what it tells, in seconds since 1970.
    pub fn send(&mut self, stamp_s: f64, message: &[Value]) {
        self.sequence += 1;
        let text = format!("do {} {stamp_s:.6}\r\n{}\r\n", self.sequence, Value::line(message));
        self.newest.send_replace(text.into());
    }
}

/// Whether the name is free, or what it is registered to is dead. `own`: where it may be registered already.
async fn take_name(server: &NameServer, name: &str, own: Option<SocketAddr>) -> Result<(), PortError> {
    match server.query(name).await {
        Err(PortError::Unknown(..)) => Ok(()),
        Err(error) => Err(error),
        Ok(contact) if own.is_some_and(|own| own.port() == contact.port) => Ok(()),
        Ok(contact) => match Connection::open(&contact.host, contact.port).await {
            Ok(_) => Err(PortError::Taken(name.to_owned(), contact.to_string())),
            Err(_) => Ok(()),
        },
    }
}

/// What the tasks of a port share.
#[derive(Debug)]
struct Port {
    name: String,
    at: SocketAddr,
    server: NameServer,
    newest: watch::Receiver<Written>,
    /// By a number of their own, since two may have one name: the name, and what ends it.
    readers: Mutex<BTreeMap<u64, (String, watch::Sender<()>)>>,
}

impl Port {
    /// Keeps the name, and says once when it is lost, and why.
    async fn stay_registered(self: Arc<Self>) {
        let (mut every, mut told) = (interval(REGISTER_EVERY), String::new());
        loop {
            every.tick().await;
            let registered = async {
                take_name(&self.server, &self.name, Some(self.at)).await?;
                self.server.register(&self.name, self.at).await
            };
            let lost = registered.await.map_or_else(|error| error.to_string(), |()| String::new());
            match lost.as_str() {
                same if same == told => {}
                "" => tracing::info!(port = self.name, "registered again"),
                why => tracing::warn!(port = self.name, "not registered any more: {why}"),
            }
            told = lost;
        }
    }

    async fn accept(self: Arc<Self>, listener: TcpListener) {
        let places = Arc::new(Semaphore::new(CONNECTIONS_MAX));
        let mut connections = JoinSet::new();
        loop {
            let Ok((stream, peer)) = listener.accept().await else {
                tokio::time::sleep(Duration::from_millis(100)).await; // no more descriptors
                continue;
            };
            while connections.try_join_next().is_some() {}
            let Ok(place) = Arc::clone(&places).try_acquire_owned() else { continue };
            let port = Arc::clone(&self);
            connections.spawn(async move {
                if let Err(error) = port.converse(stream, peer.ip()).await {
                    tracing::debug!(port = port.name, %peer, %error, "a connection ended");
                }
                drop(place);
            });
        }
    }

    /// Serves a connection.
    async fn converse(self: &Arc<Self>, stream: TcpStream, peer: IpAddr) -> io::Result<()> {
        let mut connection = Connection::of(stream)?;
        let greeting = within(GREETING_WITHIN, connection.text()).await?;
        let (acknowledges, name) = match (greeting.strip_prefix("CONNACK "), greeting.strip_prefix("CONNECT ")) {
            (Some(name), _) => (true, name),
            (_, Some(name)) => (false, name),
            _ => return Err(invalid("neither CONNECT nor CONNACK")),
        };
        let name = if name.is_empty() { peer.to_string() } else { name.to_owned() };
        connection.write(&format!("Welcome {name}\r\n")).await?;
        loop {
            let said = within(COMMAND_WITHIN, connection.text()).await?;
            let answer = match said.split_whitespace().next() {
                Some("r") => return self.write_to(name, connection.into_stream()).await,
                Some("q") => return Ok(()),
                Some("a") => {
                    let command = within(COMMAND_WITHIN, connection.text()).await?;
                    self.administer(&Command::of(&command)).await
                }
                Some("d" | "D" | "do") => {
                    within(COMMAND_WITHIN, connection.line()).await?; // for nobody
                    String::new()
                }
                _ => self.about(),
            };
            connection.write(&format!("{answer}{}", if acknowledges { "<ACK>\r\n" } else { "" })).await?;
        }
    }

    /// Does what a command wants, and says so: of what is to be done a number first, 0 if it was.
    async fn administer(self: &Arc<Self>, command: &Command) -> String {
        let own = &self.name;
        match command {
            Command::Add(to) => match self.add(to).await {
                Ok(()) => format!("0 \"Added connection from {own} to {to}\"\r\n"),
                Err(error) => format!("-1 \"Cannot connect to {to}: {}\"\r\n", error.to_string().replace('"', "'")),
            },
            Command::Remove(to) if self.remove(to) => format!("0 \"Removed connection from {own} to {to}\"\r\n"),
            Command::Remove(to) => format!("-1 \"Could not find an outgoing connection to {to}\"\r\n"),
            Command::Readers => format!("{}\r\n", self.names().join(" ")),
            Command::Reader(to) if self.names().contains(to) => {
                format!("(from {own}) (to {to}) (carrier text)\r\n")
            }
            Command::Reader(_) | Command::Senders => "\r\n".to_owned(),
            Command::Version => "ver 1 2 3\r\n".to_owned(),
            Command::Other => "-1 \"not understood\"\r\n".to_owned(),
        }
    }

    /// What is said to a `yarp ping`.
    fn about(&self) -> String {
        let name = &self.name;
        let reader = |to: &String| format!("There is an output connection from {name} to {to} using text\r\n");
        let readers: String = self.names().iter().map(reader).collect();
        format!("This is {name} at tcp://{}\r\n{readers}*** end of message\r\n", self.at)
    }

    fn names(&self) -> Vec<String> {
        self.readers.lock().unwrap_or_else(PoisonError::into_inner).values().map(|(name, _)| name.clone()).collect()
    }

    /// Ends all readers of this name; gives whether there was one.
    fn remove(&self, reader: &str) -> bool {
        let mut readers = self.readers.lock().unwrap_or_else(PoisonError::into_inner);
        let before = readers.len();
        readers.retain(|_, (name, _)| name != reader);
        readers.len() < before
    }

    /// Connects to a port that wants to read this one.
    async fn add(self: &Arc<Self>, reader: &str) -> Result<(), PortError> {
        if self.names().iter().any(|name| name == reader) {
            return Ok(());
        }
        let contact = self.server.query(reader).await?;
        let opened = async {
            let mut connection = Connection::open(&contact.host, contact.port).await?;
            connection.write(&format!("CONNECT {}\r\n", self.name)).await?;
            Ok(connection.into_stream())
        };
        let unreachable = |error| PortError::Unreachable(reader.to_owned(), contact.to_string(), error);
        let stream = opened.await.map_err(unreachable)?;
        let (port, reader) = (Arc::clone(self), reader.to_owned());
        tokio::spawn(async move {
            if let Err(error) = port.write_to(reader.clone(), stream).await {
                tracing::debug!(port = port.name, reader, %error, "a reader is gone");
            }
        });
        Ok(())
    }

    /// Writes to a reader until it is removed or takes nothing any more.
    async fn write_to(&self, reader: String, stream: TcpStream) -> io::Result<()> {
        let (end, ended) = watch::channel(());
        let number = {
            let mut readers = self.readers.lock().unwrap_or_else(PoisonError::into_inner);
            let number = readers.last_key_value().map_or(0, |(last, _)| last + 1);
            readers.insert(number, (reader, end));
            number
        };
        let written = self.write_on(stream, ended).await;
        self.readers.lock().unwrap_or_else(PoisonError::into_inner).remove(&number);
        written
    }

    /// Writes each newest message.
    async fn write_on(&self, mut stream: TcpStream, mut ended: watch::Receiver<()>) -> io::Result<()> {
        let mut newest = self.newest.clone();
        let mut said = [0; 256];
        loop {
            tokio::select! {
                changed = newest.changed() => if changed.is_err() { return Ok(()) },
                _ = ended.changed() => return Ok(()),
                // What a reader says, its welcome for one, is of no concern; that it is gone is.
                read = stream.read(&mut said) => match read? {
                    0 => return Ok(()),
                    _ => continue,
                },
            }
            let message = Arc::clone(&newest.borrow_and_update());
            within(WRITE_WITHIN, stream.write_all(message.as_bytes())).await?;
        }
    }
}
