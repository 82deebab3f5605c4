//! The fit against exact rational arithmetic on random designs, each held to what rounding alone can do to it.
//!
//! What is promised is the exact least-squares polynomial, but for rounding its Chebyshev coefficients to f64 once and
//! for evaluating it in f64. How much that costs depends on the design: where counts cluster, the polynomial swings
//! far out between the clusters, its coefficients are large, and their last digits move the pressure at every count.
//! So the bound is worked out for each design from the exact polynomial itself: [`Curve::rounding_kpa`]. The fit stays
//! within a third of it on good designs. Coefficients that are off by 8 * 2^-53 of themselves fail, and so does a basis
//! that is orthogonalised once only and not refined.

#![allow(clippy::unwrap_used)] // Tests; the exemption knows only functions marked as such.

use proptest::prelude::*;
use std::collections::BTreeSet;
use std::f64::consts::PI;
use taxel_model::stability::reference::{Reference, to_f64};
use taxel_model::{FitOptions, Samples, TaxelModel, fit};

/// The unit roundoff of f64, 2^-53.
const ROUNDOFF: f64 = f64::EPSILON / 2.0;

/// For products of roundings, and for the rounding of the bound itself.
const SECOND_ORDER: f64 = 1.01;

/// A curve that is farther than this from the projection, as a share of the largest pressure, is given up for one of a
/// lower order (`CURVE_TOLERANCE` in taxel-model).
const GIVEN_UP: f64 = 1e-9;

/// Counts and pressures of one taxel, and the order asked for.
#[derive(Debug)]
struct Design {
    counts: Vec<f64>,
    kpa: Vec<f64>,
    order: u8,
}

impl Design {
    /// A converter of so many bits whose taxel has `swing` of them; `readings` are pressures and deviates of the noise.
    fn new(bits: u32, swing: f64, half: f64, noise: f64, readings: &[(f64, f64)], order: u8) -> Self {
        let top = f64::from((1_u32 << bits) - 1);
        let gain = swing * top * (70.0 + half) / 70.0;
        let law = |kpa: f64, noises: f64| 0.9 * top - gain * kpa / (kpa + half) + noises * noise * swing * top;
        let count = |&(kpa, noises): &(f64, f64)| law(kpa, noises).round().clamp(0.0, top);
        let (counts, kpa) = (readings.iter().map(count).collect(), readings.iter().map(|reading| reading.0).collect());
        Self { counts, kpa, order }
    }

    fn distinct(&self) -> usize {
        self.counts.iter().map(|c| c.to_bits()).collect::<BTreeSet<_>>().len()
    }

    /// The highest order that was asked for and that the counts can carry.
    fn order(&self) -> usize {
        usize::from(self.order).min(self.distinct() - 1)
    }

    fn exact(&self, order: usize) -> Reference {
        Reference::fit(&self.counts, &self.kpa, order).unwrap()
    }

    fn model(&self) -> TaxelModel {
        let options = FitOptions { order: self.order, ..FitOptions::default() };
        fit(&Samples::new(&self.counts, &self.kpa), &options)
    }

    /// The greatest error of `evaluate` at the counts, in units of what rounding may do at that count.
    fn error(&self, exact: &Reference, curve: &Curve, evaluate: impl Fn(f64) -> f64) -> f64 {
        let error = |&count: &f64| (evaluate(count) - exact.evaluate(count)).abs() / curve.rounding_kpa(count);
        // Unlike f64::max, this keeps a NaN.
        self.counts.iter().map(error).fold(0.0, |a, b| if a > b { a } else { b })
    }
}

/// The exact polynomial in the basis that the fit serves it in.
struct Curve {
    centre: f64,
    half_width: f64,
    chebyshev: Vec<f64>,
}

