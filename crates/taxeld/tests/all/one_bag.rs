//! Two patches in one bag: one command, one ramp, a session and a model set for each.

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::common::text;

/// The simulated forearm as two patches, a board each, and one gauge.
const CONFIG: &str = r#"
listen = ["unix:s"]
[store]
path = "store.db"
[[bus]]
name = "skin"
source = "sim"
[[patch]]
name = "upper"
bus = "skin"
listen_only = true
area_mm2 = 42.1
boards = [{ address = 13, modules = "0-15" }]
gauge = { id = 0x3A1, signal = "0|32@1-", unit = "Pa" }
[[patch]]
name = "lower"
bus = "skin"
listen_only = true
area_mm2 = 42.1
boards = [{ address = 12, modules = "0-6" }]
gauge = { id = 0x3A1, signal = "0|32@1-", unit = "Pa" }
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

fn start(folder: &Path, config: &str) -> Daemon {
    std::fs::write(folder.join("taxeld.toml"), config).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_taxeld"));
    command.args(["run", "--config", "taxeld.toml"]).current_dir(folder).stderr(Stdio::null());
    let daemon = Daemon(command.spawn().unwrap());
    let limit = Instant::now() + Duration::from_secs(120);
    while !taxeld(folder, &["sessions", "list"]).status.success() {
        assert!(Instant::now() < limit, "the daemon does not answer");
        std::thread::yield_now();
    }
    daemon
}

#[test]
fn two_patches_in_one_bag_are_calibrated_by_one_ramp() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let _daemon = start(folder, CONFIG);
    for (with, why) in [("upper", "named twice"), ("hand", "no patch `hand`")] {
        let refused = taxeld(folder, &["calibrate", "--patch", "upper", "--with", with, "--yes"]);
        assert_eq!(refused.status.code(), Some(3), "{}", text(&refused.stderr));
        assert!(text(&refused.stderr).contains(why), "{}", text(&refused.stderr));
    }
    let words =
        ["calibrate", "--patch", "upper", "--with", "lower", "--target", "15", "--confirmed-by", "test", "--yes"];
    let done = taxeld(folder, &words);
    let (out, errors) = (text(&done.stdout), text(&done.stderr));
    assert!(done.status.success(), "{out}{errors}");
    assert_eq!(out.matches("the bag is vented").count(), 1, "{out}");
    assert_eq!(out.matches("is in use").count(), 2, "{out}");
    assert_eq!(sessions(folder), ["lower SESSION_STATE_ACTIVE", "upper SESSION_STATE_ACTIVE"]);
}

/// Patch and state of each session.
fn sessions(folder: &Path) -> Vec<String> {
    let listed = text(&taxeld(folder, &["sessions", "list", "--json"]).stdout);
    let sessions = listed.lines().map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap());
    let mut found: Vec<String> =
        sessions.map(|s| format!("{} {}", s["patch"].as_str().unwrap(), s["state"].as_str().unwrap())).collect();
    found.sort_unstable();
    found
}

#[test]
fn one_patch_that_fails_ends_no_other_calibration() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (upper, lower) = CONFIG.split_at(CONFIG.rfind("[[patch]]").unwrap());
    let slow = format!("{upper}{lower}[patch.session]\nrise_max_kpa_per_s = 0.1\n");
    let _daemon = start(folder, &slow);
    let words =
        ["calibrate", "--patch", "lower", "--with", "upper", "--target", "15", "--confirmed-by", "test", "--yes"];
    let done = taxeld(folder, &words);
    let (out, errors) = (text(&done.stdout), text(&done.stderr));
    assert_eq!(done.status.code(), Some(3), "{out}{errors}");
    assert!(errors.contains("is FAILED") && errors.contains("the pressure rose too fast"), "{errors}");
    assert!(!out.contains("stop pumping"), "the other ramp goes on: {out}");
    assert_eq!(out.matches("is in use").count(), 1, "{out}");
    assert_eq!(sessions(folder), ["lower SESSION_STATE_FAILED", "upper SESSION_STATE_ACTIVE"]);
}
