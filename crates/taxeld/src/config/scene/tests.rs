use std::path::Path;

use super::super::examine_text;

/// A small configuration; `top` are keys of the file, `rest` sections, `patch` keys of the patch.
fn text(top: &str, patch: &str, rest: &str) -> String {
    format!(
        "{top}\n[store]\npath = \"t.db\"\n[[bus]]\nname = \"b\"\ninterface = \"can0\"\n[[patch]]\nname = \"p\"\nbus = \"b\"\n\
         {patch}\n{rest}\n"
    )
}

const BOARD: &str = "boards = [{ address = 13, modules = \"0-3\" }]";

/// Keys and words of all that is wrong.
fn told(text: &str) -> Vec<(String, String)> {
    let problems = examine_text(Path::new("t.toml"), text).err();
    let all = problems.iter().flat_map(|problems| problems.all());
    all.map(|problem| (problem.key.clone(), problem.message.clone())).collect()
}

fn keys(text: &str) -> Vec<String> {
    told(text).into_iter().map(|(key, _)| key).collect()
}

#[cfg(feature = "sim")]
#[test]
fn a_force_says_whether_a_simulator_makes_it() {
    let path = Path::new("t.toml");
    let demo = include_str!("../../demo_config.toml");
    let on_a_bus = demo.replace("source = \"sim\"", "source = \"socketcan\"\ninterface = \"can0\"");
    assert_ne!(demo, on_a_bus);
    for (text, simulated) in [(demo, true), (&on_a_bus, false)] {
        let scene = examine_text(path, text).unwrap().1;
        assert_eq!(scene.plan.patches[0].simulated, simulated, "{text}");
    }
}

#[test]
fn entries_of_one_address_are_one_board_with_modules_of_several_settings() {
    let path = Path::new("t.toml");
    let of = |boards: &str| {
        let text = text("", &format!("boards = [{boards}]"), "");
        examine_text(path, &text).map(|(_, scene)| scene.plan.patches[0].clone())
    };
    let hand = "{ address = 14, modules = \"8-11 palm\" }, { address = 14, modules = \"0-4 fingertip\", shift = 0, cdc_offset = 0x2000 }";
    let plan = of(hand).unwrap();
    assert_eq!((plan.patch.boards().len(), plan.patch.modules().len(), plan.patch.taxels().len()), (1, 9, 104));
    let runs: Vec<_> = plan.bring_up[0].triangles.iter().map(|t| (t.first.get(), t.last.get(), t.shift)).collect();
    assert_eq!(runs, [(8, 11, 2), (0, 4, 0)]);
    for (boards, says) in [
        ("{ address = 14, modules = \"0-4\" }, { address = 14, modules = \"4-5\" }", "module 4 is there twice"),
        ("{ address = 14, modules = \"0\" }, { address = 14, modules = \"1\", no_load = 200 }", "expected one"),
        (
            "{ address = 14, modules = \"0\" }, { address = 1, modules = \"1\" }, { address = 14, modules = \"2\" }",
            "14",
        ),
        ("{ address = 15, modules = \"0\" }", "set listen_only = true"),
        ("{ address = 16, modules = \"0\" }", "16"),
        ("{ address = 1, modules = \"0-16\" }", "board 1: modules = \"0-16\""),
    ] {
        let why = of(boards).unwrap_err().to_string();
        assert!(why.contains(says), "{boards}: {why}");
    }
}

