//! `taxeld top` on a pseudo terminal.

use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::OwnedFd;
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread;

use nix::pty::{Winsize, openpty};
use nix::sys::termios::tcgetattr;

use crate::common::{Ended, text};
use crate::demo::Demo;

const LEAVES: &str = "\u{1b}[?1049l";
const SHOWS_THE_CURSOR: &str = "\u{1b}[?25h";

/// Runs `top`, does something beside it, ends it by `end`, and gives what the terminal got.
fn run(
    demo: &Demo,
    folder: &std::path::Path,
    end: impl FnOnce(&mut File, &Ended),
    beside: impl FnOnce(&mut File),
) -> String {
    let size = Winsize { ws_row: 24, ws_col: 80, ws_xpixel: 0, ws_ypixel: 0 };
    let pty = openpty(&size, None).unwrap();
    let before = tcgetattr(&pty.slave).unwrap();
    let io = |slave: &OwnedFd| Stdio::from(slave.try_clone().unwrap());
    let mut command = Command::new(env!("CARGO_BIN_EXE_taxeld"));
    command.args(["top", "--color", "always"]).env("TAXELD_SERVER", &demo.server).current_dir(folder);
    let mut child = Ended(command.stdin(io(&pty.slave)).stdout(io(&pty.slave)).stderr(Stdio::null()).spawn().unwrap());
    let mut master = File::from(pty.master);
    let got = Arc::new(Mutex::new(Vec::new()));
    let (mut reads, kept) = (master.try_clone().unwrap(), Arc::clone(&got));
    thread::spawn(move || {
        let mut some = [0; 4096];
        while let Ok(n @ 1..) = reads.read(&mut some) {
            kept.lock().unwrap().extend(&some[..n]);
        }
    });
    // The skin and the keys are there.
    while !["\u{2580}", "quit", "modules"].iter().all(|part| text(&got.lock().unwrap()).contains(part)) {
        assert!(child.0.try_wait().unwrap().is_none(), "{}", text(&got.lock().unwrap()));
        thread::yield_now();
    }
    beside(&mut master);
    end(&mut master, &child);
    assert!(child.0.wait().unwrap().success());
    assert_eq!(tcgetattr(&pty.slave).unwrap(), before, "the terminal's mode");
    while !text(&got.lock().unwrap()).contains(SHOWS_THE_CURSOR) {
        thread::yield_now();
    }
    text(&got.lock().unwrap())
}

#[test]
fn top_records_on_a_key_and_leaves_the_terminal_as_it_was_also_when_it_is_killed() {
    let demo = Demo::start(&[]);
    let folder = tempfile::tempdir().unwrap();
    let recording = || std::fs::read_dir(folder.path()).unwrap().next().map(|file| file.unwrap().path());
    let lines = || recording().map_or_else(String::new, |file| std::fs::read_to_string(file).unwrap());
    let quit = |terminal: &mut File, _: &Ended| terminal.write_all(b"q").unwrap();
    let shown = run(&demo, folder.path(), quit, |terminal| {
        terminal.write_all(b"r").unwrap();
        while lines().lines().count() < 5 {
            thread::yield_now();
        }
    });
    assert!(shown.contains(LEAVES), "{shown:?}");
    for line in lines().lines() {
        let sample: serde_json::Value = serde_json::from_str(line).unwrap();
        assert_eq!(sample["patch"], "left_forearm");
    }
    let shown = run(&demo, folder.path(), |_, child| child.signal("-TERM"), |_| ());
    assert!(shown.contains(LEAVES), "{shown:?}");
    assert!(demo.refused(&["top"]).contains("needs a terminal"));
}
