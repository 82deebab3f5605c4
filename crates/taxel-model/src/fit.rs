//! One fit from end to end.

use crate::curve::Curve;
use crate::dd::Dd;
use crate::model::{Quality, Sign, TaxelModel};
use crate::options::{Estimator, FitOptions, MIN_BINNED_SAMPLES, Order, Shape};
use crate::order::{choose, press_by_order};
use crate::orthogonal::Basis;
use crate::reduce::{CodeStat, Reduced};
use crate::refine::solve;
use crate::series::{Chebyshev, chebyshev_of};
use crate::shape::{Problem, isotonic_squares, repair, wrong_slope};
use crate::status::{Flag, Status};
use crate::uncertainty::{Evidence, Scatter, profile, student_975};

/// The samples contradict monotony if the best monotone function of any form has this much more RMSE than the curve
/// has. A polynomial that cannot follow monotone samples without a wave is another matter: that one is repaired.
const CONTRADICTION: f64 = 1.25;

/// A sample with more leverage than this decides the curve at its count alone.
const HIGH_LEVERAGE: f64 = 0.9;

/// An interval without a sample of this share of the range is a gap.
const GAP_SHARE: f64 = 0.25;

/// Share of the samples that the range of real counts loses at each end.
const REAL_TRIM: f64 = 0.002;

/// Share of the samples that the range of integer counts may lose at an end because none of those counts was seen often,
/// where counts hardly repeat.
const END_MAX: f64 = 0.01;

/// Counts repeat if half of them were seen so many times as often as the count at an end of the range must be.
const DENSE: f64 = 2.0;

/// A curve may be this far from the projection that it stands for, as a share of the largest pressure. Healthy ones
/// are within 1e-14; a cluster of counts with one 1e5 times as far away as it is wide is beyond f64.
const CURVE_TOLERANCE: f64 = 1e-9;

/// Below this standard deviation of the pressure, kPa, squares vanish: no gauge means it.
const LEAST_PRESSURE_SD_KPA: f64 = 1e-100;

/// Fits the model of one taxel. Never panics: [`TaxelModel::status`] says why there is no usable curve.
pub(crate) fn fit_reduced(data: &Reduced, options: &FitOptions) -> TaxelModel {
    let mut flags: Vec<Flag> = data.dropped.iter().map(|&(count, share)| Flag::RailDropped { count, share }).collect();
    if data.rejected > 0 {
        flags.push(Flag::Rejected { samples: data.rejected });
    }
    let samples = data.samples as u64;
    if options.estimator == Estimator::PressureBinned && !data.binned {
        flags.push(Flag::NotBinned { samples });
    }
    let quality = Quality { samples, distinct_counts: data.codes.len() as u32, ..Quality::default() };
    let none = |status, flags| TaxelModel {
        flags,
        estimator: options.estimator.used(data.binned),
        quality: quality.clone(),
        ..TaxelModel::without_curve(status, options.gauge)
    };
    let Some(first) = data.codes.first() else {
        return none(Status::NoData, flags);
    };
    let spread = data.pressure_spread();
    let silent = spread.sd_kpa <= (10.0 * options.gauge.noise_kpa).max(LEAST_PRESSURE_SD_KPA);
    if silent && samples > 1 {
        return none(Status::NoExcitation { pressure_sd_kpa: spread.sd_kpa }, flags);
    }
    if data.codes.len() == 1 {
        let count = first.x.to_f64();
        let status = if samples > 1 { Status::Dead { count } } else { Status::Unproven { samples } };
        let mut model = none(status, flags);
        model.range = Some([count, count]);
        model.curve = Some(Curve { centre: count, half_width: 1.0, chebyshev: vec![first.mean.to_f64()] });
        model.raw_coefficients = vec![first.mean.to_f64()];
        model.quality.rank = 1;
        return model;
    }
    if data.rows.is_empty() {
        return none(Status::Clipped, flags);
    }
    Fit::new(data, options).model(flags, quality, spread.range_kpa)
}

