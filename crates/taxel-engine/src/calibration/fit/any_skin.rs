//! A recording of any skin: counts of any width or reals, ramps, loops, plateaus or typed pressures.
//!
//! Nothing is known of its faults, of the clock of its gauge, or of how fast its counts follow. `taxel_model::skin` has
//! the fit.

use taxel_model::skin::{Form, Warp, fit as fit_skin};
use taxel_model::{TaxelModel, Workers, map};

use crate::baseline::TaxelBaseline;
use crate::calibration::branch::{Branch, PlaysChoice};
use crate::calibration::fit::legs;
use crate::calibration::fit::recipe_options::{FitRecipe, RecordingError};
use crate::calibration::fit::scans::Scans;
use crate::model_set::{Maker, ModelSet, Recorded, RecordedTaxel};

/// Fits a recording that is not one of 8-bit counts over time. The set comes without id, patch and time of making.
///
/// # Errors
/// [`RecordingError`] where nothing can be fitted. A taxel that cannot be is no error: its status says why.
pub fn fit_any(scans: &Scans<'_>, recipe: &FitRecipe, workers: &dyn Workers) -> Result<ModelSet, RecordingError> {
    let gauge = scans.pressure_kpa.ok_or(RecordingError::NoPressure)?;
    let rises_alone = recipe.branch == Branch::Rising;
    let kpa: Vec<f64> = if rises_alone {
        let rising = legs::rising(gauge, &legs::legs(gauge));
        gauge.iter().zip(rising).map(|(p, rising)| if rising { *p } else { f64::NAN }).collect()
    } else {
        gauge.to_vec()
    };
    let skin = fit_skin(scans.time_s, &kpa, &scans.counts, recipe.plays != PlaysChoice::Off, workers)?;
    let options = &recipe.options;
    let taxels: Vec<TaxelModel> =
        map(workers, scans.counts.len(), |taxel| skin.model(taxel, scans.counts[taxel], options));
    let zero = |taxel| skin.zero(taxel).map_or(TaxelBaseline::UNKNOWN, |(mean, noise)| TaxelBaseline { mean, noise });
    let in_use = |taxel: usize| {
        let plays = skin.plays(taxel).filter(|_| taxels[taxel].is_usable())?;
        let (rmse_kpa, sensitivity) = (taxels[taxel].quality.rmse_kpa, skin.sensitivity(taxel)?);
        Some(RecordedTaxel { rmse_kpa, sensitivity, hysteresis_kpa: None, plays: Some(plays) })
    };
    let in_use: Vec<Option<RecordedTaxel>> = (0..taxels.len()).map(in_use).collect();
    let recorded = in_use.iter().any(Option::is_some).then(|| Recorded {
        smooth_s: 0.0,
        plays_mean_s: skin.play_scans() as f64 * scans.period_s(),
        module_size: recipe.module_size,
        lag_s: 0.0,
        clock: None,
        zero_return: None,
        plays_error_ratio: skin.plays_error_ratio,
        taxels: in_use,
    });
    Ok(ModelSet {
        id: String::new(),
        patch: String::new(),
        created_wall_ns: 0,
        session: None,
        method: format!("{}{}", method(&skin.form), if rises_alone { ", rising" } else { "" }),
        board_settings: Vec::new(),
        baseline: (0..taxels.len()).map(zero).collect(),
        pressure_max_kpa: skin.range_kpa[1],
        gauge_gain_rel: options.gauge.gain_rel,
        gauge_offset_kpa: options.gauge.offset_kpa,
        taxels,
        recorded,
        recalibrated: None,
        maker: Maker::this(false),
    })
}

/// How the curves were fitted, in words.
fn method(form: &Form) -> String {
    let warp = match form.warp {
        Warp::None => "pressure".to_owned(),
        Warp::Log(scale) => format!("ln(1 + P / {scale} P_max)"),
        Warp::Root => "root of the pressure".to_owned(),
    };
    let zone = if form.dead_zone { ", dead zones" } else { "" };
    format!("monotone, order {} in {warp}{zone}", form.order)
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_model::{OneByOne, Status};

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
        let scans =
            Scans { time_s: &time, pressure_kpa: Some(&kpa), counts: counts.iter().map(Vec::as_slice).collect() };
        fit_any(&scans, &FitRecipe::default(), &OneByOne)
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
        let two = plateaus(&[sound], |kpa, _| kpa.iter_mut().for_each(|p| *p = if *p > 30.0 { 60.0 } else { 0.0 }));
        assert!(two.unwrap_err().to_string().contains("2 distinct pressures"));
        let none = plateaus(&[sound], |kpa, _| kpa.fill(f64::NAN)).unwrap_err().to_string();
        assert!(none.contains("0 distinct pressures"), "{none}");
        let still = plateaus(&[|_, _| 17.0], |_, _| {}).unwrap_err().to_string();
        assert!(still.contains("no taxel moves"), "{still}");
    }

    #[test]
    fn every_scale_of_counts_and_every_order_of_pressures_gives_finite_models() {
        let order: Vec<usize> = (0..360).map(|k| k * 7 % 360).collect();
        for (name, scale, base) in [("1e-9", 1e-9, 0.0), ("1e9", 1e9, 0.0), ("1e9 and little more", 1.0, 1e9)] {
            let change = |kpa: &mut Vec<f64>, counts: &mut Vec<Vec<f64>>| {
                counts.iter_mut().flatten().for_each(|count| *count = base + scale * *count);
                counts[1][7] = f64::NAN;
                let mixed = |column: &Vec<f64>| order.iter().map(|k| column[*k]).collect::<Vec<f64>>();
                *kpa = mixed(kpa);
                counts.iter_mut().for_each(|column| *column = mixed(column));
            };
            let set = plateaus(&[sound, sound], change).unwrap();
            for model in &set.taxels {
                let sigma = model.sigma.as_ref().unwrap();
                assert!(sigma.sigma_kpa.iter().all(|s| s.is_finite() && *s > 0.0), "{name}: {sigma:?}");
                assert!(model.is_usable() && model.validate().is_ok(), "{name}: {:?}", model.status);
            }
        }
    }
}
