//! The configuration file: what an installation has, in TOML. `deploy/taxeld.toml` explains every key.
//!
//! `read` makes the sections of `file` and `patch_section` of a text; `scene` checks all values and what they refer to, and
//! resolves them into what the daemon needs. Both tell everything that is wrong at once.

mod array;
mod boards;
mod file;
mod gauge;
mod limits;
mod listen;
mod patch;
mod patch_section;
mod ports;
mod problem;
mod read;
mod scene;

#[cfg(feature = "sim")]
pub use file::PageSection;
pub use file::{BusSection, BusSource, Config, RecordSection, SharedMemorySection, StoreSection};
pub use gauge::line_of;
pub use listen::{Door, Doors, SOCKET_MODE, UNRULED};
pub use ports::of_bus as port_of;
pub use read::{examine, examine_profile, examine_text};
pub use scene::Scene;

/// The configuration of an installed daemon.
pub const CONFIG_FILE: &str = "/etc/taxeld/taxeld.toml";
