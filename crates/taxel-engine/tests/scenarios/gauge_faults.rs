//! A gauge that is wrong for a while in a ramp: nothing of that while enters the models.

use std::time::Duration;

use taxel_engine::Restored;
use taxel_engine::calibration::{SampleRefusal, SessionState};
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
