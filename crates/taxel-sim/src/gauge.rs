//! The pressure sensor on the bus: a reading with its errors, in a frame of its own.

use crate::rng::{Rng, Stream};
use std::time::Duration;
use taxel_skin::{Kilopascal, Time};
use taxel_wire::signal::{ByteOrder, PressureMeaning, PressureUnit, SignalSpec};
use taxel_wire::{CanId, Frame};

/// The gauge and its errors.
#[derive(Clone, Debug, PartialEq)]
pub struct GaugeConfig {
    /// How it puts the pressure in a frame.
    pub signal: SignalSpec,
    /// Time between readings.
    pub period: Duration,
    /// Standard deviation of a reading in kPa.
    pub noise_kpa: f64,
    /// What it shows at zero, in kPa.
    pub offset_kpa: f64,
    /// Relative error of its gain.
    pub gain_error: f64,
    /// Time constant with which it follows the pressure, in seconds; 0 is at once.
    pub lag_s: f64,
}

impl Default for GaugeConfig {
    fn default() -> Self {
        Self {
            signal: SignalSpec {
                id: CanId::Standard(0x3A1),
                start_bit: 0,
                length_bits: 32,
                byte_order: ByteOrder::Little,
                signed: true,
                scale: 1.0,
                offset: 0.0,
                unit: PressureUnit::Pascal,
                meaning: PressureMeaning::Differential,
            },
            period: Duration::from_millis(10),
            noise_kpa: 0.01,
            offset_kpa: 0.01,
            gain_error: 0.001,
            lag_s: 0.0,
        }
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Gauge {
    config: GaugeConfig,
    rng: Rng,
    last: Option<Frame>,
    /// The pressure as far as it has followed it, kPa.
    followed_kpa: f64,
    /// When it reads next.
    pub(crate) next: Time,
    pub(crate) silent: bool,
    pub(crate) stuck: bool,
    /// By how much it reads too much, in kPa.
    pub(crate) jump_kpa: f64,
    /// Chance that a reading is far off, and how far in kPa.
    pub(crate) spikes: Option<(f64, f64)>,
    spike_rng: Rng,
}

impl Gauge {
    pub(crate) fn new(config: GaugeConfig, seed: u64, start: Time) -> Self {
        let mut rng = Rng::new(seed, Stream::Gauge);
        let next = start + config.period.mul_f64(rng.uniform());
        let spike_rng = Rng::new(seed, Stream::GaugeFault);
        Self {
            config,
            rng,
            last: None,
            followed_kpa: 0.0,
            next,
            silent: false,
            stuck: false,
            jump_kpa: 0.0,
            spikes: None,
            spike_rng,
        }
    }

    pub(crate) fn reseed(&mut self, seed: u64) {
        (self.rng, self.spike_rng) = (Rng::new(seed, Stream::Gauge), Rng::new(seed, Stream::GaugeFault));
    }

    /// Reads now and plans the next reading. `None` when silent, or when the signal cannot hold the value: a transmitter
    /// out of its range keeps quiet.
    pub(crate) fn read(&mut self, pressure_kpa: f64) -> Option<Frame> {
        self.next = self.next + self.config.period;
        // Drawn in any case, so that a fault shifts no later noise.
        let noise = self.config.noise_kpa * self.rng.normal();
        let spike = match self.spikes {
            Some((probability, kpa)) if self.spike_rng.chance(probability) => kpa,
            _ => 0.0,
        };
        let wrong = self.jump_kpa + spike;
        let step = if self.config.lag_s > 0.0 {
            -(-self.config.period.as_secs_f64() / self.config.lag_s).exp_m1()
        } else {
            1.0
        };
        self.followed_kpa += (pressure_kpa - self.followed_kpa) * step;
        let shown = self.followed_kpa * (1.0 + self.config.gain_error) + self.config.offset_kpa + noise + wrong;
        if !self.stuck || self.last.is_none() {
            self.last = self.config.signal.encode(Kilopascal(shown)).ok();
        }
        if self.silent { None } else { self.last }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_scatter_about_the_truth_with_the_stated_errors() {
        let config = GaugeConfig { offset_kpa: 0.2, gain_error: 0.01, noise_kpa: 0.05, ..GaugeConfig::default() };
        let mut gauge = Gauge::new(config.clone(), 5, Time::default());
        let readings: Vec<f64> =
            (0..4000).map(|_| config.signal.decode(&gauge.read(50.0).unwrap()).unwrap().0).collect();
        let mean = readings.iter().sum::<f64>() / 4000.0;
        let sd = (readings.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 4000.0).sqrt();
        assert!((mean - 50.7).abs() < 0.005, "{mean}");
        assert!((sd - 0.05).abs() < 0.003, "{sd}");
    }
}
