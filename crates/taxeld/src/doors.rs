//! Opens the doors of the service: binds what the configuration names.

use std::io::ErrorKind;
use std::net::{SocketAddr, TcpListener};
use std::os::unix::fs::{FileTypeExt, MetadataExt, PermissionsExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;

use anyhow::{Context, bail};
use taxel_rpc::{Listener, Tls};

use crate::config::{Door, Doors, SOCKET_MODE, UNRULED};
use crate::reload::Credentials;

/// Binds every door: what the service accepts connections from, and by what it knows who calls.
///
/// # Errors
/// The door or the file, and what is wrong with it.
pub fn open(doors: &Doors) -> anyhow::Result<(Vec<Listener>, Credentials)> {
    let mut credentials = Credentials::read(doors)?;
    if doors.rules.is_none() {
        tracing::warn!("{UNRULED}");
    }
    doors.unreached_grants().iter().for_each(|line| tracing::warn!("{line}"));
    let bind = |address: &SocketAddr| TcpListener::bind(address).with_context(|| format!("listening on {address}"));
    let mut listeners = Vec::new();
    for door in &doors.doors {
        listeners.push(match door {
            Door::Unix(path) => Listener::Unix(bind_unix(path, doors.group.as_deref())?),
            Door::Tcp(address) => Listener::Tcp(bind(address)?),
            Door::Tls { address, files } => {
                let tls = Tls::load(files.clone()).map_err(anyhow::Error::msg)?;
                credentials.tls.push(tls.clone());
                Listener::Tls(bind(address)?, tls)
            }
        });
    }
    if let Some(path) = &doors.tokens {
        tracing::info!(tokens = %path.display(), "tokens are read");
    }
    Ok((listeners, credentials))
}

/// Binds a Unix socket.
fn bind_unix(path: &Path, group: Option<&str>) -> anyhow::Result<UnixListener> {
    remove_old(path)?;
    let shown = path.display();
    let listener = UnixListener::bind(path).with_context(|| format!("listening on {shown}"))?;
    if let Some(group) = group {
        give_to(path, group)?;
    }
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(SOCKET_MODE)).with_context(|| format!("{shown}"))?;
    Ok(listener)
}

/// Removes what is left of a daemon that was killed, but only a socket that nobody answers on.
fn remove_old(path: &Path) -> anyhow::Result<()> {
    let shown = path.display();
    let about = match std::fs::symlink_metadata(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        about => about.with_context(|| format!("{shown}"))?,
    };
    if !about.file_type().is_socket() {
        bail!("{shown}: is there already and is not a socket");
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_old_socket_goes_and_anything_else_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("socket");
        let first = bind_unix(&path, None).unwrap();
        let problem = bind_unix(&path, None).unwrap_err().to_string();
        assert!(problem.ends_with("another process serves this socket"), "{problem}");
        drop(first);
        drop(bind_unix(&path, None).unwrap());
        assert_eq!(std::fs::metadata(&path).unwrap().mode() & 0o777, 0o660);

        std::fs::remove_file(&path).unwrap();
        std::fs::write(&path, "a file").unwrap();
        let problem = bind_unix(&path, None).unwrap_err().to_string();
        assert!(problem.contains("is not a socket"), "{problem}");
        assert_eq!(std::fs::read(&path).unwrap(), b"a file");
        let link = folder.path().join("link");
        std::os::unix::fs::symlink(&path, &link).unwrap();
        assert!(bind_unix(&link, None).unwrap_err().to_string().contains("is not a socket"));
        assert!(link.is_symlink());
    }

    #[test]
    fn an_unknown_group_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let problem = bind_unix(&folder.path().join("s"), Some("no-such-group")).unwrap_err().to_string();
        assert!(problem.contains("there is no group `no-such-group`"), "{problem}");
    }
}
