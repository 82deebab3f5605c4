//! SIGHUP: the configuration is read again. What can change while the force goes on does; what cannot is named in the log
//! with the reason, and waits for a restart.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use taxel_rpc::Rules;
use toml::Value;

use crate::config;
use crate::logs;

/// What the log prints, which changes without a restart.
const LOG_FILTER: &str = "log.filter";

/// Who may do what changes without a restart, too: all keys below this but one.
const ACCESS: &str = "access.";
const TOKENS: &str = "access.tokens";

/// Why the others wait, by the first word of a key.
const REASONS: [(&str, &str); 5] = [
    ("access", "where the tokens are, and whether there are rules at all, is settled at the start"),
    ("store", "the store is open"),
    ("service", "clients are connected to it as it is"),
    ("bus", "a bus that is opened anew loses frames, and with them the force"),
    ("patch", "another patch needs another zero, and has no force until it is taken"),
];

/// The configuration as it was when the daemon started, and as it is applied.
pub struct Reload {
    path: PathBuf,
    applied: BTreeMap<String, Value>,
    /// Whether the configuration has rules of who may do what.
    ruled: bool,
}

impl Reload {
    /// Remembers what the daemon starts with.
    pub fn new(path: &Path, ruled: bool) -> Self {
        let applied = keys(path).unwrap_or_default();
        Self { path: path.to_path_buf(), applied, ruled }
    }

    /// Reads the file again and applies what can be. Gives the rules of who may do what, if these are others now.
    pub fn again(&mut self) -> Option<Rules> {
        let read = config::load(&self.path).map_err(|error| error.to_string());
        let read = read.and_then(|config| config::resolve(&config, &self.path).map_err(|error| error.to_string()));
        let (doors, found) = match read.and_then(|scene| Ok((scene.doors, keys(&self.path)?))) {
            Ok(read) => read,
            Err(error) => {
                tracing::error!("nothing is reloaded: {error}");
                return None;
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
        let mut regranted = false;
        for name in changed {
            if name == LOG_FILTER {
                self.filter(name, &found);
            } else if name.starts_with(ACCESS) && name != TOKENS && doors.ruled == self.ruled {
                tracing::info!("{name} is reloaded");
                self.note(name, &found);
                regranted = true;
            } else {
                let section = name.split(['.', '[']).next().unwrap_or_default();
                let reason = REASONS.iter().find(|(first, _)| *first == section).map_or("it is in use", |(_, why)| why);
                tracing::warn!("{name} is not reloaded: {reason}; it needs a restart");
            }
        }
        regranted.then_some(doors.rules)
    }

    fn filter(&mut self, name: String, found: &BTreeMap<String, Value>) {
        match logs::filter(found.get(&name).and_then(Value::as_str)) {
            Ok(now) => {
                tracing::info!("{name} is reloaded: {now}");
                self.note(name, found);
            }
            Err(error) => tracing::error!("{name} is not reloaded: {error}"),
        }
    }

    /// This key is applied as it was found.
    fn note(&mut self, name: String, found: &BTreeMap<String, Value>) {
        match found.get(&name) {
            Some(value) => self.applied.insert(name, value.clone()),
            None => self.applied.remove(&name),
        };
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
