//! How much is kept: what is beyond it goes at a start and while the daemon runs, oldest first, and never what is in use.

use std::collections::BTreeSet;
use std::time::{SystemTime, UNIX_EPOCH};

use rusqlite::Connection;
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

/// What the database holds, as its own counts say.
pub(crate) fn size(connection: &Connection) -> rusqlite::Result<Size> {
    let number = |pragma: &str| connection.pragma_query_value(None, pragma, |row| row.get::<_, u64>(0));
    let samples = "SELECT coalesce(sum(rows), 0) FROM tally WHERE stream LIKE 'samples of session %'";
    let pages = number("page_count")?.saturating_sub(number("freelist_count")?);
    let samples = connection.query_row(samples, [], |row| row.get(0))?;
    Ok(Size { samples, bytes: pages * number("page_size")? })
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
