//! The skins that stories play on, each calibrated once by the engine itself.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use taxel_engine::calibration::Branch;
use taxel_engine::calibration::SessionState;
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::{PatchPlan, Plan};
use taxel_sim::{Config, DielectricConfig, Layer, LoadPath, PumpCommand, Skin, World};
use taxel_skin::{BoardAddress, Kilopascal, Module, Patch, TaxelIndex, Time};

use crate::daemon::Daemon;
use crate::dice::Dice;
use crate::rig::{plan_of_part, start_session, triangles};
use crate::store::Store;

pub const SLOT: Duration = Duration::from_millis(10);

/// How many patches the skin has that a story plays on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Patches {
    /// One of 50 taxels on two boards, or the forearm.
    One,
    /// Two of 50 taxels, far apart, that share one board or both.
    Two,
}

/// How long a story is, and what goes wrong in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Course {
    /// Some minutes in which anything may happen, far more often than on a robot.
    Minutes,
    /// Half an hour in which hands touch a skin that warms and cools, and nothing goes wrong.
    HalfHour,
    /// Eight hours of a robot, with faults as rare as there.
    Day,
}

impl Course {
    pub fn length(self, dice: &mut Dice) -> Duration {
        let minutes = Duration::from_secs_f64(dice.between(60.0, 300.0));
        match self {
            Self::Minutes => minutes,
            Self::HalfHour => Duration::from_secs(30 * 60),
            Self::Day => Duration::from_secs(8 * 3600),
        }
    }

    /// On real skin the variance of the sum of a module's ten taxels is twice that of independent ones.
    const fn common_noise_counts(self) -> f64 {
        if matches!(self, Self::Minutes) { 0.0 } else { 0.27 }
    }
}

/// The world of stories.
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    pub patches: Patches,
    pub course: Course,
}

impl Setting {
    pub const fn minutes(patches: Patches) -> Self {
        Self { patches, course: Course::Minutes }
    }
}

/// Skins of one patch of 50 taxels; the one after them is the forearm.
const SMALL_SKINS: usize = 6;
/// Skins of two patches: half of them share both boards.
const DOUBLE_SKINS: usize = 4;

impl Patches {
    /// The number of a skin; the forearm takes five times as long as the others.
    pub fn draw(self, dice: &mut Dice) -> usize {
        match self {
            Self::One if dice.chance(0.04) => SMALL_SKINS,
            Self::One => dice.below(SMALL_SKINS),
            Self::Two => dice.below(DOUBLE_SKINS),
        }
    }
}

/// A skin after its calibration, vented and settled, its boards streaming.
pub struct House {
    pub world: World,
    pub parts: Vec<Part>,
}

/// One patch of a house.
pub struct Part {
    /// As `taxeld` makes it of a scene that asks for everything.
    plan: PatchPlan,
    pub set: Arc<ModelSet>,
    /// Its taxels by their place on the world's skin, in its own order.
    pub taxels: Vec<TaxelIndex>,
    /// Whether a taxel of the world's skin is one of them.
    has: Vec<bool>,
}

impl Part {
    fn new(skin: &Skin, plan: PatchPlan, set: Arc<ModelSet>) -> Self {
        let whole = skin.patch();
        let place = |patch: &Patch, taxel: usize| {
            let site = patch.taxels()[taxel];
            let module = patch.modules()[usize::from(site.module)];
            (patch.boards()[usize::from(module.board)].address, module.module, site.slot)
        };
        let on_skin = |taxel: usize| {
            let of_patch = place(&plan.patch, taxel);
            (0..whole.taxels().len()).find(|of_skin| place(whole, *of_skin) == of_patch)
        };
        let taxels: Vec<usize> = (0..plan.patch.taxels().len()).filter_map(on_skin).collect();
        assert_eq!(taxels.len(), plan.patch.taxels().len(), "each taxel of the patch is one of the skin");
        let has = (0..whole.taxels().len()).map(|taxel| taxels.contains(&taxel)).collect();
        let taxels = taxels.into_iter().map(|taxel| TaxelIndex(taxel as u16)).collect();
        Self { plan, set, taxels, has }
    }

    pub fn name(&self) -> &str {
        self.plan.patch.name()
    }

    /// Its taxels without a model, by their place on the world's skin.
    pub fn excluded(&self) -> Vec<TaxelIndex> {
        let models = self.taxels.iter().zip(&self.set.taxels);
        models.filter(|(_, model)| !model.is_usable()).map(|(taxel, _)| *taxel).collect()
    }

    pub const fn patch(&self) -> &Patch {
        &self.plan.patch
    }

    /// Whether this taxel of the world's skin is of this patch.
    pub fn has(&self, taxel: TaxelIndex) -> bool {
        self.has[usize::from(taxel.0)]
    }

    pub fn has_board(&self, address: BoardAddress) -> bool {
        self.patch().boards().iter().any(|board| board.address == address)
    }

    pub fn has_module(&self, address: BoardAddress, module: Module) -> bool {
        let of_board = self.patch().boards().iter().filter(|board| board.address == address);
        of_board.flat_map(|board| &board.modules).any(|(other, _)| *other == module)
    }

    /// What stories vary of the scene.
    pub fn scene(&self, listens_only: bool, dice: &mut Dice) -> PatchPlan {
        let mut patch = self.plan.clone();
        if listens_only {
            patch.bring_up = Vec::new();
        }
        patch.outputs.fill = dice.chance(0.5);
        patch.follow_drift = dice.chance(0.5);
        if dice.chance(0.2) {
            patch.geometry = None;
        }
        patch
    }
}

