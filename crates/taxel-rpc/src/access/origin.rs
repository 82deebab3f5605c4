//! Who is at the other end of a connection, as far as the connection itself proves it.

use std::fmt;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::time::SystemTime;

/// An account of this machine, as the kernel names the peer of a Unix socket.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Account {
    pub(crate) uid: u32,
    /// Its name, if the system knows one.
    pub(crate) user: Option<String>,
    /// The groups that the account is in now.
    pub(crate) groups: Vec<String>,
}

/// What a client certificate that was verified says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Certificate {
    /// The names by which rules may mean it: `spiffe://...` and other URIs as they are, `DNS:...`, `CN=...`.
    pub(crate) names: Vec<String>,
    /// When it expires.
    pub(crate) until: SystemTime,
}

/// The other end of a connection.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Origin {
    /// A process on a Unix socket. The process's number is for the record alone: it may be another one's by now.
    Unix(Arc<Account>, Option<i32>),
    /// Somebody on this machine, over TCP.
    Loopback(SocketAddr),
    /// Somebody elsewhere, over TCP without encryption.
    Insecure(SocketAddr),
    /// Somebody with a certificate.
    #[cfg_attr(not(feature = "tls"), allow(dead_code))] // nobody has one without TLS
    Tls(SocketAddr, Arc<Certificate>),
}

/// Whose share of the service a connection takes.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum PeerKey {
    User(u32),
    Address(IpAddr),
    Certificate(String),
}

impl fmt::Display for PeerKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::User(uid) => write!(f, "user id {uid}"),
            Self::Address(address) => write!(f, "{address}"),
            Self::Certificate(name) => write!(f, "certificate {name}"),
        }
    }
}

impl Origin {
    /// The origin of a TCP connection without TLS.
    pub(crate) fn of_tcp(address: SocketAddr) -> Self {
        if address.ip().to_canonical().is_loopback() { Self::Loopback(address) } else { Self::Insecure(address) }
    }

    /// How it came.
    pub(crate) const fn transport(&self) -> &'static str {
        match self {
            Self::Unix(..) => "unix",
            Self::Loopback(_) => "loopback",
            Self::Insecure(_) => "insecure",
            Self::Tls(..) => "tls",
        }
    }

    /// From where, for the record.
    pub(crate) fn place(&self) -> String {
        match self {
            Self::Unix(account, Some(pid)) => format!("uid {} pid {pid}", account.uid),
            Self::Unix(account, None) => format!("uid {}", account.uid),
            Self::Loopback(address) | Self::Insecure(address) | Self::Tls(address, _) => address.to_string(),
        }
    }

    /// The name that the connection proves: that of the account or of the certificate.
    pub(crate) fn name(&self) -> Option<String> {
        match self {
            Self::Unix(account, _) => Some(account.user.clone().unwrap_or_else(|| format!("uid {}", account.uid))),
            Self::Tls(_, certificate) => certificate.names.first().cloned(),
            Self::Loopback(_) | Self::Insecure(_) => None,
        }
    }

    pub(crate) fn key(&self) -> PeerKey {
        match self {
            Self::Unix(account, _) => PeerKey::User(account.uid),
            Self::Loopback(address) | Self::Insecure(address) => PeerKey::Address(address.ip().to_canonical()),
            Self::Tls(address, certificate) => match certificate.names.first() {
                Some(name) => PeerKey::Certificate(name.clone()),
                None => PeerKey::Address(address.ip().to_canonical()),
            },
        }
    }
}
