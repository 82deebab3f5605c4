//! `[shared_memory]`: a page of each patch for controllers of the same machine.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::listen_sections::{AccessSection, GrantSection, RoleWord};

/// The pages' owner writes and their group reads.
const MODE: u32 = 0o640;

/// Where pages are, unless another place is given.
const FOLDER: &str = "/dev/shm/taxeld";

/// `[shared_memory]`; without it there are no pages.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SharedMemorySection {
    /// The folder, on a tmpfs.
    pub path: PathBuf,
    /// Mode of the pages.
    pub mode: u32,
    /// Their group; else that of the daemon.
    pub group: Option<String>,
}

impl Default for SharedMemorySection {
    fn default() -> Self {
        Self { path: FOLDER.into(), mode: MODE, group: None }
    }
}

/// What is wrong with the section, if anything is. To read a page is to observe, and no role stands before a file: so
/// where an account needs a grant to read the force, its group's grant must be there, too.
pub fn problem(section: &SharedMemorySection, access: Option<&AccessSection>) -> Option<String> {
    let SharedMemorySection { path, mode, group } = section;
    if !path.is_absolute() {
        return Some(format!(
            "shared_memory.path = {:?}: expected an absolute path, as in \"{FOLDER}\"",
            path.display()
        ));
    }
    if ![0o600, 0o640, 0o644].contains(mode) {
        return Some(format!(
            "shared_memory.mode = 0o{mode:o}: expected 0o600, 0o640 or 0o644: only the daemon writes"
        ));
    }
    let access = access.filter(|access| access.unix == RoleWord::None)?;
    if mode & 0o004 != 0 {
        return Some(format!(
            "shared_memory.mode = 0o{mode:o}: every account could read the force, which access.unix = \"none\" forbids: \
             expected 0o640 or 0o600"
        ));
    }
    if mode & 0o040 == 0 {
        return None;
    }
    // The configuration does not say which group is the daemon's own, so no grant can be found for it.
    let Some(group) = group else {
        return Some(format!(
            "shared_memory.mode = 0o{mode:o}: the daemon's own group could read the force, which access.unix = \"none\" \
             forbids: write `group` and give it a role with an [[access.grant]], or mode = 0o600"
        ));
    };
    let granted = |grant: &GrantSection| grant.group.as_ref() == Some(group) && grant.role > RoleWord::None;
    let problem = format!(
        "shared_memory.group = \"{group}\": it could read the force, which access.unix = \"none\" forbids: give it a role \
         with an [[access.grant]]"
    );
    (!access.grant.iter().any(granted)).then_some(problem)
}

/// The section as a line of `taxeld check`.
pub fn written(section: &SharedMemorySection) -> String {
    let SharedMemorySection { path, mode, group } = section;
    let path = Path::new(path).join("PATCH");
    let group = group.as_ref().map_or(String::new(), |group| format!(", group {group}"));
    format!(
        "shared memory: {} (mode {mode:03o}{group}), a page a patch, for controllers of this machine",
        path.display()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(section: &str, access: &str) -> Option<String> {
        let section: SharedMemorySection = toml::from_str(section).unwrap();
        let access: Option<AccessSection> = Some(toml::from_str(access).unwrap());
        problem(&section, access.as_ref())
    }

    #[test]
    fn only_the_daemon_writes_and_nobody_reads_who_may_not_observe() {
        let closed = "unix = \"none\"\n[[grant]]\nrole = \"observer\"\ngroup = \"skin\"";
        assert_eq!(told("", ""), None);
        assert_eq!(told("mode = 0o644", ""), None);
        assert_eq!(told("group = \"skin\"", closed), None);
        assert_eq!(told("mode = 0o600\ngroup = \"other\"", closed), None);
        assert_eq!(told("mode = 0o600", closed), None);
        for (section, access, expected) in [
            ("path = \"here\"", "", "expected an absolute path"),
            ("mode = 0o660", "", "only the daemon writes"),
            ("mode = 0o1640", "", "only the daemon writes"),
            ("mode = 0o644", closed, "every account could read"),
            ("group = \"other\"", closed, "group = \"other\": it could read the force"),
            ("group = \"other\"", closed, "give it a role"),
            // The group of the pages is the daemon's own then, whose name no grant can be seen to have.
            ("", closed, "mode = 0o640: the daemon's own group could read the force"),
            ("", closed, "write `group` and give it a role with an [[access.grant]], or mode = 0o600"),
            ("mode = 0o640", "unix = \"none\"", "the daemon's own group could read"),
        ] {
            let said = told(section, access).unwrap();
            assert!(said.contains(expected), "{section}: {said}");
        }
    }
}
