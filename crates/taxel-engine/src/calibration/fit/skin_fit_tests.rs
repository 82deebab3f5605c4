//! Which taxels may be used, and what is judged with plays, on numbers that can be worked out by hand.

use std::sync::Mutex;

use super::*;
use crate::calibration::fit::course::Course;
use crate::force::tests::model;
use taxel_model::OneByOne;

/// A taxel whose curve leaves this error and whose loop has this width.
fn taxel(status: Status, rmse_kpa: f64, hysteresis_kpa: f64) -> FittedTaxel {
    let model = TaxelModel { status, ..model() };
    FittedTaxel { model, rmse_kpa, hysteresis_kpa: Some(hysteresis_kpa), sensitivity: Some(1.0) }
}

const WIDE: Status = Status::IntervalTooWide { share: 0.10, limit: 0.08 };

#[test]
fn a_loop_is_wide_that_plays_can_win_by_taking_out() {
    // Half of the width is to be more than sqrt(1 - 0.9^2) of the error.
    let least = 2.0 * 0.19_f64.sqrt();
    assert!(is_wide_loop(1.01 * least, 1.0) && !is_wide_loop(0.99 * least, 1.0) && !is_wide_loop(least, 1.02));
    let skin = |widths: [f64; 3], errors: [f64; 3]| {
        let fitted: Vec<FittedTaxel> = widths.into_iter().zip(errors).map(|(w, e)| taxel(Status::Ok, e, w)).collect();
        has_wide_loops(&fitted)
    };
    assert!(skin([0.0, 1.0, 9.0], [1.0, 1.0, 5.0]), "in the median");
    assert!(!skin([0.0, 0.8, 9.0], [0.2, 1.0, 5.0]));
    assert!(!has_wide_loops(&[]));
}

#[test]
fn a_curve_with_a_wide_interval_may_be_used_if_its_loop_is_what_makes_it_wide() {
    for (status, width, may, wide) in [
        (Status::Ok, 0.0, true, false),
        (WIDE, 2.0, true, true),
        (WIDE, 0.5, false, true),
        (Status::NoData, 2.0, false, false),
    ] {
        let taxel = taxel(status, 1.0, width);
        assert_eq!((taxel.may_be_used(), taxel.has_wide_interval()), (may, wide), "{status:?} {width}");
    }
    let mut without = taxel(WIDE, 1.0, 2.0);
    without.model.curve = None;
    assert!(!without.may_be_used() && !without.has_wide_interval());
}

#[test]
fn with_plays_the_interval_is_judged_by_what_they_leave() {
    let plays = |rmse_kpa: f64| RecordedTaxel {
        rmse_kpa,
        sensitivity: 1.0,
        hysteresis_kpa: Some(2.0),
        plays: Some(hysteresis::identify(&loop_of_counts(), &loop_of_kpa(), taxel_model::Order::Fixed(5)).unwrap()),
    };
    let judged_at = |width: f64, limit: f64, left: f64, in_use: Option<RecordedTaxel>| {
        let mut taxel = taxel(Status::IntervalTooWide { share: 0.10, limit }, 2.0, 2.0);
        let quality = &mut taxel.model.quality;
        (quality.dof, quality.interval_kpa, quality.interval_share) = (30.0, Some(width), Some(0.10));
        let in_use = in_use.map(|in_use| RecordedTaxel { rmse_kpa: left, ..in_use });
        taxel.judge_in_use(in_use.as_ref());
        (taxel.model.status, taxel.rmse_kpa)
    };
    let judged = |limit, left, in_use| judged_at(5.0, limit, left, in_use);
    // 97.5 % of Student's distribution with 30 degrees of freedom: 2.0423.
    let share = 0.10 * (25.0 - 2.0423_f64.powi(2) * 3.0).sqrt() / 5.0;
    assert_eq!(judged(share + 0.001, 1.0, Some(plays(1.0))), (Status::Ok, 1.0));
    let (status, _) = judged(share - 0.001, 1.0, Some(plays(1.0)));
    let Status::IntervalTooWide { share: told, .. } = status else { panic!("{status:?}") };
    assert!((told - share).abs() < 1e-5, "{told} is not {share}");
    // No interval is narrower than what the plays themselves leave.
    let (status, _) = judged_at(3.0, 0.01, 0.8, Some(plays(0.8)));
    let Status::IntervalTooWide { share: told, .. } = status else { panic!("{status:?}") };
    assert!((told - 0.10 * 2.0423 * 0.8 / 3.0).abs() < 1e-5, "{told}");
    let (status, rmse) = judged(0.08, 0.1, Some(RecordedTaxel { plays: None, ..plays(0.1) }));
    assert_eq!((status, rmse), (Status::IntervalTooWide { share: 0.10, limit: 0.08 }, 2.0), "without plays");
    assert_eq!(judged(0.08, 0.1, None).1, 2.0);
}

