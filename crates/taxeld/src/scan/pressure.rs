//! Which bits of a foreign frame could be a pressure.

use taxel_wire::signal::{ByteOrder, PressureMeaning, PressureUnit, SignalSpec};
use taxel_wire::{CanId, Frame};

use super::findings::PressureFound;

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

/// Names of units, and what they are in kPa.
const UNITS: [(&str, f64); 4] = [("Pa", 1e-3), ("mbar", 0.1), ("kPa", 1.0), ("bar", 100.0)];

/// The likeliest ways in which these frames could carry a pressure.
#[must_use]
pub fn candidates(id: CanId, frames: &[Frame]) -> Vec<PressureFound> {
    let shortest = frames.iter().map(|frame| frame.bytes().len()).min().unwrap_or(0);
    if frames.len() < FRAMES_MIN || shortest == 0 {
        return Vec::new();
    }
    let mut found: Vec<(f64, PressureFound)> = Vec::new();
    for bytes in [4_usize, 2] {
        for first in 0..=shortest.saturating_sub(bytes) {
            if bytes > shortest || first % 2 != 0 {
                continue; // fields begin at even bytes in all sensors that are known to us
            }
            for signed in [true, false] {
                for byte_order in [ByteOrder::Little, ByteOrder::Big] {
                    found.extend(candidate(id, frames, (first, bytes), (byte_order, signed)));
                }
            }
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0)); // stable: longer fields, little endian and signed come first among equals
    let mut told: Vec<PressureFound> = Vec::new();
    for (_, candidate) in found {
        // The same bits with and without a sign read the same: one is enough.
        let bits = |found: &PressureFound| (found.start_bit, found.length_bits, found.byte_order);
        let same = |other: &PressureFound| bits(other) == bits(&candidate);
        if told.len() < CANDIDATES_MAX && !told.iter().any(same) {
            told.push(candidate);
        }
    }
    told
}

fn candidate(
    id: CanId,
    frames: &[Frame],
    (first, bytes): (usize, usize),
    (byte_order, signed): (ByteOrder, bool),
) -> Option<(f64, PressureFound)> {
    let little = byte_order == ByteOrder::Little;
    let start_bit = (8 * first + if little { 0 } else { 7 }) as u16;
    let length_bits = (8 * bytes) as u16;
    let signal = SignalSpec {
        id,
        start_bit,
        length_bits,
        byte_order,
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
    let steps: f64 = raw.windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum::<f64>() / (raw.len() - 1) as f64;
    let smooth = distinct >= DISTINCT[0] && steps < SMOOTH_SHARE * (most - least);
    let in_unit = |(unit, kpa): &(&'static str, f64)| {
        let (least, most) = (least * kpa, most * kpa);
        let moving = smooth && most - least > MOVES_KPA;
        let within = |(from, to): (f64, f64)| least >= from && most <= to;
        let coarse = *kpa * steps > 2.0; // whole steps of some kPa: no gauge reads so
        let meaning = if within(AMBIENT_KPA) {
            "absolute"
        } else if within(DIFFERENTIAL_KPA) && (moving || (least.abs() < VENTED_KPA && most.abs() < VENTED_KPA)) {
            "differential"
        } else {
            return None;
        };
        // Coarse units make anything small: the finest one that fits is the likeliest.
        let width = bytes as f64 / 8.0;
        let score = 4.0 * f64::from(u8::from(moving)) + f64::from(u8::from(smooth)) + width - kpa.log10() / 10.0;
        (!coarse).then_some((score, *unit, (least, most), meaning, moving))
    };
    let best = UNITS.iter().filter_map(in_unit).max_by(|a, b| a.0.total_cmp(&b.0))?;
    let (score, unit, kpa, meaning, moving) = best;
    let byte_order = if little { "little" } else { "big" };
    Some((score, PressureFound { start_bit, length_bits, byte_order, signed, unit, kpa, meaning, moving }))
}

/// How many values there are.
fn distinct(values: &[f64]) -> usize {
    let mut bits: Vec<u64> = values.iter().map(|value| value.to_bits()).collect();
    bits.sort_unstable();
    bits.dedup();
    bits.len()
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
