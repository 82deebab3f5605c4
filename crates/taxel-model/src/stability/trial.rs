//! One fit of one recording: judged against exact least squares, and by what every fit must keep.

use crate::options::MAX_MAGNITUDE;
use crate::stability::case::{Outcome, Problem, greatest};
use crate::stability::reference::Reference;
use crate::stability::taxels::Recording;
use crate::{FitOptions, Flag, Samples, TaxelModel, fit};

/// The options of a polynomial of this order.
pub(super) fn of_order(order: u8) -> FitOptions {
    FitOptions { order, ..FitOptions::default() }
}

/// The fit of a whole recording.
pub(super) fn fit_of(recording: &Recording, options: &FitOptions) -> TaxelModel {
    fit(&Samples::new(&recording.counts, &recording.kpa), options)
}

/// Fits and compares with exact least squares at all counts; the same for the peers.
pub(super) fn against_exact(recording: &Recording, order: u8) -> (TaxelModel, Outcome) {
    let model = fit_of(recording, &of_order(order));
    let mut outcome = sound(recording, &of_order(order), &model);
    let valid = valid(recording);
    let used = usize::from(model.order);
    let (Some(curve), Some(reference)) = (&model.curve, Reference::fit(&valid.counts, &valid.kpa, used)) else {
        outcome.figure = f64::NAN;
        return (model, outcome);
    };
    let counts = distinct(&valid);
    let scale = valid.kpa.iter().fold(0.0, |scale: f64, p| scale.max(p.abs()));
    let wanted: Vec<f64> = counts.iter().map(|count| reference.evaluate(*count)).collect();
    let error = move |evaluate: &dyn Fn(f64) -> f64| {
        let errors = counts.iter().zip(&wanted).map(|(count, wanted)| (evaluate(*count) - wanted).abs() / scale);
        greatest(errors)
    };
    let problem = Problem { recording: valid, order: order.into() };
    outcome.contest(&|count| curve.evaluate(count), problem, error);
    (model, outcome)
}

/// What every fit must keep: the same bits in another order and again, finite readings, a sound model, a monotone
/// table. The figure is still to be set.
pub(super) fn sound(recording: &Recording, options: &FitOptions, model: &TaxelModel) -> Outcome {
    let mut outcome = Outcome { status: model.status.code(), flags: flag_words(model), ..Outcome::default() };
    let same = |other: &Recording| fit_of(other, options) == *model;
    outcome.require(same(recording), || "a second run gives other bits".to_owned());
    outcome.require(same(&recording.permuted()), || "another order of the samples gives other bits".to_owned());
    let valid = model.validate();
    outcome.require(valid.is_ok(), || format!("the model is not sound: {valid:?}"));
    for count in recording.counts.iter().filter(|count| count.is_finite()) {
        let Some(reading) = model.evaluate(*count) else { continue };
        outcome.require(reading.kpa.is_finite() && reading.sigma_kpa > 0.0, || format!("{reading:?} at {count}"));
    }
    let flagged = outcome.flags.contains(&"not_monotone");
    let sign = model.sign.as_f64() as f32;
    let table: Vec<f32> =
        (0..=u8::MAX).filter_map(|raw| model.evaluate(raw.into())).map(|reading| reading.kpa as f32).collect();
    let wrong = table.windows(2).find(|pair| (pair[1] - pair[0]) * sign < 0.0);
    outcome.require(flagged || !model.is_usable() || wrong.is_none(), || format!("the curve steps back: {wrong:?}"));
    outcome
}

/// The words of a model's flags, in its order.
#[must_use]
pub fn flag_words(model: &TaxelModel) -> Vec<&'static str> {
    let word = |flag: &Flag| match flag {
        Flag::RankReduced { .. } => "rank_reduced",
        Flag::FewDistinctCounts { .. } => "few_distinct_counts",
        Flag::HighLeverage { .. } => "high_leverage",
        Flag::Dropouts { .. } => "dropouts",
        Flag::Gap { .. } => "gap",
        Flag::NotMonotone { .. } => "not_monotone",
        Flag::Rejected { .. } => "rejected",
    };
    model.flags.iter().map(word).collect()
}

/// The pressure that the model reads at a count, kPa; NaN without a curve.
#[must_use]
pub fn evaluate(model: &TaxelModel, count: f64) -> f64 {
    model.evaluate(count).map_or(f64::NAN, |reading| reading.kpa)
}

/// The samples that a fit takes.
fn valid(recording: &Recording) -> Recording {
    let good = |value: f64| value.abs() <= MAX_MAGNITUDE;
    Recording::new(recording.pairs().filter(|(count, kpa)| good(*count) && good(*kpa)))
}

/// Distinct counts, ascending.
fn distinct(recording: &Recording) -> Vec<f64> {
    let mut counts = recording.counts.clone();
    counts.sort_by(f64::total_cmp);
    counts.dedup();
    counts
}
