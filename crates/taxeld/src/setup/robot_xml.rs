//! The skin sections of a robot's configuration: devices with their boards, what these are configured with, and the
//! wrappers that say which port has the values of which device.
//!
//! The files are not all well-formed: comments lie in each other. So comments are taken out first, each up to the nearest
//! end; what is no XML then is refused.

use std::collections::BTreeMap;

use roxmltree::{Document, Node, ParsingOptions};

use super::params::{number, numbers, value};
use super::settings::Settings;

/// A file of a robot's configuration, as far as it is about skin.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RobotXml {
    /// Skin devices.
    pub devices: Vec<SkinDevice>,
    /// Wrappers of skin devices.
    pub wrappers: Vec<Wrapper>,
    /// What boards are configured with, outside of any device: a specification that a device includes.
    pub settings: Settings,
    /// Files that it includes outside of any device.
    pub includes: Vec<String>,
    /// How the names of the robot's ports begin.
    pub port_prefix: Option<String>,
}

/// A skin device, for example `left_leg-eb10-skin`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SkinDevice {
    /// Its name.
    pub name: String,
    /// Its type: `embObjSkin` behind an Ethernet board, `canBusSkin` on a CAN bus of the robot's computer.
    pub kind: String,
    /// The driver of the CAN card, where it has one: `cfw2can`, `ecan`, `socketcan`.
    pub card: Option<String>,
    /// Addresses on each of the device's buses, by its number.
    pub addresses: BTreeMap<u8, Vec<u8>>,
    /// What its boards are configured with.
    pub settings: Settings,
    /// Files that it includes.
    pub includes: Vec<String>,
}

/// What gives a device's values out on ports.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Wrapper {
    /// Its name.
    pub name: String,
    /// The ports.
    pub ports: Vec<Port>,
    /// Names of the devices that it takes values from.
    pub networks: Vec<String>,
}

/// A port, without the prefix of its robot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Port {
    /// `left_forearm`.
    pub name: String,
    /// The first of the device's values that is in it.
    pub first: usize,
    /// The last one.
    pub last: usize,
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
            let in_device = node.ancestors().skip(1).any(|above| above.has_tag_name("device"));
            match node.tag_name().name() {
                "robot" => {
                    read.port_prefix =
                        read.port_prefix.or(node.attribute("portprefix").or(node.attribute("name")).map(prefix))
                }
                "device" if !in_device => read.device(node),
                "include" if !in_device => read.includes.extend(node.attribute("href").map(str::to_owned)),
                "group" if !in_device => read.settings.group(node.attribute("name").unwrap_or(""), &params(node)),
                _ => {}
            }
        }
        Ok(read)
    }

    fn device(&mut self, node: Node<'_, '_>) {
        let name = node.attribute("name").unwrap_or("").trim().to_owned();
        let kind = node.attribute("type").unwrap_or("").trim().to_owned();
        let wrapper = Wrapper::of(node, name.clone());
        if !wrapper.ports.is_empty() && (kind == "skinWrapper" || value(&params(node), "device") == Some("skinWrapper"))
        {
            self.wrappers.push(wrapper);
            return;
        }
        let device = SkinDevice::of(node, name, kind);
        if matches!(device.kind.as_str(), "embObjSkin" | "canBusSkin") || !device.addresses.is_empty() {
            self.devices.push(device);
        }
    }

    /// Whether it says nothing of any skin.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.devices.is_empty() && self.wrappers.is_empty() && !self.settings.has_values()
    }
}

impl SkinDevice {
    fn of(node: Node<'_, '_>, name: String, kind: String) -> Self {
        let mut device = Self { name, kind, ..Self::default() };
        device.params(&params(node));
        for below in node.descendants().filter(Node::is_element) {
            match (below.tag_name().name(), below.attribute("name")) {
                ("include", _) => device.includes.extend(below.attribute("href").map(str::to_owned)),
                ("group", Some("patches")) => device.patches(&params(below)),
                ("group", Some(name)) => {
                    device.params(&params(below));
                    device.settings.group(name, &params(below));
                }
                _ => {}
            }
        }
        device
    }

    fn patches(&mut self, params: &[(String, String)]) {
        for (name, value) in params {
            if let Some(bus) = name.strip_prefix("skinCanAddrsPatch").and_then(|n| n.parse().ok()) {
                self.addresses.insert(bus, addresses(value));
            }
        }
    }

    /// What is said of a device that has its CAN bus on the robot's computer.
    fn params(&mut self, params: &[(String, String)]) {
        // A card that several devices share is named behind the one that shares it.
        self.card = self
            .card
            .take()
            .or_else(|| value(params, "physDevice").or(value(params, "canbusDevice")).map(str::to_owned));
        let Some(ids) = value(params, "skinCanIds").map(addresses).filter(|ids| !ids.is_empty()) else { return };
        let bus = value(params, "canDeviceNum").and_then(number).unwrap_or(0);
        self.settings.older_style(bus, &ids, params);
        self.addresses.insert(u8::try_from(bus).unwrap_or(0), ids);
    }

    /// The addresses of all boards in the order of the device's values: with two buses, the second's come first.
    #[must_use]
    pub fn in_order(&self) -> Vec<(u8, u8)> {
        let buses = self.addresses.iter().rev();
        buses.flat_map(|(bus, list)| list.iter().map(|address| (*bus, *address))).collect()
    }

