//! Whether another account could have made a page.
//!
//! A page cannot vouch for itself: in a folder like `/dev/shm` every account can make one that says whatever it likes. A page
//! of root, of the reader's own account or of the one that the reader was told is believed. A page of any other account is
//! believed where none of the folders that its path names can be written by others, as in `/run/taxeld`.

use std::fs::Metadata;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, absolute};

use nix::unistd::geteuid;

use crate::error::PageError;

/// Write permission of the group and of all others.
pub(crate) const OTHERS_WRITE: u32 = 0o022;

/// Refuses a page that somebody else than root, this account and `owner` can have made.
///
/// # Errors
/// [`PageError::Refused`] with what is in the way, or what the system says.
pub(crate) fn believe(path: &Path, page: &Metadata, owner: Option<u32>) -> Result<(), PageError> {
    let untrusted = |problem: String| PageError::Refused { path: path.to_owned(), problem };
    if page.mode() & OTHERS_WRITE != 0 {
        return Err(untrusted("others may write in it: expected a file that only its daemon writes".to_owned()));
    }
    let (uid, own) = (page.uid(), geteuid().as_raw());
    if [0, own].contains(&uid) || owner == Some(uid) {
        return Ok(());
    }
    let whole = absolute(path).map_err(PageError::of(path, "opening the page"))?;
    for folder in whole.ancestors().skip(1) {
        let about = std::fs::metadata(folder).map_err(PageError::of(folder, "looking at the way to the page"))?;
        if about.mode() & OTHERS_WRITE != 0 {
            let told = owner.map_or_else(String::new, |owner| format!(", user {owner}"));
            return Err(untrusted(format!(
                "it belongs to user {uid}, who can have made it to deceive, since others may write in {}: expected root, \
                 user {own}{told}, or a folder where nobody else writes, as in /run/taxeld",
                folder.display()
            )));
        }
    }
    Ok(())
}
