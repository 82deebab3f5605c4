//! Whether cells, time and pressure of a recording can be what they claim to be, before anything is made of them.
//!
//! What has no sound reading is refused with its place, its value and what was expected. What can be left out without
//! harm is left out, counted and named.

use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::bail;
use taxel_engine::calibration::fit::scans::is_byte;
use taxel_model::MIN_BINNED_SAMPLES;

use crate::recording::{Column, Recording};
use crate::threads;

/// A recording may have so large a share of cells or rows that have to be left out; with more it is something else.
const LEFT_OUT_MAX: f64 = 0.01;

/// Scans further apart than this are no live skin: faults and smoothing are judged over seconds.
const STEP_MAX_S: f64 = 5.0;

/// Scans closer together than this are not heard from any bus.
const STEP_MIN_S: f64 = 1e-4;

/// From this step on milliseconds are as likely as seconds.
const STEP_ODD_S: f64 = 1.0;

/// So large a share of steps back is a reversed recording and not a shuffled one.
const REVERSED_SHARE: f64 = 0.9;

/// Most kilopascals that a model can hold; a vacuum bag reaches a tenth of it.
const PRESSURE_MAX_KPA: f64 = 1000.0;

/// A recording whose pressure spans less was not loaded, or is not in kilopascals.
const SPAN_MIN_KPA: f64 = 1.0;

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
    /// For comparing them with the pressure.
    pub const JUDGE: Self = Self { pressure: true, drop_rows: true, rows_min: 0 };
}

/// Checks a recording of a skin and leaves out what must not be used; what was left out or looks odd comes back as
/// lines for the summary. A table that is no recording of a skin is left as it is.
///
/// # Errors
/// What is wrong, in which line, with which value, and what was expected instead.
pub fn check(recording: &mut Recording, wanted: Wanted) -> anyhow::Result<Vec<String>> {
    let mut notes = Vec::new();
    let Some(table) = why_a_table(recording, wanted.rows_min) else {
        notes.extend(mask_strays(recording));
        check_rows(recording, wanted, &mut notes)?;
        // Without the rows that were left out it may be one all the same.
        notes.extend(why_a_table(recording, wanted.rows_min).as_deref().map(as_a_table));
        return Ok(notes);
    };
    if is_wide_skin(recording, wanted.rows_min) {
        check_rows(recording, wanted, &mut notes)?;
    }
    notes.push(as_a_table(&table));
    Ok(notes)
}

fn as_a_table(why: &str) -> String {
    format!(
        "taken column by column as a table, because {why}: faults, hysteresis and lag are not looked for, and nothing is \
         averaged over time"
    )
}

fn check_rows(recording: &mut Recording, wanted: Wanted, notes: &mut Vec<String>) -> anyhow::Result<()> {
    check_time(recording, wanted, notes)?;
    if wanted.pressure {
        check_pressure(recording, notes)?;
    }
    Ok(())
}

/// Neither a count of an 8-bit skin nor missing.
fn is_stray(count: f64) -> bool {
    !is_byte(count) && !count.is_nan()
}

/// Cells that are no 8-bit counts: how many, and the first with its place.
fn strays(recording: &Recording) -> (usize, Option<String>) {
    let stray = |column: &Column| column.hi.iter().filter(|count| is_stray(**count)).count();
    let strays = AtomicUsize::new(0);
    threads::each(recording.counts.len(), &|taxel| {
        strays.fetch_add(stray(&recording.counts[taxel]), Ordering::Relaxed);
    });
    let strays = strays.into_inner();
    let place = |(taxel, column): (usize, &Column)| {
        let row = column.hi.iter().position(|count| is_stray(*count))?;
        Some(format!("line {}, c{taxel}: {}", recording.lines[row], column.hi[row]))
    };
    // Nearly always there is none, and then nobody looks for the first.
    (strays, if strays > 0 { recording.counts.iter().enumerate().find_map(place) } else { None })
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
    let (strays, first) = strays(recording);
    let cells = rows * columns;
    (strays as f64 > LEFT_OUT_MAX * cells as f64).then(|| {
        let share = 100.0 * strays as f64 / cells as f64;
        let first = first.unwrap_or_default();
        format!("{share:.1} % of its cells are no 8-bit counts, integers within 0..=255 ({first})")
    })
}

