//! The configuration file: what an installation has, in TOML. `deploy/taxeld.toml` explains every key.

mod area;
mod area_words;
mod file;
mod fit_section;
mod load;
mod parts;
mod resolve;

pub use file::Config;
pub use load::load;
#[cfg(any(feature = "sim", test))]
pub use load::parse;
pub use parts::BusSource;
pub use resolve::{Scene, resolve};
