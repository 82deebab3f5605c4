//! Whether cells, time and pressure of a recording can be what they claim to be, before anything is made of them.
//!
//! What has no sound reading is refused with its place, its value and what was expected. What can be left out without
//! harm is left out, counted and named.

use anyhow::{bail, ensure};
use taxel_engine::calibration::fit::scans::{RECORDING_SCANS_MIN, is_byte};
use taxel_engine::statistics::quantile;

use crate::numbers::median;
use crate::recording::Recording;

/// A recording may have so large a share of rows that have to be left out; with more it is something else.
const LEFT_OUT_MAX: f64 = 0.01;

/// Scans further apart than this are no live skin: faults and smoothing are judged over seconds.
const STEP_MAX_S: f64 = 5.0;

/// Scans closer together than this are not heard from any bus.
const STEP_MIN_S: f64 = 1e-4;

/// Most kilopascals that a model can hold; a vacuum bag reaches a tenth of it.
const PRESSURE_MAX_KPA: f64 = 1000.0;

/// A pressure that rises above zero by no more than this share of how far it falls below is negative.
const POSITIVE_SHARE: f64 = 0.1;

/// What a recording is checked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// A fit: fewer than 280 rows are no recording of a skin.
    Fit,
    /// Figures over counts and pressure.
    Draw,
    /// Reading counts by the models of a skin: every row of the file has its answer, and the pressure is not used.
    Apply,
}

/// Checks a recording of a skin and leaves out what must not be used; what was left out or looks odd comes back as
/// lines for the summary. A recording that is none of 8-bit skin over time is left as it is.
///
/// # Errors
/// What is wrong, in which line, with which value, and what was expected instead.
pub fn check(recording: &mut Recording, purpose: Purpose) -> anyhow::Result<Vec<String>> {
    let mut notes = Vec::new();
    let rows_min = if purpose == Purpose::Fit { RECORDING_SCANS_MIN } else { 0 };
    if recording.scans() >= rows_min && recording.counts.len() > 1 {
        check_time(recording, purpose, &mut notes)?;
        if purpose != Purpose::Apply {
            check_pressure(recording)?;
        }
    }
    if let Some(why) = why_no_bytes(recording, rows_min) {
        notes.push(format!("faults are not looked for and nothing is averaged over time, because {why}"));
    }
    Ok(notes)
}

/// Why this is no recording of an 8-bit skin over time; `None` if it is one.
fn why_no_bytes(recording: &Recording, rows_min: usize) -> Option<String> {
    let rows = recording.scans();
    if rows < rows_min {
        return Some(format!("it has {rows} rows and a recording of a skin has {rows_min} and more"));
    }
    if recording.counts.len() < 2 {
        return Some("it has one column of counts and a recording of a skin has two and more".to_owned());
    }
    recording.counts.iter().enumerate().find_map(|(taxel, column)| {
        let row = column.iter().position(|count| !is_byte(*count) && !count.is_nan())?;
        let (line, count) = (recording.lines[row], column[row]);
        Some(format!("c{taxel} is {count} in line {line} and counts of 8 bits are integers within 0..=255"))
    })
}

fn check_time(recording: &mut Recording, purpose: Purpose, notes: &mut Vec<String>) -> anyhow::Result<()> {
    let (time_s, lines, rows) = (&recording.time_s, &recording.lines, recording.scans());
    let mut newest = f64::NEG_INFINITY;
    let mut is_later = |time_s: &f64| {
        let later = *time_s > newest;
        newest = newest.max(*time_s);
        later
    };
    let kept: Vec<bool> = time_s.iter().map(&mut is_later).collect();
    if let Some(first) = kept.iter().position(|kept| !kept) {
        let late = kept.iter().filter(|kept| !**kept).count();
        let (line, from, to) = (lines[first], time_s[first - 1], time_s[first]);
        ensure!(
            late as f64 <= LEFT_OUT_MAX * rows as f64,
            "line {line}: t_s goes from {from} to {to}, and {late} of {rows} rows are not later than all before: expected \
             one recording with seconds that rise from row to row"
        );
        let done = if purpose == Purpose::Apply { "rows" } else { "rows left out that" };
        notes
            .push(format!("{late} {done} have a t_s that is not later than all before (first: line {line}, t_s {to})"));
    }
    let in_order: Vec<usize> = (0..rows).filter(|row| kept[*row]).collect();
    let steps: Vec<f64> = in_order.windows(2).map(|pair| time_s[pair[1]] - time_s[pair[0]]).collect();
    check_step(median(steps.iter().copied()))?;
    if let Some(at) = steps.iter().position(|step| *step > STEP_MAX_S) {
        let (gaps, line) = (steps.iter().filter(|step| **step > STEP_MAX_S).count(), lines[in_order[at + 1]]);
        notes.push(format!(
            "{gaps} gaps of more than {STEP_MAX_S} s in t_s (first: line {line}): the zero is taken to be the same on \
             both sides"
        ));
    }
    if purpose != Purpose::Apply {
        recording.retain(&kept);
    }
    Ok(())
}

/// Whether the time can be in seconds.
fn check_step(median_s: f64) -> anyhow::Result<()> {
    if median_s > STEP_MAX_S {
        bail!(
            "t_s rises by {median_s:.6} a row (median): expected seconds, {STEP_MAX_S} at most from scan to scan, because \
             faults and smoothing are judged over seconds; if these are milliseconds, divide by 1000"
        );
    }
    if median_s < STEP_MIN_S {
        bail!("t_s rises by {median_s:.1e} a row (median): expected seconds, {STEP_MIN_S} at least from scan to scan");
    }
    Ok(())
}

fn check_pressure(recording: &Recording) -> anyhow::Result<()> {
    let Some(kpa) = &recording.pressure_kpa else { return Ok(()) };
    let known = || kpa.iter().zip(&recording.lines).filter(|(kpa, _)| kpa.is_finite());
    if let Some((kpa, line)) = known().find(|(kpa, _)| kpa.abs() > PRESSURE_MAX_KPA) {
        bail!(
            "line {line}: pressure_kpa is {kpa}: expected kilopascals, at most {PRESSURE_MAX_KPA}; if these are pascals, divide \
             by 1000; if it is a single wrong value, empty its cell"
        );
    }
    let at = |share: f64| quantile(kpa.to_vec(), share);
    let Some((low, high)) = at(0.01).zip(at(0.99)) else { return Ok(()) };
    let least = known().min_by(|a, b| a.0.total_cmp(b.0));
    if let Some((kpa, line)) = least.filter(|_| low < 0.0 && high <= -POSITIVE_SHARE * low) {
        bail!(
            "line {line}: pressure_kpa is {kpa} and hardly ever above zero (99 % are below {high}): expected the pressure on the \
             skin, positive under load; if the gauge reads the bag against the atmosphere, change the sign"
        );
    }
    Ok(())
}
