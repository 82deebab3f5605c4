//! From sound scans to models of a whole skin: what recordings, tables and sessions have in common.

use taxel_model::skin::{Form, Gathered, PLAY_SCANS, SkinError, SkinFit, Warp, fit};
use taxel_model::{FitOptions, Flag, Samples, Status, TaxelModel, Workers, map};

use crate::baseline::TaxelBaseline;
use crate::calibration::fit::masks::Masks;
use crate::calibration::fit::recipe_options::FitRecipe;
use crate::calibration::fit::scans::Scans;
use crate::calibration::fit::smooth::{half_width, smooth};
use crate::calibration::fit::zero::{baseline, rest_scans};
use crate::calibration::gauge_zero::{GaugeZero, steeper_at_rest};
use crate::intake::faults::fault::Fault;
use crate::model_set::{ModelSet, Recorded, RecordedTaxel};

/// A taxel that must be left out of more of the scans than this is not fitted.
pub(crate) const MASKED_MAX: f64 = 0.3;

/// Scans with all that is known of them, ready to be fitted.
pub(crate) struct SkinScans<'a> {
    /// The scans; all counts refer to one zero.
    pub scans: &'a Scans<'a>,
    /// What of them is invalid.
    pub masks: &'a Masks,
    /// Pressure that belongs to each scan, kPa; NaN where there is none.
    pub kpa: &'a [f64],
    /// The zero of each taxel where it was measured apart, at no pressure.
    pub zeros: Option<&'a [TaxelBaseline]>,
    /// Counts are averaged over so many seconds, here and in use.
    pub smooth_s: f64,
}

