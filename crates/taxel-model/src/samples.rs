//! Samples of one taxel as slices, their reduction to rows of a least-squares problem, and its fit.

use crate::accumulate::Accumulator;
use crate::dd::Dd;
use crate::fit::fit_reduced;
use crate::model::TaxelModel;
use crate::options::{DEFAULT_BINS, Estimator, FitOptions, MIN_BINNED_SAMPLES};
use crate::pressure::FixedPressure;
use crate::reduce::{CodeStat, RampGroup, Reduced, Row, converter_rails, rails_to_drop};

/// Larger counts or pressures (kPa) are refused: a gauge or a converter that says so is broken.
pub const MAX_MAGNITUDE: f64 = 1e15;

/// The samples of one taxel, all slices of the same length; what is missing at the end of one counts as rejected.
#[derive(Clone, Copy, Debug, Default)]
pub struct Samples<'a> {
    /// Counts, or any other real reading.
    pub counts: &'a [f64],
    /// What the decimals as written leave over of `counts`, see [`crate::parse_decimal`].
    pub counts_low: Option<&'a [f64]>,
    /// Pressures, kPa.
    pub pressure_kpa: &'a [f64],
    /// What the decimals as written leave over of `pressure_kpa`.
    pub pressure_low: Option<&'a [f64]>,
    /// The ramp that each sample belongs to, for the repeatability between ramps.
    pub ramp: Option<&'a [u16]>,
}

impl<'a> Samples<'a> {
    /// Samples without low parts and of one ramp.
    #[must_use]
    pub const fn new(counts: &'a [f64], pressure_kpa: &'a [f64]) -> Self {
        Self { counts, counts_low: None, pressure_kpa, pressure_low: None, ramp: None }
    }
}

#[derive(Clone, Copy)]
struct Sample {
    x: Dd,
    y: Dd,
    ramp: u16,
}

fn low(parts: Option<&[f64]>, i: usize) -> f64 {
    parts.and_then(|parts| parts.get(i)).copied().filter(|low| low.is_finite()).unwrap_or(0.0)
}

/// The valid samples and the number of those that are not.
fn valid(samples: &Samples<'_>) -> (Vec<Sample>, u64) {
    let n = samples.counts.len().max(samples.pressure_kpa.len());
    let good = |v: f64| v.abs() <= MAX_MAGNITUDE;
    let list: Vec<Sample> = samples
        .counts
        .iter()
        .zip(samples.pressure_kpa)
        .enumerate()
        .filter(|(_, (x, y))| good(**x) && good(**y))
        .map(|(i, (&x, &y))| Sample {
            // Adding zero makes -0 and 0 the same abscissa.
            x: Dd { hi: x + 0.0, lo: low(samples.counts_low, i) },
            y: Dd { hi: y + 0.0, lo: low(samples.pressure_low, i) },
            ramp: samples.ramp.and_then(|ramp| ramp.get(i)).copied().unwrap_or(0),
        })
        .collect();
    let rejected = (n - list.len()) as u64;
    (list, rejected)
}

/// Fits the model of one taxel. Never panics: [`TaxelModel::status`] says why there is no usable curve.
#[must_use]
pub fn fit(samples: &Samples<'_>, options: &FitOptions) -> TaxelModel {
    fit_reduced(&reduce(samples, options), options)
}

