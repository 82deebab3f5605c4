//! The programme as its users start it.

use crate::common;
use crate::common::*;

/// A ramp, with a line that is no frame and a head that is too short.
fn log() -> String {
    let log = common::log(&common::frames(), |_| 1_600_000_000).replacen('\n', "\nthis is no frame\n", 1);
    log + "(1600000040.000000) can0 4D0#40F0F0\n"
}

#[test]
fn check_prints_the_scene_and_what_it_leaves_out() {
    let folder = scratch(&[("t.toml", CONFIG)]);
    let printed = succeeds(&["check", "--config", &path(folder.path(), "t.toml")]);
    assert!(printed.contains("patch palm: 20 taxels on 2 modules"), "{printed}");
    assert!(printed.contains("area: 35.8 to 48.4 mm2 a taxel, 8.4 cm2 in all"), "{printed}");
    assert!(printed.contains("palm: resultant: not asked for in outputs, and there is no geometry"), "{printed}");
    // Two modules have three identifiers each, their board four, and the gauge one.
    assert!(printed.contains("bus skin: interface can0; 11 identifiers are read; nothing is sent"), "{printed}");
    assert!(printed.contains("board 13 of bus skin: modules 0-1"), "{printed}");
    assert!(printed.contains("computes: total normal force\n"), "{printed}");
}

/// A configuration comes from elsewhere, too, and a terminal acts upon what it is shown.
#[test]
fn check_shows_what_a_terminal_would_act_upon_written_out() {
    let odd = "\\u001b[2J\\u0000\\u202e";
    let config = CONFIG.replace("\"t.db\"", &format!("\"t{odd}.db\"")).replace("\"skin\"", &format!("\"skin{odd}\""));
    let folder = scratch(&[("t.toml", &config)]);
    let printed = succeeds(&["check", "--config", &path(folder.path(), "t.toml")]);
    let shown = "\\u{1b}[2J\\u{0}\\u{202e}";
    assert!(printed.contains(&format!("t{shown}.db, one SQLite file")), "{printed}");
    assert!(printed.contains(&format!("bus skin{shown}: interface can0")), "{printed}");
    assert!(printed.lines().all(|line| taxel_skin::unprintable(line).is_none()), "{printed}");
}

#[test]
fn check_names_every_part_that_a_scene_leaves_out_and_why() {
    let (rest, _gauge) = CONFIG.split_once("gauge = ").unwrap();
    let lean = format!("{rest}outputs = [\"resultant\", \"fill\"]\ntare_at_start = false\n");
    let lean = lean.replace("[[patch]]", "[[bus]]\nname = \"leg\"\ninterface = \"can1\"\n[[patch]]");
    let folder = scratch(&[("t.toml", &lean)]);
    let printed = succeeds(&["check", "--config", &path(folder.path(), "t.toml")]);
    for line in [
        "bus leg: no board and no gauge is on it: nothing is read",
        "palm: resultant: there is no geometry",
        "palm: moment and centre of pressure: not asked for in outputs, and there is no geometry",
        "palm: fill of excluded taxels: there is no geometry",
        "palm: calibration: there is no gauge, so no pressure to fit to",
        "palm: zero after start: tare_at_start is off, so a tare must be asked for",
        "palm: board bring-up: listen_only sends nothing",
    ] {
        assert!(printed.lines().any(|printed| printed.trim() == line), "`{line}` is not a line of: {printed}");
    }
}

