//! The thread that reads files again: the configuration when SIGHUP asks for it, certificates and tokens then and when one
//! changed. A file that is on a slow disk, or is none, holds up nobody but this thread.

use std::io;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

use crate::doors::Reloader;
use crate::reload::Reload;
use crate::systemd;

/// Files of certificates and tokens are looked at so often.
const LOOK_EVERY: Duration = Duration::from_secs(5);

/// The way to that thread, which ends when this is dropped, or with the process.
pub struct Reloading(SyncSender<()>);

impl Reloading {
    /// Starts it; without a `reload` the configuration is not read again.
    ///
    /// # Errors
    /// If there is no thread to be had.
    pub fn begin(reloader: Reloader, reload: Option<Reload>) -> io::Result<Self> {
        let (asks, asked) = sync_channel(1);
        thread::Builder::new().name("reload".to_owned()).spawn(move || keep(&asked, &reloader, reload))?;
        Ok(Self(asks))
    }

    /// Has all files read again, and tells the service manager now that it begins and later that it is over. Never waits.
    pub fn ask(&self) {
        systemd::reloading();
        // Where one waits already, it reads what is there then.
        let _ = self.0.try_send(());
    }
}

fn keep(asked: &Receiver<()>, reloader: &Reloader, mut reload: Option<Reload>) {
    let mut seen = reloader.stamps();
    loop {
        let is_asked = match asked.recv_timeout(LOOK_EVERY) {
            Ok(()) => true,
            Err(RecvTimeoutError::Timeout) => false,
            Err(RecvTimeoutError::Disconnected) => return,
        };
        let rules = reload.as_mut().filter(|_| is_asked).and_then(Reload::again);
        rules.into_iter().for_each(|rules| reloader.regrant(rules));
        let now = reloader.stamps(); // before they are read: what changes meanwhile is read once more
        if is_asked || now != seen {
            seen = now;
            reloader.reload_and_tell();
        }
        if is_asked {
            systemd::reloaded();
        }
    }
}
