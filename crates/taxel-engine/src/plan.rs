//! What the engine is asked to do: the scene, resolved once at start. Nothing outside the plan is read, computed or sent.

use std::time::Duration;
use taxel_model::FitOptions;
use taxel_skin::{BusIndex, Geometry, Kilopascal, Patch, SquareMillimetre};
use taxel_wire::icub::{BoardConfig, TriangleConfig};
use taxel_wire::signal::SignalSpec;

use crate::faults::FaultLimits;
use crate::recording::{Branch, PlaysChoice};
use crate::rest::RestLimits;

/// Everything one engine does.
#[derive(Clone, Debug)]
pub struct Plan {
    /// How many buses frames can come from; a [`BusIndex`] is below it.
    pub buses: usize,
    /// The patches, in configuration order.
    pub patches: Vec<PatchPlan>,
}

/// Everything that is done for one patch.
#[derive(Clone, Debug)]
pub struct PatchPlan {
    /// Boards, modules and taxels.
    pub patch: Patch,
    /// How each board of `patch.boards()` is brought up, in that order; empty if the daemon only listens.
    pub bring_up: Vec<BoardSetup>,
    /// The period at which the boards send.
    pub period: Duration,
    /// Positions and normals, where the scene has them.
    pub geometry: Option<Geometry>,
    /// The area that each taxel stands for, one per taxel.
    pub areas: Vec<SquareMillimetre>,
    /// Relative standard uncertainty of the area that all taxels share.
    pub area_uncertainty: f64,
    /// Whether the areas are multiplied by the factor that known loads give, once it is known.
    pub area_from_loads: bool,
    /// The gauge that measures the bag's differential pressure; without one there is no calibration.
    pub gauge: Option<Gauge>,
    /// What a force sample carries.
    pub outputs: Outputs,
    /// When a taxel counts as touched or stale.
    pub live: LiveLimits,
    /// When a taxel counts as faulty.
    pub faults: FaultLimits,
    /// How the zero is taken.
    pub tare: TarePlan,
    /// Whether and how far it follows the temperature.
    pub drift: DriftPlan,
    /// The rules of a calibration session.
    pub session: SessionLimits,
    /// How models are fitted.
    pub fit: FitOptions,
}

impl PatchPlan {
    /// The least that can be asked for: the total force of boards that stream every 50 ms by themselves.
    #[must_use]
    pub fn new(patch: Patch) -> Self {
        Self {
            bring_up: Vec::new(),
            period: Duration::from_millis(50),
            geometry: None,
            areas: vec![SquareMillimetre::ICUB_TAXEL; patch.taxels().len()],
            area_uncertainty: 0.05,
            area_from_loads: false,
            gauge: None,
            outputs: Outputs::default(),
            live: LiveLimits::default(),
            faults: FaultLimits::default(),
            tare: TarePlan::default(),
            drift: DriftPlan::default(),
            session: SessionLimits::default(),
            fit: FitOptions::default(),
            patch,
        }
    }
}

/// The values that a board is configured with.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BoardSetup {
    /// Command 0x4D.
    pub board: BoardConfig,
    /// Command 0x50, first the defaults and then the exceptions.
    pub triangles: Vec<TriangleConfig>,
}

/// Where the differential pressure comes from.
#[derive(Clone, Debug)]
pub struct Gauge {
    /// The bus it sits on.
    pub bus: BusIndex,
    /// Its frame.
    pub signal: SignalSpec,
}

/// Which parts of a force sample are computed beside the total.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outputs {
    /// Resultant force vector; needs usable normals.
    pub resultant: bool,
    /// Moment about the patch origin and centre of pressure; needs usable normals.
    pub moment: bool,
    /// Clusters of touched taxels; needs positions.
    pub contacts: bool,
    /// The total includes pressures of excluded taxels, taken from their neighbours; needs positions.
    pub fill: bool,
}

