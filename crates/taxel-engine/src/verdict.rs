//! Whether a calibration is good: a model set against limits that everybody may read here, in words for all who show them.

use std::collections::BTreeMap;

use taxel_skin::counted;

use crate::comparison::Comparison;
use crate::model_set::ModelSet;
use crate::statistics::median;

/// Least share of the taxels with a usable model. The paper's forearm had 95 %.
pub const USABLE_MIN: f64 = 0.9;
/// Greatest fit error, the median over the usable taxels, as a share of the highest pressure.
pub const FIT_ERROR_MAX: f64 = 0.03;
/// Least share of the target that the pressure has to reach.
pub const REACHED_MIN: f64 = 0.9;
/// Least share of the taxels that the set in use can use.
pub const OF_IN_USE_MIN: f64 = 0.9;

/// A model set against the limits.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Verdict {
    /// Whether it holds all of them.
    pub is_good: bool,
    /// The same in words with the figures, a line each: the limits, then why taxels are excluded, then the set in use.
    pub lines: Vec<String>,
    /// How much more it reads than the set in use, in %: the median over the taxels that both can use.
    pub against_in_use_percent: Option<f64>,
}

/// A limit that does not hold, in a word, and the figure with its limit.
type Judged = (Option<&'static str>, String);

impl Verdict {
    /// Of a set; `target_kpa` is where its ramps were to end, `in_use` another set that is in use.
    #[must_use]
    pub fn of(set: &ModelSet, target_kpa: Option<f64>, in_use: Option<&ModelSet>) -> Self {
        let mut judged = vec![usable(set)];
        judged.extend(fit_error(set));
        judged.extend(target_kpa.map(|target| reached(set.pressure_max_kpa, target)));
        let against = in_use.map(|other| Comparison::of(other, set));
        let change = against.as_ref().and_then(|of| median(of.taxels.iter().filter_map(|taxel| taxel.gain_ratio)));
        let against_in_use_percent = change.map(|ratio| 100.0 * (ratio - 1.0));
        let mut last = Vec::new();
        if let Some(other) = in_use {
            let reads = against_in_use_percent.map_or_else(|| "It cannot be compared with".to_owned(), reads);
            let (now, before) = (count(set), count(other));
            let fewer = (now as f64) < OF_IN_USE_MIN * before as f64;
            judged.extend(fewer.then(|| (Some("far fewer taxels than the set in use"), String::new())));
            last.push(format!("{reads} the set in use, and has {now} usable taxels instead of {before}."));
        }
        let broken: Vec<&str> = judged.iter().filter_map(|(broken, _)| *broken).collect();
        let word = if broken.is_empty() { "Good.".to_owned() } else { format!("Not good: {}.", broken.join(", ")) };
        let figures: Vec<String> = judged.into_iter().map(|(_, text)| text).filter(|text| !text.is_empty()).collect();
        let mut lines = vec![format!("{word} {}.", figures.join(", "))];
        let of_cause = |(why, taxels): (&str, usize)| format!("{} {why}.", counted(taxels, "taxel", "taxels"));
        lines.extend(causes(set).into_iter().map(of_cause));
        lines.extend(last);
        Self { is_good: broken.is_empty(), lines, against_in_use_percent }
    }
}

/// How much more a set reads than another one.
fn reads(percent: f64) -> String {
    match (10.0 * percent).round() / 10.0 {
        0.0 => "It reads as much as".to_owned(),
        more if more > 0.0 => format!("It reads {more:.1} % more than"),
        less => format!("It reads {:.1} % less than", -less),
    }
}

fn count(set: &ModelSet) -> usize {
    set.taxels.iter().filter(|model| model.is_usable()).count()
}

fn usable(set: &ModelSet) -> Judged {
    let (usable, taxels) = (count(set), set.taxels.len());
    let share = usable as f64 / taxels.max(1) as f64;
    let text =
        format!("{usable} of {taxels} taxels ({:.0} %; at least {:.0} % needed)", 100.0 * share, 100.0 * USABLE_MIN);
    ((share < USABLE_MIN).then_some("too few taxels"), text)
}

/// `None` without a taxel that is fitted.
fn fit_error(set: &ModelSet) -> Option<Judged> {
    let fitted = set.taxels.iter().filter(|model| model.is_usable());
    let kpa = median(fitted.map(|model| model.quality.rmse_kpa))?;
    let share = kpa / set.pressure_max_kpa;
    let text =
        format!("fit error {kpa:.1} kPa ({:.1} %; at most {:.0} % allowed)", 100.0 * share, 100.0 * FIT_ERROR_MAX);
    // A highest pressure of 0 or none is no measure of anything.
    Some(((share.is_nan() || share > FIT_ERROR_MAX).then_some("the curves do not fit"), text))
}

fn reached(kpa: f64, target_kpa: f64) -> Judged {
    let share = kpa / target_kpa;
    let text = format!("up to {kpa:.0} of {target_kpa:.0} kPa (at least {:.0} % needed)", 100.0 * REACHED_MIN);
    ((share.is_nan() || share < REACHED_MIN).then_some("the pressure ended too low"), text)
}

/// Why taxels are excluded, and how many are because of that; the most frequent first.
fn causes(set: &ModelSet) -> Vec<(&'static str, usize)> {
    let mut counted: BTreeMap<&'static str, usize> = BTreeMap::new();
    for why in set.taxels.iter().filter_map(|model| cause(model.status.code())) {
        *counted.entry(why).or_default() += 1;
    }
    let mut causes: Vec<_> = counted.into_iter().collect();
    causes.sort_by_key(|(_, taxels)| std::cmp::Reverse(*taxels));
    causes
}

/// What a taxel did that is excluded with this code, and what that may come from; the page has the same words (`WHY` in
/// `calibrate.js`).
#[must_use]
pub fn cause(code: &str) -> Option<&'static str> {
    Some(match code {
        "dead" | "insufficient_swing" => "hardly moved: no contact with the bag, or broken",
        "no_data" | "missing" => "gave no usable values: silent, or saturated",
        "no_excitation" => "saw no change of the pressure",
        "railed" => "stayed at an end of the range: saturated, or broken",
        "frozen" | "jumping" | "module_flicker" => "got stuck or jumped: look at the board and its cable",
        "unproven" => "had too few samples",
        "poor_fit" => "did not follow the pressure closely: look whether the bag lies tight there",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_model::{FitOptions, Samples, Status, TaxelModel};

    /// A taxel of 1 kPa a count whose gauge scatters by `scatter_kpa` around the line.
    fn model(scatter_kpa: f64, gain: f64) -> TaxelModel {
        let steps = 0..=400;
        let counts: Vec<f64> = steps.clone().map(|i| 240.0 - 0.175 * f64::from(i)).collect();
        let kpa: Vec<f64> =
            steps.map(|i| gain * 0.175 * f64::from(i) + if i % 2 == 0 { scatter_kpa } else { -scatter_kpa }).collect();
        taxel_model::fit(&Samples::new(&counts, &kpa), &FitOptions { order: 1, ..FitOptions::default() })
    }

    fn set(taxels: Vec<TaxelModel>) -> ModelSet {
        ModelSet {
            id: "m-1".to_owned(),
            patch: "palm".to_owned(),
            pressure_max_kpa: 70.0,
            taxels,
            ..ModelSet::default()
        }
    }

    fn still(taxels: usize) -> Vec<TaxelModel> {
        vec![TaxelModel::without_curve(Status::Dead { count: 240.0 }, Default::default()); taxels]
    }

    #[test]
    fn a_set_within_all_limits_is_good_and_says_each_figure_beside_its_limit() {
        let good = set([vec![model(0.7, 1.0); 19], still(1)].concat());
        let verdict = Verdict::of(&good, Some(70.0), None);
        assert!(verdict.is_good);
        assert_eq!(
            verdict.lines,
            [
                "Good. 19 of 20 taxels (95 %; at least 90 % needed), fit error 0.7 kPa (1.0 %; at most 3 % allowed), \
                 up to 70 of 70 kPa (at least 90 % needed).",
                "1 taxel hardly moved: no contact with the bag, or broken."
            ]
        );
    }

    #[test]
    fn each_code_of_an_excluded_taxel_has_words_and_the_page_has_the_same() {
        let page = include_str!("../../taxel-page/web/calibrate.js");
        for code in "no_data no_excitation dead insufficient_swing unproven poor_fit railed frozen jumping module_flicker missing"
            .split(' ')
        {
            let words = cause(code).unwrap().split(':').next().unwrap();
            assert!(page.contains(&format!("{code}: \"{words}\"")), "{code}: {words}");
        }
    }

    #[test]
    fn each_limit_that_does_not_hold_is_named() {
        let few = Verdict::of(&set([vec![model(0.7, 1.0); 17], still(3)].concat()), None, None);
        assert!(
            !few.is_good && few.lines[0].starts_with("Not good: too few taxels. 17 of 20 taxels (85 %;"),
            "{few:?}"
        );
        let loose = Verdict::of(&set(vec![model(3.0, 1.0); 20]), None, None);
        assert!(!loose.is_good && loose.lines[0].starts_with("Not good: the curves do not fit. "), "{loose:?}");
        let low = Verdict::of(&set(vec![model(0.7, 1.0); 20]), Some(90.0), None);
        assert!(!low.is_good && low.lines[0].contains("the pressure ended too low. "), "{low:?}");
        let nothing = Verdict::of(&set(Vec::new()), None, None);
        assert!(!nothing.is_good && nothing.lines[0].contains("0 of 0 taxels (0 %;"), "{nothing:?}");
    }

    #[test]
    fn a_set_is_compared_with_the_one_in_use() {
        let before = set(vec![model(0.1, 1.0); 20]);
        let after = Verdict::of(&set(vec![model(0.1, 1.02); 20]), None, Some(&before));
        assert!(after.is_good && (after.against_in_use_percent.unwrap() - 2.0).abs() < 0.1, "{after:?}");
        assert_eq!(after.lines[1], "It reads 2.0 % more than the set in use, and has 20 usable taxels instead of 20.");
        let many = set(vec![model(0.1, 1.0); 40]);
        let fewer = Verdict::of(&set([vec![model(0.1, 1.0); 36], still(4)].concat()), None, Some(&many));
        assert!(fewer.is_good, "nine tenths are enough: {fewer:?}");
        let fewer = Verdict::of(&set(vec![model(0.1, 1.0); 35]), None, Some(&many));
        assert!(fewer.lines[0].starts_with("Not good: far fewer taxels than the set in use. 35 of 35"), "{fewer:?}");
    }
}
