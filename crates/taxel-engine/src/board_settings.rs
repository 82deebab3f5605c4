//! How the boards of a patch are set, as far as their counts depend on it, and which of their modules belong to it. Boards
//! that are set in another way rest at the same count and pass for sound, while every count is worth more or less than the
//! models say; and with other modules, or boards in another order, the models are those of other taxels.
//!
//! Model sets keep it in words, a line a board, and the words are read here, where they are written. What a line does not
//! tell is not known, and nothing follows from it.

mod commands;
mod modules;
mod signals;

use std::fmt;
use std::iter::Peekable;

use taxel_skin::{Board, CountRange, Module};
use taxel_wire::icub::{BoardConfig, TriangleConfig};

use self::commands::Commands;
use self::modules::Modules;
use self::signals::Signals;
use crate::intake::bring_up::BoardSetup;
use crate::intake::cells::DevicePlan;

/// What stands in a line before the modules.
const MODULES_OF: &str = "; modules ";

/// What is written of a board that is only listened to.
const UNKNOWN: &str = "settings unknown";

/// Modules of a skin board.
const MODULES: u8 = 16;

/// What is known of a board.
#[derive(Clone, Debug, PartialEq)]
pub struct KnownBoard {
    address: u8,
    settings: BoardSettings,
    /// `None` where an earlier version did not tell.
    modules: Option<Modules>,
}

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
        /// Which of these is which taxel; `None` where an earlier version did not tell, or there are no frames.
        signals: Option<Signals>,
        /// What it is sent; `None` where an earlier version did not tell, or somebody else sends it.
        commands: Option<Commands>,
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
        let (signals, commands) = (Signals::of(&device.frames), Commands::of(device));
        Self::Device { range: counts.into(), numbers, signals, commands }
    }

    /// A skin board sends bytes, however it is set.
    fn range(&self) -> Range {
        match self {
            Self::Configured(_) | Self::Listened => CountRange::BYTE.into(),
            Self::Device { range, .. } => *range,
        }
    }

    /// What has changed since `self`, as far as both are known; `now` is the board of this address.
    fn differences(&self, now: &Self, address: u8) -> Vec<Difference> {
        let changed =
            |then: &dyn fmt::Display, is: &dyn fmt::Display| vec![difference_of(now.named(address), then, is)];
        match (self, now) {
            _ if self.range() != now.range() => changed(&self.range(), &now.range()),
            (Self::Configured(then), Self::Configured(now)) => of_setups(then, now, address),
            (Self::Device { numbers: Some(then), .. }, Self::Device { numbers: Some(now), .. }) if then != now => {
                changed(then, now)
            }
            (Self::Device { signals: Some(then), .. }, Self::Device { signals: Some(now), .. }) if then != now => {
                changed(&format!("{then} as its taxels"), now)
            }
            (Self::Device { commands: Some(then), .. }, Self::Device { commands: Some(now), .. }) if then != now => {
                changed(then, now)
            }
            _ => Vec::new(),
        }
    }

    fn named(&self, address: u8) -> String {
        match self {
            Self::Device { .. } => format!("device {address}"),
            Self::Configured(_) | Self::Listened => format!("board {address}"),
        }
    }
}

impl KnownBoard {
    /// The board of a configuration, which is set so.
    #[must_use]
    pub fn of(board: &Board, settings: BoardSettings) -> Self {
        Self { address: board.address.get(), settings, modules: Some(Modules::of(&board.modules)) }
    }

    /// The line that tells it.
    #[must_use]
    pub fn line(&self) -> String {
        let settings = match &self.settings {
            BoardSettings::Configured(setup) => {
                let BoardConfig { kind, period_ms, no_load } = setup.board;
                let triangle = |t: &TriangleConfig| {
                    format!("{}-{}: shift {} cdc_offset {:#06x}", t.first, t.last, t.shift, t.cdc_offset)
                };
                let triangles = setup.triangles.iter().map(triangle).collect::<Vec<_>>().join(", ");
                format!("type {kind} period {period_ms} ms no_load {no_load}; {triangles}")
            }
            BoardSettings::Listened => UNKNOWN.to_owned(),
            BoardSettings::Device { range, numbers, signals, commands } => {
                let numbers = numbers.map(|numbers| format!("; {numbers}")).unwrap_or_default();
                let signals = signals.map(|signals| format!("; {signals}")).unwrap_or_default();
                let commands = commands.as_ref().map(|commands| format!("; {commands}")).unwrap_or_default();
                format!("{range}{numbers}{signals}{commands}")
            }
        };
        let modules = self.modules.as_ref().map_or_else(String::new, |modules| format!("{MODULES_OF}{modules}"));
        format!("{}: {settings}{modules}", self.settings.named(self.address))
    }

