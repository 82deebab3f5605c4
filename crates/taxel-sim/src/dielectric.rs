//! The capacitor under every taxel: a soft dielectric between two plates, and what a converter makes of it.
//!
//! Nothing here is a polynomial, a play operator or anything else that a calibration fits:
//! - spring: the tangent modulus grows as a power of the pressure, K(P) = K0 (1 + P / Pr)^n, the law of granular and
//!   fibrous media (Janbu 1963). Integrated from rest, the strain is
//!   s(P) = Pr / (K0 (n - 1)) (1 - (1 + P / Pr)^(1 - n));
//! - capacitor: C = eps A / l with l = l0 (1 - s), so C - C0 = C0 s / (1 - s);
//! - friction in the fabric grows with the load: the spring feels P (1 - mu z), where z in [-1, 1] follows the sense of
//!   motion over a reach Pc, dz = (sign(dP) - z) |dP| / Pc (Dahl 1968). Solved exactly over each monotone step, so the
//!   loop does not depend on how time is cut;
//! - creep: small shares of the strain follow with time constants of their own (standard linear solids in a row).

use crate::rng::Rng;

/// Least significant bits of the converter in one count at the boards' default shift of 2.
pub(crate) const LSB_PER_COUNT: f64 = 4.0;

/// Time constants of the creep beside the first one.
pub const MORE_CREEP: usize = 3;

/// How the dielectrics of a skin are spread. The defaults give, over the forearm, counts whose standard deviation over
/// the taxels is about 5.9 at rest and 25.6 at 70 kPa (Kangro et al. 2016), at a mean swing of about 88 counts.
#[derive(Clone, Debug, PartialEq)]
pub struct DielectricConfig {
    /// Median tangent modulus at rest, K0, in kPa.
    pub modulus_kpa: f64,
    /// Logarithmic standard deviation of K0 over the taxels.
    pub modulus_log_sd: f64,
    /// Pressure scale of the stiffening, Pr, in kPa.
    pub stiffening_kpa: f64,
    /// Stiffening exponent n, uniform between these; above 1.
    pub exponent: [f64; 2],
    /// Median capacitance at rest, C0, in converter bits.
    pub gain_lsb: f64,
    /// Logarithmic standard deviation of C0.
    pub gain_log_sd: f64,
    /// Share of taxels with next to no response, 0 to 1.
    pub insensitive_share: f64,
    /// How many times stiffer those are, log-uniform between these.
    pub insensitive_stiffness: [f64; 2],
    /// Friction mu, uniform between these; the loop is 2 mu P wide.
    pub friction: [f64; 2],
    /// Reach Pc in kPa over which the friction turns round.
    pub friction_reach_kpa: f64,
    /// Share of the strain that creeps; 0 switches creep off.
    pub creep_share: f64,
    /// Time constant of the creep in seconds.
    pub creep_s: f64,
    /// More shares that creep, each with its time constant in seconds.
    pub more_creep: [(f64, f64); MORE_CREEP],
    /// Noise of a taxel in counts, before rounding, uniform between these.
    pub noise_counts: [f64; 2],
    /// Noise that the taxels of a module share in each conversion, in counts; 0.27 doubles the variance of the sum of ten.
    pub common_noise_counts: f64,
    /// Noise of a thermal pad in counts.
    pub pad_noise_counts: f64,
    /// Thermal coefficient in counts per kelvin, of taxels and pads alike.
    pub thermal_counts_per_k: f64,
    /// Relative standard deviation of the thermal coefficient.
    pub thermal_relative_sd: f64,
    /// Relative change of the thermal coefficient from the first to the last taxel: one end of the limb is warmed more than
    /// the other.
    pub thermal_gradient: f64,
    /// Relative standard deviation of what the gain of the whole skin changes from one day to another, and of what that of a
    /// single taxel does; see [`crate::World::next_day`].
    pub day_gain_sd: [f64; 2],
    /// Residue of a tare that a taxel shows every time, standard deviation in counts.
    pub tare_bias_counts: f64,
    /// Residue of a tare that is new every time, standard deviation in counts.
    pub tare_residue_counts: f64,
}

impl Default for DielectricConfig {
    fn default() -> Self {
        Self {
            modulus_kpa: 90.0,
            modulus_log_sd: 0.085,
            stiffening_kpa: 60.0,
            exponent: [1.8, 2.2],
            gain_lsb: 660.0,
            gain_log_sd: 0.07,
            insensitive_share: 0.05,
            insensitive_stiffness: [18.0, 80.0],
            friction: [0.015, 0.035],
            friction_reach_kpa: 7.0,
            creep_share: 0.01,
            creep_s: 15.0,
            more_creep: [(0.0, 1.0); MORE_CREEP],
            noise_counts: [0.7, 1.0],
            common_noise_counts: 0.0,
            pad_noise_counts: 0.4,
            thermal_counts_per_k: 1.0,
            thermal_relative_sd: 0.1,
            thermal_gradient: 0.0,
            day_gain_sd: [0.0; 2],
            tare_bias_counts: 5.9,
            tare_residue_counts: 2.0,
        }
    }
}