/// Reduces samples; sums run over sorted samples, so that their order does not matter.
fn reduce(samples: &Samples<'_>, options: &FitOptions) -> Reduced {
    let (mut list, rejected) = valid(samples);
    let integer = list.iter().all(|s| s.x.hi.fract() == 0.0 && s.x.lo == 0.0);
    let bytes = integer && list.iter().all(|s| (0.0..=255.0).contains(&s.x.hi));
    let recording = list.len() as u64 >= MIN_BINNED_SAMPLES;
    let binned = options.estimator == Estimator::PressureBinned && recording;
    if binned && bytes && !options.exact && list.iter().all(|s| FixedPressure::from_kpa(s.y.hi).is_some()) {
        // The live path: the same numbers from a file and from the bus.
        let mut sums = Accumulator::new();
        for ramp in list.chunk_by(|a, b| a.ramp == b.ramp) {
            let fixed = ramp.iter().map(|s| (s.x.hi as u8, FixedPressure::from_kpa(s.y.hi)));
            sums.extend(fixed, ramp[0].ramp);
        }
        let mut reduced = sums.reduce(options);
        reduced.rejected += rejected;
        return reduced;
    }
    let of_converter = (integer && recording).then(|| converter_rails(list.iter().map(|s| s.x.hi))).flatten();
    let rails = options.rails(of_converter);
    list.sort_unstable_by(|a, b| order(a.x, b.x).then(order(a.y, b.y)).then(a.ramp.cmp(&b.ramp)));
    let codes = group_by_count(&list);
    let dropped = rails_to_drop(&codes, rails);
    let is_dropped = |x: f64| dropped.iter().any(|rail| rail.0 == x);
    let rows = if binned {
        let railed = |x: f64| rails.is_some_and(|(lo, hi)| x <= lo || x >= hi);
        list.sort_by(|a, b| order(a.y, b.y));
        bins(&list, options, &railed)
    } else {
        codes.iter().filter(|c| !is_dropped(c.x.hi)).map(|c| Row { x: c.x, y: c.mean, n: c.n }).collect()
    };
    let codes: Vec<CodeStat> = codes.into_iter().filter(|c| !is_dropped(c.x.hi)).collect();
    let ramps = group_by_ramp(&list, &is_dropped);
    let samples = codes.iter().map(|c| c.n).sum();
    Reduced { samples, codes, rows, rejected, integer, binned, dropped, ramps }
}

fn order(a: Dd, b: Dd) -> std::cmp::Ordering {
    a.hi.total_cmp(&b.hi).then(a.lo.total_cmp(&b.lo))
}

/// Means and scatter of the pressures at equal counts; `list` is sorted by count.
fn group_by_count(list: &[Sample]) -> Vec<CodeStat> {
    list.chunk_by(|a, b| a.x == b.x)
        .map(|group| {
            let n = group.len() as f64;
            let mean = group.iter().fold(Dd::ZERO, |sum, s| sum + s.y).div_f64(n);
            let ss = group.iter().map(|s| (s.y - mean).hi.powi(2)).sum();
            CodeStat { x: group[0].x, n, mean, ss }
        })
        .collect()
}

/// Mean count and mean pressure in bins of equal pressure; `list` is sorted by pressure.
fn bins(list: &[Sample], options: &FitOptions, railed: &dyn Fn(f64) -> bool) -> Vec<Row> {
    let (Some(first), Some(last)) = (list.first(), list.last()) else { return Vec::new() };
    let span = last.y.hi - first.y.hi;
    let width = options.bin_width_kpa.filter(|w| w.is_finite() && *w > 0.0).unwrap_or(span / DEFAULT_BINS);
    let bin = |s: &Sample| if width > 0.0 { (s.y.hi / width).floor() } else { 0.0 };
    list.chunk_by(|a, b| bin(a) == bin(b))
        .filter_map(|group| {
            let measured = || group.iter().filter(|s| !railed(s.x.hi));
            let n = measured().count() as f64;
            if n == 0.0 || n < (1.0 - crate::reduce::MAX_RAIL_SHARE_OF_BIN) * group.len() as f64 {
                return None;
            }
            let sum = measured().fold((Dd::ZERO, Dd::ZERO), |sum, s| (sum.0 + s.x, sum.1 + s.y));
            Some(Row { x: sum.0.div_f64(n), y: sum.1.div_f64(n), n })
        })
        .collect()
}

fn group_by_ramp(list: &[Sample], is_dropped: &dyn Fn(f64) -> bool) -> Vec<RampGroup> {
    let mut list: Vec<&Sample> = list.iter().filter(|s| !is_dropped(s.x.hi)).collect();
    list.sort_by_key(|s| s.ramp);
    list.chunk_by(|a, b| a.ramp == b.ramp)
        .map(|group| RampGroup { groups: group.iter().map(|s| (s.x.hi, 1.0, s.y.hi)).collect() })
        .collect()
}
