//! A module's capacitance converter and the firmware's arithmetic on it.
//!
//! sent = noLoad - ((cdc - offset - drift) >> shift), clipped at 255 ("too low") and 0 ("too high"): the wire value goes
//! down with pressure. drift = ((|change of the pad| >> 2) * gain) >> 5 with the sign of the change, so that a gain of
//! 128 would cancel the pad's drift entirely.

use crate::dielectric::{Dot, LSB_PER_COUNT, Sense};
use crate::rng::Rng;
use taxel_skin::VALUES_PER_MODULE;

/// Value whose pad is the firmware's drift reference on a triangle.
const REFERENCE_SLOT: usize = 6;
/// A converter that does not answer at all reads all ones.
const NOT_CONNECTED: u16 = 0xFFFF;

/// What surrounds the skin at a conversion.
pub(crate) struct Surroundings<'a> {
    /// Pressure on every taxel of the patch, in kPa.
    pub(crate) pressures_kpa: &'a [f64],
    /// Temperature above that of the mounting, in kelvin.
    pub(crate) temperature_k: f64,
    /// Time since the last conversion, in seconds.
    pub(crate) elapsed_s: f64,
}

/// A module whose readings jump now and then, all at once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Flicker {
    pub(crate) probability: f64,
    pub(crate) depth_counts: f64,
}

/// What ails a module; all of it reaches the host only through the frames.
#[derive(Clone, Debug, Default)]
pub(crate) struct Ailments {
    pub(crate) silent: bool,
    pub(crate) unplugged: bool,
    pub(crate) no_ack: bool,
    pub(crate) flicker: Option<Flicker>,
    pub(crate) taxels: [Option<Box<TaxelAilment>>; VALUES_PER_MODULE],
}

/// What ails a single taxel.
#[derive(Clone, Debug)]
pub(crate) enum TaxelAilment {
    /// It keeps its last reading.
    Frozen,
    /// It sends always the same value.
    Stuck(u8),
    /// It has more noise than it was made with.
    Noisy {
        /// Standard deviation in converter bits.
        sd_lsb: f64,
        /// Where the noise comes from.
        rng: Rng,
    },
    /// It reads the upper rail now and then.
    Flicker {
        /// Chance at each conversion.
        probability: f64,
        /// Whether it does at present.
        on: bool,
        /// What decides.
        rng: Rng,
    },
}

impl TaxelAilment {
    /// What goes out instead of the reading.
    const fn sends(&self) -> Option<u8> {
        match self {
            Self::Stuck(value) => Some(*value),
            Self::Flicker { on: true, .. } => Some(255),
            _ => None,
        }
    }
}

/// How the firmware turns a reading into the byte it sends.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Arithmetic {
    pub(crate) no_load: u8,
    pub(crate) shift: u8,
    pub(crate) cdc_offset: u16,
    /// Drift compensation in 128ths.
    pub(crate) drift_gain: i32,
}

/// Twelve bytes and the status word that goes with them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Reading {
    pub(crate) values: [u8; VALUES_PER_MODULE],
    pub(crate) status: u16,
}

impl Reading {
    /// The firmware read a dot as exactly 0.
    pub(crate) const fn no_ack(&self) -> bool {
        self.status & 1 != 0
    }
}

/// One module position of a board. Without dots nothing is plugged in there.
#[derive(Clone, Debug)]
pub(crate) struct Converter {
    pub(crate) dots: Vec<Dot>,
    pub(crate) ailments: Ailments,
    has_reference: bool,
    common_noise_lsb: f64,
    zero_lsb: [f64; VALUES_PER_MODULE],
    cdc: [u16; VALUES_PER_MODULE],
    reference: i32,
}

impl Converter {
    /// A converter with all twelve dots, or with none.
    pub(crate) fn new(dots: Vec<Dot>, has_reference: bool) -> Self {
        Self {
            dots,
            ailments: Ailments::default(),
            has_reference,
            common_noise_lsb: 0.0,
            zero_lsb: [0.0; VALUES_PER_MODULE],
            cdc: [NOT_CONNECTED; VALUES_PER_MODULE],
            reference: 0,
        }
    }

    /// With noise that all its taxels share.
    pub(crate) fn with_common_noise(self, lsb: f64) -> Self {
        Self { common_noise_lsb: lsb, ..self }
    }

