//! The uncertainty budget, by the GUM: standard uncertainties of one pressure read, and their root sum of squares.

use serde::Serialize;
use taxel_engine::model_set::ModelSet;
use taxel_engine::statistics::root_mean_square;

use super::course::Figures;
use super::taxel::Examined;
use crate::numbers::mean;

/// Expanded uncertainties are so many standard uncertainties.
pub(super) const COVERAGE_FACTOR: f64 = 2.0;

/// Name of each line, how it is evaluated, and whether it enters the sum; what is in another line already does not.
const LINES: [(&str, &str, bool); 6] = [
    (
        "reference",
        "B, the greater of two: the configured gain and offset, or its own certificate combined with its unloaded reading",
        true,
    ),
    ("residuals", "A, root mean square over all scans; noise, rounding and form of the curve are in it", true),
    ("repeatability", "A, standard deviation between ramps of the mean error of a level", true),
    ("zero", "B, its greatest shift between ramps as half-width of a rectangle", true),
    ("hysteresis", "B, its width as a rectangle; the residuals of both branches hold it already", false),
    ("resolution", "B, one count as a rectangle; the residuals hold it already", false),
];

/// A line of the budget: standard uncertainties in kPa; `None` where it was not determined.
#[derive(Clone, Debug, Serialize)]
pub(super) struct BudgetRow {
    name: &'static str,
    evaluation: &'static str,
    combined: bool,
    /// Of one taxel: root mean square over the usable ones.
    pub taxel_kpa: Option<f64>,
    /// Of the mean of all usable taxels under uniform pressure.
    pub mean_kpa: Option<f64>,
}

/// Standard uncertainty of the reference at the highest pressure: by its gain and offset in the model set, or by its own
/// certificate, whichever is greater. `zero_kpa` is that of its zero, which is in the set's offset: a certificate says nothing of
/// the day.
pub(super) fn reference_kpa(set: &ModelSet, expanded_kpa: Option<f64>, zero_kpa: f64) -> f64 {
    let certified = (expanded_kpa.unwrap_or(0.0) / COVERAGE_FACTOR).hypot(zero_kpa);
    (set.gauge_gain_rel * set.pressure_max_kpa).hypot(set.gauge_offset_kpa).max(certified)
}

/// Standard uncertainty of what lies anywhere within a width.
fn of_rectangle(width: f64) -> f64 {
    width.abs() / 12.0_f64.sqrt()
}

fn zero_kpa(taxel: &Examined) -> Option<f64> {
    Some(of_rectangle(2.0 * taxel.zero_shift? * taxel.slope))
}

/// Greatest mean shift of the zero between ramps, as a pressure of the mean of all taxels; `None` with a single ramp.
pub(super) fn zero_shift_of_mean_kpa(taxels: &[Examined], ramps: usize) -> Option<f64> {
    let of_ramp = |ramp: usize| {
        let shifts = taxels.iter().filter_map(|taxel| Some(taxel.zero_shifts[ramp]? * taxel.slope));
        Some(mean(shifts).abs()).filter(|shift| shift.is_finite())
    };
    (0..ramps.saturating_sub(1)).filter_map(of_ramp).max_by(f64::total_cmp)
}

/// The expanded uncertainty of one taxel.
pub(super) fn expanded_of_taxel(taxel: &Examined, reference_kpa: f64) -> f64 {
    let others = [Some(taxel.figures.rmse), taxel.figures.repeatability, zero_kpa(taxel)];
    COVERAGE_FACTOR * others.into_iter().flatten().fold(reference_kpa, f64::hypot)
}

/// The lines of the budget. `zero_shift_kpa` is that of the mean of all taxels.
pub(super) fn rows(
    taxels: &[Examined],
    of_mean: &Figures,
    zero_shift_kpa: Option<f64>,
    reference_kpa: f64,
    per_unit: f64,
) -> Vec<BudgetRow> {
    let over_taxels = |figure: &dyn Fn(&Examined) -> Option<f64>| {
        Some(root_mean_square(taxels.iter().filter_map(figure))).filter(|kpa| kpa.is_finite())
    };
    let figures = [
        (Some(reference_kpa), Some(reference_kpa)),
        (over_taxels(&|taxel| Some(taxel.figures.rmse)), Some(of_mean.rmse)),
        (over_taxels(&|taxel| taxel.figures.repeatability), of_mean.repeatability),
        (over_taxels(&zero_kpa), zero_shift_kpa.map(|kpa| of_rectangle(2.0 * kpa))),
        (over_taxels(&|taxel| taxel.figures.hysteresis.map(of_rectangle)), of_mean.hysteresis.map(of_rectangle)),
        (over_taxels(&|taxel| Some(of_rectangle(taxel.slope / per_unit))), None),
    ];
    let row = |((name, evaluation, combined), (taxel_kpa, mean_kpa))| BudgetRow {
        name,
        evaluation,
        combined,
        taxel_kpa,
        mean_kpa,
    };
    LINES.into_iter().zip(figures).map(row).collect()
}

/// Expanded uncertainty of a column of the budget.
pub(super) fn expanded(rows: &[BudgetRow], column: fn(&BudgetRow) -> Option<f64>) -> f64 {
    COVERAGE_FACTOR * rows.iter().filter(|row| row.combined).filter_map(column).fold(0.0, f64::hypot)
}
