//! Immutable views of live state.

use taxel_skin::Time;

pub use crate::boundary::catalogue::Catalogue;
pub use crate::force::budget::{Budget, Term};
pub use crate::force::reason::{Reason, ReasonCode, in_words};
pub use crate::force::sample::{Contact, ForceSample, ForceState, RangeFlag, TaxelState, Undetected};
pub use crate::force::taxels::Taxels;
pub use crate::intake::faults::fault::{Fault, FaultSet};
pub use crate::intake::health::{BoardHealth, BusHealth};
pub use crate::zero::view::{DriftView, TareView};

/// One patch at one moment.
#[derive(Clone, Debug, Default)]
pub struct PatchSnapshot {
    /// One more for each published snapshot of this patch.
    pub sequence: u64,
    /// Receive time of the newest frame in it.
    pub time: Time,
    /// The same instant in nanoseconds since 1970, a label only.
    pub wall_ns: i64,
    /// Whether any frame of the patch has come.
    pub seen: bool,
    /// Whether a simulator makes its frames: the force is none of a real skin.
    pub simulated: bool,
    /// The force on the patch.
    pub force: ForceSample,
    /// One entry per taxel, worked out when somebody looks.
    pub taxels: Taxels,
    /// The zero, if one was taken.
    pub tare: Option<TareView>,
}

/// Buses, boards and modules.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Health {
    /// One per bus.
    pub buses: Vec<BusHealth>,
    /// One per board, patch by patch.
    pub boards: Vec<BoardHealth>,
    /// What else is wrong, for example the store.
    pub problems: Vec<String>,
    /// What is wrong with the store; part of `problems`, too.
    pub store: StoreHealth,
}

/// A reading of a pressure gauge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaugeReading {
    /// When it came.
    pub time: Time,
    /// What it is, kPa.
    pub kpa: f64,
}

/// What is wrong with the store.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StoreHealth {
    /// Why it takes no records any more, if it does not.
    pub problem: Option<String>,
    /// What a start found damaged and left out, a line each.
    pub damage: Vec<String>,
}

impl StoreHealth {
    /// Whether it takes records and nothing of it is damaged.
    #[must_use]
    pub const fn is_whole(&self) -> bool {
        self.problem.is_none() && self.damage.is_empty()
    }
}