/// Whether these are integer counts of more than eight bits over time.
fn is_wide_skin(recording: &Recording, rows_min: u64) -> bool {
    let integers = recording.counts.iter().all(|column| column.hi.iter().all(|c| c.is_nan() || c.fract() == 0.0));
    recording.scans() as u64 >= rows_min && recording.counts.len() > 1 && integers
}

/// Makes the few cells that are no 8-bit counts missing ones.
fn mask_strays(recording: &mut Recording) -> Option<String> {
    let (strays, first) = strays(recording);
    for count in recording.counts.iter_mut().flat_map(|column| &mut column.hi).filter(|count| is_stray(**count)) {
        *count = f64::NAN;
    }
    let first = first?;
    Some(format!("{strays} cells left out that are no 8-bit counts, integers within 0..=255 (first: {first})"))
}

fn check_time(recording: &mut Recording, wanted: Wanted, notes: &mut Vec<String>) -> anyhow::Result<()> {
    let repeated = repeated_rows(recording);
    leave_out(recording, &repeated, wanted, "repeat the row before them", notes);
    let kept = |i: &usize| wanted.drop_rows || !repeated[*i];
    let rows: Vec<usize> = (0..recording.scans()).filter(kept).collect();
    let (time_s, lines) = (&recording.time_s, &recording.lines);
    let step = |pair: &[usize]| time_s[pair[1]] - time_s[pair[0]];
    let (Some(&first), n) = (rows.first(), rows.len()) else { return Ok(()) };
    if n > 1 && rows.windows(2).all(|pair| step(pair) == 0.0) {
        bail!("t_s is {} in all {n} rows: expected seconds that rise from row to row", time_s[first]);
    }
    let mut late = vec![false; recording.scans()];
    let mut newest = f64::NEG_INFINITY;
    for &row in &rows {
        late[row] = time_s[row] <= newest;
        newest = newest.max(time_s[row]);
    }
    let late_rows = late.iter().filter(|late| **late).count();
    if late_rows as f64 > LEFT_OUT_MAX * n as f64 {
        let back = rows.windows(2).filter(|pair| step(pair) < 0.0).count();
        let odd = rows.windows(2).find(|pair| if back > 0 { step(pair) < 0.0 } else { step(pair) == 0.0 });
        let place = odd.map_or_else(String::new, |pair| {
            format!("line {}: t_s goes from {} to {}", lines[pair[1]], time_s[pair[0]], time_s[pair[1]])
        });
        bail!("{place}, {}", why_not_in_order(back, late_rows, n));
    }
    let steps: Vec<f64> = rows.windows(2).map(step).filter(|step| *step > 0.0).collect();
    check_steps(&steps, notes)?;
    let longest = rows.windows(2).max_by(|a, b| step(a).total_cmp(&step(b)));
    let gaps = steps.iter().filter(|step| **step > STEP_MAX_S).count();
    if let Some(pair) = longest.filter(|_| gaps > 0) {
        notes.push(format!(
            "{gaps} gaps of more than {STEP_MAX_S} s in t_s (longest {:.6} s, line {}): the zero is taken to be the same \
             on both sides",
            step(pair),
            lines[pair[1]]
        ));
    }
    leave_out(recording, &late, wanted, "have a t_s that is not later than all before", notes);
    Ok(())
}

/// What a time that does not rise looks like, and what to do.
fn why_not_in_order(back: usize, late: usize, rows: usize) -> String {
    let share = back as f64 / (rows - 1) as f64;
    if share > REVERSED_SHARE {
        format!("and falls in {back} of {} steps: the rows are in reverse; expected seconds that rise", rows - 1)
    } else if back == 0 {
        format!(
            "and {late} of {rows} rows have the time of the row before: expected a t_s with digits enough to tell rows apart"
        )
    } else if back <= 2 {
        format!(
            "and {late} of {rows} rows are not later than those before: as if recordings were joined; expected one with seconds that rise"
        )
    } else {
        format!("and falls in {back} of {} steps: the rows are shuffled; expected them sorted by t_s", rows - 1)
    }
}

