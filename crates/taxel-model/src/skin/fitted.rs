//! A fitted skin as models: curves as points over raw counts, and beside them the paper's polynomial.

use super::course::{Course, Group};
use super::curve::{LoadCurve, Soft};
use super::form::Form;
use super::lag::{RADII, SCANS, SLACK_SIGMAS};
use super::sigma::SigmaByReading;
use crate::fit::fit as fit_polynomial;
use crate::model::{Quality, Sign, TaxelModel};
use crate::numbers::{mean, median};
use crate::options::FitOptions;
use crate::plays::Plays;
use crate::points::Points;
use crate::samples::Samples;
use crate::status::{Flag, Status};
use crate::uncertainty::SigmaProfile;

/// Knots of the uncertainty over a range of counts.
const SIGMA_STEPS: usize = 64;

/// Of a normal distribution 95 % lie within so many standard deviations.
const WITHIN_95: f64 = 1.96;

/// Loads below this share of the range are none.
pub(super) const LOADED: f64 = 0.02;

/// A calibrated skin.
#[derive(Debug)]
pub struct SkinFit {
    /// The form of its curves.
    pub form: Form,
    /// Least and greatest calibrated pressure, kPa.
    pub range_kpa: [f64; 2],
    /// Below this above rest the skin does not answer, mean over its taxels, kPa; 0 where no unloaded skin was seen, or plateaus are
    /// too far apart to tell.
    pub dead_zone_kpa: f64,
    /// What the readings of light loads have in common by which they are off, kPa; `None` where nothing tells.
    pub shared_kpa: Option<f64>,
    /// The same of other ramps than that which the curves are fitted to.
    pub apart_kpa: Option<f64>,
    /// What readings have in common by which they are off while the pressure falls, less what plays take off: a share of the root of the
    /// load that has gone times that which is left, where that is less. `None` without a fall.
    pub fall_share: Option<f64>,
    /// Whether the unloaded skin was seen, so that its zeros are known.
    pub zero_known: bool,
    /// Left-out error with plays over that without; `None` without a fall.
    pub plays_error_ratio: Option<f64>,
    pub(super) taxels: Vec<Result<FittedTaxel, Status>>,
    pub(super) course: Course,
}

/// One taxel of a calibrated skin.
#[derive(Clone, Debug)]
pub(super) struct FittedTaxel {
    pub(super) status: Status,
    /// +1 where counts rise with pressure, else -1.
    pub(super) sign: f64,
    pub(super) zero_counts: f64,
    pub(super) noise_counts: f64,
    pub(super) swing_counts: f64,
    pub(super) curve: LoadCurve,
    pub(super) soft: Option<Soft>,
    pub(super) plays_kpa: Option<[f64; 4]>,
    /// By how much it reads groups too high that its curve is not fitted to, kPa.
    pub(super) others_kpa: Vec<f64>,
    pub(super) sigma: SigmaByReading,
    pub(super) error_kpa: f64,
    /// Greatest pressure that tells of the curve, kPa.
    pub(super) top_kpa: f64,
}

impl SkinFit {
    /// Mean count and noise of the unloaded taxel; `None` where no unloaded skin was seen.
    #[must_use]
    pub fn zero(&self, taxel: usize) -> Option<(f64, f64)> {
        let unloaded = self.zero_known && self.course.rest_kpa.abs() <= LOADED * self.range_kpa[1];
        let taxel = self.taxels.get(taxel)?.as_ref().ok().filter(|_| unloaded)?;
        Some((taxel.zero_counts, taxel.noise_counts))
    }

    /// Counts per kPa of a taxel in use, over its swing.
    #[must_use]
    pub fn sensitivity(&self, taxel: usize) -> Option<f64> {
        let taxel = self.taxels.get(taxel)?.as_ref().ok().filter(|taxel| taxel.status.is_ok())?;
        Some(taxel.swing_counts / (self.range_kpa[1] - self.range_kpa[0]))
    }

    /// The hysteresis of a taxel about its curve; `None` where it is not compensated.
    #[must_use]
    pub fn plays(&self, taxel: usize) -> Option<Plays> {
        let taxel = self.taxels.get(taxel)?.as_ref().ok()?;
        let weights_kpa = taxel.plays_kpa?;
        let ends =
            [taxel.curve.counts.first()?, taxel.curve.counts.last()?].map(|u| taxel.zero_counts + taxel.sign * u);
        Some(Plays {
            range: [ends[0].min(ends[1]), ends[0].max(ends[1])],
            sign: taxel.sign(),
            radii_counts: RADII.map(|share| share * taxel.swing_counts),
            weights_kpa,
            slack_counts: SLACK_SIGMAS * taxel.noise_counts / (SCANS as f64).sqrt(),
        })
    }