/// Friction and creep of the fabric, the same law for all.
#[derive(Clone, Copy, Debug)]
struct Memory {
    friction: f64,
    reach_kpa: f64,
    /// Shares of the strain, each with its time constant in seconds; the first `creeping` of them are not 0.
    creep: [(f64, f64); 1 + MORE_CREEP],
    creeping: usize,
}

/// One taxel's capacitor with its history.
#[derive(Clone, Debug)]
pub(crate) struct Dielectric {
    modulus_kpa: f64,
    stiffening_kpa: f64,
    exponent: f64,
    gain_lsb: f64,
    memory: Memory,
    /// Pressure of the last step in kPa.
    pressure_kpa: f64,
    /// Sense of motion that the friction remembers, -1 to 1.
    sense: f64,
    /// Strain of the spring at the last step.
    strain: f64,
    /// The parts of the strain that lag behind.
    crept: [f64; 1 + MORE_CREEP],
    /// Time between steps in seconds, and the share of its way that each part goes in it.
    creep_step: (f64, [f64; 1 + MORE_CREEP]),
}

impl Dielectric {
    /// The capacitance above rest, in converter bits, under `pressure_kpa`, `elapsed_s` after the last step.
    pub(crate) fn press(&mut self, pressure_kpa: f64, elapsed_s: f64) -> f64 {
        let memory = &self.memory;
        let step = pressure_kpa - self.pressure_kpa;
        // Most steps bring no change: the powers are worked out only for those that do.
        if step != 0.0 {
            let towards = step.signum();
            self.sense = towards + (self.sense - towards) * (-step.abs() / memory.reach_kpa).exp();
            self.pressure_kpa = pressure_kpa;
            self.strain = self.strain(pressure_kpa * (1.0 - self.memory.friction * self.sense));
        }
        if elapsed_s != self.creep_step.0 {
            self.creep_step = (elapsed_s, self.memory.creep.map(|(_, time_s)| -(-elapsed_s / time_s).exp_m1()));
        }
        let mut total = self.strain;
        let parts = self.memory.creep.iter().zip(&mut self.crept).zip(&self.creep_step.1);
        for (((share, _), crept), step) in parts.take(self.memory.creeping) {
            *crept += (self.strain - *crept) * step;
            total += share * (*crept - self.strain);
        }
        self.gain_lsb * total / (1.0 - total)
    }

    /// Strain of the spring. Kept below 0.95: the plates never meet. A suction lifts no plate.
    fn strain(&self, pressure_kpa: f64) -> f64 {
        let order = self.exponent - 1.0;
        let relative = pressure_kpa.max(0.0) / self.stiffening_kpa;
        let scale = self.stiffening_kpa / (self.modulus_kpa * order);
        (-scale * (-order * relative.ln_1p()).exp_m1()).min(0.95)
    }

    /// From now on it gives so many times as much.
    pub(crate) fn scale(&mut self, factor: f64) {
        self.gain_lsb *= factor;
    }
}

/// What one of a module's twelve values measures.
#[derive(Clone, Debug)]
pub(crate) enum Sense {
    /// Pressure on the taxel of this patch index.
    Taxel(usize, Box<Dielectric>),
    /// Temperature alone.
    Pad,
}

/// One input of a converter: a capacitor, its noise, its thermal coefficient and how badly it tares.
#[derive(Clone, Debug)]
pub(crate) struct Dot {
    pub(crate) sense: Sense,
    pub(crate) noise_lsb: f64,
    pub(crate) thermal_lsb_per_k: f64,
    pub(crate) tare_bias_lsb: f64,
}

impl Dot {
    /// The signal in converter bits, up to a constant that the tare removes.
    pub(crate) fn signal(&mut self, pressures_kpa: &[f64], temperature_k: f64, elapsed_s: f64) -> f64 {
        let pressed = match &mut self.sense {
            Sense::Taxel(index, dielectric) => dielectric.press(pressures_kpa[*index], elapsed_s),
            Sense::Pad => 0.0,
        };
        pressed + self.thermal_lsb_per_k * temperature_k
    }
}

/// Makes the capacitors of one skin.
pub(crate) struct Fabric<'a> {
    config: &'a DielectricConfig,
    rng: Rng,
    insensitive: Vec<bool>,
    creep: [(f64, f64); 1 + MORE_CREEP],
    /// Where the last taxel lies along the skin, -0.5 to 0.5.
    along: f64,
}

impl<'a> Fabric<'a> {
    /// Chooses the insensitive taxels: a fixed share of them, at random places.
    pub(crate) fn new(config: &'a DielectricConfig, taxels: usize, mut rng: Rng) -> Self {
        let mut insensitive = vec![false; taxels];
        let mut order: Vec<usize> = (0..taxels).collect();
        let share = (config.insensitive_share.clamp(0.0, 1.0) * taxels as f64).round() as usize;
        for n in 0..share.min(taxels) {
            order.swap(n, n + rng.below(taxels - n));
            insensitive[order[n]] = true;
        }
        let [second, third, fourth] = config.more_creep;
        let mut creep = [(config.creep_share, config.creep_s), second, third, fourth];
        creep.sort_by_key(|(share, _)| *share <= 0.0);
        Self { config, rng, insensitive, creep, along: -0.5 }
    }

