//! From sound scans to models of a whole skin: what `taxel-lab fit` and a session have in common.

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

use taxel_model::{
    Accumulator, FitOptions, FixedPressure, Flag, Plays, Samples, Status, TaxelModel, Workers, map, student_975,
};

use crate::calibration::branch::{Branch, PlaysChoice};
use crate::calibration::fit::course::Course;
use crate::calibration::fit::hysteresis;
use crate::calibration::fit::masks::Masks;
use crate::calibration::fit::recipe_options::FitRecipe;
use crate::calibration::fit::scans::{Scans, is_byte};
use crate::calibration::fit::smooth::half_width;
use crate::calibration::fit::smooth::smooth;
use crate::intake::faults::fault::Fault;
use crate::model_set::RecordedTaxel;
use crate::statistics::{quantile, root_mean_square};

/// A taxel that must be left out of more of the scans than this is not fitted.
pub(crate) const MASKED_MAX: f64 = 0.3;

/// A taxel whose error is so many times the median over the taxels is broken in a way that has no name.
const POOR_FIT_RATIO: f64 = 2.5;

/// Plays are switched on if they leave at most so much of the error on the branch that was not fitted.
const PLAYS_WIN_BELOW: f64 = 0.9;

/// Scans with all that is known of them, ready to be fitted.
pub(crate) struct SkinFit<'a> {
    /// The scans; all counts refer to one zero.
    pub scans: &'a Scans<'a>,
    /// What of them must not be believed.
    pub masks: Masks,
    /// Pressure that belongs to each scan, kPa; NaN where there is none.
    pub kpa: Vec<f64>,
    /// Ramps and branches.
    pub course: Course,
    recipe: &'a FitRecipe,
    /// Scans on each side of the mean that the models see in use.
    half_scans: usize,
}

/// What came of the fit.
pub(crate) struct FittedSkin {
    /// One model per taxel.
    pub models: Vec<TaxelModel>,
    /// What is known of each taxel in use; `None` where it is not fitted or never moved while the pressure did.
    pub in_use: Vec<Option<RecordedTaxel>>,
    /// Whether hysteresis is compensated.
    pub plays_on: bool,
    /// Median error with plays over that without on what was held out, if something was.
    pub plays_error_ratio: Option<f64>,
}

impl FittedSkin {
    /// The taxels whose model may be used.
    pub(crate) fn usable(&self) -> Vec<usize> {
        (0..self.models.len()).filter(|&t| self.models[t].is_usable()).collect()
    }
}

/// A taxel's static curve with its figures in use: RMSE in kPa, NaN without a curve that may be used, hysteresis, and counts
/// per kPa, if it ever moved while the pressure did.
struct FittedTaxel {
    model: TaxelModel,
    rmse_kpa: f64,
    hysteresis_kpa: Option<f64>,
    sensitivity: Option<f64>,
}

impl FittedTaxel {
    /// Whether the curve may be used, or nothing but a wide interval forbids it that is wide by hysteresis: plays may
    /// mend it.
    fn may_be_used(&self) -> bool {
        let wide_by_loop = || is_wide_loop(self.hysteresis_kpa.unwrap_or(0.0), self.rmse_kpa);
        self.model.is_usable() || (self.has_wide_interval() && wide_by_loop())
    }

    fn has_wide_interval(&self) -> bool {
        self.model.curve.is_some() && matches!(self.model.status, Status::IntervalTooWide { .. })
    }

    /// Takes the error in use for that of the taxel. With plays the interval is judged anew: they take the difference of
    /// the two mean squares out of it.
    fn judge_in_use(&mut self, in_use: Option<&RecordedTaxel>) {
        let Some(in_use) = in_use.filter(|in_use| in_use.plays.is_some()) else { return };
        let (quality, rest_kpa) = (&self.model.quality, in_use.rmse_kpa);
        let deviations = student_975(quality.dof);
        let taken = deviations.powi(2) * (self.rmse_kpa.powi(2) - rest_kpa.powi(2));
        self.rmse_kpa = rest_kpa;
        let Status::IntervalTooWide { limit, .. } = self.model.status else { return };
        let (Some(width), Some(share)) = (quality.interval_kpa, quality.interval_share) else { return };
        let left_kpa = (width.powi(2) - taken).max(0.0).sqrt().max(deviations * rest_kpa);
        let share = share * left_kpa / width;
        self.model.status = if share <= limit { Status::Ok } else { Status::IntervalTooWide { share, limit } };
    }
}

