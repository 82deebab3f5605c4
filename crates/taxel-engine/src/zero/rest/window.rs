//! What was seen of a skin while it was watched: each taxel, and the mean of each module's taxels, as a whole and by halves.
//!
//! How noisy a module's mean is, is measured on the mean itself. The converter of a real module moves all of its taxels at
//! once: on the recorded insole at rest the mean of ten has twice the variance of ten that are independent
//! (`insole_tests.rs`), which would refuse true rests.

use std::f64::consts::FRAC_1_SQRT_2;
use std::ops::Range;

use super::limits::{NOISE_MIN_COUNTS, STEADY_COUNTS_MAX, STEADY_ERRORS_MAX};
use super::statistics::RestStatistics;
use crate::baseline::TaxelBaseline;
use crate::statistics::median;

/// Fewest taxels of a module that make a mean.
const TAXELS_MIN: usize = 5;

/// A window of scans.
#[derive(Clone, Debug, Default)]
pub struct RestWindow {
    modules: Vec<Range<usize>>,
    all: RestStatistics,
    halves: [RestStatistics; 2],
    /// What taxels with a fault read.
    faulty: RestStatistics,
    /// The means of the modules, from what each taxel read first: its own zero is no part of how far a module moved, whichever taxels
    /// are read.
    means: [RestStatistics; 2],
    first: Vec<Option<f64>>,
}

impl RestWindow {
    /// No scan yet. `modules` says which taxels form a module.
    pub fn new(taxels: usize, modules: &[Range<usize>]) -> Self {
        let [of_taxels, of_modules] = [taxels, modules.len()].map(RestStatistics::new);
        Self {
            modules: modules.to_vec(),
            all: of_taxels.clone(),
            halves: [of_taxels.clone(), of_taxels.clone()],
            faulty: of_taxels,
            means: [of_modules.clone(), of_modules],
            first: vec![None; taxels],
        }
    }

