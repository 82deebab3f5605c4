//! Sessions with all their samples, model sets, zeros and known loads, in one SQLite file that one thread writes.
//!
//! What was acknowledged is on disk: an acknowledgement is sent after the commit returned, and a commit returns after
//! the flush. What is on disk is always a beginning of what happened: after a failed write nothing more is written.
//! A row that is not what was written, or is lost, is reported and never served. A damaged file is kept under another name,
//! and what can be read of it goes into a new one; the active model sets are there once more as plain text. Sessions and model sets are deleted by
//! command alone: their bytes are overwritten, and a row stays that tells deleted from lost. Samples are read when a
//! session is taken up again; a start proves them and holds none.

mod active_file;
mod append;
mod audit_rows;
mod beside;
mod board_zeros;
mod db;
mod deletions;
mod error;
#[cfg(feature = "fuzzing")]
#[doc(hidden)]
pub mod fuzzing;
mod group;
mod held_files;
mod identity;
mod in_place;
mod load_row;
mod lock;
mod loss;
mod maintenance;
pub mod models_json;
mod open_mark;
mod pass;
mod prepare;
mod readers;
mod restore;
mod retention;
mod rows;
mod salvage;
mod schema;
mod session_samples;
mod sets;
mod store_file;
mod tally;
#[cfg(test)]
mod tests;
mod wal_check;
mod work;
mod writer;

pub use beside::{files_of, real};
pub use error::{Quarantined, StoreError};
pub use maintenance::{AuditFile, Checked, Compacted, check, compact, size_on_disk};
pub use readers::{AuditReader, SamplesReader, SetReader, SizeReader};
pub use retention::{Retention, Size, session_to_go, sets_to_go, to_be_judged};
pub use store_file::StoreFile;
pub use work::{
    Batch, Durability, OnAudit, OnDurable, OnModelSet, OnSamples, OnSize, QUEUE_BATCHES, QUEUE_BATCHES_ASKED, QueueFull,
};
pub use writer::{Notify, Store, StoreEvent};
