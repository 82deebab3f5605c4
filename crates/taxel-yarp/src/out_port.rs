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

use tokio::io::{AsyncWriteExt, BufReader};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Semaphore, watch};
use tokio::task::JoinSet;
use tokio::time::{interval, timeout};

use crate::binary;
use crate::errors::PortError;
use crate::lines::{read_line, text};
use crate::names::{NameServer, connect};
use crate::session::{Wish, answer_to, of_admin, of_word};
use crate::value::Value;

/// Connections to a port at once; YARP's programs open one for a moment.
const CONNECTIONS_MAX: usize = 32;
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
        Ok(contact) => match connect(&contact.host, contact.port).await {
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
    async fn stay_registered(self: Arc<Self>) {
        let mut every = interval(REGISTER_EVERY);
        loop {
            every.tick().await;
            let registered = async {
                take_name(&self.server, &self.name, Some(self.at)).await?;
                self.server.register(&self.name, self.at).await
            };
            if let Err(error) = registered.await {
                tracing::debug!(port = self.name, %error, "not registered");
            }
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

    /// Serves a connection, whichever form it speaks.
    async fn converse(self: &Arc<Self>, stream: TcpStream, peer: IpAddr) -> io::Result<()> {
        stream.set_nodelay(true)?;
        let mut first = [0; 1];
        stream.peek(&mut first).await?;
        let mut stream = BufReader::new(stream);
        if first[0] == binary::FIRST_BYTE {
            return self.in_binary(stream).await;
        }
        let (mut line, mut admin) = (Vec::new(), false);
        if !read_line(&mut stream, &mut line).await? {
            return Ok(());
        }
        let greeting = text(&line);
        let (acknowledges, peer_name) = match (greeting.strip_prefix("CONNACK "), greeting.strip_prefix("CONNECT ")) {
            (Some(name), _) => (true, name),
            (_, Some(name)) => (false, name),
            _ => return Err(io::Error::new(io::ErrorKind::InvalidData, "neither CONNECT nor CONNACK")),
        };
        let peer_name = if peer_name.is_empty() { peer.to_string() } else { peer_name.to_owned() };
        stream.write_all(format!("Welcome {peer_name}\r\n").as_bytes()).await?;
        let mut data = false;
        loop {
            line.clear();
            if !read_line(&mut stream, &mut line).await? {
                return Ok(());
            }
            let said = text(&line);
            let said = said.trim();
            let wish = match (std::mem::take(&mut data), std::mem::take(&mut admin)) {
                (true, _) => continue, // data, for nobody
                (_, true) => {
                    let message = Value::parse(said).unwrap_or_default();
                    let wish = of_admin(&message);
                    let answer = self.admin_answer(&wish, &message).await;
                    stream.write_all(format!("{}\r\n", Value::line(&answer)).as_bytes()).await?;
                    Wish::Nothing
                }
                _ => {
                    (data, admin) = (said == "d" || said.starts_with("do"), said == "a");
                    if data || admin {
                        continue;
                    }
                    let wish = of_word(said);
                    if wish == Wish::Reverse {
                        return self.write_to(peer_name, stream.into_inner()).await;
                    }
                    let answer = self.word_answer(&wish).await;
                    stream.write_all(answer.as_bytes()).await?;
                    wish
                }
            };
            if acknowledges {
                stream.write_all(b"<ACK>\r\n").await?;
            }
            if wish == Wish::Quit {
                return Ok(());
            }
        }
    }

    /// Commands in the binary form, which programs in C++ use where they do not ask for text.
    async fn in_binary(self: &Arc<Self>, mut stream: BufReader<TcpStream>) -> io::Result<()> {
        let acknowledges = binary::greet(&mut stream).await?;
        loop {
            let Some(command) = binary::read_command(&mut stream).await? else { return Ok(()) };
            let answer = match &command {
                binary::Command::Admin(message) => {
                    let wish = of_admin(message);
                    binary::list(&self.admin_answer(&wish, message).await)
                }
                binary::Command::Word(word) => match of_word(word) {
                    Wish::Quit => return Ok(()),
                    wish => binary::list(&[Value::Text(self.word_answer(&wish).await)]),
                },
                binary::Command::Data => Vec::new(),
            };
            if acknowledges {
                stream.write_all(&binary::reply(&answer)).await?;
            }
        }
    }

    /// What the first number of an answer says: 0 if it was done.
    async fn admin_answer(self: &Arc<Self>, wish: &Wish, message: &[Value]) -> Vec<Value> {
        let done = |done: bool, words: String| vec![Value::Int(if done { 0 } else { -1 }), Value::Text(words)];
        match wish {
            Wish::Add(to) => match self.add(to).await {
                Ok(()) => done(true, format!("Added connection from {} to {to}", self.name)),
                Err(error) => done(false, format!("Cannot connect to {to}: {error}")),
            },
            Wish::Remove(to) => match self.remove(to) {
                true => done(true, format!("Removed connection from {} to {to}", self.name)),
                false => done(false, format!("Could not find an outgoing connection to {to}")),
            },
            Wish::ListOut(None) => self.names().into_iter().map(Value::Text).collect(),
            Wish::ListOut(Some(to)) if self.names().contains(to) => {
                let pair = |key: &str, value: &str| {
                    Value::List([key, value].map(|word| Value::Text(word.to_owned())).to_vec())
                };
                vec![pair("from", &self.name), pair("to", to), pair("carrier", "text")]
            }
            Wish::ListOut(Some(_)) => Vec::new(),
            Wish::Nothing | Wish::Reverse | Wish::Quit => answer_to(message),
        }
    }

    async fn word_answer(self: &Arc<Self>, wish: &Wish) -> String {
        match wish {
            Wish::Add(_) | Wish::Remove(_) => {
                let answer = self.admin_answer(wish, &[]).await;
                answer.get(1).and_then(Value::as_text).map_or_else(String::new, |words| format!("{words}\r\n"))
            }
            Wish::Quit => "Bye bye\r\n".to_owned(),
            _ => {
                let mut lines = format!("This is {} at tcp://{}\r\n", self.name, self.at);
                for name in self.names() {
                    lines += &format!("There is an output connection from {} to {name} using text\r\n", self.name);
                }
                lines + "*** end of message\r\n"
            }
        }
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
            let mut stream = connect(&contact.host, contact.port).await?;
            stream.write_all(format!("CONNECT {}\r\n", self.name).as_bytes()).await?;
            Ok(stream)
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
                read = tokio::io::AsyncReadExt::read(&mut stream, &mut said) => match read? {
                    0 => return Ok(()),
                    _ => continue,
                },
            }
            let message = Arc::clone(&newest.borrow_and_update());
            let written = timeout(WRITE_WITHIN, stream.write_all(message.as_bytes())).await;
            written.unwrap_or_else(|_| Err(io::ErrorKind::TimedOut.into()))?;
        }
    }
}
