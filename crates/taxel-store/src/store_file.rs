//! A store that no daemon has open, read where it lies: what is damaged stays as it is, for the next start to tell and to put
//! right.

use std::path::{Path, PathBuf};

use rusqlite::Connection;
use taxel_engine::Restored;
use taxel_engine::audit::AuditEntry;
use taxel_engine::calibration::SessionSamples;

use crate::error::{Quarantined, StoreError};
use crate::files::{self, LOCK, beside};
use crate::lock::refuse_in_use;
use crate::open::{STORE, idle, read_in_place};
use crate::restore::Found;
use crate::thread::samples_of;
use crate::{audit, connect, copy, samples, sets};

/// The sessions, model sets and audit log of a store.
#[derive(Debug)]
pub struct StoreFile {
    path: PathBuf,
    connection: Connection,
    restored: Restored,
    damage: Vec<Quarantined>,
}

impl StoreFile {
    /// Reads it. Nothing is changed.
    ///
    /// # Errors
    /// [`StoreError`] if there is no store, a daemon has it, it is not one of ours, or its structure is broken. Single rows that
    /// are damaged are [`StoreFile::damage`].
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        let path = idle(path)?;
        let was_ours = files::length(&beside(&path, LOCK)) > 0;
        let read = read_in_place(&path, was_ours).map_err(|error| unless_in_use(&path, error))?;
        let (connection, Found { restored, mut damage, open, .. }) = read;
        if open {
            damage.push(Quarantined::lost(STORE, "its write-ahead log is missing: the newest that was stored is lost"));
        }
        Ok(Self { path, connection, restored, damage })
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
        samples::read(&self.connection, session).map_err(|findings| unless_in_use(&self.path, damaged(findings)))
    }

    /// The text of a model set as it was written, MODELS.json.
    ///
    /// # Errors
    /// [`StoreError`] if there is no such set, or it is not what was written, or a daemon has the store now.
    pub fn model_set(&self, id: &str) -> Result<String, StoreError> {
        let model_set = || id.to_owned();
        let text =
            sets::text(&self.connection, id)?.ok_or_else(|| StoreError::NoModelSet { model_set: model_set() })?;
        let damaged = |findings| StoreError::DamagedModelSet { model_set: model_set(), findings };
        text.map_err(|findings| unless_in_use(&self.path, damaged(findings)))
    }

    /// Entries of the audit log with numbers below `before`, newest first: at most so many, and at most 1000.
    ///
    /// # Errors
    /// [`StoreError`] if they cannot be read.
    pub fn audit(&self, before: u64, most: u32) -> Result<Vec<AuditEntry>, StoreError> {
        audit::read(&self.connection, before, most)
            .map_err(|error| unless_in_use(&self.path, StoreError::opening(&self.path, &error)))
    }
}

/// What is wrong, unless a daemon has the store now: it changes the files under whoever reads them, which looks like damage.
fn unless_in_use(path: &Path, error: StoreError) -> StoreError {
    refuse_in_use(path).err().unwrap_or(error)
}

/// What a store holds.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Checked {
    /// Model sets that are sound.
    pub model_sets: usize,
    /// Sessions that are sound.
    pub sessions: usize,
    /// Samples of the sessions that are sound.
    pub samples: u64,
    /// Bytes of the store and its log.
    pub bytes: u64,
    /// What is damaged.
    pub damage: Vec<Quarantined>,
}

/// Looks at all of a store, however large, and at its copy, and changes nothing.
///
/// # Errors
/// [`StoreError`] if there is no store, a daemon has it, or it is not one of ours; not for damage.
pub fn check(path: &Path) -> Result<Checked, StoreError> {
    let mut checked = Checked { bytes: files::size_on_disk(path), ..Checked::default() };
    match StoreFile::open(path) {
        Ok(store) => check_rows(store, &mut checked)?,
        Err(StoreError::Damaged { findings, .. } | StoreError::Corrupt(findings)) => {
            let next = "the next start sets it aside and takes the copy, if there is one";
            checked.damage.push(Quarantined::lost(STORE, format!("{findings}; {next}")));
        }
        Err(error) => return Err(error),
    }
    if let Err(error) = copy::read(&files::real(path)) {
        checked.damage.push(Quarantined::new("the copy of the store", error));
    }
    Ok(checked)
}

fn check_rows(store: StoreFile, checked: &mut Checked) -> Result<(), StoreError> {
    checked.damage.extend_from_slice(store.damage());
    let whole = connect::check_with(&store.connection, &store.path, true);
    checked.damage.extend(whole.err().map(|error| Quarantined::new(STORE, error)));
    for set in &store.restored.model_sets {
        match store.model_set(&set.id) {
            Ok(_) => checked.model_sets += 1,
            Err(error @ StoreError::InUse { .. }) => return Err(error),
            Err(error) => checked.damage.push(Quarantined::new(sets::name_of(&set.id), error)),
        }
    }
    for view in &store.restored.sessions {
        match store.samples(view.number) {
            Ok(found) => checked.samples += found.samples.len() as u64,
            Err(error @ StoreError::InUse { .. }) => return Err(error),
            Err(error) => checked.damage.push(Quarantined::new(samples_of(view.number), error)),
        }
    }
    checked.sessions = store.restored.sessions.len();
    Ok(())
}