impl<'a> SkinFit<'a> {
    /// To be fitted as `recipe` says.
    pub(crate) fn new(
        scans: &'a Scans<'a>,
        masks: Masks,
        kpa: Vec<f64>,
        course: Course,
        recipe: &'a FitRecipe,
    ) -> Self {
        let half_scans = half_width(scans, recipe.smooth_s);
        Self { scans, masks, kpa, course, recipe, half_scans }
    }

    /// Fits every taxel.
    pub(crate) fn run(&self, workers: &dyn Workers) -> FittedSkin {
        let n = self.scans.counts.len();
        // Static curves are half of the work, plays the other.
        let done = AtomicUsize::new(0);
        let count = |all: usize, before: f64| {
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            workers.progress(before + 0.5 * done as f64 / all as f64);
        };
        let mut fitted = map(workers, n, |taxel| {
            let fitted = self.fit_static(taxel);
            count(n, 0.0);
            fitted
        });
        // Hysteresis is part of a static curve's error: whether a taxel is good enough is judged with the plays, if there
        // are any.
        let candidates: Vec<usize> = (0..n).filter(|&t| fitted[t].may_be_used()).collect();
        let (plays_on, plays_error_ratio) = self.decide_on_plays(&candidates, has_wide_loops(&fitted), workers);
        done.store(0, Ordering::Relaxed);
        let found = map(workers, candidates.len(), |i| {
            let in_use = self.in_use(candidates[i], &fitted[candidates[i]], plays_on);
            count(candidates.len(), 0.5);
            in_use
        });
        let mut in_use: Vec<Option<RecordedTaxel>> = vec![None; n];
        for (&taxel, found) in candidates.iter().zip(found) {
            if !self.recipe.is_paper() {
                fitted[taxel].judge_in_use(found.as_ref());
            }
            in_use[taxel] = found;
        }
        if !self.recipe.is_paper() {
            exclude_poor_fits(&mut fitted);
        }
        in_use.iter_mut().zip(&fitted).filter(|(_, f)| !f.model.is_usable()).for_each(|(in_use, _)| *in_use = None);
        let models = fitted.into_iter().map(|fitted| fitted.model).collect();
        FittedSkin { models, in_use, plays_on, plays_error_ratio }
    }

    /// The pressure where the taxel is sound and fitted, else NaN.
    fn pressure(&self, taxel: usize) -> Vec<f64> {
        let masked = self.masks.of(taxel);
        let left_out = |i: usize| masked[i] || (self.recipe.branch == Branch::Rising && self.course.falling()[i]);
        self.kpa.iter().enumerate().map(|(i, p)| if left_out(i) { f64::NAN } else { *p }).collect()
    }

    /// The pressures that the static curve goes through, else NaN.
    fn on_the_curve(&self, kpa: &[f64]) -> Vec<f64> {
        let left_out = |falling: bool| falling && self.recipe.curve == Branch::Rising;
        let falling = self.course.falling();
        kpa.iter().zip(falling).map(|(p, falling)| if left_out(*falling) { f64::NAN } else { *p }).collect()
    }

    /// The taxel's count as the models see it in use; NaN where it is not sound.
    fn smoothed(&self, taxel: usize) -> Vec<f64> {
        let (counts, masked) = (self.scans.counts[taxel], self.masks.of(taxel));
        let mut all = vec![f64::NAN; counts.len()];
        for stretch in self.course.stretches() {
            let smoothed = smooth(&counts[stretch.clone()], &masked[stretch.clone()], self.half_scans);
            all[stretch.clone()].copy_from_slice(&smoothed);
        }
        all.iter_mut().zip(masked).filter(|(_, masked)| **masked).for_each(|(count, _)| *count = f64::NAN);
        all
    }

