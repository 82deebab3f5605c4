//! The store of a daemon, opened.

use std::path::Path;

use anyhow::Context;
use taxel_engine::Restored;
use taxel_store::{Retention, Store};

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
