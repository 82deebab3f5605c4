//! The name server: where ports are ("The name server protocol").

use std::fmt;
use std::io;
use std::net::{IpAddr, SocketAddr};
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::connection::{ANSWER_WITHIN, Connection, invalid, within};

/// Ports that a name server may list; a robot has a few hundred.
const PORTS_MAX: usize = 20_000;
const END: &str = "*** end of message";

/// Why a port cannot be read, not be found, or not be opened.
#[derive(Debug, Error)]
pub enum PortError {
    /// This file of YARP, which would say where the name server is, cannot be read.
    #[error(
        "no name server is known: {0} cannot be read ({1}); run `yarp conf ADDRESS PORT`, or write server = \"ADDRESS:PORT\""
    )]
    NoConfiguration(String, io::Error),
    /// What stands here, the second, is no address of a name server.
    #[error("{0}: \"{1}\" is no address of a name server, expected ADDRESS:PORT as in 10.0.0.2:10000")]
    Address(String, String),
    /// The name server of this address does not answer, or nothing that makes sense.
    #[error("no name server at {0}: {1}")]
    NoNameServer(String, io::Error),
    /// The name server of this address does not know the port.
    #[error("the name server at {0} knows no port {1}: is the robot's software running?")]
    Unknown(String, String),
    /// The port is registered at this address and cannot be reached.
    #[error("port {0} is registered at {1} and does not answer there: {2}")]
    Unreachable(String, String, io::Error),
    /// The port ended, or sends nothing, or no text of YARP.
    #[error("port {0}: {1}")]
    Lost(String, io::Error),
    /// Another process answers under this name, at this address.
    #[error("the name {0} is another program's, at {1}: end that, or choose another name")]
    Taken(String, String),
}

/// Where a name server is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NameServer {
    host: String,
    port: u16,
}

/// Where a port is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Contact {
    pub name: String,
    /// The machine, as the name server has it.
    pub host: String,
    /// The TCP port.
    pub port: u16,
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
    /// Of `ADDRESS:PORT`; without one as YARP's own programs find it: `yarp conf` wrote a file for each namespace.
    ///
    /// # Errors
    /// [`PortError::NoConfiguration`], [`PortError::Address`].
    pub fn of(address: Option<&str>) -> Result<Self, PortError> {
        if let Some(address) = address {
            let split = address.rsplit_once(':');
            return Self::at(split).ok_or_else(|| PortError::Address("server".to_owned(), address.to_owned()));
        }
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
        let odd = || PortError::Address(file.display().to_string(), content.chars().take(80).collect());
        Self::at(words.next().zip(words.next())).ok_or_else(odd)
    }

    fn at(address: Option<(&str, &str)>) -> Option<Self> {
        let (host, port) = address.filter(|(host, _)| !host.is_empty())?;
        Some(Self { host: host.to_owned(), port: port.parse().ok().filter(|port| *port != 0)? })
    }

    /// Where a port is.
    ///
    /// # Errors
    /// [`PortError::Unknown`], or what is wrong with the name server.
    pub(crate) async fn query(&self, port: &str) -> Result<Contact, PortError> {
        let lines = self.ask(&format!("query {port}")).await?;
        let contact = lines.iter().find_map(|line| contact(line)).filter(|contact| contact.name == port);
        contact.ok_or_else(|| PortError::Unknown(self.to_string(), port.to_owned()))
    }

    /// The names of all ports that are registered.
    ///
    /// # Errors
    /// What is wrong with the name server.
    pub async fn list(&self) -> Result<Vec<String>, PortError> {
        let lines = self.ask("list").await?;
        Ok(lines.iter().filter_map(|line| contact(line)).map(|contact| contact.name).collect())
    }

    /// Registers a port of this machine. Its carrier is text: what programs of YARP send to it is text then, too.
    ///
    /// # Errors
    /// What is wrong with the name server.
    pub(crate) async fn register(&self, port: &str, at: SocketAddr) -> Result<(), PortError> {
        let lines = self.ask(&format!("register {port} text_ack {} {}", at.ip(), at.port())).await?;
        match lines.iter().find_map(|line| contact(line)) {
            Some(contact) if contact.name == port && contact.port == at.port() => Ok(()),
            _ => Err(self.lacking(invalid(format!("it does not register {port}: {lines:.3?}")))),
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
    pub(crate) async fn own_address(&self) -> Result<IpAddr, PortError> {
        let address = async { Connection::open(&self.host, self.port).await?.into_stream().local_addr() }.await;
        address.map(|address| address.ip()).map_err(|error| self.lacking(error))
    }

    /// Asks, and gives the lines of the answer.
    async fn ask(&self, question: &str) -> Result<Vec<String>, PortError> {
        let answer = async {
            let mut connection = Connection::open(&self.host, self.port).await?;
            connection.write(&format!("CONNECT taxeld\nd\n{question}\n")).await?;
            let mut lines = Vec::new();
            while lines.len() < PORTS_MAX {
                match connection.text().await? {
                    end if end == END => return Ok(lines),
                    line => lines.push(line),
                }
            }
            Err(invalid("its answer does not end"))
        };
        within(ANSWER_WITHIN, answer).await.map_err(|error| self.lacking(error))
    }

    fn lacking(&self, error: io::Error) -> PortError {
        PortError::NoNameServer(self.to_string(), error)
    }
}

/// Of `registration name /x ip 10.0.0.2 port 10042 type tcp`.
fn contact(line: &str) -> Option<Contact> {
    let words: Vec<_> = line.split_whitespace().collect();
    let of = |key: &str| words.iter().position(|word| *word == key).and_then(|at| words.get(at + 1));
    let port = of("port")?.parse().ok()?;
    Some(Contact { name: of("name")?.to_string(), host: of("ip")?.to_string(), port })
        .filter(|_| words.first() == Some(&"registration"))
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
        assert_eq!(NameServer::of(Some("10.0.0.2:10000")).unwrap().to_string(), "10.0.0.2:10000");
        for wrong in ["10.0.0.2", ":10000", "host:0", "host:70000", ""] {
            assert!(NameServer::of(Some(wrong)).unwrap_err().to_string().contains("expected ADDRESS:PORT"), "{wrong}");
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
