//! The measured daemon: a child process in a folder of its own, which is gone with it.

use std::fmt::Write as _;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use anyhow::Context;
use taxel_sim::Skin;
use tempfile::TempDir;

use crate::options::Options;

/// Ticks of `/proc/PID/stat` a second, which Linux fixes for all that read it.
const TICKS_PER_S: f64 = 100.0;

/// The thread that plays the bus, in a daemon that has one for it.
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
            scene.configuration(options.seed)
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

impl Scene {
    fn configuration(self, seed: u64) -> String {
        let mut text = format!("[[bus]]\nname = \"skin\"\nsource = \"sim\"\nseed = {seed}\n");
        text.push_str("[[patch]]\nname = \"left_forearm\"\nbus = \"skin\"\n");
        if self == Self::Full {
            let outputs = r#"outputs = ["resultant", "moment", "contacts", "fill"]"#;
            let _ = writeln!(text, "geometry = \"positions.txt\"\n{outputs}"); // a String takes everything
        }
        text.push_str("[[patch.board]]\naddress = 13\nmodules = \"0-15\"\n");
        text.push_str("[[patch.board]]\naddress = 12\nmodules = \"0-6\"\n");
        if self == Self::Full {
            text.push_str("[patch.gauge]\nid = 0x3A1\nlength_bits = 32\nsigned = true\nunit = \"Pa\"\n");
        }
        text
    }
}

/// A running daemon; it ends when this is dropped.
pub struct Daemon {
    child: Child,
    /// Where it serves.
    pub address: SocketAddr,
    log: PathBuf,
}

/// What the process has used since its start.
#[derive(Clone, Copy, Debug, Default)]
pub struct Usage {
    /// Processor time of the whole process.
    total: Duration,
    /// That of the simulated bus, where it has a thread of its own.
    simulator: Option<Duration>,
    /// Of the other threads, in ticks: in the programme and in the kernel.
    ticks: [u64; 2],
    /// How often the other threads went to sleep.
    switches: u64,
}

/// What the daemon itself used in a while, without the simulated bus.
#[derive(Clone, Copy, Debug, Default)]
pub struct Used {
    /// Processor time.
    pub cpu: Duration,
    /// The same in ticks of 10 ms, in the programme and in the kernel; with the simulator's if it has no thread.
    pub ticks: [u64; 2],
    /// How often a thread went to sleep.
    pub switches: u64,
}

impl Usage {
    /// What was used since `before`, which is `elapsed` ago. A simulator without a thread takes its share of a core.
    pub fn since(&self, before: &Self, elapsed: Duration, simulator_share: f64) -> Used {
        let simulator = match (self.simulator, before.simulator) {
            (Some(now), Some(before)) => now.saturating_sub(before),
            _ => elapsed.mul_f64(simulator_share),
        };
        Used {
            cpu: self.total.saturating_sub(before.total).saturating_sub(simulator),
            ticks: [0, 1].map(|mode| self.ticks[mode].saturating_sub(before.ticks[mode])),
            switches: self.switches.saturating_sub(before.switches),
        }
    }
}

impl Used {
    /// Both together.
    pub fn add(&mut self, more: &Self) {
        self.cpu += more.cpu;
        self.ticks = [0, 1].map(|mode| self.ticks[mode] + more.ticks[mode]);
        self.switches += more.switches;
    }
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

    /// # Errors
    /// If `/proc` does not tell.
    pub fn usage(&self) -> anyhow::Result<Usage> {
        let process = PathBuf::from(format!("/proc/{}", self.child.id()));
        let mut usage = Usage::default();
        for task in std::fs::read_dir(process.join("task"))? {
            let task = task?.path();
            // A thread that has just ended is not there any more.
            let Ok(stat) = std::fs::read_to_string(task.join("stat")) else { continue };
            let (name, ticks) = name_and_ticks(&stat).with_context(|| format!("{}: {stat}", task.display()))?;
            let spent = match std::fs::read_to_string(task.join("schedstat")) {
                Ok(text) => Duration::from_nanos(text.split_whitespace().next().context("empty schedstat")?.parse()?),
                Err(_) => Duration::from_secs_f64((ticks[0] + ticks[1]) as f64 / TICKS_PER_S),
            };
            usage.total += spent;
            if name == SIMULATOR_THREAD {
                usage.simulator = Some(spent);
                continue;
            }
            usage.ticks = [0, 1].map(|mode| usage.ticks[mode] + ticks[mode]);
            let status = std::fs::read_to_string(task.join("status")).unwrap_or_default();
            let switches = status.lines().find_map(|line| line.strip_prefix("voluntary_ctxt_switches:"));
            usage.switches += switches.and_then(|count| count.trim().parse().ok()).unwrap_or(0);
        }
        Ok(usage)
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

/// Name of a thread, and its ticks in the programme and in the kernel: fields 2, 14 and 15 of `/proc/PID/stat`.
fn name_and_ticks(stat: &str) -> Option<(&str, [u64; 2])> {
    // The name may hold anything, parentheses too, and ends with the last one.
    let (head, fields) = stat.rsplit_once(')')?;
    let (_, name) = head.split_once('(')?;
    let mut fields = fields.split_whitespace().skip(11).map(|field| field.parse().ok());
    Some((name, [fields.next()??, fields.next()??]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_threads_name_may_hold_parentheses_and_spaces() {
        let stat = "77 (a) b (c) S 1 77 77 0 -1 4194560 100 0 2 0 31 42 0 0 20 0 3 0 55";
        assert_eq!(name_and_ticks(stat), Some(("a) b (c", [31, 42])));
        assert_eq!(name_and_ticks("77 (cut) S 1"), None);
        let own = std::fs::read_to_string("/proc/self/stat").unwrap();
        assert!(name_and_ticks(&own).is_some(), "{own}");
    }

    #[test]
    fn the_simulators_thread_or_share_is_not_the_daemons() {
        let before = Usage { total: Duration::from_millis(100), simulator: None, ticks: [5, 5], switches: 10 };
        let after = Usage { total: Duration::from_millis(160), simulator: None, ticks: [7, 9], switches: 30 };
        let used = after.since(&before, Duration::from_secs(1), 0.01);
        assert_eq!((used.cpu, used.ticks, used.switches), (Duration::from_millis(50), [2, 4], 20));
        let threaded = |usage: Usage, ms| Usage { simulator: Some(Duration::from_millis(ms)), ..usage };
        let used = threaded(after, 40).since(&threaded(before, 10), Duration::from_secs(1), 0.01);
        assert_eq!(used.cpu, Duration::from_millis(30));
    }
}
