//! What a reading of a recording is uncertain by, on numbers that can be worked out by hand.

use super::*;
use crate::force::tests::{REST, set};
use crate::model_set::{Recalibrated, Recorded, RecordedTaxel};

fn near(is: f64, expected: f64) {
    assert!((is - expected).abs() < 1e-9 * (1.0 + expected.abs()), "{is} is not {expected}");
}

/// Two taxels that a recording of both branches told of.
fn recorded() -> ModelSet {
    let taxel = RecordedTaxel { sensitivity: 2.0, plays: None };
    let recorded = Recorded {
        smooth_s: 0.0,
        plays_mean_s: 0.0,
        module_size: 10,
        zero_return_counts: Some(1.2),
        unloading_share: Some(0.1),
        plays_error_ratio: None,
        taxels: vec![Some(taxel); 2],
    };
    ModelSet { recorded: Some(recorded), ..ModelSet::clone(&set(2)) }
}

fn reader(set: &ModelSet, skin: bool, tared: bool) -> Reader<'_> {
    let curve_sigmas_kpa = vec![0.0; set.taxels.len()];
    let extensions = if skin { set.extensions() } else { vec![None; set.taxels.len()] };
    Reader { set, extensions, curve_sigmas_kpa, half: 0, period_s: 0.0, skin, tared }
}

#[test]
fn a_zero_is_uncertain_by_where_loads_leave_it_and_by_the_day_unless_it_was_tared() {
    let set = recorded();
    for (skin, tared, day) in [(true, true, 0.0), (true, false, 3.0), (false, false, 0.0)] {
        near(reader(&set, skin, tared).zero_sigma_kpa(0), (1.2 / 3.0_f64.sqrt()).hypot(day) / 2.0);
    }
    let nothing =
        |set: &ModelSet, taxel: usize| assert_eq!(reader(set, true, true).zero_sigma_kpa(taxel), 0.0, "{taxel}");
    nothing(&set, 2);
    let mut unmeasured = set;
    unmeasured.recorded.as_mut().unwrap().zero_return_counts = None;
    nothing(&unmeasured, 0);
}

#[test]
fn the_gain_of_the_day_grows_with_the_pressure_and_is_a_skins_alone() {
    let mut set = recorded();
    let rest = f64::from(REST);
    let counts = [rest - 10.0, rest - 60.0, f64::NAN];
    let masked = [false, false, true];
    let read = |set: &ModelSet, skin: bool| reader(set, skin, true).column(0, &counts, &masked, 0.0);
    let zero = reader(&set, true, true).zero_sigma_kpa(0);
    let own =
        counts.map(|count| set.taxels[0].evaluate(count).map_or(f64::NAN, |reading| reading.sigma_kpa.hypot(zero)));
    let skin = read(&set, true);
    for (i, kpa) in [10.0, 60.0].into_iter().enumerate() {
        assert!((skin.kpa[i] - kpa).abs() < 0.2, "{}", skin.kpa[i]);
        near(skin.sigma_kpa[i], own[i].hypot(GAIN_OF_DAY_REL * skin.kpa[i]));
        near(read(&set, false).sigma_kpa[i], own[i]);
    }
    assert!(skin.kpa[2].is_nan() && skin.sigma_kpa[2].is_nan() && !skin.beyond[2]);
    // What the gauge or known loads leave open is in all taxels alike, also in a table of other numbers.
    (set.gauge_gain_rel, set.gauge_offset_kpa) = (0.04, 7.8);
    set.recalibrated = Some(Recalibrated { relative_sigma: 0.04, ..corrected() });
    let skin = read(&set, true);
    near(skin.sigma_kpa[1], own[1].hypot(GAIN_OF_DAY_REL.hypot(0.04) * skin.kpa[1]).hypot(7.8));
    near(read(&set, false).sigma_kpa[1], own[1].hypot(0.04 * skin.kpa[1]).hypot(7.8));
    // A zero that has moved is taken off the counts.
    let moved = reader(&set, true, true).column(0, &counts.map(|count| count + 7.0), &masked, 7.0);
    near(moved.kpa[0], skin.kpa[0]);
}

