//! Logs of a bus as they are found: of several interfaces, cut off, of a clock that was set.

use flate2::Compression;
use flate2::write::GzEncoder;

use crate::common::*;

/// What a command that must succeed prints, and what it says beside that.
fn succeeds(arguments: &[&str]) -> (String, String) {
    let output = taxeld(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
    (text(&output.stdout), text(&output.stderr))
}

#[test]
fn a_calibration_goes_on_where_the_clock_was_set_back_and_says_where() {
    let set_back = |line: usize| if line < 200 * SCAN_LINES { 1_600_000_000 } else { 1_600_000_000 - 3600 };
    let folder = scratch(&[("t.toml", CONFIG), ("t.log", &log(&frames(), set_back))]);
    let [log, config, models] = ["t.log", "t.toml", "m.json"].map(|name| path(folder.path(), name));
    let (printed, _) = succeeds(&["replay", &log, "--config", &config, "--calibrate", "70", "--out", &models]);
    assert!(printed.contains("session: REVIEW") && printed.contains("20 of 20 usable"), "{printed}");
    let told = "the clock stepped back by 3600.0 s at line 1001: times go on from there";
    assert!(printed.contains(told) && printed.contains("(32.0 s of log)"), "{printed}");
    assert!(succeeds(&["scan", &log]).1.contains(told));
}

/// What the controller reported when the log was recorded is told to the engine as it was then.
#[test]
fn a_bus_off_in_a_log_takes_the_zero() {
    let [config, models] = ["t.toml", "m.json"];
    let at = 400 * SCAN_LINES;
    let frames = frames();
    let rest: Vec<(u64, String)> = frames[..30 * SCAN_LINES].to_vec();
    let again = |n: u64| rest.iter().map(move |(us, frame)| (us + n * 1_500_000, frame.clone()));
    // Twenty times one and a half seconds at rest; a bus-off amid them.
    let still: Vec<(u64, String)> = (0..20).flat_map(again).collect();
    let with = |line: &str| {
        let mut lines = still.clone();
        lines.insert(at, (still[at].0, line.to_owned()));
        log(&lines, |_| 1_600_000_000)
    };
    let folder = scratch(&[
        (config, CONFIG),
        ("ramp.log", &log(&frames, |_| 1_600_000_000)),
        ("still.log", &log(&still, |_| 1_600_000_000)),
        ("off.log", &with("20000040#0000000000000000")),
    ]);
    let [config, models, ramp, force] = [config, models, "ramp.log", "f.csv"].map(|name| path(folder.path(), name));
    succeeds(&["replay", &ramp, "--config", &config, "--calibrate", "70", "--out", &models]);
    let lost_by = |why: &str, log: &str| {
        let log = path(folder.path(), log);
        succeeds(&["replay", &log, "--config", &config, "--models", &models, "--force", &force]);
        let rows = std::fs::read_to_string(&force).unwrap();
        rows.lines().filter(|row| row.contains(why)).count()
    };
    assert_eq!(lost_by("bus-off", "still.log"), 0);
    assert!(lost_by("bus-off", "off.log") > 5);
}

#[test]
fn a_log_of_nothing_but_what_a_controller_told_has_no_frame() {
    let folder = scratch(&[
        ("t.toml", CONFIG),
        ("t.log", "(1.000000) can0 20000040#0000000000000000\n(1.000000) can1 301#00\n"),
    ]);
    let [log, config] = ["t.log", "t.toml"].map(|name| path(folder.path(), name));
    let none = "there is no frame of can0 in it, only error frames: 1";
    let config = ["--config", &config];
    for how in [[&["replay"][..], &config], [&["scan", "--interface", "can0"], &[]]] {
        let said = fails(&[&how.concat()[..], &[&log]].concat());
        assert!(said.contains(none), "{how:?}: {said}");
    }
}

/// A replay that comes to nothing leaves the file that was there.
#[test]
fn the_force_of_a_replay_that_fails_replaces_nothing() {
    let other = CONFIG.replace("address = 13", "address = 9").replace("0x3A1", "0x3A9");
    let folder = scratch(&[("t.toml", &other), ("t.log", &log(&frames(), |_| 0)), ("f.csv", "of an earlier replay\n")]);
    let [log, config, force] = ["t.log", "t.toml", "f.csv"].map(|name| path(folder.path(), name));
    let said = fails(&["replay", &log, "--config", &config, "--force", &force]);
    assert!(said.contains("not one of 3200 frames was understood"), "{said}");
    assert_eq!(std::fs::read_to_string(&force).unwrap(), "of an earlier replay\n");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3, "nothing is left beside it");
}

