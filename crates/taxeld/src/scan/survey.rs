//! From frames to findings. Nothing here reads a bus or a clock.

use std::collections::{BTreeMap, BTreeSet};

use taxel_can::BusError;
use taxel_skin::{BoardAddress, Module, Time};
use taxel_wire::icub::{Message, decode};
use taxel_wire::{CanId, Frame, FrameKind, TimedFrame};

use super::findings::{BoardFound, ErrorsFound, Findings, OtherFound};
use super::module::ModuleWatch;
use super::pressure;

/// Foreign identifiers that are told apart; more are counted together by their first ones.
const OTHERS_MAX: usize = 512;
/// Frames of a foreign identifier that are kept to look at: a minute of a gauge at 100 Hz.
const KEPT_MAX: usize = 6_000;
/// Bits a second on the bus.
const BITS_PER_S: f64 = 1e6;

/// Listens, and knows at its end what is there.
#[derive(Debug, Default)]
pub struct Survey {
    first: Option<Time>,
    last: Option<Time>,
    frames: u64,
    bits: u64,
    modules: BTreeMap<(BoardAddress, Module), ModuleWatch>,
    boards: BTreeMap<u8, BoardFound>,
    others: BTreeMap<CanId, OtherWatch>,
    errors: Option<ErrorsFound>,
    notices: Vec<String>,
}

#[derive(Debug, Default)]
struct OtherWatch {
    frames: u64,
    kept: Vec<Frame>,
    lengths: BTreeSet<u8>,
}

impl Survey {
    /// Takes a frame.
    pub fn frame(&mut self, timed: &TimedFrame) {
        let TimedFrame { time, frame } = timed;
        self.first = Some(self.first.map_or(*time, |first| first.min(*time)));
        self.last = Some(self.last.map_or(*time, |last| last.max(*time)));
        self.frames += 1;
        self.bits += bits(frame);
        match decode(frame) {
            Ok(Message::Head { board, module, values }) => {
                self.modules.entry((board, module)).or_default().head(*time, values);
            }
            Ok(Message::Tail { board, module, values, status }) => {
                self.modules.entry((board, module)).or_default().tail(*time, values, status);
            }
            Ok(Message::Thermometer { board, deci_celsius }) => {
                self.board(board).celsius = Some(f64::from(deci_celsius) / 10.0);
            }
            Ok(Message::FirmwareVersion { board, version }) => {
                let (kind, (major, minor, build)) = (version.board_type, version.app);
                self.board(board).firmware = Some(format!("type {kind}, {major}.{minor}.{build}"));
            }
            Ok(Message::BoardOverflow { board }) => self.board(board).overflows += 1,
            Err(_) => self.other(frame),
        }
    }

    /// Takes an error that the controller reported.
    pub fn error(&mut self, error: &BusError) {
        let errors = self.errors.get_or_insert_default();
        *errors.kinds.entry(error.kind()).or_default() += 1;
        if let Some(now) = error.counters() {
            let (sending, receiving) = errors.counters_max.unwrap_or_default();
            errors.counters_max = Some((sending.max(now.transmit), receiving.max(now.receive)));
        }
    }

    /// Takes something else that the bus told.
    pub fn notice(&mut self, what: String) {
        if !self.notices.contains(&what) {
            self.notices.push(what);
        }
    }

    fn board(&mut self, board: BoardAddress) -> &mut BoardFound {
        self.boards.entry(board.get()).or_default()
    }

    fn other(&mut self, frame: &Frame) {
        if self.others.len() >= OTHERS_MAX && !self.others.contains_key(&frame.id) {
            self.notice(format!("more than {OTHERS_MAX} foreign identifiers: the others are not told apart"));
            return;
        }
        let other = self.others.entry(frame.id).or_default();
        other.frames += 1;
        other.lengths.insert(frame.bytes().len() as u8);
        if frame.kind == FrameKind::Data && other.kept.len() < KEPT_MAX {
            other.kept.push(*frame);
        }
    }

    /// What was found.
    #[must_use]
    pub fn findings(mut self) -> Findings {
        let (first, last) = (self.first.unwrap_or_default(), self.last.unwrap_or_default());
        let seconds = last.seconds_since(first);
        let per_s = |count: f64| if seconds > 0.0 { count / seconds } else { 0.0 };
        let mut intervals: BTreeMap<u8, Vec<f32>> = BTreeMap::new();
        for ((board, _), watch) in &self.modules {
            intervals.entry(board.get()).or_default().extend(watch.intervals_ms());
        }
        for (board, intervals) in &mut intervals {
            self.boards.entry(*board).or_default().period_ms = median(intervals);
        }
        let mut never_whole: BTreeMap<u8, Vec<u8>> = BTreeMap::new();
        for ((board, module), watch) in &self.modules {
            let found = self.boards.entry(board.get()).or_default();
            let of_module = watch.found(last, found.period_ms);
            if of_module.scans > 0 {
                found.modules.insert(module.get(), of_module);
            } else {
                never_whole.entry(board.get()).or_default().push(module.get());
            }
        }
        self.boards.retain(|board, found| {
            let is_board = !found.modules.is_empty();
            if !is_board {
                never_whole.entry(*board).or_default();
            }
            is_board
        });
        let other = |(id, watch): (&CanId, &OtherWatch)| OtherFound {
            id: id.to_string(),
            extended: matches!(id, CanId::Extended(_)),
            frames: watch.frames,
            per_s: per_s(watch.frames as f64),
            lengths: watch.lengths.iter().copied().collect(),
            pressures: pressure::candidates(*id, &watch.kept),
        };
        Findings {
            seconds,
            frames: self.frames,
            load: per_s(self.bits as f64) / BITS_PER_S,
            errors: self.errors,
            notices: self.notices,
            others: self.others.iter().map(other).collect(),
            boards: self.boards,
            never_whole,
        }
    }
}

/// Bits of a frame with the gap after it, without stuffed ones.
fn bits(frame: &Frame) -> u64 {
    let around = if matches!(frame.id, CanId::Standard(_)) { 47 } else { 67 };
    let data = if frame.kind == FrameKind::Remote { 0 } else { 8 * frame.bytes().len() as u64 };
    around + data
}

fn median(values: &mut [f32]) -> Option<f64> {
    values.sort_by(f32::total_cmp);
    values.get(values.len() / 2).map(|value| f64::from(*value))
}
