//! What the figures are drawn from: scans of a calibration, and known loads that were read.

use std::ops::Range;

use taxel_engine::calibration::fit::legs::{Leg, legs, rising};
use taxel_model::{FitOptions, Samples, TaxelModel, fit};

use crate::numbers::mean;

/// Within this share of the range above the least pressure the skin is unloaded.
const UNLOADED_BAND: f64 = 0.02;

/// Bins over the whole range of pressure: half a kilopascal each for the paper's 70.
const BINS: usize = 140;

/// A leg with fewer scans is no branch.
const BRANCH_SCANS_MIN: usize = 20;

/// A known load and what was read under it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Weighing {
    /// The mass, if one was laid on.
    pub kilogram: Option<f64>,
    /// The force that it presses with, N.
    pub true_n: f64,
    /// The force read, N.
    pub measured_n: f64,
}

/// Known loads that were read in one way.
#[derive(Clone, Debug, Default)]
pub(super) struct Weighings {
    /// Which models, and how their pressures are summed, in words.
    pub by: String,
    /// All of them.
    pub all: Vec<Weighing>,
}

/// Scans of a skin under a changing pressure, and known loads.
#[derive(Clone, Debug)]
pub(super) struct Data {
    /// Where the scans are from, in words.
    pub source: String,
    /// Pressure of each scan.
    kpa: Vec<f64>,
    /// By taxel; NaN where there is no reading.
    counts: Vec<Vec<f64>>,
    legs: Vec<Leg>,
    rising: Vec<bool>,
    /// Known loads by the way they were read; empty without any.
    pub loads: Vec<Weighings>,
}

impl Data {
    /// Scans of which each taxel has `counts`; all columns are of the same length. `source` says in words where they are
    /// from.
    pub fn new(source: String, kpa: Vec<f64>, counts: Vec<Vec<f64>>) -> Self {
        let legs = legs(&kpa);
        let rising = rising(&kpa, &legs);
        Self { source, counts, legs, rising, kpa, loads: Vec::new() }
    }

    /// How many taxels.
    pub fn taxels(&self) -> usize {
        self.counts.len()
    }

    /// How many scans.
    pub fn scans(&self) -> usize {
        self.kpa.len()
    }

    /// (pressure in kPa, count) of a taxel at those `scans` of which `wanted` says so, in order.
    pub fn samples(
        &self,
        taxel: usize,
        scans: Range<usize>,
        wanted: impl Fn(usize) -> bool,
    ) -> impl Iterator<Item = (f64, f64)> {
        let all = scans.filter(move |i| wanted(*i)).map(move |i| (self.kpa[i], self.counts[taxel][i]));
        all.filter(|(p, c)| p.is_finite() && c.is_finite())
    }

    /// The samples of rising pressure: what the paper fits.
    pub fn risen(&self, taxel: usize) -> impl Iterator<Item = (f64, f64)> {
        self.samples(taxel, 0..self.scans(), |i| self.rising[i])
    }

    /// The branches of one way, each with enough scans to be one.
    pub fn branches(&self, up: bool) -> impl Iterator<Item = &Range<usize>> {
        let long = move |leg: &&Leg| leg.rising == up && leg.scans.len() >= BRANCH_SCANS_MIN;
        self.legs.iter().filter(long).map(|leg| &leg.scans)
    }

    /// The first rise and the fall right after it.
    pub fn run_with_both(&self) -> Option<(&Range<usize>, &Range<usize>)> {
        let fall_of = |rise: &Range<usize>| self.branches(false).find(|fall| fall.start == rise.end);
        self.branches(true).find_map(|rise| Some((rise, fall_of(rise)?)))
    }

    /// Mean pressure and mean count of the samples in each bin of equal pressure, as the paper averages them.
    pub fn binned(&self, samples: impl Iterator<Item = (f64, f64)>) -> Vec<Option<(f64, f64)>> {
        let (low, high) = self.range_kpa();
        let mut sums = vec![(0.0, 0.0, 0.0); BINS];
        for (kpa, count) in samples {
            // A range of nothing has one bin: what is no number is 0 as an integer.
            let at = ((kpa - low) / (high - low) * BINS as f64) as usize;
            let (n, p, c) = sums[at.min(BINS - 1)];
            sums[at.min(BINS - 1)] = (n + 1.0, p + kpa, c + count);
        }
        sums.into_iter().map(|(n, p, c)| (n > 0.0).then_some((p / n, c / n))).collect()
    }

    /// A taxel's means over one branch.
    pub fn branch(&self, taxel: usize, scans: &Range<usize>) -> Vec<Option<(f64, f64)>> {
        self.binned(self.samples(taxel, scans.clone(), |_| true))
    }

    /// Least and greatest pressure, kPa.
    pub fn range_kpa(&self) -> (f64, f64) {
        let finite = self.kpa.iter().copied().filter(|p| p.is_finite());
        finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
    }

    /// A taxel's mean count unloaded, before the first rise; NaN without a reading there.
    pub fn baseline(&self, taxel: usize) -> f64 {
        let (low, high) = self.range_kpa();
        let limit = low + UNLOADED_BAND * (high - low);
        let end = self.branches(true).next().map_or(self.scans(), |rise| rise.end);
        mean(self.samples(taxel, 0..end, |_| true).filter(|(p, _)| *p <= limit).map(|(_, count)| count))
    }

    /// The paper's models: its equation of order 5 over the rising samples, excluded by swing.
    pub fn models(&self, min_swing_counts: f64) -> Vec<TaxelModel> {
        let options = FitOptions { paper: true, min_swing_counts, ..FitOptions::default() };
        let model = |taxel: usize| {
            let (kpa, counts): (Vec<f64>, Vec<f64>) = self.risen(taxel).unzip();
            fit(&Samples::new(&counts, &kpa), &options)
        };
        (0..self.taxels()).map(model).collect()
    }
}