    fn fit_static(&self, taxel: usize) -> FittedTaxel {
        let without = |status| FittedTaxel {
            model: TaxelModel::without_curve(status, self.recipe.options.gauge),
            rmse_kpa: f64::NAN,
            hysteresis_kpa: None,
            sensitivity: None,
        };
        let share = self.masks.share(taxel);
        if share > MASKED_MAX && !self.recipe.is_paper() {
            let first = self.scans.counts[taxel].iter().copied().find(|c| c.is_finite());
            return without(faulty(self.masks.main_fault(taxel), share, first));
        }
        let kpa = self.pressure(taxel);
        let mut model = self.static_model(self.scans.counts[taxel], &self.on_the_curve(&kpa));
        let dropouts = self.masks.dropouts(taxel);
        if dropouts > 0 {
            model.flags.push(Flag::Dropouts { samples: u64::from(dropouts) });
        }
        let mut fitted = FittedTaxel { model, ..without(Status::NoData) };
        if fitted.model.is_usable() || fitted.has_wide_interval() {
            let smoothed = self.smoothed(taxel);
            let read = read_static(&fitted.model, &smoothed);
            fitted.rmse_kpa = root_mean_square(read.iter().zip(&kpa).map(|(read, p)| read - p));
            fitted.hysteresis_kpa = hysteresis::width_kpa(&read, &kpa, self.course.falling());
            let [low, high] = hysteresis::range(&kpa);
            fitted.sensitivity = hysteresis::swing(&smoothed, &kpa).map(|swing| swing / (high - low));
        }
        fitted
    }

    /// The static curve over the scans with a pressure.
    fn static_model(&self, counts: &[f64], kpa: &[f64]) -> TaxelModel {
        let options: &FitOptions = &self.recipe.options;
        let sound = || counts.iter().zip(kpa).filter(|(_, p)| p.is_finite());
        // The accumulator rounds pressures to a thousandth of a pascal, which the paper's equation does not.
        if !self.recipe.is_paper() && sound().all(|(c, _)| is_byte(*c)) {
            // Counts are integers, and so are all sums.
            let mut sums = Accumulator::new();
            for (ramp, scans) in self.course.ramps() {
                let pairs = counts[scans.clone()].iter().zip(&kpa[scans]).filter(|(_, p)| p.is_finite());
                sums.extend(pairs.map(|(c, p)| (*c as u8, FixedPressure::from_kpa(*p))), ramp);
            }
            return sums.fit(options);
        }
        let ramp_of = self.course.ramps().flat_map(|(ramp, scans)| scans.map(move |_| ramp));
        let ramps: Vec<u16> = ramp_of.zip(kpa).filter(|(_, p)| p.is_finite()).map(|(ramp, _)| ramp).collect();
        let (counts, kpa): (Vec<f64>, Vec<f64>) = sound().unzip();
        taxel_model::fit(&Samples { ramp: Some(&ramps), ..Samples::new(&counts, &kpa) }, options)
    }

    fn decide_on_plays(&self, taxels: &[usize], wide_loops: bool, workers: &dyn Workers) -> (bool, Option<f64>) {
        if self.recipe.plays == PlaysChoice::Off || self.recipe.branch == Branch::Rising {
            return (false, None);
        }
        let Some(held_out) = self.course.held_out(&self.kpa) else {
            return (self.recipe.plays == PlaysChoice::On, None);
        };
        let ratios = map(workers, taxels.len(), |i| self.error_ratio(taxels[i], &held_out));
        let ratio = quantile(ratios.into_iter().flatten().collect(), 0.5);
        let wins = wide_loops && ratio.is_some_and(|ratio| ratio < PLAYS_WIN_BELOW);
        (wins || self.recipe.plays == PlaysChoice::On, ratio)
    }

    /// Error of plays over that of the better static curve, the one that they would replace or their own without them,
    /// on scans that no fit saw.
    fn error_ratio(&self, taxel: usize, held_out: &Range<usize>) -> Option<f64> {
        let (smoothed, kpa) = (self.smoothed(taxel), self.pressure(taxel));
        let seen: Vec<f64> =
            kpa.iter().enumerate().map(|(i, p)| if held_out.contains(&i) { f64::NAN } else { *p }).collect();
        let (with, alone) = hysteresis::held_out_errors(&smoothed, &seen, &kpa, held_out, self.recipe.plays_order)?;
        let curve = self.static_model(self.scans.counts[taxel], &self.on_the_curve(&seen));
        let curve = hysteresis::error_on(&read_static(&curve, &smoothed), &kpa, held_out);
        Some(with / curve.min(alone)).filter(|ratio| ratio.is_finite())
    }

