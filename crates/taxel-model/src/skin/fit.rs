//! The fit from end to end: what all taxels share, then taxel by taxel.

use super::course::{Course, Group, READING_FOLDS, fill};
use super::curve::{LoadCurve, Problem};
use super::fitted::{FittedTaxel, LOADED, SkinFit, common_kpa};
use super::form::{Folds, Form, STIFF, Tried, pilots};
use super::lag::{self, Lag};
use super::sigma::{Moments, Noise, PRIOR_GROUPS, SigmaByReading, Variance};
use crate::numbers::{mean, median, quantile, spread};
use crate::status::Status;
use crate::workers::{Workers, map};
use thiserror::Error;

/// Fewer falling groups tell no hysteresis.
const FALLING_GROUPS_MIN: usize = 21;

/// A taxel in use has at least this share of the median swing ...
pub const SWING_MIN: f64 = 0.25;

/// ... and at most this multiple of the median error.
const ERROR_MAX: f64 = 2.5;

/// A reading that is off by this share of the standard deviation of the pressures says nothing.
const SAYS_NOTHING: f64 = 0.8;

/// So many unloaded scans give a zero.
const REST_SCANS_MIN: usize = 10;

/// A taxel shows its load above this multiple of its noise.
const SHOWN: f64 = 1.4;

/// Light loads, shares of the range, where what the curves have in common shows.
const LIGHT: [f64; 2] = [0.015, 0.15];

/// The soft inverse is taken where it lowers the left-out error to this share.
const SOFT_GAIN: f64 = 0.95;

/// Errors of plays count relative to the load and this share of the range.
const LIGHT_SHARE: f64 = 0.1;

/// Plays are taken where they lower it to this share: by more than chance does.
const PLAYS_GAIN: f64 = 0.98;

/// A curve that spans less than this share of its taxel's swing goes through noise: the others' noise is told without it.
const SPAN_MIN: f64 = 0.25;

/// A taxel without more than this share of the scans is not fitted.
const MISSING_MAX: f64 = 0.3;

/// Why a recording cannot be fitted.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum SkinError {
    /// Two pressures leave nothing to tell an error by.
    #[error("the recording has {distinct} distinct pressures in `pressure_kpa`: a fit needs 3 and more")]
    TooFewPressures {
        /// How many there are.
        distinct: usize,
    },
    /// No count changes.
    #[error("no taxel moves: all counts stay the same while the pressure goes from {from_kpa} to {to_kpa} kPa")]
    NothingMoves {
        /// Least pressure, kPa.
        from_kpa: f64,
        /// Greatest pressure, kPa.
        to_kpa: f64,
    },
    /// There is no leg to fit a curve to.
    #[error(
        "the pressure never stays above the {rest_kpa} kPa at which the recording begins: expected a rise from the unloaded skin"
    )]
    NoRise {
        /// Pressure before the rise, kPa.
        rest_kpa: f64,
    },
}

/// What is seen of a taxel before anything is fitted.
struct Seen {
    sign: f64,
    zero_counts: f64,
    noise_counts: f64,
    swing: f64,
    /// Scans without a count, ascending.
    gaps: Vec<usize>,
    /// Mean load counts, one a group; NaN of a group that has none.
    groups: Vec<f64>,
}

/// What a curve leaves of a taxel's counts.
struct Curved {
    curve: LoadCurve,
    /// The curve without each fold of groups; `None` if what is left does not carry one.
    without: [Option<LoadCurve>; READING_FOLDS],
    of_scans: Moments,
    of_groups: Moments,
    rms_counts: f64,
    /// Counts that the moments are shares of.
    span: f64,
    is_noise: bool,
}

/// What was gathered of a skin: an entry a scan, a column a taxel. What is missing is NaN.
#[derive(Clone, Copy, Debug)]
pub struct Gathered<'a> {
    /// Time, seconds.
    pub time_s: &'a [f64],
    /// Pressure, kPa.
    pub pressure_kpa: &'a [f64],
    /// Counts.
    pub counts: &'a [&'a [f64]],
    /// Mean and noise of each taxel's count at no pressure, NaN where they are not known. `None`: what the scans before the
    /// pressure rises show.
    pub zeros: Option<&'a [(f64, f64)]>,
}

