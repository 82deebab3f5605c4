//! The file, section by section. `deploy/taxeld.toml` explains every key; what is absent has the default that it names.

use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Deserialize;

use super::patch_section::PatchSection;

/// The whole file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Where the service listens: `unix:PATH`, `tcp:ADDRESS`, `tls:ADDRESS` or `insecure:ADDRESS`.
    #[serde(default)]
    pub listen: Vec<String>,
    /// The group of the Unix sockets; else that of the daemon.
    pub socket_group: Option<String>,
    /// The files of `tls:`.
    pub tls: Option<TlsSection>,
    /// Who may do what.
    pub access: Option<AccessSection>,
    /// Where sessions and model sets are kept.
    #[serde(default)]
    pub store: StoreSection,
    /// The operator's page, and metrics for Prometheus; none without it.
    pub page: Option<PageSection>,
    /// Pages in shared memory; none without it.
    pub shared_memory: Option<SharedMemorySection>,
    /// Recordings; none without it.
    pub record: Option<RecordSection>,
    /// The buses; a patch names one of them.
    #[serde(default)]
    pub bus: Vec<BusSection>,
    /// The patches.
    #[serde(default)]
    pub patch: Vec<PatchSection>,
}

impl Config {
    /// The key of the section of a patch.
    pub fn patch_key(&self, name: &str) -> String {
        let position = self.patch.iter().position(|patch| patch.name == name);
        position.map_or_else(String::new, |position| format!("patch[{position}]"))
    }
}

/// The path of a file that a configuration names relative to itself.
pub fn beside(config: &Path, file: &Path) -> PathBuf {
    config.parent().unwrap_or(Path::new("")).join(file)
}

/// `[tls]`; paths are relative to the configuration.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TlsSection {
    /// The server's certificate with those up to its authority, PEM.
    pub cert: PathBuf,
    /// Its key, PEM; only its owner may read it.
    pub key: PathBuf,
    /// The authorities of clients' certificates, PEM.
    pub client_ca: PathBuf,
}

/// `[access]`. Each list has accounts (`user:NAME`, `group:NAME`), certificates (`certificate:NAME`) and ways to come in
/// (`unix`, `loopback`, `tls`, `insecure`).
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AccessSection {
    /// Who reads.
    pub observers: Vec<String>,
    /// Who also calibrates.
    pub operators: Vec<String>,
    /// Who also imports and deletes.
    pub admins: Vec<String>,
    /// File with tokens' hashes, relative to the configuration.
    pub tokens: Option<PathBuf>,
}

impl Default for AccessSection {
    fn default() -> Self {
        let observers = ["unix", "loopback", "insecure"].map(str::to_owned).into();
        Self { observers, operators: Vec::new(), admins: Vec::new(), tokens: None }
    }
}

/// `[store]`
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoreSection {
    /// The SQLite file; made if absent. It has to be given: checked with all else, so that its lack hides no other fault.
    #[serde(default)]
    pub path: PathBuf,
    /// Megabytes of it to keep; the oldest sessions go until there are no more.
    pub keep_mb: Option<u64>,
}

impl StoreSection {
    /// How many bytes of it are kept, where there is a limit.
    pub fn kept_bytes(&self) -> Option<u64> {
        self.keep_mb.map(|mb| mb.saturating_mul(1_000_000))
    }

    /// Beyond so many megabytes no session is started and no model set imported: more than what is kept, since an active
    /// model set and what it was made of never go.
    pub fn budget_mb(&self) -> u64 {
        self.keep_mb.map_or(4096, |keep| keep.saturating_add(keep / 4).max(4096))
    }
}

/// `[page]`
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PageSection {
    /// Where it is served; loopback only.
    pub listen: SocketAddr,
    /// Names beside localhost by which it may be asked for: those of a proxy before it.
    pub hosts: Vec<String>,
    /// What is bound to that address already, by the demo: no file says so.
    #[serde(skip)]
    pub bound: Option<Arc<TcpListener>>,
}

impl Default for PageSection {
    fn default() -> Self {
        Self { listen: SocketAddr::from(([127, 0, 0, 1], 8_080)), hosts: Vec::new(), bound: None }
    }
}

/// `[shared_memory]`
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SharedMemorySection {
    /// The folder, on a tmpfs.
    pub path: PathBuf,
    /// The group that reads the pages; else that of the daemon.
    pub group: Option<String>,
}

impl Default for SharedMemorySection {
    fn default() -> Self {
        Self { path: "/dev/shm/taxeld".into(), group: None }
    }
}

/// `[record]`
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordSection {
    /// The folder; made if absent.
    pub path: PathBuf,
    /// Megabytes that all recordings there may take together; the oldest go.
    #[serde(default = "two_gigabytes")]
    pub budget_mb: u64,
    /// Every taxel of every patch, too: several times as much as all else.
    #[serde(default)]
    pub taxels: bool,
}

fn two_gigabytes() -> u64 {
    2048
}

/// `[[bus]]`
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BusSection {
    /// How patches and gauges name it.
    pub name: String,
    /// Where its frames come from.
    #[serde(default)]
    pub source: BusSource,
    /// The network interface, for `socketcan`; in a replay, the interface of the log.
    pub interface: Option<String>,
    /// The name server, `ADDRESS:PORT`, for `yarp`; without it YARP's own files say where it is.
    pub server: Option<String>,
    /// Seed of the simulated skin, for `sim`.
    #[cfg_attr(not(feature = "sim"), allow(dead_code))] // read by the simulator alone
    pub seed: Option<u64>,
}

/// Where frames come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BusSource {
    /// A network interface.
    #[default]
    SocketCan,
    /// The simulator: a forearm in a bag.
    Sim,
    /// Ports of YARP, of which each patch has one.
    Yarp,
    /// None come: a gauge prints text, on a serial device or a connection. Each has a bus of its own, which no file names.
    #[serde(skip)]
    Line,
    /// None come: a program pushes the scans of the one patch that is on it.
    Push,
}