#[test]
fn limits_of_a_session_that_exclude_each_other_are_told() {
    let of = |session: &str| keys(&text("", BOARD, &format!("[patch.session]\n{session}")));
    assert_eq!(
        of("target_kpa = 5\nnoise_band_kpa = 9"),
        ["patch[0].session.target_kpa", "patch[0].session.noise_band_kpa"]
    );
    let bag = told(&text("", BOARD, "[patch.session]\ntarget_kpa = 150"));
    assert!(bag.len() == 1 && bag[0].1.contains("pressurised_chamber = true"), "{bag:?}");
    assert!(of("target_kpa = 95").is_empty() && of("target_kpa = 150\npressurised_chamber = true").is_empty());
    assert_eq!(of("target_kpa = 1001\npressurised_chamber = true").len(), 1);
    assert_eq!(of("rise_max_kpa_per_s = nan"), ["patch[0].session.rise_max_kpa_per_s"]);
    let gauge = "gauge = { id = 1, signal = \"0|8@1+\", unit = \"Pa\", gain_uncertainty = 2.0, noise_kpa = -1.0 }";
    let found = keys(&text("", &format!("{BOARD}\n{gauge}\nstale_periods = 1"), ""));
    let expected = ["gauge.gain_uncertainty", "gauge.noise_kpa", "stale_periods"];
    assert_eq!(found, expected.map(|key| format!("patch[0].{key}")));
}

#[test]
fn a_slow_array_has_the_time_that_its_period_takes() {
    let folder = tempfile::tempdir().unwrap();
    let dbc = "VERSION \"\"\nNS_ :\nBS_:\nBU_: D\nBO_ 1 A: 1 D\n SG_ T : 0|8@1+ (1,0) [0|0] \"\" D\n";
    std::fs::write(folder.path().join("a.dbc"), dbc).unwrap();
    let path = folder.path().join("t.toml");
    let at = |ms: u32| {
        let array = "array = { dbc = \"a.dbc\", taxels = [\"A.T\"] }";
        let text = text("", &format!("period_ms = {ms}\narea_mm2 = 16.0\n{array}"), "");
        examine_text(&path, &text).map(|(_, scene)| scene.plan.patches[0].clone())
    };
    let plan = at(5000).unwrap();
    let limits = [plan.live.stale_after, plan.live.power_cycle_after, plan.tare.duration];
    assert_eq!(limits.map(|limit| limit.as_secs()), [15, 15, 50], "three periods, and ten scans for a zero");
    assert_eq!(plan.fault_limits().stale_after_s, 25.0, "as of the slowest board, by its period");
    assert!(at(5001).unwrap_err().to_string().contains("period_ms = 5001: expected 1 to 5000"));
}

#[test]
fn the_page_is_on_a_loopback_address_and_recordings_and_the_store_have_room() {
    let of = |rest: &str| keys(&text("", BOARD, rest));
    for rest in [
        "[page]\nhosts = [\"robot.lab\", \"x-1.y_2\"]",
        "[page]\nlisten = \"[::1]:1\"",
        "[record]\npath = \"r\"\nbudget_mb = 16",
    ] {
        assert_eq!(of(rest), Vec::<String>::new(), "{rest}");
    }
    for (rest, key) in [
        ("[page]\nlisten = \"0.0.0.0:8080\"", "page.listen"),
        ("[page]\nhosts = [\"robot:80\"]", "page.hosts"),
        ("[page]\nhosts = [\"\"]", "page.hosts"),
        ("[record]\npath = \"r\"\nbudget_mb = 15", "record.budget_mb"),
    ] {
        assert_eq!(of(rest), [key], "{rest}");
    }
    assert_eq!(keys(&text("", BOARD, "").replace("t.db\"", "t.db\"\nkeep_mb = 0")), ["store.keep_mb"]);
}

#[test]
fn nobody_reads_the_shared_memory_who_may_not_observe() {
    let closed = "[access]\nobservers = [\"group:skin\"]";
    for (rest, is_right) in [
        ("[shared_memory]".to_owned(), true),
        (format!("[shared_memory]\n{closed}"), false),
        (format!("[shared_memory]\ngroup = \"other\"\n{closed}"), false),
        (format!("[shared_memory]\ngroup = \"skin\"\n{closed}"), true),
        ("[shared_memory]\ngroup = \"skin\"\n[access]\noperators = [\"group:skin\"]".to_owned(), true),
    ] {
        let found = keys(&text("", BOARD, &rest));
        assert_eq!(found.is_empty(), is_right, "{rest}: {found:?}");
    }
    assert_eq!(keys(&text("", BOARD, "[shared_memory]\npath = \"here\"")), ["shared_memory.path"]);
}