/// Fits a skin. Hysteresis is compensated where that is asked for, shows, and wins.
///
/// # Errors
/// [`SkinError`]. A taxel that cannot be fitted is no error: its status says why.
pub fn fit(of: &Gathered<'_>, hysteresis: bool, workers: &dyn Workers) -> Result<SkinFit, SkinError> {
    fit_as(None, of, hysteresis, workers)
}

/// Fits a skin by curves of this form, or of the one that fits it best.
fn fit_as(form: Option<Form>, of: &Gathered<'_>, plays: bool, workers: &dyn Workers) -> Result<SkinFit, SkinError> {
    let course = Course::new(of.time_s, of.pressure_kpa, of.zeros.is_some())
        .map_err(|distinct| SkinError::TooFewPressures { distinct })?;
    let counts = of.counts;
    let zero = |taxel: usize| of.zeros.map(|zeros| zeros.get(taxel).copied().unwrap_or((f64::NAN, f64::NAN)));
    let seen = map(workers, counts.len(), |taxel| see(&course, counts[taxel], zero(taxel)));
    let range_kpa = course.kpa.iter().fold([course.rest_kpa, f64::NEG_INFINITY], |[l, h], p| [l.min(*p), h.max(*p)]);
    let swings = seen.iter().flatten().map(|seen| seen.swing).filter(|swing| *swing > 0.0);
    let swing_min = SWING_MIN * median(swings.collect());
    let moves = |taxel: &usize| seen[*taxel].as_ref().is_ok_and(|s| s.swing > 0.0 && s.swing >= swing_min);
    let moving: Vec<usize> = (0..counts.len()).filter(moves).collect();
    if moving.is_empty() {
        return Err(SkinError::NothingMoves { from_kpa: range_kpa[0], to_kpa: range_kpa[1] });
    }
    let zero_known = of.zeros.is_some() || course.rest.len() >= REST_SCANS_MIN;
    let pilots = pilots(&moving);
    let groups = |taxel: &usize| {
        let mut groups = course.of_curve(&seen[*taxel].as_ref().ok()?.groups);
        fill(&mut groups);
        Some(groups)
    };
    let groups: Vec<Vec<f64>> = pilots.iter().filter_map(groups).collect();
    let tried = Tried::on(&course, &groups, !zero_known, zero_known && !course.plateaus);
    let problem = |form: Form| Problem::new(form, &course, |_| true);
    let zone_kpa = |problem: &Problem| {
        problem.dead_zone_kpa(moving.iter().filter_map(|taxel| Some(&*seen[*taxel].as_ref().ok()?.groups)))
    };
    // Curves that are free enough to take a dead zone in read light loads as too little.
    let stiff_kpa = Some(STIFF).filter(|_| tried.stiff_fits()).and_then(problem).map_or(0.0, |stiff| zone_kpa(&stiff));
    let form = form.unwrap_or_else(|| tried.chosen(stiff_kpa > 0.0));
    let whole = problem(form).ok_or(SkinError::NoRise { rest_kpa: course.rest_kpa })?;
    let dead_zone_kpa = if stiff_kpa > 0.0 { stiff_kpa } else { zone_kpa(&whole) };
    let without = |k: usize| Problem::new(form, &course, |group| course.reading_fold(group) != k);
    let falling = course.groups.iter().filter(|group| !group.rising).count();
    let fit = Fit {
        whole,
        without: std::array::from_fn(without),
        falls: plays && falling >= FALLING_GROUPS_MIN,
        range_kpa,
        zero_known,
        swing_min,
        course,
        dead_zone_kpa,
        counts,
        seen,
    };
    Ok(fit.run(&moving, &pilots, workers))
}

