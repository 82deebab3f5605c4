//! A model whose pressures are corrected: P' = gain P + offset.
//!
//! Known loads tell by what factor a skin reads too little or too much, long after its curves were fitted. The curve, its
//! plays, its error and every figure in kPa follow; the range of counts and whether a taxel may be used stay as they are.

use crate::model::TaxelModel;
use crate::plays::Plays;

impl Plays {
    /// The plays about gain P.
    #[must_use]
    pub fn scaled(&self, gain: f64) -> Self {
        Self { weights_kpa: self.weights_kpa.map(|weight| gain * weight), ..self.clone() }
    }
}

impl TaxelModel {
    /// The model of gain P + offset, the offset in kPa; `gain` is positive.
    #[must_use]
    pub fn scaled(&self, gain: f64, offset_kpa: f64) -> Self {
        let mut model = self.clone();
        let times = |kpa: &mut f64| *kpa *= gain;
        for coefficients in
            model.curve.iter_mut().map(|curve| &mut curve.chebyshev).chain([&mut model.raw_coefficients])
        {
            coefficients.iter_mut().for_each(times);
            coefficients.iter_mut().take(1).for_each(|constant| *constant += offset_kpa);
        }
        model.points.iter_mut().flat_map(|points| &mut points.kpa).for_each(|kpa| *kpa = gain * *kpa + offset_kpa);
        model.sigma.iter_mut().flat_map(|sigma| &mut sigma.sigma_kpa).for_each(times);
        let (gauge, quality) = (&mut model.gauge, &mut model.quality);
        [&mut gauge.offset_kpa, &mut gauge.noise_kpa, &mut quality.rmse_kpa].into_iter().for_each(times);
        quality.repeatability_kpa.iter_mut().chain(&mut quality.interval_kpa).for_each(times);
        model
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Sign;
    use crate::options::FitOptions;
    use crate::plays::PlayState;
    use crate::{Samples, fit};
    use proptest::prelude::*;

    fn model() -> TaxelModel {
        let kpa: Vec<f64> = (0..700).map(|k| f64::from(k) / 10.0).collect();
        let counts: Vec<f64> = kpa.iter().map(|kpa| (240.0 - 80.0 * kpa / (kpa + 40.0)).round()).collect();
        fit(&Samples::new(&counts, &kpa), &FitOptions::default())
    }

    proptest! {
        #[test]
        fn every_reading_is_the_gain_times_the_old_one_and_the_offset(
            gain in 0.5..2.0_f64, offset in -5.0..5.0_f64, counts in proptest::collection::vec(100.0..255.0_f64, 1..20),
        ) {
            let (before, after) = (model(), model().scaled(gain, offset));
            let plays = Plays {
                range: before.range.unwrap(), sign: Sign::Falling,
                radii_counts: [3.0, 8.0, 0.0, 0.0], weights_kpa: [0.4, 0.2, 0.0, 0.0], slack_counts: 0.0,
            };
            let (scaled, mut state, mut scaled_state) = (plays.scaled(gain), PlayState::default(), PlayState::default());
            for count in counts {
                let (was, is) = (before.evaluate(count).unwrap(), after.evaluate(count).unwrap());
                prop_assert!((is.kpa - (gain * was.kpa + offset)).abs() < 1e-9, "{was:?} {is:?}");
                prop_assert!((is.sigma_kpa - gain * was.sigma_kpa).abs() < 1e-9 && is.range == was.range);
                let (was, is) = (plays.bend_kpa(&mut state, count), scaled.bend_kpa(&mut scaled_state, count));
                prop_assert!((is - gain * was).abs() < 1e-9, "{was} {is}");
            }
            prop_assert_eq!((after.status, after.range, after.order), (before.status, before.range, before.order));
        }
    }
}
