//! What a command line owes its users: failures that scripts see, completions and manual pages.

use std::process::Output;

use crate::common::{taxeld, text};

/// What a command that must fail with code 1 says.
fn fails(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(1), "{}{}", text(&output.stdout), text(&output.stderr));
    text(&output.stderr)
}

fn succeeds(output: &Output) -> String {
    assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
    text(&output.stdout)
}

#[test]
fn a_log_of_which_nothing_is_understood_fails() {
    let folder = tempfile::tempdir().unwrap();
    let [log, config] = ["t.log", "t.toml"].map(|name| folder.path().join(name).to_str().unwrap().to_owned());
    // The last one comes at the end of all time that can be told.
    let lines =
        ["(1600000000.000000) can0 123#00", "(1600000000.1) can0 123#01", "(9223372036.854775) can0 123#02", ""];
    std::fs::write(&log, lines.join("\n")).unwrap();
    std::fs::write(
        &config,
        "[store]\npath = \"t.db\"\n[[bus]]\nname = \"skin\"\ninterface = \"can0\"\n[[patch]]\nname = \"palm\"\n\
         bus = \"skin\"\nlisten_only = true\nboards = [{ address = 13, modules = \"0-1\" }]\n",
    )
    .unwrap();
    let said = fails(&taxeld(&["replay", &log, "--config", &config]));
    assert!(said.contains("not one of 3 frames was understood"), "{said}");
}

#[test]
fn completions_and_manual_pages_come_from_the_command_line_itself() {
    for shell in ["bash", "zsh", "fish"] {
        assert!(succeeds(&taxeld(&["completions", shell])).contains("calibrate"), "{shell}");
    }
    let folder = tempfile::tempdir().unwrap();
    let man = folder.path().join("man");
    succeeds(&taxeld(&["man", "--out", man.to_str().unwrap()]));
    let page = std::fs::read_to_string(man.join("taxeld-watch.1")).unwrap();
    assert!(page.contains("uncertainty") && page.contains("\\-\\-once"), "{page}");
    assert!(man.join("taxeld-models-show.1").exists());
}

#[test]
fn the_configuration_of_an_installed_daemon_is_found_by_itself() {
    let output = taxeld(&["check"]);
    let said = format!("{}{}", text(&output.stdout), text(&output.stderr));
    assert!(output.status.success() || said.contains("/etc/taxeld/taxeld.toml"), "{said}");
}
