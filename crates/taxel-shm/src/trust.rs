//! Whether another account could have put something in the place of a page.
//!
//! A page cannot vouch for itself: in a folder like `/dev/shm` every account can make one that says whatever it likes. So a
//! reader looks at the way to it from `/` on. What lies in a folder where only its owner writes was put there by that
//! owner. What lies where others write, too, has to belong to root, to the reader's own account, or to the one that the
//! reader was told.

use std::fs::Metadata;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use nix::unistd::geteuid;

use crate::error::PageError;

/// Write permission of the group and of all others.
const OTHERS_WRITE: u32 = 0o022;

/// Where a page really is, without symbolic links, and what is known of it, if nobody but root, this account and `owner`
/// can have put it there.
///
/// # Errors
/// [`PageError::Untrusted`] with what is in the way, or what the system says.
pub fn way_to(path: &Path, owner: Option<u32>) -> Result<(PathBuf, Metadata), PageError> {
    let real = path.canonicalize().map_err(PageError::of(path, "opening the page"))?;
    let way: Vec<&Path> = real.ancestors().collect();
    let own = geteuid().as_raw();
    let mut others_write = false;
    let mut last = None;
    for step in way.into_iter().rev() {
        let about = step.symlink_metadata().map_err(PageError::of(step, "looking at the way to the page"))?;
        let known = [0, own].contains(&about.uid()) || owner == Some(about.uid());
        if others_write && !known {
            let problem = format!(
                "it belongs to user {}, who can have made it to deceive: expected root, user {own}{}, or a folder where \
                 nobody else writes, as in /run/taxeld",
                about.uid(),
                owner.map_or_else(String::new, |owner| format!(", user {owner}"))
            );
            return Err(PageError::Untrusted { path: step.to_owned(), problem });
        }
        others_write = about.mode() & OTHERS_WRITE != 0;
        last = Some(about);
    }
    match last {
        Some(about) if !others_write => Ok((real, about)),
        _ => {
            let problem = "others may write in it: expected a file that only its daemon writes".to_owned();
            Err(PageError::Untrusted { path: real, problem })
        }
    }
}
