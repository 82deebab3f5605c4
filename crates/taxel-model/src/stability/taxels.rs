//! Synthetic taxels of known law.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Counts and pressures in kPa, one of each per sample.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    /// Counts.
    pub counts: Vec<f64>,
    /// Pressures, kPa.
    pub kpa: Vec<f64>,
}

impl Recording {
    /// Of samples.
    pub fn new(pairs: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let (counts, kpa) = pairs.into_iter().unzip();
        Self { counts, kpa }
    }

    /// The same samples in another order.
    #[must_use]
    pub fn permuted(&self) -> Self {
        let mut other = self.clone();
        for column in [&mut other.counts, &mut other.kpa] {
            let third = column.len() / 3;
            column.reverse();
            column.rotate_left(third);
        }
        other
    }

    /// Every sample `times` times.
    #[must_use]
    pub fn repeated(&self, times: usize) -> Self {
        Self::new((0..times).flat_map(|_| self.pairs()))
    }

    /// The samples.
    pub fn pairs(&self) -> impl Iterator<Item = (f64, f64)> {
        self.counts.iter().copied().zip(self.kpa.iter().copied())
    }

    /// With other pressures.
    #[must_use]
    pub fn with_kpa(&self, change: impl Fn(f64) -> f64) -> Self {
        Self { counts: self.counts.clone(), kpa: self.kpa.iter().map(|p| change(*p)).collect() }
    }

    /// With other counts.
    #[must_use]
    pub fn with_counts(&self, change: impl Fn(f64) -> f64) -> Self {
        Self { counts: self.counts.iter().map(|c| change(*c)).collect(), kpa: self.kpa.clone() }
    }
}

/// Numbers that are the same in every run.
#[must_use]
pub fn random(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// A standard normal number, to 6 standard deviations: a sum of twelve uniform ones.
pub fn normal(random: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| random.random_range(0.0..1.0)).sum::<f64>() - 6.0
}

/// A dielectric that stiffens: C = rest - gain P / (P + half) + noise, rounded and clipped to the converter's range.
#[derive(Clone, Copy, Debug)]
pub struct Taxel {
    /// Counts without pressure.
    pub rest: f64,
    /// Counts that an infinite pressure would take away.
    pub gain: f64,
    /// Pressure that takes away half of them, kPa.
    pub half: f64,
    /// Standard deviation of a reading, counts.
    pub noise: f64,
    /// Width of the converter.
    pub bits: u32,
}

/// A sound 8-bit taxel with a swing of 70 counts.
pub const NOMINAL: Taxel = Taxel { rest: 240.0, gain: 110.0, half: 40.0, noise: 0.7, bits: 8 };

impl Taxel {
    /// A ramp from 0 to 70 kPa.
    #[must_use]
    pub fn ramp(&self, samples: usize, seed: u64) -> Recording {
        let mut random = random(seed);
        Recording::new((0..samples).map(|k| {
            let kpa = 70.0 * k as f64 / samples as f64 + 0.05 * random.random_range(0.0..1.0);
            (self.read(kpa, &mut random), kpa)
        }))
    }

    /// One reading.
    pub fn read(&self, kpa: f64, random: &mut ChaCha8Rng) -> f64 {
        let count = self.rest - self.gain * kpa / (kpa + self.half) + self.noise * normal(random);
        count.round().clamp(0.0, self.top())
    }

    fn top(&self) -> f64 {
        f64::from((1_u32 << self.bits) - 1)
    }
}

/// A taxel of a wide converter: 90 % of full scale at rest, noise of half a percent of the gain.
#[must_use]
pub fn wide(bits: u32, gain: f64) -> Taxel {
    let rest = f64::from((1_u32 << bits) - 1) * 0.9;
    Taxel { rest, gain, half: 40.0, noise: gain / 200.0, bits }
}
