//! What the zero needs to know of a patch.

use std::time::Duration;

use crate::baseline::Activation;
use crate::zero::drift::plan::DriftPlan;
use crate::zero::drift::site::DriftSite;
use crate::zero::rest::limits::RestLimits;

/// How the zero is taken.
#[derive(Clone, Copy, Debug)]
pub struct TarePlan {
    /// How long the skin is watched.
    pub duration: Duration,
    /// Take the zero by itself after start, if rest is proven against the active model set.
    pub at_start: bool,
    /// What counts as rest.
    pub rest: RestLimits,
}

impl Default for TarePlan {
    fn default() -> Self {
        Self { duration: Duration::from_secs(1), at_start: true, rest: RestLimits::default() }
    }
}

/// All that the zero of a patch depends on.
#[derive(Clone, Debug)]
pub struct ZeroPlan {
    /// How it is taken.
    pub tare: TarePlan,
    /// Whether and how far it follows the temperature.
    pub drift: DriftPlan,
    /// The modules, and which lie beside which.
    pub sites: Vec<DriftSite>,
    /// When a taxel counts as touched.
    pub activation: Activation,
    /// The period at which the boards send.
    pub period: Duration,
    /// What each board is called.
    pub board_names: Vec<String>,
    /// What each module is called.
    pub module_names: Vec<String>,
}

impl ZeroPlan {
    /// What the module at this position is called; its position where it has no name.
    #[must_use]
    pub fn module_name(&self, module: usize) -> String {
        self.module_names.get(module).cloned().unwrap_or_else(|| format!("module {module}"))
    }
}
