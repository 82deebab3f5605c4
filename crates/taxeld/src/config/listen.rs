//! Where the service listens, and who may do what there: `listen` and `[access]`, resolved.

use std::fmt;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use taxel_rpc::{Grant, Role, Rules, Subject, TlsFiles, check_certificate_name};

use super::file::{AccessSection, Config, beside};
use taxel_rig::Faults;

/// The mode of a Unix socket: its owner and its group may connect.
pub const SOCKET_MODE: u32 = 0o660;

/// Where the service listens if the configuration says nothing.
const LISTEN_DEFAULT: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(std::net::Ipv4Addr::LOCALHOST), 50_051);

/// Name of the Unix socket in the folder that systemd gives.
const SOCKET_NAME: &str = "taxeld.sock";

/// What is told at the start and by `check` where there are no rules.
pub const UNRULED: &str = "access: there is no [access] section: EVERYBODY ON THIS MACHINE IS ADMINISTRATOR, who may calibrate, import and \
                           delete. To restrict it copy `listen`, `socket_group` and `[access]` from deploy/taxeld.toml; security.md explains them";

/// One place where the service listens.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Door {
    /// A Unix socket.
    Unix(PathBuf),
    /// TCP without encryption; from elsewhere only where that was allowed.
    Tcp(SocketAddr),
    /// TCP with TLS and client certificates.
    Tls {
        /// The address.
        address: SocketAddr,
        /// Certificate, key and the clients' authority.
        files: TlsFiles,
    },
}

impl fmt::Display for Door {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unix(path) => write!(f, "unix:{} (mode {SOCKET_MODE:03o})", path.display()),
            Self::Tcp(address) if address.ip().is_loopback() => write!(f, "{address} (loopback, unencrypted)"),
            Self::Tcp(address) => write!(f, "{address} (INSECURE: unencrypted, for everybody on that net)"),
            Self::Tls { address, .. } => write!(f, "{address} (TLS 1.3 with client certificates)"),
        }
    }
}

/// Where the service listens, and who may do what.
#[derive(Clone, Debug)]
pub struct Doors {
    /// Where.
    pub doors: Vec<Door>,
    /// The group of the Unix sockets.
    pub group: Option<String>,
    /// Who, if the configuration says it; the tokens are read when the daemon starts.
    pub rules: Option<Rules>,
    /// Where the tokens are.
    pub tokens: Option<PathBuf>,
}

impl Doors {
    /// The grants that reach nobody as far as the configuration goes, because an account is known on a Unix socket alone and a
    /// certificate where there is TLS: a line each.
    pub fn unreached_grants(&self) -> Vec<String> {
        let unix = self.doors.iter().any(|door| matches!(door, Door::Unix(_)));
        let tls = self.doors.iter().any(|door| matches!(door, Door::Tls { .. }));
        let of_unix = "a Unix socket: add \"unix:PATH\" to listen, or run it as taxeld.service";
        let unreached = |Grant { subject, role }: &Grant| {
            let (kind, name, place) = match subject {
                Subject::User(name) if !unix => ("user", name.clone(), of_unix),
                Subject::Group(name) if !unix => ("group", name.clone(), of_unix),
                Subject::Certificate(name) if !tls => {
                    ("certificate", name.clone(), "TLS: add \"tls:ADDRESS\" to listen")
                }
                _ => return None,
            };
            Some(format!("access: {kind} {name} is {role} only over {place}"))
        };
        self.rules.iter().flat_map(|rules| &rules.grants).filter_map(unreached).collect()
    }
}

/// Resolves where the service listens; `path` is the configuration's, for files relative to it. What is wrong is noted.
pub fn doors(config: &Config, path: &Path, faults: &mut Faults) -> Doors {
    let mut doors = Vec::new();
    if config.listen.is_empty() {
        // The folder that the service manager has made for sockets, systemd.exec(5): the first if there are several.
        let folders = std::env::var_os("RUNTIME_DIRECTORY").unwrap_or_default();
        let folder = std::env::split_paths(&folders).find(|folder| !folder.as_os_str().is_empty());
        doors.push(Door::Tcp(LISTEN_DEFAULT));
        doors.extend(folder.map(|folder| Door::Unix(folder.join(SOCKET_NAME))));
    }
    for (position, text) in config.listen.iter().enumerate() {
        let key = format!("listen[{position}]");
        let Some(door) = faults.take(&key, door(text, config, path)) else { continue };
        doors.push(door);
    }
    faults.require(
        "listen",
        config.access.is_some() || doors.iter().all(is_near),
        || ": an address for other machines needs an [access] section that says who may do what",
    );
    let tokens = config.access.as_ref().and_then(|access| Some(beside(path, access.tokens.as_deref()?)));
    let rules = config.access.as_ref().map(|access| rules(access, faults));
    Doors { doors, group: config.socket_group.clone(), rules, tokens }
}

