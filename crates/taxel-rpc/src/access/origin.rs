//! Who is at the other end of a connection, as far as the connection itself proves it.

use std::ffi::CString;
use std::net::{IpAddr, Ipv6Addr, SocketAddr};
use std::sync::Arc;
use std::time::SystemTime;

use nix::unistd::{Gid, Group, Uid, User, getgrouplist};

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
    /// The names by which rules may mean it, as [`uri_name`] and its like make them; the first is the one that is written down.
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
    Tls(SocketAddr, Arc<Certificate>),
}

/// How a URI of a certificate is written. Names of another kind begin with `CN=` or `DNS:`, so that no URI is read as one.
pub(crate) fn uri_name(uri: &str) -> String {
    if has_scheme(uri) { uri.to_owned() } else { format!("URI:{uri}") }
}

/// Whether a text can be a name of a certificate: `CN=ann`, `DNS:robot.example`, `spiffe://robot/operator`, `URI:urn:x`.
///
/// # Errors
/// What was expected.
pub fn check_certificate_name(text: &str) -> Result<(), String> {
    let is_name = ["CN=", "DNS:", "URI:"].iter().any(|kind| text.len() > kind.len() && text.starts_with(kind));
    if is_name || has_scheme(text) {
        return Ok(());
    }
    Err(format!("\"{text}\": expected a URI with ://, `DNS:...` or `CN=...`, or `URI:...` for any other URI"))
}

fn has_scheme(uri: &str) -> bool {
    let lower = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || "+-.".contains(c);
    uri.split_once("://").is_some_and(|(scheme, _)| !scheme.is_empty() && scheme.chars().all(lower))
}

/// Whose share of the service somebody at this address takes. All of this machine are one, since a process may take any of
/// 16 million addresses there; so are all of an IPv6 network of 64 bits, all of whose addresses one host may have.
pub(crate) fn peer_at(address: IpAddr) -> String {
    match address.to_canonical() {
        address if address.is_loopback() => "loopback TCP".to_owned(),
        IpAddr::V6(address) => format!("{}/64", Ipv6Addr::from_bits(address.to_bits() & (!0 << 64))),
        address => address.to_string(),
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

    /// Whose share of the service it takes.
    pub(crate) fn key(&self) -> String {
        match self {
            Self::Unix(account, _) => format!("user id {}", account.uid),
            Self::Loopback(address) | Self::Insecure(address) => peer_at(address.ip()),
            Self::Tls(address, certificate) => match certificate.names.first() {
                Some(name) => format!("certificate {name}"),
                None => peer_at(address.ip()),
            },
        }
    }
}

/// The account of a user. `gid` is the group of the process that asks: all that is known of a user whom the system does not
/// list. It may take long where the system asks a server.
pub(crate) fn look_up(uid: u32, gid: u32) -> Account {
    let user = User::from_uid(Uid::from_raw(uid)).ok().flatten();
    let listed = user.as_ref().and_then(|user| getgrouplist(&CString::new(user.name.clone()).ok()?, user.gid).ok());
    let ids = listed.unwrap_or_else(|| vec![Gid::from_raw(gid)]);
    let groups = ids.into_iter().filter_map(|id| Group::from_gid(id).ok().flatten());
    Account { uid, user: user.map(|user| user.name), groups: groups.map(|group| group.name).collect() }
}

/// The number of a group of this machine.
#[must_use]
pub fn group_id(name: &str) -> Option<u32> {
    Group::from_name(name).ok().flatten().map(|group| group.gid.as_raw())
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

    #[test]
    fn an_account_is_known_with_its_name_and_groups() {
        let root = look_up(0, 0);
        assert_eq!((root.uid, root.user.as_deref()), (0, Some("root")));
        assert!(root.groups.iter().any(|group| group == "root"), "{root:?}");
    }

    /// A program that has taken a group (setgid) says nothing of the other processes of its user.
    #[test]
    fn a_user_whom_nobody_lists_has_the_group_of_each_process_alone() {
        let groups = |gid| look_up(4_000_000_000, gid).groups;
        assert_eq!((groups(0), groups(4_000_000_000)), (vec!["root".to_owned()], vec![]));
    }
}
