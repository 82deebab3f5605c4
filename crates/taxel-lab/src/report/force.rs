//! The owner's first question: how far off is the force, and what does it cost to compute? Recipes of calibration
//! against each other, by the time of a fit and of a scan, on data that no fit saw.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use anyhow::Context;
use serde_json::Value;
use taxel_engine::calibration::fit::{Branch, FitRecipe, OneByOne, Tare, apply, fit, judge};
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::PatchPlan;
use taxel_model::FitOptions;
use taxel_sim::Effect;
use taxel_skin::{Board, BoardAddress, BusIndex, Module, ModuleKind, Patch};

use super::args::ReportArgs;
use crate::document::{Aim, Axis, Figure, Line, Look, Section, Table, row};
use crate::forearm::{Live, TARGET_KPA, Tried};
use crate::numbers::{mean, median};
use crate::recording::Recording;

/// From scan to scan of a skin at 20 Hz, us.
const BETWEEN_SCANS_US: f64 = 50_000.0;

/// Boards of the real skin with so many triangles, as `deploy/insole.toml` has them.
const INSOLE_BOARDS: [(u8, u8); 2] = [(13, 16), (12, 12)];

/// The recordings that are judged, and what was promised for each, percent at most.
const JUDGED: [(&str, f64); 2] = [("validation", 3.5), ("steps", 3.3)];

/// One way to calibrate.
struct Recipe {
    name: &'static str,
    fit: FitRecipe,
}

/// What came of it.
struct Outcome {
    usable: usize,
    /// Median time of a fit of the whole skin, ms.
    fit_ms: f64,
    /// Median time from the counts of a scan to its force, us.
    scan_us: f64,
    /// Error of the force on what the fit never saw, percent, one for each exam.
    error_percent: Vec<f64>,
    /// Readings within their own 95 % interval, percent; NaN where that is not judged.
    within_percent: f64,
}

/// One skin with its outcomes, in the order of [`recipes`].
struct Source {
    id: &'static str,
    skin: &'static str,
    caption: String,
    exams: Vec<&'static str>,
    outcomes: Vec<Outcome>,
}

fn recipes() -> Vec<Recipe> {
    let shipped = FitRecipe::default;
    let paper = FitOptions { paper: true, ..FitOptions::default() };
    let rising = FitRecipe { branch: Branch::Rising, ..shipped() };
    vec![
        Recipe { name: "both branches (shipped default, recordings)", fit: shipped() },
        Recipe { name: "rising branch (shipped default, sessions)", fit: rising.clone() },
        Recipe { name: "the paper's equation, rising branch", fit: FitRecipe { options: paper, ..rising } },
        Recipe { name: "both branches, no plays", fit: FitRecipe { plays: false, ..shipped() } },
    ]
}

/// Measures the section.
///
/// # Errors
/// A simulation that cannot be set up, or a recording that is there and cannot be read.
pub(super) fn section(args: &ReportArgs) -> anyhow::Result<Section> {
    let folder = args.data.as_deref().map(|data| data.join("insole")).filter(|folder| folder.is_dir());
    let (mut sources, mut aims) = (vec![forearms(args.seed, args.quick)?], Vec::new());
    let mut text = vec![
        "How far is the force off on data that no fit saw, and what does computing it cost? Each line is one way to \
         calibrate: its left end is the time from the counts of a scan to the force of the whole skin, its right end the \
         time of a fit of the whole skin, its height the error of the force. Lower and further left is better. All run \
         in one thread of the engine's own code."
            .to_owned(),
    ];
    match folder {
        Some(folder) => {
            let insole = insole(&folder, args.quick)?;
            // Of the shipped default for recordings.
            let aim = |(percent, (exam, most)): (&f64, &(&str, f64))| {
                let what = format!("{}: error of the force on a recording of another day ({exam}), %", insole.skin);
                Aim::at_most(&what, *percent, *most)
            };
            aims.extend(insole.outcomes[0].error_percent.iter().zip(&JUDGED).map(aim));
            sources.insert(0, insole);
            text.push(
                "What is missed on `validation` is the skin's gain: that day it reads 4 % more at every pressure, which no \
                 fit of another day can know and a known load can tell (`taxeld recalibrate`)."
                    .to_owned(),
            );
        }
        None => text.push("SKIPPED: the recordings of a real skin are not here (--data).".to_owned()),
    }
    Ok(Section {
        text,
        aims,
        figures: sources.iter().map(figure).collect(),
        tables: sources.iter().map(table).collect(),
        ..Section::default()
    })
}

