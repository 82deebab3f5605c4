//! Sessions with all their samples, model sets, zeros and known loads, in one SQLite file that one thread writes.
//!
//! What was acknowledged is on disk: an acknowledgement is sent after the commit returned, and a commit returns after
//! the flush. What is on disk is always a beginning of what happened: after a failed write nothing more is written.
//! A row that is not what was written, or is lost, is reported and never served. Sessions and model sets are deleted by
//! command alone: their bytes are overwritten, and a row stays that tells deleted from lost. Samples are read when a
//! session is taken up again; a start proves them and holds none.

mod append;
mod db;
mod deletions;
mod error;
mod load_row;
pub mod models_json;
mod restore;
mod rows;
mod schema;
mod tally;
#[cfg(test)]
mod tests;
mod writer;

pub use error::{Quarantined, StoreError};
pub use writer::{Batch, Durability, Notify, OnDurable, OnSamples, QUEUE_BATCHES, QueueFull, Store, StoreEvent};
