//! The skin sections of a robot's configuration: devices with their boards, and what these are configured with.
//!
//! The files are not all well-formed: comments lie in each other. So comments are taken out first, each up to the nearest
//! end; what is no XML then is refused.

use std::collections::BTreeMap;

use roxmltree::{Document, Node, ParsingOptions};

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
pub struct RobotXml {
    /// The skin device, for example `left_leg-eb10-skin`.
    pub device: Option<String>,
    /// Addresses on each of the device's buses, by its number.
    pub addresses: BTreeMap<u8, Vec<u8>>,
    /// Files that it includes.
    pub includes: Vec<String>,
    /// Ports by name, each with the first value of the device's that is in it.
    pub ports: BTreeMap<String, usize>,
    board: Option<BoardValues>,
    module: Option<ModuleValues>,
    special_boards: Vec<Special<BoardValues>>,
    special_modules: Vec<Special<ModuleValues>>,
    /// What a user should know, a line each.
    pub remarks: Vec<String>,
}

impl RobotXml {
    /// Reads a file.
    ///
    /// # Errors
    /// Where and why it is no XML, also without its comments.
    pub fn parse(text: &str) -> Result<Self, String> {
        let text = without_comments(text.trim_start_matches('\u{feff}'));
        // A few of them, each made of many of the one before, stand for more than any memory holds.
        if let Some(at) = text.find("<!ENTITY") {
            let line = 1 + text[..at].bytes().filter(|byte| *byte == b'\n').count();
            return Err(format!(
                "line {line} defines an entity (`<!ENTITY`), which is not read: write out what it stands for"
            ));
        }
        let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
        let document = Document::parse_with_options(&text, options).map_err(|e| format!("not well-formed XML: {e}"))?;
        let mut read = Self::default();
        for node in document.descendants().filter(Node::is_element) {
            match (node.tag_name().name(), node.attribute("name")) {
                ("device", Some(name)) => {
                    read.device = Some(name.to_owned());
                    read.legacy(&params(node));
                }
                ("include", _) => read.includes.extend(node.attribute("href").map(str::to_owned)),
                ("group", Some(name)) => read.group(name, &params(node)),
                ("elem", Some(name)) => {
                    if let [first, _, _, _] = numbers(node.text().unwrap_or(""))[..]
                        && let Ok(first) = usize::try_from(first)
                    {
                        read.ports.insert(name.to_owned(), first);
                    }
                }
                _ => {}
            }
        }
        Ok(read)
    }