    /// The model of a taxel, whose `counts` are those that were fitted. The order of `options` is that of the polynomial.
    #[must_use]
    pub fn model(&self, taxel: usize, counts: &[f64], options: &FitOptions) -> TaxelModel {
        match self.taxels.get(taxel).unwrap_or(&Err(Status::NoData)) {
            Ok(fitted) => self.model_of(fitted, counts, options),
            Err(status) => TaxelModel::without_curve(*status, options.gauge),
        }
    }

    fn model_of(&self, fitted: &FittedTaxel, counts: &[f64], options: &FitOptions) -> TaxelModel {
        let points = fitted.points();
        let Some(range) = points.range() else {
            // Noise alone has a flat curve.
            let dead = Status::Dead { count: fitted.zero_counts };
            let status = if fitted.status.is_ok() { dead } else { fitted.status };
            return TaxelModel::without_curve(status, options.gauge);
        };
        let polynomial = self.polynomial(counts, options);
        let missing = self.course.order.iter().filter(|row| !counts.get(**row).is_some_and(|c| c.is_finite())).count();
        let step_counts = (range[1] - range[0]) / SIGMA_STEPS as f64;
        let sigma = |k: usize| fitted.sigma.at(points.evaluate(range[0] + step_counts * k as f64));
        let sigma_kpa = (0..=SIGMA_STEPS).map(sigma).collect();
        let interval_kpa = WITHIN_95 * median(fitted.sigma.sigma_kpa.to_vec());
        let (swing_counts, needed_counts) = (fitted.swing_counts, options.min_swing_counts);
        let status = match fitted.status {
            Status::Ok if swing_counts < needed_counts => Status::InsufficientSwing { swing_counts, needed_counts },
            status => status,
        };
        let quality = Quality {
            samples: (self.course.kpa.len() - missing) as u64,
            swing_counts,
            rmse_kpa: fitted.error_kpa,
            repeatability_kpa: self.shared_kpa.map(|kpa| kpa.hypot(self.apart_kpa.unwrap_or(0.0))).or(self.apart_kpa),
            interval_kpa: Some(interval_kpa),
            interval_share: Some(interval_kpa / (self.range_kpa[1] - self.range_kpa[0])),
            ..polynomial.quality
        };
        TaxelModel {
            status,
            flags: if missing > 0 { vec![Flag::Rejected { samples: missing as u64 }] } else { Vec::new() },
            sign: fitted.sign(),
            range: Some(range),
            points: Some(points),
            sigma: Some(SigmaProfile { first_count: range[0], step_counts, sigma_kpa }),
            gauge: options.gauge,
            quality,
            ..polynomial
        }
    }

    /// The paper's polynomial of pressure over count, through the means of the groups that the curve goes through.
    fn polynomial(&self, counts: &[f64], options: &FitOptions) -> TaxelModel {
        let of_group = |scans: &[usize]| {
            let known = scans.iter().filter_map(|scan| counts.get(self.course.order[*scan])).filter(|c| c.is_finite());
            mean(known.copied())
        };
        let groups = self.course.groups.iter().filter(|group| group.on_curve);
        let (counts, kpa): (Vec<f64>, Vec<f64>) = groups.map(|group| (of_group(&group.scans), group.kpa)).unzip();
        fit_polynomial(&Samples::new(&counts, &kpa), options)
    }
}

impl FittedTaxel {
    fn sign(&self) -> Sign {
        if self.sign < 0.0 { Sign::Falling } else { Sign::Rising }
    }

    /// The curve over raw counts.
    fn points(&self) -> Points {
        let (load, kpa) = self.soft.as_ref().map_or((&self.curve.counts, &self.curve.kpa), |s| (&s.counts, &s.kpa));
        let mut points: Vec<(f64, f64)> =
            load.iter().map(|load| self.zero_counts + self.sign * load).zip(kpa.iter().copied()).collect();
        // Rounding must not take the last point away.
        points.retain(|(_, kpa)| *kpa <= self.top_kpa + 1e-9 * self.top_kpa.abs());
        if self.sign < 0.0 {
            points.reverse();
        }
        let (counts, kpa) = points.into_iter().unzip();
        Points::new(counts, kpa)
    }
}

/// Groups of a rising or a falling pressure that the curve is not fitted to: the pressure, and what the taxels in use have in common by
/// which they read it too high, kPa.
pub(super) fn common_kpa(taxels: &[Result<FittedTaxel, Status>], groups: &[Group], rising: bool) -> Vec<(f64, f64)> {
    let used = || taxels.iter().flatten().filter(|taxel| taxel.status.is_ok());
    let common = |g: usize| mean(used().map(|taxel| taxel.others_kpa[g]).filter(|off_kpa| off_kpa.is_finite()));
    let chosen = groups.iter().enumerate().filter(|(_, group)| group.rising == rising);
    chosen.map(|(g, group)| (group.kpa, common(g))).filter(|(_, kpa)| kpa.is_finite()).collect()
}
