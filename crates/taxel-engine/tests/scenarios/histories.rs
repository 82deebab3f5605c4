//! What a skin with much hysteresis has lived through is known, or the uncertainty holds that it is not.

use std::sync::{Arc, OnceLock};

use taxel_engine::Restored;
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::PatchPlan;
use taxel_engine::snapshot::ForceState;
use taxel_sim::{BagConfig, Fault, PumpCommand, World};

use crate::bench::Bench;
use crate::hysteresis::calibrated_in;
use crate::rig::{board, module, patch_plan, plan};
use crate::shared::small;

/// The skin in a bag that presses and lets go within a scan or two, vented and settled, its set with plays, and the same
/// without them.
fn skin() -> &'static (World, [Arc<ModelSet>; 2]) {
    static SKIN: OnceLock<(World, [Arc<ModelSet>; 2])> = OnceLock::new();
    SKIN.get_or_init(|| {
        let quick = BagConfig { pump_kpa_per_s: 1_000.0, vent_s: 0.05, ..BagConfig::default() };
        let (mut bench, with) = calibrated_in(quick);
        bench.world.pump(PumpCommand::Vent);
        bench.seconds(30.0);
        let mut without = ModelSet { id: "m-without".to_owned(), ..ModelSet::clone(&with) };
        let taxels = without.recorded.as_mut().unwrap().taxels.iter_mut().flatten();
        taxels.for_each(|taxel| taxel.plays = None);
        (bench.world, [with, Arc::new(without)])
    })
}

/// A daemon that has taken its zero by itself, with one of the sets in use.
fn in_use(with_plays: bool) -> Bench {
    let (world, sets) = skin();
    let set = &sets[usize::from(!with_plays)];
    let restored = Restored {
        model_sets: sets.iter().cloned().map(Into::into).collect(),
        active: vec![(set.patch.clone(), set.id.clone())],
        next_session: 2,
        ..Restored::default()
    };
    let patch = PatchPlan { bring_up: Vec::new(), ..patch_plan(&small().skin) };
    let mut bench = Bench::new(world.clone(), plan(patch), restored);
    bench.until(5.0, "a force", |host| host.snapshots.last().is_some_and(|s| s.force.total.is_some()));
    bench
}

fn squeeze(bench: &mut Bench, kpa: f64, kpa_per_s: f64) {
    bench.ramp(kpa, kpa_per_s);
    let there = |bench: &Bench| (bench.world.true_pressure().0 - kpa).abs() < 0.5;
    while !there(bench) {
        bench.seconds(0.02);
    }
}

/// A lost acknowledgement is no proof of a new zero, and has to be looked at.
fn begin_doubt(bench: &mut Bench) {
    bench.inject(Fault::ModuleNoAck(board(12), module(0)));
    bench.until(3.0, "the doubt", |host| host.reasons().contains("looked at"));
    bench.repair(Fault::ModuleNoAck(board(12), module(0)));
}

fn end_doubt(bench: &mut Bench) {
    bench.until(10.0, "the end of the doubt", |host| host.snapshot().force.total.is_some());
}

/// How far the force is off now, relative, and its standard uncertainty.
fn errors(bench: &Bench) -> (f64, f64) {
    let (force, truth) = (&bench.host.snapshot().force, bench.world.true_force().0);
    assert!(matches!(force.state, ForceState::Ok | ForceState::Degraded), "{:?}", force.reasons);
    ((force.total.unwrap().0 - truth) / truth, force.total_sigma.unwrap().0 / truth)
}

/// On to a higher pressure, by more than any play, and back to rest, without a lie. How far the force was off there.
fn goes_on(bench: &mut Bench, mark: usize, story: &str) -> f64 {
    bench.seconds(1.0);
    let now = errors(bench);
    bench.ramp(55.0, 4.0);
    bench.seconds(12.0);
    let then = errors(bench);
    bench.ramp(0.0, 4.0);
    bench.seconds(20.0);
    eprintln!("{story}: error and sigma {now:.3?}, then at 55 kPa {then:.3?}");
    bench.is_truthful_since(mark, story);
    then.0
}

/// The same where the plays have seen everything.
fn watched() -> f64 {
    let mut bench = in_use(true);
    squeeze(&mut bench, 15.0, 10.0);
    let mark = bench.mark();
    goes_on(&mut bench, mark, "watched")
}

#[test]
fn a_set_that_is_activated_under_a_load_that_was_partly_released_tells_no_lie() {
    for (most, present) in [(60.0, 15.0), (60.0, 30.0), (30.0, 30.0)] {
        let mut bench = in_use(false);
        squeeze(&mut bench, most, 10.0);
        squeeze(&mut bench, present, 10.0);
        bench.seconds(2.0);
        bench.activate(&skin().1[0].id).unwrap();
        let mark = bench.mark();
        bench.seconds(0.2);
        let (error, sigma) = errors(&bench);
        assert!(error.abs() < 0.2, "{error} at {present} kPa, sigma {sigma}: of either branch it is half of a loop");
        goes_on(&mut bench, mark, &format!("{most} kPa, then {present}"));
    }
}

#[test]
fn a_set_that_is_activated_while_the_zero_is_in_doubt_follows_from_then_on() {
    let mut bench = in_use(false);
    squeeze(&mut bench, 60.0, 10.0);
    squeeze(&mut bench, 15.0, 10.0);
    bench.seconds(2.0);
    begin_doubt(&mut bench);
    let mark = bench.mark();
    bench.activate(&skin().1[0].id).unwrap();
    end_doubt(&mut bench);
    let (later, watched) = (goes_on(&mut bench, mark, "activated in doubt"), watched());
    assert!((later - watched).abs() < 0.03, "{later} after the activation, {watched} of a skin that was watched");
}

#[test]
fn a_squeeze_while_the_zero_is_in_doubt_is_not_forgotten() {
    let squeezed = |in_doubt: bool| {
        let mut bench = in_use(true);
        squeeze(&mut bench, 15.0, 10.0);
        bench.seconds(2.0);
        let mark = bench.mark();
        if in_doubt {
            begin_doubt(&mut bench);
        }
        squeeze(&mut bench, 60.0, 250.0);
        squeeze(&mut bench, 15.0, 250.0);
        let has_force = bench.host.snapshot().force.total.is_some();
        assert_eq!(has_force, !in_doubt, "{}", bench.host.reasons());
        end_doubt(&mut bench);
        bench.seconds(2.0);
        let errors = errors(&bench);
        goes_on(&mut bench, mark, &format!("squeezed, in doubt: {in_doubt}"));
        errors
    };
    let ((seen, _), (doubted, sigma)) = (squeezed(false), squeezed(true));
    assert!((doubted - seen).abs() < 0.05, "{doubted} after a doubt, {seen} without, sigma {sigma}");
}

#[test]
fn a_load_that_lands_or_goes_within_a_scan_tells_no_lie() {
    let mut bench = in_use(true);
    let mark = bench.mark();
    for kpa in [20.0, 60.0, 15.0, 40.0] {
        squeeze(&mut bench, kpa, 400.0);
        bench.seconds(2.0);
    }
    goes_on(&mut bench, mark, "squeezed at once");
}
