//! Section `live`: the live path's arithmetic, error against run time over all counts. Whole frames through the
//! daemon are the second part, `daemon`; what the engine takes for evaluation and sum is an example of taxel-engine.
//!
//! Convention of work-precision diagrams: the same task for every method, the knob swept along each line, a reference far
//! better than any contender. All methods are safe Rust that the compiler vectorises by itself or not.

use std::hint::black_box;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use taxel_model::{Curve, Dd, FitOptions, Order};

use crate::document::{Axis, Figure, Level, Line, Point, Section, Table, row};
use crate::numbers::{median, quantile, three_digits, timed_us};
use crate::options::Options;
use crate::work_precision::taxels::{Bits, Recording};

/// The knob; the shipped default is 5.
const ORDERS: [u8; 3] = [3, 5, 9];
/// A forearm, and a whole robot.
const SIZES: [usize; 2] = [230, 5_000];
/// Scans of a stream of counts: enough to differ, and few enough that the counts stay in the second-level cache.
const SCANS: usize = 16;
/// Taxels evaluated in one timed run: long against the clock's own cost.
const TAXELS_A_RUN: usize = 80_000;
/// Taxels that a polynomial is evaluated for side by side.
const LANES: usize = 16;
/// Entries from one taxel's table to the next, as in `taxel_engine::force`: tables a power of two apart would compete for
/// the same sets of the cache.
const TABLE_STRIDE: usize = 256 + 16;
/// Scans of a taxel's calibration.
const RAMP_SCANS: usize = 700;
/// A common pressure transmitter: 0.25 % of 70 kPa.
const GAUGE_KPA: f64 = 0.175;

const TABLE: &str = "table f32 (shipped default)";
const SCALED: &str = "Horner f32, scaled";
const NAIVE: &str = "naive: powi f64, taxel by taxel";
const FLOOR: &str = "floor: load, convert, store";

/// A scan of counts to pressures in kPa, held at the ends of the calibrated range; both slices have one entry per taxel.
type Method = Box<dyn Fn(&[u8], &mut [f32])>;

/// What a polynomial on a range needs to be evaluated.
#[derive(Clone)]
struct Taxel {
    curve: Curve,
    /// In powers of the raw count, each coefficient correctly rounded.
    raw: Vec<f64>,
    range: [f64; 2],
}

/// One method at one order.
struct Row {
    method: &'static str,
    order: u8,
    /// Largest over all taxels of the larger skin and all counts, kPa; NaN for what computes no pressure.
    error_kpa: f64,
    /// ns per taxel of every run, by size.
    ns: [Vec<f64>; SIZES.len()],
}

/// Section `live`.
///
/// # Errors
/// None at present; the signature is that of every section.
pub fn section(options: &Options) -> anyhow::Result<Section> {
    let repetitions = if options.quick { 15 } else { 61 };
    let (mut rows, mut half_count_kpa) = (Vec::new(), f64::NAN);
    for order in ORDERS {
        let taxels = taxels(SIZES[1], order, options.seed);
        if order == 5 {
            half_count_kpa = median(&taxels.iter().map(Taxel::half_count_kpa).collect::<Vec<_>>());
        }
        rows.extend(measure(&taxels, order, options.seed, repetitions));
    }
    let figure = |(at, size): (usize, &usize)| figure(&rows, at, *size, half_count_kpa, repetitions);
    Ok(Section {
        text: text(&rows),
        figures: SIZES.iter().enumerate().map(figure).collect(),
        tables: vec![table(&rows)],
        ..Section::default()
    })
}

/// Taxels fitted as the daemon fits them, every one with a response of its own.
fn taxels(taxels: usize, order: u8, seed: u64) -> Vec<Taxel> {
    let options = FitOptions { order: Order::Fixed(order), ..FitOptions::default() };
    let recording = Recording::simulate(Bits::Eight, RAMP_SCANS, taxels, seed);
    let taxel = |taxel| {
        let model = recording.sums(taxel).fit(&options);
        Some(Taxel { curve: model.curve?, raw: model.raw_coefficients, range: model.range? })
    };
    (0..taxels).filter_map(taxel).collect()
}

