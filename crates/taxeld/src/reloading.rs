//! The threads that read files again: one the configuration when SIGHUP asks for it, one certificates and tokens, then and when
//! one of them changed. A file on a disk that hangs holds up nobody but its thread: a token that is taken back is taken back
//! also while the configuration cannot be read, and the log tells of what cannot.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::doors::{Reloader, Stamp};
use crate::reload::Reload;
use crate::systemd;
use crate::threads::start;

/// Files of certificates and tokens are looked at so often.
const LOOK_EVERY: Duration = Duration::from_secs(5);
/// A reload takes milliseconds.
const LATE_AFTER: Duration = Duration::from_secs(5);

/// The way to these threads, which end when this is dropped, or with the process.
pub struct Reloading {
    asks: SyncSender<()>,
    under_way: UnderWay,
}

impl Reloading {
    /// Starts them; without a `reload` the configuration is not read again.
    ///
    /// # Errors
    /// If there is no thread to be had.
    pub fn begin(reloader: Reloader, reload: Option<Reload>) -> anyhow::Result<Self> {
        let (asks, asked) = sync_channel(1);
        let (looks, look) = sync_channel(1);
        let under_way = UnderWay::default();
        let (of_configuration, of_credentials) = (under_way.clone(), under_way.clone());
        let grants = reloader.clone();
        start("reload", move || keep_configuration(&asked, reload, &grants, &looks, &of_configuration))?;
        let credentials = Credentials::opened(reloader);
        start("credentials", move || keep_credentials(&look, credentials, &of_credentials))?;
        Ok(Self { asks, under_way })
    }

    /// Has all files read again, and tells the service manager now that it begins and later that it is over. Never waits.
    pub fn ask(&self) {
        systemd::reloading();
        self.under_way.tell_if_late();
        // Where one waits already, it reads what is there then.
        let _ = self.asks.try_send(());
    }
}

fn keep_configuration(
    asked: &Receiver<()>,
    mut reload: Option<Reload>,
    reloader: &Reloader,
    looks: &SyncSender<SyncSender<()>>,
    under_way: &UnderWay,
) {
    while asked.recv().is_ok() {
        under_way.begin();
        guarded("the configuration", || {
            if let Some(rules) = reload.as_mut().and_then(Reload::again) {
                reloader.regrant(rules);
            }
        });
        let (over, is_over) = sync_channel(1);
        if looks.send(over).is_ok() {
            let _ = is_over.recv(); // nothing is sent: it is dropped
        }
        under_way.end();
        systemd::reloaded();
    }
}

/// Whoever asks is told that all has been read by the end of what it sent.
fn keep_credentials(look: &Receiver<SyncSender<()>>, mut credentials: Credentials, under_way: &UnderWay) {
    loop {
        let asked = match look.recv_timeout(LOOK_EVERY) {
            Ok(over) => Some(over),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => return,
        };
        guarded("certificates and tokens", || credentials.look(asked.is_some()));
        drop(asked);
        under_way.tell_if_late();
    }
}

/// Reads files with `read`, of which a fault of our own must not be the last time that they are read: a token that is taken back
/// has to be taken back. What was read before holds until then.
fn guarded(what: &str, read: impl FnOnce()) {
    if catch_unwind(AssertUnwindSafe(read)).is_err() {
        tracing::error!("{what} could not be read again: a fault of this program");
    }
}

/// Certificates and tokens as they were last read.
struct Credentials {
    reloader: Reloader,
    seen: Vec<Stamp>,
    /// What kept some of them from being read then. They are tried again at each look: a token may be gone from a file that
    /// only could not be opened.
    problems: Vec<String>,
}

impl Credentials {
    /// As they are since the doors were opened.
    fn opened(reloader: Reloader) -> Self {
        let seen = reloader.opened().to_vec();
        Self { reloader, seen, problems: Vec::new() }
    }

    /// Reads them again if one has changed since, if one could not be read, or if somebody asks for it, and tells how that went,
    /// of what stays wrong once.
    fn look(&mut self, asked: bool) {
        let now = self.reloader.stamps(); // before they are read: what changes meanwhile is read once more
        let changed = now != self.seen;
        if !asked && !changed && self.problems.is_empty() {
            return;
        }
        let problems = self.reloader.reload();
        if asked || changed || problems != self.problems {
            problems.iter().for_each(|problem| tracing::error!("{problem}"));
            if problems.is_empty() {
                tracing::info!("certificates and tokens were read again");
            }
        }
        (self.seen, self.problems) = (now, problems);
    }
}

/// Since when a reload is under way, and whether the log has been told that it takes too long.
#[derive(Clone, Default)]
struct UnderWay(Arc<Mutex<Option<(Instant, bool)>>>);

impl UnderWay {
    fn state(&self) -> MutexGuard<'_, Option<(Instant, bool)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn begin(&self) {
        *self.state() = Some((Instant::now(), false));
    }

    fn end(&self) {
        if let Some((begun, true)) = self.state().take() {
            tracing::info!("the reload is over after {:.0} s", begun.elapsed().as_secs_f64());
        }
    }

    /// Tells once of each reload.
    fn tell_if_late(&self) {
        let mut state = self.state();
        let Some((begun, told)) = state.as_mut().filter(|(begun, told)| !told && begun.elapsed() > LATE_AFTER) else {
            return;
        };
        *told = true;
        tracing::error!(
            "a reload that began {:.0} s ago has not ended: the configuration, or a file that it names, cannot be read to its end; \
             until then all stays as it was but tokens and certificates",
            begun.elapsed().as_secs_f64()
        );
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use taxel_rpc::Rules;

    use super::*;
    use crate::config::Doors;
    use crate::doors;

    const ROW: &str = "operator bench ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";

    #[allow(clippy::unwrap_used)] // clippy exempts only functions that are tests themselves
    fn write(path: &Path, text: &str) {
        use std::os::unix::fs::PermissionsExt;
        std::fs::write(path, text).unwrap();
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o600)).unwrap();
    }

    #[test]
    fn what_changes_after_the_doors_were_opened_is_read_and_what_could_not_be_read_is_tried_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tokens");
        write(&path, ROW);
        let tokens = Some(path.clone());
        let open = doors::open(&Doors { doors: vec![], rules: Rules::default(), tokens, ruled: true }).unwrap();
        let mut credentials = Credentials::opened(open.reloader);
        write(&path, "operator bench nonsense");
        credentials.look(false);
        assert!(credentials.problems[0].contains("line 1"), "it has changed since: {:?}", credentials.problems);
        // What could not be read, of a file that has not changed since.
        write(&path, ROW);
        credentials.seen = credentials.reloader.stamps();
        credentials.look(false);
        assert_eq!(credentials.problems, Vec::<String>::new());
        write(&path, "operator bench nonsense");
        credentials.seen = credentials.reloader.stamps();
        credentials.look(false);
        assert_eq!(credentials.problems, Vec::<String>::new(), "there was no reason to read it");
        credentials.look(true);
        assert!(credentials.problems[0].contains("line 1"), "somebody asked: {:?}", credentials.problems);
    }
}
