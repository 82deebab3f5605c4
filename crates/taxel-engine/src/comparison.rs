//! Two model sets of one patch against each other, taxel by taxel.

use taxel_model::RangeState;

use crate::model_set::ModelSet;
use crate::statistics::root_mean_square;

/// Counts at which two curves are compared, per taxel, beside the first.
const STEPS: u32 = 20;

/// A change of gain is read where the earlier set reads at least this share of the pressure that both reach.
const UPPER_PART: f64 = 0.3;

/// What changed from one set to another.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Comparison {
    /// Taxels that the earlier set could not use and the later can, ascending.
    pub became_usable: Vec<u32>,
    /// Taxels that the earlier set could use and the later cannot, ascending.
    pub lost: Vec<u32>,
    /// One per taxel that both can use, ascending.
    pub taxels: Vec<TaxelComparison>,
}

/// One taxel that both sets can use. What has no common range has no figures of pressure.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TaxelComparison {
    /// Its number.
    pub taxel: u32,
    /// How far its count at rest moved; `None` where a set does not know it.
    pub rest_counts: Option<f64>,
    /// Root mean square of the later pressure less the earlier over the counts that both curves are calibrated for, kPa.
    pub rms_kpa: Option<f64>,
    /// Mean ratio of the later pressure to the earlier in the upper part of the range.
    pub gain_ratio: Option<f64>,
}

impl Comparison {
    /// Compares `later` with `earlier`; each at its own rest, because that is how they are used.
    #[must_use]
    pub fn of(earlier: &ModelSet, later: &ModelSet) -> Self {
        let usable = |set: &ModelSet, taxel: usize| set.taxels.get(taxel).is_some_and(|model| model.is_usable());
        let only = |a: &ModelSet, b: &ModelSet| -> Vec<u32> {
            let taxels = (0..a.taxels.len()).filter(|&taxel| usable(a, taxel) && !usable(b, taxel));
            taxels.map(|taxel| taxel as u32).collect()
        };
        let both = (0..earlier.taxels.len()).filter(|&taxel| usable(earlier, taxel) && usable(later, taxel));
        Self {
            became_usable: only(later, earlier),
            lost: only(earlier, later),
            taxels: both.map(|taxel| compare(earlier, later, taxel)).collect(),
        }
    }
}

fn compare(earlier: &ModelSet, later: &ModelSet, taxel: usize) -> TaxelComparison {
    let rest = |set: &ModelSet| set.baseline.get(taxel).map(|rest| rest.mean).filter(|mean| mean.is_finite());
    let moved = rest(earlier).zip(rest(later)).map(|(earlier, later)| later - earlier);
    let mut compared = TaxelComparison { taxel: taxel as u32, rest_counts: moved, ..TaxelComparison::default() };
    let (before, after) = (&earlier.taxels[taxel], &later.taxels[taxel]);
    let Some((a, b)) = before.range.zip(after.range) else { return compared };
    // Sets fitted to a file have no rest: they are compared at equal counts.
    let shift = moved.unwrap_or(0.0);
    let (low, high) = (a[0].max(b[0] - shift), a[1].min(b[1] - shift));
    if low >= high {
        return compared;
    }
    let within = |model: &taxel_model::TaxelModel, count: f64| {
        model.evaluate(count).filter(|reading| reading.range == RangeState::InRange).map(|reading| reading.kpa)
    };
    let count = |step: u32| low + (high - low) * f64::from(step) / f64::from(STEPS);
    let at = |count: f64| within(before, count).zip(within(after, count + shift));
    let pairs: Vec<(f64, f64)> = (0..=STEPS).filter_map(|step| at(count(step))).collect();
    let differences = pairs.iter().map(|(a, b)| b - a).filter(|difference| difference.is_finite());
    let upper = UPPER_PART * earlier.pressure_max_kpa.min(later.pressure_max_kpa);
    let ratios: Vec<f64> = pairs.iter().filter(|(a, _)| *a > upper).map(|(a, b)| b / a).collect();
    compared.rms_kpa = Some(root_mean_square(differences)).filter(|rms| rms.is_finite());
    compared.gain_ratio = (!ratios.is_empty()).then(|| ratios.iter().sum::<f64>() / ratios.len() as f64);
    compared
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baseline::TaxelBaseline;
    use taxel_model::{FitOptions, Samples, TaxelModel};

    /// A taxel that loses counts evenly with pressure.
    fn model(rest: f64, kpa_per_count: f64, to_kpa: f64) -> TaxelModel {
        let pressure: Vec<f64> = (0..=400).map(|i| to_kpa * f64::from(i) / 400.0).collect();
        let noise = |i: usize| 0.2 * ((i * 7 % 11) as f64 - 5.0) / 5.0;
        let counts: Vec<f64> = pressure.iter().enumerate().map(|(i, p)| rest - p / kpa_per_count + noise(i)).collect();
        taxel_model::fit(&Samples::new(&counts, &pressure), &FitOptions { order: 1, ..FitOptions::default() })
    }

    fn set(id: &str, rest: f64, to_kpa: f64, taxels: Vec<TaxelModel>) -> ModelSet {
        ModelSet {
            id: id.to_owned(),
            patch: "palm".to_owned(),
            baseline: vec![TaxelBaseline { mean: rest, noise: 0.5 }; taxels.len()],
            pressure_max_kpa: to_kpa,
            taxels,
            ..ModelSet::default()
        }
    }

    #[test]
    fn a_change_is_read_at_equal_distance_from_rest_and_only_where_both_sets_are_calibrated() {
        let unusable = || TaxelModel::without_curve(taxel_model::Status::NoData, Default::default());
        let old = set("m-1", 240.0, 70.0, vec![model(240.0, 1.0, 70.0), model(240.0, 1.0, 70.0), unusable()]);
        let new = set("m-2", 243.0, 20.0, vec![model(243.0, 1.05, 20.0), unusable(), model(243.0, 1.0, 20.0)]);
        let compared = Comparison::of(&old, &new);
        assert_eq!((compared.lost.as_slice(), compared.became_usable.as_slice()), (&[1][..], &[2][..]));
        let [taxel] = compared.taxels.as_slice() else { panic!("{compared:?}") };
        let (gain, rms) = (taxel.gain_ratio.unwrap(), taxel.rms_kpa.unwrap());
        assert!((gain - 1.05).abs() < 0.005, "{gain}");
        assert_eq!((taxel.taxel, taxel.rest_counts), (0, Some(3.0)));
        assert!((0.5..0.7).contains(&rms), "5 % up to 20 kPa, no further than the set that ends there: {taxel:?}");
    }

    #[test]
    fn a_set_against_itself_has_not_changed_and_curves_without_a_common_range_have_no_figures() {
        let one = set("m-1", 240.0, 70.0, vec![model(240.0, 1.0, 70.0)]);
        let same = &Comparison::of(&one, &one).taxels[0];
        assert_eq!((same.gain_ratio, same.rms_kpa), (Some(1.0), Some(0.0)));
        let mut far = set("m-2", 240.0, 70.0, vec![model(500.0, 1.0, 70.0)]);
        let apart = Comparison::of(&one, &far).taxels.remove(0);
        assert_eq!(apart, TaxelComparison { rest_counts: Some(0.0), ..TaxelComparison::default() });
        far.taxels.clear();
        assert_eq!(Comparison::of(&one, &far).lost, [0]);
    }
}