/// What is seen of a column, whose `zero` (mean and noise) may be known.
fn see(course: &Course, counts: &[f64], zero: Option<(f64, f64)>) -> Result<Seen, Status> {
    let (filled, gaps) = course.column(counts, MISSING_MAX).map_err(|share| match share {
        share if share < 1.0 => Status::Missing { share },
        _ => Status::NoData,
    })?;
    let (mean_kpa, mean_count) = (mean(course.kpa.iter().copied()), mean(filled.iter().copied()));
    let cross: f64 = course.kpa.iter().zip(&filled).map(|(p, c)| (p - mean_kpa) * (c - mean_count)).sum();
    let sign = if cross < 0.0 { -1.0 } else { 1.0 };
    let at_rest: Vec<f64> = course.rest.iter().map(|scan| filled[*scan]).collect();
    let (zero_counts, noise_counts) = zero.unwrap_or_else(|| (mean(at_rest.iter().copied()), spread(&at_rest)));
    if !zero_counts.is_finite() {
        return Err(Status::NoData);
    }
    let load: Vec<f64> = filled.iter().map(|count| sign * (count - zero_counts)).collect();
    let groups = course.means(&load, &gaps);
    Ok(Seen { sign, zero_counts, noise_counts, swing: quantile(load, 0.998).max(0.0), gaps, groups })
}

/// How the counts of a skin are read.
struct ReadingChoice {
    /// With plays.
    plays: bool,
    /// By the soft inverse.
    soft: bool,
    plays_error_ratio: Option<f64>,
}

/// A fit as far as all taxels share it.
struct Fit<'a> {
    course: Course,
    dead_zone_kpa: f64,
    counts: &'a [&'a [f64]],
    seen: Vec<Result<Seen, Status>>,
    whole: Problem,
    /// The problem without each fold of groups; `None` if what is left does not carry a curve.
    without: [Option<Problem>; READING_FOLDS],
    falls: bool,
    range_kpa: [f64; 2],
    zero_known: bool,
    swing_min: f64,
}