    /// What a line tells; `None` if it is none of [`KnownBoard::line`].
    fn read(line: &str) -> Option<Self> {
        let (line, modules) = line.split_once(MODULES_OF).map_or((line, None), |(line, m)| (line, Some(m)));
        let modules = modules.map(|text| Modules::read(text).ok_or(())).transpose().ok()?;
        let (name, told) = line.split_once(": ")?;
        let (of, address) = name.split_once(' ')?;
        let settings = match of {
            "board" if told == UNKNOWN => BoardSettings::Listened,
            "board" => BoardSettings::Configured(read_setup(told)?),
            "device" => {
                let mut parts = told.split("; ").peekable();
                let range = read_range(parts.next()?)?;
                let numbers = next_if_read(&mut parts, read_numbers);
                let signals = next_if_read(&mut parts, Signals::read);
                let commands = next_if_read(&mut parts, Commands::read);
                if parts.next().is_some() {
                    return None;
                }
                BoardSettings::Device { range, numbers, signals, commands }
            }
            _ => return None,
        };
        Some(Self { address: address.parse().ok()?, settings, modules })
    }

    /// What has changed since `self`, as far as both are known.
    fn differences(&self, now: &Self) -> Vec<Difference> {
        let mut all = self.settings.differences(&now.settings, now.address);
        if let (Some(then), Some(is)) = (&self.modules, &now.modules)
            && then != is
        {
            let named = now.settings.named(now.address);
            all.push(difference_of(named, &format!("modules {then}"), &format!("modules {is}")));
        }
        all
    }
}

fn difference_of(place: String, then: &dyn fmt::Display, now: &dyn fmt::Display) -> Difference {
    Difference { place, then: then.to_string(), now: now.to_string() }
}

/// Why what was gathered with boards of these lines says nothing of boards that are as they are `now`, in words that go
/// on from what was gathered; `None` where they are the same as far as is known. Boards are compared by their place: in
/// the order of the boards taxels have their numbers. One whose address no board had before has new electronics, on the same
/// pads.
#[must_use]
pub fn difference(lines: &[String], now: &[KnownBoard]) -> Option<String> {
    let then: Vec<Option<KnownBoard>> = lines.iter().map(|line| KnownBoard::read(line)).collect();
    if let Some(why) = other_order(&then, now) {
        return Some(why);
    }
    let known = then.iter().zip(now).filter_map(|(then, now)| Some((then.as_ref()?, now)));
    let mut all = known.flat_map(|(then, now)| then.differences(now));
    let Difference { place, then, now } = all.next()?;
    let more = all.count();
    let more = if more == 0 { String::new() } else { format!(" (and {more} more)") };
    Some(format!("was gathered with {then} on {place}, where the configuration has {now}{more}"))
}

/// Why the boards are not in the order in which they were; `None` where they are, as far as all of them are known.
fn other_order(then: &[Option<KnownBoard>], now: &[KnownBoard]) -> Option<String> {
    let then: Vec<&KnownBoard> = then.iter().map(Option::as_ref).collect::<Option<_>>()?;
    let moved = |(place, board): (usize, &KnownBoard)| {
        let had = |at: usize| then.get(at).is_some_and(|then| then.address == board.address);
        !had(place) && (0..then.len()).any(had)
    };
    let moved = now.iter().enumerate().any(moved);
    if then.is_empty() || (then.len() == now.len() && !moved) {
        return None;
    }
    let list = |boards: &mut dyn Iterator<Item = &KnownBoard>| {
        boards.map(|board| board.settings.named(board.address)).collect::<Vec<_>>().join(", ")
    };
    let (then, now) = (list(&mut then.into_iter()), list(&mut now.iter()));
    Some(format!("was gathered with {then} in this order, where the configuration has {now}"))
}

/// What two sets of lines differ in, of each its own, so that the counts of both are not to be fitted together. Either may
/// tell less of the modules, or of the numbers of a device, as in earlier versions.
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
    let (Some(one), Some(other)) = (KnownBoard::read(a), KnownBoard::read(b)) else { return a == b };
    let same_modules = one.modules.is_none() || other.modules.is_none() || one.modules == other.modules;
    let same_settings = match (&one.settings, &other.settings) {
        (
            Device { range, numbers, signals, commands },
            Device { range: its_range, numbers: its_numbers, signals: its_signals, commands: its_commands },
        ) => {
            let same_taxels = range == its_range && agree(numbers, its_numbers) && agree(signals, its_signals);
            same_taxels && agree(commands, its_commands)
        }
        (one, other) => one == other,
    };
    one.address == other.address && same_modules && same_settings
}

/// As far as both are known.
fn agree<T: PartialEq>(one: &Option<T>, other: &Option<T>) -> bool {
    one.as_ref().zip(other.as_ref()).is_none_or(|(one, other)| one == other)
}

/// The period is left out: no count depends on it. A no-load value alone moves all counts by as much, and a force is made of
/// differences; but rest is told from a load by where the counts lie, so that a load that makes up for it passes for rest.
fn of_setups(then: &BoardSetup, now: &BoardSetup, address: u8) -> Vec<Difference> {
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

/// Takes the next part if it is one that `read` reads.
fn next_if_read<'a, T>(
    parts: &mut Peekable<impl Iterator<Item = &'a str>>,
    read: impl FnOnce(&str) -> Option<T>,
) -> Option<T> {
    let found = parts.peek().and_then(|text| read(text))?;
    parts.next();
    Some(found)
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
