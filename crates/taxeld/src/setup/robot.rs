//! All files of a robot's configuration together: which device a part's values come from.
//!
//! A port names the part, its wrapper names the device, the device has the boards: that chain decides. Names of devices decide
//! only where no wrapper is among the files, and what fits twice is refused.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};

use super::part::Part;
use super::robot_xml::{Port, RobotXml, SkinDevice, Wrapper};
use super::settings::Settings;
use crate::files::read_any_text;

/// Values of a board on a port.
const BOARD_VALUES: usize = 16 * 12;
/// A robot's configuration includes some hundred files.
const FILES_MAX: usize = 4_000;

/// The files.
#[derive(Debug, Default)]
pub struct Robot {
    files: Vec<File>,
}

#[derive(Debug)]
struct File {
    path: PathBuf,
    /// The same without links and detours.
    real: PathBuf,
    read: RobotXml,
    /// Whether the user named it, and did not leave it to another one to include it.
    given: bool,
}

/// The device of a part.
#[derive(Clone, Debug)]
pub struct Source {
    /// It, with all that it includes.
    pub device: SkinDevice,
    /// The place of the part's first board in the device's list, where a wrapper says it.
    pub first_board: Option<usize>,
    /// The port that has the part's values, without the robot's prefix.
    pub port: Option<String>,
    /// Files that this was read from.
    files: BTreeSet<usize>,
}

impl Robot {
    /// Reads the files and what they include, as far as that is there.
    ///
    /// # Errors
    /// The file that cannot be read, and why.
    pub fn read(given: &[PathBuf]) -> anyhow::Result<Self> {
        let mut robot = Self::default();
        for path in given {
            robot.take(path, true)?;
        }
        let mut next = 0;
        while next < robot.files.len() {
            let file = &robot.files[next];
            let own = file.read.includes.iter().chain(file.read.devices.iter().flat_map(|device| &device.includes));
            let found: Vec<PathBuf> = own.filter_map(|href| robot.find(next, href)).collect();
            for path in found {
                robot.take(&path, false)?;
            }
            next += 1;
        }
        Ok(robot)
    }

    fn take(&mut self, path: &Path, given: bool) -> anyhow::Result<()> {
        let real = real(path);
        if self.files.iter().any(|file| file.real == real) {
            return Ok(());
        }
        if self.files.len() >= FILES_MAX {
            bail!("the files include more than {FILES_MAX} others: give those of the skin alone");
        }
        let text = read_any_text(path).with_context(|| path.display().to_string())?;
        let read = RobotXml::parse(&text);
        let read = match read {
            // What only the robot's other devices need is not ours to complain of.
            Err(_) if !given => RobotXml::default(),
            read => read.map_err(|why| anyhow::anyhow!("{}: {why}", path.display()))?,
        };
        self.files.push(File { path: path.to_owned(), real, read, given });
        Ok(())
    }

    /// Where the file lies that another one includes: relative to that, to the robot's folder two above it, or among those that
    /// were given.
    fn find(&self, file: usize, href: &str) -> Option<PathBuf> {
        let folder = self.files[file].path.parent().unwrap_or(Path::new(""));
        let places = [folder.join(href), folder.join("../..").join(href)];
        let name = Path::new(href).file_name()?.to_str()?;
        let named = |file: &&File| file.path.file_name().is_some_and(|own| own.eq_ignore_ascii_case(name));
        let there = places.into_iter().find(|place| place.is_file());
        there.or_else(|| self.files.iter().filter(|file| file.given).find(named).map(|file| file.path.clone()))
    }

    /// The file that another one includes, if it was read.
    fn included(&self, file: usize, href: &str) -> Option<usize> {
        let real = real(&self.find(file, href)?);
        self.files.iter().position(|file| file.real == real)
    }

    /// The device of a part that the user's files call by these names; `None` where no file has one.
    ///
    /// # Errors
    /// If several fit, or the one that fits is in none of the files.
    pub fn source(&self, part: Part, names: &[String]) -> Result<Option<Source>, String> {
        let ports = self.ports(part, names);
        let Some((file, wrapper, port)) = ports.first() else {
            return Ok(self.by_name(part)?.map(|(file, device)| self.whole(file, device, None)));
        };
        let mut devices = BTreeMap::new();
        for (file, wrapper, _) in &ports {
            for (at, device) in self.behind(*file, wrapper, part)? {
                devices.insert((at, device.name.clone()), device);
            }
        }
        if devices.len() > 1 {
            let list = devices.iter().map(|((file, _), device)| (*file, *device));
            return Err(self.several(&format!("port {}", port.name), list));
        }
        let Some(((at, _), device)) = devices.into_iter().next() else {
            let path = self.files[*file].path.display();
            return Err(format!("{path}: port {} of {} has no device that is in the files", port.name, wrapper.name));
        };
        let mut source = self.whole(at, device, Some(port));
        source.files.extend(ports.iter().map(|(file, ..)| *file));
        Ok(Some(source))
    }

