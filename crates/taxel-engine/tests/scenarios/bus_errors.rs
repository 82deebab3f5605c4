//! What a controller reports of its bus, and what the health makes of it.

use crate::prelude::*;

#[test]
fn a_bus_is_well_again_when_frames_come_or_errors_are_few() {
    let mut bench = small().in_use();
    let health = |bench: &mut Bench, notice| {
        bench.host.notice(notice);
        bench.seconds(1.0);
        let bus = &bench.host.health().buses[0];
        (bus.up, bus.problem.clone())
    };
    let well = (true, String::new());
    let errors = "error-passive: very many errors on the bus".to_owned();
    assert_eq!(health(&mut bench, BusNotice::ControllerError(errors.clone())), (true, errors));
    assert_eq!(health(&mut bench, BusNotice::ControllerRecovered("error-active".to_owned())), well);
    // On an interface without a link state, frames are the only sign that the bus is back.
    assert_eq!(health(&mut bench, BusNotice::BusOff), well);
}
