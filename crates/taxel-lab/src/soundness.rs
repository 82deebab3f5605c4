//! Whether cells, time and pressure of a recording can be what they claim to be, before anything is made of them.
//!
//! What has no sound reading is refused with its place, its value and what was expected. What can be left out without
//! harm is left out, counted and named.

use anyhow::bail;
use taxel_engine::calibration::fit::scans::is_byte;
use taxel_model::MIN_BINNED_SAMPLES;

use crate::numbers::quantile;
use crate::recording::Recording;

/// A recording may have so large a share of cells or rows that have to be left out; with more it is something else.
const LEFT_OUT_MAX: f64 = 0.01;

/// Scans further apart than this are no live skin: faults and smoothing are judged over seconds.
const STEP_MAX_S: f64 = 5.0;

/// Scans closer together than this are not heard from any bus.
const STEP_MIN_S: f64 = 1e-4;

/// Most kilopascals that a model can hold; a vacuum bag reaches a tenth of it.
const PRESSURE_MAX_KPA: f64 = 1000.0;

/// A pressure that rises above zero by no more than this share of how far it falls below is negative.
const POSITIVE_SHARE: f64 = 0.1;

/// What is to be looked at.
#[derive(Clone, Copy, Debug)]
pub struct Wanted {
    /// The pressure is used.
    pub pressure: bool,
    /// Rows may be left out; without it they are only told, so that every row of the file has its answer.
    pub drop_rows: bool,
    /// Fewer rows are no recording of a skin.
    pub rows_min: u64,
}

impl Wanted {
    /// For a fit.
    pub const FIT: Self = Self { pressure: true, drop_rows: true, rows_min: MIN_BINNED_SAMPLES };
    /// For reading counts by the models of a skin: every row of the file has its answer.
    pub const APPLY: Self = Self { pressure: false, drop_rows: false, rows_min: 0 };
    /// For figures over counts and pressure.
    pub const DRAW: Self = Self { rows_min: 0, ..Self::FIT };
}

/// Checks a recording of a skin and leaves out what must not be used; what was left out or looks odd comes back as
/// lines for the summary. A table that is no recording of a skin is left as it is.
///
/// # Errors
/// What is wrong, in which line, with which value, and what was expected instead.
pub fn check(recording: &mut Recording, wanted: Wanted) -> anyhow::Result<Vec<String>> {
    let mut notes = Vec::new();
    let table = why_a_table(recording, wanted.rows_min);
    if table.is_none() {
        notes.extend(mask_strays(recording));
    }
    if table.is_none() || is_wide_skin(recording, wanted.rows_min) {
        check_time(recording, wanted, &mut notes)?;
        if wanted.pressure {
            check_pressure(recording, &mut notes)?;
        }
    }
    // Without the rows that were left out it may be a table all the same.
    if let Some(why) = table.or_else(|| why_a_table(recording, wanted.rows_min)) {
        notes.push(format!(
            "taken column by column as a table, because {why}: faults, hysteresis and lag are not looked for, and \
             nothing is averaged over time"
        ));
    }
    Ok(notes)
}

/// Cells that are neither 8-bit counts nor missing: how many, and the first with its place.
fn strays(recording: &Recording) -> Option<(usize, String)> {
    let is_stray = |count: &&f64| !is_byte(**count) && !count.is_nan();
    let strays: usize = recording.counts.iter().map(|column| column.iter().filter(is_stray).count()).sum();
    let first = recording.counts.iter().enumerate().find_map(|(taxel, column)| {
        let row = column.iter().position(|count| is_stray(&count))?;
        Some(format!("line {}, c{taxel}: {}", recording.lines[row], column[row]))
    });
    first.map(|first| (strays, first))
}

/// Why this is no recording of an 8-bit skin; `None` if it is one.
fn why_a_table(recording: &Recording, rows_min: u64) -> Option<String> {
    let (rows, columns) = (recording.scans(), recording.counts.len());
    if (rows as u64) < rows_min {
        return Some(format!("it has {rows} rows and a recording of a skin has {rows_min} and more"));
    }
    if columns < 2 {
        return Some("it has one column of counts and a recording of a skin has two and more".to_owned());
    }
    let (strays, first) = strays(recording)?;
    let share = strays as f64 / (rows * columns) as f64;
    let percent = 100.0 * share;
    let why = format!("{percent:.1} % of its cells are no 8-bit counts, integers within 0..=255 ({first})");
    (share > LEFT_OUT_MAX).then_some(why)
}

/// Whether these are integer counts of more than eight bits over time.
fn is_wide_skin(recording: &Recording, rows_min: u64) -> bool {
    let integers = recording.counts.iter().all(|column| column.iter().all(|c| c.is_nan() || c.fract() == 0.0));
    recording.scans() as u64 >= rows_min && recording.counts.len() > 1 && integers
}

/// Makes the few cells that are no 8-bit counts missing ones.
fn mask_strays(recording: &mut Recording) -> Option<String> {
    let (strays, first) = strays(recording)?;
    for count in recording.counts.iter_mut().flatten().filter(|count| !is_byte(**count)) {
        *count = f64::NAN;
    }
    Some(format!("{strays} cells left out that are no 8-bit counts, integers within 0..=255 (first: {first})"))
}

