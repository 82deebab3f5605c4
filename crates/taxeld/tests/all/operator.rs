//! An operator at the terminal: a whole calibration, a known load and the force, against `taxeld demo` as a process of
//! its own, through the commands alone.

use crate::common::*;
use crate::demo::Demo;

#[test]
fn a_forearm_is_calibrated_weighed_and_watched_through_the_commands_alone() {
    let demo = Demo::start(&["--bare"]);
    assert!(demo.refused(&["watch", "--once", "--within", "0.5"]).contains("no model set is in use"));
    assert!(demo.refused(&["models", "use", "newest"]).contains("there is no model set"));

    let printed = demo.until_good(&["calibrate", "--target", "40", "--yes"]);
    for part in ["TARING", "RAMPING", "go on", "FITTING", "the bag is vented", "taxels (", "is in use"] {
        assert!(printed.contains(part), "`{part}` is not in: {printed}");
    }
    let sessions = demo.json(&["sessions", "list", "--json"]);
    assert_eq!(sessions[0]["state"], "SESSION_STATE_ACTIVE");
    let sets = demo.json(&["models", "list", "--json"]);
    let id = sets[0]["modelSet"].as_str().unwrap();
    assert_eq!(sets[0]["active"], true);
    assert!(demo.succeeds(&["models", "show"]).contains(id));
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data.csv").to_str().unwrap().to_owned();
    let number = sessions[0]["session"].as_str().unwrap();
    demo.succeeds(&["sessions", "export", number, "--out", &data]);
    // The last cell of a row says what it is if it is no scan.
    let rows = std::fs::read_to_string(&data).unwrap().lines().filter(|line| line.ends_with(',')).count();
    assert_eq!(rows.to_string(), sessions[0]["accepted"].as_str().unwrap());
    assert!(demo.succeeds(&["models", "show", &id[..6]]).contains(" taxels usable"));
    for beginning in ["", "m-", &id[..3]] {
        assert!(
            demo.refused(&["models", "use", beginning]).contains("give at least its first 4 characters"),
            "{beginning}"
        );
    }
    stored_samples_are_fitted_once_more(&demo, number, id);

    let events = demo.json(&["events", "--json"]);
    let of = |kind: &str| events.iter().filter(|event| event["kind"] == kind).count();
    assert!(of("tared") > 0 && of("activated") > 0 && of("session") >= 5, "{events:?}");
    assert!(demo.succeeds(&["events"]).contains("activated: "));

    demo.until_good(&["tare"]);
    let load = demo.until_good(&["load", "0.5", "--by", "Ada", "--json"]);
    let load: serde_json::Value = serde_json::from_str(&load).unwrap();
    assert!(load["errorPercent"].as_f64().unwrap().abs() < 25.0, "{load}");
    assert!(demo.succeeds(&["load"]).contains("Ada"));

    let newton: f64 = demo.until_good(&["watch", "--once", "--quiet", "--within", "10"]).trim().parse().unwrap();
    assert!((0.0..10.0).contains(&newton), "{newton} N");
    let newtons = demo.until_good(&["watch", "--count", "3", "--quiet"]);
    assert!(newtons.lines().all(|newton| newton.parse::<f64>().is_ok_and(f64::is_finite)), "{newtons}");
    let json = demo.until_good(&["watch", "--json", "--count", "3", "--rate", "20"]);
    assert!(json.lines().all(|line| line.starts_with("{\"sequence\":")) && json.lines().count() == 3, "{json}");
    // Nobody takes the demo's force for one of a skin.
    assert!(json.lines().all(|line| line.contains("\"simulated\":true") && line.contains("\"skipped\":")), "{json}");
    let line = demo.until_good(&["watch", "--count", "1"]);
    assert!(line.contains(", simulated") && !line.contains('\u{1b}'), "{line}");
    let mut coloured = Command::new(env!("CARGO_BIN_EXE_taxeld"));
    coloured.args(["watch", "--count", "1", "--server", &demo.server]).env("CLICOLOR_FORCE", "1");
    let coloured = text(&coloured.output().unwrap().stdout);
    assert!(coloured.contains("\u{1b}[1;3") && coloured.contains("\u{1b}[0m"), "{coloured:?}");
    demo.until_good(&["health"]);
}

