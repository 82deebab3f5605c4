//! That the simulated scans are what they say, and that the judge judges.

use taxel_model::{Estimator, Order, Status, TaxelModel};

use crate::rig::Forearm;
use crate::rig::fits::{Calibration, Exam, Recipe, judge};

#[test]
fn recipes_have_names_of_their_own_and_one_is_the_default() {
    let all = Recipe::all();
    let mut names: Vec<String> = all.iter().map(Recipe::name).collect();
    names.sort();
    names.dedup();
    assert_eq!(names.len(), all.len());
    assert_eq!(all.iter().filter(|recipe| recipe.is_default()).count(), 1);
}

#[test]
fn a_ramp_rises_from_rest_and_gauge_and_truth_agree() {
    let mut forearm = Forearm::new(4).unwrap();
    let rest = forearm.rest();
    assert_eq!((rest.len(), forearm.taxels()), (230, 230));
    assert!(rest.iter().all(|taxel| (200.0..=255.0).contains(&taxel.mean)));
    let scans = forearm.ramp(40.0, 5.0);
    assert!((150..=175).contains(&scans.len()), "{} scans of 8 s", scans.len());
    for scan in &scans {
        for (gauge, truth) in scan.gauge_kpa.iter().zip(&scan.true_kpa) {
            assert!((gauge - truth).abs() < 0.15, "the gauge says {gauge} kPa of {truth} kPa");
        }
    }
    assert!(scans[0].true_kpa[0] < 1.0 && scans[scans.len() - 1].true_kpa[0] > 39.0);
    let swing = |taxel: usize| i32::from(scans[0].counts[taxel]) - i32::from(scans[scans.len() - 1].counts[taxel]);
    assert!((0..230).filter(|&taxel| swing(taxel) > 20).count() > 200);
}

#[test]
fn a_calibration_reads_what_it_never_saw_and_a_wrong_one_does_not() {
    let rested = Forearm::new(4).unwrap();
    let plan = rested.plan().unwrap();
    let mut forearm = rested.clone();
    let rest = forearm.rest();
    let scans = forearm.ramp(70.0, 5.0);
    let calibration = Calibration::new(&forearm, rest, scans.iter());
    forearm.vent();
    let ramp = (forearm.rest(), forearm.ramp(60.0, 4.0));
    forearm.vent();
    let weighings = (forearm.rest(), vec![forearm.weigh(0.5, 100).unwrap()]);
    let exam = Exam { ramp, weighings };
    let recipe = Recipe { estimator: Estimator::PressureBinned, order: Order::Fixed(5) };
    let score = |models: Vec<TaxelModel>| judge(calibration.model_set(models, &plan), &forearm, &plan, &exam);
    let models = calibration.fit(&recipe.options(&plan));
    let right = score(models.clone());
    assert!(right.usable > 205, "{right:?}");
    assert!(right.rmse_kpa < 3.0 && right.ramp_force_percent < 5.0 && right.weight_percent < 15.0, "{right:?}");
    let doubled = |mut model: TaxelModel| {
        model.curve.iter_mut().for_each(|curve| curve.chebyshev.iter_mut().for_each(|c| *c *= 2.0));
        model
    };
    let wrong = score(models.iter().cloned().map(doubled).collect());
    assert!((70.0..130.0).contains(&wrong.ramp_force_percent), "{wrong:?}");
    assert!((70.0..130.0).contains(&wrong.weight_percent), "{wrong:?}");
    let none = |model: TaxelModel| TaxelModel::without_curve(Status::NoData, model.gauge);
    assert_eq!(score(models.into_iter().map(none).collect()).usable, 0);
}
