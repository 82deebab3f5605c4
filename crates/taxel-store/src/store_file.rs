//! A store that no daemon has open, read where it lies: what is damaged stays as it is, for the next start to tell and to put
//! right.

use std::path::{Path, PathBuf};

use taxel_engine::Restored;
use taxel_engine::calibration::SessionSamples;

use crate::db::Db;
use crate::error::{Quarantined, StoreError};
use crate::lock::{idle, refuse_in_use, unless_in_use};
use crate::loss;
use crate::retention::Size;
use crate::session_samples::samples_of;

/// The sessions and model sets of a store.
pub struct StoreFile {
    path: PathBuf,
    db: Db,
    restored: Restored,
    damage: Vec<Quarantined>,
}

impl StoreFile {
    /// Reads it and proves all of it but the samples of sessions that nobody is likely to go on with: those are proven as they
    /// are read. Nothing is changed.
    ///
    /// # Errors
    /// [`StoreError`] if there is no store, a daemon has it, it is not one of ours or an earlier version's, or its structure is
    /// broken. Single rows that are damaged are [`StoreFile::damage`].
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        let path = &idle(path)?;
        Self::read(path, path, Some(StoreError::TooOld { path: path.clone() }), &mut Vec::new())
    }

    /// Reads the store at `path` in this `database`: itself, or a copy of it, which may be changed unless there is a `failure`.
    /// What was lost is also in `lost`, if reading fails then.
    pub(crate) fn read(
        path: &Path,
        database: &Path,
        failure: Option<StoreError>,
        lost: &mut Vec<Quarantined>,
    ) -> Result<Self, StoreError> {
        *lost = loss::found(path)
            .map_err(|error| StoreError::Open { path: path.to_path_buf(), reason: error.to_string() })?;
        let mut damage = lost.clone();
        let read = || {
            let (db, mut restored) = Db::open_file(database, true, failure, &mut damage)?;
            db.read_active(path, &mut restored, &mut damage)?;
            Ok((db, restored))
        };
        let (db, restored) = read().map_err(|error| unless_in_use(path, error))?;
        if !damage.is_empty() {
            refuse_in_use(path)?;
        }
        Ok(Self { path: path.to_path_buf(), db, restored, damage })
    }

    /// What a start would begin with. Of its model sets some have their summary alone.
    #[must_use]
    pub const fn restored(&self) -> &Restored {
        &self.restored
    }

    /// What is damaged or lost, and left out.
    #[must_use]
    pub fn damage(&self) -> &[Quarantined] {
        &self.damage
    }

    /// The samples of a session, in the order in which they were written.
    ///
    /// # Errors
    /// [`StoreError::DamagedSamples`] if they are not what was written, and [`StoreError::InUse`] if a daemon has the store now.
    pub fn samples(&self, session: u64) -> Result<SessionSamples, StoreError> {
        let damaged = |findings| StoreError::DamagedSamples { session, findings };
        self.db.samples(session).map_err(|findings| unless_in_use(&self.path, damaged(findings)))
    }

    /// The text of a model set as it was written, MODELS.json.
    ///
    /// # Errors
    /// [`StoreError`] if there is no such set, or it is not what was written, or a daemon has the store now.
    pub fn model_set(&self, id: &str) -> Result<String, StoreError> {
        self.db.set_text(id).map_err(|error| unless_in_use(&self.path, error))
    }

    /// Proves the samples of all sessions, as well of those that nobody goes on with. Gives all that is damaged or lost then, and
    /// how much there is.
    pub(crate) fn prove_all(mut self) -> Result<(Restored, Size, Vec<Quarantined>), StoreError> {
        for view in &self.restored.sessions {
            let Err(reason) = self.db.prove_samples(view.number) else { continue };
            let found = Quarantined::new(samples_of(view.number), reason);
            if !self.damage.contains(&found) {
                self.damage.push(found);
            }
        }
        let size = self.db.size().map_err(|error| unless_in_use(&self.path, error))?;
        if !self.damage.is_empty() {
            refuse_in_use(&self.path)?;
        }
        Ok((self.restored, size, self.damage))
    }
}
