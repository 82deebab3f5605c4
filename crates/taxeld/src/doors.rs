//! Opens the doors of the service: binds what the configuration names, reads certificates and tokens, and reads them
//! again when the files change or somebody asks for it.

use std::fs::Metadata;
use std::io::ErrorKind;
use std::net::TcpListener;
use std::os::unix::fs::{FileTypeExt, MetadataExt, PermissionsExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use taxel_rpc::{Access, Listener, Rules, Tokens};
#[cfg(feature = "tls")]
use taxel_rpc::{Tls, TlsFiles};

use crate::config::{Door, Doors, UNRULED};
use crate::sockets::Sockets;

/// The open doors, and who may come in.
pub struct Open {
    /// What the service accepts connections from.
    pub listeners: Vec<Listener>,
    /// Looks after the names of those that are Unix sockets.
    pub sockets: Sockets,
    /// Who may do what.
    pub access: Access,
    /// Reads certificates and tokens again.
    pub reloader: Reloader,
}

/// Binds every door and reads what they need.
///
/// # Errors
/// The door or the file, and what is wrong with it.
pub fn open(doors: &Doors) -> anyhow::Result<Open> {
    let files: Vec<PathBuf> = doors.credentials().collect();
    let stamps = stamps(&files); // before they are read: what changes meanwhile is read once more
    let access = Access::new(Rules { tokens: tokens(doors.tokens.as_deref())?, ..doors.rules.clone() });
    #[cfg_attr(not(feature = "tls"), allow(unused_mut))] // it has no certificates then
    let mut reloader = Reloader {
        access: access.clone(),
        tokens: doors.tokens.clone(),
        #[cfg(feature = "tls")]
        tls: Vec::new(),
        files,
        opened: stamps,
    };
    if !doors.ruled {
        tracing::warn!("{UNRULED}");
    }
    doors.unreached_grants().iter().for_each(|line| tracing::warn!("{line}"));
    let (mut listeners, mut sockets) = (Vec::new(), Sockets::default());
    for door in &doors.doors {
        listeners.push(match door {
            Door::Unix { path, mode, group } => {
                let listener = bind_unix(path, *mode, group.as_deref())?;
                sockets.add(path).with_context(|| format!("{}", path.display()))?;
                Listener::Unix(listener)
            }
            Door::Tcp(address) => {
                if !address.ip().is_loopback() {
                    tracing::warn!(
                        "INSECURE: {address} is served without encryption and without knowing who calls, as \
                         \"insecure:\" in listen, or the demo's --listen, wants it: everybody on that net can read along and connect"
                    );
                }
                Listener::Tcp(TcpListener::bind(address).with_context(|| format!("listening on {address}"))?)
            }
            #[cfg(feature = "tls")]
            Door::Tls { address, files } => {
                let tls = Tls::load(tls_files(files))?;
                reloader.tls.push(tls.clone());
                let listener = TcpListener::bind(address).with_context(|| format!("listening on {address}"))?;
                Listener::Tls(listener, tls)
            }
            #[cfg(not(feature = "tls"))]
            Door::Tls { address, .. } => bail!("{address}: this build has no TLS (cargo feature `tls`)"),
        });
    }
    if let Some(path) = &doors.tokens {
        tracing::info!(tokens = %path.display(), "tokens are read");
    }
    Ok(Open { listeners, sockets, access, reloader })
}

/// What would keep a door shut, as far as can be told without opening it, and for a daemon that may have another account.
pub fn obstacle(door: &Door) -> Option<String> {
    match door {
        Door::Tcp(_) => None,
        Door::Unix { path, .. } => match std::fs::symlink_metadata(path) {
            Ok(about) => in_the_way(path, &about),
            Err(error) if error.kind() == ErrorKind::NotADirectory => Some(format!("{}: {error}", path.display())),
            Err(_) => None, // there is none yet, or this account may not look
        },
        #[cfg(feature = "tls")]
        Door::Tls { files, .. } => Tls::check(&tls_files(files)).err().map(|error| error.to_string()),
        #[cfg(not(feature = "tls"))]
        Door::Tls { .. } => None, // the configuration is refused
    }
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

#[cfg(feature = "tls")]
fn tls_files([certificate, key, client_ca]: &[PathBuf; 3]) -> TlsFiles {
    TlsFiles { certificate: certificate.clone(), key: key.clone(), client_ca: client_ca.clone() }
}

/// Why no socket can be made where this is.
fn in_the_way(path: &Path, about: &Metadata) -> Option<String> {
    let is_socket = about.file_type().is_socket();
    (!is_socket).then(|| format!("{}: is there already and is not a socket", path.display()))
}

/// Binds a Unix socket.
fn bind_unix(path: &Path, mode: u32, group: Option<&str>) -> anyhow::Result<UnixListener> {
    remove_old(path)?;
    let shown = path.display();
    let listener = UnixListener::bind(path).with_context(|| format!("listening on {shown}"))?;
    if let Some(group) = group {
        give_to(path, group)?;
    }
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).with_context(|| format!("{shown}"))?;
    Ok(listener)
}

/// Removes what is left of a daemon that was killed, but only a socket that nobody answers on.
fn remove_old(path: &Path) -> anyhow::Result<()> {
    let shown = path.display();
    let about = match std::fs::symlink_metadata(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        about => about.with_context(|| format!("{shown}"))?,
    };
    if let Some(problem) = in_the_way(path, &about) {
        bail!(problem);
    }
    match UnixStream::connect(path) {
        Ok(_) => bail!("{shown}: another process serves this socket"),
        Err(error) if error.kind() == ErrorKind::ConnectionRefused => {
            std::fs::remove_file(path).with_context(|| format!("removing the old socket {shown}"))
        }
        Err(error) => Err(error).with_context(|| format!("{shown}: is there already")),
    }
}

/// Gives a socket to a group. It is born with the daemon's own, and where it is that there is nothing to do: the unit of
/// `deploy/` forbids the very call.
fn give_to(path: &Path, group: &str) -> anyhow::Result<()> {
    let shown = path.display();
    let id = taxel_rpc::group_id(group).with_context(|| format!("{shown}: there is no group `{group}`"))?;
    if std::fs::metadata(path).with_context(|| format!("{shown}"))?.gid() == id {
        return Ok(());
    }
    std::os::unix::fs::chown(path, None, Some(id)).with_context(|| {
        format!("giving {shown} to group `{group}`: it has to be the daemon's own, or one of its own that it may give files to")
    })
}

/// Reads certificates and tokens again. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Reloader {
    access: Access,
    tokens: Option<PathBuf>,
    #[cfg(feature = "tls")]
    tls: Vec<Tls>,
    files: Vec<PathBuf>,
    opened: Vec<Stamp>,
}

