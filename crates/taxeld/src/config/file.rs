//! The whole file, section by section.

use serde::Deserialize;

use super::listen_sections::{AccessSection, ListenSection};
use super::page_section::{MetricsSection, PageSection};
use super::parts::{BusSection, LogSection, PatchSection, StoreSection};
use super::record_section::RecordSection;
use super::service_section::ServiceSection;
use super::shared_memory_section::SharedMemorySection;

/// The whole file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Where sessions and model sets are kept.
    pub store: StoreSection,
    /// The gRPC service.
    #[serde(default)]
    pub service: ServiceSection,
    /// Where it listens beside `service.listen`.
    #[serde(default)]
    pub listen: Vec<ListenSection>,
    /// Who may do what there.
    pub access: Option<AccessSection>,
    /// The operator's page; none without it.
    pub page: Option<PageSection>,
    /// Metrics for Prometheus; none without it.
    pub metrics: Option<MetricsSection>,
    /// Pages in shared memory; none without it.
    pub shared_memory: Option<SharedMemorySection>,
    /// Recordings; none without it.
    pub record: Option<RecordSection>,
    /// The log.
    #[serde(default)]
    pub log: LogSection,
    /// The buses; a patch names one of them.
    pub bus: Vec<BusSection>,
    /// The patches.
    pub patch: Vec<PatchSection>,
}
