//! Which session goes next where more is stored than is to be kept: never one that is in use.

use std::collections::BTreeSet;

use taxel_engine::calibration::SessionState;
use taxel_engine::catalogue::Catalogue;
use taxel_engine::known_set::KnownSet;

/// The oldest session that may go: never the newest of a patch, nor one whose models are in use or that waits for the operator's
/// word.
#[must_use]
pub fn session_to_go(stored: &Catalogue) -> Option<u64> {
    let mut patches = BTreeSet::new();
    let newest: BTreeSet<u64> =
        stored.sessions.iter().rev().filter(|view| patches.insert(&view.patch)).map(|view| view.number).collect();
    let may_go = stored.sessions.iter().find(|view| {
        !newest.contains(&view.number)
            && !in_use(stored, view.model_set.as_deref())
            && !matches!(view.state, SessionState::Active | SessionState::Review | SessionState::Interrupted)
    });
    may_go.map(|view| view.number)
}

/// Whether a set is active, or the one that is was made of it by known loads.
fn in_use(stored: &Catalogue, set: Option<&str>) -> bool {
    let sets = &stored.model_sets;
    let comes_of_it = |active: &KnownSet| active.origins.iter().any(|of| Some(of.as_str()) == set);
    let uses = |active: &str| Some(active) == set || sets.iter().filter(|known| known.id == active).any(comes_of_it);
    stored.active.iter().filter_map(|(_, active)| active.as_deref()).any(uses)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use taxel_engine::calibration::SessionView;

    /// A session of patch `p` or another, and its model set.
    type Session = (u64, &'static str, SessionState, Option<&'static str>);

    #[test]
    fn the_oldest_session_goes_but_not_the_newest_of_a_patch_nor_one_in_use() {
        use SessionState::{Aborted, Active, Discarded, Interrupted, Review};
        let goes = |sessions: &[Session], active: &[(&str, &str)]| {
            let view = |&(number, patch, state, set): &Session| {
                let (patch, model_set) = (patch.to_owned(), set.map(Into::into));
                Arc::new(SessionView { number, patch, state, model_set, ..SessionView::default() })
            };
            let active = active.iter().map(|(patch, set)| ((*patch).to_owned(), Some((*set).to_owned()))).collect();
            session_to_go(&Catalogue { sessions: sessions.iter().map(view).collect(), active, ..Catalogue::default() })
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
}