/// The models of a recipe, and the median time of a fit in ms.
fn fitted(recording: &Recording, recipe: &Recipe, repetitions: usize) -> anyhow::Result<(Arc<ModelSet>, f64)> {
    let scans = recording.as_scans();
    let once = |_| {
        let begun = Instant::now();
        let set = fit(&scans, &recipe.fit, &OneByOne)?;
        Ok((set, 1e3 * begun.elapsed().as_secs_f64()))
    };
    let (mut sets, times_ms): (Vec<_>, Vec<_>) = (0..repetitions).map(once).collect::<anyhow::Result<_>>()?;
    Ok((Arc::new(sets.pop().context("no fit was asked for")?), median(times_ms)))
}

fn usable(set: &ModelSet) -> usize {
    set.taxels.iter().filter(|model| model.is_usable()).count()
}

/// Simulated forearms with everything that the simulator knows to be in the way, and known masses on them.
fn forearms(seed: u64, quick: bool) -> anyhow::Result<Source> {
    let (skins, repetitions) = if quick { (1, 1) } else { (10, 5) };
    let tried = (0..skins).map(|skin| Tried::new(&Effect::ALL, seed.wrapping_add(skin), 1, skin as usize));
    let tried = tried.collect::<anyhow::Result<Vec<Tried>>>()?;
    let outcome = |recipe: Recipe| {
        let (mut errors, mut of_first) = (Vec::new(), None);
        for skin in &tried {
            let (set, fit_ms) = fitted(&skin.calibration, &recipe, repetitions)?;
            let usable = usable(&set);
            let (read, scan_us) = skin.forces(set, &recipe.fit);
            errors.extend(read.iter().zip(&skin.weighings).map(|(n, one)| 100.0 * (n / one.true_n - 1.0).abs()));
            of_first.get_or_insert((usable, fit_ms, scan_us));
        }
        let (usable, fit_ms, scan_us) = of_first.context("no skin was tried")?;
        let error_percent = vec![mean(errors.into_iter())];
        Ok(Outcome { usable, fit_ms, scan_us, error_percent, within_percent: f64::NAN })
    };
    Ok(Source {
        id: "forearm",
        skin: "simulated forearms of 230 taxels",
        caption: format!(
            "Calibrated in the bag to {TARGET_KPA} kPa and back, judged by masses of 0.2 to 1 kg on 600 mm2 at places all \
             over {skins} skins with all effects of the simulator."
        ),
        exams: vec!["masses"],
        outcomes: recipes().into_iter().map(outcome).collect::<anyhow::Result<_>>()?,
    })
}

/// The recordings of a real skin: a 280-taxel insole in a pressure chamber (Belli et al., Sensors 2023, 23(9), 4501). The
/// pressure is the same everywhere, so the error of the total force is that of the mean pressure over the taxels.
fn insole(folder: &Path, quick: bool) -> anyhow::Result<Source> {
    let read = |name: &str| Recording::read(&folder.join(format!("left_{name}.csv.gz")));
    let calibration = read("calibration")?;
    let judged = JUDGED.iter().map(|(name, _)| read(name)).collect::<anyhow::Result<Vec<Recording>>>()?;
    let board = |(address, modules)| {
        let modules = (0..modules).map(|module| (Module::from_nibble(module), ModuleKind::Triangle)).collect();
        anyhow::Ok(Board { bus: BusIndex(0), address: BoardAddress::new(address)?, modules })
    };
    let boards = INSOLE_BOARDS.into_iter().map(board).collect::<anyhow::Result<_>>()?;
    let plan = PatchPlan::new(Patch::new("insole", boards)?);
    let outcome = |recipe: Recipe| {
        let (set, fit_ms) = fitted(&calibration, &recipe, if quick { 1 } else { 5 })?;
        let (mut error_percent, mut within_percent) = (Vec::new(), f64::NAN);
        for recording in &judged {
            let gauge = recording.pressure_kpa.as_deref().context("a recording has no pressure")?;
            let score = judge(&apply(&recording.as_scans(), &set, Tare::Auto)?, gauge);
            error_percent.push(score.area_percent);
            within_percent = score.coverage_percent.unwrap_or(f64::NAN).min(within_percent);
        }
        let mut live = Live::new(Arc::clone(&set), &plan, &set.baseline);
        let scan_us = scan_us(&calibration, &mut live);
        Ok(Outcome { usable: usable(&set), fit_ms, scan_us, error_percent, within_percent })
    };
    Ok(Source {
        id: "insole",
        skin: "a real insole of 280 taxels",
        caption: "Calibrated on one recording to 339 kPa and back, judged on two of other days by the error of the sum of all \
                  taxels above 30 kPa; the height is the mean of the two."
            .to_owned(),
        exams: JUDGED.iter().map(|(name, _)| *name).collect(),
        outcomes: recipes().into_iter().map(outcome).collect::<anyhow::Result<_>>()?,
    })
}

