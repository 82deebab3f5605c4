//! The 95 % interval of the polynomial holds 95 % of what the fit has not seen.

#![allow(clippy::unwrap_used)] // Tests; the exemption knows only functions marked as such.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use taxel_model::{FitOptions, Samples, Status, fit, student_975};

const FULL_SCALE_KPA: f64 = 70.0;

fn normal(random: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| random.random_range(0.0..1.0)).sum::<f64>() - 6.0
}

/// Counts of a simulated taxel on a ramp, after rounding to 8 bits.
fn ramp(gain: f64, half: f64, samples: usize, random: &mut ChaCha8Rng) -> (Vec<f64>, Vec<f64>) {
    (0..samples)
        .map(|k| {
            let p = FULL_SCALE_KPA * k as f64 / samples as f64;
            let gauge = p + 0.05 * normal(random);
            ((240.0 - gain * p / (p + half) + 0.7 * normal(random)).round().clamp(0.0, 255.0), gauge)
        })
        .unzip()
}

#[derive(Default)]
struct Tally {
    held: f64,
    all: f64,
}

impl Tally {
    fn add(&mut self, held: bool) {
        self.held += f64::from(u8::from(held));
        self.all += 1.0;
    }

    fn share(&self) -> f64 {
        self.held / self.all
    }
}

#[test]
fn intervals_hold_on_held_out_ramps() {
    for samples in [400, 3000] {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let (mut all, mut top, mut worst) = (Tally::default(), Tally::default(), 1.0_f64);
        for _ in 0..60 {
            let (gain, half) = (random.random_range(40.0..180.0), random.random_range(15.0..65.0));
            let (c, p) = ramp(gain, half, samples, &mut random);
            let model = fit(&Samples::new(&c, &p), &FitOptions::default());
            assert_eq!(model.status, Status::Ok);
            let (c, p) = ramp(gain, half, 1500, &mut random);
            let mut taxel = Tally::default();
            for (c, p) in c.iter().zip(&p) {
                let reading = model.evaluate(*c).unwrap();
                let held = (p - reading.kpa).abs() <= student_975(model.quality.dof) * reading.sigma_kpa;
                taxel.add(held);
                all.add(held);
                if *p > 60.0 {
                    top.add(held);
                }
            }
            worst = worst.min(taxel.share());
        }
        eprintln!(
            "{samples} samples: {:.3} of all, {:.3} above 60 kPa, {worst:.3} for the worst taxel",
            all.share(),
            top.share()
        );
        assert!((0.93..=0.97).contains(&all.share()), "{samples}: {}", all.share());
        assert!(top.share() > 0.90, "{samples}: {} above 60 kPa", top.share());
        assert!(worst > 0.90, "{samples}: worst taxel {worst}");
    }
}
