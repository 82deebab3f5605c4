//! Who may do what, by files that are read again on SIGHUP: the lists of `[access]`, certificates and tokens. All else of the
//! configuration waits for a restart, which the log says.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context;
use taxel_rpc::{Access, Rules, Tls, Tokens};
use tokio::signal::unix::Signal;
use tokio_util::sync::CancellationToken;

use crate::config::{self, Doors};
use crate::systemd;

/// What the service takes from files to know who calls.
#[derive(Clone, Debug)]
pub struct Credentials {
    /// Who may do what, by these and the configuration.
    pub access: Access,
    tokens: Option<PathBuf>,
    /// Of each listener that has any.
    pub tls: Vec<Tls>,
    /// Whether the configuration has rules of who may do what.
    ruled: bool,
}

impl Credentials {
    /// Reads the tokens; certificates are added as their listeners are opened.
    ///
    /// # Errors
    /// The file of tokens and what is wrong with it.
    pub fn read(doors: &Doors) -> anyhow::Result<Self> {
        let rules = doors.rules.clone().unwrap_or_else(Rules::open);
        let rules = Rules { tokens: tokens(doors.tokens.as_deref())?, ..rules };
        let (access, tokens) = (Access::new(rules), doors.tokens.clone());
        Ok(Self { access, tokens, tls: Vec::new(), ruled: doors.rules.is_some() })
    }

    /// Reads all files again. What is wrong stays as it was, and is told. The configuration comes last, since a disk that hangs may
    /// be in its way. Without rules everybody may do everything, so that a daemon goes from one to the other by a restart alone.
    fn read_again(&self, config: &Path) {
        match tokens(self.tokens.as_deref()) {
            Ok(tokens) => self.access.update(|now| Rules { tokens, ..now.clone() }),
            Err(error) => tracing::error!("{error}; the tokens stay as they were"),
        }
        for error in self.tls.iter().filter_map(|tls| tls.reload().err()) {
            tracing::error!("{error}; the certificates stay as they were");
        }
        match config::examine(config).map(|(_, scene)| scene.doors.rules) {
            Err(why) => tracing::error!("nothing is reloaded: {}", why.to_string().replace('\n', "; ")),
            Ok(rules) if rules.is_some() != self.ruled => {
                tracing::warn!("not reloaded: whether there is an [access] section needs a restart");
            }
            Ok(rules) => {
                let rules = rules.unwrap_or_else(Rules::open);
                self.access.update(|now| Rules { tokens: now.tokens.clone(), ..rules });
                tracing::info!("reloaded: the lists of [access], certificates and tokens; other keys need a restart");
            }
        }
    }
}

/// The tokens of a file; none without one.
fn tokens(path: Option<&Path>) -> anyhow::Result<Tokens> {
    let Some(path) = path else { return Ok(Tokens::default()) };
    Tokens::load(path).map_err(|problem| anyhow::anyhow!("access.tokens: {problem}"))
}

/// Reads files again until the daemon ends: on this signal, with this configuration. Each time a thread for what blocks does it, so
/// that a disk that hangs holds up nobody else.
pub async fn keep(
    credentials: Credentials,
    mut hangup: Signal,
    config: PathBuf,
    cancel: CancellationToken,
) -> anyhow::Result<()> {
    let files = Arc::new((credentials, config));
    while let Some(Some(())) = cancel.run_until_cancelled(hangup.recv()).await {
        systemd::reloading();
        let files = Arc::clone(&files);
        let read = tokio::task::spawn_blocking(move || files.0.read_again(&files.1));
        let Some(read) = cancel.run_until_cancelled(read).await else { return Ok(()) };
        // Without it a token that is taken back would stay: the daemon ends, and the service manager starts all anew.
        read.context("certificates and tokens are not read any more, by a fault of this program")?;
        systemd::reloaded();
    }
    Ok(())
}
