//! The installations that the scenes play on.

use std::ops::Range;
use std::sync::Arc;

use taxel_engine::calibration::fit::Branch;
use taxel_engine::command::Command;
use taxel_engine::plan::{BoardSetup, Gauge, Outputs, PatchPlan, Plan};
use taxel_model::{FitOptions, GaugeUncertainty};
use taxel_sim::{Config, DielectricConfig, GaugeConfig, HOST_BOARD_CONFIG, Skin, World};
use taxel_skin::{Board, BoardAddress, BusIndex, Geometry, Kilopascal, Module, ModuleKind, Patch};
use taxel_wire::icub::TriangleConfig;

pub const BUS: BusIndex = BusIndex(0);

pub fn board(address: u8) -> BoardAddress {
    BoardAddress::new(address).unwrap()
}

pub fn module(number: u8) -> Module {
    Module::new(number).unwrap()
}

/// 80 taxels: six modules on board 13 and two on board 12, so that one module is less and board 12 more than the share
/// of the skin that may be silent.
pub fn small_skin() -> Skin {
    Skin::sleeve(triangles("small", &[(13, 0..6), (12, 0..2)]))
}

/// A patch of these triangles, by board.
pub fn triangles(name: &str, boards: &[(u8, Range<u8>)]) -> Patch {
    let boards = boards.iter().map(|(address, modules)| Board {
        bus: BUS,
        address: board(*address),
        modules: modules.clone().map(|m| (module(m), ModuleKind::Triangle)).collect(),
    });
    Patch::new(name, boards.collect()).unwrap()
}

/// A world of the small skin whose zero leaves every taxel off the rails, so that nothing but the scene's own trouble
/// keeps a force from being good. Its boards wait to be brought up.
pub fn small_world() -> World {
    let dielectric =
        DielectricConfig { tare_bias_counts: 1.0, tare_residue_counts: 0.5, ..DielectricConfig::default() };
    World::new(small_skin(), Config { dielectric, ..Config::seeded(3) })
}

/// What `taxeld` makes of a scene that asks for everything.
pub fn patch_plan(skin: &Skin) -> PatchPlan {
    plan_of_part(skin, skin.patch().clone())
}

/// A command for each run of consecutive modules.
pub fn setup(board: &Board) -> BoardSetup {
    let numbers: Vec<Module> = board.modules.iter().map(|(number, _)| *number).collect();
    let triangles = numbers.chunk_by(|a, b| a.get() + 1 == b.get()).map(|run| TriangleConfig {
        first: run[0],
        last: run[run.len() - 1],
        shift: 2,
        enabled: true,
        cdc_offset: 0x2200,
    });
    BoardSetup { board: HOST_BOARD_CONFIG, triangles: triangles.collect() }
}

/// The same of a patch that is a part of the skin, and has the first of its boards in the same order.
pub fn plan_of_part(skin: &Skin, patch: Patch) -> PatchPlan {
    PatchPlan {
        bring_up: patch.boards().iter().map(setup).collect(),
        geometry: Some(Geometry::parse(&skin.positions_file(), &patch).unwrap()),
        areas: vec![skin.taxel_area(); patch.taxels().len()],
        area_uncertainty: 0.01,
        gauge: Some(Gauge::new(BUS, GaugeConfig::default().signal)),
        // Loads are shared out over the taxels under them: a sum has nothing to be mended by place.
        outputs: Outputs { resultant: true, moment: true, contacts: true, fill: true, place: false },
        fit: FitOptions {
            gauge: GaugeUncertainty { gain_rel: 0.0025, offset_kpa: 0.05, noise_kpa: 0.02 },
            ..FitOptions::default()
        },
        ..PatchPlan::new(patch)
    }
}

/// A session of a patch that nobody confirms and that leaves nothing out.
pub fn start_session(patch: &str, target_kpa: Option<f64>, branches: Option<Branch>) -> Command {
    let (patch, target) = (patch.to_owned(), target_kpa.map(Kilopascal));
    Command::StartSession { patch, target, branches, confirmed_by: None, leave_out: Vec::new() }
}

pub fn plan(patch: PatchPlan) -> Arc<Plan> {
    Arc::new(Plan { buses: 1, patches: vec![patch] })
}
