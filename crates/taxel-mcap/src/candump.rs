//! The frames of recordings as the text of a candump log: so everything that reads such a log reads a recording too, with
//! the same checks.

use std::collections::{HashSet, VecDeque};
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::PathBuf;

use mcap::records::{Record as Parsed, op};
use prost::Message as _;
use taxel_proto::v1::CanFrames;
use taxel_skin::Time;
use taxel_wire::candump::write_line;

use crate::chunks::{Chunks, ReadFault, Record};
use crate::file::{ABOUT, BOOT};
use crate::frames::frame_of;
use crate::schema::PACKAGE;

/// Largest message of frames that is decoded, in bytes: decoded it may take fifty times as much. Our own have a few
/// kilobytes.
const MESSAGE_BYTES_MAX: usize = 256 * 1024;

/// Stands for a bus whose name a candump log cannot hold.
const NO_NAME: &str = "bus";

/// A recording to read.
pub enum Input {
    /// A file, opened when its turn comes.
    File(PathBuf),
    /// Something that is open already, and its name for messages.
    Open(String, Box<dyn Read + Send>),
}

/// How a recording ended, and what of it is not in the text.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ending {
    /// Why a file could not be read to its end, with its name: everything before was.
    pub faults: Vec<String>,
    /// Frames in the text.
    pub frames: u64,
    /// Frames of other buses.
    pub other_bus: u64,
    /// Frames that no bus can carry, and messages that are none.
    pub bad: u64,
    /// Frames that the recorder or the kernel lost.
    pub lost: u64,
}

impl Ending {
    /// What a user should know, a line each.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        let mut lines: Vec<String> =
            self.faults.iter().map(|fault| format!("{fault}; everything before it was read")).collect();
        if self.bad > 0 {
            lines.push(format!("{} frames or messages of the recording are none", self.bad));
        }
        if self.lost > 0 {
            lines.push(format!("{} frames are missing in the recording: kernel or disk were behind", self.lost));
        }
        lines
    }
}

/// The text of the frames of some recordings, one after the other.
pub struct CandumpText {
    inputs: VecDeque<Input>,
    open: Option<(String, Messages)>,
    /// Only frames of this bus, by its name or its interface.
    wanted: Option<String>,
    /// Text that is not yet read, from `at` on.
    text: String,
    at: usize,
    /// A moment on the daemon's clock, in ns, and what to add to it for a label since 1970.
    anchor: Option<(i64, i64)>,
    /// Of which start of a computer the frames are, where their file says so.
    awake: Option<Awake>,
    /// The computer was off between the last frames and those that come.
    was_off: bool,
    ending: Ending,
    told: Box<dyn Fn(&Ending) + Send>,
}

impl CandumpText {
    /// The frames of `wanted`, by name or interface, or of all buses. `told` hears once how it ended.
    #[must_use]
    pub fn new(inputs: Vec<Input>, wanted: Option<String>, told: impl Fn(&Ending) + Send + 'static) -> Self {
        Self {
            inputs: inputs.into(),
            open: None,
            wanted,
            text: String::new(),
            at: 0,
            anchor: None,
            awake: None,
            was_off: false,
            ending: Ending::default(),
            told: Box::new(told),
        }
    }

    /// Puts the lines of the next message into the text; `false` at the end of everything.
    fn refill(&mut self) -> bool {
        self.text.clear();
        self.at = 0;
        loop {
            let Some((name, messages)) = &mut self.open else {
                match self.inputs.pop_front() {
                    Some(input) => self.begin(input),
                    None => return false,
                }
                continue;
            };
            match messages.next() {
                Ok(Some(Found::Frames(frames))) => {
                    self.write(&frames);
                    if !self.text.is_empty() {
                        return true;
                    }
                }
                Ok(Some(Found::Awake(awake))) => {
                    let before = self.awake.replace(awake);
                    self.was_off |= before != self.awake;
                }
                Ok(Some(Found::Bad)) => self.ending.bad += 1,
                Ok(None) => self.open = None,
                Err(fault) => {
                    self.ending.faults.push(format!("{name}: {fault}"));
                    self.open = None;
                }
            }
        }
    }

    fn begin(&mut self, input: Input) {
        let (name, reader): (String, Box<dyn Read + Send>) = match input {
            Input::Open(name, reader) => (name, reader),
            Input::File(path) => match File::open(&path) {
                Ok(file) => (path.display().to_string(), Box::new(file)),
                Err(error) => return self.ending.faults.push(format!("{}: {error}", path.display())),
            },
        };
        self.open = Some((name, Messages::new(reader)));
    }

