//! A dial in the place of a gauge, from the configuration to models in use: `taxeld calibrate` types what a script says, at each
//! plateau that the simulated hand holds. And a daemon whose gauge is text on a pseudo terminal.

use std::io::Write;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use nix::fcntl::OFlag;
use nix::pty::{grantpt, posix_openpt, ptsname_r, unlockpt};

use crate::common::text;

const CONFIG: &str = r#"
listen = ["unix:s"]
[store]
path = "store.db"
[[bus]]
name = "skin"
source = "sim"
[[patch]]
name = "lower"
bus = "skin"
listen_only = true
boards = [{ address = 12, modules = "0-6" }]
"#;

struct Daemon(Child);

impl Drop for Daemon {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn taxeld(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_taxeld"));
    let server = format!("unix:{}", folder.join("s").display());
    command.args(arguments).env("TAXELD_SERVER", server).current_dir(folder).stdin(Stdio::null());
    command.output().unwrap()
}

/// Asks until this is answered.
fn until(folder: &Path, arguments: &[&str], done: impl Fn(&str) -> bool) -> String {
    let limit = Instant::now() + Duration::from_secs(120);
    loop {
        let said = text(&taxeld(folder, arguments).stdout);
        if done(&said) {
            return said;
        }
        assert!(Instant::now() < limit, "{arguments:?}: {said}");
        std::thread::yield_now();
    }
}

fn start(folder: &Path, gauge: &str) -> Daemon {
    std::fs::write(folder.join("taxeld.toml"), format!("{CONFIG}gauge = {{ {gauge} }}\n")).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_taxeld"));
    command.args(["run", "--config", "taxeld.toml"]).current_dir(folder).stderr(Stdio::null());
    let daemon = Daemon(command.spawn().unwrap());
    until(folder, &["sessions", "list", "--json"], |_| taxeld(folder, &["sessions", "list"]).status.success());
    daemon
}

#[test]
fn a_script_types_what_a_dial_shows_and_the_models_are_in_use() {
    let folder = tempfile::tempdir().unwrap();
    let _daemon = start(folder.path(), "typed = true, resolution_kpa = 0.2");
    let dial = "0,2,4,6,8,10,12,14,16";
    let options = ["calibrate", "--target", "16", "--confirmed-by", "test", "--yes", "--typed", dial];
    let said = taxeld(folder.path(), &options);
    let (out, wrong) = (text(&said.stdout), text(&said.stderr));
    assert!(said.status.success(), "{out}\n{wrong}");
    assert!(out.contains("7 of 8 plateaus: pump to about 16 kPa and hold") && out.contains("vent the bag"), "{out}");
    assert!(out.contains("is in use"), "{out}");
    let below = ["calibrate", "--new", "--target", "16", "--confirmed-by", "test", "--yes", "--typed", "0,2,1"];
    let said = taxeld(folder.path(), &below);
    let why = text(&said.stderr);
    assert!(!said.status.success() && why.contains("1 kPa is not above the 2 kPa of the plateau before"), "{why}");
}

#[test]
fn a_gauge_that_prints_text_is_read_and_what_is_wrong_with_it_is_in_the_health() {
    let mut gauge = posix_openpt(OFlag::O_RDWR | OFlag::O_NOCTTY).unwrap();
    grantpt(&gauge).unwrap();
    unlockpt(&gauge).unwrap();
    let at = ptsname_r(&gauge).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let _daemon = start(folder.path(), &format!("line = \"{at}\", template = \"P={{mbar}}\""));
    let (end, ended) = std::sync::mpsc::channel::<()>();
    let printed = std::thread::spawn(move || {
        while ended.try_recv() == Err(std::sync::mpsc::TryRecvError::Empty) {
            gauge.write_all(b"P=125\r\nERR 7\r\n").unwrap();
            std::thread::sleep(Duration::from_millis(50)); // a gauge that prints twenty times a second
        }
        gauge
    });
    let wrong = format!("{at}: line \"ERR 7\" is not as the template says");
    until(folder.path(), &["health"], |said| said.contains("gauge: 12.50 kPa") && said.contains(&wrong));
    drop(end);
    drop(printed.join()); // the terminal is gone
    until(folder.path(), &["health"], |said| said.contains("DOWN"));
}
