//! What `taxel-lab fit` and `apply` owe their users: no input overwritten, pipes, failures that scripts see, messages of a
//! bearable length.

use std::fmt::Write as _;
use std::process::{Command, Output, Stdio};

use crate::{fails, lab, succeeds, text};

/// A command with this file on its standard input.
fn piped(arguments: &[&str], file: &str) -> Output {
    let input = std::fs::File::open(file).unwrap();
    Command::new(env!("CARGO_BIN_EXE_taxel-lab")).args(arguments).stdin(input).output().unwrap()
}

/// Three taxels that lose one count a kPa over 40 s, after two seconds at rest; `step` makes 16-bit counts of them.
fn recording(step: f64) -> String {
    let mut table = "t_s,pressure_kpa,c0,c1,c2\n".to_owned();
    for row in 0..840_u32 {
        let kpa = 1.5 * (f64::from(row) * 0.05 - 2.0).max(0.0);
        let count = |taxel: u32| (step * (240.0 - kpa + f64::from((row * 7 + taxel * 3) % 3) - 1.0)).round();
        writeln!(table, "{:.2},{kpa:.3},{},{},{}", f64::from(row) * 0.05, count(0), count(1), count(2)).unwrap();
    }
    table
}

/// A folder with a recording; the folder, and the names of files in it.
fn scratch() -> (tempfile::TempDir, [String; 3]) {
    let folder = tempfile::tempdir().unwrap();
    let names = ["good.csv", "models.json", "pressure.csv"];
    let names = names.map(|name| folder.path().join(name).to_str().unwrap().to_owned());
    std::fs::write(&names[0], recording(1.0)).unwrap();
    (folder, names)
}

#[test]
fn an_output_that_is_an_input_is_refused_and_nothing_is_written() {
    let (_folder, [data, models, _]) = scratch();
    let before = std::fs::read(&data).unwrap();
    let said = fails(&lab(&["fit", &data, "--out", &data]));
    assert!(said.contains("is an input"), "{said}");
    succeeds(&lab(&["fit", &data, "--out", &models]));
    let set = std::fs::read(&models).unwrap();
    for arguments in [["apply", &models, &data, "--out", &data], ["apply", &models, &data, "--out", &models]] {
        assert!(fails(&lab(&arguments)).contains("is an input"), "{arguments:?}");
    }
    let said = fails(&lab(&["apply", &models, &data, "--out", "-", "--sigma", &data]));
    assert!(said.contains("is an input"), "{said}");
    assert!(std::fs::read(&data).unwrap() == before && std::fs::read(&models).unwrap() == set);
}

/// Models of a recording with one unloaded scan know no zero, and one that is asked for by the second has nothing to be
/// compared with.
#[test]
fn an_apply_that_reads_no_taxel_says_why_and_writes_nothing() {
    let (folder, [_, models, pressure]) = scratch();
    let wide = folder.path().join("wide.csv");
    let ramp = recording(16.0);
    let rows: Vec<&str> = ramp.lines().take(1).chain(ramp.lines().skip(40).step_by(20)).collect();
    std::fs::write(&wide, rows.join("\n")).unwrap();
    let wide = wide.to_str().unwrap();
    succeeds(&lab(&["fit", wide, "--out", &models]));
    let output = lab(&["apply", &models, wide, "--tare", "2", "--out", &pressure]);
    let said = fails(&output) + &text(&output.stdout);
    assert!(said.contains("not one of 3 taxels could be read: nothing is written"), "{said}");
    assert!(said.contains("3 no zero: the models have no unloaded count of it"), "{said}");
    assert!(!std::path::Path::new(&pressure).exists());
}

#[test]
fn a_dash_is_standard_input_and_output() {
    let (_folder, [data, models, pressure]) = scratch();
    succeeds(&lab(&["fit", &data, "--patch", "palm", "--out", &models]));
    let from_pipe = succeeds(&piped(&["fit", "-", "--patch", "palm", "--out", "-"], &data));
    let taxels = |json: &str| serde_json::from_str::<serde_json::Value>(json).unwrap()["taxels"].clone();
    assert_eq!(taxels(&from_pipe), taxels(&std::fs::read_to_string(&models).unwrap()));
    succeeds(&lab(&["apply", &models, &data, "--out", &pressure]));
    let from_pipe = succeeds(&piped(&["apply", &models, "-", "--out", "-"], &data));
    assert_eq!(from_pipe, std::fs::read_to_string(&pressure).unwrap());
}

#[test]
fn a_fit_without_one_usable_taxel_fails_and_writes_nothing() {
    let (folder, [_, models, _]) = scratch();
    let dead = folder.path().join("dead.csv");
    let mut table = "t_s,pressure_kpa,c0,c1\n".to_owned();
    (0..600).for_each(|row| writeln!(table, "{},{},240,240", f64::from(row) * 0.05, f64::from(row) * 0.1).unwrap());
    std::fs::write(&dead, table).unwrap();
    let said = fails(&lab(&["fit", dead.to_str().unwrap(), "--out", &models]));
    assert!(said.contains("no taxel moves"), "{said}");
    assert!(!std::path::Path::new(&models).exists());
}

#[test]
fn counts_of_another_scale_are_refused() {
    let (folder, [data, models, pressure]) = scratch();
    succeeds(&lab(&["fit", &data, "--out", &models]));
    let wide = folder.path().join("wide.csv");
    std::fs::write(&wide, recording(256.0)).unwrap();
    let said = fails(&lab(&["apply", &models, wide.to_str().unwrap(), "--out", &pressure]));
    assert!(said.contains("another converter or scale"), "{said}");
    assert!(!std::path::Path::new(&pressure).exists());
}

/// A command of which no file may have more than one block, as on a disk that is full by then.
fn with_a_block_a_file(arguments: &[&str]) -> Output {
    let mut command = Command::new("sh");
    command.args(["-c", "trap '' XFSZ; ulimit -f 1; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_taxel-lab")]);
    command.args(arguments).stdin(Stdio::null()).output().unwrap()
}

#[test]
fn an_output_that_cannot_be_written_leaves_what_was_there_and_is_named() {
    let (folder, [data, models, out]) = scratch();
    std::fs::write(&out, "what was there").unwrap();
    succeeds(&lab(&["fit", &data, "--out", &models]));
    for command in [
        vec!["fit", &data, "--out", &out],
        vec!["apply", &models, &data, "--out", &out],
        vec!["apply", &models, &data, "--out", "/dev/null", "--sigma", &out],
    ] {
        let said = fails(&with_a_block_a_file(&command));
        assert!(said.contains(&format!("{out}: File too large")), "{command:?}: {said}");
        assert_eq!(std::fs::read_to_string(&out).unwrap(), "what was there");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3, "{command:?}");
    }
}
