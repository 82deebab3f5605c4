//! The configuration file: what an installation has, in TOML. `deploy/taxeld.toml` explains every key.

mod area;
mod fit_section;
mod load;
mod parts;
mod resolve;

#[cfg(any(feature = "sim", test))]
pub use load::parse;
pub use load::{ConfigError, load};
pub use parts::BusSource;
pub use resolve::{Scene, resolve};

use parts::{BusSection, PatchSection, ServiceSection, StoreSection};
use serde::Deserialize;

/// The whole file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Where sessions and model sets are kept.
    pub store: StoreSection,
    /// The gRPC service.
    #[serde(default)]
    pub service: ServiceSection,
    /// The buses; a patch names one of them.
    pub bus: Vec<BusSection>,
    /// The patches.
    pub patch: Vec<PatchSection>,
}
