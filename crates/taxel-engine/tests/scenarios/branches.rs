//! Sessions over both branches: what enters while the pressure falls, and what the fit learns of it.

use std::sync::Arc;
use std::time::Duration;

use taxel_engine::Restored;
use taxel_engine::calibration::fit::{Branch, PlaysChoice};
use taxel_engine::calibration::{Direction, SampleRefusal, SessionState};
use taxel_engine::command::Command;
use taxel_engine::model_set::{ModelSet, RecordedTaxel};
use taxel_engine::plan::PatchPlan;
use taxel_engine::record::Sample;
use taxel_engine::snapshot::ForceState;
use taxel_model::{Estimator, FitOptions, Samples};
use taxel_sim::{Config, DielectricConfig, PumpCommand, World};

use crate::bench::{Bench, Disk, session_of};
use crate::rig::{patch_plan, plan, small_skin};
use crate::sessions::content;
use crate::shared::small;

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
    rise(&mut bench);
    (bench, number)
}

fn risen(friction: [f64; 2]) -> (Bench, u64) {
    risen_with(friction, |_| {})
}

fn rise(bench: &mut Bench) {
    bench.ramp(61.0, 4.0);
    bench.until(30.0, "the turn", |host| host.session().direction == Direction::Falling);
    bench.seconds(1.0);
}

/// Down to the end of the branch, and the fit of it.
fn fallen(bench: &mut Bench) -> Arc<ModelSet> {
    bench.ramp(0.0, 4.0);
    bench.until_state(40.0, SessionState::Review);
    bench.host.newest_set()
}

