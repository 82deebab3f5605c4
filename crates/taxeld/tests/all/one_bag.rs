//! Two patches in one bag: a command, a session and a model set for each, and one ramp.

use crate::common::*;

/// The simulated forearm as two patches, a board each, and one gauge.
const CONFIG: &str = r#"
listen = ["unix:s"]
[store]
path = "store.db"
[[bus]]
name = "skin"
source = "sim"
[[patch]]
name = "upper"
bus = "skin"
listen_only = true
area_mm2 = 42.1
boards = [{ address = 13, modules = "0-15" }]
gauge = { id = 0x3A1, signal = "0|32@1-", unit = "Pa" }
[[patch]]
name = "lower"
bus = "skin"
listen_only = true
area_mm2 = 42.1
boards = [{ address = 12, modules = "0-6" }]
gauge = { id = 0x3A1, signal = "0|32@1-", unit = "Pa" }
"#;

/// Patch and state of each session.
fn sessions(folder: &Path) -> Vec<String> {
    let listed = text(&taxeld_in(folder, &["sessions", "list", "--json"]).stdout);
    let sessions = listed.lines().map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap());
    let mut found: Vec<String> =
        sessions.map(|s| format!("{} {}", s["patch"].as_str().unwrap(), s["state"].as_str().unwrap())).collect();
    found.sort_unstable();
    found
}

/// What came of calibrating both patches at the same time.
fn calibrate(folder: &Path) -> [Output; 2] {
    let options = ["--target", "40", "--confirmed-by", "test", "--yes"];
    std::thread::scope(|scope| {
        let of =
            |patch| scope.spawn(move || taxeld_in(folder, &[&["calibrate", "--patch", patch][..], &options].concat()));
        ["upper", "lower"].map(of).map(|command| command.join().unwrap())
    })
}

#[test]
fn two_patches_in_one_bag_are_calibrated_by_one_ramp_and_one_that_fails_ends_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let daemon = run_in(folder.path(), CONFIG);
    for done in calibrate(folder.path()) {
        assert!(done.status.success(), "{}{}", text(&done.stdout), text(&done.stderr));
    }
    assert_eq!(sessions(folder.path()), ["lower SESSION_STATE_ACTIVE", "upper SESSION_STATE_ACTIVE"]);
    drop(daemon);

    let folder = tempfile::tempdir().unwrap();
    let _daemon = run_in(folder.path(), &format!("{CONFIG}[patch.session]\nrise_max_kpa_per_s = 0.1\n"));
    let [upper, lower] = calibrate(folder.path());
    assert!(upper.status.success(), "{}{}", text(&upper.stdout), text(&upper.stderr));
    let errors = text(&lower.stderr);
    assert!(errors.contains("is FAILED") && errors.contains("the pressure rose too fast"), "{errors}");
    assert_eq!(sessions(folder.path()), ["lower SESSION_STATE_FAILED", "upper SESSION_STATE_ACTIVE"]);
}
