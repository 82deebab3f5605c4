//! What a world is made of.

use crate::bag::BagConfig;
use crate::board::BoardsConfig;
use crate::dielectric::DielectricConfig;
use crate::gauge::GaugeConfig;
use crate::path::LoadPath;
use crate::thermal::ThermalConfig;
use taxel_skin::Time;

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

impl Config {
    /// The default world of this seed.
    #[must_use]
    pub fn seeded(seed: u64) -> Self {
        Self { seed, ..Self::default() }
    }
}