#[test]
fn names_are_there_once_and_refer_to_what_is_there() {
    let second = format!("[[bus]]\nname = \"b\"\n[[patch]]\nname = \"p\"\nbus = \"c\"\n{BOARD}");
    let found = keys(&text("", BOARD, &second));
    assert_eq!(found, ["bus[1]", "bus[1].name", "patch[1].name", "patch[1].bus"]);
    assert_eq!(keys(&text("", "", "")), ["patch[0]"], "nothing says what its taxels are");
    let wrong = text("", BOARD, "").replace("can0", "").replace("\"p\"", "\"a b\"");
    assert_eq!(keys(&wrong), ["bus[0]", "patch[0].name"]);
}

const PUSHED: &str = "push = { taxels = 64, count_max = 4095 }\ngrid = { rows = 8, columns = 8, pitch_mm = 4.0 }";

/// A patch whose scans are pushed.
fn pushed(patch: &str, rest: &str) -> String {
    let bus = "source = \"push\"\n[[bus]]\nname = \"c\"\ninterface = \"can0\"";
    text("", patch, rest).replace("interface = \"can0\"", bus)
}

#[test]
fn a_pushed_patch_has_modules_a_grid_and_no_frames() {
    let path = Path::new("t.toml");
    let plan = |gauge: &str| {
        let text = pushed(&format!("{PUSHED}\n{gauge}"), "");
        examine_text(path, &text).unwrap().1.plan.patches[0].clone()
    };
    let with = plan("gauge = { gain_uncertainty = 0.01, offset_uncertainty_kpa = 0.2, noise_kpa = 0.03 }");
    assert_eq!((with.patch.taxels().len(), with.patch.modules().len(), with.patch.counts().top()), (64, 4, 4095));
    assert_eq!((with.devices.len(), with.devices[0].ids().count()), (1, 0));
    assert!(with.has_gauge() && with.gauge.is_none() && !with.configures() && with.geometry.is_some());
    assert_eq!([with.fit.gauge.gain_rel, with.fit.gauge.offset_kpa, with.fit.gauge.noise_kpa], [0.01, 0.2, 0.03]);
    assert!(!plan("").has_gauge());
    assert!(plan("gauge = { bus = \"c\", id = 0x200, signal = \"0|32@1-\", unit = \"Pa\" }").gauge.is_some());
}

#[test]
fn what_cannot_be_pushed_is_refused_with_key_and_value() {
    let gauge = "gauge = { id = 0x200, signal = \"0|32@1-\", unit = \"Pa\" }";
    for (text, says) in [
        (pushed(&PUSHED.replace("taxels = 64", "taxels = 0"), ""), "push.taxels = 0: expected 1 to 4080"),
        (pushed(&PUSHED.replace("taxels = 64", "taxels = 5000"), ""), "push.taxels = 5000: expected 1 to 4080"),
        (pushed(&PUSHED.replace("taxels = 64", "taxels = 63"), ""), "8 rows of 8 columns for 63 taxels"),
        (pushed(&PUSHED.replace("4095", "0"), ""), "push.count_max = 0"),
        (pushed(&format!("{PUSHED}\n{BOARD}"), ""), "expected one of boards, [patch.array] and push"),
        (pushed(&format!("{PUSHED}\n{gauge}"), ""), "a gauge sends over a CAN bus"),
        (pushed(BOARD, ""), "expected push = {"),
        (pushed(PUSHED, &format!("[[patch]]\nname = \"q\"\nbus = \"b\"\n{PUSHED}")), "expected one patch on it"),
        (text("", PUSHED, ""), "push needs a bus with source = \"push\", and `b` has none"),
        (pushed("push = { taxels = 64 }", ""), "area_mm2 or grid is missing"),
    ] {
        let found = told(&text);
        assert!(found.iter().any(|(_, words)| words.contains(says)), "{text}\n{found:?}");
    }
}
