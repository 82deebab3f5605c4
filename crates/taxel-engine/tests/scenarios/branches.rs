//! Sessions over both branches: what enters while the pressure falls, and what the fit learns of it.

use taxel_engine::calibration::Direction;
use taxel_engine::record::Sample;
use taxel_model::Samples;

use crate::prelude::*;
use crate::sessions::content;

const STRONG: [f64; 2] = [0.08, 0.12];

/// 80 taxels off the rails whose loop is twice this share of the pressure wide.
fn world(friction: [f64; 2]) -> World {
    let dielectric = DielectricConfig {
        tare_bias_counts: 1.0,
        tare_residue_counts: 0.5,
        friction,
        creep_share: 0.0,
        ..DielectricConfig::default()
    };
    World::new(small_skin(), Config { dielectric, ..Config::seeded(3) })
}

/// On the falling branch, with the bag still at about 61 kPa.
fn risen_with(friction: [f64; 2], change: impl FnOnce(&mut PatchPlan)) -> (Bench, u64) {
    let mut patch = patch_plan(&small().skin);
    change(&mut patch);
    let mut bench = Bench::new(world(friction), plan(patch), Restored::default());
    bench.brought_up();
    let number = bench.start_session_over(Branch::Both, Some(60.0));
    bench.ramp(61.0, 4.0);
    bench.until(30.0, "the turn", |host| host.session().direction == Direction::Falling);
    bench.seconds(1.0);
    (bench, number)
}

fn risen(friction: [f64; 2]) -> (Bench, u64) {
    risen_with(friction, |_| {})
}

/// Down to the end of the branch, and the fit of it.
fn fallen(bench: &mut Bench) -> Arc<ModelSet> {
    bench.ramp(0.0, 4.0);
    bench.until_state(40.0, SessionState::Review);
    bench.host.newest_set()
}

/// Samples of each branch never go back by more than the noise band; returns how many are of each.
fn branches_are_in_order(samples: &[Sample], band: f64) -> (usize, usize) {
    let kpa: Vec<f64> = samples.iter().map(|s| s.pressure_kpa).collect();
    let top = (0..kpa.len()).max_by(|&a, &b| kpa[a].total_cmp(&kpa[b])).unwrap();
    let in_order = |sign: f64, branch: &[f64]| {
        let mut furthest = f64::NEG_INFINITY;
        for p in branch.iter().map(|p| sign * p) {
            assert!(p >= furthest - band, "{p} after {furthest}");
            furthest = furthest.max(p);
        }
    };
    in_order(1.0, &kpa[..=top]);
    in_order(-1.0, &kpa[top + 1..]);
    (top + 1, kpa.len() - top - 1)
}

#[test]
fn what_enters_goes_the_way_of_its_branch() {
    let (mut bench, session) = risen(STRONG);
    let session_now = bench.host.session();
    assert_eq!((session_now.state, session_now.branches), (SessionState::Ramping, Branch::Both));
    bench.ramp(30.0, 4.0);
    bench.seconds(9.2); // the fall, and the second for which its last scans wait
    let refused = |bench: &Bench| bench.host.session().refused.get(SampleRefusal::NotFalling);
    let (accepted, before) = (bench.host.session().accepted, refused(&bench));
    bench.ramp(45.0, 4.0); // back up in the middle of the fall
    bench.seconds(4.0);
    let entered = bench.host.session().accepted - accepted;
    assert!(entered <= 10, "{entered} entered beyond the half second in which the trend turns");
    assert!(refused(&bench) >= before + 70, "{:?}", bench.host.session());
    fallen(&mut bench);
    let samples = bench.host.samples(session);
    let (rising, falling) = branches_are_in_order(&samples, 0.3);
    assert!(rising > 250 && falling > 250, "{rising} up and {falling} down");
    assert!(samples.last().unwrap().pressure_kpa < 2.0);
}

/// The branch of a sample is not on disk: it follows from the pressures.
#[test]
fn a_session_killed_on_its_falling_branch_gives_the_same_models_as_one_that_was_not() {
    let (mut bench, session) = risen(STRONG);
    bench.ramp(0.0, 4.0);
    bench.seconds(10.0);
    let disk = bench.host.disk.clone();
    assert_eq!(disk.restored.sessions[0].direction, Direction::Falling, "the turn is on disk");
    bench.finish(session);
    let uninterrupted = bench.host.set(0);
    let mut resumed = Bench::after(bench.world.clone(), bench.host.plan.clone(), disk);
    resumed.seconds(0.5);
    resumed.finish(session);
    assert_eq!(resumed.host.session().branches, Branch::Both);
    let set = &resumed.host.set(0);
    assert_eq!(content(set), content(&uninterrupted));
    assert_eq!(format!("{:?}", set.recorded), format!("{:?}", uninterrupted.recorded));
}

/// The falling branch is gathered as asked, but has no say, and the set is served like any other.
#[test]
fn a_session_of_the_papers_equation_is_fitted_over_the_rise_and_gives_a_force() {
    let (mut bench, session) = risen_with(STRONG, |plan| plan.fit.paper = true);
    let set = fallen(&mut bench);
    assert_eq!((set.method.as_str(), set.recorded.is_none()), ("order 5, paper", true));
    let samples = bench.host.samples(session);
    let (rising, falling) = branches_are_in_order(&samples, 0.3);
    assert!(falling > 250, "{falling}");
    let kpa = &bench.host.disk.samples[&session].clone().pressures_kpa()[..rising];
    for (taxel, model) in set.taxels.iter().enumerate() {
        let counts: Vec<f64> = samples[..rising].iter().map(|s| s.counts.counts().units(taxel).unwrap()).collect();
        let alone = taxel_model::fit(&Samples::new(&counts, kpa), &bench.host.plan.patches[0].fit);
        assert_eq!((&model.points, &model.curve), (&None, &alone.curve), "taxel {taxel}");
    }
    bench.vent(20.0);
    bench.activate(&set.id).unwrap();
    bench.tare(None).unwrap();
    bench.until_force(10.0, ForceState::Ok);
    let weight = bench.lay(0.5, 35).0;
    bench.seconds(1.0);
    let read = bench.weigh(10);
    assert!((read / weight - 1.0).abs() < 0.4, "{read} N of {weight} N");
}