/// The pieces that a fit is made of, from the frame of its variable to the curve.
struct Fit<'a> {
    data: &'a Reduced,
    options: &'a FitOptions,
    range: [f64; 2],
    centre: f64,
    half: f64,
    /// Power of two not below `half`: t = (x - centre) / scale is exact.
    scale: f64,
    basis: Basis,
    root_n: Vec<f64>,
    /// sqrt(n) y, and its coefficients in the basis.
    z: Vec<f64>,
    d: Vec<f64>,
    t: Vec<Dd>,
}

impl<'a> Fit<'a> {
    fn new(data: &'a Reduced, options: &'a FitOptions) -> Self {
        let range = calibrated_range(data, options);
        let (centre, half) = Curve::frame(range[0], range[1]);
        let scale = 2.0_f64.powi(half.log2().ceil() as i32);
        let t: Vec<Dd> = data
            .rows
            .iter()
            .map(|row| (Dd::sum(row.x.hi, -centre) + Dd::from(row.x.lo)).scale_exact(1.0 / scale))
            .collect();
        let rounded: Vec<f64> = t.iter().map(|t| t.to_f64()).collect();
        let root_n: Vec<f64> = data.rows.iter().map(|row| row.n.sqrt()).collect();
        let max_order = options.max_order().min(data.codes.len() - 1);
        let basis = Basis::new(&rounded, &root_n, max_order);
        let z: Vec<f64> = data.rows.iter().zip(&root_n).map(|(row, root_n)| root_n * row.y.hi).collect();
        let d = basis.project(&z);
        Self { data, options, range, centre, half, scale, basis, root_n, z, d, t }
    }

    fn sign(&self) -> Sign {
        if self.d.get(1).is_some_and(|slope| *slope > 0.0) { Sign::Rising } else { Sign::Falling }
    }

    /// The ends of the range in s.
    fn ends(&self) -> (Dd, Dd) {
        let s = |count: f64| Dd::sum(count, -self.centre).div_f64(self.half);
        (s(self.range[0]), s(self.range[1]))
    }

    fn scatter(&self, curve: &Curve) -> Vec<Scatter> {
        let [low, high] = self.range;
        let of = |code: &CodeStat| {
            let count = code.x.to_f64();
            let residual = code.mean.to_f64() - curve.evaluate(count.max(low).min(high));
            Scatter { count, n: code.n, squares: code.ss + code.n * residual * residual }
        };
        self.data.codes.iter().map(of).collect()
    }

    fn rmse(&self, scatter: &[Scatter]) -> f64 {
        (scatter.iter().map(|s| s.squares).sum::<f64>() / self.data.samples).sqrt()
    }

    /// RMSE of the best monotone function of the count.
    fn isotonic_rmse(&self, sign: f64) -> f64 {
        let codes = &self.data.codes;
        let within: f64 = codes.iter().map(|code| code.ss).sum();
        let between = isotonic_squares(codes.iter().map(|code| (code.n, code.mean.to_f64())), sign);
        ((within + between) / self.data.samples).sqrt()
    }

    /// The least-squares curve of the highest order up to `order` that is itself: on nearly dependent counts neither
    /// the recurrence of the basis nor coefficients in f64 can hold what the vectors of the basis still tell.
    fn free(&self, order: usize) -> (Chebyshev, usize) {
        let solution = solve(&self.basis, &self.data.rows, &self.t, &self.d, order, self.options.exact);
        let free = chebyshev_of(&solution, self.half / self.scale);
        if order == 0 || self.is_projection(&free, order) { (free, order) } else { self.free(order - 1) }
    }

