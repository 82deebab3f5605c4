//! What the engine is asked to do: everything here comes from the configuration, and nothing changes at run time.

use std::ops::Range;
use std::time::Duration;

use taxel_model::FitOptions;
use taxel_skin::{CountRange, Geometry, Patch, SquareMillimetre};

pub use crate::calibration::limits::SessionLimits;
pub use crate::force::measure::Outputs;
pub use crate::intake::bring_up::BoardSetup;
use crate::intake::bring_up::commands;
pub use crate::intake::cells::{DevicePlan, DeviceSignal, ScanBegin, Sender};
pub use crate::intake::gauge::Gauge;

use crate::baseline::Activation;
use crate::board_settings::{difference, line, sum};
use crate::calibration::branch::Branch;
use crate::calibration::fit::recipe_options::FitRecipe;
use crate::force::measure::Layout;
use crate::force::owner::ForcePlan;
use crate::intake::faults::limits::FaultLimits;
use crate::loads::load::LoadsPlan;
use crate::model_set::ModelSet;
use crate::regions::Regions;

/// Everything one engine does.
#[derive(Clone, Debug)]
pub struct Plan {
    /// How many buses frames can come from; a [`taxel_skin::BusIndex`] is below it.
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
    /// One per board of `patch.boards()` where these are no skin boards but devices that are described by their signals;
    /// else empty.
    pub devices: Vec<DevicePlan>,
    /// Where the scans are handed over whole by a program, and come in no frames; then `devices` has one without any.
    pub pushed: Option<PushPlan>,
    /// Whether a simulator makes its frames: no force of it is one of a real skin.
    pub simulated: bool,
    /// The period at which the boards send.
    pub period: Duration,
    /// Positions and normals, where the scene has them.
    pub geometry: Option<Geometry>,
    /// The area that each taxel stands for, one per taxel.
    pub areas: Vec<SquareMillimetre>,
    /// Relative standard uncertainty of the area that all taxels share.
    pub area_uncertainty: f64,
    /// The gauge that measures the bag's differential pressure; without one there is no calibration.
    pub gauge: Option<Gauge>,
    /// What a force sample carries.
    pub outputs: Outputs,
    /// When a taxel counts as stale.
    pub live: LiveLimits,
    /// How the zero is taken.
    pub tare: TarePlan,
    /// Whether it follows the temperature.
    pub follow_drift: bool,
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
            devices: Vec::new(),
            pushed: None,
            simulated: false,
            period: Duration::from_millis(50),
            geometry: None,
            areas: vec![SquareMillimetre::ICUB_TAXEL; patch.taxels().len()],
            area_uncertainty: 0.05,
            gauge: None,
            outputs: Outputs::default(),
            live: LiveLimits::default(),
            tare: TarePlan::default(),
            follow_drift: false,
            session: SessionLimits::default(),
            fit: FitOptions::default(),
            patch,
        }
    }

    /// Whether anything measures the pressure in the bag.
    #[must_use]
    pub fn has_gauge(&self) -> bool {
        self.gauge.is_some() || self.pushed.is_some_and(|pushed| pushed.pressure)
    }

    /// Whether the pressure in the bag is measured, or typed.
    #[must_use]
    pub fn can_calibrate(&self) -> bool {
        self.has_gauge() || self.session.typed
    }

    /// Whether the ambient pressure is what the gauge reads of the vented bag.
    #[must_use]
    pub fn takes_ambient(&self) -> bool {
        self.gauge.as_ref().is_some_and(|gauge| gauge.takes_ambient)
    }

    /// Whether the daemon sends anything to the boards.
    #[must_use]
    pub fn configures(&self) -> bool {
        !self.bring_up.is_empty() || self.devices.iter().any(DevicePlan::is_configured)
    }

    /// Whether a board of the patch is sent any commands.
    pub(crate) fn configures_board(&self, board: usize) -> bool {
        !self.bring_up.is_empty() || self.devices.get(board).is_some_and(DevicePlan::is_configured)
    }

    /// A sum over what the boards are and what they are sent, which is another for other settings.
    #[must_use]
    pub fn settings_sum(&self) -> u32 {
        let commands: Vec<_> = commands(&self.patch, &self.bring_up, &self.devices).collect();
        sum(&format!("{:?} {commands:?}", self.board_settings()))
    }

    /// A rail is where the converter ends, and what is silent or still for long depends on the period.
    #[must_use]
    pub fn fault_limits(&self) -> FaultLimits {
        let (counts, limits) = (self.patch.counts(), FaultLimits::default().at_period(self.period.as_secs_f32()));
        if counts == CountRange::BYTE {
            return limits;
        }
        FaultLimits { rail_high: counts.units(counts.top()) as f32, ..limits }
    }

    /// What of it the force needs.
    #[must_use]
    pub fn force(&self) -> ForcePlan {
        ForcePlan {
            layout: Layout {
                areas: self.areas.clone(),
                area_uncertainty: self.area_uncertainty,
                outputs: self.outputs,
                geometry: self.geometry.clone(),
                modules: self.modules(),
            },
            counts: self.patch.counts(),
            activation: Activation::OF_SKIN,
            stale_share_max: self.live.stale_share_max,
        }
    }

    /// How a session over these branches is fitted.
    pub(crate) fn recipe(&self, branch: Branch) -> FitRecipe {
        FitRecipe {
            options: self.fit,
            branch,
            plays: self.session.plays,
            faults: self.fault_limits(),
            // What a table of counts is cut into when this set is applied to one; live, each module has its own.
            module_size: self.modules().iter().map(ExactSizeIterator::len).max().unwrap_or(1),
            ..FitRecipe::default()
        }
    }

    /// Which taxels form each module.
    pub(crate) fn modules(&self) -> Vec<Range<usize>> {
        Regions::new(&self.patch).modules().to_vec()
    }

    /// What of it the known loads need.
    #[must_use]
    pub fn loads(&self) -> LoadsPlan {
        LoadsPlan {
            patch: self.patch.name().to_owned(),
            mean_area_mm2: self.areas.iter().map(|area| area.0).sum::<f64>() / self.areas.len().max(1) as f64,
            fills: self.outputs.fill && self.geometry.is_some(),
        }
    }

    /// How each board is set, as far as its counts depend on it, and which of its modules belong to the patch: in words, a line
    /// each board.
    pub(crate) fn board_settings(&self) -> Vec<String> {
        let of = |(at, board)| line(board, self.devices.get(at), self.bring_up.get(at), self.patch.counts());
        self.patch.boards().iter().enumerate().map(of).collect()
    }

    /// How the gauge is read, in words; empty without one.
    pub(crate) fn gauge_words(&self) -> String {
        match (&self.gauge, self.session.typed) {
            (Some(gauge), _) => gauge.words(),
            (None, true) => "typed by an operator".to_owned(),
            (None, false) => String::new(),
        }
    }

    /// How a gauge of these words was read otherwise than in this plan; `None` where it was not, or that is not known.
    pub(crate) fn gauge_differs_from(&self, then: &str) -> Option<String> {
        let now = self.gauge_words();
        let differs = !then.is_empty() && then != now;
        differs.then(|| format!("was gathered by a gauge that was configured as `{then}`, and is as `{now}` now"))
    }

    /// How boards of these lines were set otherwise than in this plan, in words that go on from what was gathered with them;
    /// `None` where they are the same, as far as both is known.
    pub(crate) fn differs_from(&self, lines: &[String]) -> Option<String> {
        difference(lines, &self.board_settings())
    }

    /// Why a model set says nothing of boards that are set as in this plan, in words.
    pub(crate) fn unfit_for_settings(&self, set: &ModelSet) -> Option<String> {
        let found = self.differs_from(&set.board_settings)?;
        Some(format!(
            "`{}` {found}: set it as it was, activate a set that was gathered as it is now, or calibrate again",
            set.id
        ))
    }
}

/// A skin whose scans are handed over by a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PushPlan {
    /// Whether the pressure in the bag comes with them.
    pub pressure: bool,
}

/// When a taxel counts as stale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LiveLimits {
    /// A module is stale, and its board suspect, when it has been silent for so long.
    pub stale_after: Duration,
    /// Above this share of stale taxels there is no force at all.
    pub stale_share_max: f64,
    /// A board silent for so long may have lost its power, and so its zero.
    pub power_cycle_after: Duration,
}

impl Default for LiveLimits {
    fn default() -> Self {
        Self {
            stale_after: Duration::from_millis(150),
            stale_share_max: 0.2,
            power_cycle_after: Duration::from_secs(1),
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
}

impl Default for TarePlan {
    fn default() -> Self {
        Self { duration: Duration::from_secs(1), at_start: true }
    }
}
