//! Sessions with all their samples, model sets, zeros and known loads, in one SQLite file that one thread writes.
//!
//! What was acknowledged is on disk: an acknowledgement is sent after the commit returned, and a commit returns after
//! the flush. What is on disk is always a beginning of what happened: after a failed write nothing more is written.
//! Nothing is ever deleted, and a row that is not what was written is reported and never served.

mod append;
mod db;
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
pub use writer::{Batch, Durability, Notify, OnDurable, QUEUE_BATCHES, QueueFull, Store, StoreEvent};