impl Curve {
    /// The Chebyshev coefficients of `exact`, from its correctly rounded values at the Chebyshev points.
    fn new(exact: &Reference, order: usize, centre: f64, half_width: f64) -> Self {
        let n = order + 1;
        let angle = |j: usize| PI * (j as f64 + 0.5) / n as f64;
        let values: Vec<f64> = (0..n).map(|j| exact.evaluate(centre + half_width * angle(j).cos())).collect();
        let coefficient = |k: usize| {
            let sum: f64 = values.iter().enumerate().map(|(j, value)| value * (k as f64 * angle(j)).cos()).sum();
            sum * if k == 0 { 1.0 } else { 2.0 } / n as f64
        };
        Self { centre, half_width, chebyshev: (0..n).map(coefficient).collect() }
    }

    /// In the frame that `model` has, which must be that of its counts.
    fn of(model: &TaxelModel, design: &Design, exact: &Reference, order: usize) -> Self {
        let least = design.counts.iter().copied().fold(f64::INFINITY, f64::min);
        let most = design.counts.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let frame = model.curve.as_ref().unwrap();
        let (centre, half_width) = (frame.centre, frame.half_width);
        assert!(centre - half_width <= least && most <= centre + half_width, "{frame:?} for {least} to {most}");
        assert!(half_width <= (most - least) / 2.0 + 0.5, "{frame:?} for {least} to {most}");
        Self::new(exact, order, centre, half_width)
    }

    /// The size of the terms that add up to the coefficient of C^k: those of powers of s, up to 5 times 16 of the
    /// `largest` Chebyshev coefficient each, times binomials of up to 10 that come with the shift to raw counts.
    fn cancelling(&self, k: usize, largest: f64) -> f64 {
        let shifted = |j: usize| self.centre.abs().powi((j - k) as i32) / self.half_width.powi(j as i32);
        800.0 * largest * (k..self.chebyshev.len()).map(shifted).sum::<f64>()
    }

    /// What rounding may do to the pressure at `count`, kPa.
    ///
    /// P = sum c_k T_k(s) is summed by Clenshaw's rule, b_k = 2 s b_{k+1} - b_{k+2} + c_k. Its analysis (D. Elliott,
    /// "Error analysis of an algorithm for summing certain finite series", J. Austral. Math. Soc. 8, 1968): the rule
    /// is linear, so a rounding in b_k is a change of c_k, which moves P by |T_k(s)| <= 1 times as much. Each of the
    /// three operations rounds its own result by a share of 2^-53 at most. On top come the rounding of each c_k to
    /// f64, as much again for what the solver may leave, the rounding of s, which moves P by |s P'(s)| times its
    /// share, and that of the exact value. All are the condition of P in this basis: nothing here knows how it was
    /// solved.
    fn rounding_kpa(&self, count: f64) -> f64 {
        let s = (count - self.centre) / self.half_width;
        let (mut b1, mut b2, mut sum) = (0.0, 0.0, 0.0);
        for (k, c) in self.chebyshev.iter().enumerate().rev() {
            let product = if k == 0 { s * b1 } else { 2.0 * s * b1 };
            let difference = product - b2;
            let b: f64 = difference + c;
            sum += f64::abs(product) + f64::abs(difference) + b.abs() + 2.0 * c.abs();
            (b1, b2) = (b, b1);
        }
        let value = b1;
        // P' = sum k c_k U_{k-1}(s).
        let (mut u_last, mut u, mut slope) = (0.0, 1.0, 0.0);
        for (k, c) in self.chebyshev.iter().enumerate().skip(1) {
            slope += k as f64 * c * u;
            (u_last, u) = (u, 2.0 * s * u - u_last);
        }
        SECOND_ORDER * ROUNDOFF * (sum + (s * slope).abs() + value.abs())
    }
}

/// Pressures over the whole range, or most of them close together, each with a deviate of the noise.
fn any_readings() -> impl Strategy<Value = Vec<(f64, f64)>> {
    let reading = |kpa: std::ops::Range<f64>| (kpa, -3.0..3.0_f64);
    let cluster = (1.0..70.0_f64, -3.0..0.0_f64).prop_flat_map(move |(top, log_width)| {
        let close = proptest::collection::vec(reading(top - 10.0_f64.powf(log_width)..top), 7..40);
        (close, proptest::collection::vec(reading(0.0..70.0), 1..5)).prop_map(|(close, far)| [close, far].concat())
    });
    prop_oneof![2 => proptest::collection::vec(reading(0.0..70.0), 8..200), 1 => cluster]
}

