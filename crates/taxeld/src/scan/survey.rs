//! From frames to what is on a bus. Nothing here reads a bus or a clock.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use taxel_can::BusError;
use taxel_skin::{BoardAddress, Module, Time};
use taxel_wire::icub::{Message, Pairer, StatusWord, decode};
use taxel_wire::{CanId, Frame, TimedFrame};

/// Head and tail of one scan are closer than this, and boards do not send faster.
const WINDOW: Duration = Duration::from_millis(15);

/// Listens, and knows at its end what is there.
#[derive(Debug, Default)]
pub struct Survey {
    /// Data and remote frames.
    pub frames: u64,
    span: Option<(Time, Time)>,
    boards: BTreeMap<BoardAddress, Board>,
    /// What is no skin board's, by identifier.
    pub others: BTreeMap<CanId, Other>,
    /// What else the bus told, and how often.
    pub notices: BTreeMap<String, u64>,
}

/// What has the address of a skin board.
#[derive(Debug, Default)]
pub struct Board {
    intervals_s: Vec<f64>,
    modules: BTreeMap<Module, ModuleWatch>,
}

/// A module while somebody listens.
#[derive(Debug)]
pub struct ModuleWatch {
    pairer: Pairer,
    /// Whole scans.
    pub scans: u64,
    last: Option<Time>,
    /// Least and most of its values.
    pub range: (u8, u8),
}

impl Default for ModuleWatch {
    fn default() -> Self {
        Self { pairer: Pairer::new(WINDOW), scans: 0, last: None, range: (u8::MAX, 0) }
    }
}

impl ModuleWatch {
    /// A tail frame. If it makes a scan whole: the seconds since the scan before.
    fn tail(&mut self, time: Time, values: [u8; 5], status: StatusWord) -> Option<f64> {
        let scan = self.pairer.tail(time, values, status)?;
        self.scans += 1;
        self.range = scan.values.iter().fold(self.range, |(least, most), value| (least.min(*value), most.max(*value)));
        self.last.replace(scan.time).map(|last| scan.time.seconds_since(last))
    }

    /// Halves without a partner.
    pub fn orphans(&self) -> u64 {
        self.pairer.orphans().heads + self.pairer.orphans().tails
    }
}

/// Frames with an identifier that is no skin board's.
#[derive(Debug, Default)]
pub struct Other {
    /// How many.
    pub frames: u64,
    /// Their lengths in bytes.
    pub lengths: BTreeSet<u8>,
    /// What the last of them held.
    pub last: Vec<u8>,
}

impl Survey {
    /// Takes a frame.
    pub fn frame(&mut self, timed: &TimedFrame) {
        let TimedFrame { time, frame } = timed;
        let (first, last) = self.span.unwrap_or((*time, *time));
        self.span = Some((first.min(*time), last.max(*time)));
        self.frames += 1;
        match decode(frame) {
            Ok(Message::Head { board, module, values }) => {
                self.board(board).modules.entry(module).or_default().pairer.head(*time, values);
            }
            Ok(Message::Tail { board, module, values, status }) => {
                let board = self.board(board);
                let since = board.modules.entry(module).or_default().tail(*time, values, status);
                board.intervals_s.extend(since);
            }
            Ok(Message::BoardOverflow { board }) => self.notice(format!("board {board} threw its send queue away")),
            Ok(Message::Thermometer { .. } | Message::FirmwareVersion { .. }) => {}
            Err(_) => self.other(frame),
        }
    }

    fn board(&mut self, address: BoardAddress) -> &mut Board {
        self.boards.entry(address).or_default()
    }

    fn other(&mut self, frame: &Frame) {
        let other = self.others.entry(frame.id).or_default();
        other.frames += 1;
        other.lengths.insert(frame.bytes().len() as u8);
        other.last = frame.bytes().to_vec();
    }

    /// Takes an error that the controller reported.
    pub fn error(&mut self, error: &BusError) {
        let hint = match error {
            BusError::Protocol { .. } => {
                "; wrong bit timing does so, too: these boards sample at 50 to 60 % of a bit, Linux at 75 %; try sample-point 0.6"
            }
            _ => "",
        };
        self.notice(format!("{}{hint}", error.kind()));
    }

    /// Takes something else that the bus told.
    pub fn notice(&mut self, what: String) {
        *self.notices.entry(what).or_default() += 1;
    }

    /// From the first frame to the last.
    pub fn seconds(&self) -> f64 {
        self.span.map_or(0.0, |(first, last)| last.seconds_since(first))
    }

    /// The boards of which a module's whole scan came: other traffic has their identifiers, too.
    pub fn boards(&self) -> impl DoubleEndedIterator<Item = (BoardAddress, &Board)> {
        self.boards
            .iter()
            .map(|(address, board)| (*address, board))
            .filter(|(_, board)| board.modules().next().is_some())
    }
}

impl Board {
    /// The modules of which a whole scan came.
    pub fn modules(&self) -> impl Iterator<Item = (Module, &ModuleWatch)> {
        self.modules.iter().filter(|(_, module)| module.scans > 0).map(|(number, module)| (*number, module))
    }

    /// Median time between two scans of a module, milliseconds.
    pub fn period_ms(&self) -> Option<f64> {
        let mut intervals = self.intervals_s.clone();
        intervals.sort_by(f64::total_cmp);
        intervals.get(intervals.len() / 2).map(|seconds| 1e3 * seconds)
    }
}
