//! How a recording is made into models: the recipes that are compared, and what came of each.

use std::hint::black_box;
use std::sync::Arc;

use taxel_engine::calibration::fit::{Branch, FitRecipe, OneByOne, PlaysChoice, Scans, fit};
use taxel_engine::model_set::ModelSet;
use taxel_model::{Estimator, FitOptions, Order, TaxelModel};

use crate::numbers::{median, timed_us};

/// One way to calibrate.
pub struct Recipe {
    /// As the legend shows it.
    pub name: &'static str,
    /// How is fitted.
    pub fit: FitRecipe,
    /// Every so many scans are fitted.
    pub every: usize,
    /// Only what lies below the source's [`Recording::low_kpa`] is fitted, so that readings go beyond.
    pub low: Option<Beyond>,
}

/// What readings beyond the calibrated range come to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Beyond {
    /// As shipped: the curve goes on with the skin's slope.
    Extended,
    /// The pressure at the range's end.
    Held,
}

impl Recipe {
    /// All that are compared.
    pub fn all() -> Vec<Self> {
        let of = |estimator, order, branch, plays| FitRecipe {
            options: FitOptions { estimator, order, ..FitOptions::default() },
            branch,
            plays,
            ..FitRecipe::default()
        };
        let binned = |order, branch| of(Estimator::PressureBinned, order, branch, PlaysChoice::Off);
        let plays = FitRecipe { plays: PlaysChoice::On, ..FitRecipe::default() };
        let (both, five) = (Branch::Both, Order::Fixed(5));
        let whole = |name, fit| Self { name, fit, every: 1, low: None };
        let low = |name, beyond| Self { low: Some(beyond), ..whole(name, binned(five, both)) };
        vec![
            whole("plays where they win (shipped default, recordings)", FitRecipe::default()),
            Self { every: 8, ..whole("the same from every 8th scan", FitRecipe::default()) },
            whole("rising branch (shipped default, sessions)", binned(five, Branch::Rising)),
            whole("the paper's equation, rising branch", of(Estimator::Paper, five, Branch::Rising, PlaysChoice::Off)),
            whole("both branches", binned(five, both)),
            whole("both branches, order chosen", binned(Order::Auto, both)),
            whole("plays always", plays),
            low("low range, extended beyond it", Beyond::Extended),
            low("low range, held at its end", Beyond::Held),
        ]
    }

    /// Whether it is what `taxeld fit` or a session does unless told otherwise.
    pub fn is_default(&self) -> bool {
        self.name.contains("shipped default")
    }

    /// Whether its forces are those of the paper: equal areas, active taxels only.
    pub fn is_paper(&self) -> bool {
        self.fit.is_paper()
    }
}

/// A calibration recording, column by column; an empty cell is NaN.
#[derive(Clone, Default)]
pub struct Recording {
    /// Time of each scan.
    pub time_s: Vec<f64>,
    /// What the gauge said.
    pub pressure_kpa: Vec<f64>,
    /// By taxel.
    pub counts: Vec<Vec<f64>>,
    /// Where the low range ends.
    pub low_kpa: f64,
}

impl Recording {
    /// What a recipe fits of it.
    fn part(&self, recipe: &Recipe) -> Self {
        let low = |i: &usize| recipe.low.is_none() || self.pressure_kpa[*i] <= self.low_kpa;
        let wanted: Vec<usize> = (0..self.time_s.len()).step_by(recipe.every).filter(low).collect();
        let of = |column: &Vec<f64>| wanted.iter().map(|&i| column[i]).collect();
        let counts = self.counts.iter().map(of).collect();
        Self { time_s: of(&self.time_s), pressure_kpa: of(&self.pressure_kpa), counts, low_kpa: self.low_kpa }
    }

    /// As the engine takes it.
    pub fn scans(&self) -> Scans<'_> {
        Scans {
            time_s: &self.time_s,
            pressure_kpa: Some(&self.pressure_kpa),
            counts: self.counts.iter().map(Vec::as_slice).collect(),
        }
    }

    /// The models of a recipe, the median time of a fit of the whole skin in ms, and how many scans were fitted.
    pub fn fit(&self, recipe: &Recipe, repetitions: usize) -> anyhow::Result<(Arc<ModelSet>, f64, usize)> {
        let part = self.part(recipe);
        let (scans, mut times_ms, mut set) = (part.scans(), Vec::new(), None);
        for _ in 0..repetitions.max(1) {
            let (us, fitted) = timed_us(|| fit(&scans, &recipe.fit, &OneByOne));
            set = Some(fitted?);
            times_ms.push(1e-3 * us);
        }
        let set = set.map(Arc::new).ok_or_else(|| anyhow::anyhow!("nothing was fitted"))?;
        Ok((set, median(&times_ms), part.time_s.len()))
    }
}

/// The calibrated end of a model towards pressure: the count, and the pressure there in kPa.
pub fn end_of(model: &TaxelModel) -> Option<(f64, f64)> {
    let at = |count: f64| Some((count, model.evaluate(count)?.kpa));
    let [one, other] = model.range?;
    [at(one)?, at(other)?].into_iter().max_by(|a, b| a.1.total_cmp(&b.1))
}

/// What came of a recipe.
pub struct Outcome {
    /// How many scans were fitted.
    pub scans: usize,
    /// Taxels with a usable model.
    pub usable: usize,
    /// Time of a fit of the whole skin, ms: the median.
    pub fit_ms: f64,
    /// Time from the counts of a scan to its force, us: the median.
    pub scan_us: f64,
    /// Error of the force on what the fit never saw, percent, one for each exam of the source.
    pub force_percent: Vec<f64>,
}

/// One skin with all its outcomes, in the order of [`Recipe::all`].
pub struct Source {
    /// Short and stable.
    pub id: &'static str,
    /// What skin, for titles.
    pub skin: &'static str,
    /// What was fitted and what it was judged by.
    pub caption: String,
    /// Headings of the exams.
    pub exams: Vec<&'static str>,
    /// What was promised for each of the shipped default for recordings, percent at most; empty for nothing.
    pub promised_percent: Vec<f64>,
    /// By recipe.
    pub outcomes: Vec<Outcome>,
}

/// Median time of `read` for a scan, us: all scans are read in turn, so many times.
pub fn scan_us(scans: &[Vec<u8>], repetitions: usize, mut read: impl FnMut(&[u8]) -> f64) -> f64 {
    let mut times_us = Vec::new();
    for _ in 0..=repetitions {
        let (us, ()) = timed_us(|| {
            for counts in scans {
                black_box(read(black_box(counts)));
            }
        });
        times_us.push(us / scans.len() as f64);
    }
    // The first round warms up.
    median(&times_us[1..])
}