    /// The ports of a part: those that are called as its files are, else as the part is, else that begin so. The first in the
    /// order of the device's values comes first.
    fn ports(&self, part: Part, names: &[String]) -> Vec<(usize, &Wrapper, &Port)> {
        let all = self.files.iter().enumerate().flat_map(|(at, file)| {
            file.read.wrappers.iter().flat_map(move |wrapper| wrapper.ports.iter().map(move |port| (at, wrapper, port)))
        });
        let mut all: Vec<_> = all.filter(|(_, _, port)| Part::named(&port.name) == Some(part)).collect();
        all.sort_by_key(|(_, _, port)| (port.first, port.name.clone()));
        let own = |port: &Port| names.iter().any(|name| name.eq_ignore_ascii_case(&port.name));
        let usual = |port: &Port| port.name.eq_ignore_ascii_case(&part.name());
        for called in [&own as &dyn Fn(&Port) -> bool, &usual] {
            let so: Vec<_> = all.iter().filter(|(_, _, port)| called(port)).copied().collect();
            if !so.is_empty() {
                return so;
            }
        }
        all
    }

    /// The devices behind a wrapper. One that does not name any is of the only device that there is, or of that of the part's limb.
    fn behind(&self, file: usize, wrapper: &Wrapper, part: Part) -> Result<Vec<(usize, &SkinDevice)>, String> {
        if wrapper.networks.is_empty() {
            let all: Vec<_> = self.devices().collect();
            return Ok(if all.len() == 1 { all } else { self.by_name(part)?.into_iter().collect() });
        }
        let named: Vec<_> = self.devices().filter(|(_, device)| wrapper.networks.contains(&device.name)).collect();
        if named.is_empty() {
            let path = self.files[file].path.display();
            let networks = wrapper.networks.join(", ");
            return Err(format!(
                "{path}: {} has the values of {networks}, which is in none of the files: give its file, too (--xml)",
                wrapper.name
            ));
        }
        Ok(named)
    }

    fn devices(&self) -> impl Iterator<Item = (usize, &SkinDevice)> {
        self.files.iter().enumerate().flat_map(|(at, file)| file.read.devices.iter().map(move |device| (at, device)))
    }

    /// The device whose name is of the part or, if none is, of its limb. Devices that a wrapper gives to other ports are none.
    fn by_name(&self, part: Part) -> Result<Option<(usize, &SkinDevice)>, String> {
        let taken: BTreeSet<&String> =
            self.files.iter().flat_map(|file| &file.read.wrappers).flat_map(|wrapper| &wrapper.networks).collect();
        let free = || self.devices().filter(|(_, device)| !taken.contains(&device.name));
        let own: Vec<_> = free().filter(|(_, device)| Part::named(&device.name) == Some(part)).collect();
        let fit =
            if own.is_empty() { free().filter(|(_, device)| part.is_of_limb(&device.name)).collect() } else { own };
        match fit[..] {
            [] => Ok(None),
            [one] => Ok(Some(one)),
            _ => Err(self.several(&part.name(), fit.into_iter())),
        }
    }

