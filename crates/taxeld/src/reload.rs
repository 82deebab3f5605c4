//! What changes while the daemon runs: on SIGHUP the configuration is read again, and with it certificates and tokens. Who may
//! do what and the log's filter change; all else waits for a restart, and the log names it.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context;
use taxel_rpc::Rules;
use tokio::signal::unix::Signal;
use tokio_util::sync::CancellationToken;
use toml::{Table, Value};

use crate::config::{self, Scene};
use crate::credentials::Credentials;
use crate::files::read_utf8;
use crate::logs;
use crate::systemd;

/// Reads files again until the daemon ends. Each time a thread for what blocks does it, so that a disk that hangs holds up
/// nobody else.
pub async fn keep(
    credentials: Credentials,
    reload: Option<(Signal, Reload)>,
    cancel: CancellationToken,
) -> anyhow::Result<()> {
    let Some((mut hangup, reload)) = reload else {
        cancel.cancelled().await;
        return Ok(());
    };
    let files = Arc::new((credentials, reload));
    while let Some(Some(())) = cancel.run_until_cancelled(hangup.recv()).await {
        systemd::reloading();
        let files = Arc::clone(&files);
        let read = tokio::task::spawn_blocking(move || {
            let (credentials, reload) = &*files;
            credentials.read_again(); // before the configuration, of which a disk that hangs may be in the way
            reload.again().into_iter().for_each(|rules| credentials.regrant(rules));
        });
        let Some(read) = cancel.run_until_cancelled(read).await else { return Ok(()) };
        // Without it a token that is taken back would stay: the daemon ends, and the service manager starts all anew.
        read.context("certificates and tokens are not read any more, by a fault of this program")?;
        systemd::reloaded();
    }
    Ok(())
}

/// The configuration that the daemon was started with.
#[derive(Clone, Debug)]
pub struct Reload {
    path: PathBuf,
    started: Table,
    /// Whether the configuration has rules of who may do what.
    ruled: bool,
}

impl Reload {
    /// Remembers what the daemon starts with: the text that its configuration was read from.
    pub fn new(path: &Path, text: &str, ruled: bool) -> Self {
        let started = toml::from_str(text).unwrap_or_default(); // what was read as a configuration is TOML
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

    /// Applies what can be of a text with which the daemon could be started. Gives the rules, and the sections that wait.
    fn apply(&self, text: &str) -> Result<(Option<Rules>, Vec<String>), String> {
        let examined = config::examine_text(&self.path, text);
        let (config, Scene { doors, .. }) = examined.map_err(|problems| problems.to_string().replace('\n', "; "))?;
        let filter = logs::filter(config.log.filter.as_deref())?;
        tracing::info!("reloaded; the log's filter is {filter}");
        let found: Table = toml::from_str(text).map_err(|error| error.to_string())?;
        let regrants = doors.ruled == self.ruled;
        Ok((regrants.then_some(doors.rules), self.waiting(&found, regrants)))
    }

    /// The sections that have another value than at the start, or are here or there alone, and need a restart: not the log's
    /// filter, and not who may do what, but where the tokens are.
    fn waiting(&self, found: &Table, regrants: bool) -> Vec<String> {
        let tokens = |table: &Table| table.get("access").and_then(|access| access.get("tokens")).map(Value::to_string);
        let is_applied = |name: &str| match name {
            "log" => true,
            "access" => regrants && tokens(&self.started) == tokens(found),
            _ => false,
        };
        let names: BTreeSet<&String> = self.started.keys().chain(found.keys()).collect();
        let changed = names.into_iter().filter(|name| self.started.get(*name) != found.get(*name));
        changed.filter(|name| !is_applied(name)).cloned().collect()
    }
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
        assert!(refused(&granting("ann").replace("\"p\"", "\"a b\"")).contains("a name is 1 to 64"));
    }
}
