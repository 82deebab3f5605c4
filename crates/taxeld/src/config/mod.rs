//! The configuration file: what an installation has, in TOML. `deploy/taxeld.toml` explains every key.

mod area;
mod area_words;
mod boards;
pub mod bus_load;
mod dbc;
mod door;
pub mod examine;
mod fault;
mod file;
mod fit_section;
mod listen;
mod listen_places;
mod listen_sections;
mod load;
mod log_filter;
mod modules;
mod number_words;
mod page_section;
mod parts;
mod patch_limits;
mod record_section;
mod resolve;
mod runtime_folder;
mod service_section;
mod shared_memory_section;
mod signal_pages;
mod signal_parts;
mod signals;

pub use door::Door;
pub use examine::{Problems, examine, examine_text, examine_with, read_text};
pub use fault::Fault;
pub use file::Config;
pub use listen::Doors;
pub use load::parse;
pub use log_filter::log_filter;
pub use modules::KindWord;
pub use modules::written as modules_written;
#[cfg(feature = "sim")]
pub use page_section::{MetricsSection, PageSection};
pub use parts::BusSection;
pub use parts::BusSource;
pub use record_section::RecordSection;
pub use record_section::written as record_written;
pub use resolve::{Scene, resolve};
pub use shared_memory_section::{SharedMemorySection, written as shared_memory_written};