/// Where one of `listen` is.
fn door(text: &str, config: &Config, path: &Path) -> Result<Door, String> {
    let wrong = |why: &str| format!("listen \"{text}\": {why}");
    let kinds = "expected unix:PATH, tcp:ADDRESS:PORT, tls:ADDRESS:PORT or insecure:ADDRESS:PORT";
    let (kind, place) = text.split_once(':').ok_or_else(|| wrong(kinds))?;
    if kind == "unix" {
        return match place {
            "" => Err(wrong("expected a path behind unix:")),
            _ => Ok(Door::Unix(beside(path, Path::new(place)))),
        };
    }
    if !["tcp", "tls", "insecure"].contains(&kind) {
        return Err(wrong(kinds));
    }
    let expected = format!("expected an address and a port, as in \"{kind}:127.0.0.1:50051\"");
    let address: SocketAddr = place.parse().map_err(|_| wrong(&expected))?;
    match (kind, &config.tls) {
        ("tls", Some(tls)) => {
            let [certificate, key, client_ca] = [&tls.cert, &tls.key, &tls.client_ca].map(|file| beside(path, file));
            let files = TlsFiles { certificate, key, client_ca };
            Ok(Door::Tls { address, files })
        }
        ("tls", None) => Err(wrong("it needs the section [tls] with cert, key and client_ca")),
        ("tcp", _) if !address.ip().is_loopback() => Err(wrong(
            "only loopback addresses are served without encryption: for other machines write tls:, or insecure: where \
             everybody on that net may read along",
        )),
        _ => Ok(Door::Tcp(address)),
    }
}

/// Whether only this machine reaches it.
fn is_near(door: &Door) -> bool {
    matches!(door, Door::Unix(_)) || matches!(door, Door::Tcp(address) if address.ip().is_loopback())
}

/// The lists of `[access]` as rules: who is in several has the greatest role.
fn rules(access: &AccessSection, faults: &mut Faults) -> Rules {
    let mut rules =
        Rules { grants: Vec::new(), loopback: None, unix: None, certificate: None, insecure: None, ..Rules::default() };
    let lists = [
        ("observers", &access.observers, Role::Observer),
        ("operators", &access.operators, Role::Operator),
        ("admins", &access.admins, Role::Admin),
    ];
    for (list, subjects, role) in lists {
        for (position, text) in subjects.iter().enumerate() {
            let way = match text.as_str() {
                "unix" => &mut rules.unix,
                "loopback" => &mut rules.loopback,
                "tls" => &mut rules.certificate,
                "insecure" => &mut rules.insecure,
                _ => {
                    let subject = subject(text).map_err(|why| format!("access.{list}: \"{text}\": {why}"));
                    let subject = faults.take(&format!("access.{list}[{position}]"), subject);
                    rules.grants.extend(subject.map(|subject| Grant { subject, role }));
                    continue;
                }
            };
            *way = Some(role);
        }
    }
    faults.require("access", rules.insecure <= Some(Role::Observer), || {
        ": insecure: everybody on the network could do it, and nobody would know who did: expected in observers or nowhere"
    });
    rules
}

fn subject(text: &str) -> Result<Subject, String> {
    match text.split_once(':') {
        Some((_, "")) => Err("expected a name behind the colon".to_owned()),
        Some(("user", name)) => Ok(Subject::User(name.to_owned())),
        Some(("group", name)) => Ok(Subject::Group(name.to_owned())),
        Some(("certificate", name)) => {
            check_certificate_name(name)?;
            Ok(Subject::Certificate(name.to_owned()))
        }
        _ => {
            Err("expected user:NAME, group:NAME, certificate:NAME, or a way to come in: unix, loopback, tls, insecure"
                .to_owned())
        }
    }
}

#[cfg(test)]
mod tests;
