//! The active model sets are there whatever became of the database: a plain file beside it has them once more.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

use taxel_engine::Restored;
use taxel_engine::model_set::ModelSet;
use taxel_engine::record::Record;

use crate::board_zeros::Missing;
use crate::db::Db;
use crate::error::{Quarantined, StoreError};
use crate::retention::wall_ns;
use crate::{active_file, board_zeros, models_json, restore};

/// How findings name the plain file.
const FILE: &str = "the file of the active model sets";

/// What the plain file knows better than the database.
struct FromFile {
    /// The sets that are active by it alone.
    sets: Vec<Arc<ModelSet>>,
    /// Whether the database is older than the file.
    is_newer: bool,
}

impl Db {
    /// Brings the plain file of the active model sets in step with the database, or takes from it what the database lost.
    /// `lost` is set if the database is older than the file.
    pub(super) fn restore_active(
        &mut self,
        path: &Path,
        restored: &mut Restored,
        lost: &mut bool,
        quarantined: &mut Vec<Quarantined>,
    ) -> Result<(), StoreError> {
        let FromFile { sets, is_newer } = self.serve_plain_file(path, restored, quarantined)?;
        *lost |= is_newer;
        let mut records = Vec::new();
        for set in sets {
            let (patch, model_set) = (set.patch.clone(), set.id.clone());
            records.push(Record::ModelSet(set));
            records.push(Record::Activated { patch, model_set, wall_ns: 0 });
        }
        self.attempt(|db| if records.is_empty() { Ok(()) } else { db.write(records.iter()).map(drop) })?;
        self.attempt(|db| {
            db.activated = true;
            db.keep_active();
            Ok(())
        })
    }

    /// What a start would take from the plain file, where nothing is to be changed.
    pub(crate) fn read_active(
        &self,
        path: &Path,
        restored: &mut Restored,
        quarantined: &mut Vec<Quarantined>,
    ) -> Result<(), StoreError> {
        self.serve_plain_file(path, restored, quarantined).map(drop)
    }

    /// Serves the sets of the plain file of patches that have none because the database lost it, and that were not deleted
    /// since: all of a newer file's, and of the present one's where something is damaged. An older file is that of a stop
    /// before it could be written: the database goes on.
    fn serve_plain_file(
        &self,
        path: &Path,
        restored: &mut Restored,
        quarantined: &mut Vec<Quarantined>,
    ) -> Result<FromFile, StoreError> {
        let newest = restore::newest_activation(&self.connection)?;
        let mut found = FromFile { sets: Vec::new(), is_newer: false };
        let is_damaged = !quarantined.is_empty();
        let file = match active_file::read(path) {
            Some(Ok(file)) => file,
            Some(Err(reason)) => {
                quarantined.push(Quarantined::lost(FILE, reason));
                return Ok(found);
            }
            None => return Ok(found),
        };
        found.is_newer = file.activation > newest;
        if found.is_newer {
            quarantined.push(older_than(newest, file.activation));
            restored.active.clear();
        } else if file.activation < newest || !is_damaged {
            return Ok(found);
        }
        for set in sets_of(file.sets, quarantined) {
            let has_one = restored.active.iter().any(|(known, _)| *known == set.patch);
            if has_one || restore::was_deleted(&self.connection, &set.id, file.activation)? {
                continue;
            }
            let what = format!("the activation of model set {}", set.id);
            quarantined
                .push(Quarantined::lost(what, "the store has it no more, and the set is served from the plain file"));
            serve(Arc::clone(&set), restored);
            found.sets.push(set);
        }
        Ok(found)
    }

    /// Finds what is known of the boards' zeros, now that all patches are known. What follows from a loss alone is written
    /// down, so that it is held until somebody vouches for the zero.
    ///
    /// `lost` tells that the newest rows may be missing, `elsewhere` of what else rows are.
    pub(super) fn restore_board_zeros(
        &mut self,
        restored: &mut Restored,
        lost: bool,
        elsewhere: &[String],
    ) -> Result<(), StoreError> {
        let patches: BTreeSet<&str> = patches_of(restored).collect();
        let missing = Missing { newest: lost, elsewhere };
        let found = board_zeros::read(&self.connection, &patches, missing, &mut Vec::new())?; // what is damaged was told
        let (wall_ns, unnoted) = (wall_ns(), found.iter().filter(|known| !known.is_noted));
        let record = |known: &board_zeros::Known| {
            tracing::error!(patch = known.patch, "{}", known.zeros.unproven.as_deref().unwrap_or_default());
            Record::BoardZeros { patch: known.patch.clone(), zeros: known.zeros.clone(), wall_ns }
        };
        let records: Vec<_> = unnoted.map(record).collect();
        restored.board_zeros = found.into_iter().map(|known| (known.patch, known.zeros)).collect();
        self.attempt(|db| if records.is_empty() { Ok(()) } else { db.write(records.iter()).map(drop) })
    }

    /// Where the database cannot be had at all: the active model sets of the plain file, in a store that takes nothing.
    ///
    /// # Errors
    /// Why the database cannot be had, if there is no such file or nothing in it.
    pub(super) fn of_plain_file(
        path: &Path,
        why: StoreError,
        quarantined: &mut Vec<Quarantined>,
    ) -> Result<(Self, Restored), StoreError> {
        let Some(Ok(file)) = active_file::read(path) else { return Err(why) };
        let mut restored = Restored { next_session: 1, next_load: 1, ..Restored::default() };
        sets_of(file.sets, quarantined).into_iter().for_each(|set| serve(set, &mut restored));
        if restored.active.is_empty() {
            return Err(why);
        }
        restored.board_zeros = board_zeros::of_all(restored.active.iter().map(|(patch, _)| patch.as_str()));
        tracing::error!(error = %why, "the active model sets are served from the plain file, and nothing is stored");
        quarantined.push(Quarantined::lost("the store", &why));
        let mut db = Self::in_memory()?;
        db.failure = Some(why);
        Ok((db, restored))
    }
}

/// The database has lost its newest activations.
fn older_than(newest: u64, in_file: u64) -> Quarantined {
    let reason = format!("its newest one is {newest}, the file beside the store has {in_file}");
    Quarantined::lost("the list of activations", reason)
}

/// The sets of the plain file that are what their names say.
fn sets_of(sets: Vec<(String, String)>, quarantined: &mut Vec<Quarantined>) -> Vec<Arc<ModelSet>> {
    let mut sound = Vec::new();
    for (id, text) in sets {
        match models_json::from_json(&text) {
            Ok(set) if set.id == id => sound.push(Arc::new(set)),
            Ok(set) => {
                quarantined.push(Quarantined::lost(FILE, format!("it names `{id}`, its content is {}", set.id)));
            }
            Err(error) => quarantined.push(Quarantined::lost(FILE, error)),
        }
    }
    sound
}

fn serve(set: Arc<ModelSet>, restored: &mut Restored) {
    restored.active.push((set.patch.clone(), set.id.clone()));
    match restored.model_sets.iter_mut().find(|known| known.id == set.id) {
        Some(known) => known.at_hand = Some(set),
        None => restored.model_sets.push(set.into()),
    }
}

/// Each patch that has a model set.
fn patches_of(restored: &Restored) -> impl Iterator<Item = &str> {
    let of_sets = restored.model_sets.iter().map(|set| set.patch.as_str());
    of_sets.chain(restored.active.iter().map(|(patch, _)| patch.as_str()))
}
