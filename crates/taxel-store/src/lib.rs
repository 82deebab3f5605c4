//! Sessions with all their samples, model sets, zeros and known loads, in one SQLite file that one thread reads and writes.
//!
//! What was acknowledged is on disk: an acknowledgement is sent after the commit returned, and a commit returns after the
//! flush. After the first commit that failed nothing more is written. A row that is not what was written is told and never
//! used. A copy beside the file is renewed after each activation, each session that ends and each deletion; it takes the place
//! of a file that is damaged, lost, or older than it is. Which of the two is newer tells the number of commits in each.
//! An operator or `store.keep_mb` deletes sessions and model sets: their bytes are overwritten.

mod append;
mod audit;
mod connect;
mod copy;
mod db;
mod error;
mod facts;
mod files;
mod lock;
pub mod models_json;
mod open;
mod restore;
mod retention;
mod samples;
mod schema;
mod sets;
mod store;
mod store_file;
#[cfg(test)]
mod tests;
mod thread;
mod watch;
mod work;

pub use error::{Quarantined, StoreError};
pub use files::size_on_disk;
pub use retention::session_to_go;
pub use store::{Reader, Store};
pub use store_file::{Checked, check};
pub use thread::{Notify, StoreEvent};
pub use work::{Batch, Durability, OnDurable, QUEUE_BATCHES, QUEUE_BATCHES_ASKED, QueueFull, Tell};
