//! What changes while the daemon runs: on SIGHUP the configuration is read again, and with it certificates and tokens, which
//! are also looked at every five seconds. Who may do what and the log's filter change; all else waits for a restart, and the
//! log names it.

use std::collections::{BTreeMap, BTreeSet};
use std::future::pending;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context;
use taxel_rpc::Rules;
use tokio::signal::unix::Signal;
use tokio_util::sync::CancellationToken;
use toml::Value;

use crate::config::{self, Problems, Scene};
use crate::credentials::Credentials;
use crate::files::read_utf8;
use crate::logs;
use crate::systemd;

/// Files of certificates and tokens are looked at so often.
const LOOK_EVERY: Duration = Duration::from_secs(5);

/// Keys that change without a restart: the log's filter, and who may do what, but not where the tokens are.
const LOG_FILTER: &str = "log.filter";
const ACCESS: &str = "access.";
const TOKENS: &str = "access.tokens";

/// Reads files again until the daemon ends, with the configuration where there is one to read. Each time a thread for what
/// blocks does it, so that a disk that hangs holds up nobody else.
pub async fn keep(
    mut credentials: Credentials,
    mut reload: Option<(Signal, Reload)>,
    cancel: CancellationToken,
) -> anyhow::Result<()> {
    loop {
        let asked = tokio::select! {
            () = cancel.cancelled() => return Ok(()),
            () = hung_up(reload.as_mut().map(|(hangup, _)| hangup)) => true,
            () = tokio::time::sleep(LOOK_EVERY) => false,
        };
        if asked {
            systemd::reloading();
        }
        let file = reload.as_ref().filter(|_| asked).map(|(_, reload)| reload.clone());
        let read = tokio::task::spawn_blocking(move || {
            credentials.look(asked); // before the configuration, of which a disk that hangs may be in the way
            if let Some(rules) = file.and_then(|file| file.again()) {
                credentials.regrant(rules);
            }
            credentials
        });
        let Some(read) = cancel.run_until_cancelled(read).await else { return Ok(()) };
        // Without it a token that is taken back would stay: the daemon ends, and the service manager starts all anew.
        credentials = read.context("certificates and tokens are not read any more, by a fault of this program")?;
        if asked {
            systemd::reloaded();
        }
    }
}

/// Waits for SIGHUP, where that reloads.
async fn hung_up(hangup: Option<&mut Signal>) {
    let Some(signal) = hangup else { return pending().await };
    if signal.recv().await.is_none() {
        pending().await // there are no more
    }
}

/// The configuration that the daemon was started with.
#[derive(Clone, Debug)]
pub struct Reload {
    path: PathBuf,
    started: BTreeMap<String, Value>,
    /// Whether the configuration has rules of who may do what.
    ruled: bool,
}

impl Reload {
    /// Remembers what the daemon starts with: the text that its configuration was read from.
    pub fn new(path: &Path, text: &str, ruled: bool) -> Self {
        let started = keys(text).unwrap_or_default(); // what was read as a configuration is TOML
        Self { path: path.to_path_buf(), started, ruled }
    }

    /// Reads the file again and applies what can be. Gives the rules of who may do what, which are to be in force now;
    /// nothing if they need a restart or the file cannot be used.
    fn again(&self) -> Option<Rules> {
        let text = read_utf8(&self.path).map_err(|error| format!("{}: {error}", self.path.display()));
        let (rules, waiting) = match text.and_then(|text| self.apply(&text)) {
            Ok(applied) => applied,
            Err(error) => {
                tracing::error!("nothing is reloaded: {error}");
                return None;
            }
        };
        if !waiting.is_empty() {
            tracing::warn!("not reloaded, as it needs a restart: {}", waiting.join(", "));
        }
        rules
    }

    /// Applies what can be of a text with which the daemon could be started. Gives the rules, and the keys that wait.
    fn apply(&self, text: &str) -> Result<(Option<Rules>, Vec<String>), String> {
        let in_a_line = |problems: Problems| {
            let each: Vec<String> = problems.all().iter().map(ToString::to_string).collect();
            each.join("; ")
        };
        let (config, Scene { doors, .. }) = config::examine_text(&self.path, text).map_err(in_a_line)?;
        let filter = logs::filter(config.log.filter.as_deref())?;
        tracing::info!("reloaded; the log's filter is {filter}");
        let regrants = doors.ruled == self.ruled;
        let mut waiting = self.waiting(&keys(text)?, regrants);
        if !regrants && !waiting.iter().any(|name| name.starts_with(ACCESS)) {
            waiting.push("access".to_owned()); // a section without keys has come or gone
        }
        Ok((regrants.then_some(doors.rules), waiting))
    }

    /// The keys that have another value than at the start, or are here or there alone, and need a restart.
    fn waiting(&self, found: &BTreeMap<String, Value>, regrants: bool) -> Vec<String> {
        let names: BTreeSet<&String> = self.started.keys().chain(found.keys()).collect();
        let applied = |name: &str| name == LOG_FILTER || (regrants && name.starts_with(ACCESS) && name != TOKENS);
        let changed = names.into_iter().filter(|name| self.started.get(*name) != found.get(*name));
        changed.filter(|name| !applied(name)).cloned().collect()
    }
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

    fn granting(user: &str) -> String {
        format!("{SCENE}[access]\noperators = [\"user:{user}\"]\n")
    }

    fn grants(user: &str) -> Vec<Grant> {
        vec![Grant { subject: Subject::User(user.to_owned()), role: Role::Operator }]
    }

    #[test]
    fn grants_are_applied_and_other_keys_wait_for_a_restart() {
        let reload = Reload::new(Path::new("taxeld.toml"), &granting("ann"), true);
        let (rules, waiting) = reload.apply(&granting("bob")).unwrap();
        assert_eq!((rules.unwrap().grants, waiting), (grants("bob"), vec![]));
        let other = format!("socket_group = \"skin\"\n{}", granting("ann"));
        let (rules, waiting) = reload.apply(&other).unwrap();
        assert_eq!((rules.unwrap().grants, waiting), (grants("ann"), vec!["socket_group".to_owned()]));
    }

    #[test]
    fn whether_there_are_rules_at_all_waits_for_a_restart() {
        let path = Path::new("taxeld.toml");
        let (rules, waiting) = Reload::new(path, &granting("ann"), true).apply(SCENE).unwrap();
        assert_eq!((rules, waiting.len()), (None, 1), "without [access] there are no rules");
        let bare = format!("{SCENE}[access]\n");
        let (rules, waiting) = Reload::new(path, SCENE, false).apply(&bare).unwrap();
        assert_eq!((rules, waiting), (None, vec!["access".to_owned()]));
        assert_eq!(Reload::new(path, SCENE, false).apply(SCENE), Ok((Some(Rules::open()), vec![])));
    }

    #[test]
    fn a_file_that_the_daemon_could_not_be_started_with_changes_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let reload = Reload::new(&folder.path().join("taxeld.toml"), &granting("ann"), true);
        assert_eq!(reload.again(), None, "it is not there");
        let refused = |text: &str| reload.apply(text).unwrap_err();
        assert!(refused(&granting("ann").replace("user:", "usr:")).contains("expected user:NAME"));
        assert!(refused(&granting("ann").replace("t.db", "/")).contains("store.path"));
    }
}
