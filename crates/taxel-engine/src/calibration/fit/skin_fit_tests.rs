//! Which taxels may be used, and for what they are excluded, on tables of any skin.

use super::*;
use crate::calibration::fit::recipe::fit;
use crate::calibration::fit::recipe_options::RecordingError;
use crate::model_set::ModelSet;
use taxel_model::OneByOne;

/// Columns over 0 to 60 kPa in 12 plateaus of 30 scans, and their set.
fn plateaus(
    columns: &[fn(f64, usize) -> f64],
    change: impl Fn(&mut Vec<f64>, &mut Vec<Vec<f64>>),
) -> Result<ModelSet, RecordingError> {
    let mut kpa: Vec<f64> = (0..360).map(|scan| f64::from(scan / 30) * 60.0 / 11.0).collect();
    let time: Vec<f64> = (0..360).map(|scan| f64::from(scan) * 0.05).collect();
    let mut counts: Vec<Vec<f64>> =
        columns.iter().map(|count| kpa.iter().enumerate().map(|(scan, p)| count(*p, scan)).collect()).collect();
    change(&mut kpa, &mut counts);
    let scans = Scans { time_s: &time, pressure_kpa: Some(&kpa), counts: counts.iter().map(Vec::as_slice).collect() };
    fit(&scans, &FitRecipe::default(), &OneByOne)
}

fn noise(scan: usize) -> f64 {
    ((scan * 7919) % 17) as f64 - 8.0
}

fn sound(kpa: f64, scan: usize) -> f64 {
    4000.0 - 3000.0 * kpa / (kpa + 40.0) + noise(scan)
}

#[test]
fn a_skin_of_twelve_bits_is_fitted_with_its_zero() {
    let set = plateaus(&[sound, sound], |_, _| {}).unwrap();
    assert!(set.taxels.iter().all(TaxelModel::is_usable), "{:?}", set.taxels[0].status);
    let read = set.taxels[0].evaluate(sound(30.0, 2)).unwrap();
    assert!((read.kpa - 30.0).abs() < 2.0 * read.sigma_kpa && read.sigma_kpa < 1.0, "{read:?}");
    assert!((set.baseline[0].mean - 4000.0).abs() < 2.0 && set.baseline[0].noise > 1.0, "{:?}", set.baseline);
    assert!(set.taxels[0].validate().is_ok() && set.taxels[0].order == 5, "{:?}", set.method);
}

#[test]
fn taxels_are_excluded_for_what_they_are() {
    let wild: fn(f64, usize) -> f64 = |_, scan| ((scan * 104_729) % 3001) as f64;
    let weak: fn(f64, usize) -> f64 = |kpa, scan| 4000.0 - 5.0 * kpa + noise(scan);
    let set = plateaus(&[sound, sound, sound, |_, _| 17.0, wild, weak], |_, counts| {
        counts[2].iter_mut().step_by(2).for_each(|count| *count = f64::NAN);
    })
    .unwrap();
    let codes: Vec<&str> = set.taxels.iter().map(|model| model.status.code()).collect();
    assert_eq!(codes, ["ok", "ok", "missing", "dead", "poor_fit", "insufficient_swing"]);
    assert!(matches!(set.taxels[2].status, Status::Missing { share } if (share - 0.5).abs() < 0.01));
}

#[test]
fn recordings_that_say_nothing_are_refused_in_words() {
    let same = plateaus(&[sound], |kpa, _| kpa.fill(20.0)).unwrap_err().to_string();
    assert!(same.contains("1 distinct pressures in `pressure_kpa`"), "{same}");
    let still = plateaus(&[|_, _| 17.0], |_, _| {}).unwrap_err().to_string();
    assert!(still.contains("no taxel moves"), "{still}");
}
