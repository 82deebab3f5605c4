//! What a robot's configuration says of how boards and modules are configured.

use super::params::{number, numbers, value};

/// The host takes so many special sets and no more.
const SETS_MAX: u32 = 20;

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

/// What a module is configured with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ModuleValues {
    /// Whether it sends.
    pub enabled: bool,
    /// Right shift.
    pub shift: i64,
    /// Converter offset.
    pub cdc_offset: i64,
}

/// A setting of some boards, or of some modules of a board, on one of a device's buses.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Special<T> {
    /// Number of the bus, as the device counts them.
    bus: i64,
    /// First and last board.
    boards: (i64, i64),
    /// First and last module; all of them for settings of boards.
    modules: (i64, i64),
    values: T,
}

/// What was read of one or several files that belong together.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Settings {
    board: Option<BoardValues>,
    module: Option<ModuleValues>,
    special_boards: Vec<Special<BoardValues>>,
    special_modules: Vec<Special<ModuleValues>>,
    /// What a user should know, a line each.
    pub remarks: Vec<String>,
}

impl Settings {
    /// Takes a group of parameters; those that say nothing of boards are left out.
    pub fn group(&mut self, name: &str, params: &[(String, String)]) {
        match name {
            "defaultCfgBoard" => self.board = Some(self.board_values(params)),
            "defaultCfgTriangle" => self.module = Some(self.module_values(params)),
            "specialCfgBoards" => {
                for numbers in self.sets(params, "boardSetCfg", 6) {
                    let [bus, first, last, period_ms, board_type, no_load] = numbers[..] else { continue };
                    let values = BoardValues { period_ms, board_type, no_load };
                    self.special_boards.push(Special { bus, boards: (first, last), modules: (0, 15), values });
                }
            }
            "specialCfgTriangles" => {
                for numbers in self.sets(params, "triangleSetCfg", 7) {
                    let [bus, board, first, last, enabled, shift, cdc_offset] = numbers[..] else { continue };
                    let values = ModuleValues { enabled: enabled == 1, shift, cdc_offset };
                    self.special_modules.push(Special { bus, boards: (board, board), modules: (first, last), values });
                }
            }
            _ => {}
        }
    }

    fn board_values(&self, params: &[(String, String)]) -> BoardValues {
        let number = |name: &str, default| value(params, name).and_then(number).unwrap_or(default);
        BoardValues {
            period_ms: number("period", 50),
            board_type: number("skinType", 0),
            no_load: number("noLoad", 240),
        }
    }

    fn module_values(&mut self, params: &[(String, String)]) -> ModuleValues {
        let number = |name: &str, default| value(params, name).and_then(number).unwrap_or(default);
        let word = value(params, "enabled").unwrap_or("false").to_owned();
        let enabled = flag(&word);
        if enabled.is_none() {
            self.remarks.push(format!("enabled = `{}` is neither true nor false: taken as false", word.trim()));
        }
        let (shift, cdc_offset) = (number("shift", 2), number("cdcOffset", 0x2200));
        ModuleValues { enabled: enabled.unwrap_or(false), shift, cdc_offset }
    }

