//! What a robot's configuration says of how boards and modules are configured.

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
    /// Takes a group of parameters; those that say nothing of boards are left out.
    pub fn group(&mut self, name: &str, params: &[Param]) {
        let number = |name: &str, default| value(params, name).and_then(number).unwrap_or(default);
        match name {
            "defaultCfgBoard" => {
                let (board_type, no_load) = (number("skinType", 0), number("noLoad", 240));
                self.board = Some(BoardValues { period_ms: number("period", 50), board_type, no_load });
            }
            "defaultCfgTriangle" => self.module = Some((number("shift", USUAL.0), number("cdcOffset", USUAL.1))),
            "specialCfgBoards" => {
                for set in sets(params, "boardSetCfg") {
                    let [bus, first, last, period_ms, board_type, no_load] = set[..] else { continue };
                    self.boards.push(([bus, first, last], BoardValues { period_ms, board_type, no_load }));
                }
            }
            "specialCfgTriangles" => {
                for set in sets(params, "triangleSetCfg") {
                    let [bus, board, first, last, _enabled, shift, cdc_offset] = set[..] else { continue };
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

/// The numbers of the sets that the host takes.
fn sets(params: &[Param], prefix: &str) -> impl Iterator<Item = Vec<i64>> {
    let count = value(params, "numOfSets").and_then(number).unwrap_or(0).min(SETS_MAX);
    let taken = move |name: &str| name.strip_prefix(prefix).and_then(number).is_some_and(|n| (1..=count).contains(&n));
    params.iter().filter(move |(name, _)| taken(name)).map(|(_, text)| numbers(text))
}