    /// Takes one scan of the earlier or the later half; `None` where a taxel gave nothing usable.
    pub fn push(&mut self, late: bool, scan: impl Iterator<Item = Option<f64>>) {
        let scan: Vec<Option<f64>> = scan.map(|count| count.filter(|count| count.is_finite())).collect();
        let half = usize::from(late);
        let moved = self.first.iter_mut().zip(&scan);
        let moved = moved.map(|(first, &count)| count.map(|count| count - *first.get_or_insert(count)));
        let moved: Vec<Option<f64>> = moved.collect();
        let of = |range: &Range<usize>| mean_of_most(moved.get(range.clone()).unwrap_or_default());
        self.means[half].push(self.modules.iter().map(of));
        self.halves[half].push(scan.iter().copied());
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
    pub const fn all(&self) -> &RestStatistics {
        &self.all
    }

    /// Which taxels form each module.
    pub fn modules(&self) -> &[Range<usize>] {
        &self.modules
    }

    /// The earlier and the later half.
    pub(in crate::zero) const fn halves(&self) -> &[RestStatistics; 2] {
        &self.halves
    }

    /// Standard error of how far a taxel moved from half to half, as a factor of its noise.
    pub(super) fn halves_error(&self) -> f64 {
        RestStatistics::error_between(&self.halves)
    }

    /// Mean and noise per taxel. A taxel that moved while it was watched has none: one may move without the skin being called
    /// restless, and what it reads in the mean may hide a load that came meanwhile.
    pub fn steady_baseline(&self) -> Vec<TaxelBaseline> {
        let [early, late] = self.halves.each_ref().map(RestStatistics::baseline);
        let share = self.halves_error();
        // Ten readings tell little of a taxel's noise, but those of all taxels together do.
        let pooled = |(early, late): (&TaxelBaseline, &TaxelBaseline)| early.noise.hypot(late.noise) * FRAC_1_SQRT_2;
        let typical = median(early.iter().zip(&late).map(pooled)).unwrap_or(0.0);
        let least = typical.max(NOISE_MIN_COUNTS);
        let steady = |(all, (early, late)): (TaxelBaseline, (TaxelBaseline, TaxelBaseline))| {
            // A ramp within a half is no noise of the taxel's: the quieter half tells.
            let noise = early.noise.min(late.noise).max(least);
            let moved = (late.mean - early.mean).abs();
            let moves = moved > STEADY_COUNTS_MAX && moved > STEADY_ERRORS_MAX * noise * share;
            if moves { TaxelBaseline::UNKNOWN } else { all }
        };
        self.all.baseline().into_iter().zip(early.into_iter().zip(late)).map(steady).collect()
    }

    /// How unlike each other the modules moved from half to half, as a standard normal deviate; `None` where fewer than two
    /// modules can be read in both. A light load that comes over a wide part of a skin moves each module by less than its own
    /// noise explains, and all modules together tell.
    ///
    /// What the median module moved by is taken off first: warmth moves all. The deviate is that of a chi-square with one
    /// degree of freedom less than there are modules (Wilson and Hilferty, The Distribution of Chi-Square, 1931).
    pub(super) fn unlikeness(&self) -> Option<f64> {
        if self.halves.iter().any(|half| half.count() < 2) {
            return None;
        }
        let [early, late] = self.means.each_ref().map(RestStatistics::baseline);
        let least = NOISE_MIN_COUNTS / (TAXELS_MIN as f64).sqrt();
        let read = early.iter().zip(&late).filter(|(early, late)| early.mean.is_finite() && late.mean.is_finite());
        let moved: Vec<(f64, f64)> = read
            .map(|(early, late)| (late.mean - early.mean, (early.noise.hypot(late.noise) * FRAC_1_SQRT_2).max(least)))
            .collect();
        let common = median(moved.iter().map(|(moved, _)| *moved))?;
        let freedom = moved.len().checked_sub(1).filter(|freedom| *freedom > 0)? as f64;
        let errors = |(moved, noise): &(f64, f64)| (moved - common) / (noise * self.halves_error());
        let chi_square: f64 = moved.iter().map(|moved| errors(moved).powi(2)).sum();
        let variance = 2.0 / (9.0 * freedom);
        Some(((chi_square / freedom).cbrt() - (1.0 - variance)) / variance.sqrt())
    }
}

/// The mean of what taxels moved by, without that which moved furthest up and that which moved furthest down: a broken one
/// does not speak for its module. `None` if too few are read.
fn mean_of_most(moved: &[Option<f64>]) -> Option<f64> {
    let mut read: Vec<f64> = moved.iter().copied().flatten().collect();
    if read.len() < TAXELS_MIN {
        return None;
    }
    read.sort_by(f64::total_cmp);
    let most = &read[1..read.len() - 1];
    Some(most.iter().sum::<f64>() / most.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::super::limits::UNLIKENESS_MAX;
    use super::super::tests::Noise;
    use super::*;

    /// A second of 20 scans of so many modules with ten taxels each, which read `level(taxel, late)` counts, beside their own
    /// noise and so much that is their module's.
    fn watched(noise: &mut Noise, modules: usize, own: f64, level: impl Fn(usize, bool) -> f64) -> Option<f64> {
        let ranges: Vec<Range<usize>> = (0..modules).map(|module| 10 * module..10 * module + 10).collect();
        let mut window = RestWindow::new(10 * modules, &ranges);
        for scan in 0..20 {
            let shaken: Vec<f64> = (0..modules).map(|_| own * noise.normal()).collect();
            let count = |taxel: usize| 240.0 + level(taxel, scan >= 10) + noise.normal() + shaken[taxel / 10];
            window.push(scan >= 10, (0..10 * modules).map(count).map(Some));
        }
        window.unlikeness()
    }

    fn refused(modules: usize, own: f64, level: impl Fn(usize, bool) -> f64) -> usize {
        let mut noise = Noise(31);
        let seconds = (0..1_000).map(|_| watched(&mut noise, modules, own, &level).unwrap());
        seconds.filter(|unlike| *unlike > UNLIKENESS_MAX).count()
    }

    #[test]
    fn chance_refuses_no_rest_whatever_moves_all_or_shakes_a_module() {
        for (modules, own, warmth) in [(2, 0.0, 0.0), (5, 0.0, 0.0), (23, 0.0, 0.0), (23, 0.5, 0.0), (23, 0.0, 9.0)] {
            let refused = refused(modules, own, |_, late| if late { warmth } else { 0.0 });
            assert!(refused <= 3, "{modules} modules that shake by {own}: {refused} of 1,000");
        }
    }

    #[test]
    fn a_broken_taxel_is_no_load_and_one_module_alone_has_nothing_to_be_unlike() {
        let broken = |taxel, late| if late && taxel == 7 { 1e6 } else { 0.0 };
        let unlike = watched(&mut Noise(32), 5, 0.0, broken).unwrap();
        assert!(unlike < UNLIKENESS_MAX, "{unlike}");
        assert_eq!(watched(&mut Noise(32), 1, 0.0, broken), None);
        assert_eq!(RestWindow::default().unlikeness(), None);
    }

    #[test]
    fn a_taxel_that_is_read_at_times_moves_no_module() {
        let mut window = RestWindow::new(20, &[0..10, 10..20]);
        for scan in 0..20 {
            let at_times = |taxel: usize| (taxel != 3 || scan > 12).then_some(if taxel == 3 { 90.0 } else { 240.0 });
            window.push(scan >= 10, (0..20).map(at_times));
        }
        assert!(window.unlikeness().unwrap() < 0.0);
    }
}
