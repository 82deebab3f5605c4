//! The store of a daemon: opened, and what the service reads of it beside the engine.

use std::path::Path;
use std::sync::Arc;

use anyhow::Context;
use taxel_engine::Restored;
use taxel_rpc::{AuditSource, ModelSetSource, Room, SamplesSource};
use taxel_store::{AuditReader, Quarantined, Retention, SamplesReader, SetReader, Store, StoreFile};

use crate::queues::TellDone;

/// Where records go.
pub enum StoreAt<'a> {
    /// A file, and how much of it is kept.
    File(&'a Path, Retention),
    /// Nowhere that outlives the process.
    Memory,
}

pub fn open_store(at: StoreAt<'_>, tell_done: &TellDone) -> anyhow::Result<(Store, Restored)> {
    match at {
        StoreAt::Memory => Ok((Store::in_memory(tell_done.of_store())?, Restored::default())),
        StoreAt::File(path, retention) => {
            if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
                std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
            }
            let opened = Store::open_keeping(path, &retention, tell_done.of_store());
            // What was found damaged is in the log already, and in `restored` for the health.
            let (store, restored, _) = opened.with_context(|| format!("opening {}", path.display()))?;
            Ok((store, restored))
        }
    }
}

/// Opens a store that no daemon has, to be read where it lies, and tells on standard error what of it is damaged.
///
/// # Errors
/// As [`StoreFile::open`].
#[cfg_attr(not(any(feature = "certificate", feature = "report")), allow(dead_code))]
pub fn read_store(path: &Path) -> anyhow::Result<StoreFile> {
    let store = StoreFile::open(path)?;
    tell(path, store.damage());
    Ok(store)
}

/// Tells on standard error what of a store is damaged or lost.
pub fn tell(path: &Path, damage: &[Quarantined]) {
    for damage in damage {
        crate::say::error_line(format_args!("taxeld: {}: {damage}", path.display()));
    }
}

/// How the service reads the audit log.
pub fn audit_source(reader: AuditReader) -> AuditSource {
    Arc::new(move |before, most, on_entries| {
        reader.read(before, most, Box::new(move |read| on_entries(read.map_err(|error| error.to_string()))));
    })
}

/// The samples of stored sessions, for the service.
pub fn samples_of(store: SamplesReader) -> SamplesSource {
    Arc::new(move |session, told| {
        store.read(session, Box::new(move |samples| told(samples.map_err(|error| error.to_string()))));
    })
}

/// The texts of stored model sets, for the service.
pub fn model_sets_of(store: SetReader) -> ModelSetSource {
    Arc::new(move |model_set, told| {
        store.read(model_set, Box::new(move |text| told(text.map_err(|error| error.to_string()))));
    })
}

/// Whether the store's files are within their budget.
pub fn room_of(store: &StoreAt<'_>, budget_mb: u64) -> Room {
    let StoreAt::File(path, _) = store else { return Arc::new(|| Ok(())) };
    let path = path.to_path_buf();
    Arc::new(move || {
        let megabytes = taxel_store::size_on_disk(&path).div_ceil(1_000_000);
        if megabytes <= budget_mb {
            return Ok(());
        }
        Err(format!(
            "the store has {megabytes} MB, its budget is {budget_mb} MB: delete sessions or model sets, a restart \
             gives their space back, or keep more with store.keep_mb"
        ))
    })
}
