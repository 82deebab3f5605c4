//! A store that no daemon has open, read where it lies: what is damaged stays as it is, for the next start to tell and to put
//! right.

use std::path::Path;

use rusqlite::Connection;

use crate::error::{Quarantined, StoreError};
use crate::files;
use crate::lock::StoreLock;
use crate::open::{STORE, read};
use crate::restore::Found;
use crate::{connect, copy, samples, sets};

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
    let real = files::real(path);
    if !real.exists() {
        return Err(StoreError::Disk("there is none".to_owned()));
    }
    let lock = StoreLock::shared(&real)?; // a daemon that starts meanwhile is told that it is in use
    match read(&real, lock.was_ours, connect::to_read) {
        Ok((connection, found)) => check_rows(&connection, found, &mut checked)?,
        Err(StoreError::Damaged(findings)) => {
            let next = "the next start sets it aside and takes the copy, if there is one";
            checked.damage.push(Quarantined::lost(STORE, format!("{findings}; {next}")));
        }
        Err(error) => return Err(error),
    }
    if let Err(error) = copy::read(&real) {
        checked.damage.push(Quarantined::new("the copy of the store", error));
    }
    Ok(checked)
}

fn check_rows(connection: &Connection, found: Found, checked: &mut Checked) -> Result<(), StoreError> {
    let Found { restored, damage, open, .. } = found;
    checked.damage.extend(damage);
    if open {
        let why = "its write-ahead log is missing: the newest that was stored is lost";
        checked.damage.push(Quarantined::lost(STORE, why));
    }
    checked.damage.extend(connect::check(connection, true).err().map(|error| Quarantined::new(STORE, error)));
    for set in &restored.model_sets {
        match sets::read(connection, &set.id)? {
            Ok(_) => checked.model_sets += 1,
            Err(why) => checked.damage.push(Quarantined::new(sets::name_of(&set.id), why)),
        }
    }
    for view in &restored.sessions {
        match samples::read(connection, view.number) {
            Ok(found) => checked.samples += found.samples.len() as u64,
            Err(why) => checked.damage.push(Quarantined::new(samples::name_of(view.number), why)),
        }
    }
    checked.sessions = restored.sessions.len();
    Ok(())
}
