//! How much is kept: what is beyond it goes at a start and while the daemon runs, oldest first, and never what is in use.

use std::collections::BTreeSet;
use std::time::{SystemTime, UNIX_EPOCH};

use taxel_engine::Restored;
use taxel_engine::calibration::{SessionState, SessionView};
use taxel_engine::known_set::KnownSet;
use taxel_engine::record::Record;

/// How much is kept; without a limit everything.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Retention {
    /// Model sets.
    pub model_sets: Option<usize>,
    /// Sessions.
    pub sessions: Option<usize>,
    /// Samples of all sessions together.
    pub samples: Option<u64>,
    /// Bytes of the database that are in use.
    pub bytes: Option<u64>,
}

impl Retention {
    /// Whether anything is limited.
    #[must_use]
    pub fn limits(&self) -> bool {
        *self != Self::default()
    }
}

/// What a database holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Samples of all sessions.
    pub samples: u64,
    /// Bytes in use.
    pub bytes: u64,
}

/// The model sets that are to go, oldest first, each as the record that says so: never one that is active, nor one that
/// the active one was made of by known loads, nor one that an operator has yet to judge.
#[must_use]
pub fn sets_to_go(restored: &Restored, limits: &Retention) -> Vec<Record> {
    let wall_ns = wall_ns();
    let beyond = restored.model_sets.len().saturating_sub(limits.model_sets.unwrap_or(usize::MAX));
    let is_active = |id: &str| in_use(restored, Some(id));
    let waits = to_be_judged(restored);
    let idle = restored.model_sets.iter().filter(|set| !is_active(&set.id) && !waits.contains(&*set.id));
    idle.take(beyond).map(|set| Record::ModelSetDeleted { model_set: set.id.clone(), wall_ns }).collect()
}

/// The model sets that an operator has yet to judge: those of sessions that are in review and came after the one whose set
/// is active. One before it is in review again since its set went out of use.
#[must_use]
pub fn to_be_judged(restored: &Restored) -> BTreeSet<&str> {
    let active_since = |patch: &str| {
        let is_active = |view: &SessionView| {
            let mut active = restored.active.iter().filter(|(of, _)| of == patch);
            active.any(|(_, set)| Some(set.as_str()) == view.model_set.as_deref())
        };
        restored.sessions.iter().filter(|view| is_active(view)).map(|view| view.number).max()
    };
    let in_review = restored.sessions.iter().filter(|view| view.state == SessionState::Review);
    let waits = in_review.filter(|view| active_since(&view.patch).is_none_or(|active| view.number > active));
    waits.filter_map(|view| view.model_set.as_deref()).collect()
}

/// The session that goes next, if one must: never the newest of a patch, nor one whose models are in use or that waits
/// for the operator's word.
#[must_use]
pub fn session_to_go(restored: &Restored, size: Size, limits: &Retention) -> Option<Record> {
    let too_many = limits.sessions.is_some_and(|most| restored.sessions.len() > most)
        || limits.samples.is_some_and(|most| size.samples > most)
        || limits.bytes.is_some_and(|most| size.bytes > most);
    if !too_many {
        return None;
    }
    let mut patches = BTreeSet::new();
    let newest: BTreeSet<u64> =
        restored.sessions.iter().rev().filter(|view| patches.insert(&view.patch)).map(|view| view.number).collect();
    let may_go = restored.sessions.iter().find(|view| {
        !newest.contains(&view.number)
            && !in_use(restored, view.model_set.as_deref())
            && !matches!(view.state, SessionState::Active | SessionState::Review | SessionState::Interrupted)
    });
    may_go.map(|view| Record::SessionDeleted { session: view.number, wall_ns: wall_ns() })
}

/// Whether a set is active, or the one that is was made of it by known loads.
fn in_use(restored: &Restored, set: Option<&str>) -> bool {
    let sets = &restored.model_sets;
    let comes_of_it = |active: &KnownSet| active.origins.iter().any(|of| Some(of.as_str()) == set);
    let uses = |active: &str| Some(active) == set || sets.iter().filter(|known| known.id == active).any(comes_of_it);
    restored.active.iter().any(|(_, active)| uses(active))
}