/// Up to 40 kPa and back.
fn loop_of_kpa() -> Vec<f64> {
    (0..400).chain((0..400).rev()).map(|k| 0.1 * f64::from(k)).collect()
}

/// Two counts a kPa, two counts lower on the way back.
fn loop_of_counts() -> Vec<f64> {
    counts_with_loop(2.0)
}

fn counts_with_loop(width: f64) -> Vec<f64> {
    let back = |i: usize| if i < 400 { 0.0 } else { width };
    loop_of_kpa().iter().enumerate().map(|(i, kpa)| 200.0 - 2.0 * kpa - back(i)).collect()
}

#[test]
fn a_fit_far_worse_than_the_others_is_left_out() {
    let mut fitted: Vec<FittedTaxel> =
        [1.0, 1.0, 1.0, 2.5, 2.51].into_iter().map(|rmse| taxel(Status::Ok, rmse, 0.0)).collect();
    fitted.push(taxel(WIDE, 9.0, 0.0));
    exclude_poor_fits(&mut fitted);
    let statuses: Vec<Status> = fitted.into_iter().map(|taxel| taxel.model.status).collect();
    let poor = Status::PoorFit { rmse_kpa: 2.51, limit_kpa: 2.5 };
    assert_eq!(statuses, [Status::Ok, Status::Ok, Status::Ok, Status::Ok, poor, WIDE]);
    exclude_poor_fits(&mut []);
}

#[test]
fn a_fault_is_told_as_a_status() {
    let told = |fault, first| faulty(fault, 0.5, first);
    assert_eq!(told(Some(Fault::Rail), None), Status::Railed { share: 0.5 });
    assert_eq!(told(Some(Fault::Dead), Some(7.0)), Status::Dead { count: 7.0 });
    assert_eq!(told(Some(Fault::Dead), None), Status::Frozen { share: 0.5 });
    assert_eq!(told(Some(Fault::Frozen), Some(7.0)), Status::Frozen { share: 0.5 });
    assert_eq!(told(Some(Fault::ModuleFlicker), None), Status::ModuleFlicker { share: 0.5 });
    assert_eq!((told(None, None), told(None, Some(1.0))), (Status::NoData, Status::Missing { share: 0.5 }));
}

/// Remembers what it was told of the progress.
#[derive(Default)]
struct Watched(Mutex<Vec<f64>>);

impl Workers for Watched {
    fn each(&self, jobs: usize, job: &(dyn Fn(usize) + Sync)) {
        (0..jobs).for_each(job);
    }

    fn progress(&self, share: f64) {
        self.0.lock().unwrap().push(share);
    }
}

