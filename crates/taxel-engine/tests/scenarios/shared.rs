//! Calibrations that many scenes begin with, made once.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use taxel_engine::Restored;
use taxel_engine::calibration::{SessionState, SessionView};
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::PatchPlan;
use taxel_engine::snapshot::ForceState;
use taxel_sim::{Config, PumpCommand, Skin, World};
use taxel_wire::TimedFrame;

use crate::bench::Bench;
use crate::disk::Disk;
use crate::rig::{patch_plan, plan, small_skin, small_world};

/// A skin after its calibration, vented and settled, its boards streaming.
pub struct Calibrated {
    pub skin: Skin,
    pub world: World,
    pub session: SessionView,
    pub set: Arc<ModelSet>,
    /// All frames from the start to the end of the fit.
    pub log: Vec<TimedFrame>,
}

/// The vacuum bag paper's forearm, at a ramp of 2 kPa/s.
pub fn forearm() -> &'static Calibrated {
    static FOREARM: OnceLock<Calibrated> = OnceLock::new();
    FOREARM.get_or_init(|| calibrate(World::new(Skin::forearm().unwrap(), Config::seeded(7)), 2.0))
}

/// 80 taxels, at a ramp of 4 kPa/s.
pub fn small() -> &'static Calibrated {
    static SMALL: OnceLock<Calibrated> = OnceLock::new();
    SMALL.get_or_init(|| calibrate(small_world(), 4.0))
}

/// 80 taxels of an ordinary skin, whose boards leave as much of a zero as those of the forearm.
pub fn ordinary() -> &'static Calibrated {
    static ORDINARY: OnceLock<Calibrated> = OnceLock::new();
    ORDINARY.get_or_init(|| calibrate(World::new(small_skin(), Config::seeded(11)), 4.0))
}

fn calibrate(world: World, kpa_per_s: f64) -> Calibrated {
    let skin = world.skin().clone();
    let mut bench = Bench::new(world, plan(patch_plan(&skin)), Restored::default());
    bench.log = Some(Vec::new());
    bench.brought_up();
    bench.start_session(None);
    bench.ramp(74.0, kpa_per_s);
    bench.until(100.0, "the end of the ramp", |host| host.session().state != SessionState::Ramping);
    let log = bench.log.take().unwrap();
    bench.world.pump(PumpCommand::Vent);
    let settled = bench.now() + Duration::from_secs(20);
    bench.world.advance(settled, &mut Vec::new());
    let session = bench.host.session().clone();
    let set = bench.host.newest_set();
    Calibrated { skin, world: bench.world, session, set, log }
}

impl Calibrated {
    /// What a store gives back after a restart with this calibration in use.
    pub fn restored(&self) -> Restored {
        Disk::with(vec![Arc::clone(&self.set)], &[patch_plan(&self.skin)]).found()
    }

    /// A daemon that starts beside the streaming boards and configures them if need be.
    pub fn started(&self) -> Bench {
        Bench::new(self.world.clone(), plan(patch_plan(&self.skin)), self.restored())
    }

    /// The same, its boards verified and a force there.
    pub fn in_charge(&self) -> Bench {
        let mut bench = self.started();
        bench.brought_up();
        bench.until_force(5.0, ForceState::Ok);
        bench
    }

    /// A daemon that starts beside the streaming boards and only listens, with a plan and a store of its own.
    pub fn listening(&self, restored: Restored, change: impl FnOnce(&mut PatchPlan)) -> Bench {
        let mut patch = PatchPlan { bring_up: Vec::new(), ..patch_plan(&self.skin) };
        change(&mut patch);
        Bench::new(self.world.clone(), plan(patch), restored)
    }

    /// A daemon that starts beside the streaming boards, only listens, and has taken its zero by itself.
    pub fn in_use(&self) -> Bench {
        self.in_use_with(|_| {})
    }

    /// The same with a plan of its own.
    pub fn in_use_with(&self, change: impl FnOnce(&mut PatchPlan)) -> Bench {
        let mut bench = self.listening(self.restored(), change);
        bench.until(5.0, "a force", |host| host.snapshots.last().is_some_and(|s| s.force.total.is_some()));
        bench
    }
}