    /// Converts all dots once. With `tare`, the present signal becomes the new zero, but for a residue.
    pub(crate) fn convert(
        &mut self,
        around: &Surroundings<'_>,
        cdc_offset: u16,
        noise: &mut Rng,
        faults: &mut Rng,
        tare: Option<(&mut Rng, f64)>,
    ) {
        let offset = f64::from(cdc_offset);
        let mut signal = [0.0; VALUES_PER_MODULE];
        // Not drawn where there is none: the noise of a dot is the same without it.
        let common = if self.common_noise_lsb > 0.0 { self.common_noise_lsb * noise.normal() } else { 0.0 };
        for (signal, dot) in signal.iter_mut().zip(&mut self.dots) {
            *signal = dot.signal(around.pressures_kpa, around.temperature_k, around.elapsed_s);
            let shared = if matches!(dot.sense, Sense::Pad) { 0.0 } else { common };
            *signal += dot.noise_lsb * noise.normal() + shared;
        }
        let tared = tare.is_some();
        if let Some((residues, residue_lsb)) = tare {
            for (slot, dot) in self.dots.iter().enumerate() {
                let residue = dot.tare_bias_lsb + residue_lsb * residues.truncated_normal(2.2);
                self.zero_lsb[slot] = signal[slot] - residue;
            }
        }
        let jump = match self.ailments.flicker {
            Some(flicker) if faults.chance(flicker.probability) => flicker.depth_counts * LSB_PER_COUNT,
            _ => 0.0,
        };
        for (slot, dot) in self.dots.iter().enumerate() {
            // A jump of the pad too would be compensated away by the firmware.
            let jump = if matches!(dot.sense, Sense::Pad) { 0.0 } else { jump };
            let extra = match self.ailments.taxels[slot].as_deref_mut() {
                Some(TaxelAilment::Frozen) => continue,
                Some(TaxelAilment::Noisy { sd_lsb, rng }) => *sd_lsb * rng.normal(),
                Some(TaxelAilment::Flicker { probability, on, rng }) => {
                    *on = rng.chance(*probability);
                    0.0
                }
                Some(TaxelAilment::Stuck(_)) | None => 0.0,
            };
            // The converter saturates at both ends; the cast does too.
            self.cdc[slot] = (offset + signal[slot] - self.zero_lsb[slot] + jump + extra).round() as u16;
        }
        if tared && self.has_reference {
            self.reference = i32::from(self.cdc[REFERENCE_SLOT]);
        }
    }

    /// What the firmware would send now.
    pub(crate) fn reading(&self, arithmetic: Arithmetic) -> Reading {
        let unplugged = self.ailments.unplugged || self.dots.is_empty();
        let raw = |slot: usize| match (unplugged, self.ailments.no_ack) {
            (true, _) => NOT_CONNECTED,
            (false, true) => 0,
            (false, false) => self.cdc[slot],
        };
        let offset = i32::from(arithmetic.cdc_offset);
        let no_load = i32::from(arithmetic.no_load);
        let change = if self.has_reference { i32::from(raw(REFERENCE_SLOT)) - self.reference } else { 0 };
        let drift = change.signum() * (((change.abs() >> 2) * arithmetic.drift_gain) >> 5);
        let mut reading = Reading { values: [0; VALUES_PER_MODULE], status: 0 };
        for slot in 0..VALUES_PER_MODULE {
            let is_pad = self.has_reference && matches!(slot, REFERENCE_SLOT | 10);
            // A frozen taxel is stuck on the wire too, where the pad's noise would still move it by a count.
            let ailment = self.ailments.taxels[slot].as_deref();
            if let Some(value) = ailment.and_then(TaxelAilment::sends) {
                reading.values[slot] = value;
                continue;
            }
            let frozen = matches!(ailment, Some(TaxelAilment::Frozen));
            let drift = if is_pad || frozen { 0 } else { drift };
            let deviation = (i32::from(raw(slot)) - offset - drift) >> arithmetic.shift.min(15);
            reading.values[slot] = (no_load - deviation).clamp(0, 255) as u8;
            if deviation > 2 * no_load || deviation < -2 * (255 - no_load) {
                reading.status |= 1 << (4 + slot);
            }
            if raw(slot) == 0 && offset != 0 {
                reading.status |= 1;
            }
        }
        if (0..VALUES_PER_MODULE).all(|slot| raw(slot) == NOT_CONNECTED) {
            reading.status |= 2;
        }
        reading
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEFAULT: Arithmetic = Arithmetic { no_load: 240, shift: 2, cdc_offset: 0x2200, drift_gain: 0 };

    fn with(cdc: i32) -> Converter {
        let mut converter = Converter::new(Vec::new(), true);
        converter.cdc = [cdc as u16; VALUES_PER_MODULE];
        converter.reference = cdc;
        // Not empty, so that it counts as plugged in.
        converter.dots = vec![Dot { sense: Sense::Pad, noise_lsb: 0.0, thermal_lsb_per_k: 0.0, tare_bias_lsb: 0.0 }];
        converter
    }

    #[test]
    fn the_boards_formula_rounds_down_and_clips() {
        let sent = |deviation: i32| with(0x2200 + deviation).reading(DEFAULT).values[0];
        assert_eq!(sent(0), 240);
        assert_eq!(sent(3), 240, "three bits are no count");
        assert_eq!(sent(4), 239);
        assert_eq!(sent(-1), 241, "an arithmetic shift rounds towards minus infinity");
        assert_eq!(sent(-400), 255);
        assert_eq!(sent(4000), 0);
    }

    #[test]
    fn the_status_word_tells_what_is_wrong() {
        assert_eq!(with(0x2200).reading(DEFAULT).status, 0);
        assert_eq!(with(0x2200 + 4 * 481).reading(DEFAULT).status, 0xFFF0, "beyond twice the span");
        assert_eq!(with(0xFFFF).reading(DEFAULT).status, 0xFFF2);
        assert_eq!(with(0).reading(DEFAULT).status, 0xFFF1);
        assert_eq!(Converter::new(Vec::new(), true).reading(DEFAULT).status & 3, 2, "an empty position");
    }
}