#[test]
fn a_set_without_a_zero_says_so_and_has_a_force_after_a_confirmed_tare() {
    let demo = Demo::start(&[]);
    let said = import_changed(&demo, |set| set["baseline"].as_array_mut().unwrap().fill(serde_json::Value::Null));
    assert!(said.contains("taxeld tare --confirmed-by NAME"));
    assert!(demo.succeeds(&["models", "use", "newest"]).contains("taxeld tare --confirmed-by NAME"));
    let wanted = "NO FORCE: the model set has no zero of its own";
    let health = || demo.command(&["health"]);
    let told = (0..500).map(|_| health()).find(|health| text(&health.stdout).contains(wanted)).unwrap_or_else(health);
    let said = text(&told.stdout);
    assert_eq!(told.status.code(), Some(3), "{said}");
    assert!(said.contains(wanted) && said.contains("  gauge: "), "{said}");
    let bare = |newton: &str| newton.trim().parse::<f64>().is_ok();
    demo.until_good(&["tare", "--confirmed-by", "Ada"]);
    assert!(bare(&demo.until_good(&["watch", "--once", "--quiet", "--within", "10"])));
}

#[test]
fn what_destroys_or_loses_most_of_the_skin_is_asked_about_and_refused_without_a_terminal() {
    let demo = Demo::start(&[]);
    import_changed(&demo, |set| {
        for taxel in set["taxels"].as_array_mut().unwrap().iter_mut().skip(30) {
            taxel.as_object_mut().unwrap().remove("figures");
            taxel["status"] = "no_data".into();
        }
    });
    let id = demo.json(&["models", "list", "--json"])[0]["modelSet"].as_str().unwrap().to_owned();
    let shown = demo.succeeds(&["models", "show", &id]);
    assert!(shown.contains("200 taxels gave no usable values: board ") && !shown.contains("no_data"), "{shown}");
    let refused = demo.refused(&["models", "use", &id]);
    assert!(refused.contains("Not good: too few taxels, far fewer taxels than the set in use. 27 of 230"), "{refused}");
    assert!(refused.contains(&format!("taxeld models use {id} --yes")), "{refused}");
    assert!(demo.refused(&["models", "delete", &id]).contains(&format!("taxeld models delete {id} --yes")));
    demo.succeeds(&["models", "delete", &id, "--yes"]);
    let waiting = demo.until_good(&["calibrate", "--target", "30"]); // without --yes it ends in review
    assert!(
        waiting.contains(" the set in use, and has ") && waiting.contains("help: taxeld models use m-"),
        "{waiting}"
    );
    let refused = demo.refused(&["sessions", "delete", "1"]);
    assert!(
        refused.contains("delete session 1 of left_forearm (REVIEW)")
            && refused.contains("taxeld sessions delete 1 --yes"),
        "{refused}"
    );
    demo.succeeds(&["sessions", "delete", "1", "--yes"]);
    assert!(demo.refused(&["sessions", "delete", "1"]).contains("no session 1"));
}

/// Exports the set in use and imports it with a change; what is said of it.
fn import_changed(demo: &Demo, change: impl FnOnce(&mut serde_json::Value)) -> String {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("models.json").to_str().unwrap().to_owned();
    demo.succeeds(&["models", "export", "--out", &file]);
    let mut set: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
    set.as_object_mut().unwrap().remove("id");
    change(&mut set);
    std::fs::write(&file, set.to_string()).unwrap();
    demo.succeeds(&["models", "import", &file])
}

/// The session's own set comes out again under its own id.
fn stored_samples_are_fitted_once_more(demo: &Demo, session: &str, own: &str) {
    let again = &demo.json(&["sessions", "refit", session, "--json"])[0];
    assert_eq!((again["modelSet"]["modelSet"].as_str().unwrap(), &again["known"]), (own, &true.into()), "{again}");
    assert!(demo.refused(&["sessions", "refit", session, session]).contains("is named twice"));
    assert!(demo.refused(&["sessions", "refit", "99"]).contains("no session 99"));

    assert!(demo.succeeds(&["sessions", "refit", session]).contains("was there already"));
}

