//! The paper's polynomial of one taxel, from end to end.

use crate::curve::Curve;
use crate::dd::Dd;
use crate::model::{Quality, Sign, TaxelModel};
use crate::options::{FitOptions, MAX_ORDER};
use crate::orthogonal::Basis;
use crate::refine::{Solution, solve};
use crate::samples::{Reduced, Samples, reduce};
use crate::series::{chebyshev_of, raw_powers_of};
use crate::status::{Flag, Status};
use crate::uncertainty::{MAX_KNOTS, SigmaProfile, student_975};

/// A sample with more leverage than this decides the curve at its count alone.
const HIGH_LEVERAGE: f64 = 0.9;

/// An interval without a sample of this share of the range is a gap.
const GAP_SHARE: f64 = 0.25;

/// A curve may be this far from the projection that it stands for, as a share of the largest pressure. Healthy ones
/// are within 1e-14; a cluster of counts with one 1e5 times as far away as it is wide is beyond f64.
const CURVE_TOLERANCE: f64 = 1e-9;

/// Samples that the pooled variance counts for.
const PRIOR_SAMPLES: f64 = 8.0;

/// Knots of the standard deviation over a range of real counts, or of more than [`MAX_KNOTS`] integer ones.
const REAL_KNOTS: usize = 64;

/// Below this standard deviation of the pressure, kPa, squares vanish: no gauge means it.
const LEAST_PRESSURE_SD_KPA: f64 = 1e-100;

/// Fits the paper's polynomial of one taxel: the sum of (P - P(C))^2 over all samples. The curve is as it comes out over all
/// counts that were seen, monotone or not. Never panics: [`TaxelModel::status`] says why there is no usable curve.
#[must_use]
pub fn fit(samples: &Samples<'_>, options: &FitOptions) -> TaxelModel {
    let data = &reduce(samples);
    let flags: Vec<Flag> = if data.rejected > 0 { vec![Flag::Rejected { samples: data.rejected }] } else { Vec::new() };
    let samples = data.samples as u64;
    let quality = Quality { samples, distinct_counts: data.rows.len() as u32, ..Quality::default() };
    let none = |status, flags| TaxelModel {
        flags,
        quality: quality.clone(),
        ..TaxelModel::without_curve(status, options.gauge)
    };
    let (Some(first), Some(last)) = (data.rows.first(), data.rows.last()) else {
        return none(Status::NoData, flags);
    };
    let mean = data.rows.iter().map(|r| r.n * r.y.hi).sum::<f64>() / data.samples;
    let squares: f64 = data.rows.iter().map(|r| r.ss + r.n * (r.y.hi - mean).powi(2)).sum();
    let pressure_sd_kpa = (squares / data.samples).sqrt();
    if pressure_sd_kpa <= (10.0 * options.gauge.noise_kpa).max(LEAST_PRESSURE_SD_KPA) && samples > 1 {
        return none(Status::NoExcitation { pressure_sd_kpa }, flags);
    }
    if data.rows.len() == 1 {
        let count = first.x;
        let status = if samples > 1 { Status::Dead { count } } else { Status::Unproven { samples } };
        let mut model = none(status, flags);
        model.range = Some([count, count]);
        model.curve = Some(Curve { centre: count, half_width: 1.0, chebyshev: vec![first.y.hi] });
        model.raw_coefficients = vec![first.y.hi];
        model.quality.rank = 1;
        return model;
    }
    Fit::new(data, options, [first.x, last.x]).model(flags, quality)
}

/// The pieces that a fit is made of, from the frame of its variable to the curve.
struct Fit<'a> {
    data: &'a Reduced,
    options: &'a FitOptions,
    /// The order asked for.
    asked: usize,
    /// The least and the greatest count.
    range: [f64; 2],
    centre: f64,
    half: f64,
    /// Power of two not below `half`: t = (x - centre) / scale is exact.
    scale: f64,
    basis: Basis,
    root_n: Vec<f64>,
    /// Coefficients in the basis of sqrt(n) y.
    d: Vec<f64>,
    t: Vec<Dd>,
}