/// Median time of a scan, us, over a thousand evenly spread ones.
fn scan_us(recording: &Recording, live: &mut Live) -> f64 {
    let step = (recording.scans() / 1000).max(1);
    let time = |scan: usize| {
        let counts: Vec<u16> = recording.counts.iter().map(|column| column[scan] as u16).collect();
        let begun = Instant::now();
        std::hint::black_box(live.read(&counts));
        1e6 * begun.elapsed().as_secs_f64()
    };
    median((0..recording.scans()).step_by(step).map(time))
}

fn figure(source: &Source) -> Figure {
    let line = |(recipe, outcome): (Recipe, &Outcome)| {
        let look = if recipe.name.contains("shipped default") { Look::Ours } else { Look::Signs };
        let height = mean(outcome.error_percent.iter().copied());
        Line::new(recipe.name, look, [outcome.scan_us, outcome.fit_ms * 1e3].map(|x| (x, height)))
    };
    Figure {
        id: format!("force-{}", source.id),
        title: format!("Error of the force against run time: {}", source.skin),
        caption: source.caption.clone(),
        x: Axis { label: "time for the whole skin, us: of a scan (left ends), of a fit (right ends)", log: true },
        y: Axis { label: "error of the force on data that no fit saw, %", log: false },
        lines: recipes().into_iter().zip(&source.outcomes).map(line).collect(),
        levels: vec![(BETWEEN_SCANS_US, "from scan to scan at 20 Hz".to_owned())],
    }
}

fn table(source: &Source) -> Table {
    let errors = source.exams.iter().map(|exam| format!("error, {exam}, %"));
    let costs = ["within 95 %, %", "fit, ms", "scan, us", "usable taxels"].map(str::to_owned);
    let columns = std::iter::once("recipe".to_owned()).chain(errors).chain(costs);
    let line = |(recipe, of): (Recipe, &Outcome)| {
        let mut cells = row![recipe.name];
        cells.extend(of.error_percent.iter().map(|percent| Value::from(*percent)));
        cells.extend(row![of.within_percent, of.fit_ms, of.scan_us, of.usable as f64]);
        cells
    };
    let (what, skin) = ("Errors of the force on data that no fit saw, and times for the whole skin", source.skin);
    let rows = recipes().into_iter().zip(&source.outcomes).map(line).collect();
    Table::new(&format!("force-{}", source.id), format!("{what}: {skin}."), columns, rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_engine::calibration::SessionLimits;

    #[test]
    fn the_marked_recipes_are_what_is_shipped() {
        let all = recipes();
        assert_eq!(format!("{:?}", all[0].fit), format!("{:?}", FitRecipe::default()));
        assert_eq!(all[1].fit.branch, SessionLimits::default().branches);
        assert!(all[2].fit.is_paper());
    }

    #[test]
    fn every_recipe_has_a_line_with_two_ends_and_a_row_as_wide_as_the_table() {
        let source = forearms(3, true).unwrap();
        let (figure, table) = (figure(&source), table(&source));
        assert_eq!((figure.lines.len(), table.rows.len()), (recipes().len(), recipes().len()));
        for (line, row) in figure.lines.iter().zip(&table.rows) {
            assert!(line.points[0].0 < line.points[1].0, "a scan takes less than a fit: {line:?}");
            assert!(line.points[0].1 < 40.0 && row.len() == table.columns.len(), "{row:?}");
        }
    }
}
