//! What the world sees of a session.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::calibration::branch::{Branch, Direction};
use crate::calibration::plateau::PlateauView;
use crate::names::named;
use crate::request::{ErrorReason, Rejection};

named! {
    /// Where a session stands.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
    pub enum SessionState {
        /// Watches the skin at rest before a ramp.
        #[default]
        Taring = "TARING",
        /// Gathers samples while the pressure rises and, over both branches, while it falls again.
        Ramping = "RAMPING",
        /// Models are being computed.
        Fitting = "FITTING",
        /// A model set waits to be activated, discarded or extended by another ramp.
        Review = "REVIEW",
        /// Its model set is in use. That is how readers see it, and not kept: see [`SessionView::seen`].
        Active = "ACTIVE",
        /// Its model set was laid aside, or what it gathered cannot be trusted; the reason is in the view.
        Discarded = "DISCARDED",
        /// An operator stopped it.
        Aborted = "ABORTED",
        /// It could not succeed; the reason is in the view.
        Failed = "FAILED",
        /// The daemon stopped while it was under way; another ramp or a fit can go on from its samples.
        Interrupted = "INTERRUPTED",
    }
}

impl SessionState {
    /// Whether the session holds the patch: no other can start.
    #[must_use]
    pub const fn is_open(self) -> bool {
        matches!(self, Self::Taring | Self::Ramping | Self::Fitting)
    }
}

named! {
    /// Why a scan did not enter the session.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    pub enum SampleRefusal {
        /// On the rising branch the pressure was not above what had been reached.
        NotRising = "not_rising",
        /// The pressure rose or fell faster than the limit.
        TooFast = "too_fast",
        /// No pressure frame near the scan's time.
        NoPressure = "no_pressure",
        /// A module was silent.
        StaleModule = "stale_module",
        /// The session's memory was full.
        Full = "full",
        /// The gauge read far from what it read within the last second.
        GaugeSpike = "gauge_spike",
        /// On the falling branch the pressure was not below what had been reached.
        NotFalling = "not_falling",
        /// The zero was lost or came into check within a second after it.
        ZeroInCheck = "zero_in_check",
        /// The gauge repeated the same reading while the pressure went on.
        GaugeStuck = "gauge_stuck",
    }
}

/// How many scans were refused, by reason.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct RefusalCounts(BTreeMap<SampleRefusal, u64>);

impl RefusalCounts {
    /// Counts so many.
    pub fn add(&mut self, reason: SampleRefusal, scans: u64) {
        *self.0.entry(reason).or_default() += scans;
    }

    /// How many scans were refused for this reason.
    #[must_use]
    pub fn get(&self, reason: SampleRefusal) -> u64 {
        self.0.get(&reason).copied().unwrap_or_default()
    }
}

/// A session at one moment.
/// What is kept of it on disk has these names there.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SessionView {
    /// Its number.
    pub number: u64,
    /// The patch under calibration.
    pub patch: String,
    /// Where it stands.
    pub state: SessionState,
    /// Why it failed, was interrupted, waits, or ended its ramp before the end of the fall.
    pub reason: String,
    /// When it began, nanoseconds since 1970.
    pub started_wall_ns: i64,
    /// When it reached its present state, nanoseconds since 1970.
    pub changed_wall_ns: i64,
    /// Who confirmed that the skin was unloaded, if someone did.
    pub confirmed_by: Option<String>,
    /// Modules that the operator left out: positions in the patch, ascending. Their taxels get no model.
    pub left_out: Vec<u16>,
    /// How the boards were set when it began, in words, a line a board: all its samples were gathered so.
    pub board_settings: Arc<[String]>,
    /// How the gauge was read when it began, in words: all its pressures were read so. Empty where they came with the scans.
    pub gauge: String,
    /// Where the rise of a ramp ends by itself, in kPa.
    pub target_kpa: f64,
    /// Which branches of the pressure it gathers and fits.
    pub branches: Branch,
    /// Which branch of its ramp it is at.
    pub direction: Direction,
    /// Ramps begun.
    pub ramps: u16,
    /// Scans that entered.
    pub accepted: u64,
    /// Scans that did not.
    pub refused: RefusalCounts,
    /// Scans that are on disk.
    #[serde(skip)]
    pub durable: u64,
    /// The newest pressure in kPa, if one came lately; from the first ramp on, above what the gauge read at rest.
    #[serde(skip)]
    pub pressure_kpa: Option<f64>,
    /// What the gauge read at rest before the newest ramp, in kPa: what pressures are counted from. 0 before the first ramp
    /// and where it is not known; not kept on disk.
    #[serde(skip)]
    pub gauge_zero_kpa: f64,
    /// Its rate of rise in kPa/s over the last second.
    #[serde(skip)]
    pub rate_kpa_per_s: Option<f64>,
    /// Share of the 1 kPa steps from 0 to the target that hold a sample, 0 to 1.
    pub coverage: f64,
    /// Taxels that responded so far, and all taxels.
    pub responding: (u32, u32),
    /// Those that did not, ascending; empty where only the numbers are known.
    #[serde(skip)]
    pub not_responding: Arc<[u16]>,
    /// Where a dial is typed: what is known of its plateaus. Not kept on disk.
    #[serde(skip)]
    pub typed: Option<PlateauView>,
    /// Time to the end of the branch at the present rate, in seconds.
    #[serde(skip)]
    pub remaining_s: Option<f64>,
    /// What should have been seen to when it began, a line each; not kept on disk.
    #[serde(skip)]
    pub look: Arc<[String]>,
    /// The model set it produced.
    pub model_set: Option<Arc<str>>,
    /// Why what it gathered cannot be trusted, for people; empty where nothing is known against it. A set that was made
    /// before stays as good as it was.
    pub untrusted: String,
}

impl SessionView {
    /// The session as readers see it while the set of this id is in use on its patch.
    #[must_use]
    pub fn seen(self: &Arc<Self>, in_use: Option<&str>) -> Arc<Self> {
        let idle = !self.state.is_open() && self.state != SessionState::Discarded;
        if idle && in_use.is_some() && self.model_set.as_deref() == in_use {
            return Arc::new(Self { state: SessionState::Active, ..Self::clone(self) });
        }
        Arc::clone(self)
    }

    /// Refuses to make models of what cannot be trusted, or to gather more beside it.
    ///
    /// # Errors
    /// [`Rejection::FailedPrecondition`] with the session and the reason.
    pub fn check_trusted(&self) -> Result<(), Rejection> {
        ErrorReason::SessionWrongState.unless(self.untrusted.is_empty(), || {
            format!("what session {} gathered is not fitted: {}", self.number, self.untrusted)
        })
    }

    /// Refuses what cannot be while it holds its patch; `then` says what to do.
    ///
    /// # Errors
    /// [`Rejection::FailedPrecondition`] with the session and its state.
    pub(crate) fn check_closed(&self, then: &str) -> Result<(), Rejection> {
        let closed = !self.state.is_open();
        ErrorReason::SessionOpen.unless(closed, || format!("session {} is {}; {then}", self.number, self.state.name()))
    }
}
