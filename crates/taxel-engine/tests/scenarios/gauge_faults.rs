//! A gauge that is wrong for a while in a ramp: nothing of that while enters the models.

use std::sync::Arc;
use std::time::Duration;

use taxel_engine::Restored;
use taxel_engine::calibration::{SampleRefusal, SessionState};
use taxel_engine::command::Command;
use taxel_engine::model_set::ModelSet;
use taxel_sim::Fault;

use crate::bench::Bench;
use crate::rig::{patch_plan, plan, small_world};
use crate::shared::small;

#[test]
fn what_a_gauge_says_while_it_stands_still_in_a_fast_ramp_never_enters() {
    let mut bench = Bench::new(small_world(), plan(patch_plan(&small().skin)), Restored::default());
    bench.brought_up();
    let session = bench.start_session(None);
    bench.ramp(74.0, 4.0);
    bench.until(30.0, "pressure", |host| host.session().pressure_kpa.is_some_and(|p| p >= 20.0));
    bench.inject(Fault::GaugeStuck);
    bench.seconds(1.0);
    bench.repair(Fault::GaugeStuck);
    bench.until(60.0, "the end of the ramp", |host| host.session().state != SessionState::Ramping);
    let samples = bench.host.samples(session);
    assert!(samples.len() > 150, "the rest of the ramp enters: {}", samples.len());
    let repeated = samples.windows(2).filter(|pair| pair[0].pressure_kpa == pair[1].pressure_kpa).count();
    assert_eq!(repeated, 0, "samples at the pressure at which the gauge stood still");
    let refused = bench.host.session().refused.get(SampleRefusal::GaugeStuck);
    assert!(refused >= 10, "{refused} refused as such: {:?}", bench.host.session().refused);
}

#[test]
fn a_gauge_that_jumps_and_stays_ends_the_ramp_by_name() {
    for kpa in [3.0, -3.0] {
        let mut bench = Bench::new(small_world(), plan(patch_plan(&small().skin)), Restored::default());
        bench.brought_up();
        let session = bench.start_session(None);
        bench.ramp(74.0, 4.0);
        bench.until(30.0, "pressure", |host| host.session().pressure_kpa.is_some_and(|p| p >= 20.0));
        let before = bench.world.true_pressure().0;
        bench.inject(Fault::GaugeOffset { kpa });
        bench.until_state(10.0, SessionState::Failed);
        let reason = &bench.host.session().reason;
        assert!(reason.starts_with(&format!("the gauge jumped by {kpa:+.1} kPa")), "{reason}");
        let last = bench.host.samples(session).last().map_or(0.0, |sample| sample.pressure_kpa);
        assert!((before - 1.0..before + 0.2).contains(&last), "{last} entered, the gauge jumped at {before}");
    }
}

#[test]
fn a_gauge_that_is_back_within_a_second_costs_the_ramp_only_what_it_said_meanwhile() {
    let mut bench = Bench::new(small_world(), plan(patch_plan(&small().skin)), Restored::default());
    bench.brought_up();
    let session = bench.start_session(None);
    bench.ramp(74.0, 4.0);
    bench.until(30.0, "pressure", |host| host.session().pressure_kpa.is_some_and(|p| p >= 20.0));
    bench.inject(Fault::GaugeOffset { kpa: 3.0 });
    bench.seconds(0.6);
    bench.repair(Fault::GaugeOffset { kpa: 3.0 });
    bench.until(60.0, "the end of the ramp", |host| host.session().state != SessionState::Ramping);
    assert_ne!(bench.host.session().state, SessionState::Failed, "{}", bench.host.session().reason);
    let samples = bench.host.samples(session);
    assert!(samples.len() > 150, "the rest of the ramp enters: {}", samples.len());
    let rises = samples.windows(2).map(|pair| pair[1].pressure_kpa - pair[0].pressure_kpa);
    let falls = rises.filter(|step| *step < -0.3).count();
    assert_eq!(falls, 0, "a sample of an offset that ended would be above those after it");
}

/// The set of a session whose gauge was off by so much since before it began.
fn set_of_a_gauge_off_by(kpa: f64) -> Arc<ModelSet> {
    let mut bench = Bench::new(small_world(), plan(patch_plan(&small().skin)), Restored::default());
    bench.brought_up();
    bench.inject(Fault::GaugeOffset { kpa });
    bench.seconds(1.5);
    bench.start_session(None);
    bench.ramp(90.0, 2.0);
    bench.until_state(60.0, SessionState::Review);
    bench.host.set(0)
}

