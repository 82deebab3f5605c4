//! The measured daemon: a child process in a folder of its own, which is gone with it.

use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use anyhow::Context;
use taxel_sim::Skin;
use tempfile::TempDir;

use crate::options::Options;

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
    /// # Errors
    /// If the folder cannot be written.
    pub fn new(options: &Options, scene: Scene) -> anyhow::Result<Self> {
        let home = Self { folder: tempfile::tempdir()?, taxeld: options.taxeld.clone() };
        std::fs::write(home.path("positions.txt"), Skin::forearm()?.positions_file())?;
        let config = format!(
            "[store]\npath = \"{}\"\n[service]\nlisten = \"ADDRESS\"\n{}",
            home.path("store.db").display(),
            configuration(scene, options.seed)
        );
        std::fs::write(home.path("template.toml"), config)?;
        Ok(home)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
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

fn configuration(scene: Scene, seed: u64) -> String {
    let (geometry, gauge) = match scene {
        Scene::Full => (
            "geometry = \"positions.txt\"\noutputs = [\"resultant\", \"moment\", \"contacts\", \"fill\"]\n",
            "[patch.gauge]\nid = 0x3A1\nlength_bits = 32\nsigned = true\nunit = \"Pa\"\n",
        ),
        Scene::Lean => ("", ""),
    };
    format!(
        "[[bus]]\nname = \"skin\"\nsource = \"sim\"\nseed = {seed}\n\
         [[patch]]\nname = \"left_forearm\"\nbus = \"skin\"\n{geometry}\
         [[patch.board]]\naddress = 13\nmodules = \"0-15\"\n[[patch.board]]\naddress = 12\nmodules = \"0-6\"\n{gauge}"
    )
}

/// A running daemon; it ends when this is dropped.
pub struct Daemon {
    child: Child,
    /// Where it serves.
    pub address: SocketAddr,
    log: PathBuf,
}

impl Daemon {
    /// What it had to complain about, for an error's text.
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

    /// Processor time since the start, without that of the simulated bus.
    ///
    /// # Errors
    /// If `/proc` does not tell.
    pub fn cpu(&self) -> anyhow::Result<Duration> {
        let mut total = Duration::ZERO;
        for task in std::fs::read_dir(format!("/proc/{}/task", self.child.id()))? {
            let task = task?.path();
            // A thread that has just ended is not there any more.
            let Ok(name) = std::fs::read_to_string(task.join("comm")) else { continue };
            if name.trim_end() != SIMULATOR_THREAD {
                let spent = std::fs::read_to_string(task.join("schedstat")).unwrap_or_default();
                let ns =
                    spent.split_whitespace().next().with_context(|| format!("no schedstat in {}", task.display()))?;
                total += Duration::from_nanos(ns.parse()?);
            }
        }
        Ok(total)
    }

    /// Resident memory in bytes.
    ///
    /// # Errors
    /// If `/proc` does not tell.
    pub fn resident_bytes(&self) -> anyhow::Result<f64> {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id()))?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).context("no VmRSS in /proc")?;
        let kibibytes: f64 = line.split_whitespace().next().context("no figure behind VmRSS")?.parse()?;
        Ok(kibibytes * 1024.0)
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        // What it acknowledged is on disk; an error means that it has ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
