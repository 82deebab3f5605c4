//! SIGHUP: the configuration is read again. What can change while the force goes on does; what cannot is named in the log
//! with the reason, and waits for a restart.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use taxel_rpc::Rules;
use toml::Value;

use crate::config::{self, Problems, Scene};
use crate::files::read_utf8;
use crate::logs;

/// What the log prints, which changes without a restart.
const LOG_FILTER: &str = "log.filter";

/// Who may do what changes without a restart, too: all keys below this but one.
const ACCESS: &str = "access.";
const TOKENS: &str = "access.tokens";

/// Why the others wait, by the first word of a key.
const REASONS: [(&str, &str); 6] = [
    ("access", "where the tokens are, and whether there are rules at all, is settled at the start"),
    ("store", "the store is open"),
    ("listen", "clients are connected to it as it is"),
    ("socket_group", "clients are connected to it as it is"),
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
    /// Remembers what the daemon starts with: the text that its configuration was read from. By the time that it serves the
    /// file may say something else, which is not applied yet.
    pub fn new(path: &Path, text: &str, ruled: bool) -> Self {
        let applied = keys(text).unwrap_or_default(); // what was read as a configuration is TOML
        Self { path: path.to_path_buf(), applied, ruled }
    }

    /// Reads the file again and applies what can be. Gives the rules of who may do what, which are to be in force now;
    /// nothing if they need a restart or the file cannot be used.
    pub fn again(&mut self) -> Option<Rules> {
        let text = read_utf8(&self.path).map_err(|error| format!("{}: {error}", self.path.display()));
        text.and_then(|text| self.apply(&text)).unwrap_or_else(|error| {
            tracing::error!("nothing is reloaded: {error}");
            None
        })
    }

    /// Applies what can be of a text with which the daemon could be started, as far as can be told beforehand. Keys and rules
    /// are of this one: what is written meanwhile is for the next reload.
    fn apply(&mut self, text: &str) -> Result<Option<Rules>, String> {
        let in_a_line = |problems: Problems| {
            let each: Vec<String> = problems.all().iter().map(ToString::to_string).collect();
            each.join("; ")
        };
        let (_, Scene { doors, .. }) = config::examine_text(&self.path, text).map_err(in_a_line)?;
        let found = keys(text)?;
        let regrants = doors.ruled == self.ruled;
        let changed = self.changed(&found);
        if !regrants && !changed.iter().any(|name| name.starts_with(ACCESS)) {
            refuse("access"); // a section without keys has come or gone
        } else if changed.is_empty() {
            tracing::info!("reloaded: nothing has changed");
        }
        for name in changed {
            if name == LOG_FILTER {
                self.filter(name, &found);
            } else if name.starts_with(ACCESS) && name != TOKENS && regrants {
                tracing::info!("{name} is reloaded");
                self.note(name, &found);
            } else {
                refuse(&name);
            }
        }
        // Also if no key has changed: who may do what is what the file says, not what a comparison says of it.
        Ok(regrants.then_some(doors.rules))
    }

    /// The keys that have another value than the one applied, or are here or there alone.
    fn changed(&self, found: &BTreeMap<String, Value>) -> Vec<String> {
        let names: BTreeSet<&String> = self.applied.keys().chain(found.keys()).collect();
        names.into_iter().filter(|name| self.applied.get(*name) != found.get(*name)).cloned().collect()
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

/// Tells that a key waits for a restart, and why.
fn refuse(name: &str) {
    let section = name.split(['.', '[']).next().unwrap_or_default();
    let reason = REASONS.iter().find(|(first, _)| *first == section).map_or("it is in use", |(_, why)| why);
    tracing::warn!("{name} is not reloaded: {reason}; it needs a restart");
}

/// Every value of a text by its key, such as `store.path` and `patch[0].period_ms`.
fn keys(text: &str) -> Result<BTreeMap<String, Value>, String> {
    let table: toml::Table = toml::from_str(text).map_err(|error| error.to_string())?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_rpc::{Grant, Role, Subject};

    const SCENE: &str = "[store]\npath = \"t.db\"\n[[bus]]\nname = \"b\"\ninterface = \"can0\"\n[[patch]]\nname = \"p\"\n\
                         bus = \"b\"\nboards = [{ address = 13, modules = \"0-3\" }]\n";

    fn granting(users: &[&str]) -> String {
        let users: Vec<String> = users.iter().map(|user| format!("user:{user}")).collect();
        format!("{SCENE}[access]\noperators = {users:?}\n")
    }

    fn grants(users: &[&str]) -> Vec<Grant> {
        let grant = |user: &&str| Grant { subject: Subject::User((*user).to_owned()), role: Role::Operator };
        users.iter().map(grant).collect()
    }

    /// The daemon reads its configuration, then its store, for seconds: a grant may go meanwhile.
    #[test]
    fn what_the_file_says_since_the_start_is_applied_by_the_first_reload_and_told_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("taxeld.toml");
        std::fs::write(&path, granting(&["ann"])).unwrap();
        let mut reload = Reload::new(&path, &granting(&["ann", "bob"]), true);
        let now = keys(&granting(&["ann"])).unwrap();
        assert_eq!(reload.changed(&now), ["access.operators"]);
        assert_eq!(reload.again().unwrap().grants, grants(&["ann"]));
        assert_eq!(reload.changed(&now), Vec::<String>::new());
    }

    #[test]
    fn the_rules_of_the_file_are_given_whatever_has_changed_and_not_where_they_need_a_restart() {
        let path = Path::new("taxeld.toml");
        let text = granting(&["ann"]);
        let mut reload = Reload::new(path, &text, true);
        assert_eq!(reload.apply(&text).unwrap().unwrap().grants, grants(&["ann"]));
        let other = format!("socket_group = \"skin\"\n{text}");
        assert_eq!(reload.apply(&other).unwrap().unwrap().grants, grants(&["ann"]));
        assert_eq!(reload.changed(&keys(&other).unwrap()), ["socket_group"], "it waits for a restart");
        assert_eq!(reload.apply(SCENE), Ok(None), "without [access] there are no rules");
        assert_eq!(Reload::new(path, SCENE, false).apply(&text), Ok(None), "there were none before");
        assert_eq!(Reload::new(path, SCENE, false).apply(SCENE), Ok(Some(Rules::open())));
    }

    /// There is no file at all: were a part of a reload read from it a second time, another text could come.
    #[test]
    fn keys_and_rules_of_a_reload_are_of_one_text() {
        let folder = tempfile::tempdir().unwrap();
        let mut reload = Reload::new(&folder.path().join("taxeld.toml"), &granting(&["ann"]), true);
        let text = granting(&["bob"]);
        assert_eq!(reload.apply(&text).unwrap().unwrap().grants, grants(&["bob"]));
        assert_eq!(reload.applied, keys(&text).unwrap());
        assert_eq!(reload.again(), None, "a file that cannot be read changes nothing");
        assert_eq!(reload.applied, keys(&text).unwrap());
        assert!(reload.apply(&text.replace("user:", "usr:")).unwrap_err().contains("expected user:NAME"));
        assert!(
            reload.apply(&text.replace("t.db", "/")).unwrap_err().contains("store.path"),
            "it could not be started with"
        );
        assert_eq!(reload.applied, keys(&text).unwrap());
    }
}