impl Taxel {
    /// The pressure at `count`, held at the ends of the range, to about 30 digits, kPa: Clenshaw's rule in double-double
    /// arithmetic on the coefficients as they are.
    fn exact(&self, count: u8) -> Dd {
        let inside = f64::from(count).max(self.range[0]).min(self.range[1]);
        let s = Dd::sum(inside, -self.curve.centre).div_f64(self.curve.half_width);
        let (mut b1, mut b2) = (Dd::ZERO, Dd::ZERO);
        for &c in self.curve.chebyshev.iter().skip(1).rev() {
            (b1, b2) = ((s * b1).scale_exact(2.0) - b2 + Dd::from(c), b1);
        }
        s * b1 - b2 + Dd::from(self.curve.chebyshev.first().copied().unwrap_or(0.0))
    }

    /// Coefficients in powers of s = (C - centre) / half width, kPa.
    fn scaled(&self) -> Vec<f64> {
        let n = self.curve.chebyshev.len();
        let mut powers = vec![0.0; n];
        // Powers of T_{k-1} and T_k; T_{k+1} = 2 s T_k - T_{k-1}.
        let (mut last, mut this) = (vec![0.0; n], vec![0.0; n]);
        this[0] = 1.0;
        for (k, c) in self.curve.chebyshev.iter().enumerate() {
            powers.iter_mut().zip(&this).for_each(|(power, t)| *power += c * t);
            let factor = if k == 0 { 1.0 } else { 2.0 };
            let next = (0..n).map(|j| factor * if j > 0 { this[j - 1] } else { 0.0 } - last[j]).collect();
            (last, this) = (this, next);
        }
        powers
    }

    /// Half a count in the middle of the range.
    fn half_count_kpa(&self) -> f64 {
        let middle = (0.5 * (self.range[0] + self.range[1])) as u8;
        0.25 * (self.exact(middle + 1) - self.exact(middle - 1)).to_f64().abs()
    }
}

/// [`SCANS`] scans in which every count walks by -1, 0 or 1 within its taxel's range.
fn walk(taxels: &[Taxel], seed: u64) -> Vec<Vec<u8>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut counts: Vec<f64> = taxels.iter().map(|t| random.random_range(t.range[0]..=t.range[1]).round()).collect();
    let mut scan = |_| {
        for (count, taxel) in counts.iter_mut().zip(taxels) {
            let walked = *count + f64::from(random.random_range(-1_i8..=1));
            *count = walked.max(taxel.range[0].ceil()).min(taxel.range[1].floor());
        }
        counts.iter().map(|count| *count as u8).collect()
    };
    (0..SCANS).map(&mut scan).collect()
}

/// [`LANES`] taxels with `N` coefficients each, coefficient by coefficient, so that one load serves all lanes.
struct Block<const N: usize> {
    range: [[f32; LANES]; 2],
    centre: [f32; LANES],
    per_half_width: [f32; LANES],
    coefficients: [[f32; LANES]; N],
}

impl<const N: usize> Block<N> {
    fn new(taxels: &[Taxel]) -> Self {
        let each = |value: &dyn Fn(&Taxel) -> f64| -> [f32; LANES] {
            std::array::from_fn(|lane| taxels.get(lane).map_or(0.0, value) as f32)
        };
        let lists: Vec<Vec<f64>> = taxels.iter().map(Taxel::scaled).collect();
        let coefficient = |k: usize, lane: usize| lists.get(lane).and_then(|list| list.get(k)).copied().unwrap_or(0.0);
        Self {
            range: [0, 1].map(|end| each(&|taxel| taxel.range[end])),
            centre: each(&|taxel| taxel.curve.centre),
            per_half_width: each(&|taxel| 1.0 / taxel.curve.half_width),
            coefficients: std::array::from_fn(|k| std::array::from_fn(|lane| coefficient(k, lane) as f32)),
        }
    }

