//! SIGHUP: the configuration is read again. What can change while the force goes on does; what cannot is named in the log
//! with the reason, and waits for a restart.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use toml::Value;

use crate::config;
use crate::logs;

/// The keys that change without a restart.
const CHANGEABLE: [&str; 1] = ["log.filter"];

/// Why the others wait, by the first word of a key.
const REASONS: [(&str, &str); 4] = [
    ("store", "the store is open"),
    ("service", "clients are connected to it as it is"),
    ("bus", "a bus that is opened anew loses frames, and with them the force"),
    ("patch", "another patch needs another zero, and has no force until it is taken"),
];

/// The configuration as it was when the daemon started, and as it is applied.
pub struct Reload {
    path: PathBuf,
    applied: BTreeMap<String, Value>,
}

impl Reload {
    /// Remembers what the daemon starts with.
    pub fn new(path: &Path) -> Self {
        let applied = keys(path).unwrap_or_default();
        Self { path: path.to_path_buf(), applied }
    }

    /// Reads the file again and applies what can be.
    pub fn again(&mut self) {
        let read = config::load(&self.path).map_err(|error| error.to_string());
        let read = read.and_then(|config| config::resolve(&config, &self.path).map_err(|error| error.to_string()));
        let found = match read.and_then(|_| keys(&self.path)) {
            Ok(found) => found,
            Err(error) => {
                tracing::error!("nothing is reloaded: {error}");
                return;
            }
        };
        let mut names: Vec<&String> = self.applied.keys().chain(found.keys()).collect();
        names.sort();
        names.dedup();
        let changed = names.into_iter().filter(|name| self.applied.get(*name) != found.get(*name)).cloned();
        let changed: Vec<String> = changed.collect();
        if changed.is_empty() {
            tracing::info!("reloaded: nothing has changed");
        }
        for name in changed {
            if CHANGEABLE.contains(&name.as_str()) {
                self.apply(name, &found);
            } else {
                let section = name.split(['.', '[']).next().unwrap_or_default();
                let reason = REASONS.iter().find(|(first, _)| *first == section).map_or("it is in use", |(_, why)| why);
                tracing::warn!("{name} is not reloaded: {reason}; it needs a restart");
            }
        }
    }

    fn apply(&mut self, name: String, found: &BTreeMap<String, Value>) {
        let value = found.get(&name);
        match logs::filter(value.and_then(Value::as_str)) {
            Ok(now) => {
                tracing::info!("{name} is reloaded: {now}");
                match value {
                    Some(value) => self.applied.insert(name, value.clone()),
                    None => self.applied.remove(&name),
                };
            }
            Err(error) => tracing::error!("{name} is not reloaded: {error}"),
        }
    }
}

/// Every value of the file by its key, such as `service.listen` and `patch[0].period_ms`.
fn keys(path: &Path) -> Result<BTreeMap<String, Value>, String> {
    let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let table: toml::Table = toml::from_str(&text).map_err(|error| error.to_string())?;
    let mut found = BTreeMap::new();
    let mut waiting: Vec<(String, Value)> = table.into_iter().collect();
    while let Some((name, value)) = waiting.pop() {
        match value {
            Value::Table(table) => {
                waiting.extend(table.into_iter().map(|(key, value)| (format!("{name}.{key}"), value)))
            }
            Value::Array(list) if list.iter().any(Value::is_table) => {
                let each = list.into_iter().enumerate().map(|(at, value)| (format!("{name}[{at}]"), value));
                waiting.extend(each);
            }
            value => drop(found.insert(name, value)),
        }
    }
    Ok(found)
}
