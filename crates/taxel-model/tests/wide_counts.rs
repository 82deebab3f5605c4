//! Counts of 8 to 24 bits: the polynomial is as good as the noise allows, however rarely a count repeats.

use proptest::prelude::*;
use taxel_model::{FitOptions, Samples, TaxelModel, fit};

const TOP_KPA: f64 = 70.0;

/// A recording whose counts are linear in pressure.
#[derive(Clone, Copy, Debug)]
struct Linear {
    rest_count: f64,
    /// Counts per kPa, negative where counts fall.
    slope: f64,
    noise_counts: f64,
    /// Scans at rest before the ramp.
    rest_scans: usize,
    ramp_scans: usize,
    seed: u64,
}

impl Linear {
    /// Counts and pressures.
    fn samples(&self) -> (Vec<f64>, Vec<f64>) {
        let mut state = self.seed;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / f64::from(1_u32 << 24)
        };
        let kpa: Vec<f64> = (0..self.rest_scans + self.ramp_scans)
            .map(|i| TOP_KPA * i.saturating_sub(self.rest_scans) as f64 / (self.ramp_scans - 1) as f64)
            .collect();
        let counts = kpa.iter().map(|p| {
            let noise = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
            (self.rest_count + self.slope * p + self.noise_counts * noise).round()
        });
        (counts.collect(), kpa)
    }

    fn fit(&self) -> TaxelModel {
        let (counts, kpa) = self.samples();
        fit(&Samples::new(&counts, &kpa), &FitOptions::default())
    }

    /// What noise and rounding of the counts leave, kPa.
    fn allowed_kpa(&self) -> f64 {
        (self.noise_counts.powi(2) + 1.0 / 12.0).sqrt() / self.slope.abs()
    }

    fn swing(&self) -> f64 {
        self.slope.abs() * TOP_KPA
    }
}

/// Panics unless the model is as good as the noise allows over all of the pressure.
fn assert_good(truth: &Linear, model: &TaxelModel) {
    let context = || format!("{truth:?}: {:?} {:?} {:?}", model.status, model.range, model.flags);
    assert!(model.is_usable(), "{}", context());
    let allowed = truth.allowed_kpa();
    let rmse = model.quality.rmse_kpa;
    assert!(rmse <= 1.15 * allowed + 0.04, "RMSE {rmse} kPa, noise allows {allowed}; {}", context());
    let covered = model.quality.swing_counts / truth.swing();
    assert!(covered > 0.97, "only {covered} of the swing is calibrated; {}", context());
    for share in [0.03, 0.2, 0.5, 0.8, 0.97] {
        let kpa = share * TOP_KPA;
        let read = model.evaluate(truth.rest_count + truth.slope * kpa).map_or(f64::NAN, |reading| reading.kpa);
        assert!((read - kpa).abs() <= 0.5 * allowed + 0.1, "{read} kPa at {kpa} kPa; {}", context());
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// Any width, slope and noise: the RMSE is the noise over the slope.
    #[test]
    fn counts_of_any_width_are_fitted_as_well_as_their_noise_allows(
        bits in 8_u32..=24, swing_share in 0.15..0.9_f64, noise_share in 0.0..0.012_f64, falling: bool,
        rest_scans in 0_usize..400, ramp_scans in 400_usize..3000, seed: u64,
    ) {
        let full = f64::from((1_u32 << bits) - 1);
        let swing = swing_share * full;
        let sign = if falling { -1.0 } else { 1.0 };
        let rest_count = (0.5 * full - sign * 0.5 * swing).round();
        let noise_counts = (noise_share * swing).max(0.5).min(0.012 * full);
        let truth = Linear { rest_count, slope: sign * swing / TOP_KPA, noise_counts, rest_scans, ramp_scans, seed };
        assert_good(&truth, &truth.fit());
    }
}
