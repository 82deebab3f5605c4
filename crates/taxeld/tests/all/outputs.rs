//! What the outputs of commands leave alone, and that they are whole.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use crate::common::{taxeld, text};

/// Names and content of all files.
fn content(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<_> = entries.map(|path| (path.clone(), std::fs::read(path).unwrap())).collect();
    files.sort();
    files
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
