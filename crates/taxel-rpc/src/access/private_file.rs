//! Files with secrets: read only if nobody else can read or change them.

use nix::unistd::geteuid;
use std::io::Read;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// No key and no list of tokens is as long.
const BYTES_MAX: u64 = 1 << 20;

/// Group may write, others may do anything at all.
const MODE_FORBIDDEN: u32 = 0o027;

/// Reads a file that only its owner, who is root or the daemon's own account, and perhaps its group can read.
///
/// # Errors
/// The path, what is wrong with the file and what was expected.
pub fn read_private(path: &Path) -> Result<Vec<u8>, String> {
    let told = |problem: String| format!("{}: {problem}", path.display());
    let file = std::fs::File::open(path).map_err(|error| told(error.to_string()))?;
    // Of the open file and not of the path, which may be another file's by now.
    let about = file.metadata().map_err(|error| told(error.to_string()))?;
    if !about.is_file() {
        return Err(told("is not a regular file".to_owned()));
    }
    let (owner, own) = (about.uid(), geteuid().as_raw());
    if owner != 0 && owner != own {
        return Err(told(format!("belongs to user {owner}, expected root or user {own}, who runs the daemon")));
    }
    let mode = about.mode() & 0o777;
    if mode & MODE_FORBIDDEN != 0 {
        return Err(told(format!("its mode is {mode:03o}: others can read or change it; expected 600 or 640")));
    }
    if about.len() > BYTES_MAX {
        return Err(told(format!("has {} bytes, expected at most {BYTES_MAX}", about.len())));
    }
    let mut bytes = Vec::new();
    file.take(BYTES_MAX).read_to_end(&mut bytes).map_err(|error| told(error.to_string()))?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn a_file_that_others_can_read_or_change_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tokens");
        std::fs::write(&path, "text").unwrap();
        for (mode, good) in
            [(0o600, true), (0o400, true), (0o640, true), (0o644, false), (0o660, false), (0o601, false)]
        {
            std::fs::set_permissions(&path, std::fs::Permissions::from_mode(mode)).unwrap();
            assert_eq!(read_private(&path).is_ok(), good, "{mode:o}");
        }
        assert!(read_private(folder.path()).unwrap_err().contains("is not a regular file"));
        assert!(read_private(&folder.path().join("absent")).unwrap_err().contains("No such file"));
    }
}