#[test]
fn a_scan_of_a_log_says_what_is_there_and_begins_a_configuration() {
    let folder = scratch(&[("t.log", &log())]);
    let (log, begun) = (path(folder.path(), "t.log"), path(folder.path(), "begun.toml"));
    let printed = succeeds(&["scan", &log, "--out", &begun]);
    assert!(printed.contains("board 13: modules 0-1, every 50.0 ms"), "{printed}");
    assert!(printed.contains("identifier 3A1: ") && printed.contains(" of 4 bytes, last ["), "{printed}");
    let checked = succeeds(&["check", "--config", &begun]);
    assert!(checked.contains("patch skin: 20 taxels on 2 modules"), "{checked}");
    assert!(fails(&["scan", &log, "--out", &begun]).contains("is there already"));
    let dump = scratch(&[("data.log", "0 1.0 240\n")]);
    let refused = fails(&["scan", dump.path().to_str().unwrap()]);
    assert!(refused.contains("recordings of YARP's ports: `taxeld replay` reads them"), "{refused}");
}

#[test]
fn a_reader_that_goes_away_is_no_failure() {
    let folder = scratch(&[("t.toml", CONFIG), ("t.log", &log())]);
    let (config, log) = (path(folder.path(), "t.toml"), path(folder.path(), "t.log"));
    let models = path(folder.path(), "m.json");
    for arguments in [
        vec!["check", "--config", &config],
        vec!["replay", &log, "--config", &config, "--calibrate", "70", "--out", &models],
    ] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_taxeld"));
        command.args(&arguments).stdout(std::process::Stdio::piped()).stderr(std::process::Stdio::piped());
        let mut child = command.spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
    }
    assert!(Path::new(&models).exists(), "what was asked for is written, whether anybody reads the text or not");
}

#[test]
fn a_store_that_is_no_file_is_not_checked() {
    assert!(fails(&["check", "--store", "/dev/null"]).contains("is no file"));
}

#[test]
fn check_lists_every_error_and_run_lists_the_same_and_begins_nothing() {
    let broken = CONFIG.replace("unit =", "uint =") + "period_ms = \"50\"\nstale_periods = 1\n";
    let folder = scratch(&[("t.toml", &broken)]);
    let config = path(folder.path(), "t.toml");
    let said = fails(&["check", "--config", &config]);
    assert!(said.contains("did you mean `unit`?") && said.contains("stale_periods = 1"), "{said}");
    assert_eq!(fails(&["run", "--config", &config]), said);
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left, ["t.toml"], "no store, no socket");
}

#[test]
fn check_says_everything_that_is_wrong_with_the_profile_of_a_drive_without_the_drive() {
    let micro = include_str!("../../../../deploy/rigs/micro.toml");
    let printed = succeeds(&["check", "--device", "micro"]);
    let line = "12.5 kPa: sends \"set 12.50 2000\\n\", expects \"ok set {kPa}\"";
    assert!(printed.contains("drive micro board on /dev/ttyACM0@115200") && printed.contains(line), "{printed}");
    let wrong = [
        ("at = \"/dev/ttyACM0@115200\"", "at = \"ACM0\""),
        ("set_answer = \"ok set {kPa}\"", "set_answer = \"ok {*}\""),
        ("vent_answer", "vent_anser"),
        ("total_s = 900.0", "total_s = 9.0"),
    ];
    let text_of = wrong.iter().fold(micro.to_owned(), |text, (from, to)| text.replacen(from, to, 1));
    let folder = scratch(&[("board.toml", &text_of)]);
    let file = path(folder.path(), "board.toml");
    let said = fails(&["check", "--device", &file]);
    let lines = |at: &str| 1 + text_of.lines().position(|line| line.starts_with(at)).unwrap();
    for (key, words) in [
        ("set_answer", "text.set_answer = \"ok {*}\": it has no number"),
        ("vent_anser", "unknown key `vent_anser`; did you mean `vent_answer`?"),
        ("total_s", "total_s = 9: expected 30 to 7200"),
    ] {
        assert!(said.contains(&format!("{file}:{}: {words}", lines(key))), "expected `{words}` in: {said}");
    }
    assert!(
        fails(&["calibrate", "--device", &file, "--server", "127.0.0.1:1"]).contains("no daemon"),
        "the daemon is asked first"
    );
    assert!(fails(&["check", "--device", "nano"]).contains("expected a file, or one of micro, alicat"));
}