    fn several<'a>(&self, what: &str, devices: impl Iterator<Item = (usize, &'a SkinDevice)>) -> String {
        let list: Vec<String> =
            devices.map(|(file, device)| format!("{} ({})", device.name, self.files[file].path.display())).collect();
        format!(
            "several devices fit {what}: {}. Give the wrapper of its port (--xml), or only one of these files",
            list.join(", ")
        )
    }

    /// A device with what it includes.
    fn whole(&self, at: usize, device: &SkinDevice, port: Option<&Port>) -> Source {
        let (mut device, mut files) = (device.clone(), BTreeSet::from([at]));
        let mut missing = Vec::new();
        for href in device.includes.clone() {
            match self.included(at, &href) {
                Some(file) => {
                    device.settings.add(self.files[file].read.settings.clone());
                    files.insert(file);
                }
                None => missing.push(format!("{href} is included and not there")),
            }
        }
        if !device.settings.has_values() {
            device.settings.remarks.append(&mut missing);
        }
        let first_board = port.map(|port| port.first / BOARD_VALUES);
        Source { device, first_board, port: port.map(|port| port.name.clone()), files }
    }

    /// The robot's port of this name.
    #[must_use]
    pub fn port(&self, name: &str) -> String {
        let prefix = self.files.iter().find_map(|file| file.read.port_prefix.as_deref());
        format!("{}/skin/{name}", prefix.unwrap_or("/ROBOT"))
    }

    /// Whether any file was given.
    #[must_use]
    pub fn is_given(&self) -> bool {
        !self.files.is_empty()
    }

    /// What of the files is in no patch, a line each: `used` are the sources with the boards, by bus and address, that were taken.
    #[must_use]
    pub fn left_over(&self, used: &[(&Source, Vec<(u8, u8)>)]) -> Vec<String> {
        let files: BTreeSet<usize> = used.iter().flat_map(|(source, _)| source.files.iter().copied()).collect();
        let unused = |(at, file): &(usize, &File)| {
            let included = |href: &String| self.included(*at, href).is_some_and(|found| files.contains(&found));
            let leads = file.read.port_prefix.is_some() || file.read.includes.iter().any(included);
            file.given && !files.contains(at) && !leads
        };
        let lines = self.files.iter().enumerate().filter(unused);
        let mut lines: Vec<String> =
            lines.map(|(_, file)| format!("{}: not used: {}", file.path.display(), file.read.why_unused())).collect();
        lines.extend(self.boards_left_over(used));
        lines
    }

    fn boards_left_over(&self, used: &[(&Source, Vec<(u8, u8)>)]) -> Vec<String> {
        let mut names: Vec<&String> = used.iter().map(|(source, _)| &source.device.name).collect();
        names.sort_unstable();
        names.dedup();
        let of_device = |name: &&String| {
            let of: Vec<_> = used.iter().filter(|(source, _)| source.device.name == **name).collect();
            let taken: BTreeSet<(u8, u8)> = of.iter().flat_map(|(_, boards)| boards.iter().copied()).collect();
            let all = of.first()?.0.device.in_order();
            let left: Vec<usize> = (0..all.len()).filter(|at| !taken.contains(&all[*at])).collect();
            let list: Vec<String> = left.iter().map(|at| all[*at].1.to_string()).collect();
            let ports: Vec<String> = self.ports_of(name, &left).into_iter().map(|port| self.port(&port)).collect();
            let ports = if ports.is_empty() { String::new() } else { format!(" (port {})", ports.join(", ")) };
            (!left.is_empty()).then(|| format!("boards {} of {name} are in no patch{ports}", list.join(", ")))
        };
        names.iter().filter_map(of_device).collect()
    }

    /// The ports that have boards at these places of a device.
    fn ports_of(&self, device: &String, boards: &[usize]) -> Vec<String> {
        let wrappers = self.files.iter().flat_map(|file| &file.read.wrappers);
        let only = self.devices().count() == 1;
        let own = wrappers.filter(|wrapper| wrapper.networks.contains(device) || (wrapper.networks.is_empty() && only));
        let has = |port: &&Port| {
            let range = port.first / BOARD_VALUES..=port.last / BOARD_VALUES;
            boards.iter().any(|board| range.contains(board))
        };
        own.flat_map(|wrapper| &wrapper.ports).filter(has).map(|port| port.name.clone()).collect()
    }
}

impl RobotXml {
    fn why_unused(&self) -> String {
        let list = |names: Vec<&String>| names.into_iter().map(String::as_str).collect::<Vec<_>>().join(", ");
        if !self.devices.is_empty() {
            format!("no part that was given is on device {}", list(self.devices.iter().map(|d| &d.name).collect()))
        } else if !self.wrappers.is_empty() {
            let ports = self.wrappers.iter().flat_map(|wrapper| &wrapper.ports).map(|port| &port.name).collect();
            format!("no part that was given is on port {}", list(ports))
        } else if self.is_empty() {
            "it has no skin device, wrapper or specification".to_owned()
        } else {
            "no device that is used includes it".to_owned()
        }
    }
}

impl Source {
    /// What its boards are configured with; `None` where no file says it.
    #[must_use]
    pub fn settings(&self) -> Option<&Settings> {
        Some(&self.device.settings).filter(|settings| settings.has_values())
    }
}

fn real(path: &Path) -> PathBuf {
    std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned())
}
