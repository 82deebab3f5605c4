//! Calibration length against held-out error on simulated forearms.

use taxel_engine::plan::PatchPlan;

use crate::document::{Axis, Cell, Figure, Line, Point, Table};
use crate::held_out::fits::{Calibration, Exam, Recipe, Score, judge};
use crate::held_out::forearm::{Forearm, Scan};
use crate::live::measure::Spread;

/// Ramps to 70 kPa that take 14, 28, 56, 112 and 224 s: 5 kPa/s is the fastest that a session accepts.
const RATES_KPA_PER_S: [f64; 5] = [5.0, 2.5, 1.25, 0.625, 0.3125];

/// Of the fastest ramp also every fourth and every second scan, as slower boards would send.
const STRIDES: [usize; 2] = [4, 2];

/// End of the ramps that are fitted, kPa.
const TARGET_KPA: f64 = 70.0;

/// The ramp that is judged by: another rate, within the calibrated range.
const EXAM_KPA_PER_S: f64 = 1.7;
const EXAM_KPA: f64 = 68.0;

/// The masses of the paper's validation, kg, and the places that each is laid on.
const MASSES_KG: [f64; 5] = [0.2, 0.4, 0.6, 0.8, 1.0];
const PLACES: usize = 4;

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
        let exam = sit(forearm.clone(), skin)?;
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
fn sit(mut forearm: Forearm, skin: u64) -> anyhow::Result<Exam> {
    forearm.ramp(TARGET_KPA, RATES_KPA_PER_S[0]);
    forearm.vent();
    let ramp = (forearm.rest(), forearm.ramp(EXAM_KPA, EXAM_KPA_PER_S));
    forearm.vent();
    let rest = forearm.rest();
    let mut weighings = Vec::new();
    for (m, kilogram) in MASSES_KG.into_iter().enumerate() {
        for place in 0..PLACES {
            // Evenly spread, a few taxels on with each mass and skin, so that no place is special.
            let centre = (place * forearm.taxels() / PLACES + 20 * m + 7 * skin as usize) % forearm.taxels();
            weighings.push(forearm.weigh(kilogram, centre)?);
        }
    }
    Ok(Exam { ramp, weighings: (rest, weighings) })
}

impl Entry {
    fn spread(&self, of: impl Fn(&Score) -> f64) -> Spread {
        Spread::of(self.scores.iter().map(of).collect())
    }

    fn scans(&self) -> f64 {
        Spread::of(self.scans.clone()).median
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
        let least =
            |of: fn(&Score) -> f64| longest().map(|entry| entry.spread(of).median).fold(f64::INFINITY, f64::min);
        let most = |of: fn(&Score) -> f64| longest().map(|entry| entry.spread(of).median).fold(0.0, f64::max);
        let percent = |entry: &Entry| entry.spread(|score| score.weight_percent).median;
        let kpa = |entry: &Entry| entry.spread(|score| score.rmse_kpa).median;
        vec![
            format!(
                "On {} simulated forearms the default ({}) reads a ramp that it never saw within {:.2} kPa after a \
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
        let figure = |id: &str, caption: String, label: &str, of: fn(&Score) -> f64| Figure {
            id: id.to_owned(),
            caption: format!("{caption} Medians over {skins} simulated forearms."),
            x: Axis { label: "calibration length, scans".to_owned(), log: true },
            y: Axis { label: label.to_owned(), log: true },
            lines: Recipe::all().into_iter().map(|recipe| self.line(recipe, of)).collect(),
            bands: Vec::new(),
        };
        let lengths = "Ramps to 70 kPa at 20 scans a second; below 280 scans every second and every fourth scan of the \
                       fastest. Fewer than 280 samples are never binned.";
        vec![
            figure(
                "b-sim-pressure",
                format!("Error of the pressure on an independent rising ramp, root mean square. {lengths}"),
                "pressure error, kPa",
                |score| score.rmse_kpa,
            ),
            figure(
                "b-sim-ramp-force",
                "Error of the sum over all usable taxels on that ramp above 5 kPa: what all taxels have in common."
                    .to_owned(),
                "total force error under the bag, %",
                |score| score.ramp_force_percent,
            ),
            figure(
                "b-sim-weight",
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
        let mark = match recipe.order {
            taxel_model::Order::Fixed(order) => order.to_string(),
            taxel_model::Order::Auto => "auto".to_owned(),
        };
        let point = |entry: &Entry| Point {
            x: entry.scans(),
            y: entry.spread(of).median,
            mark: mark.clone(),
            ..Point::default()
        };
        Line { name: recipe.name(), ours: recipe.is_default(), points: self.of(recipe).map(point).collect() }
    }

    /// All figures with their spread.
    pub fn table(&self) -> Table {
        let columns = [
            "recipe",
            "scans",
            "pressure, kPa",
            "least",
            "most",
            "ramp force, %",
            "least",
            "most",
            "masses, %",
            "least",
            "most",
            "usable of 230",
        ];
        let row = |entry: &Entry| {
            let figures: [fn(&Score) -> f64; 3] = [|s| s.rmse_kpa, |s| s.ramp_force_percent, |s| s.weight_percent];
            let spreads = figures.iter().flat_map(|of| {
                let spread = entry.spread(of);
                [spread.median, spread.p5, spread.p95].map(Cell::Number)
            });
            let head = [Cell::Text(entry.recipe.name()), Cell::Number(entry.scans())];
            let usable = Cell::Number(entry.spread(|score| score.usable as f64).median);
            head.into_iter().chain(spreads).chain([usable]).collect()
        };
        Table {
            id: "b-sim".to_owned(),
            caption: format!("Median, least and most over {} simulated forearms.", self.skins),
            columns: columns.map(str::to_owned).into(),
            rows: self.entries.iter().map(row).collect(),
        }
    }
}
