//! A store is opened: what is damaged is kept aside, and what can be read is served also where nothing can be written.

use std::io;
use std::path::Path;

use rusqlite::Connection;
use taxel_engine::Restored;

use crate::db::connect::connect;
use crate::db::{Db, Opened, fold_back};
use crate::error::{Quarantined, StoreError, lines};
use crate::held_files::HeldFiles;
use crate::identity::{check_identity, check_log, check_structure, is_damage};
use crate::lock::StoreLock;
use crate::loss::LOG;
use crate::prepare::{bring_up_to_date, give_back_space, space_to_give_back, use_log};
use crate::restore::Found;
use crate::retention::Retention;
use crate::salvage::{self, Salvaged};
use crate::tally::Stream;
use crate::{beside, loss, restore, sets, tally, wal_check};

/// How findings name the file as a whole.
const STORE: &str = "the store";

/// A file up to this size is proven whole at a start, which takes some ten milliseconds. It is that of a robot with ten
/// calibrations; a larger one is proven while the daemon runs.
const WHOLE_BYTES_MAX: u64 = 8 << 20;

/// How a start looks at a file.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Look {
    /// What is large is proven later.
    Quick,
    /// All of it is proven.
    Whole,
    /// The same of what has just been made of a damaged one.
    PutRight,
}

impl Db {
    /// As [`Db::open_keeping`], and deletes nothing.
    #[cfg(any(test, feature = "fixtures"))]
    pub(crate) fn open(path: &Path) -> Result<(Self, Restored, Vec<Quarantined>), StoreError> {
        Self::open_keeping(path, &Retention::default())
    }

    /// Opens or creates the file and reads what a start needs. A file that is damaged is kept aside, and what can be read of
    /// it goes on in a new one. A small file is proven whole, and so is one that was found damaged while it was open; of
    /// another one the rest is proven by [`Db::prove_next`]. What is beyond the limits is deleted.
    pub(crate) fn open_keeping(
        path: &Path,
        limits: &Retention,
    ) -> Result<(Self, Restored, Vec<Quarantined>), StoreError> {
        Self::open_proving(path, limits, WHOLE_BYTES_MAX)
    }

    /// As [`Db::open_keeping`], with the size up to which a file is proven whole.
    pub(crate) fn open_proving(
        path: &Path,
        limits: &Retention,
        whole_bytes_max: u64,
    ) -> Result<(Self, Restored, Vec<Quarantined>), StoreError> {
        let path = &beside::real(path);
        // Without it another process may have the store: what is beside the database is only read.
        let (lock, failure) = match StoreLock::take(path) {
            Ok(lock) => (Some(lock), None),
            Err(error @ StoreError::InUse { .. }) => return Err(error),
            Err(error) => (None, Some(error)),
        };
        let without_lock = failure.clone();
        let mut quarantined = loss::noted(path);
        let mut lost = !quarantined.is_empty();
        let opened = Self::open_or_mend(path, failure, limits, whole_bytes_max, &mut lost, &mut quarantined);
        let (mut db, mut restored) = opened.or_else(|error| match error {
            error if error.is_of_changing() || matches!(error, StoreError::Damaged { .. }) => {
                Self::of_plain_file(path, error, &mut quarantined)
            }
            // There is none, and the disk takes no new one, nor a lock for it.
            error @ StoreError::Open { .. } if !path.exists() => {
                Self::of_plain_file(path, without_lock.unwrap_or(error), &mut quarantined)
            }
            other => Err(other),
        })?;
        db.lock = lock;
        for damage in &quarantined {
            tracing::error!(store = %path.display(), "{damage}");
        }
        if db.failure.is_none() {
            loss::forget(path);
        }
        restored.problems = lines(&quarantined);
        Ok((db, restored, quarantined))
    }

    /// Opens the file; one that shows to be damaged where it was not looked at whole is looked at again, whole.
    fn open_or_mend(
        path: &Path,
        failure: Option<StoreError>,
        limits: &Retention,
        whole_bytes_max: u64,
        lost: &mut bool,
        quarantined: &mut Vec<Quarantined>,
    ) -> Result<(Self, Restored), StoreError> {
        let succeeded =
            failure.map_or_else(|| salvage::succeed(path).map_err(|error| StoreError::changing(path, &error)), Err);
        let failure = succeeded.map(|told| quarantined.extend(told)).err();
        let whole = beside::bytes(path) <= whole_bytes_max || beside::doubt_mark(path).exists();
        let opened = match Self::open_once(path, failure.clone(), whole, limits, lost, quarantined) {
            // Of these kinds are errors that come after the tables of a file were read that was not proven: it may be
            // damaged in a place that only deleting reads. Proven whole it is mended, and does not fail each start.
            Err(error @ (StoreError::Corrupt(_) | StoreError::Unstorable { .. })) if !whole => {
                tracing::error!(store = %path.display(), %error, "the store is looked at whole");
                if failure.is_none() {
                    beside::mark_doubt(path);
                }
                let mut again = Vec::new();
                let opened = Self::open_once(path, failure, true, limits, lost, &mut again);
                again.retain(|finding| !quarantined.contains(finding));
                quarantined.append(&mut again);
                opened
            }
            opened => opened,
        };
        opened.map_err(|error| match error {
            StoreError::Corrupt(findings) => StoreError::Damaged { path: path.to_path_buf(), findings },
            other => other,
        })
    }