/// Skin number `n`, as [`Patches::draw`] numbers them.
pub fn house(Setting { patches, course }: Setting, n: usize) -> &'static House {
    static ONE: [[OnceLock<House>; SMALL_SKINS + 1]; 2] = [const { [const { OnceLock::new() }; SMALL_SKINS + 1] }; 2];
    static TWO: [[OnceLock<House>; DOUBLE_SKINS]; 2] = [const { [const { OnceLock::new() }; DOUBLE_SKINS] }; 2];
    let common = course.common_noise_counts();
    let [one, two] = [&ONE[usize::from(common > 0.0)][..], &TWO[usize::from(common > 0.0)][..]];
    let calibrate = |skin| calibrate(n, skin, common);
    match patches {
        Patches::One if n == SMALL_SKINS => one[n].get_or_init(|| calibrate(whole(Skin::forearm().unwrap()))),
        Patches::One => one[n].get_or_init(|| calibrate(whole(small_skin()))),
        Patches::Two => two[n].get_or_init(|| calibrate(double_skin(n < DOUBLE_SKINS / 2))),
    }
}

/// A skin that is one patch.
fn whole(skin: Skin) -> (Skin, Vec<Patch>) {
    let patch = skin.patch().clone();
    (skin, vec![patch])
}

/// Three modules on one board and two on another: one may be silent without the whole skin being stale.
fn small_skin() -> Skin {
    Skin::sleeve(triangles("small", &[(13, 0..3), (12, 0..2)]))
}

/// Two patches as the small skin, 19 cm apart: nothing that lies on one touches the other. Both have modules of board 13; the
/// others are of one board, too, or of one each.
fn double_skin(shares_both: bool) -> (Skin, Vec<Patch>) {
    let upper = triangles("upper", &[(13, 0..3), (12, 0..2)]);
    let (lower, skin) = if shares_both {
        (triangles("lower", &[(13, 3..6), (12, 2..4)]), triangles("whole", &[(13, 0..6), (12, 0..4)]))
    } else {
        (triangles("lower", &[(13, 3..6), (11, 0..2)]), triangles("whole", &[(13, 0..6), (12, 0..2), (11, 0..2)]))
    };
    // Of board 13 three modules of either, then two of the upper patch and two of the lower one.
    let places = vec![0, 1, 2, 64, 65, 66, 3, 4, 67, 68];
    (Skin::sleeve_at(skin, places), vec![upper, lower])
}

fn calibrate(n: usize, (skin, patches): (Skin, Vec<Patch>), common_noise_counts: f64) -> House {
    let seed = 100 + n as u64;
    // Every other skin tares so well that no taxel rests on a rail.
    let fine = DielectricConfig { tare_bias_counts: 1.0, tare_residue_counts: 0.5, ..DielectricConfig::default() };
    let dielectric = if n.is_multiple_of(2) { DielectricConfig::default() } else { fine };
    let dielectric = DielectricConfig { common_noise_counts, ..dielectric };
    // Loads reach the taxels through a soft layer: where they were shared out over the taxels whose centres they cover, half
    // a load that hangs over the rim lay on one taxel alone, and its neighbours felt nothing of tens of newtons.
    let loads = LoadPath::Layer(Layer::default());
    let plans: Vec<PatchPlan> = patches.into_iter().map(|patch| plan_of_part(&skin, patch)).collect();
    let mut world = World::new(skin, Config { dielectric, loads, ..Config::seeded(seed) });
    let branches = if n % 3 == 1 { Branch::Both } else { Branch::Rising };
    let plan = Plan { buses: 1, patches: plans.clone() };
    let mut daemon = Daemon::new(Arc::new(plan), Store::default(), Dice::new(seed), world.now());
    let in_state = |wanted: SessionState| {
        move |daemon: &Daemon| {
            daemon.sessions.iter().flatten().filter(|s| s.state == wanted).count() == daemon.sessions.len()
        }
    };
    let end = world.now() + Duration::from_secs(3);
    let is_up = |daemon: &Daemon| daemon.newest.iter().all(|newest| newest.time >= end - Duration::from_millis(100));
    run(n, &mut world, &mut daemon, 4.0, "bring-up", &is_up);
    for plan in &plans {
        daemon.command(start_session(plan.patch.name(), None, Some(branches)));
    }
    run(n, &mut world, &mut daemon, 20.0, "ramp", &in_state(SessionState::Ramping));
    world.pump(PumpCommand::Ramp { target: Kilopascal(74.0), kpa_per_s: 3.0 });
    let full = |daemon: &Daemon| {
        daemon.sessions.iter().flatten().all(|s| s.state != SessionState::Ramping || s.pressure_kpa >= Some(72.0))
    };
    run(n, &mut world, &mut daemon, 60.0, "full vacuum", &full);
    world.pump(PumpCommand::Ramp { target: Kilopascal(0.0), kpa_per_s: 3.0 });
    run(n, &mut world, &mut daemon, 60.0, "models", &in_state(SessionState::Review));
    world.pump(PumpCommand::Vent);
    let settled = world.now() + Duration::from_secs(40);
    world.advance(settled, &mut Vec::new());
    let with_models = |plan: PatchPlan| {
        let mut sets = daemon.catalogue.model_sets.iter().filter(|set| set.patch == plan.patch.name());
        let set = daemon.set_of(&sets.next_back().expect("the fit gave models").id);
        Part::new(world.skin(), plan, set)
    };
    let parts = plans.into_iter().map(with_models).collect();
    House { world, parts }
}

/// Lets time pass until `done`, which must come within `limit_s`.
fn run(n: usize, world: &mut World, daemon: &mut Daemon, limit_s: f64, what: &str, done: &dyn Fn(&Daemon) -> bool) {
    let end = world.now() + Duration::from_secs_f64(limit_s);
    while !done(daemon) {
        assert!(world.now() < end, "skin {n}: no {what} within {limit_s} s: {:?}", daemon.sessions);
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