impl<'a> Fit<'a> {
    fn new(data: &'a Reduced, options: &'a FitOptions, range: [f64; 2]) -> Self {
        let (centre, half) = Curve::frame(range[0], range[1]);
        let scale = 2.0_f64.powi(half.log2().ceil() as i32);
        let scaled = |t: Dd| Dd { hi: t.hi * (1.0 / scale), lo: t.lo * (1.0 / scale) };
        let t: Vec<Dd> = data.rows.iter().map(|row| scaled(Dd::from(row.x) - Dd::from(centre))).collect();
        let rounded: Vec<f64> = t.iter().map(|t| t.hi).collect();
        let root_n: Vec<f64> = data.rows.iter().map(|row| row.n.sqrt()).collect();
        let asked = usize::from(options.order.clamp(1, MAX_ORDER));
        let basis = Basis::new(&rounded, &root_n, asked.min(data.rows.len() - 1));
        let z: Vec<f64> = data.rows.iter().zip(&root_n).map(|(row, root_n)| root_n * row.y.hi).collect();
        let d = basis.project(&z);
        Self { data, options, asked, range, centre, half, scale, basis, root_n, d, t }
    }

    fn sign(&self) -> Sign {
        if self.d.get(1).is_some_and(|slope| *slope > 0.0) { Sign::Rising } else { Sign::Falling }
    }

    /// The least-squares curve of the highest order up to `order` that is itself: on nearly dependent counts neither
    /// the recurrence of the basis nor coefficients in f64 can hold what the vectors of the basis still tell.
    fn solve(&self, order: usize) -> (Solution, Curve) {
        let solution = solve(&self.basis, &self.data.rows, &self.t, &self.d, order);
        let chebyshev = chebyshev_of(&solution, self.half / self.scale).iter().map(|c| c.hi).collect();
        let curve = Curve { centre: self.centre, half_width: self.half, chebyshev };
        if order == 0 || self.is_projection(&curve) { (solution, curve) } else { self.solve(order - 1) }
    }

    /// Whether the curve has the pressures at the rows that the basis says.
    fn is_projection(&self, curve: &Curve) -> bool {
        let largest = self.data.rows.iter().fold(0.0, |largest: f64, row| largest.max(row.y.hi.abs()));
        let projection = self.basis.weighted_values(&self.d[..=curve.order()]);
        let mut rows = self.data.rows.iter().zip(self.root_n.iter().zip(&projection));
        rows.all(|(row, (root_n, projection))| {
            (curve.evaluate(row.x) - projection / root_n).abs() <= CURVE_TOLERANCE * largest
        })
    }

