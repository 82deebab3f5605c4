//! One place where the service listens, as it is configured and shown.

use std::fmt;
use std::net::SocketAddr;
use std::path::PathBuf;

/// One place where the service listens.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Door {
    /// A Unix socket.
    Unix {
        /// Its path.
        path: PathBuf,
        /// Its mode.
        mode: u32,
        /// Its group.
        group: Option<String>,
    },
    /// TCP without encryption; from elsewhere only where that was allowed.
    Tcp(SocketAddr),
    /// TCP with TLS and client certificates.
    Tls {
        /// The address.
        address: SocketAddr,
        /// Certificate, key and the clients' authority.
        files: [PathBuf; 3],
    },
}

impl fmt::Display for Door {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unix { path, mode, .. } => write!(f, "unix:{} (mode {mode:03o})", path.display()),
            Self::Tcp(address) if address.ip().is_loopback() => write!(f, "{address} (loopback, unencrypted)"),
            Self::Tcp(address) => write!(f, "{address} (INSECURE: unencrypted, for everybody on that net)"),
            Self::Tls { address, .. } => write!(f, "{address} (TLS 1.3 with client certificates)"),
        }
    }
}