#[test]
fn a_gauge_that_is_off_since_before_the_ramp_is_taken_from_what_it_read_at_rest_and_that_stays_in_doubt() {
    let [right, off] = [0.0, 9.0].map(set_of_a_gauge_off_by);
    assert!(right.gauge_offset_kpa < 0.1 && !right.method.contains("at rest"), "{}", right.method);
    assert!((2.9..3.1).contains(&off.gauge_offset_kpa), "{}: a third of 9 kPa", off.gauge_offset_kpa);
    assert!(off.method.ends_with(", less 9.0 kPa that the gauge read at rest"), "{}", off.method);
    assert!((off.pressure_max_kpa - (right.pressure_max_kpa - 9.0)).abs() < 0.2, "{}", off.pressure_max_kpa);
    assert!(off.taxels.iter().all(|model| model.gauge.offset_kpa >= 2.9));
    for part in [-0.5, 0.0, 0.4, 0.8] {
        // Over the skin: single taxels read their own noise.
        let pairs = right.taxels.iter().zip(&off.taxels).filter(|(right, _)| right.is_usable());
        let apart = pairs.map(|(right, off)| {
            let curve = right.curve.as_ref().unwrap();
            let count = curve.centre + part * curve.half_width;
            off.kpa(count).unwrap() - right.kpa(count).unwrap()
        });
        let apart: Vec<f64> = apart.collect();
        let mean = apart.iter().sum::<f64>() / apart.len() as f64;
        assert!(mean.abs() < 0.3, "{mean} kPa apart at {part} of the range");
    }
}

#[test]
fn a_gauge_that_jumps_just_before_the_ramp_begins_has_no_zero_and_the_ramp_is_void() {
    let start = || {
        let mut bench = Bench::new(small_world(), plan(patch_plan(&small().skin)), Restored::default());
        bench.brought_up();
        let (patch, leave_out) = (String::new(), Vec::new());
        bench
            .ask(Command::StartSession { patch, target: None, branches: None, confirmed_by: None, leave_out })
            .unwrap();
        bench
    };
    let mut first = start();
    let asked = first.now();
    first.until(10.0, "the ramp", |host| host.session().state == SessionState::Ramping);
    let watched_s = first.now().seconds_since(asked);
    for before_s in [0.1, 0.3, 0.7] {
        let mut bench = start();
        bench.seconds(watched_s - before_s);
        bench.inject(Fault::GaugeOffset { kpa: 6.0 });
        bench.until(10.0, "the ramp", |host| host.session().state == SessionState::Ramping);
        bench.ramp(74.0, 2.0);
        bench.until_state(30.0, SessionState::Failed);
        let reason = &bench.host.session().reason;
        assert!(reason.starts_with("the gauge jumped by +6.0 kPa"), "{before_s} s before: {reason}");
        assert_eq!(bench.host.session().accepted, 0, "{before_s} s before");
    }
}

/// Boards brought up, a session that is not patient on its way up.
fn rising(change: impl FnOnce(&mut Bench)) -> Bench {
    let mut patch = patch_plan(&small().skin);
    patch.session.patience = Duration::from_secs(3);
    let mut bench = Bench::new(small_world(), plan(patch), Restored::default());
    bench.brought_up();
    bench.start_session(None);
    change(&mut bench);
    bench
}

#[test]
fn a_leak_is_named_when_it_ends_a_session() {
    let mut bench = rising(|bench| bench.ramp(74.0, 4.0));
    bench.until(30.0, "pressure", |host| host.session().pressure_kpa.is_some_and(|p| p >= 30.0));
    bench.inject(Fault::BagLeak { leak_s: 0.5 });
    bench.until_state(30.0, SessionState::Failed);
    let reason = &bench.host.session().reason;
    assert!(reason.contains("the bag leaks, or the pump has stopped"), "{reason}");
}

#[test]
fn a_gauge_that_stands_still_while_the_skin_is_pressed_is_named_when_it_ends_a_session() {
    let mut bench = rising(|bench| {
        bench.inject(Fault::GaugeStuck);
        bench.ramp(74.0, 4.0);
    });
    bench.until_state(30.0, SessionState::Failed);
    let reason = &bench.host.session().reason;
    assert!(reason.contains("taxels have moved, and the gauge only"), "{reason}");
}