/// The pump goes on while the daemon hangs: nobody may see the last pressure as the present one.
#[test]
fn a_calibration_says_stop_while_the_daemon_hangs() {
    let demo = Demo::start(&["--bare"]);
    let mut calibrate = Command::new(env!("CARGO_BIN_EXE_taxeld"));
    calibrate
        .args(["calibrate", "--target", "30", "--yes", "--confirmed-by", "test"])
        .env("TAXELD_SERVER", &demo.server);
    let child = calibrate.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut child = Ended(child);
    let mut lines = BufReader::new(child.0.stdout.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.any(|line| line.starts_with("RAMPING")), "the ramp begins");
    demo.child.signal("-STOP");
    assert!(lines.any(|line| line.contains("stop pumping: nothing new comes from the daemon")), "it says so");
    demo.child.signal("-CONT");
    assert!(lines.any(|line| !line.contains("stop pumping")), "it goes on, or says why not");
}

#[test]
fn a_demo_starts_with_its_models_in_use_and_a_stream_ends_with_its_reader() {
    let demo = Demo::start(&[]);
    let slow = demo.until_good(&["watch", "--rate", "1", "--count", "3"]);
    assert_eq!(slow.lines().count(), 3, "a line a sample, however rare they are: {slow}");
    // As in `taxeld watch --json | head -1`: it ends by itself and says nothing.
    let mut command = Command::new(env!("CARGO_BIN_EXE_taxeld"));
    command.args(["watch", "--json", "--server", &demo.server]).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut watch = command.spawn().unwrap();
    let mut first = String::new();
    BufReader::new(watch.stdout.take().unwrap()).read_line(&mut first).unwrap();
    let ended = watch.wait_with_output().unwrap();
    assert!(first.starts_with('{') && ended.status.success() && ended.stderr.is_empty(), "{first}{ended:?}");
}

/// The demo's mass lies at another of three places each time.
#[test]
fn known_loads_recalibrate_the_skin_and_only_an_activation_uses_the_result() {
    let demo = Demo::start(&[]);
    assert!(demo.refused(&["recalibrate"]).contains("0 known loads so far; at least 5"));
    let before = demo.json(&["models", "list", "--json"])[0]["modelSet"].as_str().unwrap().to_owned();
    let mut said = String::new();
    let accepted = (0..60).any(|_| {
        demo.until_good(&["load", "0.5", "--by", "Ada"]);
        let output = demo.command(&["recalibrate", "--accept"]);
        said = text(&output.stdout) + &text(&output.stderr);
        output.status.success()
    });
    assert!(accepted && said.contains("gain ") && said.contains("not in use. Use it: taxeld models use"), "{said}");
    let sets = demo.json(&["models", "list", "--json"]);
    let made = sets.iter().find(|set| set["derivedFrom"] == before.as_str()).unwrap();
    assert!(made["active"] != true, "{made}");
    demo.succeeds(&["models", "use", made["modelSet"].as_str().unwrap()]);
    assert!(demo.refused(&["models", "delete", &before, "--yes"]).contains("known loads"), "it is kept");
    assert!(
        demo.refused(&["recalibrate"]).contains("0 known loads so far"),
        "loads of the set before say nothing of this one"
    );
}

#[test]
fn a_daemon_that_is_not_there_is_no_refusal_and_the_command_that_helps_is_named() {
    let output = taxeld(&["tare", "--server", "127.0.0.1:1"]);
    assert_eq!(output.status.code(), Some(1));
    let said = text(&output.stderr);
    let mut lines = said.lines();
    assert!(lines.next().unwrap().starts_with("taxeld: no daemon answers at http://127.0.0.1:1"), "{said}");
    assert!(lines.next().unwrap().starts_with("help: taxeld run --config FILE"), "{said}");
    let wrong = taxeld(&["tare", "--server", "robot"]);
    assert_eq!(wrong.status.code(), Some(2));
}

/// The whole process stands still for a second, as on a machine that is overloaded.
#[test]
fn simulated_boards_that_were_held_up_do_not_send_too_fast_afterwards() {
    let demo = Demo::start(&["--bare"]);
    // It ends with 3 while modules are silent, as they are at first.
    let boards = || {
        let health = text(&demo.command(&["health", "--json"]).stdout);
        serde_json::from_str::<serde_json::Value>(&health).unwrap()["boards"].clone()
    };
    let scans = |boards: &serde_json::Value| boards[0]["scans"].as_str().unwrap().parse::<u64>().unwrap();
    demo.child.signal("-STOP");
    std::thread::sleep(Duration::from_secs(1)); // so long it stands still
    demo.child.signal("-CONT");
    let begun = scans(&boards());
    let later = loop {
        let boards = boards();
        if scans(&boards) > begun + 400 {
            break boards;
        }
    };
    assert!(!later.to_string().contains("too fast"), "{later}");
}
