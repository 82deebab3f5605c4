//! How the boards of a patch are set, as far as their counts depend on it. Boards that are set in another way rest at the
//! same count and pass for sound, while every count is worth more or less than the models say.
//!
//! Model sets keep it in words, a line a board, and the words are read here, where they are written. What a line does not
//! tell is not known, and nothing follows from it.

use std::fmt;

use taxel_skin::{BoardAddress, CountRange, Module};
use taxel_wire::icub::{BoardConfig, TriangleConfig};

use crate::intake::bring_up::BoardSetup;
use crate::intake::cells::DevicePlan;

/// What is written of a board that is only listened to.
const UNKNOWN: &str = "settings unknown";

/// Modules of a skin board.
const MODULES: u8 = 16;

/// How a board is set.
#[derive(Clone, Debug, PartialEq)]
pub enum BoardSettings {
    /// A skin board that is configured so.
    Configured(BoardSetup),
    /// A skin board that is only listened to: somebody else has set it.
    Listened,
    /// A device that is described by its signals, or a skin whose scans are pushed.
    Device {
        /// The range of its counts.
        range: Range,
        /// How they are made of the numbers in its frames; `None` where that is not known, or there are no frames.
        numbers: Option<Numbers>,
    },
}

/// What counts there are, and how many are a unit of the models.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    top: u16,
    per_unit: f64,
}

/// How a number becomes a count: `(number - low) >> shift`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Numbers {
    low: i64,
    shift: u8,
}

/// Something that a board had when a set was gathered, and has not now.
struct Difference {
    place: String,
    then: String,
    now: String,
}

impl BoardSettings {
    /// Of a device whose counts have this range.
    #[must_use]
    pub fn of_device(device: &DevicePlan, counts: CountRange) -> Self {
        let fields = || device.frames.iter().flat_map(|spec| &spec.counts).map(|(_, field)| field);
        let numbers = fields().next().map(|field| Numbers { low: field.low, shift: field.shift });
        // One line tells of all its taxels.
        let numbers = numbers.filter(|all| fields().all(|field| (field.low, field.shift) == (all.low, all.shift)));
        Self::Device { range: counts.into(), numbers }
    }

    /// The line of the board of this address.
    #[must_use]
    pub fn line(&self, address: BoardAddress) -> String {
        match self {
            Self::Configured(setup) => {
                let BoardConfig { kind, period_ms, no_load } = setup.board;
                let triangle = |t: &TriangleConfig| {
                    format!("{}-{}: shift {} cdc_offset {:#06x}", t.first, t.last, t.shift, t.cdc_offset)
                };
                let triangles = setup.triangles.iter().map(triangle).collect::<Vec<_>>().join(", ");
                format!("board {address}: type {kind} period {period_ms} ms no_load {no_load}; {triangles}")
            }
            Self::Listened => format!("board {address}: {UNKNOWN}"),
            Self::Device { range, numbers: None } => format!("device {address}: {range}"),
            Self::Device { range, numbers: Some(numbers) } => format!("device {address}: {range}; {numbers}"),
        }
    }

    /// What a line tells; `None` if it is none of [`BoardSettings::line`].
    fn read(line: &str) -> Option<Self> {
        let (name, told) = line.split_once(": ")?;
        match name.split_once(' ')?.0 {
            "board" if told == UNKNOWN => Some(Self::Listened),
            "board" => read_setup(told).map(Self::Configured),
            "device" => {
                let (range, numbers) = told.split_once("; ").map_or((told, None), |(r, n)| (r, Some(n)));
                let numbers = numbers.map(|text| read_numbers(text).ok_or(())).transpose().ok()?;
                Some(Self::Device { range: read_range(range)?, numbers })
            }
            _ => None,
        }
    }

    /// A skin board sends bytes, however it is set.
    fn range(&self) -> Range {
        match self {
            Self::Configured(_) | Self::Listened => CountRange::BYTE.into(),
            Self::Device { range, .. } => *range,
        }
    }

    /// What has changed since `self`, as far as both are known; `now` is the board of this address.
    fn differences(&self, now: &Self, address: BoardAddress) -> Vec<Difference> {
        let place = || match now {
            Self::Device { .. } => format!("device {address}"),
            _ => format!("board {address}"),
        };
        let changed = |then: &dyn fmt::Display, now: &dyn fmt::Display| {
            vec![Difference { place: place(), then: then.to_string(), now: now.to_string() }]
        };
        match (self, now) {
            _ if self.range() != now.range() => changed(&self.range(), &now.range()),
            (Self::Configured(then), Self::Configured(now)) => of_setups(then, now, address),
            (Self::Device { numbers: Some(then), .. }, Self::Device { numbers: Some(now), .. }) if then != now => {
                changed(then, now)
            }
            _ => Vec::new(),
        }
    }
}

/// Why what was gathered with boards of these lines says nothing of boards that are set as they are `now`, in words that go
/// on from what was gathered; `None` where they are the same as far as is known. Boards are compared by their place: in
/// the order of the boards taxels have their numbers.
#[must_use]
pub fn difference(lines: &[String], now: &[(BoardAddress, BoardSettings)]) -> Option<String> {
    let known = lines.iter().zip(now).filter_map(|(line, now)| Some((BoardSettings::read(line)?, now)));
    let mut all = known.flat_map(|(then, (address, now))| then.differences(now, *address));
    let Difference { place, then, now } = all.next()?;
    let more = all.count();
    let more = if more == 0 { String::new() } else { format!(" (and {more} more)") };
    Some(format!("was gathered with {then} on {place}, where the configuration has {now}{more}"))
}

