//! A skin in a vacuum bag, without hardware: physics, boards, pump, gauge and masses that speak the real frames.
//!
//! No I/O, no clock: [`World::advance`] takes time as data and gives back frames. The same seed and the same commands
//! at the same times give the same bytes, however time is cut.
//!
//! The physics is independent of anything that a calibration fits: springs that stiffen by a power law under plates of
//! a capacitor, friction and creep, drift of temperature, converters that round and clip. What is true (pressures,
//! forces) can be asked for, so that a calibration can be judged.

mod bag;
mod board;
mod bus;
mod config;
mod converter;
mod dielectric;
mod effects;
mod faults;
mod foreign;
mod gauge;
mod load;
mod loads;
mod path;
mod receiver;
mod rng;
mod skin;
mod thermal;
mod world;

pub use bag::{BagConfig, PumpCommand};
pub use board::{BoardsConfig, CONVERSION, HOST_BOARD_CONFIG, bring_up};
pub use config::Config;
pub use dielectric::{DielectricConfig, MORE_CREEP};
pub use effects::Effect;
pub use faults::{Fault, FaultError, ForeignScan};
pub use gauge::GaugeConfig;
pub use load::{Footprint, LoadError, Mass, Profile, STANDARD_GRAVITY};
pub use loads::LoadId;
pub use path::{Layer, LoadPath};
pub use skin::{Pose, Skin};
pub use thermal::ThermalConfig;
pub use world::World;
