//! An adapter on a serial line, whose controller has the states that a virtual bus lacks.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, Command, Stdio};

use taxel_can::SocketCan;

use super::{open, run};

/// An interface of the kernel's driver slcan; gone when this is.
pub struct Adapter {
    pub name: String,
    process: Child,
}

impl Adapter {
    /// An adapter that is plugged in and up; `None` outside of user-mode Linux, said loudly.
    pub fn plugged(name: &str) -> Option<Self> {
        if std::env::var("TAXELD_LAB").as_deref() != Ok("uml") {
            eprintln!("SKIPPED: {name}: the driver slcan is there in user-mode Linux, see tests/vcan/run-can-tests");
            return None;
        }
        let mut process = Command::new("python3")
            .args([concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/vcan/adapter.py"), name])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
        assert_eq!(line, "up\n");
        Some(Self { name: name.to_owned(), process })
    }

    /// What the adapter tells its driver.
    pub fn says(&mut self, message: &str) {
        writeln!(self.process.stdin.as_mut().unwrap(), "{message}").unwrap();
    }

    pub fn set(&self, state: &str) {
        run("ip", &["link", "set", &self.name, state]);
    }

    pub fn open(&self) -> SocketCan {
        open(&self.name, None, true)
    }
}

impl Drop for Adapter {
    fn drop(&mut self) {
        drop(self.process.stdin.take());
        let _ = self.process.wait();
    }
}
