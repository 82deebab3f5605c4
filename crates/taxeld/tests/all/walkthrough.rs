//! The walk-through as it stands: its lines are run by a shell.

use crate::common::*;
use crate::demo::Demo;

/// Each line of the walk-through that begins with `$`, by a shell, in order and in one folder. A line is repeated as an operator
/// would: the mass comes and goes, and the skin recovers from it.
#[test]
fn the_walk_through_holds_as_it_stands() {
    let demo = Demo::start(&[]);
    let folder = tempfile::tempdir().unwrap();
    let programs = Path::new(env!("CARGO_BIN_EXE_taxeld")).parent().unwrap().display();
    let path = format!("{programs}:{}", std::env::var("PATH").unwrap());
    let lines: Vec<&str> =
        include_str!("../../doc/walkthrough.md").lines().filter_map(|line| line.strip_prefix("    $ ")).collect();
    assert!(lines.iter().any(|line| line.starts_with("taxeld calibrate")), "{lines:?}");
    for line in lines {
        let run = || {
            let mut shell = Command::new("bash");
            shell.args(["-o", "pipefail", "-c", line]).current_dir(folder.path()).env("PATH", &path);
            shell.env("TAXELD_SERVER", &demo.server).stdin(Stdio::null()).output().unwrap()
        };
        let mut output = run();
        let patience = Instant::now() + Duration::from_secs(120);
        while !output.status.success() && Instant::now() < patience {
            assert_eq!(output.status.code(), Some(3), "{line}: {}{}", text(&output.stdout), text(&output.stderr));
            output = run();
        }
        assert!(output.status.success(), "{line}: {}{}", text(&output.stdout), text(&output.stderr));
        if line.contains("models import") || line.contains("models use") {
            let said = text(&output.stdout) + &text(&output.stderr);
            assert!(
                said.contains("the zero of its calibration") && said.contains(" taxels (") && said.contains("Good. "),
                "{line}: {said}"
            );
        }
    }
    demo.until_good(&["watch", "--once", "--quiet", "--within", "10"]);
}