    /// Which CAN bus of the robot its port is: behind an Ethernet board one of its own, on the computer's card the one of this
    /// number, which devices may share.
    #[must_use]
    pub fn line(&self, port: u8) -> String {
        if self.kind == "canBusSkin" { format!("CAN {port}") } else { format!("{} {port}", self.name) }
    }

    /// Why the robot's computer has no CAN interface for it, if so.
    #[must_use]
    pub fn out_of_reach(&self) -> Option<String> {
        match (self.kind.as_str(), self.card.as_deref()) {
            ("embObjSkin", _) => Some(format!("its device {} is behind an Ethernet board (embObjSkin)", self.name)),
            (_, Some(card)) if !card.eq_ignore_ascii_case("socketcan") => {
                Some(format!("the CAN card of its device {} ({card}) has no SocketCAN driver", self.name))
            }
            _ => None,
        }
    }
}

impl Wrapper {
    fn of(node: Node<'_, '_>, name: String) -> Self {
        let mut wrapper = Self { name, ..Self::default() };
        for list in node.descendants().filter(|below| below.has_tag_name("paramlist")) {
            let elems = list.children().filter(|elem| elem.has_tag_name("elem"));
            for elem in elems {
                let text = elem.text().unwrap_or("");
                match (list.attribute("name"), elem.attribute("name")) {
                    (Some("networks"), _) => wrapper.networks.extend(words(text)),
                    (Some("ports"), Some(name)) => wrapper.ports.extend(Port::of(name, text)),
                    _ => {}
                }
            }
        }
        wrapper
    }
}

impl Port {
    fn of(name: &str, text: &str) -> Option<Self> {
        let [first, last, _, _] = numbers(text)[..] else { return None };
        Some(Self { name: name.trim().to_owned(), first: first.try_into().ok()?, last: last.try_into().ok()? })
    }
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

/// Name and text of the parameters right below a node, or below a `params` there.
fn params(node: Node<'_, '_>) -> Vec<(String, String)> {
    let (inner, own): (Vec<_>, Vec<_>) =
        node.children().filter(Node::is_element).partition(|child| child.has_tag_name("params"));
    let inner = inner.into_iter().flat_map(|params| params.children().collect::<Vec<_>>());
    let all = own.into_iter().chain(inner).filter(|child| child.has_tag_name("param"));
    all.filter_map(|p| Some((p.attribute("name")?.to_owned(), p.text().unwrap_or("").to_owned()))).collect()
}

/// The prefix of a robot's ports, with the slash that some files leave out.
fn prefix(text: &str) -> String {
    format!("/{}", text.trim().trim_matches('/'))
}

/// The words of a list; brackets and quotes are tolerated.
fn words(text: &str) -> impl Iterator<Item = String> {
    text.split(|c: char| c.is_whitespace() || "(),\"".contains(c)).filter(|word| !word.is_empty()).map(str::to_owned)
}

fn addresses(text: &str) -> Vec<u8> {
    numbers(text).into_iter().filter_map(|n| u8::try_from(n).ok().filter(|n| (1..=15).contains(n))).collect()
}

#[cfg(test)]
mod tests {
    use super::super::settings::{BoardValues, ModuleValues};
    use super::*;

    /// The only device of a file.
    fn device(text: &str) -> SkinDevice {
        RobotXml::parse(text).unwrap().devices.remove(0)
    }

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
        let mut device = device(DEVICE);
        assert_eq!(device.includes, ["./left_leg-eb10-skinSpec.xml"]);
        assert_eq!(device.name, "left_leg-eb10-skin");
        let order: Vec<u8> = device.in_order().into_iter().map(|(_, address)| address).collect();
        assert_eq!(order, [13, 12, 8, 9, 10, 11, 1, 2, 3, 4, 5, 6, 7], "the second bus comes first");
        device.settings.add(RobotXml::parse(SPEC).unwrap().settings);
        let robot = device.settings;
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
            let robot = RobotXml::parse(&SPEC.replace("fal se", word)).unwrap().settings;
            assert_eq!(robot.module(1, 9, 0).enabled, enabled, "{word}");
            assert!(!robot.remarks.iter().any(|r| r.contains("neither true nor false")), "{word}");
        }
        let robot = RobotXml::parse(&SPEC.replace("fal se", "perhaps")).unwrap().settings;
        assert!(robot.remarks.iter().any(|r| r.contains("`perhaps` is neither true nor false")));
    }

    #[test]
    fn the_older_style_has_a_mask_of_modules_a_board() {
        let text = "<device name='right_hand-skin' type='canBusSkin'><param name='canDeviceNum'>8</param>\
                    <param name='skinCanIds'>14 13</param><param name='4E_EnaL'>0x1F 0xFF</param>\
                    <param name='4E_EnaH'>0x0F 255</param></device>";
        let robot = device(text);
        let enabled: Vec<u8> = (0..16).filter(|m| robot.settings.module(8, 14, *m).enabled).collect();
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
                       </paramlist><action><paramlist name='networks'><elem name='Set'> left_leg-skin </elem></paramlist></action>\
                       </device></devices>";
        let wrapper = RobotXml::parse(wrapper).unwrap().wrappers.remove(0);
        let ports: Vec<_> = wrapper.ports.iter().map(|port| (port.name.as_str(), port.first, port.last)).collect();
        assert_eq!(ports, [("left_foot", 0, 383), ("left_leg_lower", 384, 1151)]);
        assert_eq!(wrapper.networks, ["left_leg-skin"]);
        let why = RobotXml::parse("<a>\n<b></a>").unwrap_err();
        assert!(why.contains("2:"), "{why}");
    }
}
