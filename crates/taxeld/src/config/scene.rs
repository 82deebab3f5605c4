//! From the file to the plan: the one check of all values and of all that they refer to, and what the scene leaves out.

use std::path::Path;

use taxel_engine::conflict::conflicts;
use taxel_engine::plan::Plan;
use taxel_rpc::{Grant, Rules, Subject};

use super::file::{BusSection, BusSource, Config, SharedMemorySection};
use super::listen::{Doors, doors};
use super::patch::patch_plan;
use super::ports;
use super::problem::Said;
use taxel_rig::Faults;

/// Smallest budget of recordings, in MB: less than a few files make no recording.
const RECORD_MB_MIN: u64 = 16;

/// As many as have a number in a byte, those of gauges and ports among them.
const BUSES_MAX: f64 = 256.0;

/// What an installation needs, resolved once.
#[derive(Clone, Debug)]
pub struct Scene {
    /// What the engine does.
    pub plan: Plan,
    /// Where the service listens, and who may do what.
    pub doors: Doors,
    /// What a user should know.
    pub said: Said,
}

/// Resolves a configuration, whose path is for files relative to it. What is wrong is noted, all of it; then there is no scene.
pub fn scene_of(config: &Config, path: &Path, faults: &mut Faults) -> Option<Scene> {
    faults.range("bus", config.bus.len() as f64, 0.0, BUSES_MAX);
    for (number, bus) in config.bus.iter().enumerate() {
        let is_twice = config.bus[..number].iter().any(|other| other.name == bus.name);
        faults.within(&format!("bus[{number}]"), &format!("bus `{}`", bus.name), |faults| {
            faults.require("name", !is_twice, || ": it is there twice");
            source(bus, faults);
        });
    }
    let has_path = !config.store.path.as_os_str().is_empty();
    faults.require("store.path", has_path, || " is missing: the file for sessions and model sets");
    let keeps = config.store.keep_mb != Some(0);
    faults.require("store.keep_mb", keeps, || " = 0: expected 1 or more, or no session could be kept");
    page(config, faults);
    record(config, faults);
    let doors = doors(config, path, faults);
    if let Some(section) = &config.shared_memory {
        shared_memory(section, doors.rules.as_ref(), faults);
    }
    let plan = Plan { buses: config.bus.len(), patches: Vec::new() };
    let mut scene = Scene { plan, doors, said: Said::default() };
    faults.require("patch", !config.patch.is_empty(), || ": there is no [[patch]], at least one is needed");
    for (number, section) in config.patch.iter().enumerate() {
        let is_twice = config.patch[..number].iter().any(|other| other.name == section.name);
        let plan = faults.within(&format!("patch[{number}]"), &format!("patch `{}`", section.name), |faults| {
            faults.require("name", !is_twice, || ": it is there twice");
            patch_plan(config, section, path, (faults, &mut scene.said))
        });
        scene.plan.patches.extend(plan);
    }
    conflicts(&scene.plan).iter().for_each(|conflict| faults.note(&config.patch_key(&conflict.patch), &conflict.why));
    faults.is_empty().then_some(scene)
}

fn source(bus: &BusSection, faults: &mut Faults) {
    let is_built = bus.source != BusSource::Sim || cfg!(feature = "sim");
    faults.require("source", is_built, || " = \"sim\": this build has no simulator (cargo feature `sim`)");
    ports::check_bus(bus, faults);
    let is_named = bus.interface.as_deref().is_some_and(|interface| !interface.is_empty());
    let is_found = is_named || bus.source != BusSource::SocketCan;
    faults.require("", is_found, || "source socketcan needs an interface, for example \"can0\"");
}

fn page(config: &Config, faults: &mut Faults) {
    let Some(page) = &config.page else { return };
    faults.require("page.listen", page.listen.ip().is_loopback(), || {
        let listen = page.listen;
        format!(
            " = {listen}: only loopback addresses are served; from elsewhere come through ssh -L or a proxy with TLS"
        )
    });
    let known = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_');
    let is_name = |host: &&String| !host.is_empty() && host.chars().all(known);
    for host in page.hosts.iter().filter(|host| !is_name(host)) {
        let words = format!("page.hosts: {host:?}: expected a name without scheme or port, as in \"robot.lab\"");
        faults.note("page.hosts", words);
    }
}

fn record(config: &Config, faults: &mut Faults) {
    let Some(budget_mb) = config.record.as_ref().map(|section| section.budget_mb) else { return };
    faults.require("record.budget_mb", budget_mb >= RECORD_MB_MIN, || {
        format!(" = {budget_mb}: expected {RECORD_MB_MIN} or more")
    });
}

/// To read a page is to observe, and no role stands before a file: so where an account needs a role to read the force, the
/// pages' group must have one, too.
fn shared_memory(section: &SharedMemorySection, rules: Option<&Rules>, faults: &mut Faults) {
    let SharedMemorySection { path, group } = section;
    faults.require("shared_memory.path", path.is_absolute(), || {
        format!(" = {path:?}: expected an absolute path, as in \"/dev/shm/taxeld\"")
    });
    let Some(rules) = rules.filter(|rules| rules.unix.is_none()) else { return };
    let granted = |group: &String| {
        let of_group = |grant: &Grant| matches!(&grant.subject, Subject::Group(name) if name == group);
        rules.grants.iter().any(of_group)
    };
    // The configuration does not say which group is the daemon's own, so no grant can be found for it.
    faults.require("shared_memory.group", group.as_ref().is_some_and(granted), || {
        let whose = group.as_ref().map_or("the daemon's own group".to_owned(), |group| format!("group `{group}`"));
        format!(
            ": {whose} could read the force, but no list of [access] has it or `unix`: name a group here that \
             access.observers has, as in \"group:skin\""
        )
    });
}

#[cfg(test)]
mod tests;
