//! Simulated recordings for the fit: a ramp of pressure, and what taxels count meanwhile.
//!
//! C = C0 - g P / (P + Ph) + noise, with C0 = 240 +- 6, g = 40 to 180 and Ph = 15 to 65 kPa per taxel, noise of 0.7
//! counts; P rises evenly from 0 to 70 kPa with noise of 0.05 kPa. A converter of 16 bits has all counts times 257.
//! Pressures are whole multiples of 2^-10 kPa, about what a gauge resolves: so they are exact as f64 and as
//! [`FixedPressure`] alike, and every contender sees the very same numbers.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;
use taxel_model::{Accumulator, FixedPressure};

/// Units of pressure in a kPa.
const UNITS_PER_KPA: i64 = 1024;

const TOP_KPA: f64 = 70.0;

/// Width of the converter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Bits {
    Eight,
    Sixteen,
}

impl Bits {
    pub fn number(self) -> u32 {
        match self {
            Self::Eight => 8,
            Self::Sixteen => 16,
        }
    }

    /// The greatest count, and how many of its counts are one of 8 bits.
    fn full_scale(self) -> (f64, f64) {
        match self {
            Self::Eight => (255.0, 1.0),
            Self::Sixteen => (65_535.0, 257.0),
        }
    }
}

/// What one taxel counted.
#[derive(Clone, Debug)]
pub(crate) struct Taxel {
    /// A count a scan.
    pub counts: Vec<f64>,
    /// The same as the bus has them; empty beyond 8 bits.
    pub bytes: Vec<u8>,
    /// The distinct counts, ascending.
    pub codes: Vec<f64>,
}

/// One ramp.
#[derive(Clone, Debug)]
pub(crate) struct Recording {
    pub bits: Bits,
    /// Pressure of each scan, in units of 2^-10 kPa.
    pub units: Vec<i64>,
    /// The same in kPa.
    pub kpa: Vec<f64>,
    /// The same as the live path has it.
    pub fixed: Vec<Option<FixedPressure>>,
    pub taxels: Vec<Taxel>,
}

/// A normal number, by Box and Muller's method.
fn normal(random: &mut ChaCha8Rng) -> f64 {
    let radius = (-2.0 * random.random_range(f64::MIN_POSITIVE..1.0).ln()).sqrt();
    radius * (TAU * random.random_range(0.0..1.0)).cos()
}

impl Recording {
    pub fn simulate(bits: Bits, scans: usize, taxels: usize, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let truth: Vec<f64> = (0..scans).map(|k| TOP_KPA * k as f64 / scans as f64).collect();
        let noisy = |kpa: &f64| ((kpa + 0.05 * normal(&mut random)) * UNITS_PER_KPA as f64).round() as i64;
        let units: Vec<i64> = truth.iter().map(noisy).collect();
        let kpa: Vec<f64> = units.iter().map(|units| *units as f64 / UNITS_PER_KPA as f64).collect();
        let fixed = kpa.iter().map(|kpa| FixedPressure::from_kpa(*kpa)).collect();
        let taxels = (0..taxels).map(|_| Taxel::simulate(bits, &truth, &mut random)).collect();
        Self { bits, units, kpa, fixed, taxels }
    }

    /// The running sums of one taxel of 8 bits.
    pub fn sums(&self, taxel: usize) -> Accumulator {
        let mut sums = Accumulator::new();
        sums.extend(self.taxels[taxel].bytes.iter().copied().zip(self.fixed.iter().copied()), 0);
        sums
    }
}

impl Taxel {
    fn simulate(bits: Bits, truth_kpa: &[f64], random: &mut ChaCha8Rng) -> Self {
        let (full_scale, scale) = bits.full_scale();
        // Short of the rails, which are another story: section `stability`.
        let rest = (240.0 + 5.9 * normal(random)).min(248.0);
        let (gain, half_kpa) = (random.random_range(40.0..180.0), random.random_range(15.0..65.0));
        let counts: Vec<f64> = truth_kpa
            .iter()
            .map(|kpa| rest - gain * kpa / (kpa + half_kpa) + 0.7 * normal(random))
            .map(|count| (count * scale).round().clamp(1.0, full_scale - 1.0))
            .collect();
        let bytes = if bits == Bits::Eight { counts.iter().map(|count| *count as u8).collect() } else { Vec::new() };
        let mut codes = counts.clone();
        codes.sort_by(f64::total_cmp);
        codes.dedup();
        Self { counts, bytes, codes }
    }

    /// Greatest less least count.
    pub fn swing(&self) -> f64 {
        self.codes.last().zip(self.codes.first()).map_or(0.0, |(last, first)| last - first)
    }
}
