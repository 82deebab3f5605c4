//! The whole file, section by section.

use serde::Deserialize;

use super::parts::{BusSection, PatchSection, ServiceSection, StoreSection};

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
