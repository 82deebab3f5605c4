//! The figures of one taxel, over every scan of its session.

use serde_json::{Value, json};
use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::calibration::SessionSamples;
use taxel_model::{Curve, TaxelModel};

use super::course::{Course, Figures};

/// Points of the range at which a curve is compared with a straight line.
const LINE_POINTS: usize = 101;

/// Force is told from none beyond this many standard deviations of the errors (ASTM E74).
const LOWER_LIMIT_SIGMAS: f64 = 2.4;

/// A usable taxel under examination.
pub(super) struct Examined {
    /// What the certificate says of it.
    pub part: Value,
    /// The figures of its errors.
    pub figures: Figures,
    /// Reading less reference of each scan, kPa.
    pub errors: Vec<f64>,
    /// Slope of its curve from end to end, kPa per count, signed.
    pub slope: f64,
    /// Its zero at each ramp less that at the last, counts; `None` where it was not known.
    pub zero_shifts: Vec<Option<f64>>,
    /// The one of them that is farthest from 0.
    pub zero_shift: Option<f64>,
}

/// Examines a taxel; `None` without a usable model.
pub(super) fn examine(
    number: usize,
    model: &TaxelModel,
    samples: &SessionSamples,
    course: &Course,
) -> Option<Examined> {
    let curve = model.curve.as_ref().filter(|_| model.is_usable())?;
    let [low, high] = model.range?;
    let of = |zero: &[TaxelBaseline]| *zero.get(number).unwrap_or(&TaxelBaseline::UNKNOWN);
    let zero = of(samples.rest().unwrap_or_default());
    let shift = |ramp: usize| Some(of(&samples.ramps[ramp].taxels).mean - zero.mean).filter(|shift| shift.is_finite());
    let zero_shifts: Vec<Option<f64>> = (0..course.ramps).map(shift).collect();
    // Counts of all ramps are brought to the zero of the last.
    let units = samples.samples.iter().map(|sample| sample.counts.counts().units(number).unwrap_or(f64::NAN));
    let counts: Vec<f64> =
        units.zip(&course.ramp).map(|(count, &ramp)| count - zero_shifts[ramp].unwrap_or(0.0)).collect();
    let errors: Vec<f64> =
        counts.iter().zip(&course.kpa).map(|(count, kpa)| curve.evaluate(count.max(low).min(high)) - kpa).collect();
    let figures = course.figures(&errors);
    let (p_low, p_high) = (curve.evaluate(low), curve.evaluate(high));
    let (span_kpa, slope) = ((p_high - p_low).abs(), (p_high - p_low) / (high - low));
    let outside = counts.iter().filter(|count| !(low..=high).contains(*count)).count();
    let zero_shift = zero_shifts.iter().rev().skip(1).flatten().copied().max_by(|a, b| a.abs().total_cmp(&b.abs()));
    let known = |value: f64| Some(value).filter(|value| value.is_finite());
    let part = json!({
        "taxel": number,
        "order": curve.order(),
        "count_min": low,
        "count_max": high,
        "centre": curve.centre,
        "half_width": curve.half_width,
        "chebyshev_kpa": curve.chebyshev,
        "range_kpa": [p_low.min(p_high), p_low.max(p_high)],
        "sensitivity_counts_per_kpa": slope.abs().recip(),
        "linearity_percent": 100.0 * off_the_line_kpa(curve, [low, high]) / span_kpa,
        "rmse_kpa": figures.rmse,
        "bias_kpa": figures.bias,
        "max_error_kpa": figures.max,
        "hysteresis_kpa": figures.hysteresis,
        "hysteresis_percent": figures.hysteresis.map(|kpa| 100.0 * kpa.abs() / span_kpa),
        "repeatability_kpa": figures.repeatability,
        "zero_counts": known(zero.mean),
        "zero_noise_counts": known(zero.noise),
        "zero_shift_counts": zero_shift,
        "lower_limit_kpa": lower_limit_kpa(&errors, curve.order(), slope.abs() / per_unit(samples)),
        "outside_share": outside as f64 / counts.len().max(1) as f64,
    });
    Some(Examined { part, figures, errors, slope, zero_shifts, zero_shift })
}

/// Raw counts in a unit of the counts that models are in.
pub(super) fn per_unit(samples: &SessionSamples) -> f64 {
    samples.samples.first().map_or(1.0, |sample| sample.counts.counts().range().per_unit())
}

/// Greatest distance of a curve from the straight line between its ends, kPa.
fn off_the_line_kpa(curve: &Curve, [low, high]: [f64; 2]) -> f64 {
    let (first, last) = (curve.evaluate(low), curve.evaluate(high));
    let distance = |k: usize| {
        let share = k as f64 / (LINE_POINTS - 1) as f64;
        (curve.evaluate(low + share * (high - low)) - (first + share * (last - first))).abs()
    };
    (0..LINE_POINTS).map(distance).fold(0.0, f64::max)
}

/// The least pressure that is told from none: a multiple of the standard deviation of the errors, and no less than one
/// raw count.
fn lower_limit_kpa(errors: &[f64], order: usize, raw_count_kpa: f64) -> f64 {
    let squares: f64 = errors.iter().map(|error| error * error).sum();
    let free = errors.len().saturating_sub(order + 1).max(1) as f64;
    (LOWER_LIMIT_SIGMAS * (squares / free).sqrt()).max(raw_count_kpa)
}