/// PROPTEST_CASES, or `usual`.
fn cases(usual: u32) -> ProptestConfig {
    let cases = std::env::var("PROPTEST_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(usual);
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(cases(120))]

    /// Over converters, swings, orders, noise and clusters.
    #[test]
    fn any_taxel_has_the_exact_solution(
        bits in 8_u32..25, swing in 0.01..0.8_f64, half in 5.0..80.0_f64, noise in 0.0..0.05_f64,
        readings in any_readings(), order in 1_u8..11,
    ) {
        let design = Design::new(bits, swing, half, noise, &readings, order);
        prop_assume!(design.distinct() > 1);
        let (model, mut order) = (design.model(), design.order());
        let mut exact = design.exact(order);
        let mut curve = Curve::of(&model, &design, &exact, order);
        if usize::from(model.order) < order {
            // Only where f64 cannot hold the curve of that order. The largest mean at a count is that of all or more.
            let mean = design.kpa.iter().sum::<f64>() / design.kpa.len() as f64;
            let rounding = design.counts.iter().map(|count| curve.rounding_kpa(*count)).fold(0.0, f64::max);
            prop_assert!(rounding > GIVEN_UP * mean, "{} of {order} with {rounding:e} kPa", model.order);
            order = usize::from(model.order);
            exact = design.exact(order);
            curve = Curve::of(&model, &design, &exact, order);
        }
        prop_assert_eq!(usize::from(model.order), order);
        let error = design.error(&exact, &curve, |count| model.evaluate(count).unwrap().kpa);
        prop_assert!(error <= 1.0, "order {order}: {error} times what rounding may do: {:?}", curve.chebyshev);
    }
}

/// Readings of a whole ramp and more of an 8-bit taxel.
fn ramp_readings() -> impl Strategy<Value = Vec<(f64, f64)>> {
    proptest::collection::vec((0.0..70.0_f64, -3.0..3.0_f64), 280..600)
}

proptest! {
    #![proptest_config(cases(60))]

    /// At the paper's order 5: every count that was seen is in the range, rails too, and in the fit.
    #[test]
    fn the_papers_polynomial_is_the_exact_least_squares_of_all_samples(
        swing in 0.02..1.0_f64, half in 5.0..80.0_f64, noise in 0.0..0.2_f64,
        readings in prop_oneof![any_readings(), ramp_readings()],
    ) {
        let design = Design::new(8, swing, half, noise, &readings, 5);
        let order = design.order();
        prop_assume!(order > 0);
        let model = design.model();
        prop_assert_eq!(usize::from(model.order), order);
        let exact = design.exact(order);
        let curve = Curve::of(&model, &design, &exact, order);
        let error = design.error(&exact, &curve, |count| model.evaluate(count).unwrap().kpa);
        prop_assert!(error <= 1.0, "{error} times what rounding may do: {:?}", curve.chebyshev);
        // A Chebyshev coefficient is as uncertain as the rounding of the largest one; a power of the raw count as the
        // terms that cancel in it, of which double-double keeps 25 digits.
        let largest = curve.chebyshev.iter().fold(0.0_f64, |largest, c| largest.max(c.abs()));
        for (served, exact) in model.curve.as_ref().unwrap().chebyshev.iter().zip(&curve.chebyshev) {
            prop_assert!((served - exact).abs() <= 1e-12 * largest, "{served} for {exact} of {largest}");
        }
        for (k, (printed, exact)) in model.raw_coefficients.iter().zip(exact.coefficients()).enumerate() {
            let exact = to_f64(&exact);
            let bound = 1e-12 * exact.abs() + 1e-25 * curve.cancelling(k, largest);
            prop_assert!((printed - exact).abs() <= bound, "{printed} for {exact} of C^{k}");
        }
    }
}
