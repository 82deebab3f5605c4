//! What a controller reports of its bus, and what the health makes of it.

use crate::prelude::*;

fn tared() -> Bench {
    let mut bench = Bench::new(small_world(), plan(patch_plan(&small().skin)), small().restored());
    bench.brought_up();
    bench.tare(None).unwrap();
    bench.seconds(1.0);
    bench
}

#[test]
fn a_bus_off_is_over_when_frames_come_again() {
    let mut bench = tared();
    bench.host.notice(BusNotice::BusOff);
    bench.seconds(2.0);
    // On an interface without a link state, frames are the only sign that the bus is back.
    let bus = &bench.host.health().buses[0];
    assert_eq!((bus.up, bus.problem.as_str()), (true, ""), "frames come: {} so far", bus.frames);
}

#[test]
fn errors_that_have_become_few_again_are_no_problem_any_more() {
    let mut bench = tared();
    bench.host.notice(BusNotice::ControllerError("error-passive: very many errors on the bus".to_owned()));
    bench.seconds(1.0);
    assert_eq!(bench.host.health().buses[0].problem, "error-passive: very many errors on the bus");
    bench.host.notice(BusNotice::ControllerRecovered("error-active".to_owned()));
    bench.seconds(1.0);
    let bus = &bench.host.health().buses[0];
    assert_eq!((bus.up, bus.problem.as_str()), (true, ""));
}

#[test]
fn an_error_frame_that_a_local_process_forged_is_counted_and_keeps_the_zero() {
    let mut bench = tared();
    assert!(bench.host.state() <= ForceState::Degraded);
    bench.host.notice(BusNotice::Forged);
    bench.seconds(1.0);
    assert!(bench.host.state() <= ForceState::Degraded, "{:?}", bench.host.state());
    assert_eq!(bench.host.health().buses[0].forged, 1);
}