fn corrected() -> Recalibrated {
    Recalibrated {
        derived_from: "m-before".to_owned(),
        earlier: Vec::new(),
        area_mm2: 1.0,
        filled: true,
        gain: 1.0,
        gain_sigma: 0.0,
        place_rel: 0.0,
        relative_sigma: 0.0,
        gain_in_all: 1.0,
        points: Vec::new(),
    }
}

#[test]
fn at_the_rail_and_beyond_the_range_a_reading_says_so() {
    let set = recorded();
    let rest = f64::from(REST);
    let counts = [rest - 70.0, rest - 90.0, 0.0, 255.0];
    let column = |skin: bool| reader(&set, skin, true).column(0, &counts, &[false; 4], 0.0);
    let skin = column(true);
    assert_eq!(skin.beyond, [false, true, true, false]);
    assert!(skin.kpa[1] > 80.0 && skin.sigma_kpa[1].is_finite() && skin.sigma_kpa[1] > skin.sigma_kpa[0]);
    assert_eq!(skin.sigma_kpa[2], f64::INFINITY, "nobody knows how much more");
    assert!(skin.sigma_kpa[3].is_finite(), "that rail is away from pressure");
    // Of a table of numbers nothing tells how a curve goes on beyond its range, and no value is a rail.
    let table = column(false);
    assert_eq!(table.beyond, [false, true, true, false]);
    assert_eq!(table.sigma_kpa.iter().map(|kpa| kpa.is_finite()).collect::<Vec<_>>(), [true, false, false, true]);
    assert!((table.kpa[1] - 70.0).abs() < 1.0, "the range's end: {}", table.kpa[1]);
}

/// Calibrated from 20 kPa on: below, it may be anything from there to nothing.
#[test]
fn before_the_range_a_reading_is_as_uncertain_as_the_ranges_end_is_far_from_nothing() {
    let mut set = recorded();
    let rest = f64::from(REST);
    let counts = [rest - 10.0, rest - 20.0, rest - 30.0];
    let column = |set: &ModelSet, skin: bool| reader(set, skin, true).column(0, &counts, &[false; 3], 0.0);
    let whole = column(&set, true);
    set.taxels[0].range = Some([rest - 70.0, rest - 20.0]);
    for skin in [true, false] {
        let late = column(&set, skin);
        assert!((late.kpa[0] - 20.0).abs() < 0.2, "{}", late.kpa[0]);
        assert!((20.0..20.1).contains(&late.sigma_kpa[0]) && !late.beyond[0], "{}", late.sigma_kpa[0]);
        assert!(late.sigma_kpa[1] < 2.0 && late.sigma_kpa[2] < 2.0, "{:?}", late.sigma_kpa);
    }
    assert!(whole.sigma_kpa[0] < 2.0);
}

#[test]
fn what_is_left_out_is_counted_and_other_numbers_are_no_skin() {
    let set = recorded();
    let (time, rest) = ([0.0, 0.05, 0.10], f64::from(REST));
    let (a, b) = ([rest, f64::NAN, rest - 90.0], [rest - 20.0, rest - 20.5, rest - 90.0]);
    let two = Scans { time_s: &time, pressure_kpa: None, counts: vec![&a, &b] };
    let applied = apply(&two, &set, Tare::None).unwrap();
    assert_eq!(applied.masked, (1, 6));
    let is_skin = |applied: &Applied| applied.columns[0].as_ref().unwrap().sigma_kpa[2].is_finite(); // that goes on beyond the range
    assert!(!is_skin(&applied), "half a count is none of a skin's");
    let bytes = [rest - 20.0, rest - 20.0, rest - 90.0];
    assert!(is_skin(&apply(&Scans { counts: vec![&bytes, &bytes], ..two }, &set, Tare::None).unwrap()));
}
