//! Certificates and tokens, read again when one of their files changes or somebody asks for it.

use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use taxel_rpc::{Access, Rules, Tls, Tokens};

use crate::config::Doors;

/// What changes when a file is written or replaced: device, inode, length, time of the last change of anything about it.
type Stamp = Option<(u64, u64, u64, i64, i64)>;

/// What the service takes from files to know who calls.
#[derive(Debug)]
pub struct Credentials {
    access: Access,
    tokens: Option<PathBuf>,
    tls: Vec<Tls>,
    files: Vec<PathBuf>,
    /// The files as they were when they were last read.
    seen: Vec<Stamp>,
    /// What kept some of them from being read then. They are tried again at each look: a token may be gone from a file that
    /// only could not be opened.
    problems: Vec<String>,
}

impl Credentials {
    /// Reads the tokens; certificates are added as their listeners are opened.
    ///
    /// # Errors
    /// The file of tokens and what is wrong with it.
    pub fn read(doors: &Doors) -> anyhow::Result<Self> {
        let files: Vec<PathBuf> = doors.credentials().collect();
        let seen = files.iter().map(|file| stamp(file)).collect(); // before they are read: what changes meanwhile is read again
        let rules = Rules { tokens: tokens(doors.tokens.as_deref())?, ..doors.rules.clone() };
        let (access, tokens) = (Access::new(rules), doors.tokens.clone());
        Ok(Self { access, tokens, tls: Vec::new(), files, seen, problems: Vec::new() })
    }

    /// Looks after the certificates of one more listener.
    pub fn add(&mut self, tls: Tls) {
        self.tls.push(tls);
    }

    /// Who may do what, by these and the configuration.
    pub fn access(&self) -> Access {
        self.access.clone()
    }

    /// Other grants from the configuration; what comes of a file stays.
    pub fn regrant(&self, rules: Rules) {
        self.access.update(|now| Rules { tokens: now.tokens.clone(), ..rules });
    }

    /// Reads them again if one has changed since, if one could not be read, or if somebody asks for it, and tells how that went,
    /// of what stays wrong once.
    pub fn look(&mut self, asked: bool) {
        let now: Vec<Stamp> = self.files.iter().map(|file| stamp(file)).collect();
        let changed = now != self.seen;
        if !asked && !changed && self.problems.is_empty() {
            return;
        }
        let problems = self.read_again();
        if asked || changed || problems != self.problems {
            problems.iter().for_each(|problem| tracing::error!("{problem}"));
            if problems.is_empty() {
                tracing::info!("certificates and tokens were read again");
            }
        }
        (self.seen, self.problems) = (now, problems);
    }

    /// Reads all files again. What is wrong stays as it was; a line for each, and none if all is well.
    fn read_again(&self) -> Vec<String> {
        let mut problems = Vec::new();
        match tokens(self.tokens.as_deref()) {
            Ok(tokens) => self.access.update(|now| Rules { tokens, ..now.clone() }),
            Err(error) => problems.push(format!("{error}; the tokens stay as they were")),
        }
        let reloaded = self.tls.iter().filter_map(|tls| tls.reload().err());
        problems.extend(reloaded.map(|error| format!("{error}; the certificates stay as they were")));
        problems
    }
}

fn stamp(file: &Path) -> Stamp {
    let about = std::fs::metadata(file).ok()?;
    Some((about.dev(), about.ino(), about.len(), about.ctime(), about.ctime_nsec()))
}

/// What is wrong with a token file, for a daemon that may have another account.
pub fn obstacle_of_tokens(path: &Path) -> Option<String> {
    Tokens::check(path).err().map(of_tokens)
}

/// The tokens of a file; none without one.
fn tokens(path: Option<&Path>) -> anyhow::Result<Tokens> {
    let Some(path) = path else { return Ok(Tokens::default()) };
    Tokens::load(path).map_err(|problem| anyhow::Error::msg(of_tokens(problem)))
}

fn of_tokens(problem: String) -> String {
    format!("access.tokens: {problem}")
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    const ROW: &str = "operator bench ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";

    #[test]
    fn tokens_are_read_again_once_their_file_changes_and_bad_ones_change_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tokens");
        let write = |text: &str| {
            std::fs::write(&path, text).unwrap();
            std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600)).unwrap();
        };
        write(ROW);
        let doors = Doors { doors: vec![], rules: Rules::default(), tokens: Some(path.clone()), ruled: true };
        let mut credentials = Credentials::read(&doors).unwrap();
        let mut look = |asked| {
            credentials.look(asked);
            credentials.problems.join("")
        };
        write("operator bench nonsense");
        let said = look(false);
        assert!(said.contains("line 1") && said.contains("stay as they were"), "{said}");
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o644)).unwrap();
        assert!(look(false).contains("its mode is 644"), "what could not be read is tried again");
        write(ROW);
        assert_eq!((look(false), look(true)), (String::new(), String::new()));
    }
}