#[test]
fn a_log_of_several_interfaces_is_scanned_by_the_name_of_one() {
    let (first, second) = (log(&frames(), |_| 0), log(&frames(), |_| 0));
    let second = second.replace("can0 4D0", "can1 4E0").replace("can0 4D1", "can1 4E1").replace("can0 3A1", "can1 3A2");
    let both: String = first.lines().zip(second.lines()).map(|(a, b)| format!("{a}\n{b}\n")).collect();
    let folder = scratch(&[("both.log", &both), ("second.log", &second)]);
    let [both, second, out] = ["both.log", "second.log", "out.toml"].map(|name| path(folder.path(), name));
    let said = fails(&["scan", &both, "--out", &out]);
    assert!(said.contains("the log has can0 and can1: say which with --interface"), "{said}");
    let (printed, _) = succeeds(&["scan", &both, "--interface", "can1"]);
    assert!(printed.contains("board 14: modules 0-1") && !printed.contains("board 13"), "{printed}");
    succeeds(&["scan", &second, "--out", &out]);
    let begun = std::fs::read_to_string(&out).unwrap();
    assert!(begun.contains("interface = \"can1\""), "{begun}");
    let said = fails(&["scan", &both, "--interface", "can2"]);
    assert!(said.contains("none of its 6400 frames is of can2: they are of can0, can1"), "{said}");
}

#[test]
fn lines_that_are_refused_are_told_and_a_log_of_nothing_else_fails_with_the_first() {
    let log = log(&frames(), |_| 1_600_000_000).replacen('\n', "\nthis is no frame\n", 1);
    let bare = "  can0  4D0   [3]  40 F0 EF\n  can0  4D0   [2]  C0 F0\n";
    let folder = scratch(&[("t.toml", CONFIG), ("t.log", &log), ("bare.log", bare), ("empty.log", "# nothing\n")]);
    let [config, log, bare, empty] = ["t.toml", "t.log", "bare.log", "empty.log"].map(|name| path(folder.path(), name));
    for name in ["scan", "replay"] {
        let of = |log| if name == "scan" { vec![name, log] } else { vec![name, log, "--config", &config] };
        let (printed, said) = succeeds(&of(&log));
        let told = if name == "replay" { printed } else { said };
        assert!(told.contains("1 of 3201 lines are no frame:\n  line 2: column 1: found `t`"), "{name}: {told}");
        let said = fails(&of(&bare));
        let why =
            "not one of its 2 lines is a frame: line 1: column 3: found `c`, expected `(` and a time: record with";
        assert!(said.contains(why), "{name}: {said}");
        let said = fails(&of(&empty));
        assert!(said.contains("there is no frame in it"), "{name}: {said}");
    }
}

#[test]
fn of_a_gzip_that_was_cut_off_all_before_is_used() {
    let folder = scratch(&[("t.toml", CONFIG)]);
    let [config, cut, models] = ["t.toml", "t.log.gz", "m.json"].map(|name| path(folder.path(), name));
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    std::io::Write::write_all(&mut encoder, log(&frames(), |_| 1_600_000_000).as_bytes()).unwrap();
    let whole = encoder.finish().unwrap();
    std::fs::write(&cut, &whole[..whole.len() - 9]).unwrap();
    let (printed, said) = succeeds(&["replay", &cut, "--config", &config, "--calibrate", "70", "--out", &models]);
    assert!(printed.contains("20 of 20 usable"), "{printed}");
    let printed = printed + &said;
    assert!(
        printed.contains("t.log.gz: after line 3") && printed.contains("; everything before it was read"),
        "{printed}"
    );
}
