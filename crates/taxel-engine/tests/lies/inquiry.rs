//! Whether a lie comes from the fault that it is named after: the story is played again without it.
//!
//! Faults draw from random streams of their own, so that a story without one is the same but for what follows from it. Two
//! faults that last at the same time can't be told apart by what is seen, but by this: a fault is cleared of lies that are
//! told without it just the same, and of lies that need a zero that a board took by itself since the daemon's, which lasts.

use std::time::Duration;

use crate::house::Setting;
use crate::kinds::{Kind, Kinds};
use crate::story::{self, LyingSample, Outcome};
use crate::suspects::RETARES;

/// Without a fault that delays frames a sample comes earlier by as much.
const TOGETHER: Duration = Duration::from_millis(250);

/// Plays the story of this seed; its lies that are not argued are named after faults that they need.
pub fn play(setting: Setting, seed: u64) -> Outcome {
    let (mut cleared, mut lines) = (Kinds::default(), Vec::new());
    loop {
        let play = |without, cleared| story::play(setting, seed, without, cleared);
        let mut outcome = play(Kinds::default(), cleared);
        let cleared_of = |kind| Some((kind, clears(&play, &outcome, kind, cleared)?));
        let Some((kind, why)) = accused(&outcome).find_map(cleared_of) else {
            outcome.lines.splice(0..0, lines);
            return outcome;
        };
        lines.push(format!("   `{}` is cleared: {why}", kind.name()));
        cleared.insert(kind);
    }
}

/// The faults that lies are named after which are not argued, each once. What an operator did can't be left out of a story.
fn accused(outcome: &Outcome) -> impl Iterator<Item = Kind> + use<> {
    let named = outcome.lies.iter().filter(|lie| !lie.argued).filter_map(|lie| lie.from);
    named
        .filter(|kind| Kind::faults().contains(kind))
        .fold(Kinds::default(), |all, kind| all.or(Kinds::one(kind)))
        .iter()
}

/// Why the lies that are named after this fault and not argued do not come from it; `None` if they may. It is left out
/// together with those that are `cleared` already: of two that each suffice, one is to blame.
fn clears(play: &dyn Fn(Kinds, Kinds) -> Outcome, outcome: &Outcome, kind: Kind, cleared: Kinds) -> Option<String> {
    let lies: Vec<LyingSample> =
        outcome.lies.iter().filter(|lie| lie.from == Some(kind) && !lie.argued).copied().collect();
    let without = |kind: Kind| play(cleared.or(Kinds::one(kind)), Kinds::default());
    let told_by = |other: &Outcome| lies.iter().filter(|lie| other.lies.iter().any(|same| is_same(lie, same))).count();
    if told_by(&without(kind)) == lies.len() {
        return Some("the same lies are told without it".to_owned());
    }
    let at_it = |retare: Kind| lies.iter().all(|lie| lie.since_zero.has(retare));
    let needed = |retare: &Kind| *retare != kind && at_it(*retare) && told_by(&without(*retare)) == 0;
    RETARES.into_iter().find(needed).map(|retare| format!("none of its lies is told without `{}`", retare.name()))
}

/// Whether two stories tell the same lie: at the same time, the same way, by half as much at least.
fn is_same(lie: &LyingSample, other: &LyingSample) -> bool {
    let apart = lie.time.max(other.time).seconds_since(lie.time.min(other.time));
    apart <= TOGETHER.as_secs_f64()
        && lie.lie.too_little == other.lie.too_little
        && other.lie.excess_n >= 0.5 * lie.lie.excess_n
}