/// When a taxel counts as touched or stale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LiveLimits {
    /// A taxel is active beyond rest mean + this many times its rest noise.
    pub activation_sigmas: f64,
    /// The least activation distance, in counts.
    pub activation_floor_counts: f64,
    /// A module is stale when it has been silent for so long.
    pub stale_after: Duration,
    /// Above this share of stale taxels there is no force at all.
    pub stale_share_max: f64,
    /// A board silent for so long may have lost its power, and so its zero.
    pub power_cycle_after: Duration,
    /// Two active taxels closer than this belong to one contact, in metres.
    pub contact_reach_m: f64,
}

impl Default for LiveLimits {
    fn default() -> Self {
        Self {
            activation_sigmas: 4.0,
            activation_floor_counts: 2.0,
            stale_after: Duration::from_millis(150),
            stale_share_max: 0.2,
            power_cycle_after: Duration::from_secs(1),
            contact_reach_m: 0.015,
        }
    }
}

/// How the zero is taken.
#[derive(Clone, Copy, Debug)]
pub struct TarePlan {
    /// How long the skin is watched.
    pub duration: Duration,
    /// Take the zero by itself after start, if rest is proven against the active model set.
    pub at_start: bool,
    /// After so many whole scans that zero is taken provisionally, until `duration` is over; 0 is never.
    pub first_scans: u32,
    /// What counts as rest.
    pub rest: RestLimits,
}

impl Default for TarePlan {
    fn default() -> Self {
        Self { duration: Duration::from_secs(1), at_start: true, first_scans: 4, rest: RestLimits::default() }
    }
}

/// Whether and how far the zero follows the temperature of the skin; see [`crate::drift`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriftPlan {
    /// Whether it does at all.
    pub follow: bool,
    /// How fast at most, counts per minute.
    pub rate_max_counts_per_min: f64,
    /// How far at most from the proven zero, counts.
    pub bound_counts: f64,
}

impl Default for DriftPlan {
    fn default() -> Self {
        Self { follow: false, rate_max_counts_per_min: 1.0, bound_counts: 3.0 }
    }
}

/// The rules of a calibration session.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SessionLimits {
    /// A ramp ends by itself here.
    pub target: Kilopascal,
    /// A sample may lie this far behind the furthest pressure so far, on a rise below it: the gauge's noise.
    pub noise_band: Kilopascal,
    /// Which branches of the pressure a ramp gathers, unless its session asks for others.
    pub branches: Branch,
    /// Steepest rise that may enter the fit, in kPa/s.
    pub rise_max_kpa_per_s: f64,
    /// Steepest fall that may enter the fit, in kPa/s, positive.
    pub fall_max_kpa_per_s: f64,
    /// The falling branch of a ramp ends by itself here.
    pub fall_end: Kilopascal,
    /// Whether the hysteresis of a session over both branches is compensated.
    pub plays: PlaysChoice,
    /// Without a pressure frame for so long no scan can be paired.
    pub gauge_timeout: Duration,
    /// Without any pressure frame, or any rise, for so long the session fails; without any fall the ramp ends.
    pub patience: Duration,
    /// A ramp cannot start above this: the bag must be vented.
    pub vented_below: Kilopascal,
    /// Most scans of one session; a ramp ends when they are full.
    pub scans_max: usize,
    /// A taxel responds once its count has moved so far.
    pub responding_counts: u8,
}

impl Default for SessionLimits {
    fn default() -> Self {
        Self {
            target: Kilopascal(70.0),
            noise_band: Kilopascal(0.3),
            branches: Branch::Rising,
            rise_max_kpa_per_s: 5.0,
            fall_max_kpa_per_s: 5.0,
            fall_end: Kilopascal(1.0),
            plays: PlaysChoice::Auto,
            gauge_timeout: Duration::from_millis(500),
            patience: Duration::from_secs(60),
            vented_below: Kilopascal(10.0),
            scans_max: 36_000, // half an hour at 20 Hz
            responding_counts: 6,
        }
    }
}