/// Whether the time can be in seconds.
fn check_steps(steps: &[f64], notes: &mut Vec<String>) -> anyhow::Result<()> {
    let Some(median) = quantile(steps.to_vec(), 0.5) else { return Ok(()) };
    if median > STEP_MAX_S {
        bail!(
            "t_s rises by {median:.6} a row (median): expected seconds, {STEP_MAX_S} at most from scan to scan, because \
             faults and smoothing are judged over seconds; if these are milliseconds, divide by 1000"
        );
    }
    if median < STEP_MIN_S {
        bail!("t_s rises by {median:.1e} a row (median): expected seconds, {STEP_MIN_S} at least from scan to scan");
    }
    if median >= STEP_ODD_S {
        notes.push(format!(
            "t_s rises by {median:.6} a row (median) and is taken for seconds; if these are milliseconds, divide by 1000"
        ));
    }
    Ok(())
}

fn check_pressure(recording: &mut Recording, notes: &mut Vec<String>) -> anyhow::Result<()> {
    let Some(column) = &mut recording.pressure_kpa else { return Ok(()) };
    let at = |q: f64| quantile(column.hi.clone(), q);
    let (Some(low), Some(high)) = (at(0.01), at(0.99)) else { return Ok(()) };
    let place = |row: Option<usize>| row.map_or_else(String::new, |row| format!("line {}", recording.lines[row]));
    let extreme = |sign: f64| {
        let known = column.hi.iter().enumerate().filter(|(_, p)| p.is_finite());
        known.max_by(|a, b| (sign * a.1).total_cmp(&(sign * b.1))).map(|(row, _)| row)
    };
    if high > PRESSURE_MAX_KPA || low < -PRESSURE_MAX_KPA {
        let row = extreme(if high > PRESSURE_MAX_KPA { 1.0 } else { -1.0 });
        let value = row.map_or(high, |row| column.hi[row]);
        bail!(
            "{}: pressure_kpa is {value}: expected kilopascals, at most {PRESSURE_MAX_KPA}; if these are pascals, divide \
             by 1000",
            place(row)
        );
    }
    if low < 0.0 && high <= -POSITIVE_SHARE * low {
        let row = extreme(-1.0);
        bail!(
            "{}: pressure_kpa is {} and hardly ever above zero (99 % are below {high}): expected the pressure on the skin, \
             positive under load; if the gauge reads the bag against the atmosphere, change the sign",
            place(row),
            row.map_or(low, |row| column.hi[row])
        );
    }
    if high - low < SPAN_MIN_KPA {
        notes.push(format!(
            "pressure_kpa spans {:.4} only ({low} to {high}); if these are bar or megapascals, convert them",
            high - low
        ));
    }
    let beyond = |p: &f64| p.abs() > PRESSURE_MAX_KPA;
    if let Some(row) = column.hi.iter().position(beyond) {
        let (n, value) = (column.hi.iter().filter(|p| beyond(p)).count(), column.hi[row]);
        notes.push(format!(
            "{n} pressures left out that are beyond {PRESSURE_MAX_KPA} kPa (first: {}, {value})",
            place(Some(row))
        ));
        column.hi.iter_mut().filter(|p| beyond(p)).for_each(|p| *p = f64::NAN);
    }
    Ok(())
}

/// Rows that hold what the row before holds, time and all.
fn repeated_rows(recording: &Recording) -> Vec<bool> {
    let same = |column: &[f64], i: usize| column[i].to_bits() == column[i - 1].to_bits();
    let columns = || recording.pressure_kpa.iter().chain(&recording.counts);
    let repeats = |i: usize| same(&recording.time_s, i) && columns().all(|column| same(&column.hi, i));
    (0..recording.scans()).map(|i| i > 0 && repeats(i)).collect()
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

/// A quantile of the finite values.
fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.retain(|v| v.is_finite());
    let at = (share * values.len().checked_sub(1)? as f64).round() as usize;
    Some(*values.select_nth_unstable_by(at, f64::total_cmp).1)
}
