//! The frames of recordings, in the order in which the daemon took them.

use std::collections::VecDeque;
use std::fs::File;
use std::io::Read;
use std::path::PathBuf;

use mcap::McapError;
use mcap::io::MessageReader;
use mcap::sans_io::LinearReaderOptions;
use prost::Message as _;
use taxel_can::{LogReport, RecordedFrames};
use taxel_proto::v1::CanFrames;
use taxel_skin::Time;
use taxel_wire::{FrameKind, TimedFrame};

use crate::frames::frame_of;
use crate::schema::PACKAGE;

/// Largest record, and largest chunk before and after compression, in bytes. Our own have about one MiB.
const CHUNK_BYTES_MAX: usize = 32 << 20;

/// Buses are recorded side by side: a clock that goes back by less than this goes on. By more it does at a start of the computer.
const BACK_NS: i64 = 5_000_000_000;

/// No bus is silent for so long while a daemon runs: somebody put recordings together.
const FORWARD_NS: i64 = 24 * 3600 * 1_000_000_000;

/// What is taken to have passed while a computer was started anew: no zero outlives a silence of this length.
const OFF_NS: i64 = 10_000_000_000;

/// The messages of a file, as far as it is whole.
type Messages = MessageReader<Box<dyn Read + Send>>;

fn messages(file: impl Read + Send + 'static) -> Messages {
    let options = LinearReaderOptions::default().with_prevalidate_chunk_crcs(true);
    MessageReader::new_with_options(Box::new(file), options.with_record_length_limit(CHUNK_BYTES_MAX))
}

/// The frames of some files, one after the other. A file that cannot be read to its end is told in the report.
pub struct Recording {
    files: VecDeque<PathBuf>,
    open: Option<(String, Messages)>,
    /// Only frames of this bus, by its name or its interface.
    wanted: Option<String>,
    /// Frames of the newest message that are not handed out yet.
    waiting: VecDeque<TimedFrame>,
    clock: Clock,
    lost: u64,
    report: LogReport,
}

impl Recording {
    /// The frames of `wanted`, by name or interface, or of all buses, in these files.
    #[must_use]
    pub fn of_files(files: impl IntoIterator<Item = PathBuf>, wanted: Option<String>) -> Self {
        Self {
            files: files.into_iter().collect(),
            open: None,
            wanted,
            waiting: VecDeque::new(),
            clock: Clock::default(),
            lost: 0,
            report: LogReport::default(),
        }
    }

    /// The same of something that is open already; `name` is for messages.
    #[must_use]
    pub fn of_reader(name: String, reader: impl Read + Send + 'static, wanted: Option<String>) -> Self {
        let open = Some((name, messages(reader)));
        Self { open, ..Self::of_files([], wanted) }
    }

    /// Takes what comes next of the files; `false` at their end.
    fn read_on(&mut self) -> bool {
        let Some((name, open)) = &mut self.open else {
            let Some(path) = self.files.pop_front() else { return false };
            let name = path.display().to_string();
            match File::open(&path) {
                Ok(file) => self.open = Some((name, messages(file))),
                Err(error) => self.report.faults.push(format!("{name}: {error}")),
            }
            return true;
        };
        match open.next() {
            Some(Ok(message)) => {
                let schema = message.channel.schema.as_ref();
                if schema.is_some_and(|schema| schema.name.strip_prefix(PACKAGE) == Some(".CanFrames")) {
                    match CanFrames::decode(&*message.data) {
                        Ok(frames) => self.take(&frames),
                        Err(_) => self.refuse(),
                    }
                }
            }
            None => self.open = None,
            Some(Err(fault)) => {
                self.report.faults.push(match fault {
                    McapError::UnexpectedEof => {
                        format!("{name}: the file was cut off: it was not closed, or is still being written")
                    }
                    fault => format!("{name}: {fault}"),
                });
                self.open = None;
            }
        }
        true
    }

    fn refuse(&mut self) {
        self.report.lines += 1;
        self.report.bad += 1;
    }

    fn take(&mut self, message: &CanFrames) {
        let name = if message.interface.is_empty() { &message.bus } else { &message.interface };
        self.report.note_interface(name);
        if self.wanted.as_ref().is_some_and(|wanted| *wanted != message.bus && *wanted != message.interface) {
            self.report.lines += message.frames.len() as u64;
            self.report.other_interface += message.frames.len() as u64;
            return;
        }
        let lost = message.kernel_lost.saturating_add(message.not_recorded);
        if lost > 0 {
            self.lost = self.lost.saturating_add(lost);
            self.report.lost = self.report.lost.saturating_add(lost);
        }
        let first_ns = message.monotonic_ns.saturating_add(self.clock.offset(message));
        for frame in &message.frames {
            let Some(decoded) = frame_of(frame) else {
                self.refuse();
                continue;
            };
            self.report.lines += 1;
            self.report.frames += 1;
            self.report.errors += u64::from(decoded.kind == FrameKind::Error);
            let time = Time::from_nanos(first_ns.saturating_add(frame.after_ns));
            self.waiting.push_back(TimedFrame { time, frame: decoded });
        }
    }
}

impl RecordedFrames for Recording {
    fn next_batch(&mut self, frames: &mut Vec<TimedFrame>, max: usize) -> bool {
        let until = frames.len() + max;
        loop {
            let room = (until - frames.len()).min(self.waiting.len());
            frames.extend(self.waiting.drain(..room));
            if frames.len() == until {
                return true;
            }
            if !self.read_on() {
                return false;
            }
            if self.lost > 0 {
                return true; // what waits now comes behind the loss
            }
        }
    }

    fn take_lost(&mut self) -> u64 {
        std::mem::take(&mut self.lost)
    }

    fn report(&self) -> &LogReport {
        &self.report
    }
}

/// The daemon's own clock, with one label since 1970 for all of it, so that a step of the wall clock moves no frame against
/// another. Each start of a computer begins it anew, and nobody knows what time that computer thought it was.
#[derive(Default)]
struct Clock {
    /// The newest moment on the daemon's clock, in ns, and what to add to it.
    newest: Option<(i64, i64)>,
}

impl Clock {
    /// What to add to the daemon's clock.
    fn offset(&mut self, message: &CanFrames) -> i64 {
        let now = message.monotonic_ns;
        let offset = match self.newest {
            None => {
                let label = message.time.unwrap_or_default();
                let wall = label.seconds.saturating_mul(1_000_000_000).saturating_add(i64::from(label.nanos));
                wall.saturating_sub(now)
            }
            Some((newest, offset))
                if (newest.saturating_sub(BACK_NS)..=newest.saturating_add(FORWARD_NS)).contains(&now) =>
            {
                offset
            }
            Some((newest, offset)) => newest.saturating_add(offset).saturating_add(OFF_NS).saturating_sub(now),
        };
        self.newest = Some((now, offset));
        offset
    }
}
