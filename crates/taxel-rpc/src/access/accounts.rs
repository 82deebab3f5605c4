//! Names and groups of accounts, asked of the system once a minute at most: it may ask a server for them.

use futures_util::FutureExt;
use futures_util::future::{BoxFuture, Shared};
use nix::unistd::{Gid, Group, Uid, User, getgrouplist};
use std::collections::HashMap;
use std::ffi::CString;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use crate::access::origin::Account;

/// What is known of an account is asked again after so long.
const KNOWN_FOR: Duration = Duration::from_secs(60);

/// More accounts than a robot has; beyond, everything known is forgotten.
const ACCOUNTS_MAX: usize = 256;

/// An account, and when the system was asked for it.
type Known = (Instant, Arc<Account>);

/// The accounts that were asked for.
#[derive(Clone, Debug, Default)]
pub(crate) struct Accounts(Arc<Mutex<Asked>>);

/// What the system has answered.
#[derive(Debug, Default)]
struct Asked {
    /// By user and group: of a user whom the system does not list the group of the process is all that is known.
    known: HashMap<(u32, u32), Known>,
    /// What the system has not answered yet.
    asking: HashMap<(u32, u32), Shared<BoxFuture<'static, Arc<Account>>>>,
    /// So often everything was forgotten: an answer to an earlier question is not kept.
    forgotten: u64,
}

impl Accounts {
    /// The account of a user. `gid` is the group of the process that asks, which the system's list may lack. The system is asked
    /// once for all who want to know, and its answer is kept though none of them waits for it any more.
    pub(crate) async fn of(&self, uid: u32, gid: u32) -> Arc<Account> {
        let answer = {
            let mut asked = self.asked();
            if let Some((_, account)) = asked.known.get(&(uid, gid)).filter(|(asked, _)| asked.elapsed() < KNOWN_FOR) {
                return Arc::clone(account);
            }
            let before = asked.forgotten;
            let asking = asked.asking.entry((uid, gid)).or_insert_with(|| {
                let question = Question { accounts: self.clone(), of: (uid, gid), before };
                let looked_up = tokio::spawn(question.answered());
                looked_up.map(move |account| account.unwrap_or_else(|_| Account::nameless(uid).into())).boxed().shared()
            });
            asking.clone()
        };
        answer.await
    }

    /// Forgets what is known, so that a change of groups counts at once for new connections.
    pub(crate) fn forget(&self) {
        let mut asked = self.asked();
        asked.known.clear();
        asked.asking.clear();
        asked.forgotten += 1;
    }

