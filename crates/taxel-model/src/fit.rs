//! The paper's polynomial of one taxel, from end to end.

use crate::curve::Curve;
use crate::dd::Dd;
use crate::model::{Quality, Sign, TaxelModel};
use crate::options::{FitOptions, MAX_ORDER};
use crate::orthogonal::Basis;
use crate::reduce::{Reduced, Row};
use crate::refine::solve;
use crate::series::{Chebyshev, chebyshev_of};
use crate::status::{Flag, Status};
use crate::uncertainty::{Evidence, Scatter, profile, student_975};

/// A sample with more leverage than this decides the curve at its count alone.
const HIGH_LEVERAGE: f64 = 0.9;

/// An interval without a sample of this share of the range is a gap.
const GAP_SHARE: f64 = 0.25;

/// A curve may be this far from the projection that it stands for, as a share of the largest pressure. Healthy ones
/// are within 1e-14; a cluster of counts with one 1e5 times as far away as it is wide is beyond f64.
const CURVE_TOLERANCE: f64 = 1e-9;

/// Below this standard deviation of the pressure, kPa, squares vanish: no gauge means it.
const LEAST_PRESSURE_SD_KPA: f64 = 1e-100;

/// Fits the model of one taxel. Never panics: [`TaxelModel::status`] says why there is no usable curve.
pub(crate) fn fit_reduced(data: &Reduced, options: &FitOptions) -> TaxelModel {
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
    let spread = data.pressure_spread();
    let silent = spread.sd_kpa <= (10.0 * options.gauge.noise_kpa).max(LEAST_PRESSURE_SD_KPA);
    if silent && samples > 1 {
        return none(Status::NoExcitation { pressure_sd_kpa: spread.sd_kpa }, flags);
    }
    if data.rows.len() == 1 {
        let count = first.x.to_f64();
        let status = if samples > 1 { Status::Dead { count } } else { Status::Unproven { samples } };
        let mut model = none(status, flags);
        model.range = Some([count, count]);
        model.curve = Some(Curve { centre: count, half_width: 1.0, chebyshev: vec![first.y.to_f64()] });
        model.raw_coefficients = vec![first.y.to_f64()];
        model.quality.rank = 1;
        return model;
    }
    Fit::new(data, options, [first.x.to_f64(), last.x.to_f64()]).model(flags, quality, spread.range_kpa)
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
        let t: Vec<Dd> = data
            .rows
            .iter()
            .map(|row| (Dd::sum(row.x.hi, -centre) + Dd::from(row.x.lo)).scale_exact(1.0 / scale))
            .collect();
        let rounded: Vec<f64> = t.iter().map(|t| t.to_f64()).collect();
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

    fn scatter(&self, curve: &Curve) -> Vec<Scatter> {
        let of = |row: &Row| {
            let count = row.x.to_f64();
            let residual = row.y.to_f64() - curve.evaluate(count);
            Scatter { count, n: row.n, squares: row.ss + row.n * residual * residual }
        };
        self.data.rows.iter().map(of).collect()
    }

    fn rmse(&self, scatter: &[Scatter]) -> f64 {
        (scatter.iter().map(|s| s.squares).sum::<f64>() / self.data.samples).sqrt()
    }

    /// The least-squares curve of the highest order up to `order` that is itself: on nearly dependent counts neither
    /// the recurrence of the basis nor coefficients in f64 can hold what the vectors of the basis still tell.
    fn free(&self, order: usize) -> (Chebyshev, usize) {
        let solution = solve(&self.basis, &self.data.rows, &self.t, &self.d, order);
        let free = chebyshev_of(&solution, self.half / self.scale);
        if order == 0 || self.is_projection(&free, order) { (free, order) } else { self.free(order - 1) }
    }

    /// Whether the curve has the pressures at the rows that the basis says.
    fn is_projection(&self, free: &Chebyshev, order: usize) -> bool {
        let curve = Curve::new(free, self.centre, self.half);
        let largest = self.data.rows.iter().fold(0.0, |largest: f64, row| largest.max(row.y.hi.abs()));
        let projection = self.basis.weighted_values(&self.d[..=order]);
        let mut rows = self.data.rows.iter().zip(self.root_n.iter().zip(&projection));
        rows.all(|(row, (root_n, projection))| {
            let error = curve.evaluate(row.x.to_f64()) - projection / root_n;
            error.abs() <= CURVE_TOLERANCE * largest
        })
    }

    fn model(&self, mut flags: Vec<Flag>, mut quality: Quality, pressure_range_kpa: f64) -> TaxelModel {
        let (data, options) = (self.data, self.options);
        let carried = self.basis.order();
        let (series, order) = self.free(carried);
        if order < self.asked {
            flags.push(Flag::RankReduced { asked: self.asked as u8, used: order as u8 });
        }
        let curve = Curve::new(&series, self.centre, self.half);
        if let Some(count) = curve.wrong_slope(self.range, self.sign().as_f64()) {
            flags.push(Flag::NotMonotone { count });
        }
        self.flag_support(order, &mut flags, &mut quality);
        let scatter = self.scatter(&curve);
        quality.rank = carried as u8 + 1;
        quality.swing_counts = self.range[1] - self.range[0];
        quality.dof = (data.samples - (order + 1) as f64).max(0.0);
        quality.rmse_kpa = self.rmse(&scatter);
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
            let half_width = student_975(quality.dof) * weighted_median(&sigma.sigma_kpa, &support);
            quality.interval_kpa = Some(half_width).filter(|width| width.is_finite());
            quality.interval_share = Some(half_width / pressure_range_kpa).filter(|share| share.is_finite());
            sigma
        });
        TaxelModel {
            status: self.status(&quality),
            flags,
            order: order as u8,
            sign: self.sign(),
            range: Some(self.range),
            raw_coefficients: Curve::raw_coefficients(&series, self.centre, self.half),
            curve: Some(curve),
            points: None,
            sigma,
            gauge: options.gauge,
            quality,
        }
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
                    flags.push(Flag::HighLeverage { count: row.x.to_f64(), leverage });
                }
            }
        }
        let pairs = self.data.rows.windows(2).map(|pair| (pair[0].x.to_f64(), pair[1].x.to_f64()));
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
