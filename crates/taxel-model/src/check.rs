//! Whether a model that came from outside (a file, a message) may be believed.

use crate::curve::Curve;
use crate::model::TaxelModel;
use crate::options::MAX_ORDER;
use crate::status::Flag;
use thiserror::Error;

/// Why a model cannot be served.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ModelError {
    /// A usable model needs a curve and a range.
    #[error("status is `ok` but the model has no {missing}")]
    Missing {
        /// What is not there.
        missing: &'static str,
    },
    /// A polynomial of order 0 to 10 has 1 to 11 coefficients.
    #[error("the curve has {found} coefficients, 1 to {} are possible", MAX_ORDER + 1)]
    Coefficients {
        /// How many there are.
        found: usize,
    },
    /// A number is not finite or not where it must be.
    #[error("{name} is {value}, expected {expected}")]
    Number {
        /// Which number.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        expected: &'static str,
    },
    /// The curve turns within its range, or is none, and the model does not say so.
    #[error("the curve is not monotone near count {count}")]
    NotMonotone {
        /// A count where the slope has the wrong sign.
        count: f64,
    },
}

fn number(name: &'static str, value: f64, good: bool, expected: &'static str) -> Result<(), ModelError> {
    if good && value.is_finite() { Ok(()) } else { Err(ModelError::Number { name, value, expected }) }
}

impl TaxelModel {
    /// Checks everything that evaluation relies on: finite numbers, an ordered range, a monotone curve.
    ///
    /// # Errors
    /// [`ModelError`] names the first thing that is wrong. A model without a curve is sound unless its status is ok.
    pub fn validate(&self) -> Result<(), ModelError> {
        if self.served().is_none() {
            return if self.status.is_ok() { Err(ModelError::Missing { missing: "curve" }) } else { Ok(()) };
        }
        let [low, high] = self.range.ok_or(ModelError::Missing { missing: "range" })?;
        number("range[0]", low, true, "a finite count")?;
        number("range[1]", high, high >= low, "a finite count not below range[0]")?;
        self.validate_sigma()?;
        if let Some(curve) = &self.curve {
            validate_numbers(curve)?;
        }
        let told = self.flags.iter().any(|flag| matches!(flag, Flag::NotMonotone { .. }));
        match (&self.points, &self.curve) {
            (Some(points), _) => {
                let problem = points.problem(self.sign.as_f64());
                problem.map_or(Ok(()), |count| Err(ModelError::NotMonotone { count }))
            }
            (None, Some(curve)) if self.status.is_ok() && !told => {
                let turns = curve.wrong_slope([low, high], self.sign.as_f64());
                turns.map_or(Ok(()), |count| Err(ModelError::NotMonotone { count }))
            }
            _ => Ok(()),
        }
    }

    fn validate_sigma(&self) -> Result<(), ModelError> {
        let Some(sigma) = &self.sigma else { return Ok(()) };
        number("sigma.first_count", sigma.first_count, true, "a finite count")?;
        number("sigma.step_counts", sigma.step_counts, sigma.step_counts > 0.0, "a positive number of counts")?;
        let mut deviations = sigma.sigma_kpa.iter();
        deviations.try_for_each(|s| number("sigma.sigma_kpa", *s, *s >= 0.0, "standard deviations of 0 kPa and more"))
    }
}

fn validate_numbers(curve: &Curve) -> Result<(), ModelError> {
    number("curve.centre", curve.centre, true, "a finite count")?;
    number("curve.half_width", curve.half_width, curve.half_width > 0.0, "a positive number of counts")?;
    if curve.chebyshev.is_empty() || curve.chebyshev.len() > usize::from(MAX_ORDER) + 1 {
        return Err(ModelError::Coefficients { found: curve.chebyshev.len() });
    }
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
        assert!(with_series(vec![1.0; 12]).contains("12 coefficients"));
        assert!(with_series(vec![f64::NAN]).contains("NaN"));
        assert!(with_series(vec![0.0, 0.0, 1.0]).contains("monotone"));
    }
}
