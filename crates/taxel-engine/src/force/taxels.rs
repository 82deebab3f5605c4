//! The states of all taxels at one moment, worked out only when somebody looks.
//!
//! Most readers want the force alone. So a snapshot keeps what the states follow from, which is little and mostly
//! shared, and the first reader that asks pays for the rest.

use std::fmt;
use std::ops::Deref;
use std::sync::{Arc, OnceLock};
use taxel_skin::Time;

use crate::counts::SharedCounts;
use crate::force::offsets::{self, Offsets};
use crate::force::sample::TaxelState;
use crate::force::tables::Tables;
use crate::intake::faults::fault::FaultSet;
use crate::model_set::ModelSet;

/// One entry per taxel of the patch.
#[derive(Clone, Default)]
pub struct Taxels {
    basis: Option<Arc<Basis>>,
    states: OnceLock<Arc<[TaxelState]>>,
}

/// What the states of the taxels follow from. Slices have one entry per taxel unless they say otherwise.
#[derive(Debug)]
pub struct Basis {
    /// Raw counts as last received.
    pub counts: SharedCounts,
    /// One per module.
    pub modules: Box<[ModuleAge]>,
    /// Position of each taxel's module in `modules`.
    pub module_of: Arc<[u16]>,
    /// What is wrong with each taxel.
    pub faults: Arc<[FaultSet]>,
    /// Tables of the active model set at the present zero, if both are there.
    pub tables: Option<Arc<Tables>>,
    /// What each taxel's history adds to its pressure, where hysteresis is compensated.
    pub offsets: Option<Offsets>,
    /// The taxels whose force is in the total, ascending.
    pub active: Box<[u16]>,
    /// The active model set.
    pub model_set: Option<Arc<ModelSet>>,
}

/// One module at that time.
#[derive(Clone, Copy, Debug)]
pub struct ModuleAge {
    /// When it was last received whole.
    pub last: Option<Time>,
    /// Whether it is silent.
    pub stale: bool,
}

impl Taxels {
    /// States that follow from `basis`.
    #[must_use]
    pub fn of(basis: Basis) -> Self {
        Self { basis: Some(Arc::new(basis)), states: OnceLock::new() }
    }

    /// The faults of all taxels, where the engine made the states: the same allocation as long as nothing changes.
    #[must_use]
    pub fn faults(&self) -> Option<&Arc<[FaultSet]>> {
        self.basis.as_ref().map(|basis| &basis.faults)
    }
}

impl From<Vec<TaxelState>> for Taxels {
    fn from(states: Vec<TaxelState>) -> Self {
        Self { basis: None, states: OnceLock::from(Arc::from(states)) }
    }
}

impl Deref for Taxels {
    type Target = [TaxelState];

    fn deref(&self) -> &[TaxelState] {
        self.states.get_or_init(|| {
            self.basis
                .as_ref()
                .map_or_else(Arc::default, |m| (0..m.counts.counts().len()).map(|t| m.state(t)).collect())
        })
    }
}

impl fmt::Debug for Taxels {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

impl Basis {
    fn state(&self, taxel: usize) -> TaxelState {
        let (count, module) =
            (self.counts.counts().raw(taxel).unwrap_or_default(), self.modules[usize::from(self.module_of[taxel])]);
        let tables = self.tables.as_ref().filter(|_| !module.stale);
        let reading = tables.and_then(|tables| offsets::reading(tables, self.offsets.as_ref(), taxel, count));
        TaxelState {
            count,
            time: module.last.unwrap_or_default(),
            seen: module.last.is_some(),
            stale: module.stale,
            active: u16::try_from(taxel).is_ok_and(|taxel| self.active.binary_search(&taxel).is_ok()),
            calibrated: self.model_set.as_ref().is_some_and(|set| set.taxels[taxel].is_usable()),
            range: reading.map(|r| r.range).unwrap_or_default(),
            faults: self.faults[taxel],
            pressure_kpa: reading.map(|r| r.pressure_kpa),
            sigma_kpa: reading.map(|r| r.sigma_kpa),
        }
    }
}