impl Fit<'_> {
    fn run(self, moving: &[usize], pilots: &[usize], workers: &dyn Workers) -> SkinFit {
        let curved: Vec<Option<Curved>> = map(workers, self.counts.len(), |taxel| self.curve(taxel));
        let pooled = |of: fn(&Curved) -> &Moments| {
            let mut sums = Moments::default();
            let clear = moving.iter().filter_map(|taxel| curved[*taxel].as_ref()).filter(|curved| !curved.is_noise);
            clear.for_each(|curved| sums.add(of(curved)));
            sums.variance()
        };
        let shapes = [pooled(|curved| &curved.of_scans), pooled(|curved| &curved.of_groups)];
        let reading = self.choose_reading(pilots, &curved, workers);
        let taxels = map(workers, self.counts.len(), |taxel| {
            let seen = self.seen[taxel].as_ref().map_err(|status| *status)?;
            let curved = curved[taxel].as_ref().ok_or(Status::Dead { count: seen.zero_counts })?;
            Ok(self.taxel(taxel, seen, curved, shapes, &reading))
        });
        let taxels = judged(taxels, self.swing_min, spread(&self.course.kpa), self.course.kpa.len() as u64);
        SkinFit {
            form: self.whole.form,
            range_kpa: self.range_kpa,
            dead_zone_kpa: self.dead_zone_kpa,
            shared_kpa: self.shared_kpa(&curved, &taxels),
            apart_kpa: root_mean_square(common_kpa(&taxels, &self.course.groups, true).into_iter().map(|(_, kpa)| kpa)),
            fall_share: self.fall_share(&taxels),
            zero_known: self.zero_known,
            plays_error_ratio: reading.plays_error_ratio,
            taxels,
            course: self.course,
        }
    }

    /// A taxel's load counts, in the order of the course.
    fn load(&self, taxel: usize, seen: &Seen) -> Vec<f64> {
        let (filled, _) = self.course.column(self.counts[taxel], MISSING_MAX).unwrap_or_default();
        filled.iter().map(|count| seen.sign * (count - seen.zero_counts)).collect()
    }

    /// The curve of a taxel that moves, and what it leaves in counts.
    fn curve(&self, taxel: usize) -> Option<Curved> {
        let seen = self.seen[taxel].as_ref().ok().filter(|seen| seen.swing > 0.0)?;
        let curve = self.whole.fit(&seen.groups);
        let on_curve = || self.on_curve(seen).map(|(group, _)| group);
        let row = |kpa: f64| self.whole.row(kpa, curve.zone_kpa);
        let folds = Folds::new(on_curve().map(|g| (row(g.kpa), g.weight, g.fold)), self.whole.form.free());
        let left = folds.residuals(&self.on_curve(seen).map(|(_, count)| count).collect::<Vec<f64>>());
        let span = curve.span().max(SPAN_MIN * seen.swing);
        let at = |kpa: f64| curve.counts_at(kpa);
        let of_groups = Moments::of(left.iter().zip(on_curve()).map(|(r, g)| (*r, at(g.kpa))), span);
        let load = self.load(taxel, seen);
        let known = |scan: &&usize| seen.gaps.binary_search(scan).is_err();
        let scans = on_curve().flat_map(|group| &group.scans).filter(known);
        let residual = |scan: &usize| {
            let u = at(self.course.kpa[*scan]);
            (load[*scan] - u, u)
        };
        let of_scans = Moments::of(scans.map(residual), span);
        let rms_counts = of_scans.mean_square().max(of_groups.mean_square()).sqrt() * span;
        let without = self.without.each_ref().map(|problem| Some(problem.as_ref()?.fit(&seen.groups)));
        Some(Curved { is_noise: curve.span() < span, curve, without, of_scans, of_groups, rms_counts, span })
    }

    /// Plays, and the soft inverse, if they err less on scans that were left out.
    fn choose_reading(&self, pilots: &[usize], curved: &[Option<Curved>], workers: &dyn Workers) -> ReadingChoice {
        let from = self.range_kpa[0] + LOADED * (self.range_kpa[1] - self.range_kpa[0]);
        let error = |plays: bool, soft: bool| {
            let squares = map(workers, pilots.len(), |i| {
                let clear = curved[pilots[i]].as_ref().filter(|curved| !curved.is_noise);
                let (Ok(seen), Some(curved)) = (&self.seen[pilots[i]], clear) else { return 0.0 };
                let load = self.load(pilots[i], seen);
                let lags = plays.then(|| lag::lags(&load, seen.swing));
                let readings = self.left_out(seen, curved, &load, lags.as_deref(), soft);
                let errors = readings.iter().zip(&self.course.kpa).filter(|(r, p)| r.is_finite() && **p > from);
                errors.map(|(r, p)| (r - p).powi(2)).sum()
            });
            squares.iter().sum::<f64>().sqrt()
        };
        let alone = error(false, false);
        let with_plays = self.falls.then(|| error(true, false));
        let plays = with_plays.is_some_and(|with| with < PLAYS_GAIN * alone);
        let plain = if plays { with_plays.unwrap_or(alone) } else { alone };
        let plays_error_ratio = with_plays.map(|with| with / alone).filter(|ratio| ratio.is_finite());
        ReadingChoice { plays, soft: error(plays, true) < SOFT_GAIN * plain, plays_error_ratio }
    }

    /// The weight of errors that count relative to the load.
    fn relative_weight(&self, kpa: f64) -> f64 {
        (kpa - self.range_kpa[0] + LIGHT_SHARE * (self.range_kpa[1] - self.range_kpa[0])).powi(-2)
    }

    /// The weights of the plays about a curve, from the falling groups that are chosen. What is left counts relative to the load:
    /// else the wide end of a loop that closes takes too much from every light touch.
    fn plays(&self, curve: &LoadCurve, seen: &Seen, lags: &[Lag], chosen: impl Fn(usize) -> bool) -> [f64; 4] {
        let falls = |g: usize, group: &Group| !group.rising && chosen(g) && !seen.groups[g].is_nan();
        let falling = self.course.groups.iter().enumerate().filter(|(g, group)| falls(*g, group));
        lag::weights(falling.map(|(g, group)| {
            let weight = group.weight * self.relative_weight(group.kpa);
            (weight, lag::mean(lags, &group.scans), curve.inverse(seen.groups[g]) - group.kpa)
        }))
    }

    /// Each scan read by the curve without its fold of groups, kPa; NaN for scans of no group.
    fn left_out(&self, seen: &Seen, curved: &Curved, load: &[f64], lags: Option<&[Lag]>, soft: bool) -> Vec<f64> {
        let mut readings = vec![f64::NAN; load.len()];
        for (k, curve) in curved.without.iter().enumerate() {
            let Some(curve) = curve else { continue };
            let plays = lags.map(|lags| (lags, self.plays(curve, seen, lags, |g| self.course.reading_fold(g) != k)));
            let soft = soft.then(|| curve.soft(curved.rms_counts));
            let own = |(g, _): &(usize, &Group)| self.course.reading_fold(*g) == k;
            for (_, group) in self.course.groups.iter().enumerate().filter(own) {
                for scan in &group.scans {
                    let kpa = soft.as_ref().map_or_else(|| curve.read(load[*scan]), |soft| soft.read(load[*scan]));
                    let taken = plays
                        .as_ref()
                        .map_or(0.0, |(lags, weights)| lag::taken_kpa(lags[*scan].map(f64::from), weights));
                    readings[*scan] = kpa - taken;
                }
            }
        }
        seen.gaps.iter().for_each(|scan| readings[*scan] = f64::NAN);
        readings
    }

    /// The groups that tell of a taxel's curve, and its mean load counts in each.
    fn on_curve<'s>(&'s self, seen: &'s Seen) -> impl Iterator<Item = (&'s Group, f64)> {
        let groups = self.course.groups.iter().zip(seen.groups.iter().copied());
        groups.filter(|(group, count)| group.on_curve && !count.is_nan())
    }

    /// By how much a curve reads each group too high that it is not fitted to, kPa; NaN of the others.
    fn others_kpa(&self, curve: &LoadCurve, seen: &Seen, plays: Option<(&[Lag], [f64; 4])>) -> Vec<f64> {
        let off_kpa = |(group, load): (&Group, &f64)| {
            if group.on_curve || load.is_nan() {
                return f64::NAN;
            }
            let taken = |(lags, weights)| lag::taken_kpa(lag::mean(lags, &group.scans), &weights);
            let taken = plays.map_or(0.0, taken);
            curve.read(*load) - taken - group.kpa
        };
        self.course.groups.iter().zip(&seen.groups).map(off_kpa).collect()
    }

    /// Root mean square over light groups of what the left-out readings of the taxels in use have in common, of those that show
    /// their load; kPa.
    fn shared_kpa(&self, curved: &[Option<Curved>], taxels: &[Result<FittedTaxel, Status>]) -> Option<f64> {
        let groups = &self.course.groups;
        let width = groups.iter().filter(|g| g.on_curve).map(|g| g.kpa).fold(0.0, f64::max) - self.course.rest_kpa;
        let light = LIGHT.map(|share| self.course.rest_kpa + share * width);
        let mut sums = vec![(0.0, 0.0); groups.len()];
        for ((seen, curved), taxel) in self.seen.iter().zip(curved).zip(taxels) {
            let (Ok(seen), Some(curved), Ok(taxel)) = (seen, curved, taxel) else { continue };
            for ((g, group), count) in groups.iter().enumerate().zip(&seen.groups) {
                let is_light = group.on_curve && group.kpa > light[0] && group.kpa < light[1];
                let shows = taxel.status.is_ok() && is_light && *count > SHOWN * taxel.noise_counts;
                if let Some(curve) = curved.without[self.course.reading_fold(g)].as_ref().filter(|_| shows) {
                    sums[g] = (sums[g].0 + curve.read(*count) - group.kpa, sums[g].1 + 1.0);
                }
            }
        }
        root_mean_square(sums.iter().filter(|(_, n)| *n > 0.0).map(|(sum, n)| sum / n))
    }

    /// What falling groups are read wrong by, as a share of the root of the load that has gone times that which is left, where more has
    /// gone: where it turns, counts stay for a while. Light loads count relative to the load, as for the plays.
    fn fall_share(&self, taxels: &[Result<FittedTaxel, Status>]) -> Option<f64> {
        let [rest_kpa, top_kpa] = self.range_kpa;
        let (mut off, mut product) = (0.0, 0.0);
        let fallen = common_kpa(taxels, &self.course.groups, false).into_iter();
        for (kpa, off_kpa) in fallen.filter(|(kpa, _)| kpa - rest_kpa < top_kpa - kpa) {
            off += self.relative_weight(kpa) * off_kpa.powi(2);
            product += self.relative_weight(kpa) * (kpa - rest_kpa) * (top_kpa - kpa);
        }
        (product > 0.0).then(|| (off / product).sqrt())
    }

    fn taxel(
        &self,
        taxel: usize,
        seen: &Seen,
        curved: &Curved,
        shapes: [Variance; 2],
        reading: &ReadingChoice,
    ) -> FittedTaxel {
        let load = self.load(taxel, seen);
        let lags = reading.plays.then(|| lag::lags(&load, seen.swing));
        let readings = self.left_out(seen, curved, &load, lags.as_deref(), reading.soft);
        let pairs = || readings.iter().copied().zip(self.course.kpa.iter().copied());
        let squares = pairs().filter(|(r, _)| r.is_finite()).map(|(r, p)| (r - p).powi(2));
        let curve = &curved.curve;
        let noise = Noise::new(curved.span, (&curved.of_scans, shapes[0]), (&curved.of_groups, shapes[1]));
        let plays_kpa = lags.as_ref().map(|lags| self.plays(curve, seen, lags, |_| true));
        let prior_scans = PRIOR_GROUPS * load.len() as f64 / self.course.groups.len() as f64;
        FittedTaxel {
            status: Status::Ok,
            sign: seen.sign,
            zero_counts: seen.zero_counts,
            noise_counts: if self.zero_known { seen.noise_counts } else { curved.rms_counts },
            swing_counts: seen.swing,
            soft: reading.soft.then(|| curve.soft(curved.rms_counts)),
            others_kpa: self.others_kpa(curve, seen, lags.as_deref().zip(plays_kpa)),
            plays_kpa,
            sigma: SigmaByReading::new(curve, &noise, self.range_kpa, pairs(), prior_scans),
            error_kpa: mean(squares).sqrt(),
            top_kpa: self.on_curve(seen).map(|(group, _)| group.kpa).fold(f64::NEG_INFINITY, f64::max),
            curve: curve.clone(),
        }
    }
}