    pub(crate) const fn tare_residue_counts(&self) -> f64 {
        self.config.tare_residue_counts
    }

    pub(crate) const fn common_noise_counts(&self) -> f64 {
        self.config.common_noise_counts
    }

    pub(crate) fn taxel(&mut self, index: usize) -> Dot {
        let (config, rng) = (self.config, &mut self.rng);
        let [stiff_low, stiff_high] = config.insensitive_stiffness;
        // Drawn for every taxel, so that the share of insensitive ones moves nothing else.
        let stiffer = (rng.between(stiff_low.ln(), stiff_high.ln())).exp();
        let factor = if self.insensitive[index] { stiffer } else { 1.0 };
        let dielectric = Dielectric {
            modulus_kpa: factor * rng.log_normal(config.modulus_kpa, config.modulus_log_sd),
            stiffening_kpa: config.stiffening_kpa,
            exponent: rng.between(config.exponent[0], config.exponent[1]),
            gain_lsb: rng.log_normal(config.gain_lsb, config.gain_log_sd),
            memory: Memory {
                friction: rng.between(config.friction[0], config.friction[1]),
                reach_kpa: config.friction_reach_kpa,
                creep: self.creep,
                creeping: self.creep.iter().filter(|(share, _)| *share > 0.0).count(),
            },
            pressure_kpa: 0.0,
            sense: 0.0,
            strain: 0.0,
            crept: [0.0; 1 + MORE_CREEP],
            creep_step: (0.0, [0.0; 1 + MORE_CREEP]),
        };
        self.along = index as f64 / self.insensitive.len() as f64 - 0.5;
        let noise_counts = rng.between(config.noise_counts[0], config.noise_counts[1]);
        self.dot(Sense::Taxel(index, Box::new(dielectric)), noise_counts, config.tare_bias_counts)
    }

    pub(crate) fn pad(&mut self) -> Dot {
        // A pad is a bare capacitor: nothing in it settles after a tare.
        self.dot(Sense::Pad, self.config.pad_noise_counts, 1.0)
    }

    fn dot(&mut self, sense: Sense, noise_counts: f64, tare_bias_counts: f64) -> Dot {
        let (config, rng) = (self.config, &mut self.rng);
        let thermal = config.thermal_counts_per_k * (1.0 + config.thermal_relative_sd * rng.truncated_normal(2.5));
        let thermal = thermal * (1.0 + config.thermal_gradient * self.along);
        Dot {
            sense,
            noise_lsb: noise_counts * LSB_PER_COUNT,
            thermal_lsb_per_k: thermal * LSB_PER_COUNT,
            tare_bias_lsb: tare_bias_counts * LSB_PER_COUNT * rng.truncated_normal(2.2),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Rng, Stream};
    use proptest::prelude::*;

    fn dielectric(seed: u64, config: &DielectricConfig) -> Dielectric {
        match Fabric::new(config, 1, Rng::new(seed, Stream::Fabric)).taxel(0).sense {
            Sense::Taxel(_, dielectric) => *dielectric,
            Sense::Pad => unreachable!(),
        }
    }

    proptest! {
        #[test]
        fn the_loop_does_not_depend_on_how_a_stroke_is_cut(seed in 0_u64..1000, cuts in 1_usize..200) {
            let config = DielectricConfig { creep_share: 0.0, ..DielectricConfig::default() };
            let (mut whole, mut cut) = (dielectric(seed, &config), dielectric(seed, &config));
            whole.press(70.0, 0.0);
            for n in 1..=cuts {
                cut.press(70.0 * n as f64 / cuts as f64, 0.0);
            }
            let (a, b) = (whole.press(30.0, 0.0), cut.press(30.0, 0.0));
            prop_assert!((a - b).abs() < 1e-9 * a.abs(), "{a} {b}");
        }

        #[test]
        fn falling_reads_more_than_rising_and_the_loop_closes_at_rest(seed in 0_u64..1000) {
            let config = DielectricConfig::default();
            let mut taxel = dielectric(seed, &config);
            let rising: Vec<f64> = (0..=70).map(|p| taxel.press(f64::from(p), 0.5)).collect();
            let falling: Vec<f64> = (0..=70).rev().map(|p| taxel.press(f64::from(p), 0.5)).collect();
            let widest = (5..60).map(|p| falling[70 - p] - rising[p]).fold(0.0, f64::max);
            prop_assert!((10..60).all(|p| falling[70 - p] > rising[p]));
            let span = rising[70] - rising[0];
            prop_assert!((0.01..0.08).contains(&(widest / span)), "{} of the span", widest / span);
            prop_assert!(falling[70].abs() < 0.01 * span, "creep leaves {} of {span}", falling[70]);
        }
    }
}
