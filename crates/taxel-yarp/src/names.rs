//! The name server: where ports are ("The name server protocol").

use std::fmt;
use std::io;
use std::net::{IpAddr, SocketAddr};
use std::path::{Path, PathBuf};
use std::time::Duration;

use tokio::io::{AsyncWriteExt, BufReader};
use tokio::net::TcpStream;
use tokio::time::timeout;

use crate::errors::PortError;
use crate::lines::{read_line, text};

/// A name server or a port in the same network answers sooner.
pub(crate) const ANSWER_WITHIN: Duration = Duration::from_secs(3);
/// Ports that a name server may list; a robot has a few hundred.
const PORTS_MAX: usize = 20_000;
const END: &str = "*** end of message";

/// Where a name server is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NameServer {
    host: String,
    port: u16,
}

/// Where a port is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Contact {
    /// Its name.
    pub name: String,
    /// The machine, as the name server has it.
    pub host: String,
    /// The TCP port.
    pub port: u16,
    /// `tcp`, or what else it was registered with.
    pub carrier: String,
}

impl fmt::Display for NameServer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.host, self.port)
    }
}

impl fmt::Display for Contact {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.host, self.port)
    }
}

impl NameServer {
    /// Of `ADDRESS:PORT`.
    ///
    /// # Errors
    /// [`PortError::Address`].
    pub fn at(address: &str) -> Result<Self, PortError> {
        let split = address.rsplit_once(':').and_then(|(host, port)| Some((host, port.parse().ok()?)));
        match split {
            Some((host, port)) if !host.is_empty() && port != 0 => Ok(Self { host: host.to_owned(), port }),
            _ => Err(PortError::Address("server".to_owned(), address.to_owned())),
        }
    }

    /// As YARP's own programs find it: `yarp conf` wrote a file for each namespace.
    ///
    /// # Errors
    /// [`PortError::NoConfiguration`], [`PortError::Address`].
    pub fn of_files() -> Result<Self, PortError> {
        let folder = configuration_folder(|name| std::env::var_os(name).map(PathBuf::from));
        let namespace = std::fs::read_to_string(folder.join("yarp_namespace.conf")).unwrap_or_default();
        let file = folder.join(file_of(namespace.split_whitespace().next().unwrap_or("/root")));
        let content = std::fs::read_to_string(&file)
            .map_err(|error| PortError::NoConfiguration(file.display().to_string(), error))?;
        Self::of_content(&file, &content)
    }

    /// `10.0.0.2 10000 yarp`
    fn of_content(file: &Path, content: &str) -> Result<Self, PortError> {
        let mut words = content.split_whitespace();
        let address = (words.next(), words.next().and_then(|port| port.parse().ok()));
        match address {
            (Some(host), Some(port)) => Ok(Self { host: host.to_owned(), port }),
            _ => Err(PortError::Address(file.display().to_string(), content.chars().take(80).collect())),
        }
    }

    /// Where a port is.
    ///
    /// # Errors
    /// [`PortError::Unknown`], or what is wrong with the name server.
    pub async fn query(&self, port: &str) -> Result<Contact, PortError> {
        let lines = self.ask(&format!("query {port}")).await?;
        let contact = lines.iter().find_map(|line| contact(line)).filter(|contact| contact.name == port);
        contact.ok_or_else(|| PortError::Unknown(self.to_string(), port.to_owned()))
    }

    /// All ports that are registered.
    ///
    /// # Errors
    /// What is wrong with the name server.
    pub async fn list(&self) -> Result<Vec<Contact>, PortError> {
        let lines = self.ask("list").await?;
        Ok(lines.iter().filter_map(|line| contact(line)).collect())
    }

    /// Registers a port of this machine, under the address at which the name server sees it.
    ///
    /// # Errors
    /// What is wrong with the name server.
    pub async fn register(&self, port: &str, at: SocketAddr) -> Result<(), PortError> {
        let lines = self.ask(&format!("register {port} tcp {} {}", at.ip(), at.port())).await?;
        let registered = lines.iter().find_map(|line| contact(line));
        match registered {
            Some(contact) if contact.name == port && contact.port == at.port() => Ok(()),
            _ => Err(self.odd(&lines)),
        }
    }

    /// Takes the name of a port back.
    ///
    /// # Errors
    /// What is wrong with the name server.
    pub async fn unregister(&self, port: &str) -> Result<(), PortError> {
        self.ask(&format!("unregister {port}")).await.map(drop)
    }

    /// The address of this machine towards the name server.
    ///
    /// # Errors
    /// [`PortError::NoNameServer`].
    pub async fn own_address(&self) -> Result<IpAddr, PortError> {
        let address = async { self.connect().await?.local_addr() }.await;
        address.map(|address| address.ip()).map_err(|error| self.lacking(error))
    }

    async fn connect(&self) -> io::Result<TcpStream> {
        connect(&self.host, self.port).await
    }

