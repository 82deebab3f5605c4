//! Whether the curves, zeros and uncertainties of a model set from elsewhere can be those of a patch. A set that was scaled,
//! turned over or damaged on its way reads as a force that looks right.

use taxel_model::{Served, Sign, TaxelModel, figure};
use taxel_skin::Kilopascal;

use crate::baseline::TaxelBaseline;
use crate::model_set::ModelSet;

/// A calibration that went further than this many times the pressure that the patch is calibrated to is not its own.
const TARGETS_MAX: f64 = 10.0;

/// Within its range a curve lies between these shares of the pressure that the calibration reached: below zero and above
/// that pressure it may err by half of it.
const SHARES: [f64; 2] = [-0.5, 1.5];

/// In its range a curve goes at least over the so many-th part of that pressure: less is the curve of a taxel that feels
/// nothing.
const SPANS_MAX: f64 = 50.0;

/// All taxels were in the same vacuum, so that half of all curves come at least to this share of it. A single one may end early.
const USUAL_TOP_MIN: f64 = 0.5;

/// Places of the range that are looked at. A curve has at most ten turns.
const PLACES: u32 = 64;

/// A pressure that is uncertain by more than so many times the greatest of the calibration is none.
const SIGMAS_MAX: f64 = 10.0;

/// Readings of a taxel at rest scatter by less than this share of all counts.
const NOISE_SHARE_MAX: f64 = 1.0 / 16.0;

/// What cannot be so about a set, if anything: `target` is the pressure that the patch is calibrated to, `top` the highest
/// count.
pub(super) fn implausible(set: &ModelSet, target: Kilopascal, top: u16) -> Option<String> {
    odd_curves(set, target).or_else(|| odd_rest(set, f64::from(top)))
}

/// What cannot be so about the zeros of taxels that have a curve, and about how well that is known. Others are left out for
/// what is odd about them.
fn odd_rest(set: &ModelSet, top: f64) -> Option<String> {
    let (most, noise_max) = (SIGMAS_MAX * set.pressure_max_kpa, NOISE_SHARE_MAX * top);
    let of = |(taxel, (rest, model)): (usize, (&TaxelBaseline, &TaxelModel))| {
        if !rest.mean.is_nan() && !(0.0..=top).contains(&rest.mean) {
            let mean = figure(rest.mean);
            return Some(format!("taxel {taxel}: its `baseline` is {mean} counts, expected 0 to {top}"));
        }
        if !rest.noise.is_nan() && !(0.0..=noise_max).contains(&rest.noise) {
            let noise = figure(rest.noise);
            return Some(format!(
                "taxel {taxel}: its `baseline` has a noise of {noise} counts, expected 0 to {noise_max}"
            ));
        }
        let sigmas = model.sigma.iter().flat_map(|profile| &profile.sigma_kpa);
        if sigmas.clone().next().is_some() && sigmas.clone().all(|&sigma| sigma == 0.0) {
            return Some(format!("taxel {taxel}: its `sigma_kpa` is 0 everywhere, which no calibration is"));
        }
        let odd = sigmas.into_iter().find(|sigma| !(0.0..=most).contains(*sigma))?;
        let (odd, most) = (figure(*odd), figure(most));
        Some(format!("taxel {taxel}: its `sigma_kpa` has {odd}, expected 0 to {most} kPa"))
    };
    set.baseline.iter().zip(&set.taxels).enumerate().filter(|(_, (_, model))| model.is_usable()).find_map(of)
}

