//! Whether another account could have put something in the place of a page.
//!
//! A page cannot vouch for itself: in a folder like `/dev/shm` every account can make one that says whatever it likes. So a
//! reader looks at the way to it from `/` on, symbolic links and what they lead to included. What lies in a folder where only
//! its owner writes was put there by that owner. What lies where others write, too, has to belong to root, to the reader's
//! own account, or to the one that the reader was told.

use std::collections::VecDeque;
use std::ffi::OsString;
use std::fs::Metadata;
use std::os::unix::fs::MetadataExt;
use std::path::{Component, Path, PathBuf, absolute};

use nix::unistd::geteuid;

use crate::error::PageError;

/// Write permission of the group and of all others.
const OTHERS_WRITE: u32 = 0o022;
/// As many symbolic links as Linux follows.
const LINKS_MAX: usize = 40;

/// Where a page really is, without symbolic links, and what is known of it, if nobody but root, this account and `owner`
/// can have put it there.
///
/// # Errors
/// [`PageError::Untrusted`] with what is in the way, or what the system says.
pub fn way_to(path: &Path, owner: Option<u32>) -> Result<(PathBuf, Metadata), PageError> {
    let given = absolute(path).map_err(PageError::of(path, "opening the page"))?;
    let (mut left, mut links) = (steps(&given), 0);
    let mut at = PathBuf::from("/");
    let mut about = looked_at(&at)?;
    while let Some(step) = left.pop_front() {
        if step == ".." {
            at.pop();
            about = looked_at(&at)?;
            continue;
        }
        let next = at.join(step);
        let found = looked_at(&next)?;
        if about.mode() & OTHERS_WRITE != 0 {
            known(&next, &found, owner)?;
        }
        if !found.is_symlink() {
            (at, about) = (next, found);
            continue;
        }
        links += 1;
        if links > LINKS_MAX {
            return Err(untrusted(path, "too many symbolic links lead to it".to_owned()));
        }
        let target = next.read_link().map_err(PageError::of(&next, "following the link"))?;
        if target.is_absolute() {
            at = PathBuf::from("/");
            about = looked_at(&at)?;
        }
        let mut then = steps(&target);
        then.append(&mut left);
        left = then;
    }
    if about.mode() & OTHERS_WRITE != 0 {
        return Err(untrusted(&at, "others may write in it: expected a file that only its daemon writes".to_owned()));
    }
    Ok((at, about))
}

/// The names on a way, with `..` as a name.
fn steps(path: &Path) -> VecDeque<OsString> {
    let name = |part: Component<'_>| match part {
        Component::Normal(name) => Some(name.to_owned()),
        Component::ParentDir => Some("..".into()),
        Component::RootDir | Component::CurDir | Component::Prefix(_) => None,
    };
    path.components().filter_map(name).collect()
}

fn looked_at(path: &Path) -> Result<Metadata, PageError> {
    path.symlink_metadata().map_err(PageError::of(path, "looking at the way to the page"))
}

/// Refuses what lies where others write and belongs to one of them.
fn known(path: &Path, about: &Metadata, owner: Option<u32>) -> Result<(), PageError> {
    let (uid, own) = (about.uid(), geteuid().as_raw());
    if [0, own].contains(&uid) || owner == Some(uid) {
        return Ok(());
    }
    let told = owner.map_or_else(String::new, |owner| format!(", user {owner}"));
    Err(untrusted(
        path,
        format!(
            "it belongs to user {uid}, who can have made it to deceive: expected root, user {own}{told}, or a folder where \
             nobody else writes, as in /run/taxeld"
        ),
    ))
}

fn untrusted(path: &Path, problem: String) -> PageError {
    PageError::Untrusted { path: path.to_owned(), problem }
}