    /// Whether the curve has the pressures at the rows in range that the basis says.
    fn is_projection(&self, free: &Chebyshev, order: usize) -> bool {
        let curve = Curve::new(free, self.centre, self.half);
        let largest = self.data.rows.iter().fold(0.0, |largest: f64, row| largest.max(row.y.hi.abs()));
        let [low, high] = self.range;
        let projection = self.basis.weighted_values(&self.d[..=order]);
        let rows = self.data.rows.iter().zip(self.root_n.iter().zip(&projection));
        let mut in_range = rows.filter(|(row, _)| (low..=high).contains(&row.x.to_f64())).peekable();
        // Rows that all lie beyond the range vouch for nothing within it.
        in_range.peek().is_some()
            && in_range.all(|(row, (root_n, projection))| {
                let error = curve.evaluate(row.x.to_f64()) - projection / root_n;
                error.abs() <= CURVE_TOLERANCE * largest
            })
    }

    /// The curve that is served, with the status and flags that the shape of the `free` one earns.
    fn shaped(&self, free: Chebyshev, order: usize, flags: &mut Vec<Flag>) -> (Chebyshev, Option<Status>) {
        let (from, to) = self.ends();
        let sign = self.sign().as_f64();
        let Some(place) = wrong_slope(&free, from, to, sign) else { return (free, None) };
        let small = (self.data.samples as u64) < MIN_BINNED_SAMPLES;
        let report = match self.options.shape {
            _ if self.options.estimator == Estimator::Paper => true,
            Shape::Auto => small && !self.data.integer,
            Shape::Repair => false,
            Shape::Report => true,
        };
        if report {
            flags.push(Flag::NotMonotone { count: self.centre + place * self.half });
            return (free, None);
        }
        let s: Vec<f64> = self.t.iter().map(|t| t.to_f64() * (self.scale / self.half)).collect();
        let problem = Problem { basis: &self.basis, s: &s, root_n: &self.root_n, d: &self.d, order, sign };
        let rmse = |series: &Chebyshev| self.rmse(&self.scatter(&Curve::new(series, self.centre, self.half)));
        // A free curve through all points has no RMSE to compare with; the ratio stays a number that files can hold.
        let free_rmse = rmse(&free);
        let ratio = |monotone: f64| if monotone <= free_rmse { 1.0 } else { (monotone / free_rmse).min(f64::MAX) };
        let isotonic_ratio = ratio(self.isotonic_rmse(sign));
        if isotonic_ratio > CONTRADICTION {
            return (free, Some(Status::NotMonotone { rmse_ratio: isotonic_ratio }));
        }
        let monotone = repair(&problem, from, to, self.data.pressure_spread().range_kpa);
        let rmse_ratio = ratio(rmse(&monotone));
        if wrong_slope(&monotone, from, to, sign).is_some() {
            return (free, Some(Status::NotMonotone { rmse_ratio }));
        }
        flags.push(Flag::Repaired { rmse_ratio });
        (monotone, None)
    }

    fn model(&self, mut flags: Vec<Flag>, mut quality: Quality, pressure_range_kpa: f64) -> TaxelModel {
        let (data, options) = (self.data, self.options);
        let scores = press_by_order(&self.basis, &self.z, &self.d);
        let carried = self.basis.order();
        let order = match options.order {
            Order::Fixed(_) => carried,
            Order::Auto => choose(&scores).min(carried),
        };
        let (free, order) = self.free(order);
        if let Order::Fixed(_) = options.order
            && order < options.max_order()
        {
            flags.push(Flag::RankReduced { asked: options.max_order() as u8, used: order as u8 });
        }
        let (series, shape_status) = self.shaped(free, order, &mut flags);
        let curve = Curve::new(&series, self.centre, self.half);
        let repaired = flags.iter().any(|flag| matches!(flag, Flag::Repaired { .. }));
        self.flag_support(order, &mut flags, &mut quality);
        let scatter = self.scatter(&curve);
        quality.rank = carried as u8 + 1;
        quality.swing_counts = self.range[1] - self.range[0];
        quality.dof = (data.samples - (order + 1) as f64).max(0.0);
        quality.rmse_kpa = self.rmse(&scatter);
        quality.press_kpa = scores.get(order).and_then(|score| score.press_kpa);
        quality.press_by_order = scores;
        self.lack_of_fit(&scatter, order, &mut quality);
        quality.repeatability_kpa = self.repeatability(&curve);
        let evidence = Evidence {
            scatter: &scatter,
            range: self.range,
            integer: data.integer,
            dof: quality.dof,
            basis: &self.basis,
            d: &self.d,
            order,
            scale: self.scale,
            curve: &curve,
        };
        let sigma = profile(&evidence).map(|(sigma, support)| {
            let full_scale = options.exclusion.full_scale_kpa.unwrap_or(pressure_range_kpa);
            let half_width = student_975(quality.dof) * weighted_median(&sigma.sigma_kpa, &support);
            quality.interval_kpa = Some(half_width).filter(|width| width.is_finite());
            quality.interval_share = Some(half_width / full_scale).filter(|share| share.is_finite());
            sigma
        });
        let status = shape_status.unwrap_or_else(|| self.status(&quality));
        TaxelModel {
            status,
            flags,
            estimator: options.estimator.used(data.binned),
            order: order as u8,
            sign: self.sign(),
            range: Some(self.range),
            raw_coefficients: Curve::raw_coefficients(&series, self.centre, self.half),
            curve: Some(curve),
            points: None,
            sigma,
            gauge: options.gauge,
            quality,
            repaired,
        }
    }

