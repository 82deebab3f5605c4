//! The uncertainty budget, by the GUM: standard uncertainties of one pressure read, and their root sum of squares.

use taxel_engine::model_set::ModelSet;

use super::document::{BudgetRow, MeanPart};
use super::taxel::Examined;

/// Expanded uncertainties are so many standard uncertainties.
pub(super) const COVERAGE_FACTOR: f64 = 2.0;

/// Standard uncertainty of the reference at the highest pressure: by its gain and offset in the model set, or by its own
/// certificate, whichever is greater. `zero_kpa` is that of its zero, which is in the set's offset: a certificate says nothing of
/// the day.
pub(super) fn reference_kpa(set: &ModelSet, expanded_kpa: Option<f64>, zero_kpa: f64) -> f64 {
    let certified = (expanded_kpa.unwrap_or(0.0) / COVERAGE_FACTOR).hypot(zero_kpa);
    (set.gauge_gain_rel * set.pressure_max_kpa).hypot(set.gauge_offset_kpa).max(certified)
}

/// Standard uncertainty of a zero that shifted by so much at most: a rectangle.
fn of_shift(shift_kpa: f64) -> f64 {
    shift_kpa.abs() / 3.0_f64.sqrt()
}

fn zero_kpa(taxel: &Examined) -> Option<f64> {
    Some(of_shift(taxel.part.zero_shift_counts? * taxel.slope))
}

/// Expanded uncertainty of one taxel.
pub(super) fn expanded_of_taxel(taxel: &Examined, reference_kpa: f64) -> f64 {
    let others = [Some(taxel.part.rmse_kpa), taxel.part.repeatability_kpa, zero_kpa(taxel)];
    COVERAGE_FACTOR * others.into_iter().flatten().fold(reference_kpa, f64::hypot)
}

/// Greatest mean shift of the zero between ramps, as a pressure of the mean of all taxels; `None` with a single ramp.
pub(super) fn zero_shift_of_mean_kpa(taxels: &[Examined]) -> Option<f64> {
    let ramps = taxels.iter().map(|taxel| taxel.zero_shifts.len()).max()?;
    let of_ramp = |ramp: usize| {
        let shifts = taxels.iter().filter_map(|taxel| Some((*taxel.zero_shifts.get(ramp)?)? * taxel.slope));
        let (sum, n) = shifts.fold((0.0, 0_usize), |(sum, n), shift| (sum + shift, n + 1));
        (n > 0).then(|| (sum / n as f64).abs())
    };
    (1..ramps).filter_map(of_ramp).max_by(f64::total_cmp)
}

/// The lines of the budget.
pub(super) fn rows(taxels: &[Examined], mean: &MeanPart, reference_kpa: f64, per_unit: f64) -> Vec<BudgetRow> {
    let rms = |figure: &dyn Fn(&Examined) -> Option<f64>| {
        let known: Vec<f64> = taxels.iter().filter_map(figure).collect();
        (!known.is_empty()).then(|| (known.iter().map(|f| f * f).sum::<f64>() / known.len() as f64).sqrt())
    };
    let rectangle = 12.0_f64.sqrt();
    let step = rms(&|taxel| Some(taxel.slope.abs() / per_unit / rectangle));
    vec![
        BudgetRow {
            name: "reference",
            source: "reference sensor at the highest pressure",
            evaluation: "B, the greater of configured gain and offset and of its own certificate, with what it read at rest",
            taxel_kpa: Some(reference_kpa),
            mean_kpa: Some(reference_kpa),
            combined: true,
        },
        BudgetRow {
            name: "residuals",
            source: "errors of the model over all scans",
            evaluation: "A, root mean square; noise, rounding and form of the curve are in it",
            taxel_kpa: rms(&|taxel| Some(taxel.part.rmse_kpa)),
            mean_kpa: Some(mean.rmse_kpa),
            combined: true,
        },
        BudgetRow {
            name: "repeatability",
            source: "repeatability between ramps",
            evaluation: "A, standard deviation between ramps of the mean error of a level",
            taxel_kpa: rms(&|taxel| taxel.part.repeatability_kpa),
            mean_kpa: mean.repeatability_kpa,
            combined: true,
        },
        BudgetRow {
            name: "zero",
            source: "shift of the zero between ramps",
            evaluation: "B, greatest shift as half-width of a rectangle",
            taxel_kpa: rms(&zero_kpa),
            mean_kpa: mean.zero_shift_kpa.map(of_shift),
            combined: true,
        },
        BudgetRow {
            name: "hysteresis",
            source: "hysteresis",
            evaluation: "B, its width as a rectangle; the residuals of both branches hold it already",
            taxel_kpa: rms(&|taxel| Some(taxel.part.hysteresis_kpa? / rectangle)),
            mean_kpa: mean.hysteresis_kpa.map(|kpa| kpa.abs() / rectangle),
            combined: false,
        },
        BudgetRow {
            name: "resolution",
            source: "resolution of one count",
            evaluation: "B, one count as a rectangle; the residuals hold it already",
            taxel_kpa: step,
            mean_kpa: None,
            combined: false,
        },
    ]
}

/// Expanded uncertainty of a column of the budget.
pub(super) fn expanded(rows: &[BudgetRow], column: fn(&BudgetRow) -> Option<f64>) -> f64 {
    COVERAGE_FACTOR * rows.iter().filter(|row| row.combined).filter_map(column).fold(0.0, f64::hypot)
}