/// What two sets of lines differ in, of each its own, so that the counts of both are not to be fitted together. Lines of skin
/// boards are to be equal; one of a device may tell less, as in earlier versions.
#[must_use]
pub fn differ_in(lines: &[String], others: &[String]) -> Option<(String, String)> {
    if lines.len() != others.len() {
        return Some((lines.join("; "), others.join("; ")));
    }
    let mut pairs = lines.iter().zip(others);
    pairs.find(|(a, b)| !mean_the_same(a, b)).map(|(a, b)| (a.clone(), b.clone()))
}

fn mean_the_same(a: &str, b: &str) -> bool {
    use BoardSettings::Device;
    match (BoardSettings::read(a), BoardSettings::read(b)) {
        (Some(Device { range, numbers }), Some(Device { range: other, numbers: others })) => {
            range == other && (numbers == others || numbers.is_none() || others.is_none())
        }
        _ => a == b,
    }
}

/// The period is left out: no count depends on it. A no-load value alone moves all counts by as much, and a force is made of
/// differences; but rest is told from a load by where the counts lie, so that a load that makes up for it passes for rest.
fn of_setups(then: &BoardSetup, now: &BoardSetup, address: BoardAddress) -> Vec<Difference> {
    let board = || format!("board {address}");
    let (was, is) = (then.board, now.board);
    let of_board = [("type", was.kind, is.kind), ("no_load", was.no_load, is.no_load)].into_iter();
    let of_board = of_board.filter(|(_, was, is)| was != is);
    let of_board = of_board.map(|(name, was, is)| (board(), format!("{name} {was}"), format!("{name} {is}")));
    let of_modules = (0..MODULES).map(Module::from_nibble).flat_map(|module| {
        let both = settings_of(then, module).zip(settings_of(now, module));
        both.into_iter().flat_map(move |((shift, offset), (shift_now, offset_now))| {
            let shift = (format!("shift {shift}"), format!("shift {shift_now}"));
            let offset = (format!("cdc_offset {offset:#06x}"), format!("cdc_offset {offset_now:#06x}"));
            let changed = [shift, offset].into_iter().filter(|(was, is)| was != is);
            changed.map(move |(was, is)| (format!("module {module} of board {address}"), was, is))
        })
    });
    of_board.chain(of_modules).map(|(place, then, now)| Difference { place, then, now }).collect()
}

/// Shift and offset of a module: those of the last command that counts for it.
fn settings_of(setup: &BoardSetup, module: Module) -> Option<(u8, u16)> {
    let last = setup.triangles.iter().rev().find(|t| (t.first..=t.last).contains(&module))?;
    Some((last.shift, last.cdc_offset))
}

fn read_setup(text: &str) -> Option<BoardSetup> {
    let (board, triangles) = text.split_once("; ")?;
    let words: Vec<&str> = board.split(' ').collect();
    let ["type", kind, "period", period_ms, "ms", "no_load", no_load] = words[..] else { return None };
    let [kind, period_ms, no_load] = [kind, period_ms, no_load].map(|word| word.parse().ok());
    let board = BoardConfig { kind: kind?, period_ms: period_ms?, no_load: no_load? };
    let triangles = triangles.split(", ").filter(|text| !text.is_empty()).map(read_triangles);
    Some(BoardSetup { board, triangles: triangles.collect::<Option<_>>()? })
}

fn read_triangles(text: &str) -> Option<TriangleConfig> {
    let (modules, told) = text.split_once(": ")?;
    let (first, last) = modules.split_once('-')?;
    let module = |text: &str| Module::new(text.parse().ok()?).ok();
    let words: Vec<&str> = told.split(' ').collect();
    let ["shift", shift, "cdc_offset", offset] = words[..] else { return None };
    let cdc_offset = u16::from_str_radix(offset.strip_prefix("0x")?, 16).ok()?;
    let (first, last) = (module(first)?, module(last)?);
    Some(TriangleConfig { first, last, shift: shift.parse().ok()?, enabled: true, cdc_offset })
}

fn read_range(text: &str) -> Option<Range> {
    let (top, per_unit) = text.strip_prefix("counts from 0 to ")?.strip_suffix(" to a unit")?.split_once(", ")?;
    Some(Range { top: top.parse().ok()?, per_unit: per_unit.parse().ok()? })
}

fn read_numbers(text: &str) -> Option<Numbers> {
    let (low, shift) = text.strip_prefix("numbers from ")?.strip_suffix(" bits left out")?.split_once(", lowest ")?;
    Some(Numbers { low: low.parse().ok()?, shift: shift.parse().ok()? })
}

impl From<CountRange> for Range {
    fn from(counts: CountRange) -> Self {
        Self { top: counts.top(), per_unit: counts.per_unit() }
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "counts from 0 to {}, {} to a unit", self.top, self.per_unit)
    }
}

impl fmt::Display for Numbers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "numbers from {}, lowest {} bits left out", self.low, self.shift)
    }
}

#[cfg(test)]
mod tests;