fn again(bench: &mut Bench, session: u64) -> Arc<ModelSet> {
    bench.world.pump(PumpCommand::Vent);
    bench.seconds(10.0);
    session_of(bench.ask(Command::StartRamp { session }));
    bench.until_state(30.0, SessionState::Ramping);
    rise(bench);
    fallen(bench)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// The median over the taxels of a figure in use.
fn typical(set: &ModelSet, figure: impl Fn(&RecordedTaxel) -> f64) -> f64 {
    median(set.recorded.as_ref().unwrap().taxels.iter().flatten().map(figure).collect())
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

/// With two cycles the second falling branch is kept from the fit that is tried on it.
#[test]
fn hysteresis_is_learned_over_both_branches_and_compensated() {
    let (mut bench, session) = risen_with(STRONG, |plan| plan.session.plays = PlaysChoice::Auto);
    fallen(&mut bench);
    let set = again(&mut bench, session);
    let recorded = set.recorded.as_ref().unwrap();
    let ratio = recorded.plays_error_ratio.unwrap();
    let width = typical(&set, |taxel| taxel.hysteresis_kpa.unwrap());
    let rmse = typical(&set, |t| t.rmse_kpa);
    eprintln!("plays leave {ratio:.2}, width {width:.2} kPa, RMSE {rmse:.2} kPa");
    assert!(
        ratio < 0.7 && rmse < 0.35 * width,
        "plays leave {ratio} of the error, {rmse} kPa of a loop of {width} kPa"
    );
    assert!((4.0..8.0).contains(&width), "two tenths of the mean pressure are 6 kPa: {width}");
    let with_plays = recorded.taxels.iter().flatten().filter(|taxel| taxel.plays.is_some()).count();
    assert!(
        with_plays >= 70 && set.method.ends_with("rising, hysteresis from falling, two plays about order 3 in use"),
        "{set:?}"
    );
    assert!(recorded.zero_return_counts() < 0.5, "{:?}", recorded.zero_return);
    assert!(set.taxels.iter().filter(|m| m.is_usable()).all(|m| m.quality.repeatability_kpa.is_some()));
}

#[test]
fn without_hysteresis_nothing_is_compensated() {
    let (mut bench, session) = risen([0.0, 0.0]);
    let one = fallen(&mut bench);
    let two = again(&mut bench, session);
    for set in [one, two] {
        let recorded = set.recorded.as_ref().unwrap();
        assert!(
            recorded.taxels.iter().flatten().all(|taxel| taxel.plays.is_none()),
            "{:?}",
            recorded.plays_error_ratio
        );
        let width = typical(&set, |taxel| taxel.hysteresis_kpa.unwrap());
        assert!(width.abs() < 0.2 && recorded.lag_s.abs() < 0.05, "{width} kPa, {} s", recorded.lag_s);
        assert!(set.method.ends_with("rising, hysteresis from falling"), "{}", set.method);
    }
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

#[test]
fn too_fast_a_fall_is_refused_and_a_vented_bag_ends_the_ramp() {
    let (mut bench, session) = risen(STRONG);
    bench.world.pump(PumpCommand::Vent);
    bench.until_state(10.0, SessionState::Review);
    assert!(bench.host.session().refused.get(SampleRefusal::TooFast) > 10, "{:?}", bench.host.session());
    let (_, falling) = branches_are_in_order(&bench.host.samples(session), 0.3);
    assert!(falling < 30, "{falling}");
    let recorded = bench.host.set(0).recorded.clone().unwrap();
    assert_eq!(recorded.plays_error_ratio, None, "nothing to judge plays by");
}

#[test]
fn the_operator_ends_first_the_rise_and_then_the_fall() {
    let mut bench = Bench::new(world(STRONG), plan(patch_plan(&small().skin)), Restored::default());
    bench.brought_up();
    let session = bench.start_session_over(Branch::Both, None);
    bench.ramp(40.0, 4.0);
    bench.seconds(11.0);
    let view = session_of(bench.ask(Command::FinishRamp { session }));
    assert_eq!((view.state, view.direction), (SessionState::Ramping, Direction::Falling));
    bench.ramp(10.0, 4.0);
    bench.seconds(5.0);
    let view = session_of(bench.ask(Command::FinishRamp { session }));
    assert_eq!(view.state, SessionState::Fitting);
    bench.until_state(1.0, SessionState::Review);
    let (rising, falling) = branches_are_in_order(&bench.host.samples(session), 0.3);
    assert!(rising > 150 && falling > 60, "{rising} up and {falling} down");
}

#[test]
fn a_fall_that_comes_to_a_stand_leaves_the_rise_to_be_fitted_and_says_so() {
    let (mut bench, _) = risen_with(STRONG, |plan| plan.session.patience = Duration::from_secs(3));
    bench.ramp(60.2, 4.0);
    bench.until_state(10.0, SessionState::Review);
    let view = bench.host.session();
    let why = "the falling branch ended early: the pressure did not fall for 3 s: it is 6";
    assert!(view.reason.starts_with(why), "{}", view.reason);
    assert!(bench.host.set(0).taxels.iter().filter(|m| m.is_usable()).count() >= 70);
}

#[test]
fn a_session_over_the_rising_branch_does_not_wait_for_a_fall() {
    let set = &small().set;
    assert!(set.recorded.is_none() && set.method == "order 5, pressure-binned", "{}", set.method);
}

/// The branch of a sample is not on disk: it follows from the pressures.
#[test]
fn a_session_killed_on_its_falling_branch_gives_the_same_models_as_one_that_was_not() {
    let (mut bench, session) = risen(STRONG);
    bench.ramp(0.0, 4.0);
    bench.seconds(10.0);
    let disk = Disk::after_a_crash(&bench.host);
    assert_eq!(disk.restored.sessions[0].direction, Direction::Falling, "the turn is on disk");
    bench.ask(Command::FinishRamp { session }).unwrap();
    bench.until_state(1.0, SessionState::Review);
    let uninterrupted = bench.host.set(0);

    let mut resumed = Bench::after(bench.world.clone(), bench.host.plan.clone(), disk);
    resumed.seconds(0.5);
    let view = session_of(resumed.ask(Command::FinishRamp { session }));
    assert_eq!((view.state, view.branches), (SessionState::Fitting, Branch::Both));
    resumed.until_state(1.0, SessionState::Review);
    let set = &resumed.host.set(0);
    assert_eq!(content(set), content(&uninterrupted));
    assert_eq!(format!("{:?}", set.recorded), format!("{:?}", uninterrupted.recorded));
    assert!(set.recorded.as_ref().unwrap().taxels.iter().flatten().all(|taxel| taxel.hysteresis_kpa.is_some()));
}

/// The falling branch is gathered as asked, but has no say, and the set is served like any other.
#[test]
fn a_session_of_the_papers_estimator_is_its_equation_over_the_rise_and_gives_a_force() {
    let (mut bench, session) = risen_with(STRONG, |plan| plan.fit.estimator = Estimator::Paper);
    let set = fallen(&mut bench);
    assert_eq!((set.method.as_str(), set.recorded.is_none()), ("order 5, paper", true));
    let samples = bench.host.samples(session);
    let (rising, falling) = branches_are_in_order(&samples, 0.3);
    assert!(falling > 250, "{falling}");
    let kpa = &bench.host.on_disk(session).unwrap().pressures_kpa()[..rising];
    for (taxel, model) in set.taxels.iter().enumerate() {
        let counts: Vec<f64> = samples[..rising].iter().map(|s| s.counts.counts().units(taxel).unwrap()).collect();
        let options = FitOptions { estimator: Estimator::Paper, ..bench.host.plan.patches[0].fit };
        let alone = taxel_model::fit(&Samples::new(&counts, kpa), &options);
        assert_eq!((model.estimator, &model.curve), (Estimator::Paper, &alone.curve), "taxel {taxel}");
    }
    bench.world.pump(PumpCommand::Vent);
    bench.seconds(20.0);
    bench.activate(&set.id).unwrap();
    bench.tare(None).unwrap();
    bench.until_force(10.0, ForceState::Ok);
    let weight = bench.lay(0.5, 35).0;
    bench.seconds(1.0);
    let read = bench.weigh(10);
    assert!((read / weight - 1.0).abs() < 0.4, "{read} N of {weight} N");
}
