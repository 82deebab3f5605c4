//! Calibration length against held-out error on simulated forearms.

use taxel_engine::plan::PatchPlan;

use crate::document::{Axis, Cell, Figure, Line, Point, Table, row};
use crate::numbers::{median, quantile, three_digits};
use crate::rig::fits::{Calibration, Exam, Recipe, Score, judge};
use crate::rig::{Forearm, MASSES_KG, PLACES, Scan};

/// Ramps to 70 kPa that take 14, 28, 56, 112 and 224 s: 5 kPa/s is the fastest that a session accepts.
const RATES_KPA_PER_S: [f64; 5] = [5.0, 2.5, 1.25, 0.625, 0.3125];

/// Of the fastest ramp also every fourth and every second scan, as slower boards would send.
const STRIDES: [usize; 2] = [4, 2];

/// End of the ramps that are fitted, kPa.
const TARGET_KPA: f64 = 70.0;

/// The ramp that is judged by: another rate, within the calibrated range.
const EXAM_KPA_PER_S: f64 = 1.7;
const EXAM_KPA: f64 = 68.0;

/// Skins: quick and full.
const SKINS: [u64; 2] = [3, 9];

/// Of one recipe at one length.
struct Entry {
    recipe: Recipe,
    length: usize,
    scans: Vec<f64>,
    scores: Vec<Score>,
}

/// All that was measured.
pub struct Simulated {
    entries: Vec<Entry>,
    skins: u64,
}

/// Simulates, fits and judges.
///
/// # Errors
/// A simulation that cannot be set up.
pub fn measure(seed: u64, quick: bool) -> anyhow::Result<Simulated> {
    let skins = SKINS[usize::from(!quick)];
    let mut entries: Vec<Entry> = Vec::new();
    for recipe in Recipe::all() {
        let lengths = 0..STRIDES.len() + RATES_KPA_PER_S.len();
        entries.extend(lengths.map(|length| Entry { recipe, length, scans: vec![], scores: vec![] }));
    }
    for skin in 0..skins {
        let forearm = Forearm::new(seed.wrapping_add(skin))?;
        let plan = forearm.plan()?;
        let exam = sit(forearm.clone(), skin as usize)?;
        let calibrations = calibrations(&forearm);
        for entry in &mut entries {
            let calibration = &calibrations[entry.length];
            let score = one(calibration, entry.recipe, &forearm, &plan, &exam);
            entry.scans.push(calibration.scans as f64);
            entry.scores.push(score);
        }
    }
    Ok(Simulated { entries, skins })
}

fn one(calibration: &Calibration, recipe: Recipe, forearm: &Forearm, plan: &PatchPlan, exam: &Exam) -> Score {
    let models = calibration.fit(&recipe.options(plan));
    judge(calibration.model_set(models, plan), forearm, plan, exam)
}

/// One calibration per length, ascending, each on a copy of the same skin at rest.
fn calibrations(forearm: &Forearm) -> Vec<Calibration> {
    let mut all = Vec::new();
    for (at, rate) in RATES_KPA_PER_S.into_iter().enumerate() {
        let mut copy = forearm.clone();
        let rest = copy.rest();
        let scans = copy.ramp(TARGET_KPA, rate);
        let strides = if at == 0 { [STRIDES.as_slice(), &[1]].concat() } else { vec![1] };
        for stride in strides {
            let some: Vec<&Scan> = scans.iter().step_by(stride).collect();
            all.push(Calibration::new(forearm, rest.clone(), &some));
        }
    }
    all
}

/// What all calibrations of a skin are judged by: after a ramp and venting, a ramp and then masses on another copy.
fn sit(mut forearm: Forearm, skin: usize) -> anyhow::Result<Exam> {
    forearm.ramp(TARGET_KPA, RATES_KPA_PER_S[0]);
    forearm.vent();
    let ramp = (forearm.rest(), forearm.ramp(EXAM_KPA, EXAM_KPA_PER_S));
    forearm.vent();
    let rest = forearm.rest();
    let weighings = forearm.weigh_all(skin)?;
    Ok(Exam { ramp, weighings: (rest, weighings) })
}

impl Entry {
    fn at(&self, share: f64, of: impl Fn(&Score) -> f64) -> f64 {
        quantile(&self.scores.iter().map(of).collect::<Vec<_>>(), share)
    }

    fn median(&self, of: impl Fn(&Score) -> f64) -> f64 {
        self.at(0.5, of)
    }

    fn scans(&self) -> f64 {
        median(&self.scans)
    }
}

impl Simulated {
    /// The entries of a recipe, by length.
    fn of(&self, recipe: Recipe) -> impl Iterator<Item = &Entry> {
        self.entries.iter().filter(move |entry| entry.recipe == recipe)
    }