/// What cannot be so about the curves.
fn odd_curves(set: &ModelSet, target: Kilopascal) -> Option<String> {
    let (most, limit) = (set.pressure_max_kpa, TARGETS_MAX * target.0);
    let mut usable = set.taxels.iter().enumerate().filter(|(_, model)| model.is_usable()).peekable();
    if usable.peek().is_some() && !(most > 0.0 && most <= limit) {
        let most = figure(most);
        return Some(format!("`pressure_max_kpa` is {most}, expected more than 0 and at most {limit} for this patch"));
    }
    let mut tops = Vec::new();
    for (taxel, model) in usable {
        let own = model.served().zip(model.range).map(|(curve, range)| (curve, range, model.sign));
        tops.extend(own.map(|(curve, range, _)| range.map(|count| curve.evaluate(count))).map(|[a, b]| a.max(b)));
        let problem = own.and_then(|(curve, range, sign)| odd(curve, range, sign, most));
        if let Some(problem) = problem {
            return Some(format!("taxel {taxel}: {problem}"));
        }
    }
    odd_together(tops, most)
}

/// What cannot be so about the pressures at which the curves of all taxels end.
fn odd_together(mut tops: Vec<f64>, most: f64) -> Option<String> {
    tops.sort_by(f64::total_cmp);
    let usual = *tops.get(tops.len() / 2)?;
    (usual < USUAL_TOP_MIN * most).then(|| {
        let [usual, most, least] = [usual, most, USUAL_TOP_MIN * most].map(figure);
        format!("half of the curves end at {usual} kPa or below, where the calibration went up to {most} kPa: expected {least} kPa or more")
    })
}

/// What cannot be so about a curve of a calibration up to `most` kPa.
fn odd(curve: Served<'_>, [low, high]: [f64; 2], sign: Sign, most: f64) -> Option<String> {
    let (least, greatest) = (SHARES[0] * most, SHARES[1] * most);
    for place in 0..=PLACES {
        let count = low + (high - low) * f64::from(place) / f64::from(PLACES);
        let kpa = curve.evaluate(count);
        if !(least..=greatest).contains(&kpa) {
            let [kpa, count, least, greatest] = [kpa, count, least, greatest].map(figure);
            return Some(format!("its curve gives {kpa} kPa at count {count}, expected {least} to {greatest} kPa"));
        }
    }
    let ends = [curve.evaluate(low), curve.evaluate(high)];
    let (rise, span) = (sign.as_f64() * (ends[1] - ends[0]), most / SPANS_MAX);
    let expected = match rise {
        rise if rise < 0.0 => "against its `sign`".to_owned(),
        rise if rise < span => format!("expected {} kPa or more between its ends", figure(span)),
        _ => return None,
    };
    let [from, to] = ends.map(figure);
    Some(format!("its curve goes from {from} to {to} kPa, {expected}"))
}

#[cfg(test)]
mod tests {
    use taxel_model::{Curve, GaugeUncertainty, SigmaProfile, Status};

    use super::*;

    use Sign::{Falling, Rising};

    /// Of a taxel over 150 to 250 counts, its curve in the polynomials of Chebyshev.
    fn model(chebyshev: &[f64], sign: Sign) -> TaxelModel {
        let curve = Curve { centre: 200.0, half_width: 50.0, chebyshev: chebyshev.to_vec() };
        let without = TaxelModel::without_curve(Status::Ok, GaugeUncertainty::default());
        TaxelModel { sign, range: Some([150.0, 250.0]), curve: Some(curve), ..without }
    }

    fn set(pressure_max_kpa: f64, taxels: Vec<TaxelModel>) -> ModelSet {
        ModelSet { id: "m-1".to_owned(), patch: "p".to_owned(), pressure_max_kpa, taxels, ..ModelSet::default() }
    }

    /// What is said of a set for a patch that is calibrated to 70 kPa.
    fn says(set: &ModelSet) -> Option<String> {
        implausible(set, Kilopascal(70.0), 255)
    }

    #[test]
    fn a_calibration_reached_more_than_nothing_and_at_most_ten_times_the_target() {
        for (kpa, plausible) in [(0.0, false), (f64::NAN, false), (0.1, true), (700.0, true), (700.1, false)] {
            let found = says(&set(kpa, vec![model(&[0.0], Falling)]));
            let said = found.is_some_and(|why| why.contains("more than 0 and at most 700 for this patch"));
            assert_eq!(said, !plausible, "{kpa}");
        }
        let none = TaxelModel::without_curve(Status::NoData, GaugeUncertainty::default());
        assert_eq!(says(&set(0.0, vec![none])), None, "a set without models was calibrated to nothing");
    }