    fn open_once(
        path: &Path,
        failure: Option<StoreError>,
        whole: bool,
        limits: &Retention,
        lost: &mut bool,
        quarantined: &mut Vec<Quarantined>,
    ) -> Result<(Self, Restored), StoreError> {
        let failure = clear_the_way(path, failure, quarantined);
        let failure = look_at_log(path, failure, lost, quarantined)?;
        let known = quarantined.len();
        let look = if whole { Look::Whole } else { Look::Quick };
        let (db, restored) = match Self::start(path, look, failure.clone(), limits, lost, quarantined) {
            Err(error) if is_damage(&error, path) || (whole && matches!(error, StoreError::Corrupt(_))) => {
                quarantined.truncate(known); // it is all found again
                quarantined.push(put_right(path, &error, failure)?);
                Self::start(path, Look::PutRight, None, limits, lost, quarantined)?
            }
            started => started?,
        };
        let doubt = beside::doubt_mark(path);
        if whole
            && db.failure.is_none()
            && doubt.exists()
            && let Err(error) = beside::remove(&doubt)
        {
            // The next start looks at all of it once more.
            tracing::warn!(mark = %doubt.display(), %error, "a mark could not be removed");
        }
        Ok((db, restored))
    }

    /// Opens a file that can be read, and does with it what a start does.
    fn start(
        path: &Path,
        look: Look,
        failure: Option<StoreError>,
        limits: &Retention,
        lost: &mut bool,
        quarantined: &mut Vec<Quarantined>,
    ) -> Result<(Self, Restored), StoreError> {
        let known = quarantined.len();
        let (mut db, mut restored) = Self::open_file(path, look != Look::Quick, failure, quarantined)?;
        let missing = Quarantined::losses(&quarantined[known..]);
        *lost |= look == Look::PutRight && !tally::is_recorded(&db.connection, Stream::BoardZeros)?;
        // The log was folded back: what is written from here on is known to be in it.
        db.attempt(|db| db.mark_open(path))?;
        db.attempt(|db| {
            let page_bytes = db.connection.pragma_query_value(None, "page_size", |row| row.get(0))?;
            db.held = Some(HeldFiles::of(path, page_bytes)?);
            Ok(())
        })?;
        db.restore_active(path, &mut restored, lost, quarantined)?;
        db.restore_board_zeros(&mut restored, *lost, &missing)?;
        db.attempt(|db| db.retain(&mut restored, limits))?;
        Ok((db, restored))
    }

    /// Opens a file that can be read, and finds rows that are not what was written: all of them if it proves the `whole`.
    /// After a `failure` nothing is changed.
    pub(crate) fn open_file(
        path: &Path,
        whole: bool,
        failure: Option<StoreError>,
        quarantined: &mut Vec<Quarantined>,
    ) -> Result<(Self, Restored), StoreError> {
        let opening = |error: rusqlite::Error| StoreError::opening(path, &error);
        let (connection, failure) = connect(path, failure)?;
        check_identity(&connection, path)?;
        let (connection, failure) = changed(path, (connection, failure), |connection| use_log(connection, path))?;
        check_log(&connection, path)?;
        // Rewriting a damaged file could lose what salvaging it would find.
        if whole || space_to_give_back(&connection).map_err(opening)?.is_some() {
            check_structure(&connection, path)?;
        }
        // Before anything is written: what comes over the end of the log that a power cut tore would look like a second one.
        let (mut connection, failure) =
            changed(path, (connection, failure), |connection| fold_back(connection, Some(path)))?;
        bring_up_to_date(&mut connection).map_err(|error| failure.clone().unwrap_or_else(|| opening(error)))?;
        let mut damaged_rows = Vec::new();
        let Found { restored, rows_of_sets, unproven, texts_read, to_index } =
            restore::read(&connection, whole, &mut damaged_rows).map_err(opening)?;
        let (sets, sessions) = (restored.model_sets.len(), restored.sessions.len());
        tracing::debug!(model_sets = sets, sessions, texts_read, whole, "the store was read");
        let opened = Opened { rows_of_sets, unproven, texts_read, failure };
        let mut db = Self::new(connection, Some(path.to_path_buf()), Some(opened));
        db.attempt(|db| sets::complete_index(&db.connection, &to_index).map_err(opening))?;
        db.attempt(|db| give_back_space(&db.connection, path).map_err(opening))?;
        // What an earlier run deleted may still be in the log if it was killed then.
        db.attempt(|db| db.checkpoint())?;
        quarantined.append(&mut damaged_rows);
        Ok((db, restored))
    }
}

