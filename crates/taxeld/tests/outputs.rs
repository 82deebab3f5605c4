//! What the outputs of commands leave alone, and that they are whole.
#![allow(clippy::unwrap_used, clippy::expect_used)] // a test's helpers fail as the test does

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// Without a single good frame, which is told after all outputs have been looked at.
const LOG: &str = "(1600000000.000000) can0 123#00\n";

const CONFIG: &str = r#"
listen = ["unix:socket"]
[store]
path = "FOLDER/s.db"
[access]
tokens = "tokens"
[[bus]]
name = "skin"
interface = "can0"
[[patch]]
name = "palm"
bus = "skin"
listen_only = true
boards = [{ address = 13, modules = "0-1" }]
"#;

fn taxeld(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_taxeld")).args(arguments).stdin(Stdio::null()).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A folder with a log, and a configuration with files that it names.
fn scratch() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let config = CONFIG.replace("FOLDER", folder.path().to_str().unwrap());
    for (name, content) in
        [("t.toml", config.as_str()), ("t.log", LOG), ("s.db", "a store"), ("s.db-wal", "its log"), ("tokens", "")]
    {
        std::fs::write(folder.path().join(name), content).unwrap();
    }
    std::os::unix::fs::symlink("s.db-wal", folder.path().join("link.csv")).unwrap();
    let private = std::os::unix::fs::PermissionsExt::from_mode(0o600);
    std::fs::set_permissions(folder.path().join("tokens"), private).unwrap();
    std::fs::hard_link(folder.path().join("tokens"), folder.path().join("name.csv")).unwrap();
    folder
}

/// Names and content of all files.
fn content(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<_> = entries.map(|path| (path.clone(), std::fs::read(path).unwrap())).collect();
    files.sort();
    files
}

/// Some of them are not there yet, and would be in the way of the next start.
#[test]
fn no_output_takes_the_name_of_a_file_of_the_store_or_of_the_configuration() {
    let folder = scratch();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let before = content(folder.path());
    let [config, log] = ["t.toml", "t.log"].map(at);
    for name in [
        "s.db",
        "s.db-wal",
        "./s.db-wal",
        "s.db-active",
        "s.db-open",
        "s.db-lock",
        "s.db-new",
        "socket",
        "tokens",
        "t.toml",
        "t.log",
        "link.csv",
        "name.csv",
    ] {
        let out = at(name);
        let force = vec!["replay", &log, "--config", &config, "--force", &out];
        let models = vec!["replay", &log, "--config", &config, "--calibrate", "--out", &out];
        let mut commands = vec![force, models];
        if cfg!(feature = "certificate") && cfg!(feature = "client") && name != "t.log" {
            commands.push(vec!["certificate", "--config", &config, "--out", &out]);
        }
        for command in commands {
            let output = taxeld(&command);
            let said = text(&output.stderr);
            assert_eq!(output.status.code(), Some(1), "{command:?}: {said}");
            assert!(said.contains("would be overwritten by the output"), "{command:?}: {said}");
            assert_eq!(content(folder.path()), before, "{command:?}");
        }
    }
    let beginning = at("s.db-doubt");
    let output = taxeld(&["scan", &log, "--config", &config, "--out", &beginning]);
    assert!(text(&output.stderr).contains("would be overwritten by the output"), "{}", text(&output.stderr));
}

#[cfg(feature = "client")]
#[test]
fn no_output_takes_the_name_of_a_file_that_a_connection_is_made_with() {
    let folder = scratch();
    let tokens = folder.path().join("tokens");
    let tokens = tokens.to_str().unwrap();
    let server = ["--server", "unix:/nowhere", "--token", tokens];
    for command in [
        &["certificate", "--out", tokens][..],
        &["models", "export", "--out", tokens],
        &["sessions", "export", "1", "--out", tokens],
    ] {
        let output = taxeld(&[command, &server].concat());
        assert!(text(&output.stderr).contains("would be overwritten by the output"), "{}", text(&output.stderr));
    }
}

/// A shell has opened that by its name.
#[test]
fn no_output_takes_the_name_of_what_comes_as_the_standard_input() {
    let folder = scratch();
    let log = folder.path().join("t.log");
    let mut command = Command::new(env!("CARGO_BIN_EXE_taxeld"));
    command.args(["fit", "-", "--out"]).arg(&log).stdin(std::fs::File::open(&log).unwrap());
    let output = command.output().unwrap();
    assert!(text(&output.stderr).contains("would be overwritten by the output"), "{}", text(&output.stderr));
    assert_eq!(std::fs::read(&log).unwrap(), LOG.as_bytes());
}

/// Three taxels that lose one count a kPa over 40 s, after two seconds at rest.
fn recording() -> String {
    let mut table = "t_s,pressure_kpa,c0,c1,c2\n".to_owned();
    for row in 0..840_u32 {
        let kpa = 1.5 * (f64::from(row) * 0.05 - 2.0).max(0.0);
        let count = |taxel: u32| (240.0 - kpa + f64::from((row * 7 + taxel * 3) % 3) - 1.0).round();
        writeln!(table, "{:.2},{kpa:.3},{},{},{}", f64::from(row) * 0.05, count(0), count(1), count(2)).unwrap();
    }
    table
}

/// A command of which no file may have more than one block, as on a disk that is full by then.
fn with_a_block_a_file(arguments: &[&str]) -> Output {
    let mut command = Command::new("sh");
    command.args(["-c", "trap '' XFSZ; ulimit -f 1; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_taxeld")]);
    command.args(arguments).stdin(Stdio::null()).output().unwrap()
}

#[test]
fn an_output_that_cannot_be_written_leaves_what_was_there_and_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let [data, models, out] = ["data.csv", "models.json", "out"].map(|name| folder.path().join(name));
    std::fs::write(&data, recording()).unwrap();
    std::fs::write(&out, "what was there").unwrap();
    let [data, models, out] = [&data, &models, &out].map(|path| path.to_str().unwrap());
    assert!(taxeld(&["fit", data, "--out", models]).status.success());
    let before = content(folder.path());
    let mut commands = vec![
        vec!["fit", data, "--out", out],
        vec!["apply", models, data, "--out", out],
        vec!["apply", models, data, "--out", "/dev/null", "--sigma", out],
    ];
    if cfg!(feature = "sim") {
        commands.push(vec!["demo", "--once", "--svg", out]);
    }
    for command in commands {
        let output = with_a_block_a_file(&command);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{command:?}: {said}");
        assert!(said.contains(&format!("{out}: File too large")), "{command:?}: {said}");
        assert_eq!(content(folder.path()), before, "{command:?}");
    }
}
