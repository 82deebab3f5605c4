//! Files on which it hangs who may do what: read only if nobody else can have changed them, or read secrets in them.

use nix::fcntl::OFlag;
use nix::unistd::geteuid;
use std::fs::OpenOptions;
use std::io::Read;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::Path;

/// No key, no authorities and no list of tokens are as long.
const BYTES_MAX: u64 = 1 << 20;

/// The bits of a mode that must not be set, and what they mean.
type Forbidden = (u32, &'static str);

/// Of a file that only its owner, who is root or the daemon's own account, and perhaps its group may read.
pub(crate) const SECRET: Forbidden = (0o027, "others can read or change it; expected 600 or 640");

/// Of a file that everybody may read.
pub(crate) const TRUSTED: Forbidden = (0o022, "others can change it; expected 600 or 644");

/// Reads a file with which others may do no more than that.
///
/// # Errors
/// The path, what is wrong with the file and what was expected.
pub(crate) fn read_guarded(path: &Path, forbidden: Forbidden) -> Result<Vec<u8>, String> {
    read(path, forbidden).map_err(|problem| format!("{}: {problem}", path.display()))
}

fn read(path: &Path, (forbidden, why): Forbidden) -> Result<Vec<u8>, String> {
    // A pipe that nobody writes to is opened at once so, and then refused; without it the daemon would wait for a writer.
    let nonblocking = OFlag::O_NONBLOCK.bits();
    let file = OpenOptions::new().read(true).custom_flags(nonblocking).open(path).map_err(|error| error.to_string())?;
    // Of the open file and not of the path, which may be another file's by now.
    let about = file.metadata().map_err(|error| error.to_string())?;
    if !about.is_file() {
        return Err("is not a regular file".to_owned());
    }
    if about.len() > BYTES_MAX {
        return Err(format!("has {} bytes, expected at most {BYTES_MAX}", about.len()));
    }
    let (owner, own) = (about.uid(), geteuid().as_raw());
    if owner != 0 && owner != own {
        return Err(format!("belongs to user {owner}, expected root or user {own}, who runs the daemon"));
    }
    let mode = about.mode() & 0o777;
    if mode & forbidden != 0 {
        return Err(format!("its mode is {mode:03o}: {why}"));
    }
    let mut bytes = Vec::new();
    file.take(BYTES_MAX).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    fn read_private(path: &Path) -> Result<Vec<u8>, String> {
        read_guarded(path, SECRET)
    }

    #[test]
    fn a_file_that_others_can_read_or_change_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tokens");
        std::fs::write(&path, "text").unwrap();
        // By mode: whether a secret is read, and whether what others may know is.
        let cases = [
            (0o600, true, true),
            (0o400, true, true),
            (0o640, true, true),
            (0o644, false, true),
            (0o660, false, false),
            (0o664, false, false),
            (0o646, false, false),
            (0o601, false, true),
        ];
        for (mode, secret, known) in cases {
            std::fs::set_permissions(&path, std::fs::Permissions::from_mode(mode)).unwrap();
            assert_eq!(read_private(&path).is_ok(), secret, "{mode:o}");
            assert_eq!(read_guarded(&path, TRUSTED).is_ok(), known, "{mode:o}");
        }
        assert!(read_private(folder.path()).unwrap_err().contains("is not a regular file"));
        assert!(read_private(&folder.path().join("absent")).unwrap_err().contains("No such file"));
    }

    #[test]
    fn a_file_that_is_too_long_or_a_strangers_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tokens");
        for (bytes, good) in [(BYTES_MAX, true), (BYTES_MAX + 1, false)] {
            std::fs::write(&path, vec![b'x'; usize::try_from(bytes).unwrap()]).unwrap();
            std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600)).unwrap();
            let read = read_private(&path);
            assert_eq!(read.as_ref().is_ok_and(|read| read.len() as u64 == bytes), good, "{bytes} bytes");
            assert!(good || read.unwrap_err().contains("bytes, expected at most 1048576"));
        }
        // Only root can give a file away.
        if geteuid().is_root() {
            std::fs::write(&path, "x").unwrap();
            assert!(read_private(&path).is_ok());
            std::os::unix::fs::chown(&path, Some(12345), None).unwrap();
            assert!(read_private(&path).unwrap_err().contains("belongs to user 12345, expected root"));
        }
    }
}
