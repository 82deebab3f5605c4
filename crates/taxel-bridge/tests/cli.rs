//! The binary as a process. `tests/bridge/run.py` takes the binary that is built for this test.

use std::process::{Command, Output};

#[allow(clippy::unwrap_used)] // a test that cannot start its process has failed
fn bridge(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_taxel-bridge")).args(arguments).output().unwrap()
}

#[test]
fn a_configuration_is_checked_and_refused_with_file_and_place() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("bridge.toml");
    let path = file.to_str().unwrap();
    let good = "robot = \"icub\"\n[fleet]\n[[patch]]\nname = \"arm\"\n";
    std::fs::write(&file, good).unwrap();
    let output = bridge(&["check", "--config", path]);
    assert!(output.status.success(), "{output:?}");
    for (bad, said) in [
        (good.replace("[fleet]", "[fleet]\nrate_hz = 2000.0"), "fleet.rate_hz = 2000"),
        (good.replace("[fleet]", "[zenoh]\nrouter = \"here\"\n[fleet]"), "here"),
        (good.replace("[fleet]", "[daemon]\nserver = \"a b\"\n[fleet]"), "daemon.server"),
        (good.replace("[fleet]", "[yarp]\nserver = \"nowhere\"").replace("arm", "left_arm"), "expected ADDRESS:PORT"),
        (good.replace("[fleet]", "[daemon]\ntoken_file = \"/no/such/token\"\n[fleet]"), "/no/such/token"),
    ] {
        std::fs::write(&file, &bad).unwrap();
        let output = bridge(&["check", "--config", path]);
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success() && error.contains(said), "{bad}\n{error}");
    }
}
