//! The skin sections of a robot's configuration: which device has a part's boards, and what they are configured with.
//!
//! A port names the part, its wrapper names the device, the device has the boards: that chain decides, and what fits twice is
//! refused.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow};
use roxmltree::{Document, Node, ParsingOptions};
use taxel_skin::VALUES_PER_BOARD;

use super::part::Part;
use super::settings::{Param, Settings, number, numbers, value};
use taxel_files::read_any_text;

/// What the files say of skin.
#[derive(Debug, Default)]
pub struct Robot {
    /// The files that the user named.
    given: Vec<PathBuf>,
    /// All that were read, without links and detours.
    read: BTreeSet<PathBuf>,
    devices: Vec<Device>,
    ports: Vec<Port>,
    /// Files that say something of the whole robot, or only include others.
    used: BTreeSet<PathBuf>,
    /// What they include and cannot be read, a line each.
    unread: Vec<String>,
    /// How the names of the robot's ports begin.
    prefix: Option<String>,
}

/// A skin device, for example `left_leg-eb10-skin`, with what it includes.
#[derive(Clone, Debug, Default)]
pub struct Device {
    /// Its name, its file and those that it includes.
    pub name: String,
    files: Vec<PathBuf>,
    /// Its type: `embObjSkin` behind an Ethernet board, `canBusSkin` on a CAN bus of the robot's computer.
    kind: String,
    /// Of a CAN bus of the computer: the driver of its card, for example `cfw2can`.
    card: Option<String>,
    /// Addresses on each of the device's buses, by its number.
    addresses: BTreeMap<u8, Vec<u8>>,
    settings: Settings,
    /// What somebody has to look at, a line each.
    pub open: Vec<String>,
}

/// A port, without the prefix of its robot.
#[derive(Debug)]
struct Port {
    name: String,
    /// The first of the device's values that is in it, and how many boards' there are.
    first: usize,
    boards: usize,
    /// The wrapper that has it, its file, and the devices that it takes values from.
    wrapper: String,
    file: PathBuf,
    networks: Vec<String>,
}

/// A port of YARP.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DraftPort {
    /// Its name.
    pub name: String,
    /// The addresses of all boards in it, in its order.
    pub boards: Vec<u8>,
}

/// The device of a part.
#[derive(Debug)]
pub struct Source<'a> {
    /// It, with all that it includes.
    pub device: &'a Device,
    /// The place of the part's first board in the device's list.
    pub first_board: usize,
    /// The port that has the part's values, and the file that names it.
    pub port: DraftPort,
    file: Option<&'a Path>,
}

impl Robot {
    /// Reads the files and what they include, as far as that is there.
    ///
    /// # Errors
    /// The file that cannot be read, and why.
    pub fn read(given: &[PathBuf]) -> anyhow::Result<Self> {
        let mut robot = Self { given: given.to_vec(), ..Self::default() };
        given.iter().try_for_each(|path| robot.file(path))?;
        Ok(robot)
    }

