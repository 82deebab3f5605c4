//! `taxeld demo` as a process of its own, and commands against it.

use crate::common::*;

/// A demo.
pub struct Demo {
    pub child: Ended,
    pub server: String,
    _memory: tempfile::TempDir,
}

impl Demo {
    /// Starts a demo on a port of its own and waits until it says that it is live.
    pub fn start(arguments: &[&str]) -> Self {
        // Two that start at once would both find the usual folder free.
        let memory = tempfile::Builder::new().prefix("taxeld-test-").tempdir_in("/dev/shm").unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_taxeld"));
        command.args(["demo", "--listen", "127.0.0.1:0"]).args(arguments);
        if !arguments.contains(&"--shared-memory") {
            command.arg("--shared-memory").arg(memory.path());
        }
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let live = lines.find_map(|line| {
            let line = line.unwrap();
            line.starts_with("The skin is now").then(|| line.rsplit_once(" on ").unwrap().1.to_owned())
        });
        let address = live.expect("the demo says where it listens");
        let server = address.trim_end_matches('.').to_owned();
        std::thread::spawn(move || lines.for_each(drop)); // its text goes on and must not block it
        Self { child: Ended(child), server, _memory: memory }
    }

    pub fn command(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_taxeld"));
        command.args(arguments).env("TAXELD_SERVER", &self.server).stdin(Stdio::null());
        command.output().unwrap()
    }

    /// What a command that must succeed prints.
    pub fn succeeds(&self, arguments: &[&str]) -> String {
        let output = self.command(arguments);
        assert!(output.status.success(), "{arguments:?}: {}{}", text(&output.stdout), text(&output.stderr));
        text(&output.stdout)
    }

    /// What a command says that the daemon must refuse.
    pub fn refused(&self, arguments: &[&str]) -> String {
        let output = self.command(arguments);
        assert_eq!(output.status.code(), Some(3), "{arguments:?}: {}{}", text(&output.stdout), text(&output.stderr));
        text(&output.stderr)
    }

    /// The JSON that a command prints, a value a line.
    pub fn json(&self, arguments: &[&str]) -> Vec<serde_json::Value> {
        let printed = self.succeeds(arguments);
        printed.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }

    /// Repeats a command until it succeeds, as an operator does: the mass comes and goes every five seconds, and a zero
    /// that is lost (on a busy machine the simulated boards fall silent) is taken again.
    pub fn until_good(&self, arguments: &[&str]) -> String {
        let mut said = String::new();
        for _ in 0..200 {
            let output = self.command(arguments);
            if output.status.success() {
                return text(&output.stdout);
            }
            said = text(&output.stderr);
            assert_eq!(output.status.code(), Some(3), "{arguments:?}: {said}");
            if said.contains("zero") {
                self.command(&["tare"]);
            }
        }
        panic!("{arguments:?} never succeeded: {said}");
    }
}
