//! The skins that stories play on, each calibrated once by the engine itself.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use taxel_engine::calibration::Branch;
use taxel_engine::calibration::SessionState;
use taxel_engine::command::Command;
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::PatchPlan;
use taxel_sim::{Config, DielectricConfig, Layer, LoadPath, PumpCommand, Skin, World};
use taxel_skin::{Board, Kilopascal, ModuleKind, Patch, Time};

use crate::daemon::Daemon;
use crate::dice::Dice;
use crate::rig::{BUS, board, module, patch_plan, plan};
use crate::store::Store;

/// Skins of 50 taxels; the one after them is the forearm.
const SMALL_SKINS: usize = 6;
pub const SKINS: usize = SMALL_SKINS + 1;
pub const SLOT: Duration = Duration::from_millis(10);

/// A skin after its calibration, vented and settled, its boards streaming.
pub struct House {
    pub world: World,
    pub set: Arc<ModelSet>,
}

/// Skin number `n` of [`SKINS`].
pub fn house(n: usize) -> &'static House {
    static HOUSES: [OnceLock<House>; SKINS] = [const { OnceLock::new() }; SKINS];
    HOUSES[n].get_or_init(|| calibrate(n))
}

/// Three modules on one board and two on another: one may be silent without the whole skin being stale.
fn small_skin() -> Skin {
    let boards = [(13, 3), (12, 2)].map(|(address, modules)| Board {
        bus: BUS,
        address: board(address),
        modules: (0..modules).map(|m| (module(m), ModuleKind::Triangle)).collect(),
    });
    Skin::sleeve(Patch::new("small", boards.into()).unwrap())
}

/// What stories vary of the scene.
pub fn scene(skin: &Skin, listens_only: bool, dice: &mut Dice) -> PatchPlan {
    let mut patch = patch_plan(skin);
    if listens_only {
        patch.bring_up = Vec::new();
    }
    patch.outputs.fill = dice.chance(0.5);
    patch.drift.follow = dice.chance(0.5);
    if dice.chance(0.2) {
        patch.geometry = None;
    }
    patch
}

fn calibrate(n: usize) -> House {
    let seed = 100 + n as u64;
    let skin = if n < SMALL_SKINS { small_skin() } else { Skin::forearm().unwrap() };
    // Every other skin tares so well that no taxel rests on a rail.
    let fine = DielectricConfig { tare_bias_counts: 1.0, tare_residue_counts: 0.5, ..DielectricConfig::default() };
    let dielectric = if n.is_multiple_of(2) { DielectricConfig::default() } else { fine };
    // Loads reach the taxels through a soft layer: where they were shared out over the taxels whose centres they cover, half
    // a load that hangs over the rim lay on one taxel alone, and its neighbours felt nothing of tens of newtons.
    let loads = LoadPath::Layer(Layer::default());
    let mut world = World::new(skin, Config { dielectric, loads, ..Config::seeded(seed) }).unwrap();
    let branches = if n % 3 == 1 { Branch::Both } else { Branch::Rising };
    let whole = plan(patch_plan(world.skin()));
    let mut daemon = Daemon::new(whole, Store::default(), Dice::new(seed), world.now());
    let in_state = |wanted: SessionState| {
        move |daemon: &Daemon| daemon.session.as_ref().is_some_and(|session| session.state == wanted)
    };
    let end = world.now() + Duration::from_secs(3);
    run(n, &mut world, &mut daemon, 4.0, "bring-up", &|daemon| daemon.newest.time >= end - Duration::from_millis(100));
    daemon.command(Command::StartSession {
        patch: String::new(),
        target: None,
        branches: Some(branches),
        confirmed_by: None,
        leave_out: Vec::new(),
    });
    run(n, &mut world, &mut daemon, 20.0, "ramp", &in_state(SessionState::Ramping));
    world.pump(PumpCommand::Ramp { target: Kilopascal(74.0), kpa_per_s: 3.0 });
    let full = |daemon: &Daemon| {
        daemon.session.as_ref().is_some_and(|s| s.state != SessionState::Ramping || s.pressure_kpa >= Some(72.0))
    };
    run(n, &mut world, &mut daemon, 60.0, "full vacuum", &full);
    world.pump(PumpCommand::Ramp { target: Kilopascal(0.0), kpa_per_s: 3.0 });
    run(n, &mut world, &mut daemon, 60.0, "models", &in_state(SessionState::Review));
    world.pump(PumpCommand::Vent);
    let settled = world.now() + Duration::from_secs(40);
    world.advance(settled, &mut Vec::new());
    let set = daemon.catalogue.model_sets.last().expect("the fit gave models").at_hand.clone().expect("it is new");
    House { world, set }
}

/// Lets time pass until `done`, which must come within `limit_s`.
fn run(n: usize, world: &mut World, daemon: &mut Daemon, limit_s: f64, what: &str, done: &dyn Fn(&Daemon) -> bool) {
    let end = world.now() + Duration::from_secs_f64(limit_s);
    while !done(daemon) {
        assert!(world.now() < end, "skin {n}: no {what} within {limit_s} s: {:?}", daemon.session);
        slot(world, daemon);
    }
}

/// 10 ms pass.
fn slot(world: &mut World, daemon: &mut Daemon) {
    let (end, mut frames): (Time, _) = (world.now() + SLOT, Vec::new());
    world.advance(end, &mut frames);
    daemon.advance(end, &frames);
    daemon.published.clear();
    for frame in std::mem::take(&mut daemon.sent) {
        world.send(end, &frame);
    }
}
