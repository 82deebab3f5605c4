//! What makes a total a lower bound, for how long, and what may lie on a taxel that cannot be read.

use std::ops::Range;
use std::time::Duration;
use taxel_skin::Time;

use super::{REST, Skin, TAXELS, plan, row, set};
use crate::baseline::TaxelBaseline;
use crate::force::owner::Force;
use crate::force::tests::rest;

#[test]
fn what_a_contact_shows_holds_for_a_second_and_not_beyond_another_zero() {
    let beyond_range = || Skin::new(Some(row(TAXELS))).press(20..22, 100);
    let beside_one = || Skin::new(Some(row(TAXELS))).press(23..24, 60).press(25..26, 60).fault(24);
    let without_a_zero = || {
        let mut skin = Skin::new(Some(row(TAXELS))).press(37..38, 40);
        let mut zero = rest(TAXELS);
        zero[37] = TaxelBaseline::UNKNOWN;
        skin.force.set_zero(Some(&zero), 0.0);
        skin
    };
    for (what, skin) in [("range", beyond_range()), ("beside", beside_one()), ("zero", without_a_zero())] {
        let mut skin = skin;
        assert!(skin.measured().sample.lower_bound, "{what}");
        skin.counts.fill(REST);
        for (ms, expected) in [(50, true), (1_000, true), (1_001, false)] {
            skin.time = Time::default() + Duration::from_millis(ms);
            let sample = skin.measured().sample;
            assert_eq!(
                (sample.lower_bound, sample.reasons.len()),
                (expected, usize::from(expected)),
                "{what}: {ms} ms"
            );
        }
    }
    let mut skin = beyond_range();
    assert!(skin.measured().sample.lower_bound);
    skin.counts.fill(REST);
    skin.force.set_zero(Some(&rest(TAXELS)), 0.0);
    assert!(!skin.measured().sample.lower_bound, "another zero: the contact was of the one before");
}

/// What the taxels beside one read says how much it may bear, whether one of them is active by noise or none is.
#[test]
fn the_floor_holds_what_may_lie_on_a_taxel_that_cannot_be_read() {
    let floor = |counts: [u8; 2], excluded: bool| {
        let skin = Skin::new(Some(row(TAXELS))).press(23..24, counts[0]).press(25..26, counts[1]);
        let sample = if excluded { skin.fault(24) } else { skin }.measured().sample;
        (sample.detection_floor.unwrap().0, sample.active, sample.lower_bound)
    };
    let (untouched, ..) = floor([0, 0], true);
    let (of_all, ..) = floor([0, 0], false);
    assert!((0.9..1.1).contains(&(untouched / of_all)), "nothing lies there: {untouched} and {of_all} N");
    let (both, active, bound) = floor([3, 3], true);
    assert!(active == 0 && !bound && both > 3.0 * untouched, "{both} N, {untouched} N where they read nothing");
    let (one_active, active, bound) = floor([4, 3], true);
    assert!(active == 1 && !bound && one_active > both, "{one_active} N, {both} N without it");
    let (none_excluded, ..) = floor([3, 3], false);
    assert!(none_excluded < 0.5 * both, "{none_excluded} N");
    let (one_side, ..) = floor([3, 0], true);
    assert!(one_side < both, "the least of them bounds it, too: {one_side} N");
}

/// One taxel at its threshold is noise, as far as anybody can tell, and two beside the same one are a contact.
#[test]
fn two_active_taxels_beside_one_that_cannot_be_read_are_a_contact_and_one_is_none() {
    let bound = |counts: [u8; 2]| {
        let skin = Skin::new(Some(row(TAXELS))).press(23..24, counts[0]).press(25..26, counts[1]);
        skin.fault(24).fault(22).verdict().2
    };
    assert!(!bound([4, 0]), "two lie beside it, which are more than it is itself");
    assert!(bound([4, 4]) && bound([5, 0]));
}

/// A contact amid several lies on all of them.
#[test]
fn what_may_lie_on_taxels_beside_each_other_adds_up() {
    let floor = |excluded: std::ops::Range<usize>| {
        let mut skin = Skin::new(Some(row(TAXELS))).press(23..24, 3).press(26..27, 3).press(25..26, 3);
        excluded.for_each(|taxel| skin.sound[taxel] = false);
        skin.measured().sample.detection_floor.unwrap().0
    };
    assert!(floor(24..26) > 1.5 * floor(24..25), "{} and {} N", floor(24..26), floor(24..25));
}

/// A contact that is touched makes the total a lower bound for what it hides; the floor is of what nobody has touched.
#[test]
fn a_contact_beside_several_that_cannot_be_read_is_no_part_of_the_floor() {
    let mut skin = Skin::new(Some(row(TAXELS))).press(20..24, 60);
    (24..28).for_each(|taxel| skin.sound[taxel] = false);
    let beside = skin.measured().sample;
    skin.counts.fill(REST);
    let untouched = skin.measured().sample.detection_floor.unwrap().0;
    assert!(beside.lower_bound && beside.active == 4, "{beside:?}");
    assert!(beside.detection_floor.unwrap().0 < 1.5 * untouched, "{beside:?}, {untouched} N where nothing lies");
}

