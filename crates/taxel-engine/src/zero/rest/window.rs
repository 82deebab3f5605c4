//! What was seen of a skin while it was watched.

use std::f64::consts::FRAC_1_SQRT_2;
use std::ops::Range;

use super::statistics::{NOISE_FLOOR_COUNTS, RestStatistics, STEADY_COUNTS_MAX, STEADY_ERRORS_MAX, error_between};
use super::unlike::ModuleMeans;
use crate::baseline::TaxelBaseline;
use crate::statistics::median;

/// A window of scans, as a whole and by halves.
#[derive(Clone, Debug, Default)]
pub struct RestWindow {
    all: RestStatistics,
    halves: [RestStatistics; 2],
    /// What taxels with a fault read.
    faulty: RestStatistics,
    means: ModuleMeans,
}

impl RestWindow {
    /// No scan yet. `modules` says which taxels form a module.
    #[must_use]
    pub fn new(taxels: usize, modules: &[Range<usize>]) -> Self {
        let empty = || RestStatistics::new(taxels).in_modules(modules.iter().cloned());
        let means = ModuleMeans::new(taxels, modules.len());
        Self { all: empty(), halves: [empty(), empty()], faulty: empty(), means }
    }

    /// Takes one scan of the earlier or the later half; `None` where a taxel gave nothing usable.
    pub fn push(&mut self, late: bool, scan: impl Iterator<Item = Option<f64>>) {
        let scan: Vec<Option<f64>> = scan.collect();
        self.halves[usize::from(late)].push(scan.iter().copied());
        self.means.push(late, &scan, self.all.modules());
        self.all.push(scan);
    }

    /// What those taxels read in the same scan that gave nothing usable: they have no zero, but may stand at a rail under a
    /// load.
    pub fn push_faulty(&mut self, scan: impl Iterator<Item = Option<f64>>) {
        self.faulty.push(scan);
    }

    /// The taxels with a fault.
    pub(super) const fn faulty(&self) -> &RestStatistics {
        &self.faulty
    }

    /// The whole window.
    #[must_use]
    pub const fn all(&self) -> &RestStatistics {
        &self.all
    }

    /// Mean and noise per taxel. A taxel that moved while it was watched has none: one may move without the skin being called
    /// restless, and what it reads in the mean may hide a load that came meanwhile.
    #[must_use]
    pub fn steady_baseline(&self) -> Vec<TaxelBaseline> {
        let [early, late] = self.halves.each_ref().map(RestStatistics::baseline);
        let share = self.halves_error();
        // Ten readings tell little of a taxel's noise, but those of all taxels together do.
        let pooled = |(early, late): (&TaxelBaseline, &TaxelBaseline)| early.noise.hypot(late.noise) * FRAC_1_SQRT_2;
        let typical = median(early.iter().zip(&late).map(pooled).filter(|noise| noise.is_finite())).unwrap_or(0.0);
        let least = typical.max(NOISE_FLOOR_COUNTS);
        let steady = |(all, (early, late)): (TaxelBaseline, (TaxelBaseline, TaxelBaseline))| {
            // A ramp within a half is no noise of the taxel's: the quieter half tells.
            let noise = early.noise.min(late.noise).max(least);
            let moved = (late.mean - early.mean).abs();
            let moves = moved > STEADY_COUNTS_MAX && moved > STEADY_ERRORS_MAX * noise * share;
            if moves { TaxelBaseline::UNKNOWN } else { all }
        };
        self.all.baseline().into_iter().zip(early.into_iter().zip(late)).map(steady).collect()
    }

    /// Standard error of how far a taxel moved from half to half, as a factor of its noise.
    pub(super) fn halves_error(&self) -> f64 {
        error_between(&self.halves)
    }

    /// How unlike each other the modules moved from half to half, as [`ModuleMeans::unlikeness`] says.
    #[must_use]
    pub(super) fn unlikeness(&self) -> Option<f64> {
        self.means.unlikeness()
    }

    /// Whether each half has scans enough to be compared with the other.
    pub(super) fn has_both_halves(&self) -> bool {
        self.halves.iter().all(|half| half.count() > 1)
    }

    /// The earlier and the later half.
    #[must_use]
    pub const fn halves(&self) -> &[RestStatistics; 2] {
        &self.halves
    }
}