    /// Horner's rule.
    #[inline]
    fn evaluate(&self, counts: &[u8; LANES]) -> [f32; LANES] {
        let s: [f32; LANES] = std::array::from_fn(|lane| {
            let (count, low, high) = (f32::from(counts[lane]), self.range[0][lane], self.range[1][lane]);
            let above = if count > low { count } else { low };
            ((if above < high { above } else { high }) - self.centre[lane]) * self.per_half_width[lane]
        });
        let mut value = self.coefficients[N - 1];
        for coefficients in self.coefficients[..N - 1].iter().rev() {
            value = std::array::from_fn(|lane| value[lane] * s[lane] + coefficients[lane]);
        }
        value
    }
}

/// Horner's rule in powers of s, for `N` coefficients a taxel.
fn horner<const N: usize>(taxels: &[Taxel]) -> Method {
    let blocks: Vec<Block<N>> = taxels.chunks(LANES).map(Block::new).collect();
    Box::new(move |counts, kpa| {
        let ((counts, counts_left), (kpa, kpa_left)) = (counts.as_chunks(), kpa.as_chunks_mut());
        for ((block, counts), kpa) in blocks.iter().zip(counts).zip(kpa) {
            *kpa = block.evaluate(counts);
        }
        if let Some(block) = blocks.last().filter(|_| !counts_left.is_empty()) {
            let mut padded = [0; LANES];
            padded[..counts_left.len()].copy_from_slice(counts_left);
            kpa_left.copy_from_slice(&block.evaluate(&padded)[..counts_left.len()]);
        }
    })
}

fn methods(taxels: &[Taxel], order: u8) -> Vec<(&'static str, Method)> {
    let entry = |taxel: &Taxel, count: usize| if count < 256 { taxel.exact(count as u8).to_f64() as f32 } else { 0.0 };
    let table = |taxel| -> [f32; TABLE_STRIDE] { std::array::from_fn(|count| entry(taxel, count)) };
    let (tables, all): (Vec<_>, _) = (taxels.iter().map(table).collect(), taxels.to_vec());
    let look_up: Method = Box::new(move |counts, kpa| {
        for ((table, &count), kpa) in tables.iter().zip(counts).zip(kpa) {
            *kpa = table[usize::from(count)];
        }
    });
    // Sum of c_k C^k: what most would write first.
    let naive: Method = Box::new(move |counts, kpa| {
        for ((taxel, &count), kpa) in all.iter().zip(counts).zip(kpa) {
            let count = f64::from(count).max(taxel.range[0]).min(taxel.range[1]);
            *kpa = taxel.raw.iter().enumerate().map(|(k, c)| c * count.powi(k as i32)).sum::<f64>() as f32;
        }
    });
    // No pressure at all. Nothing that reads counts is faster.
    let floor: Method =
        Box::new(|counts, kpa| counts.iter().zip(kpa).for_each(|(&count, kpa)| *kpa = f32::from(count)));
    let scaled = match order {
        3 => horner::<4>(taxels),
        5 => horner::<6>(taxels),
        _ => horner::<10>(taxels),
    };
    vec![(TABLE, look_up), (SCALED, scaled), (NAIVE, naive), (FLOOR, floor)]
}

fn measure(taxels: &[Taxel], order: u8, seed: u64, repetitions: usize) -> Vec<Row> {
    let [small, large] = SIZES.map(|size| {
        let taxels = &taxels[..size.min(taxels.len())];
        times(&methods(taxels, order), &walk(taxels, seed), repetitions)
    });
    let mut rows = Vec::new();
    for (((method, run), small), large) in methods(taxels, order).into_iter().zip(small).zip(large) {
        let error_kpa = if method == FLOOR { f64::NAN } else { max_error_kpa(&run, taxels) };
        rows.push(Row { method, order, error_kpa, ns: [small, large] });
    }
    rows
}