    fn status(&self, quality: &Quality) -> Status {
        let exclusion = &self.options.exclusion;
        if quality.swing_counts < exclusion.min_swing_counts {
            let (swing_counts, needed_counts) = (quality.swing_counts, exclusion.min_swing_counts);
            return Status::InsufficientSwing { swing_counts, needed_counts };
        }
        if quality.dof <= 0.0 {
            return Status::Unproven { samples: quality.samples };
        }
        if self.options.estimator == Estimator::Paper {
            return Status::Ok;
        }
        match quality.interval_share {
            Some(share) if share <= exclusion.max_interval_share => Status::Ok,
            share => Status::IntervalTooWide { share: share.unwrap_or(f64::MAX), limit: exclusion.max_interval_share },
        }
    }

    /// Flags where few or single samples carry the curve.
    fn flag_support(&self, order: usize, flags: &mut Vec<Flag>, quality: &mut Quality) {
        let wanted = 2 * (order as u32 + 1);
        if quality.distinct_counts < wanted {
            flags.push(Flag::FewDistinctCounts { distinct: quality.distinct_counts, wanted });
        }
        for (row, of_row) in self.data.rows.iter().zip(self.basis.row_leverages(order)) {
            let leverage = of_row / row.n;
            if leverage > quality.max_leverage {
                quality.max_leverage = leverage;
                if leverage > HIGH_LEVERAGE {
                    flags.retain(|flag| !matches!(flag, Flag::HighLeverage { .. }));
                    flags.push(Flag::HighLeverage { count: row.x.to_f64(), leverage });
                }
            }
        }
        let pairs = self.data.codes.windows(2).map(|pair| (pair[0].x.to_f64(), pair[1].x.to_f64()));
        let inside = pairs.filter(|(from, to)| *from >= self.range[0] && *to <= self.range[1]);
        let widest = inside.max_by(|a, b| (a.1 - a.0).total_cmp(&(b.1 - b.0)));
        if let Some((from, to)) = widest
            && to - from > GAP_SHARE * (self.range[1] - self.range[0])
            && to - from > 1.0
        {
            flags.push(Flag::Gap { from, to });
        }
    }

    fn lack_of_fit(&self, scatter: &[Scatter], order: usize, quality: &mut Quality) {
        let (samples, codes) = (self.data.samples, self.data.codes.len() as f64);
        let pure: f64 = self.data.codes.iter().map(|code| code.ss).sum();
        let (pure_dof, lack_dof) = (samples - codes, codes - (order + 1) as f64);
        if pure_dof <= 0.0 {
            return;
        }
        quality.pure_error_kpa = Some((pure / pure_dof).sqrt());
        let lack = (scatter.iter().map(|s| s.squares).sum::<f64>() - pure).max(0.0);
        if lack_dof > 0.0 && pure > 0.0 {
            quality.lack_of_fit_f = Some((lack / lack_dof) / (pure / pure_dof));
        }
    }

