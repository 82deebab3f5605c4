//! What the zero is told of a patch's warmth, and what readers see of it.

pub mod plan;
pub mod site;
pub mod view;

pub use plan::DriftPlan;
pub use site::{DriftSite, drift_sites};
pub use view::{DriftState, DriftView};
