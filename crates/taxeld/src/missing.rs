//! What a configuration needs and this machine does not have, and what would keep a daemon from starting with it here. It is told
//! beforehand as far as that needs no change and no other account.

use std::path::{Path, PathBuf};

use taxel_rpc::{Subject, group_id, user_id};

use crate::config::{BusSource, Config, Door, Doors, Faults, Scene, line_of};
use crate::credentials::obstacle_of_tokens;
use crate::doors;
use crate::rig::At;

/// Where the kernel lists the interfaces of this machine.
const INTERFACES: &str = "/sys/class/net";

/// Notes what would keep a daemon from starting.
pub fn obstacles(config: &Config, scene: &Scene, faults: &mut Faults) {
    let tokens = scene.doors.tokens.as_deref().and_then(obstacle_of_tokens);
    tokens.iter().for_each(|words| faults.note("access.tokens", words));
    for (position, door) in scene.doors.doors.iter().enumerate() {
        let key = if config.listen.is_empty() { String::new() } else { format!("listen[{position}]") };
        doors::obstacle(door).iter().for_each(|words| faults.note(&key, format!("listen: {words}")));
    }
}

/// A line for each thing that is missing: the key that names it, and what is not there. The configuration may be checked on
/// another machine than the robot's, so that none of this is an error of it.
pub fn missing(config: &Config, doors: &Doors) -> Vec<String> {
    let interfaces = config.bus.iter().filter(|bus| bus.source == BusSource::SocketCan);
    let mut missing: Vec<String> = interfaces.filter_map(|bus| interface(bus.interface.as_deref()?)).collect();
    let lines = config.bus.iter().filter_map(|bus| line_of(config, bus));
    missing.extend(lines.filter_map(|line| match &line.at {
        At::Serial(path, _) => file("gauge.line", path),
        At::Tcp(_) => None,
    }));
    missing.extend(doors.doors.iter().flat_map(door));
    missing.extend(doors.tokens.iter().filter_map(|path| file("access.tokens", path)));
    missing.extend(doors.rules.grants.iter().filter_map(|grant| account(&grant.subject)));
    let pages = config.shared_memory.as_ref().and_then(|section| section.group.as_deref());
    missing.extend(pages.and_then(|name| group("shared_memory.group", name)));
    missing
}

fn interface(name: &str) -> Option<String> {
    let there = Path::new(INTERFACES).join(name).exists();
    (!there).then(|| format!("bus.interface: there is no interface `{name}`"))
}

fn door(door: &Door) -> Vec<String> {
    match door {
        Door::Unix { path, group: name, .. } => {
            let folder = path.parent().and_then(|folder| file("listen", folder));
            folder.into_iter().chain(name.as_deref().and_then(|name| group("socket_group", name))).collect()
        }
        Door::Tls { files, .. } => {
            let keys = ["cert", "key", "client_ca"];
            let of = |(key, path): (&str, &PathBuf)| file(&format!("tls.{key}"), path);
            keys.into_iter().zip(files).filter_map(of).collect()
        }
        Door::Tcp(_) => Vec::new(),
    }
}

fn account(subject: &Subject) -> Option<String> {
    match subject {
        Subject::User(name) if user_id(name).is_none() => Some(format!("access: there is no user `{name}`")),
        Subject::Group(name) => group("access", name),
        Subject::User(_) | Subject::Certificate(_) => None,
    }
}

fn group(key: &str, name: &str) -> Option<String> {
    group_id(name).is_none().then(|| format!("{key}: there is no group `{name}`"))
}

fn file(key: &str, path: &Path) -> Option<String> {
    std::fs::metadata(path).err().map(|error| format!("{key}: {}: {error}", path.display()))
}