    /// Curves that err by more than half of 70 kPa, go against their sign, or were scaled down and would read too little.
    #[test]
    fn a_curve_is_near_the_pressures_of_the_calibration_and_goes_the_way_of_its_sign() {
        let most =
            "half of the curves end at 34.3 kPa or below, where the calibration went up to 70 kPa: expected 35 kPa";
        for (chebyshev, sign, problem) in [
            ([35.0, -69.9, 0.0], Falling, None),
            ([35.1, -70.0, 0.0], Falling, Some("its curve gives 105.1 kPa at count 150, expected -35 to 105 kPa")),
            // A bay between its ends, which are within the limits.
            ([30.0, -1.0, 70.0], Falling, Some("kPa at count 192.1875, expected -35 to 105 kPa")),
            ([f64::NAN, 0.0, 0.0], Falling, Some("its curve gives NaN kPa at count 150")),
            ([30.0, 5.0, 0.0], Rising, None),
            ([30.0, 5.0, 0.0], Falling, Some("taxel 0: its curve goes from 25 to 35 kPa, against its `sign`")),
            ([18.36, -17.34, 0.0], Falling, None),
            ([17.64, -16.66, 0.0], Falling, Some(most)),
            ([0.72, -0.68, 0.0], Falling, Some("expected 1.4 kPa or more between its ends")),
        ] {
            let found = says(&set(70.0, vec![model(&chebyshev, sign)]));
            let is = found.as_deref().zip(problem).is_some_and(|(is, problem)| is.contains(problem));
            assert!(is || (found.is_none() && problem.is_none()), "{chebyshev:?}: {found:?}");
        }
        // A taxel whose count ended early is one of many.
        let some = [[36.0, -34.0], [4.0, -4.0], [35.0, -30.0]].map(|chebyshev| model(&chebyshev, Falling));
        assert_eq!(says(&set(70.0, some.into())), None);
    }

    #[test]
    fn uncertainties_and_zeros_are_those_of_a_skin() {
        let with = |change: &dyn Fn(&mut ModelSet)| {
            let mut set = set(70.0, vec![model(&[35.0, -5.0], Falling)]);
            set.baseline = vec![TaxelBaseline { mean: 250.0, noise: 0.5 }];
            let profile = SigmaProfile { first_count: 150.0, step_counts: 50.0, sigma_kpa: vec![0.5, 700.0, 2.0] };
            set.taxels[0].sigma = Some(profile);
            change(&mut set);
            says(&set)
        };
        assert_eq!(with(&|_| ()), None);
        assert_eq!(with(&|set| set.baseline = vec![TaxelBaseline::UNKNOWN]), None);
        let is = |found: Option<String>, expected: &str| assert_eq!(found.as_deref(), Some(expected));
        is(with(&|set| set.baseline[0].mean = 255.5), "taxel 0: its `baseline` is 255.5 counts, expected 0 to 255");
        let noise = "taxel 0: its `baseline` has a noise of 16 counts, expected 0 to 15.9375";
        is(with(&|set| set.baseline[0].noise = 16.0), noise);
        let left_out = |set: &mut ModelSet| {
            set.taxels.push(TaxelModel::without_curve(Status::NoData, GaugeUncertainty::default()));
            set.baseline.push(TaxelBaseline { mean: 200.0, noise: 60.0 });
        };
        assert_eq!(with(&left_out), None, "a taxel that is left out for its noise");
        let sigma = "taxel 0: its `sigma_kpa` has 700.5, expected 0 to 700 kPa";
        is(with(&|set| set.taxels[0].sigma.as_mut().unwrap().sigma_kpa[1] = 700.5), sigma);
        let none = "taxel 0: its `sigma_kpa` is 0 everywhere, which no calibration is";
        is(with(&|set| set.taxels[0].sigma.as_mut().unwrap().sigma_kpa.fill(0.0)), none);
    }
}
