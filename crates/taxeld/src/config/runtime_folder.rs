//! The folder that a service manager gives a daemon for its socket.

use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::path::PathBuf;

/// The folder that the service manager has made for sockets (`RuntimeDirectory=`), the first if there are several.
pub fn runtime_folder() -> Option<PathBuf> {
    first_of(&std::env::var_os("RUNTIME_DIRECTORY")?)
}

/// The first of the folders that a variable of the service manager lists, systemd.exec(5): colons are between them.
fn first_of(folders: &OsStr) -> Option<PathBuf> {
    let first = folders.as_bytes().split(|byte| *byte == b':').find(|folder| !folder.is_empty())?;
    Some(OsStr::from_bytes(first).into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_several_folders_the_first_is_the_daemons() {
        for (listed, first) in [
            ("/run/taxeld", Some("/run/taxeld")),
            ("/run/taxeld:/run/taxeld/force", Some("/run/taxeld")),
            (":/run/taxeld", Some("/run/taxeld")),
            ("", None),
            (":", None),
        ] {
            assert_eq!(first_of(OsStr::new(listed)), first.map(PathBuf::from), "{listed}");
        }
    }
}
