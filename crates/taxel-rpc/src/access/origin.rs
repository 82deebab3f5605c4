//! Who is at the other end of a connection, as far as the connection itself proves it.

use std::fmt;
use std::net::{IpAddr, Ipv6Addr, SocketAddr};
use std::sync::Arc;
use std::time::SystemTime;

use crate::access::certificate_name::CertificateName;

/// An account of this machine, as the kernel names the peer of a Unix socket.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Account {
    pub(crate) uid: u32,
    /// Its name, if the system knows one.
    pub(crate) user: Option<String>,
    /// The groups that the account is in now.
    pub(crate) groups: Vec<String>,
}

impl Account {
    /// One of which nothing but its number is known.
    pub(crate) const fn nameless(uid: u32) -> Self {
        Self { uid, user: None, groups: Vec::new() }
    }
}

/// What a client certificate that was verified says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Certificate {
    /// The names by which rules may mean it; the first is the one that is written down.
    pub(crate) names: Vec<CertificateName>,
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
    /// Whoever comes over TCP from this machine: a process may take any of 16 million addresses there.
    Loopback,
    /// An address elsewhere; of IPv6 the network of 64 bits, all of whose addresses one host may have.
    Address(IpAddr),
    Certificate(CertificateName),
    /// The holder of a token, from wherever a call comes. Connections are never so: a token comes with a call.
    Token(Arc<str>),
}

impl PeerKey {
    pub(crate) fn of(address: IpAddr) -> Self {
        match address.to_canonical() {
            address if address.is_loopback() => Self::Loopback,
            IpAddr::V6(address) => Self::Address(Ipv6Addr::from_bits(address.to_bits() & (!0 << 64)).into()),
            address => Self::Address(address),
        }
    }
}

impl fmt::Display for PeerKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::User(uid) => write!(f, "user id {uid}"),
            Self::Loopback => write!(f, "loopback TCP"),
            Self::Address(IpAddr::V6(network)) => write!(f, "{network}/64"),
            Self::Address(address) => write!(f, "{address}"),
            Self::Certificate(name) => write!(f, "certificate {name}"),
            Self::Token(name) => write!(f, "token {}", name.escape_debug()),
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
            Self::Tls(_, certificate) => certificate.names.first().map(CertificateName::to_string),
            Self::Loopback(_) | Self::Insecure(_) => None,
        }
    }

    pub(crate) fn key(&self) -> PeerKey {
        match self {
            Self::Unix(account, _) => PeerKey::User(account.uid),
            Self::Loopback(address) | Self::Insecure(address) => PeerKey::of(address.ip()),
            Self::Tls(address, certificate) => match certificate.names.first() {
                Some(name) => PeerKey::Certificate(name.clone()),
                None => PeerKey::of(address.ip()),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_host_is_one_peer_whichever_of_its_addresses_it_comes_from() {
        let key = |address: &str| Origin::of_tcp(address.parse().unwrap()).key();
        for other in ["127.0.0.2:1", "127.255.255.254:9", "[::1]:1", "[::ffff:127.0.0.3]:1"] {
            assert_eq!(key("127.0.0.1:1"), key(other), "{other}");
        }
        assert_eq!(key("[2001:db8::1]:1"), key("[2001:db8::ffff:1:2:3]:2"));
        assert_ne!(key("[2001:db8::1]:1"), key("[2001:db8:0:1::1]:1"));
        assert_ne!(key("192.0.2.1:1"), key("192.0.2.2:1"));
        assert_eq!(key("[::ffff:192.0.2.1]:1"), key("192.0.2.1:1"));
        assert_eq!(key("[2001:db8::5]:1").to_string(), "2001:db8::/64");
        assert_eq!(key("192.0.2.1:1").to_string(), "192.0.2.1");
        assert_eq!(key("127.0.0.1:1").to_string(), "loopback TCP");
    }

    /// Where the kernel does not say which process it is.
    #[test]
    fn an_account_without_a_process_or_a_name_is_its_number() {
        let account = Account { uid: 1004, user: None, groups: Vec::new() };
        let origin = Origin::Unix(Arc::new(account), None);
        assert_eq!((origin.place().as_str(), origin.name().as_deref()), ("uid 1004", Some("uid 1004")));
        assert_eq!((origin.transport(), origin.key().to_string().as_str()), ("unix", "user id 1004"));
        let remote = Origin::of_tcp("192.0.2.1:5".parse().unwrap());
        assert_eq!((remote.transport(), remote.name(), remote.place().as_str()), ("insecure", None, "192.0.2.1:5"));
    }
}