    fn file(&mut self, path: &Path) -> anyhow::Result<()> {
        if !self.read.insert(whole(path)) {
            return Ok(());
        }
        let text = text(path)?;
        let document = parse(&text).with_context(|| path.display().to_string())?;
        for node in document.descendants().filter(|node| !is_in_device(node)) {
            match node.tag_name().name() {
                "robot" => {
                    self.used.insert(path.to_owned());
                    let prefix = node.attribute("portprefix").or(node.attribute("name"));
                    self.prefix = self.prefix.take().or(prefix.map(str::to_owned));
                }
                "device" => self.device(node, path),
                "include" => {
                    self.used.insert(path.to_owned());
                    let href = node.attribute("href").unwrap_or_default();
                    let read = match self.find(path, node) {
                        Some(given) if self.given.contains(&given) => Ok(self.file(&given)?),
                        Some(found) => self.file(&found).map_err(|error| format!("{error:#}")),
                        None => Err("it is not there".to_owned()),
                    };
                    // What only the robot's other devices need is not ours to complain of.
                    if let Err(why) = read.or_else(|why| if href.contains("skin") { Err(why) } else { Ok(()) }) {
                        self.unread.push(format!("{href}, which {} includes, is not used: {why}", path.display()));
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn device(&mut self, node: Node<'_, '_>, path: &Path) {
        let attribute = |name| node.attribute(name).unwrap_or("").trim().to_owned();
        let (name, kind) = (attribute("name"), attribute("type"));
        if kind == "skinWrapper" || value(&params(node), "device") == Some("skinWrapper") {
            self.ports.extend(ports(node, &name, path));
            return;
        }
        let mut device = Device { name, kind, files: vec![path.to_owned()], ..Device::default() };
        device.take(node);
        for include in node.descendants().filter(|below| below.tag_name().name() == "include") {
            let found = self.find(path, include);
            device.files.extend(found.clone());
            match found.and_then(|found| text(&found).ok()).as_deref().map(parse) {
                Some(Ok(document)) => device.take(document.root()),
                _ => {
                    let href = include.attribute("href").unwrap_or_default();
                    device.open.push(format!("{href} is included and cannot be read: settings as on most robots"));
                }
            }
        }
        device.open.extend(device.settings.of_no_board(&device.addresses));
        if matches!(device.kind.as_str(), "embObjSkin" | "canBusSkin") || !device.addresses.is_empty() {
            self.devices.push(device);
        }
    }

    /// Where the file lies that another one includes: relative to that, to the robot's folder two above it, or among those that
    /// were given.
    fn find(&self, file: &Path, include: Node<'_, '_>) -> Option<PathBuf> {
        let (folder, href) = (file.parent().unwrap_or(Path::new("")), include.attribute("href")?);
        let places = [folder.join(href), folder.join("../..").join(href)];
        let named = |given: &&PathBuf| given.file_name() == Path::new(href).file_name();
        let there = places.into_iter().find(|place| place.is_file());
        there.or_else(|| self.given.iter().find(named).cloned())
    }

    /// The device of a part that the user's files call by these names; `None` where no wrapper has a port of it.
    ///
    /// # Errors
    /// If several fit, or the one that fits is in none of the files.
    pub fn source(&self, part: Part, names: &[String]) -> Result<Option<Source<'_>>, String> {
        let mut all: Vec<&Port> = self.ports.iter().filter(|port| Part::named(&port.name) == Some(part)).collect();
        all.sort_by_key(|port| (port.first, &port.name));
        let called = |names: &[String]| -> Vec<&Port> {
            let so = |port: &&&Port| names.iter().any(|name| name.eq_ignore_ascii_case(&port.name));
            all.iter().filter(so).copied().collect()
        };
        // As its files call it, else as it is called, else as its name begins.
        let ports = [called(names), called(&[part.name()]), all.clone()].into_iter().find(|ports| !ports.is_empty());
        let Some(ports) = ports else { return Ok(self.only_device(part)) };
        let (port, networks) = (ports[0], ports.iter().flat_map(|port| &port.networks).collect::<BTreeSet<_>>());
        // A wrapper that names no device is of the only one that there is.
        let devices = self.devices.iter().filter(|device| networks.is_empty() || networks.contains(&device.name));
        let devices: Vec<&Device> = devices.collect();
        let (name, wrapper, file) = (&port.name, &port.wrapper, &port.file);
        match devices[..] {
            [device] => {
                let first_board = port.first / VALUES_PER_BOARD;
                let port = self.port(name, device, (first_board, port.boards));
                Ok(Some(Source { device, first_board, port, file: Some(file) }))
            }
            [] => {
                let networks = networks.into_iter().cloned().collect::<Vec<_>>().join(", ");
                let file = file.display();
                Err(format!(
                    "{file}: {wrapper} has the values of {networks}, which is in none of the files: give its file, too (--xml)"
                ))
            }
            _ => {
                let list: Vec<String> =
                    devices.iter().map(|d| format!("{} ({})", d.name, d.files[0].display())).collect();
                Err(format!("several devices fit port {name}: {}. Give only one of these files", list.join(", ")))
            }
        }
    }

    /// Where no wrapper has a port of a hand: the one device of its arm, if it has one board.
    fn only_device(&self, part: Part) -> Option<Source<'_>> {
        let of_limb = |device: &&Device| Part::named(&device.name).is_some_and(|of| of.bus() == part.bus());
        let mut devices = self.devices.iter().filter(of_limb);
        let device = devices.next().filter(|device| part.is_hand() && device.in_order().len() == 1)?;
        let port = self.port(&part.name(), device, (0, 1));
        devices.next().is_none().then_some(Source { device, first_board: 0, port, file: None })
    }

    /// A port by its whole name, with so many boards of a device from a first one on.
    fn port(&self, name: &str, device: &Device, (first, boards): (usize, usize)) -> DraftPort {
        let prefix = self.prefix.as_deref().unwrap_or("icub").trim().trim_matches('/');
        let addresses = device.in_order().into_iter().map(|(_, address)| address);
        DraftPort { name: format!("/{prefix}/skin/{name}"), boards: addresses.skip(first).take(boards).collect() }
    }

    /// What of the files is not used, where these are the sources of all patches: files, boards, includes; a line each.
    pub fn unused(&self, sources: &[Source<'_>]) -> Vec<String> {
        let mut used = self.used.clone();
        let mut devices: Vec<&Device> = Vec::new();
        for source in sources {
            used.extend(source.device.files.iter().cloned().chain(source.file.map(Path::to_owned)));
            if devices.iter().all(|device| device.name != source.device.name) {
                devices.push(source.device);
            }
        }
        let used: BTreeSet<PathBuf> = used.iter().map(|path| whole(path)).collect();
        let files = self.given.iter().filter(|given| !used.contains(&whole(given)));
        let files =
            files.map(|file| format!("{}: not used: it says nothing of the parts that were given", file.display()));
        let boards = devices.iter().filter_map(|device| {
            let of_device = sources.iter().filter(|source| source.device.name == device.name);
            let taken: BTreeSet<u8> = of_device.flat_map(|source| source.port.boards.clone()).collect();
            let left: Vec<String> = device
                .in_order()
                .iter()
                .map(|(_, address)| address)
                .filter(|address| !taken.contains(address))
                .map(u8::to_string)
                .collect();
            let words = format!(
                "{}: boards {} are in no patch: no file of their parts was given",
                device.name,
                left.join(", ")
            );
            Some(words).filter(|_| !left.is_empty())
        });
        self.unread.iter().cloned().chain(files).chain(boards).collect()
    }
}

impl Device {
    /// Takes what is said of the device here, in a group or outside of any.
    fn take(&mut self, node: Node<'_, '_>) {
        let groups = node.descendants().filter(|below| below.has_tag_name("group"));
        for part in std::iter::once(node).chain(groups) {
            let params = params(part);
            for (name, text) in &params {
                if let Some(bus) = name.strip_prefix("skinCanAddrsPatch").and_then(|number| number.parse().ok()) {
                    self.addresses.insert(bus, addresses(text));
                }
            }
            if let Some(ids) = value(&params, "skinCanIds").map(addresses).filter(|ids| !ids.is_empty()) {
                let bus = value(&params, "canDeviceNum").and_then(number).and_then(|bus| bus.try_into().ok());
                self.addresses.insert(bus.unwrap_or(0), ids);
            }
            self.card = self.card.take().or(value(&params, "canbusDevice").map(str::to_owned));
            self.settings.group(part.attribute("name").unwrap_or(""), &params, &mut self.open);
        }
    }

    /// Whether its boards are on no CAN interface of the computer: behind an Ethernet board, or on a card that SocketCAN does
    /// not know.
    pub fn is_out_of_reach(&self) -> bool {
        self.kind == "embObjSkin" || self.card.as_ref().is_some_and(|card| !card.eq_ignore_ascii_case("socketcan"))
    }

    /// What its boards are configured with; `None` where no file says it.
    pub fn settings(&self) -> Option<&Settings> {
        Some(&self.settings).filter(|settings| settings.has_values())
    }

    /// Bus and address of all boards in the order of the device's values: with two buses, the second's come first.
    pub fn in_order(&self) -> Vec<(u8, u8)> {
        let buses = self.addresses.iter().rev();
        buses.flat_map(|(bus, list)| list.iter().map(|address| (*bus, *address))).collect()
    }

    /// Which CAN bus of the robot its bus is: behind an Ethernet board one of its own, on the computer's card the one of this
    /// number, which devices may share.
    pub fn line(&self, bus: u8) -> String {
        if self.kind == "canBusSkin" { format!("CAN {bus}") } else { format!("{} {bus}", self.name) }
    }
}

/// The ports of a wrapper.
fn ports(node: Node<'_, '_>, wrapper: &str, file: &Path) -> Vec<Port> {
    let elems = |list: &'static str| {
        let of_list = move |elem: &Node<'_, '_>| elem.parent().and_then(|list| list.attribute("name")) == Some(list);
        node.descendants().filter(|elem| elem.has_tag_name("elem")).filter(of_list)
    };
    let words = |text: &str| text.replace(['(', ')', ',', '"'], " ").split_whitespace().map(str::to_owned).collect();
    let networks: Vec<String> =
        elems("networks").flat_map(|elem| -> Vec<String> { words(elem.text().unwrap_or("")) }).collect();
    let port = |elem: Node<'_, '_>| {
        let range = numbers(elem.text()?);
        let first = range.first().copied()?.try_into().ok()?;
        let last: usize = range.get(1).copied().unwrap_or_default().try_into().ok()?;
        let boards = (last + 1).saturating_sub(first).div_ceil(VALUES_PER_BOARD);
        let (name, networks) = (elem.attribute("name")?.trim().to_owned(), networks.clone());
        Some(Port { name, first, boards, wrapper: wrapper.to_owned(), file: file.to_owned(), networks })
    };
    elems("ports").filter_map(port).collect()
}

/// A path without links and detours.
fn whole(path: &Path) -> PathBuf {
    std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned())
}

fn is_in_device(node: &Node<'_, '_>) -> bool {
    node.ancestors().skip(1).any(|above| above.has_tag_name("device"))
}

/// The text of a file without its comments, which lie in each other: each goes up to the nearest end, and lines keep their numbers.
fn text(path: &Path) -> anyhow::Result<String> {
    let text = read_any_text(path)?;
    let (mut kept, mut rest) = (String::with_capacity(text.len()), text.as_str());
    while let Some(start) = rest.find("<!--") {
        let end = rest[start..].find("-->").map_or(rest.len(), |end| start + end + 3);
        kept.push_str(&rest[..start]);
        kept.extend(rest[start..end].chars().filter(|c| *c == '\n'));
        rest = &rest[end..];
    }
    kept.push_str(rest);
    Ok(kept.replace("-->", "")) // what an outer comment leaves behind
}

fn parse(text: &str) -> anyhow::Result<Document<'_>> {
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).map_err(|error| anyhow!("not well-formed XML: {error}"))
}

/// The parameters right below a node, or below a `params` there.
fn params(node: Node<'_, '_>) -> Vec<Param> {
    let (inner, own): (Vec<_>, Vec<_>) = node.children().partition(|child| child.has_tag_name("params"));
    let inner = inner.into_iter().flat_map(|params| params.children().collect::<Vec<_>>());
    let all = own.into_iter().chain(inner).filter(|child| child.has_tag_name("param"));
    all.filter_map(|p| Some((p.attribute("name")?.to_owned(), p.text().unwrap_or("").to_owned()))).collect()
}

fn addresses(text: &str) -> Vec<u8> {
    numbers(text).into_iter().filter_map(|n| u8::try_from(n).ok().filter(|n| (1..=15).contains(n))).collect()
}
