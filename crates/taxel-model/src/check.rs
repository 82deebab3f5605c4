//! Whether a model that came from outside (a file, a message) may be used.

use crate::curve::Curve;
use crate::model::TaxelModel;
use crate::options::TERMS_MAX;
use crate::status::Flag;
use crate::uncertainty::KNOTS_MAX;

fn number(name: &str, value: f64, good: bool, expected: &str) -> Result<(), String> {
    if good && value.is_finite() { Ok(()) } else { Err(format!("{name} is {value}, expected {expected}")) }
}

fn entries(name: &str, found: usize, most: usize) -> Result<(), String> {
    if (1..=most).contains(&found) {
        Ok(())
    } else {
        Err(format!("{name} has {found} entries, 1 to {most} are possible"))
    }
}

impl TaxelModel {
    /// Checks everything that evaluation relies on: finite numbers, an ordered range, a monotone curve.
    ///
    /// # Errors
    /// Names the first thing that is wrong. A model without a curve is sound unless its status is ok.
    pub fn validate(&self) -> Result<(), String> {
        let missing = |what| format!("status is `ok` but the model has no {what}");
        if self.served().is_none() {
            return if self.status.is_ok() { Err(missing("curve")) } else { Ok(()) };
        }
        let [low, high] = self.range.ok_or_else(|| missing("range"))?;
        number("range[0]", low, true, "a finite count")?;
        number("range[1]", high, high >= low, "a finite count not below range[0]")?;
        if let Some(sigma) = &self.sigma {
            number("sigma.first_count", sigma.first_count, true, "a finite count")?;
            number("sigma.step_counts", sigma.step_counts, sigma.step_counts > 0.0, "a positive number of counts")?;
            entries("sigma.sigma_kpa", sigma.sigma_kpa.len(), KNOTS_MAX)?;
            let deviation = |s: &f64| number("sigma.sigma_kpa", *s, *s >= 0.0, "standard deviations of 0 kPa and more");
            sigma.sigma_kpa.iter().try_for_each(deviation)?;
        }
        self.curve.as_ref().map_or(Ok(()), validate_numbers)?;
        let told = self.flags.iter().any(|flag| matches!(flag, Flag::NotMonotone { .. }));
        let turns = match (&self.points, &self.curve) {
            (Some(points), _) => {
                entries("points.counts", points.counts.len(), KNOTS_MAX)?;
                points.problem(self.sign.as_f64())
            }
            (None, Some(curve)) if self.status.is_ok() && !told => curve.wrong_slope([low, high], self.sign.as_f64()),
            _ => None,
        };
        turns.map_or(Ok(()), |count| Err(format!("the curve is not monotone near count {count}")))
    }
}

fn validate_numbers(curve: &Curve) -> Result<(), String> {
    number("curve.centre", curve.centre, true, "a finite count")?;
    number("curve.half_width", curve.half_width, curve.half_width > 0.0, "a positive number of counts")?;
    entries("curve.chebyshev", curve.chebyshev.len(), TERMS_MAX)?;
    curve.chebyshev.iter().try_for_each(|c| number("curve.chebyshev", *c, true, "finite coefficients"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FitOptions, Samples, fit};

    #[test]
    fn a_model_from_outside_is_checked() {
        let kpa: Vec<f64> = (0..2000).map(|k| 0.035 * f64::from(k)).collect();
        let counts: Vec<f64> = kpa.iter().map(|p| (240.0 - 110.0 * p / (p + 40.0)).round()).collect();
        let good = fit(&Samples::new(&counts, &kpa), &FitOptions::default());
        assert_eq!(good.validate(), Ok(()));
        let curve = good.curve.clone().unwrap();
        let with = |change: &dyn Fn(&mut TaxelModel)| {
            let mut model = good.clone();
            change(&mut model);
            model.validate().unwrap_err().to_string()
        };
        let with_series =
            |chebyshev: Vec<f64>| with(&|m| m.curve = Some(Curve { chebyshev: chebyshev.clone(), ..curve.clone() }));
        assert!(with(&|m| m.curve = None).contains("no curve"));
        assert!(with(&|m| m.range = Some([2.0, 1.0])).contains("range[1] is 1"));
        assert!(with(&|m| m.curve = Some(Curve { half_width: 0.0, ..curve.clone() })).contains("half_width is 0"));
        assert!(with_series(vec![1.0; 12]).contains("has 12 entries, 1 to 11"));
        let knots = |m: &mut TaxelModel| m.sigma.as_mut().unwrap().sigma_kpa = vec![1.0; KNOTS_MAX + 1];
        assert!(with(&knots).contains("has 1026 entries, 1 to 1025"));
        assert!(with_series(vec![f64::NAN]).contains("NaN"));
        assert!(with_series(vec![0.0, 0.0, 1.0]).contains("monotone"));
    }
}
