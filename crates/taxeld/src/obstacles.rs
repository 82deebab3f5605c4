//! What would keep a daemon from starting with a configuration on this machine. It is told beforehand as far as that needs no
//! change and no other account: what the machine lacks may come until then (`missing.rs`), and what this account may not look at
//! passes.

use crate::config::{Config, Door, Doors, Fault, RecordSection, Scene};
use crate::credentials::obstacle_of_tokens;
use crate::doors;
use crate::files;

/// Each obstacle, with the key that it is about.
pub fn obstacles(config: &Config, scene: &Scene) -> Vec<Fault> {
    let tokens = scene.doors.tokens.as_deref().and_then(obstacle_of_tokens);
    let mut found: Vec<Fault> = tokens.into_iter().map(|words| Fault::of("access.tokens", words)).collect();
    found.extend(listeners(config, &scene.doors));
    found.extend(config.record.as_ref().and_then(recordings));
    found
}

fn listeners(config: &Config, doors: &Doors) -> Vec<Fault> {
    let of = |(position, door): (usize, &Door)| {
        let key = if config.listen.is_empty() { String::new() } else { format!("listen[{position}]") };
        Some(Fault::of(key, format!("listen: {}", doors::obstacle(door)?)))
    };
    doors.doors.iter().enumerate().filter_map(of).collect()
}

/// A folder of recordings that is there need not be one to write in: the daemon then runs without, and tells.
fn recordings(section: &RecordSection) -> Option<Fault> {
    let why = files::no_room_in(&section.path).filter(|_| !section.path.is_dir())?;
    Some(Fault::of("record.path", format!("record.path = {}: {why}", section.path.display())))
}
