//! Commands as processes, and the files that they are given.

use std::path::Path;
use std::process::{Command, Output, Stdio};

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

/// Runs a command to its end; its standard input is empty.
pub fn taxeld(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_taxeld")).args(arguments).stdin(Stdio::piped()).output().unwrap()
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
