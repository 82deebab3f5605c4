//! A store that no daemon has open, read where it lies: what is damaged stays as it is, for the next start to tell and to put
//! right.

use std::path::Path;

use taxel_engine::Restored;
use taxel_engine::calibration::SessionSamples;

use crate::db::Db;
use crate::error::{Quarantined, StoreError};
use crate::maintenance::idle;
use crate::{loss, wal_check};

/// The sessions and model sets of a store.
pub struct StoreFile {
    db: Db,
    restored: Restored,
    damage: Vec<Quarantined>,
}

impl StoreFile {
    /// Reads and proves all of it. Nothing is changed.
    ///
    /// # Errors
    /// [`StoreError`] if there is no store, a daemon has it, it is not one of ours or an earlier version's, or its structure is
    /// broken. Single rows that are damaged are [`StoreFile::damage`].
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        let path = &idle(path)?;
        let opening = |reason: String| StoreError::Open { path: path.clone(), reason };
        let mut damage = loss::noted(path);
        let lost = wal_check::problem(path).map_err(|error| opening(error.to_string()))?;
        damage.extend(lost.map(|reason| Quarantined::lost("the write-ahead log", reason)));
        let older = "an earlier version of this program wrote it, and here it is only read: start the daemon or run `taxeld \
                     store compact` first";
        let (db, mut restored) = Db::open_file(path, true, Some(opening(older.to_owned())), &mut damage)?;
        db.read_active(path, &mut restored, &mut damage)?;
        Ok(Self { db, restored, damage })
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
    /// [`StoreError::DamagedSamples`] if they are not what was written.
    pub fn samples(&self, session: u64) -> Result<SessionSamples, StoreError> {
        self.db.samples(session).map_err(|findings| StoreError::DamagedSamples { session, findings })
    }

    /// The text of a model set as it was written, MODELS.json.
    ///
    /// # Errors
    /// [`StoreError`] if there is no such set, or it is not what was written.
    pub fn model_set(&self, id: &str) -> Result<String, StoreError> {
        self.db.set_text(id)
    }
}