impl Reloader {
    /// Other grants from the configuration; what comes of a file stays.
    pub fn regrant(&self, rules: Rules) {
        self.access.replace_grants(rules);
    }

    /// Reads all files again. What is wrong stays as it was; a line for each, and none if all is well.
    pub fn reload(&self) -> Vec<String> {
        let mut problems = Vec::new();
        match tokens(self.tokens.as_deref()) {
            Ok(tokens) => self.access.replace_tokens(tokens),
            Err(error) => problems.push(format!("{error:#}; the tokens stay as they were")),
        }
        #[cfg(feature = "tls")]
        for tls in &self.tls {
            if let Err(error) = tls.reload() {
                problems.push(format!("{error}; the certificates stay as they were"));
            }
        }
        problems
    }

    /// What changes when one of the files does.
    pub fn stamps(&self) -> Vec<Stamp> {
        stamps(&self.files)
    }

    /// The same as it was when the doors were opened.
    pub fn opened(&self) -> &[Stamp] {
        &self.opened
    }
}

/// What changes when a file is written or replaced: device, inode, length, time of the last change of anything about it.
pub type Stamp = Option<(u64, u64, u64, i64, i64)>;

fn stamps(files: &[PathBuf]) -> Vec<Stamp> {
    let stamp = |file: &PathBuf| {
        let about = std::fs::metadata(file).ok()?;
        Some((about.dev(), about.ino(), about.len(), about.ctime(), about.ctime_nsec()))
    };
    files.iter().map(stamp).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_old_socket_goes_and_anything_else_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("socket");
        let first = bind_unix(&path, 0o600, None).unwrap();
        assert_eq!(std::fs::metadata(&path).unwrap().mode() & 0o777, 0o600);
        let problem = bind_unix(&path, 0o600, None).unwrap_err().to_string();
        assert!(problem.ends_with("another process serves this socket"), "{problem}");
        drop(first);
        drop(bind_unix(&path, 0o660, None).unwrap());
        assert_eq!(std::fs::metadata(&path).unwrap().mode() & 0o777, 0o660);

        std::fs::remove_file(&path).unwrap();
        std::fs::write(&path, "a file").unwrap();
        let problem = bind_unix(&path, 0o600, None).unwrap_err().to_string();
        assert!(problem.contains("is not a socket"), "{problem}");
        assert_eq!(std::fs::read(&path).unwrap(), b"a file");
        let link = folder.path().join("link");
        std::os::unix::fs::symlink(&path, &link).unwrap();
        assert!(bind_unix(&link, 0o600, None).unwrap_err().to_string().contains("is not a socket"));
        assert!(link.is_symlink());
    }

    #[test]
    fn an_unknown_group_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let problem = bind_unix(&folder.path().join("s"), 0o660, Some("no-such-group")).unwrap_err().to_string();
        assert!(problem.contains("there is no group `no-such-group`"), "{problem}");
    }

    #[test]
    fn tokens_are_read_again_and_bad_ones_change_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tokens");
        let write = |text: &str| {
            std::fs::write(&path, text).unwrap();
            std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600)).unwrap();
        };
        write("");
        let doors = Doors { doors: vec![], rules: Rules::default(), tokens: Some(path.clone()), ruled: true };
        let open = open(&doors).unwrap();
        write("operator bench ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
        assert_eq!(open.reloader.reload(), Vec::<String>::new());
        write("operator bench nonsense");
        let problems = open.reloader.reload();
        assert!(problems[0].contains("line 1") && problems[0].contains("stay as they were"), "{problems:?}");
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o644)).unwrap();
        assert!(open.reloader.reload()[0].contains("its mode is 644"));
    }
}
