//! The calibration of the paper, from frames to newtons.

use taxel_engine::snapshot::RangeFlag;

use crate::prelude::*;

#[test]
fn a_whole_calibration_ends_in_review_with_nearly_all_taxels_usable() {
    let calibrated = forearm();
    assert_eq!(calibrated.session.state, SessionState::Review, "{:?}", calibrated.session);
    let usable = calibrated.set.taxels.iter().filter(|m| m.is_usable()).count();
    eprintln!("{usable} of 230 taxels are usable, {} samples", calibrated.session.accepted);
    assert!(usable >= 210, "{usable} of 230");
    assert!(calibrated.session.coverage > 0.97, "{:?}", calibrated.session);
}

#[test]
fn half_a_kilogram_is_weighed_within_a_tenth() {
    let mut bench = forearm().in_use();
    let weight = bench.lay(0.5, 100).0;
    bench.seconds(1.0);
    let force = bench.weigh(10);
    eprintln!("{force:.3} N, the truth is {weight:.3} N");
    assert!((force / weight - 1.0).abs() < 0.1, "{force} N, the truth is {weight} N");
    let excused = bench.host.reasons().ends_with("taxels have a fault"); // some rest on the converter's upper end
    assert!(bench.host.state() == ForceState::Ok || excused, "{}", bench.host.reasons());
    bench.world.clear();
    bench.seconds(2.0);
    let rest = bench.weigh(10);
    assert!(rest < 0.05 * weight, "{rest} N without a load");
}

#[test]
fn a_mass_beyond_the_calibrated_range_is_flagged_and_counted_and_the_curves_go_on() {
    let mut bench = small().in_use_with(|plan| plan.outputs.fill = false);
    bench.lay(12.0, 33); // about 200 kPa
    bench.seconds(4.0);
    let snapshot = bench.host.snapshot();
    let force = &snapshot.force;
    assert_eq!(force.state, ForceState::Degraded);
    let above = snapshot.taxels.iter().filter(|t| t.range == RangeFlag::Above && t.active && t.faults.is_empty());
    assert_eq!(above.count(), force.out_of_range as usize);
    assert!(force.out_of_range >= 5, "{force:?}");
    let reason = format!("{} taxels read more than was calibrated: no upper bound", force.out_of_range);
    assert!(force.reasons.iter().any(|told| told.text() == reason), "{:?}", force.reasons);
    let calibrated = small().set.pressure_max_kpa;
    let beyond = snapshot.taxels.iter().filter(|t| t.range == RangeFlag::Above && t.active && t.faults.is_empty());
    for state in beyond {
        let (kpa, sigma) = (f64::from(state.pressure_kpa.unwrap()), f64::from(state.sigma_kpa.unwrap()));
        assert!((0.8 * calibrated..4.0 * calibrated).contains(&kpa), "{kpa} kPa, {calibrated} was calibrated");
        assert!(kpa - 2.0 * sigma <= calibrated + 1.0, "{kpa} kPa with {sigma}: more than anybody confirms");
    }
}

#[test]
fn a_still_skin_weighs_plainly_nothing() {
    let bench = small().in_use();
    let force = &bench.host.snapshot().force;
    assert_eq!(force.total.unwrap().0.to_bits(), 0.0_f64.to_bits(), "not even a negative zero: {force:?}");
    assert_eq!((force.active, force.out_of_range, force.contacts.len()), (0, 0, 0));
}