    /// What came out, in words.
    pub fn sentences(&self) -> Vec<String> {
        let Some(ours) = Recipe::all().into_iter().find(Recipe::is_default) else { return Vec::new() };
        let entries: Vec<&Entry> = self.of(ours).collect();
        let (Some(first), Some(last)) = (entries.get(STRIDES.len()), entries.last()) else { return Vec::new() };
        let longest = || self.entries.iter().filter(|entry| entry.length == last.length);
        let least = |of: fn(&Score) -> f64| longest().map(|entry| entry.median(of)).fold(f64::INFINITY, f64::min);
        let most = |of: fn(&Score) -> f64| longest().map(|entry| entry.median(of)).fold(0.0, f64::max);
        let percent = |entry: &Entry| entry.median(|score| score.weight_percent);
        let kpa = |entry: &Entry| entry.median(|score| score.rmse_kpa);
        vec![
            format!(
                "On {} simulated forearms `{}` reads a ramp that it never saw within {:.2} kPa after a \
                 calibration of {:.0} scans and within {:.2} kPa after {:.0}; known masses within {:.1} and {:.1} %. \
                 Medians over the skins.",
                self.skins,
                ours.name(),
                kpa(first),
                first.scans(),
                kpa(last),
                last.scans(),
                percent(first),
                percent(last)
            ),
            format!(
                "After the longest calibration the eight recipes lie between {:.2} and {:.2} kPa, and between {:.1} and \
                 {:.1} % under known masses.",
                least(|score| score.rmse_kpa),
                most(|score| score.rmse_kpa),
                least(|score| score.weight_percent),
                most(|score| score.weight_percent),
            ),
        ]
    }

    /// Three diagrams over the calibration length.
    pub fn figures(&self) -> Vec<Figure> {
        let skins = self.skins;
        let figure = |id: &str, title: &str, caption: String, label: &str, of: fn(&Score) -> f64| Figure {
            id: id.to_owned(),
            title: format!("Length of a calibration against the error of {title}"),
            caption: format!("{caption} Medians over {skins} simulated forearms."),
            x: Axis::log("calibration length, scans"),
            y: Axis::log(label),
            lines: Recipe::all().into_iter().map(|recipe| self.line(recipe, of)).collect(),
            ..Figure::default()
        };
        let lengths = "Ramps to 70 kPa at 20 scans a second; below 280 scans every second and every fourth scan of the \
                       fastest. Fewer than 280 samples are never binned.";
        vec![
            figure(
                "b-sim-pressure",
                "a taxel's pressure",
                format!("Error of the pressure on an independent rising ramp, root mean square. {lengths}"),
                "pressure error, kPa",
                |score| score.rmse_kpa,
            ),
            figure(
                "b-sim-ramp-force",
                "the sum under the bag",
                "Error of the sum over all usable taxels on that ramp above 5 kPa: what all taxels have in common."
                    .to_owned(),
                "total force error under the bag, %",
                |score| score.ramp_force_percent,
            ),
            figure(
                "b-sim-weight",
                "the force",
                format!(
                    "Error of the engine's total force under masses of 0.2 to 1 kg at {} places, with the activation \
                     threshold and filled taxels as in use.",
                    MASSES_KG.len() * PLACES
                ),
                "force error under known masses, %",
                |score| score.weight_percent,
            ),
        ]
    }

    fn line(&self, recipe: Recipe, of: fn(&Score) -> f64) -> Line {
        let point = |entry: &Entry| Point { x: entry.scans(), y: entry.median(of), ..Point::default() };
        let points = self.of(recipe).map(point).collect();
        Line { name: recipe.name(), ours: recipe.is_default(), points, ..Line::default() }
    }

    /// All figures with their spread.
    pub fn table(&self) -> Table {
        let columns = ["recipe", "scans", "pressure, kPa", "ramp force, %", "masses, %", "usable of 230"];
        let row = |entry: &Entry| {
            let figures: [fn(&Score) -> f64; 3] = [|s| s.rmse_kpa, |s| s.ramp_force_percent, |s| s.weight_percent];
            let spreads = figures.map(|of| {
                let [low, middle, high] = [0.0, 0.5, 1.0].map(|share| three_digits(entry.at(share, of)));
                Cell::from(format!("{middle} ({low} to {high})"))
            });
            let usable = Cell::from(entry.median(|score| score.usable as f64));
            row![entry.recipe.name(), entry.scans()].into_iter().chain(spreads).chain([usable]).collect()
        };
        let caption = format!("Median, least and most over {} simulated forearms.", self.skins);
        Table::new("b-sim", caption, columns, self.entries.iter().map(row).collect())
    }
}