    /// Asks, and gives the lines of the answer.
    async fn ask(&self, question: &str) -> Result<Vec<String>, PortError> {
        let answer = async {
            let mut stream = BufReader::new(self.connect().await?);
            stream.write_all(format!("CONNECT taxeld\nd\n{question}\n").as_bytes()).await?;
            let (mut lines, mut line) = (Vec::new(), Vec::new());
            while read_line(&mut stream, &mut line).await? && lines.len() < PORTS_MAX {
                let read = text(&line);
                line.clear();
                if read == END {
                    return Ok(lines);
                }
                lines.push(read);
            }
            lines.truncate(3);
            Err(io::Error::new(io::ErrorKind::InvalidData, format!("its answer does not end: {lines:?}")))
        };
        let answer = timeout(ANSWER_WITHIN, answer).await.unwrap_or_else(|_| Err(io::ErrorKind::TimedOut.into()));
        answer.map_err(|error| self.lacking(error))
    }

    fn lacking(&self, error: io::Error) -> PortError {
        PortError::NoNameServer(self.to_string(), error)
    }

    fn odd(&self, lines: &[String]) -> PortError {
        let answer = lines.iter().find(|line| !line.starts_with("Welcome")).cloned().unwrap_or_default();
        PortError::Answer(self.to_string(), answer.chars().take(120).collect())
    }
}

/// Connects within [`ANSWER_WITHIN`]; small messages go at once.
pub(crate) async fn connect(host: &str, port: u16) -> io::Result<TcpStream> {
    let connected = timeout(ANSWER_WITHIN, TcpStream::connect((host, port))).await;
    let stream = connected.unwrap_or_else(|_| Err(io::ErrorKind::TimedOut.into()))?;
    stream.set_nodelay(true)?;
    Ok(stream)
}

/// Of `registration name /x ip 10.0.0.2 port 10042 type tcp`.
fn contact(line: &str) -> Option<Contact> {
    let words: Vec<_> = line.split_whitespace().collect();
    let of = |key: &str| words.iter().position(|word| *word == key).and_then(|at| words.get(at + 1));
    if words.first() != Some(&"registration") {
        return None;
    }
    let port = of("port")?.parse().ok()?;
    let carrier = of("type").map_or_else(String::new, ToString::to_string);
    Some(Contact { name: of("name")?.to_string(), host: of("ip")?.to_string(), port, carrier })
}

fn configuration_folder(variable: impl Fn(&str) -> Option<PathBuf>) -> PathBuf {
    let of_home = || variable("HOME").unwrap_or_default().join(".config");
    variable("YARP_CONFIG_HOME").unwrap_or_else(|| variable("XDG_CONFIG_HOME").unwrap_or_else(of_home).join("yarp"))
}

/// `yarp.conf` of the namespace `/root`, `_lab.conf` of `/lab`.
fn file_of(namespace: &str) -> String {
    match namespace {
        "/root" => "yarp.conf".to_owned(),
        other => format!("{}.conf", other.replace('/', "_")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_and_answers_are_read_as_the_documents_have_them() {
        let answer = "registration name /icub/skin/left_forearm ip 10.0.0.2 port 10042 type tcp";
        let found = contact(answer).unwrap();
        assert_eq!((found.name.as_str(), found.to_string().as_str()), ("/icub/skin/left_forearm", "10.0.0.2:10042"));
        assert_eq!(contact("registration name /x ip none port none type none"), None);
        assert_eq!(NameServer::at("10.0.0.2:10000").unwrap().to_string(), "10.0.0.2:10000");
        for wrong in ["10.0.0.2", ":10000", "host:0", "host:70000", ""] {
            assert!(NameServer::at(wrong).unwrap_err().to_string().contains("expected ADDRESS:PORT"), "{wrong}");
        }
        let file = Path::new("yarp.conf");
        assert_eq!(NameServer::of_content(file, "10.0.0.2 10000 yarp\n").unwrap().to_string(), "10.0.0.2:10000");
        assert!(
            NameServer::of_content(file, "nonsense").unwrap_err().to_string().starts_with("yarp.conf: \"nonsense\"")
        );
    }

    #[test]
    fn the_files_lie_where_yarp_looks_for_them() {
        let with = |names: &'static [(&str, &str)]| {
            configuration_folder(|name| names.iter().find(|(n, _)| *n == name).map(|(_, value)| PathBuf::from(value)))
        };
        assert_eq!(with(&[("HOME", "/home/a")]), Path::new("/home/a/.config/yarp"));
        assert_eq!(with(&[("HOME", "/home/a"), ("XDG_CONFIG_HOME", "/c")]), Path::new("/c/yarp"));
        assert_eq!(with(&[("YARP_CONFIG_HOME", "/y"), ("HOME", "/home/a")]), Path::new("/y"));
        assert_eq!((file_of("/root"), file_of("/lab/one")), ("yarp.conf".to_owned(), "_lab_one.conf".to_owned()));
    }
}