    /// What is known of a usable taxel in use; `None` if it never moved while the pressure did.
    fn in_use(&self, taxel: usize, fitted: &FittedTaxel, plays_on: bool) -> Option<RecordedTaxel> {
        let sensitivity = fitted.sensitivity?;
        // Plays that contradict the static curve would be of another taxel.
        let same_sign = |(plays, _): &(Plays, f64)| plays.sign == fitted.model.sign;
        let plays = if plays_on { self.plays(taxel).filter(same_sign) } else { None };
        let (plays, rmse_kpa) = plays.map_or((None, fitted.rmse_kpa), |(plays, rmse_kpa)| (Some(plays), rmse_kpa));
        Some(RecordedTaxel { rmse_kpa, sensitivity, hysteresis_kpa: fitted.hysteresis_kpa, plays })
    }

    /// The taxel's plays, and what error they leave, kPa.
    fn plays(&self, taxel: usize) -> Option<(Plays, f64)> {
        let (smoothed, kpa) = (self.smoothed(taxel), self.pressure(taxel));
        let plays = hysteresis::identify(&smoothed, &kpa, self.recipe.plays_order)?;
        let read = hysteresis::read(&plays, &smoothed);
        Some((plays, root_mean_square(read.iter().zip(&kpa).map(|(read, p)| read - p))))
    }
}

/// The pressures that a static curve makes of a smoothed count; NaN where there is none.
fn read_static(model: &TaxelModel, smoothed: &[f64]) -> Vec<f64> {
    smoothed.iter().map(|count| model.kpa(*count).unwrap_or(f64::NAN)).collect()
}

/// Whether a loop is large enough for plays to win by taking it out. One of width w makes an error of w / 2; if plays win
/// where there is less of it in the error, they bend the curve and compensate nothing.
fn is_wide_loop(width_kpa: f64, error_kpa: f64) -> bool {
    0.5 * width_kpa > (1.0 - PLAYS_WIN_BELOW * PLAYS_WIN_BELOW).sqrt() * error_kpa
}

/// Whether the loops of the skin are.
fn has_wide_loops(fitted: &[FittedTaxel]) -> bool {
    let usable = || fitted.iter().filter(|f| f.may_be_used());
    let width = quantile(usable().filter_map(|f| f.hysteresis_kpa).collect(), 0.5).unwrap_or(0.0);
    let error = quantile(usable().map(|f| f.rmse_kpa).collect(), 0.5).unwrap_or(f64::INFINITY);
    is_wide_loop(width, error)
}

fn exclude_poor_fits(fitted: &mut [FittedTaxel]) {
    let usable = fitted.iter().filter(|f| f.model.is_usable());
    let Some(median) = quantile(usable.map(|f| f.rmse_kpa).collect(), 0.5) else { return };
    let limit_kpa = POOR_FIT_RATIO * median;
    for taxel in fitted.iter_mut().filter(|f| f.model.is_usable() && f.rmse_kpa > limit_kpa) {
        taxel.model.status = Status::PoorFit { rmse_kpa: taxel.rmse_kpa, limit_kpa };
    }
}

/// The status of a taxel that is not fitted.
fn faulty(fault: Option<Fault>, share: f64, first: Option<f64>) -> Status {
    match (fault, first) {
        (Some(Fault::Rail), _) => Status::Railed { share },
        (Some(Fault::Dead), Some(count)) => Status::Dead { count },
        (Some(Fault::Frozen | Fault::Dead), _) => Status::Frozen { share },
        (Some(Fault::ModuleFlicker), _) => Status::ModuleFlicker { share },
        (Some(_), _) => Status::Jumping { share },
        (None, None) => Status::NoData,
        (None, Some(_)) => Status::Missing { share },
    }
}

#[cfg(test)]
#[path = "skin_fit_tests.rs"]
mod tests;
