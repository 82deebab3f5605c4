//! From a calibration recording to a model set.

use taxel_model::{Accumulator, FitOptions, FixedPressure, Plays, Status, TaxelModel};
use thiserror::Error;

use crate::faults::{Fault, FaultLimits};
use crate::model_set::{ModelSet, Recorded, RecordedTaxel};
use crate::recording::zero::{baseline, rest_scans, zero_return};
use crate::recording::{Masks, Scans, hysteresis, lag, median, root_mean_square, running_median, smooth};
use crate::rest::TaxelBaseline;
use crate::session::method;

/// Gauges give single readings that are off by 8 to 14 kPa: a median over 0.3 s takes them out.
const GAUGE_MEDIAN_SCANS: usize = 15;

/// A taxel that must be left out of more of the recording than this is not fitted.
const MASKED_MAX: f64 = 0.3;

/// A taxel whose error is so many times the median over the taxels is broken in a way that has no name.
const POOR_FIT_RATIO: f64 = 2.5;

/// Plays are switched on if they leave at most so much of the error on the branch that was not fitted.
const PLAYS_WIN_BELOW: f64 = 0.9;

/// Which part of a recording is fitted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Branch {
    /// All of it: the curve runs through the middle of the hysteresis.
    #[default]
    Both,
    /// Up to the highest pressure, as in the paper.
    Rising,
}

/// Whether hysteresis is compensated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PlaysChoice {
    /// If it wins on the lower half of the falling branch, fitted without that half.
    #[default]
    Auto,
    /// Wherever a taxel carries it.
    On,
    /// Nowhere.
    Off,
}

/// How a recording is fitted.
#[derive(Clone, Debug)]
pub struct FitRecipe {
    /// How each taxel's static curve is fitted.
    pub options: FitOptions,
    /// Which part is fitted.
    pub branch: Branch,
    /// Whether hysteresis is compensated.
    pub plays: PlaysChoice,
    /// So many neighbouring taxels form a module.
    pub module_size: usize,
    /// Counts are averaged over so many seconds for the plays and in use; 0 is not at all.
    pub smooth_s: f64,
    /// A lag of at most so many seconds between gauge and counts is looked for; 0 is none.
    pub max_lag_s: f64,
    /// Limits of the faults.
    pub faults: FaultLimits,
}

impl Default for FitRecipe {
    fn default() -> Self {
        Self {
            options: FitOptions::default(),
            branch: Branch::default(),
            plays: PlaysChoice::default(),
            module_size: 10,
            smooth_s: 0.5,
            max_lag_s: 0.0,
            faults: FaultLimits::default(),
        }
    }
}

/// Why a recording cannot be used.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum RecordingError {
    /// A fit needs both.
    #[error("the recording has no pressure: expected a column `pressure_kpa` with finite numbers")]
    NoPressure,
    /// The models are of another skin.
    #[error("the recording has {recorded} taxels, the model set {models}")]
    Taxels {
        /// Taxels of the recording.
        recorded: usize,
        /// Taxels of the set.
        models: usize,
    },
}

/// Fits a recording. The set comes without id, patch and time of making. `progress` is told taxels done and all.
///
/// # Errors
/// [`RecordingError::NoPressure`]. A taxel that cannot be fitted is no error: its status says why.
pub fn fit(
    scans: &Scans<'_>,
    recipe: &FitRecipe,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<ModelSet, RecordingError> {
    let gauge = scans.pressure_kpa.ok_or(RecordingError::NoPressure)?;
    let masks = Masks::find(scans, recipe.module_size, &recipe.faults);
    let kpa = running_median(gauge, GAUGE_MEDIAN_SCANS);
    let lag_s = if recipe.max_lag_s > 0.0 { lag::estimate(scans, &kpa, &masks, recipe.max_lag_s) } else { 0.0 };
    let kpa = lag::shifted(scans.time_s, &kpa, lag_s);
    let known = kpa.iter().enumerate().filter(|(_, p)| p.is_finite());
    let top = known.max_by(|a, b| a.1.total_cmp(b.1)).ok_or(RecordingError::NoPressure)?.0;
    let fit = Fit { scans, recipe, masks, kpa, top };
    Ok(fit.model_set(lag_s, progress))
}

struct Fit<'a> {
    scans: &'a Scans<'a>,
    recipe: &'a FitRecipe,
    masks: Masks,
    /// Pressure that belongs to each scan; NaN where there is none.
    kpa: Vec<f64>,
    /// Scan of the highest pressure: up to here it is the rising branch.
    top: usize,
}