/// The largest error over all counts of all taxels, kPa; infinite if one is no number.
fn max_error_kpa(method: &Method, taxels: &[Taxel]) -> f64 {
    let (mut kpa, mut worst) = (vec![0.0_f32; taxels.len()], 0.0_f64);
    for count in 0..=u8::MAX {
        method(&vec![count; taxels.len()], &mut kpa);
        for (kpa, taxel) in kpa.iter().zip(taxels) {
            let error = (Dd::from(f64::from(*kpa)) - taxel.exact(count)).to_f64().abs();
            worst = worst.max(if error.is_finite() { error } else { f64::INFINITY });
        }
    }
    worst
}

/// ns per taxel of every method and run. They run in turns, so that whatever else the machine does meets them all alike,
/// and each first once without the clock, so that nobody pays for the cache that another one filled.
fn times(methods: &[(&'static str, Method)], scans: &[Vec<u8>], repetitions: usize) -> Vec<Vec<f64>> {
    let taxels = scans[0].len();
    let rounds = TAXELS_A_RUN.div_ceil(taxels * scans.len());
    let mut ns = vec![Vec::with_capacity(repetitions); methods.len()];
    let mut kpa = vec![0.0_f32; taxels];
    for _ in 0..repetitions {
        for ((_, method), ns) in methods.iter().zip(&mut ns) {
            let mut run = || {
                for scan in std::iter::repeat_n(scans, rounds).flatten() {
                    method(black_box(scan), &mut kpa);
                    black_box(&kpa);
                }
            };
            run();
            ns.push(1e3 * timed_us(run).0 / (rounds * scans.len() * taxels) as f64);
        }
    }
    ns
}

fn text(rows: &[Row]) -> Vec<String> {
    let of = |method: &str, order: u8| rows.iter().find(|row| row.method == method && row.order == order);
    let ns = |method: &str, size: usize| of(method, 5).map_or(f64::NAN, |row| median(&row.ns[size]));
    let error = |method: &str, order: u8| three_digits(of(method, order).map_or(f64::NAN, |row| row.error_kpa));
    let over = |method: &str| [0, 1].map(|size| three_digits(ns(TABLE, size) / ns(method, size)));
    let ([small, large], [_, naive]) = (over(SCALED), over(NAIVE));
    vec![
        "How long it takes to turn one scan of counts into pressures, and how far the pressures are off. Every method gets \
         one count a taxel and stores one f32 pressure; counts beyond the calibrated range are held at its ends. The error \
         is the largest over all 256 counts of every taxel against the curve in double-double arithmetic. Times are medians \
         of runs taken in turns in one thread, with counts and tables as warm as they get; a daemon that wakes for one scan \
         starts colder."
            .to_owned(),
        format!(
            "At order 5 the shipped table takes {} ns a taxel for {} taxels and {} ns for {}: {small} and {large} times as \
             long as Horner's rule in scaled f32, and {naive} times as long as the naive way. What the table buys \
             where Horner's rule is faster: its time does not depend on the order, and activation, area and the curve \
             beyond its range are in it already.",
            three_digits(ns(TABLE, 0)),
            SIZES[0],
            three_digits(ns(TABLE, 1)),
            SIZES[1],
        ),
        format!(
            "The table is off by {} kPa at order 9, scaled Horner by {}, and powers of the raw count by {}, in f64.",
            error(TABLE, 9),
            error(SCALED, 9),
            error(NAIVE, 9)
        ),
    ]
}

fn figure(rows: &[Row], at: usize, size: usize, half_count_kpa: f64, repetitions: usize) -> Figure {
    let line = |name: &&'static str| {
        let point = |row: &Row| Point {
            x: median(&row.ns[at]),
            x_spread: Some((quantile(&row.ns[at], 0.05), quantile(&row.ns[at], 0.95))),
            y: row.error_kpa,
            mark: row.order.to_string(),
        };
        let points = rows.iter().filter(|row| row.method == *name).map(point).collect();
        Line { name: (*name).to_owned(), ours: *name == TABLE, points, ..Line::default() }
    };
    let floor: Vec<f64> = rows.iter().filter(|row| row.method == FLOOR).map(|row| median(&row.ns[at])).collect();
    Figure {
        id: format!("live-{size}"),
        title: format!("Live: time per taxel against error, {size} taxels"),
        caption: format!(
            "Counts that walk. Left is faster, down is more exact; the marks are orders. To load, convert and store a count \
             without any pressure takes {} ns. Bars: 5 to 95 % of {repetitions} runs.",
            three_digits(median(&floor))
        ),
        x: Axis::log("ns per taxel"),
        y: Axis::log("largest error over all counts, kPa"),
        lines: [TABLE, SCALED, NAIVE].iter().map(line).collect(),
        bands: vec![Level::new(GAUGE_KPA, "gauge: 0.25 % of 70 kPa"), Level::new(half_count_kpa, "half a count")],
        levels: Vec::new(),
    }
}

fn table(rows: &[Row]) -> Table {
    let row = |row: &Row| {
        let error = if row.error_kpa.is_nan() { "none computed".into() } else { row.error_kpa.into() };
        let head = row![row.method, f64::from(row.order)];
        head.into_iter().chain([error]).chain(row.ns.iter().map(|ns| median(ns).into())).collect()
    };
    let columns = ["method", "order", "largest error, kPa", "230 taxels, ns per taxel", "5,000 taxels, ns per taxel"];
    Table::new("live-methods", "Medians, counts that walk.", columns, rows.iter().map(row).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_rational::BigRational;
    use proptest::prelude::*;
    use taxel_model::reference::{exact, integer, to_f64};

    /// Not a multiple of the lanes.
    const TAXELS: usize = 37;

    #[test]
    fn every_method_is_as_exact_as_its_arithmetic() {
        for order in ORDERS {
            let taxels = taxels(TAXELS, order, 5);
            assert_eq!(taxels.len(), TAXELS);
            let half_ulp = 3.9e-6; // of f32 between 64 and 128 kPa
            let raw = [1e-4, 10.0][usize::from(order == 9)];
            for (name, method) in methods(&taxels, order) {
                let (error, most) = match name {
                    TABLE => (max_error_kpa(&method, &taxels), half_ulp),
                    SCALED => (max_error_kpa(&method, &taxels), 1e-4),
                    NAIVE => (max_error_kpa(&method, &taxels), raw),
                    _ => continue,
                };
                assert!(error <= most, "{name}, order {order}: {error}");
            }
        }
    }

    #[test]
    fn a_walk_walks_and_stays_in_range() {
        let taxels = taxels(TAXELS, 3, 1);
        let scans = walk(&taxels, 3);
        assert_eq!(scans.len(), SCANS);
        for pair in scans.windows(2) {
            assert!(pair[0].iter().zip(&pair[1]).all(|(a, b)| a.abs_diff(*b) <= 1));
            assert_ne!(pair[0], pair[1]);
        }
        let inside = |(count, taxel): (&u8, &Taxel)| (taxel.range[0]..=taxel.range[1]).contains(&f64::from(*count));
        assert!(scans.iter().flat_map(|scan| scan.iter().zip(&taxels)).all(inside));
    }

    proptest! {
        /// Against exact rational arithmetic on the same coefficients.
        #[test]
        fn the_reference_is_exact(seed in 0_u64..50, order in prop::sample::select(ORDERS.to_vec()), count in any::<u8>()) {
            let taxel = taxels(1, order, seed).remove(0);
            let exact = |value: f64| exact(value).unwrap();
            let inside = f64::from(count).max(taxel.range[0]).min(taxel.range[1]);
            let s = (exact(inside) - exact(taxel.curve.centre)) / exact(taxel.curve.half_width);
            let (mut last, mut this): (BigRational, BigRational) = (s.clone(), integer(1));
            let mut sum = integer(0);
            for c in &taxel.curve.chebyshev {
                sum += exact(*c) * &this;
                let next = integer(2) * &s * &this - &last;
                (last, this) = (this, next);
            }
            let error = (taxel.exact(count).to_f64() - to_f64(&sum)).abs();
            prop_assert!(error <= 1e-14 * 70.0, "{error}");
        }
    }
}
