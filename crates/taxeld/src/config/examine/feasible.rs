//! What is well written and cannot work: names that no interface can have, a store that cannot be written, limits that
//! exclude each other.

use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use crate::config::bus_load::overloaded;
use crate::config::fault::Fault;
use crate::config::file::Config;
use crate::config::parts::{BusSection, BusSource, PatchSection};
use crate::config::resolve::Scene;

/// Longest name of a network interface in Linux, in bytes (IFNAMSIZ less its end).
const INTERFACE_BYTES_MAX: usize = 15;

/// Everything of a configuration that cannot work, whatever the daemon's account is.
pub fn impossible(config: &Config, scene: &Scene) -> Vec<Fault> {
    let mut found = Vec::new();
    for (number, bus) in config.bus.iter().enumerate() {
        let within = |fault: Fault| fault.within(&format!("bus[{number}]"), &format!("bus `{}`", bus.name));
        found.extend(interface(bus).map(within));
    }
    found.extend(store(&config.store.path));
    if config.store.budget_mb == 0 {
        let words = "store.budget_mb = 0: expected 1 or more, or no session can be started";
        found.push(Fault::of("store.budget_mb", words));
    }
    if let Some(keep) = config.store.keep_mb.filter(|keep| *keep > config.store.budget_mb) {
        let budget = config.store.budget_mb;
        found.push(Fault::of(
            "store.keep_mb",
            format!(
                "store.keep_mb = {keep}: expected at most store.budget_mb = {budget}, or no session can be started"
            ),
        ));
    }
    found.extend(overloaded(config, &scene.plan));
    for (number, (section, plan)) in config.patch.iter().zip(&scene.plan.patches).enumerate() {
        let within = |fault: Fault| fault.within(&format!("patch[{number}]"), &format!("patch `{}`", section.name));
        found.extend(session(section, &plan.session).into_iter().map(within));
    }
    found
}

fn interface(bus: &BusSection) -> Option<Fault> {
    if bus.source == BusSource::Sim {
        let lacks = || Fault::of("source", "source = \"sim\": this build has no simulator (cargo feature `sim`)");
        return cfg!(not(feature = "sim")).then(lacks);
    }
    let name = bus.interface.as_deref()?;
    let why = match name {
        "" => "is empty".to_owned(),
        "." | ".." => "names a folder".to_owned(),
        _ if name.len() > INTERFACE_BYTES_MAX => format!("has {} bytes", name.len()),
        _ if name.contains(['/', ':']) || name.contains(char::is_whitespace) => {
            "has a slash, a colon or a blank".to_owned()
        }
        _ => return None,
    };
    let expected = format!("expected 1 to {INTERFACE_BYTES_MAX} bytes without slash, colon and blank, as in \"can0\"");
    Some(Fault::of("interface", format!("interface = {name:?} {why}: {expected}")))
}

/// Why no account can write a store there. The folders that lack are made by the daemon.
fn store(path: &Path) -> Option<Fault> {
    let fault = |why: String| Some(Fault::of("store.path", format!("store.path = \"{}\": {why}", path.display())));
    if path.file_name().is_none() {
        return fault("expected the name of a file".to_owned());
    }
    if let Ok(there) = std::fs::metadata(path) {
        if !there.is_file() {
            return fault("it is not a file".to_owned());
        }
        if there.permissions().mode() & 0o222 == 0 {
            return fault("the file is read-only".to_owned());
        }
    }
    crate::files::no_room_in(path.parent()?).and_then(fault)
}

/// Limits of a session of which one leaves no room for another.
fn session(section: &PatchSection, limits: &taxel_engine::plan::SessionLimits) -> Vec<Fault> {
    let target = limits.target.0;
    let below_target = [
        ("fall_end_kpa", limits.fall_end.0, "the falling branch would end where it begins"),
        ("vented_below_kpa", limits.vented_below.0, "a ramp could begin at its end"),
        ("noise_band_kpa", limits.noise_band.0, "everything would be noise"),
    ];
    let set = |key: &str| match key {
        "fall_end_kpa" => section.session.fall_end_kpa.is_some(),
        "vented_below_kpa" => section.session.vented_below_kpa.is_some(),
        _ => section.session.noise_band_kpa.is_some(),
    };
    let excluded = below_target.into_iter().filter(|(_, kpa, _)| *kpa >= target);
    let fault = |(key, kpa, why): (&str, f64, &str)| {
        // The one of the two that the file has is the one to look at.
        let at = if set(key) { key } else { "target_kpa" };
        let words = format!("session.{key} = {kpa}: expected less than session.target_kpa = {target}, or {why}");
        Fault::of(format!("session.{at}"), words)
    };
    excluded.map(fault).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_store_is_possible_where_a_folder_can_be_made_and_impossible_below_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "").unwrap();
        assert_eq!(store(&folder.path().join("new/deeper/t.db")), None);
        assert_eq!(store(&file), None);
        let words = |path: &Path| store(path).unwrap().words().to_owned();
        assert!(words(&file.join("t.db")).contains("file is not a folder"));
        assert!(words(folder.path()).contains("it is not a file"));
        let closed = folder.path().join("closed");
        std::fs::create_dir(&closed).unwrap();
        std::fs::set_permissions(&closed, std::fs::Permissions::from_mode(0o555)).unwrap();
        assert!(words(&closed.join("t.db")).contains("is read-only"));
        std::fs::set_permissions(&closed, std::fs::Permissions::from_mode(0o755)).unwrap();
    }
}
