//! Whether each Unix socket still has its name. Somebody may remove it, and then nobody can connect any more: a socket cannot be
//! given its name again, so that it is told until the daemon is started anew.

use std::fs;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use tokio_util::sync::CancellationToken;

use crate::looking::{Problems, look_after};

/// How often it is looked.
const LOOK_EVERY: Duration = Duration::from_secs(5);

/// A socket that the daemon listens on.
#[derive(Debug)]
struct Socket {
    path: PathBuf,
    /// Device and inode of the file that is its name.
    named: (u64, u64),
    /// What is wrong with it, as it was told last.
    problem: Option<String>,
}

/// All sockets that the daemon listens on.
#[derive(Debug, Default)]
pub struct Sockets {
    sockets: Vec<Socket>,
    problems: Problems,
}

impl Sockets {
    /// Looks after one more, which was just bound.
    ///
    /// # Errors
    /// The system's answer.
    pub fn add(&mut self, path: &Path) -> io::Result<()> {
        let (path, named) = (path.to_path_buf(), identity(path)?);
        self.sockets.push(Socket { path, named, problem: None });
        Ok(())
    }

    /// Where it says what is wrong at present.
    pub fn problems(&self) -> Problems {
        self.problems.clone()
    }

    /// Starts to look until the daemon ends, if there are any. Gives the end.
    ///
    /// # Errors
    /// If there is no thread to be had.
    pub fn keep(mut self, cancel: CancellationToken) -> anyhow::Result<Option<impl Future<Output = ()> + use<>>> {
        if self.sockets.is_empty() {
            return Ok(None);
        }
        look_after("sockets", move || self.look(), LOOK_EVERY, cancel).map(Some)
    }

    /// Looks at each, tells the log what is new, and the health all that is wrong.
    fn look(&mut self) {
        self.sockets.iter_mut().for_each(Socket::look);
        self.problems.set(self.sockets.iter().filter_map(|socket| socket.problem.clone()).collect());
    }
}

impl Socket {
    fn look(&mut self) {
        let wrong = match identity(&self.path) {
            Ok(there) if there == self.named => None,
            Ok(_) => Some("something else has its name".to_owned()),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Some("it was removed".to_owned()),
            Err(error) => Some(error.to_string()),
        };
        let problem = wrong.map(|why| {
            format!("nobody can connect to the socket {} any more: {why}; a restart makes it anew", self.path.display())
        });
        if self.problem == problem {
            return;
        }
        match &problem {
            Some(words) => tracing::error!("{words}"),
            None => tracing::info!(socket = %self.path.display(), "it can be connected to again"),
        }
        self.problem = problem;
    }
}

/// Device and inode of what has this name.
fn identity(path: &Path) -> io::Result<(u64, u64)> {
    let there = fs::symlink_metadata(path)?;
    Ok((there.dev(), there.ino()))
}

#[cfg(test)]
mod tests {
    use std::os::unix::net::UnixListener;

    use super::*;

    #[test]
    fn a_socket_whose_name_is_gone_or_another_s_is_told_until_it_is_back() {
        let folder = tempfile::tempdir().unwrap();
        let (path, aside) = (folder.path().join("s"), folder.path().join("aside"));
        let _listener = UnixListener::bind(&path).unwrap();
        let mut sockets = Sockets::default();
        sockets.add(&path).unwrap();
        let mut look = || {
            sockets.look();
            sockets.problems().get()
        };
        assert_eq!(look(), Vec::<String>::new());
        fs::rename(&path, &aside).unwrap();
        let said = |why: &str| {
            vec![format!(
                "nobody can connect to the socket {} any more: {why}; a restart makes it anew",
                path.display()
            )]
        };
        assert_eq!(look(), said("it was removed"));
        let _other = UnixListener::bind(&path).unwrap();
        assert_eq!(look(), said("something else has its name"));
        fs::rename(&aside, &path).unwrap();
        assert_eq!(look(), Vec::<String>::new());
    }
}