    fn model(&self, mut flags: Vec<Flag>, mut quality: Quality) -> TaxelModel {
        let (data, carried) = (self.data, self.basis.order());
        let (solution, curve) = self.solve(carried);
        let order = curve.order();
        if order < self.asked {
            flags.push(Flag::RankReduced { asked: self.asked as u8, used: order as u8 });
        }
        if let Some(count) = curve.wrong_slope(self.range, self.sign().as_f64()) {
            flags.push(Flag::NotMonotone { count });
        }
        self.flag_support(order, &mut flags, &mut quality);
        let squares: Vec<f64> =
            data.rows.iter().map(|row| row.ss + row.n * (row.y.hi - curve.evaluate(row.x)).powi(2)).collect();
        quality.rank = carried as u8 + 1;
        quality.swing_counts = self.range[1] - self.range[0];
        quality.dof = (data.samples - (order + 1) as f64).max(0.0);
        quality.rmse_kpa = (squares.iter().sum::<f64>() / data.samples).sqrt();
        let sigma = (quality.dof > 0.0).then(|| {
            let (sigma, support) = self.sigma(&curve, &squares, quality.dof);
            let means = data.rows.iter().map(|row| row.y.hi);
            let (low, high) = means.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), y| (lo.min(y), hi.max(y)));
            let half_width = student_975(quality.dof) * weighted_median(&sigma.sigma_kpa, &support);
            quality.interval_kpa = Some(half_width).filter(|width| width.is_finite());
            quality.interval_share = Some(half_width / (high - low)).filter(|share| share.is_finite());
            sigma
        });
        TaxelModel {
            status: self.status(&quality),
            flags,
            order: order as u8,
            sign: self.sign(),
            range: Some(self.range),
            raw_coefficients: raw_powers_of(&solution, self.scale, self.centre),
            curve: Some(curve),
            sigma,
            quality,
            ..TaxelModel::without_curve(Status::Ok, self.options.gauge)
        }
    }

    /// The standard deviation of a reading, and how many samples support each knot. `squares` are the sums of squared residuals
    /// of the rows, with `dof` degrees of freedom.
    ///
    /// var(C) = v(C) + s^2 h(C). v is the mean square of the residuals at and next to the count, shrunk towards the pooled
    /// s^2 where samples are few: skin is noisier, in kPa, where it is flat, and a pooled value alone covers only four
    /// of five readings there. h is the leverage of a new sample. What gauge and area share among taxels is not in it.
    fn sigma(&self, curve: &Curve, squares: &[f64], dof: f64) -> (SigmaProfile, Vec<f64>) {
        let ([low, high], rows) = (self.range, &self.data.rows);
        let integer = rows.iter().all(|row| row.x.fract() == 0.0);
        let by_count = integer && high - low < MAX_KNOTS;
        let intervals = if by_count { (high - low).max(0.0) as usize } else { REAL_KNOTS };
        // Counts as near as the smallest numbers, or as far apart as the greatest, have no width to divide.
        let width = (high - low) / REAL_KNOTS as f64;
        let step = if !by_count && width.is_normal() { width } else { 1.0 };
        // A knot more at each end, so that every one has two neighbours.
        let (mut n, mut near_squares) = (vec![0.0; intervals + 3], vec![0.0; intervals + 3]);
        for (row, squares) in rows.iter().zip(squares) {
            let at = (((row.x - low) / step).clamp(0.0, intervals as f64) + 0.5) as usize + 1;
            n[at] += row.n;
            near_squares[at] += squares;
        }
        let pooled = near_squares.iter().sum::<f64>() / dof;
        let counts: Vec<f64> = (0..=intervals).map(|k| low + k as f64 * step).collect();
        let t: Vec<f64> = counts.iter().map(|count| (count - self.centre) / self.scale).collect();
        let windows = n.windows(3).zip(near_squares.windows(3));
        // Samples that a curve meets exactly say nothing of its error, but it was computed in doubles.
        let rounding = f64::EPSILON * curve.chebyshev.iter().map(|c| c.abs()).sum::<f64>();
        let sigma_kpa = windows
            .zip(counts.iter().zip(self.basis.leverages(&t, curve.order())))
            .map(|((n, squares), (count, (leverage, last)))| {
                let near = n[0] + n[1] + n[2];
                let sum = (squares[0] + squares[1] + squares[2]) * self.data.samples / dof;
                let local = (sum + PRIOR_SAMPLES * pooled) / (near + PRIOR_SAMPLES);
                let quantum = if integer { curve.slope(*count).powi(2) / 12.0 } else { 0.0 };
                // Where no sample shows the curve, the step from the next lower order stands for its error.
                let unseen = if near > 0.0 { 0.0 } else { self.d[curve.order()] * last };
                // Quantisation is in the residuals of integer counts already: it is a floor, not a term. Far from all
                // samples a basis overflows: the deviation stays a number that files can hold.
                (local.max(quantum) + pooled * leverage + unseen * unseen).sqrt().max(rounding).min(f64::MAX)
            })
            .collect();
        (SigmaProfile { first_count: low, step_counts: step, sigma_kpa }, n[1..=intervals + 1].to_vec())
    }

    fn status(&self, quality: &Quality) -> Status {
        let (swing_counts, needed_counts) = (quality.swing_counts, self.options.min_swing_counts);
        if swing_counts < needed_counts {
            return Status::InsufficientSwing { swing_counts, needed_counts };
        }
        if quality.dof <= 0.0 {
            return Status::Unproven { samples: quality.samples };
        }
        Status::Ok
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
                    flags.push(Flag::HighLeverage { count: row.x, leverage });
                }
            }
        }
        let pairs = self.data.rows.windows(2).map(|pair| (pair[0].x, pair[1].x));
        let widest = pairs.max_by(|a, b| (a.1 - a.0).total_cmp(&(b.1 - b.0)));
        if let Some((from, to)) = widest
            && to - from > GAP_SHARE * (self.range[1] - self.range[0])
            && to - from > 1.0
        {
            flags.push(Flag::Gap { from, to });
        }
    }
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
