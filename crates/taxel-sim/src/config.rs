//! What a world is made of.

use crate::bag::BagConfig;
use crate::board::BoardsConfig;
use crate::dielectric::DielectricConfig;
use crate::gauge::GaugeConfig;
use crate::path::LoadPath;
use crate::thermal::ThermalConfig;
use std::time::Duration;
use taxel_skin::Time;
use taxel_wire::signal::SignalError;
use thiserror::Error;

/// Everything about a simulated installation but the shape of its skin. The same seed makes the same world.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// The seed of all randomness.
    pub seed: u64,
    /// The run's time at which the world begins.
    pub start: Time,
    /// The capacitors.
    pub dielectric: DielectricConfig,
    /// Bag, pump and valve.
    pub bag: BagConfig,
    /// The pressure sensor.
    pub gauge: GaugeConfig,
    /// The skin boards.
    pub boards: BoardsConfig,
    /// The course of temperature.
    pub thermal: ThermalConfig,
    /// How loads reach the taxels.
    pub loads: LoadPath,
}

/// A world that cannot be.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ConfigError {
    /// A number outside its range.
    #[error("{name} is {value}, expected a finite number of at least {least} and at most {most}")]
    Number {
        /// The field.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The least that makes sense.
        least: f64,
        /// The most that makes sense.
        most: f64,
    },
    /// The gauge's period must let the bus breathe.
    #[error("gauge.period is {0:?}, expected at least 1 ms")]
    GaugePeriod(Duration),
    /// The gauge's signal cannot be put into a frame.
    #[error("gauge.signal: {0}")]
    Signal(#[from] SignalError),
}

impl Config {
    /// The default world of this seed.
    #[must_use]
    pub fn seeded(seed: u64) -> Self {
        Self { seed, ..Self::default() }
    }

    /// # Errors
    /// [`ConfigError`] for the first field that cannot be.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let (d, b, t) = (&self.dielectric, &self.bag, &self.thermal);
        let (tiny, huge) = (1e-3, 1e6);
        let positive = [
            ("dielectric.modulus_kpa", d.modulus_kpa),
            ("dielectric.stiffening_kpa", d.stiffening_kpa),
            ("dielectric.gain_lsb", d.gain_lsb),
            ("dielectric.insensitive_stiffness[0]", d.insensitive_stiffness[0]),
            ("dielectric.insensitive_stiffness[1]", d.insensitive_stiffness[1]),
            ("dielectric.friction_reach_kpa", d.friction_reach_kpa),
            ("dielectric.creep_s", d.creep_s),
            ("dielectric.more_creep[0].time_s", d.more_creep[0].1),
            ("dielectric.more_creep[1].time_s", d.more_creep[1].1),
            ("dielectric.more_creep[2].time_s", d.more_creep[2].1),
            ("bag.ambient_kpa", b.ambient_kpa),
            ("bag.leak_s", b.leak_s),
            ("bag.vent_s", b.vent_s),
            ("bag.pump_limit_kpa", b.pump_limit_kpa),
            ("thermal.warm_up_s", t.warm_up_s),
            ("thermal.period_s", t.period_s),
        ];
        let not_negative = [
            ("dielectric.modulus_log_sd", d.modulus_log_sd),
            ("dielectric.gain_log_sd", d.gain_log_sd),
            ("dielectric.noise_counts[0]", d.noise_counts[0]),
            ("dielectric.noise_counts[1]", d.noise_counts[1]),
            ("dielectric.pad_noise_counts", d.pad_noise_counts),
            ("dielectric.tare_bias_counts", d.tare_bias_counts),
            ("dielectric.tare_residue_counts", d.tare_residue_counts),
            ("bag.pump_kpa_per_s", b.pump_kpa_per_s),
            ("bag.controller_per_s", b.controller_per_s),
            ("gauge.noise_kpa", self.gauge.noise_kpa),
            ("gauge.lag_s", self.gauge.lag_s),
        ];
        let shares = [
            ("dielectric.insensitive_share", d.insensitive_share),
            ("dielectric.friction[0]", d.friction[0]),
            ("dielectric.friction[1]", d.friction[1]),
            ("dielectric.creep_share", d.creep_share),
            ("dielectric.more_creep[0].share", d.more_creep[0].0),
            ("dielectric.more_creep[1].share", d.more_creep[1].0),
            ("dielectric.more_creep[2].share", d.more_creep[2].0),
            ("dielectric.day_gain_sd[0]", d.day_gain_sd[0]),
            ("dielectric.day_gain_sd[1]", d.day_gain_sd[1]),
            ("bag.wrinkle_sd", b.wrinkle_sd),
        ];
        let signed = [
            ("dielectric.thermal_counts_per_k", d.thermal_counts_per_k),
            ("dielectric.thermal_relative_sd", d.thermal_relative_sd),
            ("dielectric.thermal_gradient", d.thermal_gradient),
            ("gauge.offset_kpa", self.gauge.offset_kpa),
            ("gauge.gain_error", self.gauge.gain_error),
            ("thermal.start_celsius", t.start_celsius),
            ("thermal.warm_up_k", t.warm_up_k),
            ("thermal.swing_k", t.swing_k),
        ];
        let exponents = [("dielectric.exponent[0]", d.exponent[0]), ("dielectric.exponent[1]", d.exponent[1])];
        within(&positive, tiny, huge)?;
        within(&not_negative, 0.0, huge)?;
        within(&shares, 0.0, 0.5)?;
        within(&signed, -huge, huge)?;
        within(&exponents, 1.01, 10.0)?;
        validate_loads(self.loads)?;
        within(&[("boards.clock_ppm", self.boards.clock_ppm)], 0.0, 10_000.0)?;
        if self.gauge.period < Duration::from_millis(1) {
            return Err(ConfigError::GaugePeriod(self.gauge.period));
        }
        Ok(self.gauge.signal.validate()?)
    }
}

fn validate_loads(path: LoadPath) -> Result<(), ConfigError> {
    let LoadPath::Layer(layer) = path else { return Ok(()) };
    let millimetres = [("loads.depth_mm", layer.depth_mm), ("loads.pad_radius_mm", layer.pad_radius_mm)];
    within(&millimetres, 0.1, 4.0)?;
    within(&[("loads.crosstalk", layer.crosstalk)], 0.0, 0.5)
}

fn within(fields: &[(&'static str, f64)], least: f64, most: f64) -> Result<(), ConfigError> {
    let outside = fields.iter().find(|(_, value)| !(least..=most).contains(value));
    outside.map_or(Ok(()), |&(name, value)| Err(ConfigError::Number { name, value, least, most }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_valid_and_nonsense_is_named() {
        assert_eq!(Config::seeded(1).validate(), Ok(()));
        let mut config = Config::default();
        config.bag.leak_s = f64::NAN;
        assert!(matches!(config.validate(), Err(ConfigError::Number { name: "bag.leak_s", .. })));
        config = Config::default();
        config.gauge.period = Duration::ZERO;
        assert!(matches!(config.validate(), Err(ConfigError::GaugePeriod(_))));
        config = Config::default();
        config.gauge.signal.length_bits = 65;
        assert!(matches!(config.validate(), Err(ConfigError::Signal(_))));
    }
}