#[test]
fn the_static_curves_are_half_of_the_progress_and_what_is_in_use_the_other() {
    let (kpa, counts) = (loop_of_kpa(), loop_of_counts());
    let time_s: Vec<f64> = (0..kpa.len()).map(|i| 0.05 * i as f64).collect();
    let scans = Scans { time_s: &time_s, pressure_kpa: None, counts: vec![&counts, &counts] };
    let recipe = FitRecipe::default();
    let course = Course::of_recording(&kpa);
    let watched = Watched::default();
    let fitted = SkinFit::new(&scans, Masks::missing(&scans), kpa.clone(), course, &recipe).run(&watched);
    assert_eq!(fitted.usable(), [0, 1]);
    assert_eq!(*watched.0.lock().unwrap(), [0.25, 0.5, 0.75, 1.0]);
}

fn fitted(kpa: &[f64], counts: &[f64], recipe: &FitRecipe) -> FittedSkin {
    let time_s: Vec<f64> = (0..kpa.len()).map(|i| 0.05 * i as f64).collect();
    let scans = Scans { time_s: &time_s, pressure_kpa: None, counts: vec![counts; 2] };
    let course = Course::of_recording(kpa);
    SkinFit::new(&scans, Masks::missing(&scans), kpa.to_vec(), course, recipe).run(&OneByOne)
}

#[test]
fn plays_are_used_where_they_are_asked_for_and_there_is_a_falling_branch() {
    use PlaysChoice::{Auto, Off, On};
    let (kpa, counts) = (loop_of_kpa(), loop_of_counts());
    let of = |plays, branch, scans: usize| {
        let fitted = fitted(&kpa[..scans], &counts[..scans], &FitRecipe { plays, branch, ..FitRecipe::default() });
        (fitted.plays_on, fitted.plays_error_ratio.is_some())
    };
    assert_eq!(of(On, Branch::Both, 800), (true, true));
    assert_eq!(of(Auto, Branch::Both, 800), (true, true), "they take the loop out");
    assert_eq!(of(Off, Branch::Both, 800), (false, false));
    assert_eq!(of(On, Branch::Rising, 800), (false, false));
    assert_eq!([of(On, Branch::Both, 400), of(Auto, Branch::Both, 400)], [(true, false), (false, false)]);
}

#[test]
fn what_a_taxel_is_in_use_follows_from_its_loop() {
    let (kpa, counts) = (loop_of_kpa().iter().map(|p| p + 20.0).collect::<Vec<f64>>(), loop_of_counts());
    let recipe = FitRecipe { plays: PlaysChoice::Off, smooth_s: 0.0, ..FitRecipe::default() };
    let fitted = fitted(&kpa, &counts, &recipe);
    assert!(fitted.models[0].flags.iter().all(|flag| !matches!(flag, Flag::Dropouts { .. })));
    let in_use = fitted.in_use[0].as_ref().unwrap();
    // Two counts of two a kPa: the branches lie a kilopascal apart, and a curve goes between them.
    assert!((in_use.rmse_kpa - 0.5).abs() < 0.05, "{}", in_use.rmse_kpa);
    assert!((in_use.hysteresis_kpa.unwrap().abs() - 1.0).abs() < 0.05, "{:?}", in_use.hysteresis_kpa);
    // 82 counts but for the outermost, of 39.9 kPa.
    assert!((in_use.sensitivity - 2.04).abs() < 0.04, "{}", in_use.sensitivity);
}

/// A loop of 9 kPa makes the interval of a static curve wider than is allowed; plays take it out.
#[test]
fn a_taxel_with_a_wide_loop_is_usable_with_plays_alone() {
    let (kpa, counts) = (loop_of_kpa(), counts_with_loop(18.0));
    let of = |plays| fitted(&kpa, &counts, &FitRecipe { plays, smooth_s: 0.0, ..FitRecipe::default() });
    let (with, without) = (of(PlaysChoice::On), of(PlaysChoice::Off));
    assert!(matches!(without.models[0].status, Status::IntervalTooWide { .. }), "{:?}", without.models[0].status);
    assert_eq!((with.usable(), without.usable()), (vec![0, 1], Vec::new()), "{:?}", with.models[0].status);
}
