//! taxel-lab as shipped, and its certificates.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test's helpers fail as the test does

mod bad_recordings;
mod certificate;
mod commands;
mod recalibration;
mod recordings;

use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

fn lab(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_taxel-lab")).args(arguments).stdin(Stdio::null()).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// What a command that must fail with code 1 says.
fn fails(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(1), "{}{}", text(&output.stdout), text(&output.stderr));
    text(&output.stderr)
}

fn succeeds(output: &Output) -> String {
    assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
    text(&output.stdout)
}

/// The number behind these words.
fn number(said: &str, words: &str) -> f64 {
    let (_, rest) = said.split_once(words).unwrap_or_else(|| panic!("no `{words}` in {said}"));
    rest.split_whitespace().next().unwrap().parse().unwrap()
}

/// A recording of a real skin, where it is.
fn insole(name: &str) -> Option<PathBuf> {
    let fallback = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let folder = std::env::var_os("TAXELD_DATA").map_or_else(fallback, PathBuf::from);
    let path = folder.join(format!("insole/left_{name}.csv.gz"));
    if !path.exists() {
        eprintln!("SKIPPED: no file {}", path.display());
        return None;
    }
    Some(path)
}
