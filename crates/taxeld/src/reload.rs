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