/// Nobody knows which taxels of a module lie beside one that cannot be read, so that the one that reads most may.
#[test]
fn without_positions_the_floor_holds_what_may_lie_on_taxels_that_cannot_be_read_of_a_module_that_nothing_touches() {
    let floor = |counts: u8, excluded: std::ops::Range<usize>| {
        let mut skin = Skin::new(None).press(27..28, counts);
        excluded.for_each(|taxel| skin.sound[taxel] = false);
        let sample = skin.measured().sample;
        assert!(sample.active == 0 && !sample.lower_bound, "{sample:?}");
        sample.detection_floor.unwrap().0
    };
    let none = floor(3, 0..0);
    let one = floor(3, 24..25);
    // A taxel of 100 mm2 lies 10.7 mm from the next ones: of a contact over it these feel a four hundredth.
    assert!(one > 3.0 * 0.1 * 35.0 && one > 3.0 * none, "{one} N, {none} N with all of them");
    assert!(floor(3, 23..25) > 1.9 * one, "a contact may lie on both");
    assert!(floor(3, 44..45) > 0.9 * one, "a module that reads nothing may lie beside the one that does");
    assert!(floor(0, 24..25) < 0.3 * one, "nothing reads anything");
}

/// Where the corners of two modules meet, a contact lies on both.
#[test]
fn without_positions_what_may_lie_on_taxels_of_several_modules_adds_up() {
    let floor = |excluded: &[usize]| {
        let skin = Skin::new(None).press(28..29, 3).press(31..32, 3);
        let mut skin = excluded.iter().fold(skin, |skin, &taxel| skin.fault(taxel));
        skin.measured().sample.detection_floor.unwrap().0
    };
    assert!(floor(&[29, 30]) > 1.9 * floor(&[29]), "{} and {} N", floor(&[29, 30]), floor(&[29]));
    let [three, four] = [&[29, 30, 40][..], &[29, 30, 40, 50]].map(floor);
    assert!((four / three - 1.0).abs() < 0.01, "no more than three modules meet: {three} and {four} N");
}

/// A contact on one module says nothing of another one on the same or the next module that touches nothing: those beside its tip
/// read a hundredth of it.
#[test]
fn without_positions_a_contact_elsewhere_takes_nothing_off_what_may_lie_on_taxels_that_cannot_be_read() {
    let mut wide = Skin::new(None).press(20..27, 4).press(27..29, 3).fault(29);
    let wide = wide.measured().sample;
    assert!(wide.active == 7 && !wide.lower_bound, "{wide:?}");
    let mut next = Skin::new(None).press(30..34, 20).press(27..29, 3).fault(29);
    let next = next.measured().sample;
    assert!(next.active == 4 && !next.lower_bound, "{next:?}");
    // 4 kPa beside 0.1 N/kPa: what 125 times as much bears, and 1.4 times at the rim.
    for sample in [wide, next] {
        assert!(sample.detection_floor.unwrap().0 > 4.0 * 0.1 * 175.0, "{sample:?}");
    }
}

/// On a module of many taxels a contact on seven of them is no wide one.
#[test]
fn without_positions_a_contact_on_less_than_half_of_a_module_with_one_that_cannot_be_read_is_a_lower_bound() {
    let bound = |touched: Range<usize>| {
        let mut skin = Skin::new(None);
        let mut plan = plan(TAXELS, None);
        plan.layout.modules = vec![0..50, 50..100];
        skin.force = Force::new(plan);
        skin.force.set_models(set(TAXELS), 0.0);
        skin.force.set_zero(Some(&rest(TAXELS)), 0.0);
        skin.silent = vec![false; 2];
        skin.jumps = vec![0.0; 2];
        skin.press(touched, 30).fault(49).verdict().2
    };
    assert!(bound(0..7) && bound(0..24) && !bound(0..25));
}

/// A wide contact on one module with two that cannot be read says nothing of a narrow one on another.
#[test]
fn without_positions_a_wide_contact_takes_no_lower_bound_from_a_narrow_one() {
    let mut models = crate::model_set::ModelSet::clone(&set(TAXELS));
    let unusable = taxel_model::Accumulator::new().fit(&taxel_model::FitOptions::default());
    [48, 49, 99].into_iter().for_each(|taxel| models.taxels[taxel] = unusable.clone());
    let mut plan = plan(TAXELS, None);
    plan.layout.modules = vec![0..50, 50..100];
    let mut skin = Skin::new(None);
    skin.force = Force::new(plan);
    skin.force.set_models(models.into(), 0.0);
    skin.force.set_zero(Some(&rest(TAXELS)), 0.0);
    (skin.silent, skin.jumps) = (vec![false; 2], vec![0.0; 2]);
    let mut skin = skin.press(0..40, 30);
    assert!(!skin.measured().sample.lower_bound, "the wide one alone");
    assert!(skin.press(50..72, 30).measured().sample.lower_bound);
}

/// What a touched module's taxels hide makes the total a lower bound, and is no part of the floor.
#[test]
fn without_positions_a_contact_beside_taxels_that_cannot_be_read_is_no_part_of_the_floor() {
    let mut skin = Skin::new(None).press(20..24, 60).fault(25).fault(26);
    let beside = skin.measured().sample;
    skin.sound.fill(true);
    let all = skin.measured().sample.detection_floor.unwrap().0;
    assert!(beside.lower_bound && beside.detection_floor.unwrap().0 < 1.5 * all, "{beside:?}, {all} N with all");
}
