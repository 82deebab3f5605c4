//! What counts mean between the zero and the least pressure that was calibrated.
//!
//! A curve says nothing beyond the ends of its range. At the end of least pressure two things are known all the same: at
//! the zero nothing presses, and from there to the end of the range the pressure only rises. A ramp of which the beginning
//! was lost (a gauge that fell silent, a bag that was not vented) may begin at 10 kPa, and then a light touch is not 10 kPa.

use taxel_model::{Sign, TaxelModel};

/// The stretch from the zero of the models to the end of their range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LightEnd {
    /// Zero and end, counts as the model has them.
    zero: f64,
    end: f64,
    sign: Sign,
    /// Pressure at the end, kPa, more than none.
    kpa: f64,
}

impl LightEnd {
    /// Of a model whose zero lies before the end of its range; else there is no such stretch.
    pub(super) fn new(model: &TaxelModel, zero: f64) -> Option<Self> {
        let ([low, high], sign) = (model.range?, model.sign);
        let end = if sign == Sign::Rising { low } else { high };
        let kpa = model.evaluate(end)?.kpa;
        (sign.as_f64() * (end - zero) > 0.0 && kpa > 0.0).then_some(Self { zero, end, sign, kpa })
    }

    /// Pressure at a count on this stretch or before the zero, and what its standard uncertainty is beside that at the end,
    /// both in kPa; nothing for a count in the range or beyond.
    ///
    /// On a straight line; the uncertainty is how far a parabola through both ends is away from it. Skin bends the same way
    /// everywhere, so a contact has it in common.
    pub(super) fn at(&self, count: f64) -> Option<(f64, f64)> {
        let part = (count - self.zero) / (self.end - self.zero);
        let before = self.sign.as_f64() * (self.end - count) > 0.0;
        let part = part.max(0.0);
        before.then_some((part * self.kpa, part * (1.0 - part) * self.kpa))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::force::tests::REST;
    use taxel_model::{FitOptions, Samples, fit};

    /// A taxel that was calibrated from 10 kPa on, a count for each kPa.
    pub(in crate::force) fn begun_late() -> TaxelModel {
        let kpa: Vec<f64> = (0..600).map(|k| 10.0 + f64::from(k) / 10.0).collect();
        let counts: Vec<f64> = kpa.iter().map(|kpa| (f64::from(REST) - kpa).round()).collect();
        fit(&Samples::new(&counts, &kpa), &FitOptions::default())
    }

    #[test]
    fn a_light_touch_is_read_between_nothing_and_the_least_calibrated_pressure() {
        let model = begun_late();
        let zero = f64::from(REST);
        let light = LightEnd::new(&model, zero).unwrap();
        for kpa in 0..10 {
            let (read, sigma) = light.at(zero - f64::from(kpa)).unwrap();
            assert!((read - f64::from(kpa)).abs() < 0.3, "{kpa} kPa: {read}");
            assert!(sigma >= 0.0 && (kpa == 0 || sigma > 0.05 * f64::from(kpa)), "{kpa} kPa: {sigma}");
        }
        assert_eq!(light.at(zero + 5.0), Some((0.0, 0.0)), "lighter than nothing");
        assert_eq!(light.at(zero - 30.0), None, "the curve has it");
    }

    #[test]
    fn a_zero_within_the_range_leaves_no_stretch() {
        let model = begun_late();
        assert_eq!(LightEnd::new(&model, f64::from(REST) - 20.0), None);
        assert_eq!(LightEnd::new(&model, f64::NAN), None);
    }
}