impl SkinScans<'_> {
    /// Fits every taxel. The set comes without id, patch and time of making, and without what `share_gauge` adds. What was recorded
    /// of hysteresis is in it, but for how far the zero returns.
    ///
    /// # Errors
    /// [`SkinError`]: the scans say nothing.
    pub(crate) fn fit(&self, recipe: &FitRecipe, workers: &dyn Workers) -> Result<ModelSet, SkinError> {
        if recipe.is_paper() {
            return Ok(self.fit_paper(recipe, workers));
        }
        let taxels = self.scans.counts.len();
        let columns = map(workers, taxels, |taxel| self.column(taxel));
        let counts: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let zeros: Option<Vec<(f64, f64)>> = self.zeros.map(|z| z.iter().map(|zero| (zero.mean, zero.noise)).collect());
        let gathered =
            Gathered { time_s: self.scans.time_s, pressure_kpa: self.kpa, counts: &counts, zeros: zeros.as_deref() };
        let skin = fit(&gathered, recipe.plays, workers)?;
        let models = map(workers, taxels, |taxel| self.model(&skin, taxel, counts[taxel], recipe));
        let zero =
            |taxel| skin.zero(taxel).map_or(TaxelBaseline::UNKNOWN, |(mean, noise)| TaxelBaseline { mean, noise });
        let recorded = Recorded {
            smooth_s: self.smooth_s,
            plays_mean_s: PLAY_SCANS as f64 * self.scans.period_s(),
            module_size: recipe.module_size,
            zero_return_counts: None,
            unloading_share: skin.fall_share,
            plays_error_ratio: skin.plays_error_ratio,
            taxels: (0..taxels).map(|taxel| in_use(&skin, taxel, &models[taxel])).collect(),
        };
        Ok(ModelSet {
            method: method(&skin.form),
            baseline: (0..taxels).map(zero).collect(),
            pressure_max_kpa: skin.range_kpa[1],
            dead_zone_kpa: skin.dead_zone_kpa,
            taxels: models,
            recorded: Some(recorded),
            ..ModelSet::default()
        })
    }

    /// The paper's fit: its equation over all samples of rising pressure, as they are. No fault is looked for, nothing is
    /// averaged, shifted in time or compensated.
    fn fit_paper(&self, recipe: &FitRecipe, workers: &dyn Workers) -> ModelSet {
        let rest = rest_scans(self.kpa);
        let of = |taxel: usize| baseline(self.scans.counts[taxel], self.masks.of(taxel), &rest);
        ModelSet {
            method: format!("order {}, paper", recipe.options.order),
            baseline: self.zeros.map_or_else(|| (0..self.scans.counts.len()).map(of).collect(), <[_]>::to_vec),
            pressure_max_kpa: self.kpa.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            taxels: map(workers, self.scans.counts.len(), |taxel| self.paper_model(taxel, &recipe.options)),
            ..ModelSet::default()
        }
    }

    fn paper_model(&self, taxel: usize, options: &FitOptions) -> TaxelModel {
        let all =
            self.scans.counts[taxel].iter().zip(self.kpa).filter(|(count, kpa)| count.is_finite() && kpa.is_finite());
        let (counts, kpa): (Vec<f64>, Vec<f64>) = all.unzip();
        taxel_model::fit(&Samples::new(&counts, &kpa), options)
    }

    /// The counts of a taxel as they are in use, NaN where they are invalid; empty where too many are.
    fn column(&self, taxel: usize) -> Vec<f64> {
        if self.masks.share(taxel) > MASKED_MAX {
            return Vec::new();
        }
        let (counts, masked) = (self.scans.counts[taxel], self.masks.of(taxel));
        let mut column = smooth(counts, masked, half_width(self.scans, self.smooth_s));
        column.iter_mut().zip(masked).filter(|(_, masked)| **masked).for_each(|(count, _)| *count = f64::NAN);
        column
    }

    fn model(&self, skin: &SkinFit, taxel: usize, counts: &[f64], recipe: &FitRecipe) -> TaxelModel {
        let share = self.masks.share(taxel);
        if share > MASKED_MAX {
            let first = self.scans.counts[taxel].iter().copied().find(|count| count.is_finite());
            let status = faulty(self.masks.main_fault(taxel), share, first);
            return TaxelModel::without_curve(status, recipe.options.gauge);
        }
        let mut model = skin.model(taxel, counts, &recipe.options);
        let dropouts = self.masks.dropouts(taxel);
        if dropouts > 0 {
            model.flags.push(Flag::Dropouts { samples: u64::from(dropouts) });
        }
        model
    }
}

/// All models of a set share the gauge, what was taken off its readings, and `curve_sigma_kpa` beside that.
pub(crate) fn share_gauge(set: &mut ModelSet, recipe: &FitRecipe, gauge_zero: &GaugeZero, curve_sigma_kpa: f64) {
    let gauge = recipe.options.gauge;
    let zero_kpa = gauge_zero.sigma_kpa() * steeper_at_rest(&set.taxels, &set.baseline);
    set.gauge_gain_rel = gauge.gain_rel;
    set.gauge_offset_kpa = zero_kpa.hypot(gauge.offset_kpa).hypot(curve_sigma_kpa);
    set.taxels.iter_mut().for_each(|model| model.gauge.offset_kpa = set.gauge_offset_kpa);
}

/// What is known of a taxel in use.
fn in_use(skin: &SkinFit, taxel: usize, model: &TaxelModel) -> Option<RecordedTaxel> {
    let sensitivity = skin.sensitivity(taxel).filter(|_| model.is_usable())?;
    Some(RecordedTaxel { sensitivity, plays: skin.plays(taxel) })
}

/// How the curves were fitted, in words.
fn method(form: &Form) -> String {
    let warp = match form.warp {
        Warp::None => "pressure".to_owned(),
        Warp::Log(scale) => format!("ln(1 + P / {scale} P_max)"),
        Warp::Root => "root of the pressure".to_owned(),
    };
    let zone = if form.dead_zone { ", dead zones" } else { "" };
    format!("monotone, order {} in {warp}{zone}", form.order)
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
