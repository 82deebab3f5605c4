//! A store is opened: what is damaged is kept aside, and the active model sets are there whatever became of the database.

use std::path::Path;
use std::sync::Arc;
use std::{fs, io};

use rusqlite::Connection;
use rusqlite::config::DbConfig;
use taxel_engine::Restored;
use taxel_engine::model_set::ModelSet;
use taxel_engine::record::Record;

use crate::append::Appender;
use crate::db::Db;
use crate::error::{Quarantined, StoreError, lines};
use crate::identity::{check_identity, check_structure, is_damage};
use crate::models_json;
use crate::prepare::{bring_up_to_date, configure, give_back_space, space_to_give_back};
use crate::restore::Found;
use crate::retention::Retention;
use crate::salvage::{self, Salvaged};
use crate::{active_file, beside, restore, wal_check};

/// How findings name the write-ahead log.
const LOG: &str = "the write-ahead log";

/// A file up to this size is proven whole at a start, which takes some ten milliseconds. It is that of a robot with ten
/// calibrations; a larger one is proven while the daemon runs.
const WHOLE_BYTES_MAX: u64 = 8 << 20;

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
        salvage::succeed(path)
            .map_err(|error| StoreError::Open { path: path.to_path_buf(), reason: error.to_string() })?;
        let whole = bytes_of(path) <= whole_bytes_max || beside::doubt_mark(path).exists();
        let mut quarantined = Vec::new();
        let opened = match Self::open_once(path, whole, limits, &mut quarantined) {
            // Of these kinds are errors that come after the tables of a file were read that was not proven: it may be
            // damaged in a place that only deleting reads. Proven whole it is mended, and does not fail each start.
            Err(error @ (StoreError::Corrupt(_) | StoreError::Io(_) | StoreError::Unstorable { .. })) if !whole => {
                tracing::error!(store = %path.display(), %error, "the store is looked at whole");
                beside::mark_doubt(path);
                let mut again = Vec::new();
                let opened = Self::open_once(path, true, limits, &mut again);
                again.retain(|finding| !quarantined.contains(finding));
                quarantined.append(&mut again);
                opened
            }
            opened => opened,
        };
        let (db, mut restored) = opened.map_err(|error| match error {
            StoreError::Corrupt(findings) => StoreError::Damaged { path: path.to_path_buf(), findings },
            other => other,
        })?;
        restored.problems = lines(&quarantined);
        Ok((db, restored, quarantined))
    }

    fn open_once(
        path: &Path,
        whole: bool,
        limits: &Retention,
        quarantined: &mut Vec<Quarantined>,
    ) -> Result<(Self, Restored), StoreError> {
        let io = |error: io::Error| StoreError::Open { path: path.to_path_buf(), reason: error.to_string() };
        if let Some(reason) = wal_check::problem(path).map_err(io)? {
            let aside = beside::keep_log(path).map_err(io)?;
            let kept = aside.map(|aside| format!("; it is kept as {}", aside.display())).unwrap_or_default();
            let reason = format!("{reason}{kept}");
            quarantined.push(Quarantined::new(LOG, reason));
        }
        let (mut db, mut restored) = match Self::open_file(path, whole, quarantined) {
            Err(error) if is_damage(&error, path) => {
                let reason = match salvage::salvage(path) {
                    Ok(Salvaged { aside, rows }) => {
                        format!("{error}; it is kept as {}, {rows} rows of it are in a new one", aside.display())
                    }
                    Err(why) => return Err(StoreError::Damaged { path: path.to_path_buf(), findings: why }),
                };
                quarantined.push(Quarantined::new("the store", reason));
                Self::open_file(path, true, quarantined)?
            }
            opened => opened?,
        };
        if let Err(error) = db.restore_active(path, &mut restored, quarantined) {
            db.abandon();
            return Err(error);
        }
        if let Err(error) = beside::replace(&beside::open_mark(path), &[]) {
            // It may be there all the same, and must not be left without the log that it stands for.
            let _ = db.close();
            return Err(io(error));
        }
        if let Err(error) = db.retain(&mut restored, limits) {
            db.abandon();
            return Err(error);
        }
        let doubt = beside::doubt_mark(path);
        if whole
            && doubt.exists()
            && let Err(error) = beside::remove(&doubt)
        {
            // The next start looks at all of it once more.
            tracing::warn!(mark = %doubt.display(), %error, "a mark could not be removed");
        }
        Ok((db, restored))
    }

    /// Opens a file that can be read, and finds rows that are not what was written: all of them if it proves the `whole`.
    pub(crate) fn open_file(
        path: &Path,
        whole: bool,
        quarantined: &mut Vec<Quarantined>,
    ) -> Result<(Self, Restored), StoreError> {
        let opening = |error: rusqlite::Error| StoreError::opening(path, &error);
        let mut connection = Connection::open(path).map_err(opening)?;
        // Until all is known to be well, nothing of it is changed.
        connection.set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, true).map_err(opening)?;
        configure(&connection).map_err(opening)?;
        check_identity(&connection, path)?;
        let mode: String =
            connection.pragma_update_and_check(None, "journal_mode", "wal", |row| row.get(0)).map_err(opening)?;
        if mode != "wal" {
            let reason = format!("its file system has no write-ahead log (journal mode is `{mode}`)");
            return Err(StoreError::Open { path: path.to_path_buf(), reason });
        }
        // Rewriting a damaged file could lose what salvaging it would find.
        if whole || space_to_give_back(&connection).map_err(opening)?.is_some() {
            check_structure(&connection, path)?;
        }
        bring_up_to_date(&mut connection).map_err(opening)?;
        give_back_space(&connection, path).map_err(opening)?;
        let mut damaged_rows = Vec::new();
        let Found { restored, rows_of_sets, unproven, texts_read } =
            restore::read(&connection, whole, &mut damaged_rows).map_err(opening)?;
        connection.set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, false).map_err(opening)?;
        let (sets, sessions) = (restored.model_sets.len(), restored.sessions.len());
        tracing::debug!(model_sets = sets, sessions, texts_read, whole, "the store was read");
        let db = Self {
            connection,
            path: Some(path.to_path_buf()),
            appender: Appender::new(rows_of_sets),
            erasing: false,
            activated: false,
            unproven,
            #[cfg(test)]
            texts_read,
        };
        // What an earlier run deleted may still be in the log if it was killed then.
        db.checkpoint().map_err(|error| StoreError::Open { path: path.to_path_buf(), reason: error.to_string() })?;
        quarantined.append(&mut damaged_rows);
        Ok((db, restored))
    }

    /// Brings the plain file of the active model sets in step with the database, or takes from it what the database lost.
    fn restore_active(
        &mut self,
        path: &Path,
        restored: &mut Restored,
        quarantined: &mut Vec<Quarantined>,
    ) -> Result<(), StoreError> {
        let newest = restore::newest_activation(&self.connection)?;
        let lacks = |restored: &Restored, patch: &str| restored.active.iter().all(|(known, _)| known != patch);
        let file = match active_file::read(path) {
            Some(Ok(file)) => Some(file),
            Some(Err(reason)) => {
                quarantined.push(Quarantined::new("the file of the active model sets", reason));
                None
            }
            None => None,
        };
        // An older file is that of a stop before it could be written: the database goes on.
        if let Some(file) = file.filter(|file| file.activation > newest || !quarantined.is_empty()) {
            if file.activation > newest {
                let reason = format!("its newest one is {newest}, the file beside the store has {}", file.activation);
                quarantined.push(Quarantined::new("the list of activations", reason));
                restored.active.clear();
            }
            for (id, text) in file.sets.into_iter().filter(|_| file.activation >= newest) {
                let set = match models_json::from_json(&text) {
                    Ok(set) if set.id == id => Arc::new(set),
                    Ok(set) => {
                        let reason = format!("it names `{id}`, its content is {}", set.id);
                        quarantined.push(Quarantined::new("the file of the active model sets", reason));
                        continue;
                    }
                    Err(error) => {
                        quarantined.push(Quarantined::new("the file of the active model sets", error));
                        continue;
                    }
                };
                if lacks(restored, &set.patch) && !restore::was_deleted(&self.connection, &set.id, file.activation)? {
                    self.take_back(&set, restored)?;
                    let what = format!("the activation of model set {} in the store", set.id);
                    quarantined.push(Quarantined::new(what, "it is served from the plain file beside it"));
                }
            }
        }
        self.activated = true;
        self.keep_active();
        Ok(())
    }

    /// Makes a model set active that the database lost.
    fn take_back(&mut self, set: &Arc<ModelSet>, restored: &mut Restored) -> Result<(), StoreError> {
        let (patch, model_set) = (set.patch.clone(), set.id.clone());
        let activated = Record::Activated { patch: patch.clone(), model_set: model_set.clone(), wall_ns: 0 };
        self.write([Record::ModelSet(Arc::clone(set)), activated].iter())?;
        match restored.model_sets.iter_mut().find(|known| known.id == model_set) {
            Some(known) => known.at_hand = Some(Arc::clone(set)),
            None => restored.model_sets.push(Arc::clone(set).into()),
        }
        restored.active.push((patch, model_set));
        Ok(())
    }
}

/// Bytes of a database and its log.
fn bytes_of(path: &Path) -> u64 {
    let bytes = |file: &Path| fs::metadata(file).map_or(0, |file| file.len());
    bytes(path) + bytes(&beside::wal(path))
}
