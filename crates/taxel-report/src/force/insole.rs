//! The recordings of a real skin, where they are there.
//!
//! A 280-taxel insole in a pressure chamber (Belli et al., Sensors 2023, 23(9), 4501): fitted on `left_calibration`,
//! judged on `left_validation` and `left_steps`. The pressure is the same everywhere, so the error of the total force is
//! that of the mean pressure over the taxels.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, bail};
use flate2::read::MultiGzDecoder;
use taxel_engine::calibration::fit::{Applied, ApplyRecipe, apply, judge};
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::PatchPlan;
use taxel_skin::{Board, BoardAddress, BusIndex, Module, ModuleKind, Patch};

use super::recipe::{Beyond, Outcome, Recipe, Recording, Source, end_of, scan_us};
use crate::rig::fits::Live;

/// What is judged.
const JUDGED: [&str; 2] = ["validation", "steps"];

/// What was promised for these, percent at most.
const PROMISED_PERCENT: [f64; JUDGED.len()] = [3.5, 3.3];

/// Half of what was calibrated.
const LOW_KPA: f64 = 170.0;

/// Boards with so many triangles, as `deploy/insole.toml` has them.
const BOARDS: [(u8, u8); 2] = [(13, 16), (12, 12)];

/// Scans that are read for their time, evenly spread over the steps.
const TIMED_SCANS: usize = 1000;

/// Fits and judges; `None` where `folder` is not there.
///
/// # Errors
/// A recording that cannot be read or has no pressure.
pub fn measure(folder: &Path, quick: bool) -> anyhow::Result<Option<Source>> {
    if !folder.is_dir() {
        return Ok(None);
    }
    let read = |name: &str| read(&folder.join(format!("left_{name}.csv.gz")));
    let calibration = read("calibration")?;
    let judged = [read(JUDGED[0])?, read(JUDGED[1])?];
    let plan = PatchPlan::new(patch()?);
    let timed = bytes(&judged[1]);
    let repetitions = if quick { 1 } else { 5 };
    let mut outcomes = Vec::new();
    for recipe in Recipe::all() {
        let (set, fit_ms, scans) = calibration.fit(&recipe, repetitions)?;
        let force_percent = judged.iter().map(|recording| error_percent(recording, &set, recipe.low));
        let force_percent = force_percent.collect::<anyhow::Result<_>>()?;
        let mut live = Live::new(Arc::clone(&set), &plan, &set.baseline);
        let scan_us = scan_us(&timed, repetitions, |counts| live.read(counts));
        let usable = set.taxels.iter().filter(|model| model.is_usable()).count();
        outcomes.push(Outcome { scans, usable, fit_ms, scan_us, force_percent });
    }
    Ok(Some(Source {
        id: "insole",
        skin: "a real insole of 280 taxels",
        caption: format!(
            "Calibrated on one recording to 339 kPa and back (the low range: to {LOW_KPA} kPa), judged on two of other days by \
             the error of the sum of all taxels above 30 kPa; the height is the mean of the two."
        ),
        exams: JUDGED.to_vec(),
        promised_percent: PROMISED_PERCENT.to_vec(),
        outcomes,
    }))
}

fn patch() -> anyhow::Result<Patch> {
    let board = |(address, modules)| {
        let modules = (0..modules).map(|module| (Module::from_nibble(module), ModuleKind::Triangle)).collect();
        anyhow::Ok(Board { bus: BusIndex(0), address: BoardAddress::new(address)?, modules })
    };
    Ok(Patch::new("insole", BOARDS.into_iter().map(board).collect::<anyhow::Result<_>>()?)?)
}

fn bytes(recording: &Recording) -> Vec<Vec<u8>> {
    let scans = recording.time_s.len();
    let scan = |i: usize| recording.counts.iter().map(|column| column[i] as u8).collect();
    (0..scans).step_by((scans / TIMED_SCANS).max(1)).map(scan).collect()
}

/// Error of the total force on a recording, percent, after a tare at rest where it can be proven.
fn error_percent(recording: &Recording, set: &ModelSet, low: Option<Beyond>) -> anyhow::Result<f64> {
    let mut applied = apply(&recording.scans(), set, &ApplyRecipe::default())?;
    if low == Some(Beyond::Held) {
        hold(&mut applied, set);
    }
    Ok(judge(&applied, &recording.pressure_kpa).area_percent)
}

/// Takes away what readings have beyond the pressure at the end of their curve.
fn hold(applied: &mut Applied, set: &ModelSet) {
    for (column, model) in applied.pressure_kpa.iter_mut().zip(&set.taxels) {
        let Some((_, end_kpa)) = end_of(model) else { continue };
        column.iter_mut().filter(|kpa| **kpa > end_kpa).for_each(|kpa| *kpa = end_kpa);
    }
}

/// Reads `t_s,pressure_kpa,c0,c1,...`, gzipped.
fn read(path: &Path) -> anyhow::Result<Recording> {
    let named = || path.display().to_string();
    parse(MultiGzDecoder::new(File::open(path).with_context(named)?)).with_context(named)
}

fn parse(input: impl std::io::Read) -> anyhow::Result<Recording> {
    let mut reader = csv::Reader::from_reader(input);
    let columns = reader.headers()?.len();
    if columns < 3 || reader.headers()?.get(1) != Some("pressure_kpa") {
        bail!("line 1: expected the header `t_s,pressure_kpa,c0,c1,...`");
    }
    let counts = vec![Vec::new(); columns - 2];
    let mut recording = Recording { counts, low_kpa: LOW_KPA, ..Recording::default() };
    for row in reader.deserialize::<Vec<Option<f64>>>() {
        let mut cells = row?.into_iter().map(|cell| cell.unwrap_or(f64::NAN));
        recording.time_s.extend(cells.next());
        recording.pressure_kpa.extend(cells.next());
        recording.counts.iter_mut().zip(cells).for_each(|(column, count)| column.push(count));
    }
    Ok(recording)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_is_read_column_by_column() {
        let text = "t_s,pressure_kpa,c0,c1\n0.0,1.5,240,239\n0.1,,238,\n0.2,2.5,237,236\n";
        let recording = parse(text.as_bytes()).unwrap();
        assert_eq!(recording.time_s, [0.0, 0.1, 0.2]);
        assert!(recording.pressure_kpa[1].is_nan() && recording.counts[1][1].is_nan());
        assert_eq!(bytes(&recording)[2], [237, 236]);
    }

    #[test]
    fn what_is_no_recording_is_refused_with_its_place() {
        let says = |text: &str| format!("{:#}", parse(text.as_bytes()).err().unwrap());
        assert!(says("x,y\n").contains("expected the header"));
        assert!(says("t_s,pressure_kpa,c0\n0,1,2\n0,1,many\n").contains("line: 3"));
        assert!(measure(Path::new("no/such/folder"), true).unwrap().is_none());
    }
}