    fn asked(&self) -> MutexGuard<'_, Asked> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A question to the system. However it ends, whoever wants to know afterwards asks anew, unless the answer is kept.
struct Question {
    accounts: Accounts,
    of: (u32, u32),
    /// So often everything had been forgotten.
    before: u64,
}

impl Question {
    async fn answered(self) -> Arc<Account> {
        let (uid, gid) = self.of;
        let looked_up = tokio::task::spawn_blocking(move || look_up(uid, gid)).await;
        let Ok(account) = looked_up.map(Arc::new) else { return Account::nameless(uid).into() }; // there was no thread
        let mut asked = self.accounts.asked();
        if asked.known.len() >= ACCOUNTS_MAX {
            asked.known.clear();
        }
        if asked.forgotten == self.before {
            asked.known.insert(self.of, (Instant::now(), Arc::clone(&account)));
        }
        account
    }
}

impl Drop for Question {
    fn drop(&mut self) {
        let mut asked = self.accounts.asked();
        if asked.forgotten == self.before {
            asked.asking.remove(&self.of);
        }
    }
}

fn look_up(uid: u32, gid: u32) -> Account {
    if hidden().is_some_and(|[user, _]| user == uid) {
        return Account::nameless(uid);
    }
    let user = User::from_uid(Uid::from_raw(uid)).ok().flatten();
    let listed = user.as_ref().and_then(|user| {
        let name = CString::new(user.name.clone()).ok()?;
        getgrouplist(&name, user.gid).ok()
    });
    let ids = listed.unwrap_or_else(|| vec![Gid::from_raw(gid)]);
    let ids = ids.into_iter().filter(|id| hidden().is_none_or(|[_, group]| group != id.as_raw()));
    let name = |id: &Gid| Group::from_gid(*id).ok().flatten().map(|group| group.name);
    Account { uid, user: user.map(|user| user.name), groups: ids.filter_map(|id| name(&id)).collect() }
}

/// The numbers of the user and the group that the kernel gives for all that this process's user namespace does not have; none
/// where it has all.
fn hidden() -> Option<[u32; 2]> {
    static HIDDEN: OnceLock<Option<[u32; 2]>> = OnceLock::new();
    let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    *HIDDEN.get_or_init(|| {
        let whole = ["/proc/self/uid_map", "/proc/self/gid_map"].iter().all(|map| has_all(&read(map)));
        let number = |path: &str| read(path).trim().parse().unwrap_or(OVERFLOW);
        (!whole).then(|| [number("/proc/sys/kernel/overflowuid"), number("/proc/sys/kernel/overflowgid")])
    })
}

/// What the kernel gives where nobody has set another number.
const OVERFLOW: u32 = 65_534;

/// Whether a map of a user namespace, lines of inside, outside and count, has every number there is.
fn has_all(map: &str) -> bool {
    let counts = map.lines().filter_map(|line| line.split_ascii_whitespace().nth(2)?.parse::<u64>().ok());
    counts.sum::<u64>() >= u64::from(u32::MAX)
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
    fn a_namespace_that_has_not_all_accounts_is_told_from_one_that_has() {
        assert!(has_all("         0          0 4294967295\n"));
        assert!(has_all("0 0 65536\n65536 65536 4294901759\n"));
        assert!(!has_all("0 0 65536\n") && !has_all("0 1000 1\n1 100000 65536\n") && !has_all(""));
    }

    #[tokio::test]
    async fn an_account_is_asked_for_once_until_it_is_forgotten() {
        let accounts = Accounts::default();
        let root = accounts.of(0, 0).await;
        assert_eq!((root.uid, root.user.as_deref()), (0, Some("root")));
        assert!(Arc::ptr_eq(&root, &accounts.of(0, 0).await));
        accounts.forget();
        assert!(!Arc::ptr_eq(&root, &accounts.of(0, 0).await));
    }

    /// A program that has taken a group (setgid) says nothing of the other processes of its user.
    #[tokio::test]
    async fn a_user_whom_nobody_lists_has_the_group_of_each_process_alone() {
        let accounts = Accounts::default();
        let groups = async |gid| accounts.of(4_000_000_000, gid).await.groups.clone();
        assert_eq!((groups(0).await, groups(4_000_000_000).await), (vec!["root".to_owned()], vec![]));
    }

    /// The system may have no thread for a question.
    #[tokio::test]
    async fn a_question_that_ends_without_an_answer_is_asked_again() {
        let accounts = Accounts::default();
        let never = futures_util::future::pending().boxed().shared();
        accounts.asked().asking.insert((0, 0), never);
        drop(Question { accounts: accounts.clone(), of: (0, 0), before: 0 });
        assert_eq!(accounts.of(0, 0).await.user.as_deref(), Some("root"));
    }

    #[tokio::test]
    async fn no_more_accounts_are_known_than_a_robot_has() {
        let accounts = Accounts::default();
        for (before, uid) in (4_000_000_000..).enumerate().take(ACCOUNTS_MAX + 1) {
            assert_eq!(accounts.asked().known.len(), before);
            accounts.of(uid, 0).await;
        }
        assert_eq!(accounts.asked().known.len(), 1);
    }

    #[test]
    fn groups_are_found_by_name() {
        assert_eq!([group_id("root"), group_id("no-such-group-here")], [Some(0), None]);
    }
}
