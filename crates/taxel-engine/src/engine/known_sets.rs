//! Every model set that is stored, and which of them are in memory.

use std::collections::VecDeque;
use std::sync::Arc;

use crate::known_set::{KnownSet, SetSummary};
use crate::model_set::ModelSet;

/// Sets that stay in memory although no patch uses them: those that were made, imported or in use last are the ones that an
/// operator activates next. A set of the forearm takes about a megabyte.
pub const SETS_AT_HAND_MAX: usize = 4;

/// The list of sets, oldest first.
#[derive(Debug, Default)]
pub struct KnownSets {
    all: Vec<KnownSet>,
    /// Ids of those that are in memory beside those in use, the one that came last at the end.
    at_hand: VecDeque<String>,
}

impl KnownSets {
    /// These, of which those in memory are in use.
    #[must_use]
    pub const fn new(all: Vec<KnownSet>) -> Self {
        Self { all, at_hand: VecDeque::new() }
    }

    /// All of them, oldest first.
    #[must_use]
    pub fn all(&self) -> &[KnownSet] {
        &self.all
    }

    /// How many there are.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.all.len()
    }

    /// The set of this id.
    #[must_use]
    pub fn get(&self, id: &str) -> Option<&KnownSet> {
        self.all.iter().find(|known| known.id == id)
    }

    /// A set is stored; one that is known already stays as it is.
    pub fn learn(&mut self, set: Arc<ModelSet>, in_use: impl Fn(&str) -> bool) {
        if self.get(&set.id).is_none() {
            self.all.push(KnownSet::from(Arc::clone(&set)));
        }
        self.keep_at_hand(&set, in_use);
    }

    /// A set that is known was in use or is about to be: it stays in memory for a while, and others go.
    pub fn keep_at_hand(&mut self, set: &Arc<ModelSet>, in_use: impl Fn(&str) -> bool) {
        let Some(known) = self.all.iter_mut().find(|known| known.id == set.id) else { return };
        // Two sets with the same id may differ in when and in which session they were made. The one that is stored counts.
        if SetSummary::of(set) != *known.summary() {
            return;
        }
        known.at_hand.get_or_insert_with(|| Arc::clone(set));
        self.at_hand.retain(|id| *id != set.id);
        self.at_hand.push_back(set.id.clone());
        let free = |id: &String| !in_use(id);
        while self.at_hand.iter().filter(|id| free(id)).count() > SETS_AT_HAND_MAX {
            let Some(oldest) = self.at_hand.iter().position(free) else { break };
            let Some(id) = self.at_hand.remove(oldest) else { break };
            if let Some(known) = self.all.iter_mut().find(|known| known.id == id) {
                known.at_hand = None;
            }
        }
    }

    /// A set is not stored any more.
    pub fn forget(&mut self, id: &str) {
        self.all.retain(|known| known.id != id);
        self.at_hand.retain(|kept| kept != id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(created_wall_ns: i64) -> Arc<ModelSet> {
        Arc::new(ModelSet {
            id: "m-1".to_owned(),
            patch: "left_forearm".to_owned(),
            created_wall_ns,
            session: None,
            method: String::new(),
            board_settings: Vec::new(),
            baseline: Vec::new(),
            pressure_max_kpa: 70.0,
            gauge_gain_rel: 0.0,
            gauge_offset_kpa: 0.0,
            taxels: Vec::new(),
            recorded: None,
            recalibrated: None,
            maker: crate::model_set::Maker::default(),
        })
    }

    #[test]
    fn what_is_at_hand_is_the_set_that_is_stored() {
        let mut sets = KnownSets::new(vec![KnownSet::stored(SetSummary::of(&set(1)))]);
        sets.learn(set(2), |_| false);
        assert!(sets.all()[0].at_hand.is_none(), "it was made at another time than the list says");
        sets.learn(set(1), |_| false);
        assert_eq!(sets.all()[0].at_hand.as_ref().map(|set| set.created_wall_ns), Some(1));
    }

    fn named(id: &str) -> Arc<ModelSet> {
        Arc::new(ModelSet { id: id.to_owned(), ..ModelSet::clone(&set(1)) })
    }

    fn at_hand(sets: &KnownSets) -> Vec<&str> {
        sets.all().iter().filter(|known| known.at_hand.is_some()).map(|known| known.id.as_str()).collect()
    }

    #[test]
    fn the_last_four_and_those_in_use_are_at_hand() {
        let mut sets = KnownSets::default();
        let in_use = |id: &str| id == "m-b";
        for id in ["m-a", "m-b", "m-c", "m-d", "m-e"] {
            sets.learn(named(id), in_use);
        }
        assert_eq!((sets.len(), at_hand(&sets)), (5, vec!["m-a", "m-b", "m-c", "m-d", "m-e"]));
        // What comes again is the last; what is not known does not come.
        sets.keep_at_hand(&named("m-a"), in_use);
        sets.keep_at_hand(&named("m-x"), in_use);
        sets.learn(named("m-f"), in_use);
        assert_eq!(at_hand(&sets), ["m-a", "m-b", "m-d", "m-e", "m-f"]);
        // Once it is not in use it is the oldest.
        sets.learn(named("m-g"), |_| false);
        assert_eq!(at_hand(&sets), ["m-a", "m-e", "m-f", "m-g"]);
        sets.keep_at_hand(&named("m-c"), |_| false);
        assert_eq!(at_hand(&sets), ["m-a", "m-c", "m-f", "m-g"]);
        assert!(sets.get("m-b").is_some() && sets.get("m-x").is_none());
        sets.forget("m-g");
        assert_eq!((sets.len(), at_hand(&sets)), (6, vec!["m-a", "m-c", "m-f"]));
        sets.learn(named("m-h"), |_| false);
        assert_eq!(at_hand(&sets), ["m-a", "m-c", "m-f", "m-h"], "what is forgotten takes no room");
        sets.learn(named("m-i"), |_| false);
        assert_eq!(at_hand(&sets), ["m-c", "m-f", "m-h", "m-i"], "and the others still make room");
    }
}
