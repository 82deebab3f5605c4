//! Names and groups of accounts, as the system knows them.

use std::ffi::CString;

use nix::unistd::{Gid, Group, Uid, User, getgrouplist};

use crate::access::origin::Account;

/// The account of a user. `gid` is the group of the process that asks: all that is known of a user whom the system does not
/// list. It may take long where the system asks a server.
pub(crate) fn look_up(uid: u32, gid: u32) -> Account {
    let user = User::from_uid(Uid::from_raw(uid)).ok().flatten();
    let listed = user.as_ref().and_then(|user| getgrouplist(&CString::new(user.name.clone()).ok()?, user.gid).ok());
    let ids = listed.unwrap_or_else(|| vec![Gid::from_raw(gid)]);
    let groups = ids.into_iter().filter_map(|id| Group::from_gid(id).ok().flatten());
    Account { uid, user: user.map(|user| user.name), groups: groups.map(|group| group.name).collect() }
}

/// The number of an account of this machine.
#[must_use]
pub fn user_id(name: &str) -> Option<u32> {
    User::from_name(name).ok().flatten().map(|user| user.uid.as_raw())
}

/// The number of a group of this machine.
#[must_use]
pub fn group_id(name: &str) -> Option<u32> {
    Group::from_name(name).ok().flatten().map(|group| group.gid.as_raw())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_account_is_known_with_its_name_and_groups() {
        let root = look_up(0, 0);
        assert_eq!((root.uid, root.user.as_deref()), (0, Some("root")));
        assert!(root.groups.iter().any(|group| group == "root"), "{root:?}");
    }

    /// A program that has taken a group (setgid) says nothing of the other processes of its user.
    #[test]
    fn a_user_whom_nobody_lists_has_the_group_of_each_process_alone() {
        let groups = |gid| look_up(4_000_000_000, gid).groups;
        assert_eq!((groups(0), groups(4_000_000_000)), (vec!["root".to_owned()], vec![]));
    }
}
