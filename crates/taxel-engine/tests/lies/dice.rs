//! The randomness of a story: it depends on the seed alone.

use std::time::Duration;

/// SplitMix64 (Steele, Lea and Flood 2014).
#[derive(Clone, Debug)]
pub struct Dice {
    state: u64,
}

impl Dice {
    pub fn new(seed: u64) -> Self {
        Self { state: seed }
    }

    /// Dice of their own for one part of a story, so that no part shifts another.
    pub fn of(&self, part: u64) -> Self {
        let mut dice = Self { state: self.state ^ part.wrapping_mul(0xD6E8_FEB8_6659_FD93) };
        dice.bits();
        dice
    }

    pub fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn chance(&mut self, probability: f64) -> bool {
        self.uniform() < probability
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// As likely in each octave.
    pub fn octaves(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.uniform() * n as f64) as usize
    }

    pub fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())]
    }

    /// When something happens that comes so often in 1,000 hours, within a story of this length.
    pub fn arrivals(&mut self, per_1000_h: f64, length: Duration) -> Vec<Duration> {
        let mut next_s = || -self.uniform().max(1e-300).ln() * 3.6e6 / per_1000_h;
        let mut arrivals = Vec::new();
        let mut at_s = next_s();
        while at_s < length.as_secs_f64() {
            arrivals.push(Duration::from_secs_f64(at_s));
            at_s += next_s();
        }
        arrivals
    }

    /// A span of so many seconds, as likely in each octave.
    pub fn span(&mut self, low_s: f64, high_s: f64) -> Duration {
        Duration::from_secs_f64(self.octaves(low_s, high_s))
    }
}
