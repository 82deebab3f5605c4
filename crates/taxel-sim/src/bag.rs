//! The vacuum bag: a pump that takes air out, a leak that lets it in, a valve that vents.
//!
//! The differential pressure P = ambient - bag obeys dP/dt = draw - P / leak, where the draw is what the pump removes.
//! A controller drives the pump so that P follows a ramp. Everything is stepped on a fixed grid of time, so the course
//! of the pressure does not depend on how the caller cuts time.

use taxel_skin::Kilopascal;

/// The bag, its pump and its valve.
#[derive(Clone, Debug, PartialEq)]
pub struct BagConfig {
    /// Ambient pressure in kPa, absolute.
    pub ambient_kpa: f64,
    /// Time constant of the leak in seconds.
    pub leak_s: f64,
    /// Time constant of venting through the open valve in seconds.
    pub vent_s: f64,
    /// Fastest fall of the bag pressure that the pump can make, in kPa/s, at no vacuum.
    pub pump_kpa_per_s: f64,
    /// The differential pressure at which the pump draws no more, in kPa.
    pub pump_limit_kpa: f64,
    /// Gain of the pump's controller in 1/s.
    pub controller_per_s: f64,
    /// Wrinkles and the tension of the foil: relative standard deviation of the pressure on a taxel from that of the bag.
    pub wrinkle_sd: f64,
}

impl Default for BagConfig {
    fn default() -> Self {
        Self {
            ambient_kpa: 101.325,
            leak_s: 400.0,
            vent_s: 0.8,
            pump_kpa_per_s: 20.0,
            pump_limit_kpa: 88.0,
            controller_per_s: 2.0,
            wrinkle_sd: 0.0,
        }
    }
}

/// What the pump is told.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum PumpCommand {
    /// Pump off, valve closed: the leak alone moves the pressure.
    #[default]
    Off,
    /// A linear ramp of the differential pressure to `target`, then held there. A target below the present pressure
    /// is reached by bleeding air in at the same rate.
    Ramp {
        /// Differential pressure at the end.
        target: Kilopascal,
        /// Rate in kPa/s; its sign is ignored.
        kpa_per_s: f64,
    },
    /// Pump off, valve open.
    Vent,
}

/// Step of the bag's grid in nanoseconds: far below every time constant of the pneumatics.
pub(crate) const STEP_NS: i64 = 5_000_000;
const STEP_S: f64 = STEP_NS as f64 * 1e-9;

/// The state of the bag at the last point of the grid.
#[derive(Clone, Debug)]
pub(crate) struct Bag {
    config: BagConfig,
    command: PumpCommand,
    pressure_kpa: f64,
    rate_kpa_per_s: f64,
    /// Where the ramp is now.
    reference_kpa: f64,
    /// Time constant of a leak that the bag was not made with, in seconds.
    pub(crate) fault_leak_s: Option<f64>,
}

impl Bag {
    pub(crate) fn new(config: BagConfig) -> Self {
        Self {
            config,
            command: PumpCommand::Off,
            pressure_kpa: 0.0,
            rate_kpa_per_s: 0.0,
            reference_kpa: 0.0,
            fault_leak_s: None,
        }
    }

    /// Takes effect at the next point of the grid.
    pub(crate) fn command(&mut self, command: PumpCommand) {
        self.command = command;
        self.reference_kpa = self.pressure_kpa;
    }

    /// One step of the grid.
    pub(crate) fn step(&mut self) {
        self.pressure_kpa = self.pressure_after(STEP_S);
        let leak = -self.pressure_kpa / self.fault_leak_s.unwrap_or(self.config.leak_s);
        self.rate_kpa_per_s = match self.command {
            PumpCommand::Off => leak,
            PumpCommand::Vent => -self.pressure_kpa / self.config.vent_s,
            PumpCommand::Ramp { target, kpa_per_s } => self.draw(target.0, kpa_per_s.abs()) + leak,
        };
    }

    /// Differential pressure in kPa, `elapsed_s` after the last point of the grid.
    pub(crate) fn pressure_after(&self, elapsed_s: f64) -> f64 {
        (self.pressure_kpa + self.rate_kpa_per_s * elapsed_s).clamp(0.0, self.config.ambient_kpa)
    }

    /// What pump and bleed valve do to follow the ramp, in kPa/s.
    fn draw(&mut self, target_kpa: f64, kpa_per_s: f64) -> f64 {
        let wanted = (target_kpa - self.reference_kpa).clamp(-kpa_per_s * STEP_S, kpa_per_s * STEP_S);
        self.reference_kpa += wanted;
        let error = self.reference_kpa - self.pressure_kpa;
        let capacity = self.config.pump_kpa_per_s * (1.0 - self.pressure_kpa / self.config.pump_limit_kpa);
        let bleed = self.pressure_kpa / self.config.vent_s;
        (wanted / STEP_S + self.config.controller_per_s * error).clamp(-bleed, capacity.max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(bag: &mut Bag, seconds: f64) -> f64 {
        for _ in 0..(seconds / STEP_S).round() as usize {
            bag.step();
        }
        bag.pressure_after(0.0)
    }

    fn ramp(target: f64, kpa_per_s: f64) -> PumpCommand {
        PumpCommand::Ramp { target: Kilopascal(target), kpa_per_s }
    }

    #[test]
    fn a_bag_left_alone_leaks_and_a_vent_empties_it() {
        let mut bag = Bag::new(BagConfig::default());
        bag.command(ramp(60.0, 10.0));
        let full = run(&mut bag, 10.0);
        bag.command(PumpCommand::Off);
        let leaked = run(&mut bag, 40.0);
        assert!((leaked / full - (-0.1_f64).exp()).abs() < 0.001, "{full} -> {leaked}");
        bag.command(PumpCommand::Vent);
        assert!(run(&mut bag, 10.0) < 0.001);
    }
}