#[test]
fn the_socket_is_in_the_first_of_the_folders_that_the_service_manager_gives() {
    let folder = scratch(&[("t.toml", CONFIG)]);
    let mut check = Command::new(env!("CARGO_BIN_EXE_taxeld"));
    check.args(["check", "--config", &path(folder.path(), "t.toml")]).env("RUNTIME_DIRECTORY", "/run/one:/run/one/two");
    let output = check.output().unwrap();
    let printed = text(&output.stdout);
    assert!(output.status.success() && printed.contains("on unix:/run/one/taxeld.sock (mode 660)\n"), "{printed}");
}

#[test]
fn a_replay_calibrates_counts_what_it_cannot_use_and_is_bit_identical() {
    let folder = scratch(&[("t.toml", CONFIG), ("t.log", &log())]);
    let (config, log) = (path(folder.path(), "t.toml"), path(folder.path(), "t.log"));
    let run = |out: &str| {
        let out = path(folder.path(), out);
        let printed = succeeds(&["replay", &log, "--config", &config, "--calibrate", "70", "--out", &out]);
        (printed, std::fs::read_to_string(out).unwrap())
    };
    let (printed, first) = run("a.json");
    assert!(printed.contains("1 that are no frame"), "{printed}");
    assert!(printed.contains("1 malformed"), "{printed}");
    assert!(printed.contains("session: REVIEW"), "{printed}");
    assert!(printed.contains("20 of 20 usable"), "{printed}");
    assert_eq!(first, run("b.json").1, "two replays of one log differ");
}

#[test]
fn alone_and_with_help_it_shows_the_commands_in_groups() {
    let alone = common::taxeld(&[]);
    assert_eq!(alone.status.code(), Some(2));
    for help in [text(&alone.stderr), succeeds(&["--help"])] {
        assert!(help.contains("\nCalibrate:\n  calibrate ") && help.contains("\nLook:\n  watch "), "{help}");
    }
}

#[test]
fn completions_and_manual_pages_come_from_the_command_line_itself() {
    for shell in ["bash", "zsh", "fish"] {
        assert!(succeeds(&["completions", shell]).contains("calibrate"), "{shell}");
    }
    let folder = scratch(&[]);
    succeeds(&["man", "--out", &path(folder.path(), "man")]);
    let page = std::fs::read_to_string(folder.path().join("man/taxeld-watch.1")).unwrap();
    assert!(page.contains("uncertainty") && page.contains("\\-\\-once"), "{page}");
    assert!(folder.path().join("man/taxeld-models-show.1").exists());
}

#[test]
fn a_log_that_is_too_short_or_not_there_is_told() {
    let still: String = log().lines().take(100).map(|line| format!("{line}\n")).collect();
    let folder = scratch(&[("t.toml", CONFIG), ("t.log", &still)]);
    let said =
        fails(&["replay", &path(folder.path(), "t.log"), "--config", &path(folder.path(), "t.toml"), "--calibrate"]);
    let why = "the log ended while the calibration was TARING: waiting for an unloaded skin: the gauge has been heard for less than a second";
    assert!(said.contains(why), "{said}");
    let said = fails(&["replay", "/nowhere.log", "--config", &path(folder.path(), "t.toml")]);
    assert!(said.contains("/nowhere.log"), "{said}");
}

#[cfg(feature = "sim")]
#[test]
fn the_demo_weighs_within_the_papers_error() {
    let printed = succeeds(&["demo", "--once", "--seed", "7"]);
    for (contact, most_percent) in [("masses", 5.0), ("fingers", 12.0)] {
        let (_, mean) = printed.split_once(&format!("{contact}: mean absolute force error ")).unwrap();
        let percent: f64 = mean.split_whitespace().next().unwrap().parse().unwrap();
        assert!(percent <= most_percent, "{printed}");
    }
}
