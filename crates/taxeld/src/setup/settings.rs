//! What a robot's configuration says of how boards and modules are configured.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// The host takes so many special sets and no more.
const SETS_MAX: i64 = 20;

/// A parameter: its name and its text.
pub type Param = (String, String);

/// The value of a parameter, without the quotes that some have.
pub fn value<'a>(params: &'a [Param], name: &str) -> Option<&'a str> {
    let (_, value) = params.iter().find(|(n, _)| n.eq_ignore_ascii_case(name))?;
    Some(value.trim().trim_matches('"').trim())
}

/// A number, decimal or hexadecimal.
pub fn number(text: &str) -> Option<i64> {
    let hex = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
    hex.map_or_else(|| text.parse().ok(), |hex| i64::from_str_radix(hex, 16).ok())
}

/// The numbers of a list; brackets and commas are tolerated.
pub fn numbers(text: &str) -> Vec<i64> {
    text.split(|c: char| c.is_whitespace() || "(),;".contains(c)).filter_map(number).collect()
}

/// What a board is configured with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoardValues {
    /// Period in milliseconds.
    pub period_ms: i64,
    /// Type in command 0x4D.
    pub board_type: i64,
    /// The count of an unloaded value.
    pub no_load: i64,
}

/// Shift and converter offset of a module.
pub type ModuleValues = (i64, i64);

/// What nearly all modules have.
pub const USUAL: ModuleValues = (2, 0x2200);

/// What was read of one or several files that belong together. Special sets are of a bus, as the device counts them, and of the
/// boards or modules from a first to a last one; the last set counts, as the last command does.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    board: Option<BoardValues>,
    module: Option<ModuleValues>,
    boards: Vec<([i64; 3], BoardValues)>,
    modules: Vec<([i64; 4], ModuleValues)>,
}

impl Settings {
    /// Takes a group of parameters; those that say nothing of boards are left out. Sets that are of no use are named in `open`.
    pub fn group(&mut self, name: &str, params: &[Param], open: &mut Vec<String>) {
        let number = |name: &str, default| value(params, name).and_then(number).unwrap_or(default);
        match name {
            "defaultCfgBoard" => {
                let (board_type, no_load) = (number("skinType", 0), number("noLoad", 240));
                self.board = Some(BoardValues { period_ms: number("period", 50), board_type, no_load });
            }
            "defaultCfgTriangle" => self.module = Some((number("shift", USUAL.0), number("cdcOffset", USUAL.1))),
            "specialCfgBoards" => {
                for [bus, first, last, period_ms, board_type, no_load] in sets(params, "boardSetCfg", open) {
                    self.boards.push(([bus, first, last], BoardValues { period_ms, board_type, no_load }));
                }
            }
            "specialCfgTriangles" => {
                for [bus, board, first, last, _enabled, shift, cdc_offset] in sets(params, "triangleSetCfg", open) {
                    self.modules.push(([bus, board, first, last], (shift, cdc_offset)));
                }
            }
            _ => {}
        }
    }

    /// Whether it says what boards are configured with.
    pub fn has_values(&self) -> bool {
        self.board.is_some() || self.module.is_some() || !self.modules.is_empty()
    }

    /// Names the sets that are of none of these boards, listed by the number of their bus.
    pub fn of_no_board(&self, boards: &BTreeMap<u8, Vec<u8>>) -> Vec<String> {
        let is_there = |bus: i64, range: RangeInclusive<i64>| {
            let on_bus = u8::try_from(bus).ok().and_then(|bus| boards.get(&bus));
            on_bus.is_some_and(|list| list.iter().any(|address| range.contains(&i64::from(*address))))
        };
        let triangles = self.modules.iter().map(|([bus, board, ..], _)| ("triangles", *bus, *board..=*board));
        let sets = self.boards.iter().map(|([bus, first, last], _)| ("boards", *bus, *first..=*last)).chain(triangles);
        let unused = sets.filter(|(_, bus, range)| !is_there(*bus, range.clone()));
        let words = |(what, bus, range): (_, _, RangeInclusive<i64>)| {
            format!("a special set of {what} is not used: bus {bus} has no board {} to {}", range.start(), range.end())
        };
        unused.map(words).collect()
    }

    /// What a board is configured with; `bus` is the device's number of it.
    pub fn board(&self, bus: u8, address: u8) -> BoardValues {
        let (bus, address) = (i64::from(bus), i64::from(address));
        let own = self.boards.iter().rfind(|([of, first, last], _)| *of == bus && (*first..=*last).contains(&address));
        let default = self.board.unwrap_or(BoardValues { period_ms: 50, board_type: 0, no_load: 240 });
        own.map_or(default, |(_, values)| *values)
    }

    /// What a module is configured with.
    pub fn module(&self, bus: u8, address: u8, module: u8) -> ModuleValues {
        let place = (i64::from(bus), i64::from(address));
        let concerns = |[bus, board, first, last]: &[i64; 4]| {
            (*bus, *board) == place && (*first..=*last).contains(&i64::from(module))
        };
        let own = self.modules.iter().rfind(|(of, _)| concerns(of));
        own.map_or(self.module.unwrap_or(USUAL), |(_, values)| *values)
    }
}

/// The numbers of the sets that the host takes; others are named in `open`.
fn sets<const N: usize>(params: &[Param], prefix: &str, open: &mut Vec<String>) -> Vec<[i64; N]> {
    let count = value(params, "numOfSets").and_then(number).unwrap_or(0).min(SETS_MAX);
    let mut taken = Vec::new();
    for (name, text) in params {
        let Some(place) = name.strip_prefix(prefix) else { continue };
        match <[i64; N]>::try_from(numbers(text)) {
            Ok(set) if number(place).is_some_and(|place| (1..=count).contains(&place)) => taken.push(set),
            Ok(_) => open.push(format!("{name} is not used: its number is not among 1 to numOfSets = {count}")),
            Err(_) => open.push(format!("{name} = {} is not used: expected {N} numbers", text.trim())),
        }
    }
    taken
}