    /// The numbers of the sets that the host takes.
    fn sets(&mut self, params: &[(String, String)], prefix: &str, numbers_each: usize) -> Vec<Vec<i64>> {
        let count = value(params, "numOfSets").and_then(number).unwrap_or(0);
        let count = u32::try_from(count).unwrap_or(0).min(SETS_MAX);
        let mut sets = Vec::new();
        for (name, text) in params.iter().filter(|(name, _)| name.starts_with(prefix)) {
            let set = name[prefix.len()..].parse::<u32>().ok();
            let numbers = numbers(text);
            if set.is_none_or(|set| set == 0 || set > count) {
                self.remarks.push(format!("{name} is beyond the {count} sets that the host reads: left out"));
            } else if numbers.len() != numbers_each {
                let found = numbers.len();
                self.remarks.push(format!("{name} has {found} numbers, expected {numbers_each}: left out"));
            } else {
                sets.push(numbers);
            }
        }
        let mut names: Vec<&String> = params.iter().map(|(name, _)| name).filter(|n| n.starts_with(prefix)).collect();
        names.sort_unstable();
        if let Some([name, _]) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            self.remarks.push(format!("{name} is there twice: both count"));
        }
        sets
    }

    /// The older style: lists of one entry a board, of the boards `ids` on a bus.
    pub fn older_style(&mut self, bus: i64, ids: &[u8], params: &[(String, String)]) {
        let list = |name: &str| value(params, name).map(numbers).unwrap_or_default();
        let (low, high, shifts) = (list("4E_EnaL"), list("4E_EnaH"), list("4E_Shift"));
        for (i, address) in ids.iter().map(|id| i64::from(*id)).enumerate() {
            let (Some(low), Some(high)) = (low.get(i), high.get(i)) else { continue };
            let enabled = low & 0xFF | (high & 0xFF) << 8;
            for module in 0..16 {
                let values = ModuleValues {
                    enabled: enabled >> module & 1 == 1,
                    shift: shifts.get(i).copied().unwrap_or(2),
                    cdc_offset: 0x2200,
                };
                let (boards, modules) = ((address, address), (module, module));
                self.special_modules.push(Special { bus, boards, modules, values });
            }
        }
        if !low.is_empty() {
            self.remarks
                .push("configured in the older style (4C_, 4E_): compare shift and cdc_offset by hand".to_owned());
        }
    }

    /// Special sets for buses that the device does not have: the host does not use them either.
    #[must_use]
    pub fn of_other_buses(&self, own: &[u8]) -> Option<String> {
        let boards = self.special_boards.iter().map(|special| special.bus);
        let buses = boards.chain(self.special_modules.iter().map(|special| special.bus));
        let mut others: Vec<i64> = buses.filter(|bus| !own.iter().any(|own| i64::from(*own) == *bus)).collect();
        let sets = others.len();
        others.sort_unstable();
        others.dedup();
        let list: Vec<String> = others.iter().map(i64::to_string).collect();
        let own: Vec<String> = own.iter().map(u8::to_string).collect();
        (sets > 0).then(|| {
            let (list, own) = (list.join(", "), own.join(", "));
            format!(
                "{sets} special sets are for CAN {list} and not used: the device has CAN {own}. Is type or gain theirs?"
            )
        })
    }

    /// Takes over what another file says, for example the specification that a device includes.
    pub fn add(&mut self, other: Self) {
        self.board = self.board.or(other.board);
        self.module = self.module.or(other.module);
        self.special_boards.extend(other.special_boards);
        self.special_modules.extend(other.special_modules);
        self.remarks.extend(other.remarks);
    }

    /// Whether it says what boards are configured with.
    #[must_use]
    pub fn has_values(&self) -> bool {
        self.board.is_some() || self.module.is_some() || !self.special_modules.is_empty()
    }

    /// What a board is configured with; `bus` is the device's number of it.
    #[must_use]
    pub fn board(&self, bus: u8, address: u8) -> BoardValues {
        let default = self.board.unwrap_or(BoardValues { period_ms: 50, board_type: 0, no_load: 240 });
        last_of(&self.special_boards, bus, address, 0).unwrap_or(default)
    }

    /// What a module is configured with.
    #[must_use]
    pub fn module(&self, bus: u8, address: u8, module: u8) -> ModuleValues {
        let default = self.module.unwrap_or(ModuleValues { enabled: false, shift: 2, cdc_offset: 0x2200 });
        last_of(&self.special_modules, bus, address, module).unwrap_or(default)
    }
}

/// The last of the settings that concern a module, as the last command counts.
fn last_of<T: Copy>(list: &[Special<T>], bus: u8, address: u8, module: u8) -> Option<T> {
    let within = |(first, last): (i64, i64), number: u8| (first..=last).contains(&i64::from(number));
    let concerns = |special: &&Special<T>| {
        special.bus == i64::from(bus) && within(special.boards, address) && within(special.modules, module)
    };
    list.iter().rfind(concerns).map(|special| special.values)
}

/// A truth value, with the spellings that there are on real robots.
fn flag(text: &str) -> Option<bool> {
    let word: String = text.chars().filter(|c| !c.is_whitespace()).collect::<String>().to_ascii_lowercase();
    match word.as_str() {
        "true" | "1" | "ture" => Some(true),
        "false" | "0" | "fasle" | "flase" => Some(false),
        _ => None,
    }
}
