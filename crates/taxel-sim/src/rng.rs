//! Random numbers that depend on the seed alone.
//!
//! Every part of the world draws from its own stream of one ChaCha8 key. So a fault in one board, or a command at
//! another time, never shifts the noise of its neighbours.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};
use std::f64::consts::TAU;

/// Who draws; the number of a part that comes several times is the second half of the stream's name.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Stream {
    /// Properties of the dielectric over the whole skin.
    Fabric,
    /// Thermal phase.
    Temperature,
    /// Clock and phase of a board.
    BoardClock(usize),
    /// Noise of a board's conversions.
    Conversion(usize),
    /// Residue of a board's tares.
    Tare(usize),
    /// Faults of a board.
    BoardFault(usize),
    /// Noise of the gauge.
    Gauge,
    /// Stuff bits and hand-over gaps on the bus.
    Bus,
    /// Frames that the receiver loses.
    Loss,
    /// Frames that the receiver gets twice.
    Duplicates,
    /// Frames that the receiver gets too late.
    Swaps,
    /// Faults of a taxel.
    TaxelFault(usize),
    /// Faults of the gauge.
    GaugeFault,
    /// Phase of a foreign node with a board's identifiers.
    Foreign(usize),
    /// Wrinkles of the bag.
    Wrinkles,
    /// What the gains change to on another day.
    Day(usize),
}

impl Stream {
    fn number(self) -> u64 {
        let (part, index) = match self {
            Self::Fabric => (1, 0),
            Self::Temperature => (2, 0),
            Self::BoardClock(n) => (3, n),
            Self::Conversion(n) => (4, n),
            Self::Tare(n) => (5, n),
            Self::BoardFault(n) => (6, n),
            Self::Gauge => (7, 0),
            Self::Bus => (8, 0),
            Self::Loss => (9, 0),
            Self::Duplicates => (10, 0),
            Self::Swaps => (11, 0),
            Self::TaxelFault(n) => (12, n),
            Self::GaugeFault => (13, 0),
            Self::Foreign(n) => (14, n),
            Self::Wrinkles => (15, 0),
            Self::Day(n) => (16, n),
        };
        (part << 32) | index as u64
    }
}

/// A stream of random numbers.
#[derive(Clone, Debug)]
pub(crate) struct Rng {
    source: ChaCha8Rng,
    /// Box and Muller's method makes two normal numbers at a time.
    spare: Option<f64>,
}

impl Rng {
    pub(crate) fn new(seed: u64, stream: Stream) -> Self {
        let mut source = ChaCha8Rng::seed_from_u64(seed);
        source.set_stream(stream.number());
        Self { source, spare: None }
    }

    /// Uniform in [0, 1), 53 bits.
    pub(crate) fn uniform(&mut self) -> f64 {
        (self.source.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
    }

    /// Uniform in [low, high).
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Uniform in 0..n; n must not be 0. The bias of the product method is below n / 2^53.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        ((self.uniform() * n as f64) as usize).min(n.saturating_sub(1))
    }

    /// True with the given probability.
    pub(crate) fn chance(&mut self, probability: f64) -> bool {
        self.uniform() < probability
    }

    /// Standard normal (Box and Muller 1958).
    pub(crate) fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        let (sine, cosine) = (TAU * self.uniform()).sin_cos();
        self.spare = Some(radius * sine);
        radius * cosine
    }

    /// Normal, redrawn until it lies within `limit` standard deviations: no part leaves the factory beyond that.
    pub(crate) fn truncated_normal(&mut self, limit: f64) -> f64 {
        loop {
            let draw = self.normal();
            if draw.abs() <= limit {
                return draw;
            }
        }
    }

    /// Log-normal about `median`, truncated at 2.5 logarithmic standard deviations.
    pub(crate) fn log_normal(&mut self, median: f64, log_sd: f64) -> f64 {
        median * (log_sd * self.truncated_normal(2.5)).exp()
    }
}