/// Nanoseconds since 1970, by the clock on the wall.
pub(crate) fn wall_ns() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    /// A session of patch `p` or another, and its model set.
    type Session = (u64, &'static str, SessionState, Option<&'static str>);

    fn restored(sessions: &[Session], active: &[(&str, &str)]) -> Restored {
        let view = |&(number, patch, state, set): &Session| {
            Arc::new(SessionView {
                number,
                patch: patch.to_owned(),
                state,
                model_set: set.map(Into::into),
                ..SessionView::default()
            })
        };
        let active = active.iter().map(|(patch, set)| ((*patch).to_owned(), (*set).to_owned()));
        Restored { sessions: sessions.iter().map(view).collect(), active: active.collect(), ..Restored::default() }
    }

    fn number(record: Option<Record>) -> Option<u64> {
        match record? {
            Record::SessionDeleted { session, .. } => Some(session),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn sets_in_review_wait_for_the_operator_unless_a_later_session_made_the_active_one() {
        use SessionState::{Active, Discarded, Review};
        let sessions = [
            (1, "p", Review, Some("before")),
            (2, "q", Review, Some("other")),
            (3, "p", Active, Some("in use")),
            (4, "p", Review, Some("after")),
            (5, "p", Discarded, Some("gone")),
        ];
        let waits = restored(&sessions, &[("p", "in use")]);
        assert_eq!(to_be_judged(&waits), BTreeSet::from(["after", "other"]));
        let none_active = restored(&sessions, &[("r", "in use")]);
        assert_eq!(to_be_judged(&none_active), BTreeSet::from(["after", "before", "other"]));
        let itself = restored(&[(3, "p", Review, Some("in use"))], &[("p", "in use")]);
        assert_eq!(to_be_judged(&itself), BTreeSet::new());
    }

    #[test]
    fn a_limit_that_is_just_reached_is_kept_to() {
        use SessionState::Discarded;
        let two = restored(&[(1, "p", Discarded, None), (2, "p", Discarded, None)], &[]);
        let size = Size { samples: 100, bytes: 8_192 };
        let goes = |limits: Retention| number(session_to_go(&two, size, &limits));
        let all = Retention::default();
        for (most, goes_then) in [(99, Some(1)), (100, None), (101, None)] {
            assert_eq!(goes(Retention { samples: Some(most), ..all }), goes_then, "{most} samples");
            assert_eq!(goes(Retention { bytes: Some(most + 8_092), ..all }), goes_then, "{most} bytes less 8,092");
        }
        assert_eq!([1, 2].map(|most| goes(Retention { sessions: Some(most), ..all })), [Some(1), None]);
    }

    #[test]
    fn the_newest_session_of_each_patch_stays() {
        use SessionState::{Aborted, Active, Discarded, Interrupted, Review};
        let none = Retention { sessions: Some(0), ..Retention::default() };
        let goes = |sessions: &[Session], active: &[(&str, &str)]| {
            number(session_to_go(&restored(sessions, active), Size { samples: 0, bytes: 0 }, &none))
        };
        assert_eq!(goes(&[(1, "p", Discarded, None)], &[]), None);
        assert_eq!(goes(&[(1, "p", Discarded, None), (2, "q", Aborted, None), (3, "q", Aborted, None)], &[]), Some(2));
        for state in [Active, Review, Interrupted] {
            assert_eq!(goes(&[(1, "p", state, None), (2, "p", Discarded, None)], &[]), None, "{state:?}");
        }
        let sessions = [(1, "p", Discarded, Some("in use")), (2, "p", Discarded, None)];
        assert_eq!(goes(&sessions, &[("p", "in use")]), None);
        assert_eq!(goes(&sessions, &[("p", "another")]), Some(1));
    }

    #[test]
    fn a_deletion_has_the_time_of_the_clock_on_the_wall() {
        let (before, now) = (SystemTime::now(), wall_ns());
        let between = UNIX_EPOCH + std::time::Duration::from_nanos(now as u64);
        assert!((before..=SystemTime::now()).contains(&between), "{now}");
    }
}
