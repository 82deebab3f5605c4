//! The configuration of taxeld.

use std::path::Path;

use toml::{Table, Value};

use crate::config::{Scene, examine_text};

/// Nothing lies there, so that a configuration can name no file that is.
const PATH: &str = "/nowhere/t.toml";

/// Most problems that are told.
const PROBLEMS_MAX: usize = 100;

/// A text: what the examination finds no fault with means the same in any form.
pub fn run(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let table = text.parse::<Table>();
    if table.as_ref().is_ok_and(|table| table.values().any(names_a_device)) {
        return; // reading one may never end
    }
    match examine_text(Path::new(PATH), text) {
        Ok((_, scene)) => check_written(&scene, table.expect("what was used is TOML")),
        Err(problems) => check_problems(&problems.to_string(), text),
    }
}

/// Each problem is one line: the file, a line of it or none, and words.
fn check_problems(said: &str, text: &str) {
    let (problems, lines) = (said.lines().count(), text.lines().count());
    assert!((1..=PROBLEMS_MAX).contains(&problems), "{problems} problems");
    for problem in said.lines() {
        let parts = problem.strip_prefix(PATH).and_then(|rest| rest.split_once(": "));
        let (line, words) = parts.unwrap_or_else(|| panic!("{problem:?}"));
        let line: usize = line.strip_prefix(':').map_or(0, |line| line.parse().expect("the number of a line"));
        assert!(!words.is_empty() && line <= lines + 1, "{problem}");
    }
}

/// The same values in the form in which a program writes them are the same scene.
fn check_written(scene: &Scene, table: Table) {
    let written = toml::to_string(&table).expect("a table can be written");
    let again = examine_text(Path::new(PATH), &written);
    assert_eq!(again.map(|(_, again)| format!("{again:?}")), Ok(format!("{scene:?}")), "{written}");
}

fn names_a_device(value: &Value) -> bool {
    match value {
        Value::String(text) => ["/dev", "/proc", "/sys"].iter().any(|folder| text.contains(folder)),
        Value::Array(values) => values.iter().any(names_a_device),
        Value::Table(table) => table.values().any(names_a_device),
        _ => false,
    }
}
