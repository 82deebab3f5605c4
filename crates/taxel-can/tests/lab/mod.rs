//! Virtual buses, the tools that play on them, and what came of it.
#![allow(clippy::unwrap_used, clippy::panic)] // these are tests, too

pub mod adapter;

use std::process::Command;
use std::time::Duration;

use taxel_can::{Batch, BusEvent, FrameSource, SocketCan, SocketCanOptions};
use taxel_wire::{CanId, Frame, TimedFrame};

/// Only a guard against hanging for ever; no test depends on it.
const HANG: Duration = Duration::from_secs(30);

/// A virtual bus of its own for each test; gone when the test is.
pub struct Vcan {
    pub name: String,
}

impl Vcan {
    /// A bus that is up; `None` outside the lab, said loudly.
    pub fn up(name: &str) -> Option<Self> {
        let bus = Self::named(name)?;
        bus.create();
        Some(bus)
    }

    /// A bus that is not there yet.
    pub fn named(name: &str) -> Option<Self> {
        if std::env::var_os("TAXELD_VCAN").is_none() {
            eprintln!(
                "SKIPPED: {name}: TAXELD_VCAN is not set; real buses are in the lab, see tests/vcan/run-can-tests"
            );
            return None;
        }
        Some(Self { name: name.to_owned() })
    }

    pub fn create(&self) {
        run("ip", &["link", "add", "dev", &self.name, "type", "vcan"]);
        self.set("up");
    }

    pub fn delete(&self) {
        run("ip", &["link", "del", &self.name]);
    }

    pub fn set(&self, state: &str) {
        run("ip", &["link", "set", &self.name, state]);
    }

    /// One frame, written as cansend wants it, from a process of its own.
    pub fn cansend(&self, frame: &str) {
        run("cansend", &[&self.name, frame]);
    }

    pub fn open(&self, ids: Option<&[CanId]>, tx: bool) -> SocketCan {
        open(&self.name, ids, tx)
    }
}

pub fn open(name: &str, ids: Option<&[CanId]>, tx: bool) -> SocketCan {
    SocketCan::open(SocketCanOptions { interface: name.to_owned(), ids: ids.map(<[_]>::to_vec), tx }).unwrap()
}

impl Drop for Vcan {
    fn drop(&mut self) {
        let _ = Command::new("ip").args(["link", "del", &self.name]).output();
    }
}

pub fn run(program: &str, args: &[&str]) {
    let output = Command::new(program).args(args).output().unwrap_or_else(|error| panic!("{program}: {error}"));
    assert!(output.status.success(), "{program} {args:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// All that a source said.
#[derive(Default)]
pub struct Heard {
    pub frames: Vec<TimedFrame>,
    pub errors: Vec<TimedFrame>,
    pub events: Vec<BusEvent>,
}

impl Heard {
    /// Reads on until `enough` says so.
    pub async fn until(&mut self, source: &mut SocketCan, enough: impl Fn(&Self) -> bool) {
        let mut batch = Batch::default();
        while !enough(self) {
            match tokio::time::timeout(HANG, source.next(&mut batch)).await {
                Ok(result) => result.unwrap(),
                Err(_) => panic!("nothing new; so far {} frames, {:?}", self.frames.len(), self.events),
            }
            assert!(!batch.is_empty());
            self.frames.append(&mut batch.frames);
            self.errors.append(&mut batch.errors);
            self.events.append(&mut batch.events);
        }
    }

    pub async fn frames(source: &mut SocketCan, count: usize) -> Self {
        let mut heard = Self::default();
        heard.until(source, |heard| heard.frames.len() >= count).await;
        heard
    }

    pub async fn event(source: &mut SocketCan, event: BusEvent) -> Self {
        let mut heard = Self::default();
        heard.until(source, |heard| heard.events.contains(&event)).await;
        heard
    }

    pub fn dropped(&self) -> u64 {
        let count = |event: &BusEvent| if let BusEvent::Dropped { frames } = event { *frames } else { 0 };
        self.events.iter().map(count).sum()
    }

    pub fn plain_frames(&self) -> Vec<Frame> {
        self.frames.iter().map(|timed| timed.frame).collect()
    }
}