    fn group(&mut self, name: &str, params: &[(String, String)]) {
        match name {
            "patches" => {
                for (name, value) in params {
                    let bus = name.strip_prefix("skinCanAddrsPatch").and_then(|n| n.parse().ok());
                    if let Some(bus) = bus {
                        self.addresses.insert(bus, addresses(value));
                    }
                }
            }
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
            _ => self.legacy(params),
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

    /// The older style: one bus with a number, and lists of one entry a board.
    fn legacy(&mut self, params: &[(String, String)]) {
        let Some(ids) = value(params, "skinCanIds").map(addresses).filter(|ids| !ids.is_empty()) else { return };
        let bus = value(params, "canDeviceNum").and_then(number).unwrap_or(0);
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
        self.addresses.insert(u8::try_from(bus).unwrap_or(0), ids);
    }

    /// Takes over what another file says, for example the specification that a device includes.
    pub fn add(&mut self, other: Self) {
        self.device = self.device.take().or(other.device);
        self.addresses.extend(other.addresses);
        self.ports.extend(other.ports);
        self.board = self.board.or(other.board);
        self.module = self.module.or(other.module);
        self.special_boards.extend(other.special_boards);
        self.special_modules.extend(other.special_modules);
        self.remarks.extend(other.remarks);
    }

    /// The addresses of all boards in the order of the device's values: with two buses, the second's come first.
    #[must_use]
    pub fn in_order(&self) -> Vec<(u8, u8)> {
        let buses = self.addresses.iter().rev();
        buses.flat_map(|(bus, list)| list.iter().map(|address| (*bus, *address))).collect()
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

/// A text without its comments, each up to the nearest end; lines keep their numbers.
fn without_comments(text: &str) -> String {
    let (mut kept, mut rest) = (String::with_capacity(text.len()), text);
    while let Some(start) = rest.find("<!--") {
        let end = rest[start..].find("-->").map_or(rest.len(), |end| start + end + 3);
        kept.push_str(&rest[..start]);
        kept.extend(rest[start..end].chars().filter(|c| *c == '\n'));
        rest = &rest[end..];
    }
    kept.push_str(rest);
    kept.replace("-->", "") // what an outer comment leaves behind
}

/// Name and text of the parameters right below a node.
fn params(node: Node<'_, '_>) -> Vec<(String, String)> {
    let params = node.children().filter(|child| child.has_tag_name("param"));
    params.filter_map(|p| Some((p.attribute("name")?.to_owned(), p.text().unwrap_or("").to_owned()))).collect()
}

fn value<'a>(params: &'a [(String, String)], name: &str) -> Option<&'a str> {
    params.iter().find(|(n, _)| n.eq_ignore_ascii_case(name)).map(|(_, value)| value.as_str())
}

/// A number, decimal or hexadecimal.
fn number(text: &str) -> Option<i64> {
    let text = text.trim();
    match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(hex) => i64::from_str_radix(hex, 16).ok(),
        None => text.parse().ok(),
    }
}

/// The numbers of a list; brackets and commas are tolerated.
fn numbers(text: &str) -> Vec<i64> {
    text.split(|c: char| c.is_whitespace() || "(),;".contains(c)).filter_map(number).collect()
}

fn addresses(text: &str) -> Vec<u8> {
    numbers(text).into_iter().filter_map(|n| u8::try_from(n).ok().filter(|n| (1..=14).contains(n))).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    const DEVICE: &str = r#"<?xml version="1.0" encoding="UTF-8" ?>
<!DOCTYPE devices PUBLIC "-//YARP//DTD yarprobotinterface 3.0//EN" "http://www.yarp.it/DTD/yarprobotinterfaceV3.0.dtd">
<device xmlns:xi="http://www.w3.org/2001/XInclude" name="left_leg-eb10-skin" type="embObjSkin">
  <!-- <param name="old"> <!-- nested --> -->
  <group name="patches">
    <param name="skinCanAddrsPatch1"> 1 2 3 4 5 6 7 </param>
    <param name="skinCanAddrsPatch2"> 13 12 8 9 10 11 </param>
  </group>
  <xi:include href="./left_leg-eb10-skinSpec.xml" />
</device>"#;

    const SPEC: &str = r#"<params robot="r" build="1">
  <group name="defaultCfgBoard">
    <param name="period"> 50 </param> <param name="skinType"> 0 </param> <param name="noLoad"> 0xf0 </param>
  </group>
  <group name="defaultCfgTriangle">
    <param name="enabled"> fal se </param> <param name="shift"> 2 </param> <param name="cdcOffset"> 0x2200 </param>
  </group>
  <group name="specialCfgBoards">
    <param name="numOfSets"> 1 </param>
    <param name="boardSetCfg1"> 2 12 13 30 1 200 </param>
  </group>
  <group name="specialCfgTriangles">
    <param name="numOfSets"> 3 </param>
    <param name="triangleSetCfg1"> 1 4 0 6 1 0 0x2000 </param>
    <param name="triangleSetCfg2"> 1 4 5 5 0 2 8704 </param>
    <param name="triangleSetCfg2"> 2 12 1 2 1 2 0x2200 </param>
    <param name="triangleSetCfg3"> 1 4 8 </param>
    <param name="triangleSetCfg4"> 1 4 9 9 1 2 0x2200 </param>
  </group>
</params>"#;

    #[test]
    fn a_device_and_its_specification_say_how_each_module_is_configured() {
        let mut robot = RobotXml::parse(DEVICE).unwrap();
        assert_eq!(robot.includes, ["./left_leg-eb10-skinSpec.xml"]);
        robot.add(RobotXml::parse(SPEC).unwrap());
        assert_eq!(robot.device.as_deref(), Some("left_leg-eb10-skin"));
        let order: Vec<u8> = robot.in_order().into_iter().map(|(_, address)| address).collect();
        assert_eq!(order, [13, 12, 8, 9, 10, 11, 1, 2, 3, 4, 5, 6, 7], "the second bus comes first");
        assert_eq!(robot.board(2, 13), BoardValues { period_ms: 30, board_type: 1, no_load: 200 });
        assert_eq!(robot.board(1, 13), BoardValues { period_ms: 50, board_type: 0, no_load: 240 });
        let enabled: Vec<u8> = (0..16).filter(|m| robot.module(1, 4, *m).enabled).collect();
        assert_eq!(enabled, [0, 1, 2, 3, 4, 6], "set 2 comes after set 1, set 4 is not read");
        assert_eq!(robot.module(1, 4, 0), ModuleValues { enabled: true, shift: 0, cdc_offset: 0x2000 });
        assert!(robot.module(2, 12, 2).enabled && !robot.module(2, 12, 3).enabled);
        let remarks = robot.remarks.join("\n");
        for says in ["triangleSetCfg3 has 3 numbers, expected 7", "triangleSetCfg4 is beyond the 3 sets", "twice"] {
            assert!(remarks.contains(says), "{says}: {remarks}");
        }
    }

    #[test]
    fn misspelt_truth_values_are_understood() {
        for (word, enabled) in [("true", true), ("1", true), (" TRUE ", true), ("fasle", false), ("fal se", false)] {
            let robot = RobotXml::parse(&SPEC.replace("fal se", word)).unwrap();
            assert_eq!(robot.module(1, 9, 0).enabled, enabled, "{word}");
            assert!(!robot.remarks.iter().any(|r| r.contains("neither true nor false")), "{word}");
        }
        let robot = RobotXml::parse(&SPEC.replace("fal se", "perhaps")).unwrap();
        assert!(robot.remarks.iter().any(|r| r.contains("`perhaps` is neither true nor false")));
    }

    #[test]
    fn the_older_style_has_a_mask_of_modules_a_board() {
        let text = "<device name='right_hand-skin' type='canBusSkin'><param name='canDeviceNum'>8</param>\
                    <param name='skinCanIds'>14 13</param><param name='4E_EnaL'>0x1F 0xFF</param>\
                    <param name='4E_EnaH'>0x0F 255</param></device>";
        let robot = RobotXml::parse(text).unwrap();
        let enabled: Vec<u8> = (0..16).filter(|m| robot.module(8, 14, *m).enabled).collect();
        assert_eq!(enabled, [0, 1, 2, 3, 4, 8, 9, 10, 11]);
        assert_eq!(robot.in_order(), [(8, 14), (8, 13)]);
    }

    /// Of 26 kB they made four thousand million bytes.
    #[test]
    fn entities_are_refused_before_anything_is_made_of_them() {
        let bomb = "<?xml version=\"1.0\"?>\n<!DOCTYPE d [<!ENTITY a \"1 1 1\">\n<!ENTITY b \"&a;&a;\">]>\n<d>&b;</d>";
        let why = RobotXml::parse(bomb).unwrap_err();
        assert!(why.starts_with("line 2 defines an entity"), "{why}");
        assert!(RobotXml::parse("<!DOCTYPE d>\n<d/>").is_ok(), "as real files have it");
    }

    #[test]
    fn ports_are_found_and_what_is_no_xml_is_refused_with_its_place() {
        let wrapper = "<devices robot='r'><device name='w' type='skinWrapper'><paramlist name='ports'>\
                       <elem name='left_foot'> 0 383 0 383</elem><elem name='left_leg_lower'>384 1151 0 767</elem>\
                       </paramlist></device></devices>";
        let ports = RobotXml::parse(wrapper).unwrap().ports;
        assert_eq!(ports, [("left_foot".to_owned(), 0), ("left_leg_lower".to_owned(), 384)].into());
        let why = RobotXml::parse("<a>\n<b></a>").unwrap_err();
        assert!(why.contains("2:"), "{why}");
    }
}
