//! The slow course of temperature: electronics that warm up, a room that breathes.

use crate::rng::{Rng, Stream};
use std::f64::consts::TAU;

/// Temperature over time: warm-up (1 - exp(-t / warm-up time)) + swing sin(2 pi t / period + phase).
#[derive(Clone, Debug, PartialEq)]
pub struct ThermalConfig {
    /// Final rise by the boards' own heat, in kelvin.
    pub warm_up_k: f64,
    /// Time constant of the warm-up in seconds.
    pub warm_up_s: f64,
    /// Half the range of the room's slow swing, in kelvin.
    pub swing_k: f64,
    /// Period of that swing in seconds; its phase comes from the seed.
    pub period_s: f64,
}

impl Default for ThermalConfig {
    fn default() -> Self {
        Self { warm_up_k: 1.0, warm_up_s: 900.0, swing_k: 0.4, period_s: 1200.0 }
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Temperature {
    config: ThermalConfig,
    phase: f64,
    warmings: Vec<Warming>,
}

/// A linear change on top of the course.
#[derive(Clone, Copy, Debug)]
struct Warming {
    kelvin: f64,
    /// In seconds after the start.
    begin_s: f64,
    over_s: f64,
}

impl Warming {
    fn rise_k(&self, seconds: f64) -> f64 {
        let passed_s = seconds - self.begin_s;
        if passed_s >= self.over_s { self.kelvin } else { self.kelvin * (passed_s / self.over_s).max(0.0) }
    }
}

impl Temperature {
    pub(crate) fn new(config: ThermalConfig, seed: u64) -> Self {
        Self { config, phase: TAU * Rng::new(seed, Stream::Temperature).uniform(), warmings: Vec::new() }
    }

    /// From `begin_s` after the start on it becomes warmer by so many kelvin within `over_s`.
    pub(crate) fn warm(&mut self, kelvin: f64, begin_s: f64, over_s: f64) {
        self.warmings.push(Warming { kelvin, begin_s, over_s });
    }

    /// Kelvin above the start, `seconds` after it.
    pub(crate) fn rise_k(&self, seconds: f64) -> f64 {
        let warm_up = self.config.warm_up_k * -(-seconds / self.config.warm_up_s).exp_m1();
        let swing = (TAU * seconds / self.config.period_s + self.phase).sin() - self.phase.sin();
        let warmings: f64 = self.warmings.iter().map(|warming| warming.rise_k(seconds)).sum();
        warm_up + self.config.swing_k * swing + warmings
    }
}
