//! The measured daemon: a child process in a folder of its own, which is gone with it.

use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use anyhow::Context;
use taxel_sim::Skin;
use tempfile::TempDir;

/// The thread that plays the bus: none of the daemon's own time.
const SIMULATOR_THREAD: &str = "sim-bus";

/// What an installation asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scene {
    /// Geometry, gauge and every output.
    Full,
    /// The total force and nothing else.
    Lean,
}

/// A folder with a configuration and a store.
pub struct Home {
    folder: TempDir,
    taxeld: PathBuf,
}

impl Home {
    /// For the simulated forearm, with further sections.
    ///
    /// # Errors
    /// If the folder cannot be written.
    pub fn forearm(taxeld: &Path, service: &str, scene: Scene, seed: u64) -> anyhow::Result<Self> {
        let home = Self::with(taxeld, service, &configuration(scene, seed))?;
        std::fs::write(home.path("positions.txt"), Skin::forearm()?.positions_file())?;
        Ok(home)
    }

    /// For any buses and patches: `service` are further sections, `rest` is what follows them. The daemon
    /// listens on loopback TCP, and on the Unix socket that [`Home::socket_address`] names.
    ///
    /// # Errors
    /// If the folder cannot be written.
    pub fn with(taxeld: &Path, service: &str, rest: &str) -> anyhow::Result<Self> {
        let home = Self { folder: tempfile::tempdir()?, taxeld: taxeld.to_owned() };
        let config = format!(
            "listen = [\"tcp:ADDRESS\", \"unix:{}\"]\n[store]\npath = \"{}\"\n{service}\n{rest}",
            home.path("socket").display(),
            home.path("store.db").display(),
        );
        std::fs::write(home.path("template.toml"), config)?;
        Ok(home)
    }

    /// A file in the folder.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Where the daemon serves on a Unix socket.
    #[must_use]
    pub fn socket_address(&self) -> String {
        format!("unix:{}", self.path("socket").display())
    }

    /// Starts the daemon, on the store that an earlier one left.
    ///
    /// # Errors
    /// If it cannot be started.
    pub fn start(&self) -> anyhow::Result<Daemon> {
        // The port is free again when the listener is dropped, and taken by the daemon a moment later.
        let address = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?.local_addr()?;
        let config = std::fs::read_to_string(self.path("template.toml"))?.replace("ADDRESS", &address.to_string());
        let (file, log) = (self.path("taxeld.toml"), self.path("taxeld.log"));
        std::fs::write(&file, config)?;
        let mut command = Command::new(&self.taxeld);
        command.arg("run").arg("--config").arg(&file).env("RUST_LOG", "warn").stdin(Stdio::null());
        command.stdout(Stdio::null()).stderr(std::fs::File::create(&log)?);
        let child = command.spawn().with_context(|| format!("starting {}", self.taxeld.display()))?;
        Ok(Daemon { child, address, log })
    }
}

/// Bus and patch of the simulated forearm.
fn configuration(scene: Scene, seed: u64) -> String {
    let (geometry, gauge) = match scene {
        Scene::Full => (
            "geometry = \"positions.txt\"\noutputs = [\"resultant\", \"moment\", \"contacts\", \"fill\"]\n",
            "gauge = { id = 0x3A1, signal = \"0|32@1-\", unit = \"Pa\" }\n",
        ),
        Scene::Lean => ("", ""),
    };
    format!(
        "[[bus]]\nname = \"skin\"\nsource = \"sim\"\nseed = {seed}\n\
         [[patch]]\nname = \"left_forearm\"\nbus = \"skin\"\n{geometry}\
         boards = [{{ address = 13, modules = \"0-15\" }}, {{ address = 12, modules = \"0-6\" }}]\n{gauge}"
    )
}

/// What a process takes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Used {
    /// Time of all processors together since its start, without the simulated bus.
    pub processor: Duration,
    /// How often one of its threads went to sleep and was woken again, without the simulated bus.
    pub wakes: u64,
    /// Resident memory, MiB.
    pub memory_mib: f64,
    /// Threads that there are.
    pub threads: usize,
    /// Open descriptors.
    pub descriptors: usize,
}

/// A running daemon; it ends when this is dropped.
pub struct Daemon {
    child: Child,
    address: SocketAddr,
    log: PathBuf,
}

impl Daemon {
    /// Where it serves.
    #[must_use]
    pub fn address(&self) -> String {
        format!("http://{}", self.address)
    }

    /// What it had to complain about, for an error's text.
    #[must_use]
    pub fn complaints(&self) -> String {
        std::fs::read_to_string(&self.log).unwrap_or_default().trim().to_owned()
    }

    /// # Errors
    /// If the process is gone.
    pub fn alive(&mut self) -> anyhow::Result<()> {
        match self.child.try_wait()? {
            None => Ok(()),
            Some(status) => anyhow::bail!("taxeld ended with {status}: {}", self.complaints()),
        }
    }

    /// What the process takes.
    ///
    /// # Errors
    /// If `/proc` does not tell.
    pub fn used(&self) -> anyhow::Result<Used> {
        let process = Path::new("/proc").join(self.child.id().to_string());
        let mut used = Used {
            memory_mib: number_in(&std::fs::read_to_string(process.join("status"))?, "VmRSS:")? as f64 / 1024.0,
            descriptors: std::fs::read_dir(process.join("fd"))?.count(),
            ..Used::default()
        };
        for task in std::fs::read_dir(process.join("task"))? {
            let task = task?.path();
            used.threads += 1;
            // A thread that has just ended is not there any more.
            let Ok(name) = std::fs::read_to_string(task.join("comm")) else { continue };
            if name.trim_end() == SIMULATOR_THREAD {
                continue;
            }
            let spent = std::fs::read_to_string(task.join("schedstat")).unwrap_or_default();
            let ns = spent.split_whitespace().next().with_context(|| format!("no schedstat in {}", task.display()))?;
            used.processor += Duration::from_nanos(ns.parse()?);
            let status = std::fs::read_to_string(task.join("status")).unwrap_or_default();
            used.wakes += number_in(&status, "voluntary_ctxt_switches:")?;
        }
        Ok(used)
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        // What it acknowledged is on disk; an error means that it has ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The number behind `name` at the beginning of a line of `/proc/PID/status`.
fn number_in(status: &str, name: &str) -> anyhow::Result<u64> {
    let line =
        status.lines().find_map(|line| line.strip_prefix(name)).with_context(|| format!("no {name} in /proc"))?;
    Ok(line.split_whitespace().next().context("no figure in /proc")?.parse()?)
}
