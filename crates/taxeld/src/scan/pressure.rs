//! Which bits of a foreign frame could be a pressure.

use taxel_wire::signal::{ByteOrder, PressureMeaning, PressureUnit, SignalSpec};
use taxel_wire::{CanId, Frame};

/// Frames below which nothing is said.
const FRAMES_MIN: usize = 8;
/// Candidates that are told of one identifier.
const CANDIDATES_MAX: usize = 3;
/// What a gauge can read, differential: of a bag up to 101, of a chamber more; vented it may be off by a few kPa.
const DIFFERENTIAL_KPA: (f64, f64) = (-3.0, 500.0);
/// What a vented bag reads, differential.
const VENTED_KPA: f64 = 3.0;
/// Absolute pressure of a vented bag, from the mountains to the sea.
const AMBIENT_KPA: (f64, f64) = (70.0, 108.0);
/// A pressure moves smoothly: its mean step is a small share of its range.
const SMOOTH_SHARE: f64 = 0.12;
/// A converter has at least so many steps in what moves, and noise at least the second number.
const DISTINCT: [usize; 2] = [8, 3];
/// Share of equal steps from which values are those of a counter.
const COUNTER_SHARE: f64 = 0.97;
/// What moves by less than this stands, kPa.
const MOVES_KPA: f64 = 0.5;
/// Whole steps of more kPa: no gauge reads so.
const STEP_KPA_MAX: f64 = 2.0;

/// Names of units, and what they are in kPa.
const UNITS: [(&str, f64); 4] = [("Pa", 1e-3), ("mbar", 0.1), ("kPa", 1.0), ("bar", 100.0)];

/// Bits that could be a pressure.
#[derive(Clone, Debug)]
pub struct Pressure {
    score: f64,
    /// First bit, counted as in DBC files.
    pub start_bit: u16,
    /// How many.
    pub length_bits: u16,
    /// Little endian.
    pub little: bool,
    /// Two's complement.
    pub signed: bool,
    /// Unit that fits.
    pub unit: &'static str,
    /// Least and most, kPa.
    pub kpa: (f64, f64),
    /// Of a gauge that reads the air's pressure in a vented bag.
    pub absolute: bool,
    /// Whether it moved as a pressure does, smoothly and further than its noise; else it stood at a plausible value.
    pub moves: bool,
}

/// The likeliest ways in which these frames could carry a pressure.
#[must_use]
pub fn candidates(id: CanId, frames: &[Frame]) -> Vec<Pressure> {
    let shortest = frames.iter().map(|frame| frame.bytes().len()).min().unwrap_or(0);
    let mut found = Vec::new();
    for bytes in [4, 2] {
        // Fields begin at even bytes in all sensors that are known to us.
        for first in (0..shortest).step_by(2).filter(|first| first + bytes <= shortest) {
            for little in [true, false] {
                // The same bits with and without a sign most often read the same.
                let signs = [true, false].into_iter();
                found.extend(signs.filter_map(|signed| candidate(id, frames, (first, bytes), little, signed)).next());
            }
        }
    }
    found.sort_by(|a, b| b.score.total_cmp(&a.score)); // stable: longer fields and little endian come first among equals
    found.truncate(CANDIDATES_MAX);
    found
}

fn candidate(
    id: CanId,
    frames: &[Frame],
    (first, bytes): (usize, usize),
    little: bool,
    signed: bool,
) -> Option<Pressure> {
    let (start_bit, length_bits) = ((8 * first + if little { 0 } else { 7 }) as u16, (8 * bytes) as u16);
    let signal = SignalSpec {
        id,
        start_bit,
        length_bits,
        byte_order: if little { ByteOrder::Little } else { ByteOrder::Big },
        signed,
        scale: 1.0,
        offset: 0.0,
        unit: PressureUnit::Kilopascal,
        meaning: PressureMeaning::Differential,
    };
    let raw: Vec<f64> = frames.iter().filter_map(|frame| Some(signal.decode(frame).ok()?.0)).collect();
    let (least, most) = raw.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
    let distinct = distinct(&raw);
    if raw.len() < FRAMES_MIN || distinct < DISTINCT[1] || counts_up(&raw) {
        return None; // what never changes is no sensor, and a counter or a clock is no pressure
    }
    let step = raw.windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum::<f64>() / (raw.len() - 1) as f64;
    let smooth = distinct >= DISTINCT[0] && step < SMOOTH_SHARE * (most - least);
    let in_unit = |(unit, factor): &(&'static str, f64)| {
        let kpa = (least * factor, most * factor);
        let moves = smooth && kpa.1 - kpa.0 > MOVES_KPA;
        let within = |(from, to): (f64, f64)| kpa.0 >= from && kpa.1 <= to;
        let absolute = within(AMBIENT_KPA);
        let differential = within(DIFFERENTIAL_KPA) && (moves || within((-VENTED_KPA, VENTED_KPA)));
        // Coarse units make anything small: the finest one that fits is the likeliest.
        let width = bytes as f64 / 8.0;
        let score = 4.0 * f64::from(u8::from(moves)) + f64::from(u8::from(smooth)) + width - factor.log10() / 10.0;
        let found = Pressure { score, start_bit, length_bits, little, signed, unit, kpa, absolute, moves };
        ((absolute || differential) && factor * step <= STEP_KPA_MAX).then_some(found)
    };
    UNITS.iter().filter_map(in_unit).max_by(|a, b| a.score.total_cmp(&b.score))
}

/// How many values there are.
fn distinct(values: &[f64]) -> usize {
    values.iter().map(|value| value.to_bits()).collect::<std::collections::HashSet<_>>().len()
}

/// Whether nearly all values go up by the same step, as counters and clocks do, also those that begin anew now and then.
/// A ramp has noise on it, or begins and ends with a rest.
fn counts_up(values: &[f64]) -> bool {
    let mut steps: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    let Some(&usual) = steps.get(steps.len() / 2) else { return false };
    let alike = steps.iter().filter(|step| (**step - usual).abs() <= 0.05 * usual.abs() + 1e-9).count();
    usual != 0.0 && alike as f64 >= COUNTER_SHARE * steps.len() as f64
}
