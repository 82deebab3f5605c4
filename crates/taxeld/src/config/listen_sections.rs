//! `[[listen]]` and `[access]` as the file has them.

use std::net::SocketAddr;
use std::path::PathBuf;

use serde::Deserialize;
use taxel_rpc::Role;

/// `[[listen]]`: either `unix` or `tcp`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ListenSection {
    /// Path of a Unix socket.
    pub unix: Option<PathBuf>,
    /// Its mode.
    pub mode: Option<u32>,
    /// Its group; else that of the daemon.
    pub group: Option<String>,
    /// A TCP address.
    pub tcp: Option<SocketAddr>,
    /// TLS on it.
    pub tls: Option<TlsSection>,
    /// Whether an address of another machine's reach may go without TLS.
    #[serde(default)]
    pub allow_insecure: bool,
}

/// `tls = { ... }` of a `[[listen]]`; paths are relative to the configuration.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TlsSection {
    /// The server's certificate with those up to its authority, PEM.
    pub certificate: PathBuf,
    /// Its key, PEM; only its owner may read it.
    pub key: PathBuf,
    /// The authorities of clients' certificates, PEM.
    pub client_ca: PathBuf,
}

/// `[access]`. Without it everything is allowed to whoever is on this machine.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AccessSection {
    /// Over TCP from this machine without a token.
    pub loopback: RoleWord,
    /// On the Unix socket, for accounts that no grant names.
    pub unix: RoleWord,
    /// With a certificate that no grant names.
    pub certificate: RoleWord,
    /// Over TCP from elsewhere without TLS.
    pub insecure: RoleWord,
    /// File with tokens' hashes.
    pub tokens: Option<PathBuf>,
    /// Who has which role.
    pub grant: Vec<GrantSection>,
}

impl Default for AccessSection {
    fn default() -> Self {
        let (observer, none) = (RoleWord::Observer, RoleWord::None);
        Self {
            loopback: observer,
            unix: observer,
            certificate: none,
            insecure: observer,
            tokens: None,
            grant: Vec::new(),
        }
    }
}

/// `[[access.grant]]`: one of `user`, `group` and `certificate`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GrantSection {
    /// What they may do.
    pub role: RoleWord,
    /// An account, by name or number.
    pub user: Option<String>,
    /// The accounts of a group.
    pub group: Option<String>,
    /// A name of a client certificate.
    pub certificate: Option<String>,
}

/// A role or none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RoleWord {
    /// Nothing at all.
    None,
    /// Reads.
    Observer,
    /// Also calibrates.
    Operator,
    /// Also imports and deletes.
    Admin,
}

impl RoleWord {
    /// The role, if it is one.
    pub const fn role(self) -> Option<Role> {
        match self {
            Self::None => None,
            Self::Observer => Some(Role::Observer),
            Self::Operator => Some(Role::Operator),
            Self::Admin => Some(Role::Admin),
        }
    }
}