    fn write(&mut self, message: &CanFrames) {
        let frames = message.frames.len() as u64;
        if self.wanted.as_ref().is_some_and(|wanted| *wanted != message.bus && *wanted != message.interface) {
            self.ending.other_bus += frames;
            return;
        }
        self.ending.lost = self.ending.lost.saturating_add(message.kernel_lost).saturating_add(message.not_recorded);
        let offset = self.offset(message);
        let name = name_of(message);
        let time =
            |after_ns: i64| Time::from_nanos(message.monotonic_ns.saturating_add(after_ns).saturating_add(offset));
        for frame in &message.frames {
            let Some(decoded) = frame_of(frame) else {
                self.ending.bad += 1;
                continue;
            };
            if write_line(&mut self.text, time(frame.after_ns), name, &decoded).is_ok() {
                self.ending.frames += 1;
            }
        }
    }

    /// What to add to the daemon's clock for a label since 1970. It is kept, so that a step of the wall clock moves no
    /// frame against another, until the daemon's own clock begins anew or has stood still while nobody recorded. A computer
    /// without a battery may have forgotten then what time it is.
    fn offset(&mut self, message: &CanFrames) -> i64 {
        let now = message.monotonic_ns;
        let label = message.time.unwrap_or_default();
        let wall = label.seconds.saturating_mul(1_000_000_000).saturating_add(i64::from(label.nanos));
        let offset = match self.anchor {
            None => wall.saturating_sub(now),
            Some((newest, offset)) if self.was_off || now < newest.saturating_sub(BACK_NS) => {
                let off_until = newest.saturating_add(offset).saturating_add(OFF_NS);
                wall.max(off_until).saturating_sub(now)
            }
            Some((_, offset)) => offset,
        };
        (self.anchor, self.was_off) = (Some((now, offset)), false);
        offset
    }
}

/// Buses are recorded side by side: a clock that goes back by less than this goes on.
const BACK_NS: i64 = 5_000_000_000;

/// For how long a computer is off at least when it is started anew; no zero outlives a silence of this length.
const OFF_NS: i64 = 10_000_000_000;

/// Start of a computer, as a file has it in its metadata.
type Awake = [Option<String>; 1];

/// What is longer is neither; ours have 32 characters at most.
const AWAKE_BYTES_MAX: usize = 64;

/// By which name a log knows the bus of these frames.
fn name_of(message: &CanFrames) -> &str {
    let name = [&message.interface, &message.bus].into_iter().find(|name| is_name(name));
    name.map_or(NO_NAME, String::as_str)
}

fn is_name(name: &str) -> bool {
    !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_graphic())
}

impl Read for CandumpText {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        if self.at == self.text.len() && !self.refill() {
            let told = std::mem::replace(&mut self.told, Box::new(|_| ()));
            told(&self.ending);
            return Ok(0);
        }
        let rest = &self.text.as_bytes()[self.at..];
        let length = rest.len().min(into.len());
        into[..length].copy_from_slice(&rest[..length]);
        self.at += length;
        Ok(length)
    }
}

fn is_frames(name: &str, encoding: &str) -> bool {
    encoding == "protobuf" && name.strip_prefix(PACKAGE) == Some(".CanFrames")
}

/// What was found in a recording.
enum Found {
    Frames(CanFrames),
    /// Of which start of a computer what follows is.
    Awake(Awake),
    Bad,
}

/// The messages of frames in one file. Of what a file defines only small numbers are kept.
struct Messages {
    chunks: Chunks<BufReader<Box<dyn Read + Send>>>,
    schemas: HashSet<u16>,
    channels: HashSet<u16>,
}

impl Messages {
    fn new(input: Box<dyn Read + Send>) -> Self {
        Self { chunks: Chunks::new(BufReader::new(input)), schemas: HashSet::new(), channels: HashSet::new() }
    }

    fn next(&mut self) -> Result<Option<Found>, ReadFault> {
        while let Some(Record { op, body }) = self.chunks.next_record()? {
            if !matches!(op, op::SCHEMA | op::CHANNEL | op::MESSAGE | op::METADATA) {
                continue;
            }
            match mcap::parse_record(op, body)? {
                Parsed::Metadata(about) if about.name == ABOUT => {
                    let short = |key| about.metadata.get(key).filter(|text| text.len() <= AWAKE_BYTES_MAX).cloned();
                    let awake = [BOOT].map(short);
                    if awake.iter().any(Option::is_some) {
                        return Ok(Some(Found::Awake(awake)));
                    }
                }
                Parsed::Schema { header, .. } if is_frames(&header.name, &header.encoding) => {
                    self.schemas.insert(header.id);
                }
                Parsed::Channel(channel) if self.schemas.contains(&channel.schema_id) => {
                    self.channels.insert(channel.id);
                }
                Parsed::Message { header, data } if self.channels.contains(&header.channel_id) => {
                    if data.len() > MESSAGE_BYTES_MAX {
                        return Ok(Some(Found::Bad));
                    }
                    return Ok(Some(CanFrames::decode(&*data).map_or(Found::Bad, Found::Frames)));
                }
                _ => {}
            }
        }
        Ok(None)
    }
}
