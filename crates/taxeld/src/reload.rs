//! What changes while the daemon runs: on SIGHUP the configuration is read again, and with it certificates and tokens. Who may
//! do what changes; all else waits for a restart, which the log says.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context;
use taxel_rpc::Rules;
use tokio::signal::unix::Signal;
use tokio_util::sync::CancellationToken;

use crate::config::{self, Problems};
use crate::credentials::Credentials;
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
    /// Whether the configuration has rules of who may do what.
    ruled: bool,
}

impl Reload {
    /// Remembers what the daemon starts with.
    pub fn new(path: &Path, ruled: bool) -> Self {
        Self { path: path.to_path_buf(), ruled }
    }

    /// Reads the file again. Gives the rules of who may do what, which are to be in force now; nothing if they need a restart or
    /// the daemon could not be started with the file. Without rules everybody may do everything, so that a daemon goes from one
    /// to the other by a restart alone.
    fn again(&self) -> Option<Rules> {
        let examined = config::examine(&self.path);
        let told = |why: Problems| tracing::error!("nothing is reloaded: {}", why.to_string().replace('\n', "; "));
        let (_, scene) = examined.map_err(told).ok()?;
        if scene.doors.ruled != self.ruled {
            tracing::warn!("not reloaded: whether there is an [access] section needs a restart");
            return None;
        }
        tracing::info!("reloaded: the lists of [access], certificates and tokens; other keys need a restart");
        Some(scene.doors.rules)
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

    /// What a daemon whose configuration had rules, or had none, takes of this text.
    fn reloaded(ruled: bool, text: &str) -> Option<Rules> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("taxeld.toml");
        std::fs::write(&path, text).unwrap();
        Reload::new(&path, ruled).again()
    }

    #[test]
    fn grants_are_applied_and_whether_there_are_rules_at_all_waits_for_a_restart() {
        assert_eq!(reloaded(true, &granting("bob")).unwrap().grants, grants("bob"));
        assert_eq!(reloaded(true, SCENE), None, "without [access] there are no rules");
        assert_eq!(reloaded(false, &format!("{SCENE}[access]\n")), None);
        assert_eq!(reloaded(false, SCENE), Some(Rules::open()));
    }

    #[test]
    fn a_file_that_the_daemon_could_not_be_started_with_changes_nothing() {
        assert_eq!(Reload::new(Path::new("/nowhere/taxeld.toml"), true).again(), None, "it is not there");
        assert_eq!(reloaded(true, &granting("ann").replace("user:", "usr:")), None);
        assert_eq!(reloaded(true, &granting("ann").replace("\"p\"", "\"a b\"")), None);
    }
}