/// The taxels with their status: by swing, and by error beside that of the others and the `spread` of the pressures.
fn judged(
    mut taxels: Vec<Result<FittedTaxel, Status>>,
    swing_min: f64,
    spread_kpa: f64,
    samples: u64,
) -> Vec<Result<FittedTaxel, Status>> {
    let moving = |taxel: &&FittedTaxel| taxel.swing_counts >= swing_min;
    let errors = taxels.iter().flatten().filter(moving).map(|taxel| taxel.error_kpa);
    let limit_kpa = (ERROR_MAX * median(errors.collect())).min(SAYS_NOTHING * spread_kpa);
    for taxel in taxels.iter_mut().flatten() {
        let (swing_counts, rmse_kpa) = (taxel.swing_counts, taxel.error_kpa);
        if swing_counts < swing_min {
            taxel.status = Status::InsufficientSwing { swing_counts, needed_counts: swing_min };
        } else if rmse_kpa.is_nan() {
            taxel.status = Status::Unproven { samples };
            taxel.error_kpa = 0.0;
        } else if rmse_kpa > limit_kpa {
            taxel.status = Status::PoorFit { rmse_kpa, limit_kpa };
        }
    }
    taxels
}

/// `None` of nothing.
fn root_mean_square(values: impl Iterator<Item = f64>) -> Option<f64> {
    Some(mean(values.map(|value| value * value)).sqrt()).filter(|root| !root.is_nan())
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
