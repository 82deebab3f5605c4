//! Section `model`: how long to calibrate, with which estimator and which order, on simulated forearms and judged on data
//! that no fit saw. Recordings of a real skin are in [`crate::force`].

use taxel_engine::plan::PatchPlan;

use crate::document::{Axis, Cell, Figure, Line, Point, Section, Table, row};
use crate::numbers::{median, quantile, three_digits};
use crate::options::Options;
use crate::rig::fits::{Calibration, Exam, Recipe, Score, judge};
use crate::rig::{Forearm, MASSES_KG, PLACES};

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
struct Simulated {
    entries: Vec<Entry>,
    skins: u64,
}

/// Measures the section.
///
/// # Errors
/// A simulation that cannot be set up.
pub fn section(options: &Options) -> anyhow::Result<Section> {
    let simulated = measure(options.seed, options.quick)?;
    let mut text = vec![
        "How far pressures and forces are off on data that no fit saw, by the length of the calibration. The skin in the \
         bag is the simulator's, whose physics shares nothing with what is fitted: friction, creep, drift of \
         temperature, noise and rounding are in it. Every calibration of a skin starts from the same rest, and all are \
         judged on the same later ramp and the same weighings, each with a zero of its own before it."
            .to_owned(),
    ];
    text.extend(simulated.sentences());
    Ok(Section { text, figures: vec![simulated.figure()], tables: vec![simulated.table()], ..Section::default() })
}

/// Simulates, fits and judges.
///
/// # Errors
/// A simulation that cannot be set up.
fn measure(seed: u64, quick: bool) -> anyhow::Result<Simulated> {
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
            all.push(Calibration::new(forearm, rest.clone(), scans.iter().step_by(stride)));
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
    fn sentences(&self) -> Vec<String> {
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

    /// The force over the calibration length.
    fn figure(&self) -> Figure {
        Figure {
            id: "model-weight".to_owned(),
            title: "Length of a calibration against the error of the force".to_owned(),
            caption: format!(
                "Error of the engine's total force under masses of 0.2 to 1 kg at {} places, with the activation threshold and \
                 filled taxels as in use. Ramps to 70 kPa at 20 scans a second; below 280 scans every second and every fourth \
                 scan of the fastest. Fewer than 280 samples are never binned. Medians over {} simulated forearms.",
                MASSES_KG.len() * PLACES,
                self.skins,
            ),
            x: Axis::log("calibration length, scans"),
            y: Axis::linear("force error under known masses, %"),
            lines: Recipe::all().into_iter().map(|recipe| self.line(recipe, |score| score.weight_percent)).collect(),
            ..Figure::default()
        }
    }

    fn line(&self, recipe: Recipe, of: fn(&Score) -> f64) -> Line {
        let point = |entry: &Entry| Point { x: entry.scans(), y: entry.median(of), ..Point::default() };
        let points = self.of(recipe).map(point).collect();
        Line { name: recipe.name(), ours: recipe.is_default(), points, ..Line::default() }
    }

    /// All figures with their spread.
    fn table(&self) -> Table {
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
        let caption = format!(
            "Median, least and most over {} simulated forearms: the pressure of a taxel on an unseen ramp, root mean square; \
             the sum over all usable taxels on that ramp above 5 kPa, which is what they have in common; masses.",
            self.skins
        );
        Table::new("model-lengths", caption, columns, self.entries.iter().map(row).collect())
    }
}