    /// Standard deviation between ramps of the mean residual, kPa.
    fn repeatability(&self, curve: &Curve) -> Option<f64> {
        let [low, high] = self.range;
        let means: Vec<f64> = self
            .data
            .ramps
            .iter()
            .filter_map(|ramp| {
                let n: f64 = ramp.groups.iter().map(|group| group.1).sum();
                let residual = |&(count, n, sum): &(f64, f64, f64)| sum - n * curve.evaluate(count.max(low).min(high));
                (n > 0.0).then(|| ramp.groups.iter().map(residual).sum::<f64>() / n)
            })
            .collect();
        let n = means.len() as f64;
        if n < 2.0 {
            return None;
        }
        let mean = means.iter().sum::<f64>() / n;
        Some((means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt())
    }
}

/// The range of counts in which the curve may be evaluated.
///
/// A recording's rare outermost counts are noise, and bins of pressure say nothing about counts beyond their means: a
/// polynomial must not be extended to either. The paper leaves nothing out.
fn calibrated_range(data: &Reduced, options: &FitOptions) -> [f64; 2] {
    let samples = data.samples;
    let all = ends(&data.codes).unwrap_or([0.0, 0.0]);
    let mut range = all;
    if samples >= MIN_BINNED_SAMPLES as f64 && options.estimator != Estimator::Paper {
        let often = f64::from(options.min_samples_at_ends);
        // Half of the counts, and not their mean: a long rest at one count says nothing of the others.
        let dense = 2 * data.codes.iter().filter(|code| code.n >= DENSE * often).count() >= data.codes.len();
        let often = data.integer.then_some((often, if dense { 1.0 } else { END_MAX }));
        let ends =
            [trimmed_end(data.codes.iter(), samples, often), trimmed_end(data.codes.iter().rev(), samples, often)];
        if let [Some(low), Some(high)] = ends
            && high > low
        {
            range = [low, high];
        }
    }
    if data.binned && !data.rows.is_empty() {
        let x = || data.rows.iter().map(|row| row.x.to_f64());
        let (low, high) = (x().fold(f64::INFINITY, f64::min), x().fold(f64::NEG_INFINITY, f64::max));
        let (low, high) = if data.integer { (low.floor(), high.ceil()) } else { (low, high) };
        let inner = [range[0].max(low), range[1].min(high)];
        range = if inner[1] > inner[0] { inner } else { range };
    }
    range
}

/// Where the calibrated range ends, from the outermost of `codes` inwards: at the first count that was seen `often`, how
/// many times and within which share of the samples. Without such a count, [`REAL_TRIM`] of the samples lie beyond.
fn trimmed_end<'a>(
    codes: impl Iterator<Item = &'a CodeStat> + Clone,
    samples: f64,
    often: Option<(f64, f64)>,
) -> Option<f64> {
    let first_beyond = |share: f64, often: f64| {
        let mut seen = 0.0;
        codes.clone().find(|code| {
            seen += code.n;
            seen > share * samples || code.n >= often
        })
    };
    let common = often.and_then(|(often, within)| first_beyond(within, often).filter(|code| code.n >= often));
    common.or_else(|| first_beyond(REAL_TRIM, f64::INFINITY)).map(|code| code.x.to_f64())
}

/// The least and the greatest count; `codes` are ascending.
fn ends(codes: &[CodeStat]) -> Option<[f64; 2]> {
    Some([codes.first()?.x.to_f64(), codes.last()?.x.to_f64()])
}

/// The value below which half of the weight lies.
fn weighted_median(values: &[f64], weights: &[f64]) -> f64 {
    let mut pairs: Vec<(f64, f64)> = values.iter().copied().zip(weights.iter().copied()).collect();
    pairs.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let half = weights.iter().sum::<f64>() / 2.0;
    let mut sum = 0.0;
    let found = pairs.iter().find(|(_, weight)| {
        sum += weight;
        sum >= half
    });
    found.map_or(f64::INFINITY, |pair| pair.0)
}