fn check_time(recording: &mut Recording, wanted: Wanted, notes: &mut Vec<String>) -> anyhow::Result<()> {
    let repeated = repeated_rows(recording);
    leave_out(recording, &repeated, wanted, "repeat the row before them", notes);
    let rows: Vec<usize> = (0..recording.scans()).filter(|row| wanted.drop_rows || !repeated[*row]).collect();
    let time_s = &recording.time_s;
    let mut late = vec![false; recording.scans()];
    let mut newest = f64::NEG_INFINITY;
    for &row in &rows {
        late[row] = time_s[row] <= newest;
        newest = newest.max(time_s[row]);
    }
    let late_rows = late.iter().filter(|late| **late).count();
    if late_rows as f64 > LEFT_OUT_MAX * rows.len() as f64 {
        let pair = rows.windows(2).find(|pair| late[pair[1]]).unwrap_or(&[0, 0]);
        bail!(
            "line {}: t_s goes from {} to {}, and {late_rows} of {} rows are not later than all before: expected one \
             recording with seconds that rise from row to row",
            recording.lines[pair[1]],
            time_s[pair[0]],
            time_s[pair[1]],
            rows.len()
        );
    }
    let steps: Vec<f64> = rows.windows(2).map(|pair| time_s[pair[1]] - time_s[pair[0]]).collect();
    check_steps(&steps)?;
    let gaps = steps.iter().filter(|step| **step > STEP_MAX_S).count();
    if let Some(at) = steps.iter().position(|step| *step > STEP_MAX_S) {
        let line = recording.lines[rows[at + 1]];
        notes.push(format!(
            "{gaps} gaps of more than {STEP_MAX_S} s in t_s (first: line {line}): the zero is taken to be the same on \
             both sides"
        ));
    }
    leave_out(recording, &late, wanted, "have a t_s that is not later than all before", notes);
    Ok(())
}

/// Whether the time can be in seconds.
fn check_steps(steps: &[f64]) -> anyhow::Result<()> {
    let median = quantile(steps, 0.5);
    if median > STEP_MAX_S {
        bail!(
            "t_s rises by {median:.6} a row (median): expected seconds, {STEP_MAX_S} at most from scan to scan, because \
             faults and smoothing are judged over seconds; if these are milliseconds, divide by 1000"
        );
    }
    if median < STEP_MIN_S {
        bail!("t_s rises by {median:.1e} a row (median): expected seconds, {STEP_MIN_S} at least from scan to scan");
    }
    Ok(())
}

fn check_pressure(recording: &mut Recording, notes: &mut Vec<String>) -> anyhow::Result<()> {
    let (lines, Some(kpa)) = (&recording.lines, &mut recording.pressure_kpa) else { return Ok(()) };
    let finite: Vec<f64> = kpa.iter().copied().filter(|p| p.is_finite()).collect();
    let (low, high) = (quantile(&finite, 0.01), quantile(&finite, 0.99));
    // The row whose pressure is greatest or least.
    let extreme = |sign: f64| {
        let known = kpa.iter().enumerate().filter(|(_, p)| p.is_finite());
        let row = known.max_by(|a, b| (sign * a.1).total_cmp(&(sign * b.1))).map_or(0, |(row, _)| row);
        format!("line {}: pressure_kpa is {}", lines[row], kpa[row])
    };
    if high > PRESSURE_MAX_KPA || low < -PRESSURE_MAX_KPA {
        let place = extreme(if high > PRESSURE_MAX_KPA { 1.0 } else { -1.0 });
        bail!("{place}: expected kilopascals, at most {PRESSURE_MAX_KPA}; if these are pascals, divide by 1000");
    }
    if low < 0.0 && high <= -POSITIVE_SHARE * low {
        bail!(
            "{} and hardly ever above zero (99 % are below {high}): expected the pressure on the skin, positive under \
             load; if the gauge reads the bag against the atmosphere, change the sign",
            extreme(-1.0)
        );
    }
    let beyond = |p: &f64| p.abs() > PRESSURE_MAX_KPA;
    if let Some(row) = kpa.iter().position(beyond) {
        let (n, line, value) = (kpa.iter().filter(|p| beyond(p)).count(), lines[row], kpa[row]);
        notes.push(format!(
            "{n} pressures left out that are beyond {PRESSURE_MAX_KPA} kPa (first: line {line}, {value})"
        ));
        kpa.iter_mut().filter(|p| beyond(p)).for_each(|p| *p = f64::NAN);
    }
    Ok(())
}

/// Rows that hold what the row before holds, time and all.
fn repeated_rows(recording: &Recording) -> Vec<bool> {
    let columns = || recording.pressure_kpa.iter().chain(&recording.counts).chain([&recording.time_s]);
    let same = |column: &Vec<f64>, i: usize| column[i].to_bits() == column[i - 1].to_bits();
    (0..recording.scans()).map(|i| i > 0 && columns().all(|column| same(column, i))).collect()
}

/// Leaves out the marked rows, or only tells them.
fn leave_out(recording: &mut Recording, marked: &[bool], wanted: Wanted, what: &str, notes: &mut Vec<String>) {
    let Some(first) = marked.iter().position(|marked| *marked) else { return };
    let n = marked.iter().filter(|marked| **marked).count();
    let (line, time_s) = (recording.lines[first], recording.time_s[first]);
    let done = if wanted.drop_rows { "rows left out that" } else { "rows" };
    notes.push(format!("{n} {done} {what} (first: line {line}, t_s {time_s})"));
    if wanted.drop_rows {
        let kept: Vec<bool> = marked.iter().map(|marked| !marked).collect();
        recording.retain(&kept);
    }
}
