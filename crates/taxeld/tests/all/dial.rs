//! A dial in the place of a gauge, from the configuration to models in use: `taxeld calibrate` types what a script says, at each
//! plateau that the simulated hand holds. And a daemon whose gauge is text on a pseudo terminal.

use std::io::Write;

use nix::fcntl::OFlag;
use nix::pty::{grantpt, posix_openpt, ptsname_r, unlockpt};

use crate::common::*;

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

fn start(folder: &Path, gauge: &str) -> Ended {
    run_in(folder, &format!("{CONFIG}gauge = {{ {gauge} }}\n"))
}

#[test]
fn a_script_types_what_a_dial_shows_and_the_models_are_in_use() {
    let folder = tempfile::tempdir().unwrap();
    let _daemon = start(folder.path(), "typed = true, resolution_kpa = 0.2");
    let dial = "0,5,10,15,20,25,30,35,40";
    let options = ["calibrate", "--target", "40", "--confirmed-by", "test", "--yes", "--typed", dial];
    let said = taxeld_in(folder.path(), &options);
    let (out, wrong) = (text(&said.stdout), text(&said.stderr));
    assert!(said.status.success(), "{out}\n{wrong}");
    assert!(out.contains("7 of 8 plateaus: pump to about 40 kPa and hold") && out.contains("vent the bag"), "{out}");
    assert!(out.contains("is in use"), "{out}");
}

#[test]
fn a_set_that_is_not_good_is_not_used_by_yes_alone() {
    let folder = tempfile::tempdir().unwrap();
    let _daemon = start(folder.path(), "typed = true, resolution_kpa = 0.2");
    let options =
        ["calibrate", "--target", "16", "--confirmed-by", "test", "--yes", "--typed", "0,2,4,6,8,10,12,14,16"];
    let fewer = [&options[..], &["--leave-out", "12:0", "--leave-out", "12:1"]].concat();
    let said = taxeld_in(folder.path(), &fewer);
    let (out, wrong) = (text(&said.stdout), text(&said.stderr));
    assert_eq!(said.status.code(), Some(4), "{out}\n{wrong}");
    let set = out.split_whitespace().find(|word| word.starts_with("m-")).unwrap();
    assert!(wrong.contains(&format!("{set} is not good, so that --yes does not use it")), "{wrong}");
    assert!(wrong.contains(&format!("help: taxeld models use {set} --yes")), "{wrong}");
    let list = text(&taxeld_in(folder.path(), &["models", "list"]).stdout);
    assert!(list.lines().any(|line| line.contains(set) && !line.contains("active")), "{list}");
}

#[test]
fn a_gauge_that_prints_text_is_read_as_proposed_and_what_is_wrong_with_it_is_in_the_health() {
    let mut gauge = posix_openpt(OFlag::O_RDWR | OFlag::O_NOCTTY).unwrap();
    grantpt(&gauge).unwrap();
    unlockpt(&gauge).unwrap();
    let at = ptsname_r(&gauge).unwrap();
    let (end, ended) = std::sync::mpsc::channel::<()>();
    let printed = std::thread::spawn(move || {
        while ended.try_recv() == Err(std::sync::mpsc::TryRecvError::Empty) {
            gauge.write_all(b"P=125\r\nERR 7\r\n").unwrap();
            std::thread::sleep(Duration::from_millis(50)); // a gauge that prints twenty times a second
        }
        gauge
    });
    let folder = tempfile::tempdir().unwrap();
    let said = taxeld_in(folder.path(), &["scan", "--serial", &at, "--seconds", "1", "--template", "P={mbar}"]);
    let said = text(&said.stdout);
    assert!(said.contains("not read: received \"ERR 7\", expected \"P={mbar}\""), "{said}");
    let proposed = said.lines().find(|line| line.trim().starts_with("gauge = ")).unwrap();
    assert!(
        proposed
            .contains(&format!("{{ line = \"{at}@115200\", template = \"P={{mbar}}\" }} # 12.500 to 12.500 kPa in ")),
        "{said}"
    );
    let _daemon = run_in(folder.path(), &format!("{CONFIG}{proposed}\n"));
    let wrong = format!("{at}@115200: received \"ERR 7\", expected \"P={{mbar}}\"");
    let says = |output: &Output, words: &str| text(&output.stdout).contains(words);
    until(folder.path(), &["health"], |output| says(output, "gauge: 12.50 kPa") && says(output, &wrong));
    drop(end);
    drop(printed.join()); // the terminal is gone
    until(folder.path(), &["health"], |output| says(output, "DOWN"));
}
