//! Which listeners leave no room for each other.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use super::door::Door;
use super::file::Config;
use super::page_section::listens;

/// Whether one that listens at the one leaves no room for the other.
pub fn is_same_place(one: &Door, other: &Door) -> bool {
    match (one, other) {
        (Door::Unix { path: one, .. }, Door::Unix { path: other, .. }) => place_of(one) == place_of(other),
        _ => address_of(one).zip(address_of(other)).is_some_and(|(one, other)| overlap(one, other)),
    }
}

/// The path of a socket by its folder's own name: of what two spellings stand for there is one.
fn place_of(path: &Path) -> PathBuf {
    let folder = path.parent().map(|folder| if folder.as_os_str().is_empty() { Path::new(".") } else { folder });
    let folder = folder.and_then(|folder| folder.canonicalize().ok());
    let place = folder.zip(path.file_name()).map(|(folder, name)| folder.join(name));
    place.or_else(|| std::path::absolute(path).ok()).unwrap_or_else(|| path.to_path_buf())
}

fn address_of(door: &Door) -> Option<SocketAddr> {
    match door {
        Door::Unix { .. } => None,
        Door::Tcp(address) | Door::Tls { address, .. } => Some(*address),
    }
}

/// Whether two addresses cannot both be listened at. Port 0 is any that is free; `[::]` has those of IPv4, too, ipv6(7).
fn overlap(one: SocketAddr, other: SocketAddr) -> bool {
    let has = |all: SocketAddr, other: SocketAddr| all.ip().is_unspecified() && (all.is_ipv6() || other.is_ipv4());
    let same_host = one.ip() == other.ip() || has(one, other) || has(other, one);
    one.port() == other.port() && one.port() != 0 && same_host
}

/// Page or metrics where the service listens, too: which key it is, and the address.
pub fn listens_beside(config: &Config, doors: &[Door]) -> Option<(&'static str, SocketAddr)> {
    let page = config.page.as_ref().filter(|page| page.bound.is_none());
    let is_taken = |address: SocketAddr| doors.iter().filter_map(address_of).any(|door| overlap(door, address));
    listens(page, config.metrics.as_ref()).find(|(_, address)| is_taken(*address))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_overlap_as_the_kernel_has_it() {
        let overlap = |one: &str, other: &str| {
            let (one, other) = (one.parse().unwrap(), other.parse().unwrap());
            assert_eq!(overlap(one, other), overlap(other, one));
            overlap(one, other)
        };
        for (one, other, expected) in [
            ("127.0.0.1:9", "127.0.0.1:9", true),
            ("127.0.0.1:9", "127.0.0.2:9", false),
            ("127.0.0.1:9", "127.0.0.1:8", false),
            ("0.0.0.0:9", "127.0.0.1:9", true),
            ("[::]:9", "127.0.0.1:9", true),
            ("[::]:9", "0.0.0.0:9", true),
            ("0.0.0.0:9", "[::1]:9", false),
            ("127.0.0.1:0", "127.0.0.1:0", false),
        ] {
            assert_eq!(overlap(one, other), expected, "{one} and {other}");
        }
    }

    #[test]
    fn a_path_is_one_place_however_it_is_spelt() {
        let folder = tempfile::tempdir().unwrap();
        let (real, link) = (folder.path().join("real"), folder.path().join("link"));
        std::fs::create_dir(&real).unwrap();
        std::os::unix::fs::symlink(&real, &link).unwrap();
        let unix = |path: PathBuf| Door::Unix { path, mode: 0o660, group: None };
        let same = |one: PathBuf, other: PathBuf| is_same_place(&unix(one), &unix(other));
        for other in [link.join("s"), real.join("../real/s"), link.join("../link/./s")] {
            assert!(same(real.join("s"), other.clone()), "{}", other.display());
        }
        assert!(same("s".into(), std::env::current_dir().unwrap().join("s")));
        assert!(!same(real.join("s"), real.join("t")) && !same(real.join("s"), folder.path().join("s")));
        assert!(same("/nowhere/s".into(), "/nowhere/./s".into()) && !same("/nowhere/s".into(), "/nowhere/t".into()));
    }
}
