//! Commands as processes, and the files that they are given.

pub use std::fmt::Write as _;
pub use std::io::{BufRead, BufReader, Read};
pub use std::net::{Ipv4Addr, SocketAddr, TcpListener};
pub use std::path::{Path, PathBuf};
pub use std::process::{Child, Command, Output, Stdio};
pub use std::time::{Duration, Instant};
pub use taxel_proto::v1;
pub use taxel_proto::v1::skin_service_client::SkinServiceClient;
pub use tempfile::TempDir;
pub use tonic::{Code, Status, Streaming};

/// Two triangles on a bus that is only listened to, and a gauge.
pub const CONFIG: &str = r#"
[store]
path = "t.db"
[[bus]]
name = "skin"
interface = "can0"
[[patch]]
name = "palm"
bus = "skin"
listen_only = true
boards = [{ address = 13, modules = "0-1" }]
gauge = { id = 0x3A1, signal = "0|32@1-", unit = "Pa", noise_kpa = 0.02 }
"#;

/// A process that ends with its test.
pub struct Ended(pub Child);

impl Drop for Ended {
    fn drop(&mut self) {
        let _ = self.0.kill(); // it may have ended
        let _ = self.0.wait();
    }
}

impl Ended {
    /// Sends a signal such as `-HUP`.
    pub fn signal(&self, name: &str) {
        assert!(Command::new("kill").args([name, &self.0.id().to_string()]).status().unwrap().success(), "{name}");
    }
}

/// An address that is free now; the daemon takes it a moment later.
pub fn free_address() -> SocketAddr {
    TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap().local_addr().unwrap()
}

/// Lines of a scan of [`frames`].
pub const SCAN_LINES: usize = 5;

/// The frames of 640 scans of twenty taxels, one every 50 ms, that lose one count a kPa: at rest for 1.5 s, then 2.5 kPa/s
/// up to 76 kPa. With the times in microseconds at which they came, the first at 0.
pub fn frames() -> Vec<(u64, String)> {
    let mut frames = Vec::new();
    for scan in 0..640_u32 {
        let kpa = 2.5 * (f64::from(scan) * 0.05 - 1.5).max(0.0);
        let pascal: String = ((kpa * 1000.0) as i32).to_le_bytes().iter().map(|b| format!("{b:02X}")).collect();
        let mut of_scan = vec![format!("3A1#{pascal}")];
        for module in 0..2 {
            // Pressure does not reach the two thermal pads.
            let pressed = |k: u32| if matches!(k, 6 | 10) { 0.0 } else { kpa };
            let count =
                |k: u32| (240.0 - pressed(k) + f64::from((scan * 7 + k * 3) % 3) - 1.0).clamp(0.0, 255.0).round() as u8;
            let hex = |from: u32, to: u32| (from..to).map(|k| format!("{:02X}", count(k))).collect::<String>();
            of_scan.push(format!("4D{module}#40{}", hex(0, 7)));
            of_scan.push(format!("4D{module}#C0{}0000", hex(7, 12)));
        }
        let at = |line: usize| u64::from(scan) * 50_000 + line as u64 * 120;
        frames.extend(of_scan.into_iter().enumerate().map(|(line, frame)| (at(line), frame)));
    }
    frames
}

/// A log of these frames; `begin_s` says from when on the clock counts at each line, from 0.
pub fn log(frames: &[(u64, String)], begin_s: impl Fn(usize) -> u64) -> String {
    let mut log = String::new();
    for (line, (at_us, frame)) in frames.iter().enumerate() {
        let time_us = begin_s(line) * 1_000_000 + at_us;
        writeln!(log, "({}.{:06}) can0 {frame}", time_us / 1_000_000, time_us % 1_000_000).unwrap();
    }
    log
}

/// Runs a command to its end; its standard input is empty.
pub fn taxeld(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_taxeld")).args(arguments).stdin(Stdio::piped()).output().unwrap()
}

/// How long a busy machine may take for anything.
pub const PATIENCE: Duration = Duration::from_secs(180);

/// Runs a command in a folder, against the daemon whose socket is there.
pub fn taxeld_in(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_taxeld"));
    let server = format!("unix:{}", folder.join("s").display());
    command.args(arguments).env("TAXELD_SERVER", server).current_dir(folder).stdin(Stdio::null());
    command.output().unwrap()
}

/// Runs such a command until it is done; what it prints then.
pub fn until(folder: &Path, arguments: &[&str], done: impl Fn(&Output) -> bool) -> String {
    let begun = Instant::now();
    loop {
        let output = taxeld_in(folder, arguments);
        if done(&output) {
            return text(&output.stdout);
        }
        assert!(begun.elapsed() < PATIENCE, "{arguments:?}: {output:?}");
        std::thread::yield_now();
    }
}

/// A daemon of this configuration, which has its socket in the folder and answers.
pub fn run_in(folder: &Path, config: &str) -> Ended {
    std::fs::write(folder.join("taxeld.toml"), config).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_taxeld"));
    command.args(["run", "--config", "taxeld.toml"]).current_dir(folder).stderr(Stdio::null());
    let daemon = Ended(command.spawn().unwrap());
    until(folder, &["sessions", "list"], |output| output.status.success());
    daemon
}

/// Waits until the log in the folder says so: a thread of its own writes it, some time after what it tells of. Its whole lines.
pub fn until_logged(folder: &Path, text: &str) -> String {
    let begun = Instant::now();
    loop {
        let log = std::fs::read_to_string(folder.join("log")).unwrap();
        match log.rsplit_once('\n') {
            Some((lines, _)) if lines.contains(text) => return lines.to_owned(),
            _ => assert!(begun.elapsed() < PATIENCE, "no `{text}` in {log}"),
        }
        std::thread::yield_now();
    }
}

/// What a process wrote.
pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// What a command that must succeed prints.
pub fn succeeds(arguments: &[&str]) -> String {
    let output = taxeld(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
    text(&output.stdout)
}

/// What a command that must fail says.
pub fn fails(arguments: &[&str]) -> String {
    let output = taxeld(arguments);
    assert!(!output.status.success(), "{arguments:?} succeeded: {}", text(&output.stdout));
    text(&output.stderr)
}

/// A folder with these files.
pub fn scratch(files: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        std::fs::write(folder.path().join(name), content).unwrap();
    }
    folder
}

/// A file of a folder as an argument.
pub fn path(folder: &Path, name: &str) -> String {
    folder.join(name).to_str().unwrap().to_owned()
}