/// A change of a file that is open, unless another has failed before. Where the disk takes nothing, the file is opened where it
/// lies.
fn changed(
    path: &Path,
    (connection, failure): (Connection, Option<StoreError>),
    change: impl FnOnce(&Connection) -> Result<(), StoreError>,
) -> Result<(Connection, Option<StoreError>), StoreError> {
    if failure.is_some() {
        return Ok((connection, failure));
    }
    match change(&connection) {
        Err(error) if error.is_of_changing() => {
            drop(connection);
            connect(path, Some(error))
        }
        changed => changed.map(|()| (connection, None)),
    }
}

/// Puts aside what is no file and has the name of a log or journal: why that failed, if it did. After a `failure` nothing is
/// changed.
fn clear_the_way(path: &Path, failure: Option<StoreError>, quarantined: &mut Vec<Quarantined>) -> Option<StoreError> {
    let put_aside = || beside::put_aside_no_files(path).map_err(|error| StoreError::changing(path, &error));
    let (put_aside, failure) = match failure.map_or_else(put_aside, Err) {
        Ok(put_aside) => (put_aside, None),
        Err(failure) => (Vec::new(), Some(failure)),
    };
    for (what, aside) in put_aside {
        let reason = format!("it is no regular file and in the way: it is kept as {}", aside.display());
        quarantined.push(Quarantined::lost(what.display().to_string(), reason));
    }
    failure
}

/// Looks for what the log lost. Before anything is changed, the log is kept and the loss is noted: why that failed, if it did.
/// After a `failure` nothing is changed.
fn look_at_log(
    path: &Path,
    failure: Option<StoreError>,
    lost: &mut bool,
    quarantined: &mut Vec<Quarantined>,
) -> Result<Option<StoreError>, StoreError> {
    let reading = |error: io::Error| StoreError::Open { path: path.to_path_buf(), reason: error.to_string() };
    let Some(reason) = wal_check::problem(path).map_err(reading)? else { return Ok(failure) };
    *lost = true;
    // What an earlier start noted of the log is this loss: since then nobody was told that anything is on disk.
    let noted = quarantined.iter().position(|known| known.what == LOG).map(|at| quarantined.remove(at).reason);
    let reason = noted.unwrap_or(reason);
    let keep = || loss::note(path, &Quarantined::lost(LOG, &reason)).and_then(|()| beside::keep_log(path));
    let (kept, failure) = match failure.map_or_else(|| Ok(keep()), Err) {
        Ok(Ok(aside)) => (aside.map(|aside| format!("; it is kept as {}", aside.display())), None),
        Ok(Err(error)) => (None, Some(StoreError::changing(&beside::wal(path), &error))),
        Err(failure) => (None, Some(failure)),
    };
    quarantined.push(Quarantined::lost(LOG, format!("{reason}{}", kept.unwrap_or_default())));
    Ok(failure)
}

/// Puts a new file with what can be read in the place of a damaged one; what there is to tell of it.
///
/// # Errors
/// What is wrong with it and why it stays as it is.
fn put_right(path: &Path, error: &StoreError, failure: Option<StoreError>) -> Result<Quarantined, StoreError> {
    let findings = match error {
        StoreError::Damaged { findings, .. } => findings.clone(),
        other => other.to_string(),
    };
    let stays = |why: String| {
        let findings = format!("{findings}, and nothing can be put in its place: {why}");
        StoreError::Damaged { path: path.to_path_buf(), findings }
    };
    if let Some(failure) = failure {
        return Err(stays(failure.to_string()));
    }
    let stopped = format!("{findings}; what can be read of it went into a new one, by a start that was stopped then");
    loss::note(path, &Quarantined::lost(STORE, stopped)).map_err(|error| stays(error.to_string()))?;
    let Salvaged { aside, rows } = salvage::salvage(path).map_err(stays)?;
    let reason = format!("{findings}; it is kept as {}, {rows} rows of it are in a new one", aside.display());
    Ok(Quarantined::lost(STORE, reason))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::fixture::filled;

    #[test]
    fn a_file_that_cannot_be_changed_is_read_where_it_lies_and_a_damaged_one_is_not_taken_for_that() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("store.db");
        filled(&path);
        let opened = |failure| (Connection::open(&path).unwrap(), failure);
        let is_read_only = |connection: Connection| connection.is_readonly("main").unwrap();
        let (connection, failure) = changed(&path, opened(None), |_| Ok(())).unwrap();
        assert_eq!((is_read_only(connection), failure), (false, None));
        let full = StoreError::changing(&path, &io::ErrorKind::StorageFull.into());
        let (connection, failure) = changed(&path, opened(None), |_| Err(full.clone())).unwrap();
        assert_eq!((is_read_only(connection), failure), (true, Some(full.clone())));
        let (_, failure) = changed(&path, opened(Some(full.clone())), |_| unreachable!()).unwrap();
        assert_eq!(failure, Some(full));
        let damage = StoreError::Corrupt("a page".to_owned());
        assert_eq!(changed(&path, opened(None), |_| Err(damage.clone())).err(), Some(damage));
    }
}