/// A taxel's two kinds of curve.
struct FittedTaxel {
    model: TaxelModel,
    /// The RMSE of the static curve in use, kPa, and its hysteresis.
    rmse_kpa: f64,
    hysteresis_kpa: Option<f64>,
}

impl Fit<'_> {
    fn model_set(&self, lag_s: f64, progress: &mut dyn FnMut(usize, usize)) -> ModelSet {
        let n = self.scans.counts.len();
        // Static curves are half of the work, plays the other.
        let mut fitted: Vec<FittedTaxel> = Vec::with_capacity(n);
        for taxel in 0..n {
            fitted.push(self.fit_static(taxel));
            progress(taxel, 2 * n);
        }
        exclude_poor_fits(&mut fitted);
        let usable: Vec<usize> = (0..n).filter(|&t| fitted[t].model.is_usable()).collect();
        let (plays_on, plays_error_ratio) = self.decide_on_plays(&usable);
        let mut taxels: Vec<Option<RecordedTaxel>> = vec![None; n];
        for (done, &taxel) in usable.iter().enumerate() {
            taxels[taxel] = self.recorded(taxel, &fitted[taxel], plays_on);
            progress(n + done * n / usable.len(), 2 * n);
        }
        let rest = rest_scans(&self.kpa, self.top);
        let of = |t: usize| baseline(self.scans.counts[t], self.masks.of(t), &rest);
        let baseline: Vec<TaxelBaseline> = (0..n).map(of).collect();
        let zero_return_counts = zero_return(self.scans, &self.masks, &self.kpa, &baseline, &usable);
        let options = &self.recipe.options;
        ModelSet {
            id: String::new(),
            patch: String::new(),
            created_wall_ns: 0,
            session: None,
            method: self.method(plays_on),
            board_settings: Vec::new(),
            baseline,
            pressure_max_kpa: self.kpa[self.top],
            gauge_gain_rel: options.gauge.gain_rel,
            gauge_offset_kpa: options.gauge.offset_kpa,
            taxels: fitted.into_iter().map(|fitted| fitted.model).collect(),
            recorded: Some(Recorded {
                smooth_s: self.recipe.smooth_s,
                module_size: self.recipe.module_size,
                lag_s,
                zero_return_counts,
                plays_error_ratio,
                taxels,
            }),
        }
    }

    fn method(&self, plays_on: bool) -> String {
        let branch = match self.recipe.branch {
            Branch::Both => "rising and falling",
            Branch::Rising => "rising",
        };
        let plays = if plays_on { ", two plays about order 3 in use" } else { "" };
        format!("{}, {branch}{plays}", method(&self.recipe.options))
    }

    /// The scans that are fitted end here.
    fn end(&self) -> usize {
        match self.recipe.branch {
            Branch::Both => self.scans.len(),
            Branch::Rising => self.top + 1,
        }
    }

    /// The pressure where the taxel is sound and fitted, else NaN.
    fn pressure(&self, taxel: usize) -> Vec<f64> {
        let masked = self.masks.of(taxel);
        let end = self.end();
        let at = |(i, p): (usize, &f64)| if masked[i] || i >= end { f64::NAN } else { *p };
        self.kpa.iter().enumerate().map(at).collect()
    }

    /// The taxel's count as the models see it in use.
    fn smoothed(&self, taxel: usize) -> Vec<f64> {
        let (counts, masked) = (self.scans.counts[taxel], self.masks.of(taxel));
        let mut smoothed = smooth(counts, masked, half_width(self.scans, self.recipe.smooth_s));
        smoothed.iter_mut().zip(masked).filter(|(_, masked)| **masked).for_each(|(count, _)| *count = f64::NAN);
        smoothed
    }

    fn fit_static(&self, taxel: usize) -> FittedTaxel {
        let without = |status| FittedTaxel {
            model: TaxelModel::without_curve(status, self.recipe.options.gauge),
            rmse_kpa: f64::NAN,
            hysteresis_kpa: None,
        };
        let share = self.masks.share(taxel);
        if share > MASKED_MAX {
            let first = self.scans.counts[taxel].iter().copied().find(|c| c.is_finite());
            return without(faulty(self.masks.main_fault(taxel), share, first));
        }
        let kpa = self.pressure(taxel);
        let mut sums = Accumulator::new();
        for (ramp, range) in [(0, 0..self.top + 1), (1, self.top + 1..self.scans.len())] {
            let pairs = self.scans.counts[taxel][range.clone()].iter().zip(&kpa[range]);
            let sound = pairs.filter(|(_, p)| p.is_finite());
            sums.extend(sound.map(|(c, p)| (*c as u8, FixedPressure::from_kpa(*p))), ramp);
        }
        let model = sums.fit(&self.recipe.options);
        if !model.is_usable() {
            return FittedTaxel { model, ..without(Status::NoData) };
        }
        let read: Vec<f64> =
            self.smoothed(taxel).iter().map(|c| model.evaluate(*c).map_or(f64::NAN, |reading| reading.kpa)).collect();
        let rmse_kpa = root_mean_square(read.iter().zip(&kpa).map(|(read, p)| read - p));
        let hysteresis_kpa = hysteresis::width_kpa(&read, &kpa, self.top);
        FittedTaxel { model, rmse_kpa, hysteresis_kpa }
    }

    fn decide_on_plays(&self, usable: &[usize]) -> (bool, Option<f64>) {
        if self.recipe.plays == PlaysChoice::Off || self.recipe.branch == Branch::Rising {
            return (false, None);
        }
        let Some(cut) = hysteresis::cut(&self.kpa, self.top) else {
            return (self.recipe.plays == PlaysChoice::On, None);
        };
        let ratios = usable.iter().filter_map(|&t| hysteresis::error_ratio(&self.smoothed(t), &self.pressure(t), cut));
        let ratio = median(ratios.collect());
        let wins = ratio.is_some_and(|ratio| ratio < PLAYS_WIN_BELOW);
        (wins || self.recipe.plays == PlaysChoice::On, ratio)
    }

    /// What is known of a usable taxel in use; `None` if it never moved while the pressure did.
    fn recorded(&self, taxel: usize, fitted: &FittedTaxel, plays_on: bool) -> Option<RecordedTaxel> {
        let (smoothed, kpa) = (self.smoothed(taxel), self.pressure(taxel));
        let range = |kpa: &[f64]| {
            let known = || kpa.iter().copied().filter(|p| p.is_finite());
            known().fold(f64::NEG_INFINITY, f64::max) - known().fold(f64::INFINITY, f64::min)
        };
        let sensitivity = hysteresis::swing(&smoothed, &kpa)? / range(&kpa);
        // Plays that contradict the static curve would be of another taxel.
        let plays: Option<Plays> = if plays_on { hysteresis::identify(&smoothed, &kpa) } else { None };
        let plays = plays.filter(|plays| plays.sign == fitted.model.sign);
        let rmse_kpa = plays.as_ref().map_or(fitted.rmse_kpa, |plays| {
            root_mean_square(hysteresis::read(plays, &smoothed).iter().zip(&kpa).map(|(read, p)| read - p))
        });
        Some(RecordedTaxel { rmse_kpa, sensitivity, hysteresis_kpa: fitted.hysteresis_kpa, plays })
    }
}

/// Scans on each side of a centred mean over `seconds`.
pub(super) fn half_width(scans: &Scans<'_>, seconds: f64) -> usize {
    let half = 0.5 * seconds / scans.period_s();
    if half.is_finite() && half > 0.0 { half as usize } else { 0 }
}

fn exclude_poor_fits(fitted: &mut [FittedTaxel]) {
    let Some(median) = median(fitted.iter().map(|f| f.rmse_kpa).collect()) else { return };
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
