//! What the page says of a patch at one moment.

use crate::text::Text;

/// Bytes for the id of a model set.
pub(crate) const MODEL_SET_BYTES: usize = 64;
/// Bytes for the reasons.
pub(crate) const REASON_BYTES: usize = 256;

/// How far the force can be trusted; the numbers are those of `taxel.v1.ForceState`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum State {
    /// No state that this reader knows.
    #[default]
    Unspecified = 0,
    /// Every activated taxel is calibrated, fresh and in its calibrated range.
    Ok = 1,
    /// There is a force, with shortcomings.
    Degraded = 2,
    /// There is no force: too much of the skin is silent.
    Stale = 3,
    /// There is no force: the zero is not proven.
    TareInvalid = 4,
    /// There is no force: no model set is in use.
    Uncalibrated = 5,
}

impl State {
    /// Its name in the service, without the prefix.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unspecified => "UNSPECIFIED",
            Self::Ok => "OK",
            Self::Degraded => "DEGRADED",
            Self::Stale => "STALE",
            Self::TareInvalid => "TARE_INVALID",
            Self::Uncalibrated => "UNCALIBRATED",
        }
    }

    pub(crate) fn of_number(number: u32) -> Self {
        let known = [Self::Ok, Self::Degraded, Self::Stale, Self::TareInvalid, Self::Uncalibrated];
        known.into_iter().find(|state| *state as u32 == number).unwrap_or_default()
    }
}

/// One sample, as `taxel.v1.ForceSample` has it. As it was written: whether it may be acted on now is for
/// [`Page::force`](crate::Page::force) to say.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// One more for each state of the patch that the daemon published.
    pub sequence: u64,
    /// Arrival of the newest frame in it, `CLOCK_BOOTTIME` in ns; absent if none has come yet.
    pub monotonic_ns: Option<i64>,
    /// The same moment in ns since 1970: a label.
    pub wall_ns: i64,
    /// When it was written, `CLOCK_BOOTTIME` in ns. The writer sets it.
    pub written_ns: i64,
    /// How far the force can be trusted.
    pub state: State,
    /// A simulator makes the counts behind it: no skin is touched.
    pub simulated: bool,
    /// Total normal force in N.
    pub total_n: Option<f64>,
    /// Its standard uncertainty in N.
    pub sigma_n: Option<f64>,
    /// Ends of the 95 % interval in N; without an upper one nothing bounds the force above.
    pub low_n: Option<f64>,
    /// As `low_n`.
    pub high_n: Option<f64>,
    /// Upper bound (95 %) in N of force that is present but not detected; part of `high_n`.
    pub undetected_n: Option<f64>,
    /// By how much the total jumped in N when zero or model set last changed.
    pub step_n: Option<f64>,
    /// One more for each zero taken or lost.
    pub zero_epoch: u64,
    /// The force that acts on the skin, in N, in the patch's frame.
    pub resultant_n: Option<[f64; 3]>,
    /// Its moment about the origin of that frame, in N m.
    pub moment_nm: Option<[f64; 3]>,
    /// Force-weighted mean position of the active taxels, in m.
    pub centre_of_pressure_m: Option<[f64; 3]>,
    /// Taxels that count in the total.
    pub active: u32,
    /// Taxels without a usable model or with a fault.
    pub excluded: u32,
    /// Taxels of silent modules.
    pub stale: u32,
    /// Active taxels beyond their calibrated range.
    pub out_of_range: u32,
    /// Id of the active model set, which is made of a hash of its content; empty without one.
    pub model_set: Text<MODEL_SET_BYTES>,
    /// Why the state is not OK, most important first, as far as there is room.
    pub reasons: Text<REASON_BYTES>,
}
