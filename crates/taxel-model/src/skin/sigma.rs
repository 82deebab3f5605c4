//! How far a reading is off: the noise of the counts by load, and the errors of readings that were left out.

use super::curve::LoadCurve;
use crate::uncertainty::between_knots;

/// Knots of the uncertainty over the range of the pressure.
pub(super) const KNOTS: usize = 13;

/// The prior of an uncertainty weighs as much as so many groups.
pub(super) const PRIOR_GROUPS: f64 = 8.0;

/// The own scale of a taxel's noise is drawn to 1 as by so many samples.
const PRIOR_SAMPLES: f64 = 8.0;

/// The prior is no less than this, kPa: no gauge knows it better.
const LEAST_KPA: f64 = 3e-5;

/// Sums over residuals r and loads u, both as shares of the taxel's span.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moments {
    n: f64,
    r2: f64,
    u2: f64,
    u4: f64,
    r2u2: f64,
}

impl Moments {
    /// Of residuals and loads, counts.
    pub fn of(pairs: impl Iterator<Item = (f64, f64)>, span: f64) -> Self {
        let mut sums = Self::default();
        for (residual, load) in pairs {
            let (r2, u2) = ((residual / span).powi(2), (load / span).powi(2));
            sums.n += 1.0;
            sums.r2 += r2;
            sums.u2 += u2;
            sums.u4 += u2 * u2;
            sums.r2u2 += r2 * u2;
        }
        sums
    }

    pub fn add(&mut self, other: &Self) {
        self.n += other.n;
        self.r2 += other.r2;
        self.u2 += other.u2;
        self.u4 += other.u4;
        self.r2u2 += other.r2u2;
    }

    /// Mean square of the residuals as a share of the span, squared.
    pub fn mean_square(&self) -> f64 {
        if self.n > 0.0 { self.r2 / self.n } else { 0.0 }
    }

    /// The variance a + b u^2 of all samples together, a and b not negative.
    pub fn variance(&self) -> Variance {
        let of = |a: f64, b: f64| Variance { a: a.max(0.0), b: b.max(0.0) };
        let misfit = |v: &Variance| {
            v.a * (v.a * self.n + 2.0 * v.b * self.u2 - 2.0 * self.r2) + v.b * (v.b * self.u4 - 2.0 * self.r2u2)
        };
        let determinant = self.n * self.u4 - self.u2 * self.u2;
        let both = of(
            (self.r2 * self.u4 - self.r2u2 * self.u2) / determinant,
            (self.r2u2 * self.n - self.r2 * self.u2) / determinant,
        );
        if both.a > 0.0 && both.b > 0.0 {
            return both;
        }
        let share = |sum: f64, of: f64| if of > 0.0 { sum / of } else { 0.0 };
        let (level, slope) = (of(share(self.r2, self.n), 0.0), of(0.0, share(self.r2u2, self.u4)));
        if misfit(&level) <= misfit(&slope) { level } else { slope }
    }

    /// By how much more than `shape` says the residuals of one taxel vary.
    fn scale(&self, shape: &Variance) -> f64 {
        let expected = shape.a + shape.b * self.u2 / self.n.max(1.0);
        let ratio = if expected > 0.0 { self.mean_square() / expected } else { 0.0 };
        (ratio * self.n + PRIOR_SAMPLES) / (self.n + PRIOR_SAMPLES)
    }
}

/// The variance a + b u^2 of a count at load u, in shares of a taxel's span.
#[derive(Clone, Copy, Debug)]
pub(super) struct Variance {
    a: f64,
    b: f64,
}

/// The noise of one taxel by load.
pub(super) struct Noise {
    span: f64,
    parts: [(f64, Variance); 2],
}

impl Noise {
    /// Of the scans about the curve and the groups about a curve without them, with the shapes of the skin.
    pub fn new(span: f64, scans: (&Moments, Variance), groups: (&Moments, Variance)) -> Self {
        Self { span, parts: [scans, groups].map(|(moments, shape)| (moments.scale(&shape), shape)) }
    }

    /// Standard deviation at a load, both in counts.
    pub fn at(&self, load: f64) -> f64 {
        let u2 = (load / self.span).powi(2);
        let variance = self.parts.iter().map(|(scale, shape)| scale * (shape.a + shape.b * u2)).fold(0.0, f64::max);
        variance.sqrt() * self.span
    }
}

/// The standard deviation of a reading by its pressure.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SigmaByReading {
    first_kpa: f64,
    step_kpa: f64,
    pub sigma_kpa: [f64; KNOTS],
}

impl SigmaByReading {
    /// From left-out `readings` of `kpa` (pairs, NaN where nothing was read). The prior, which weighs as `prior_scans`, is the
    /// curve's slope times the noise.
    pub fn new(
        curve: &LoadCurve,
        noise: &Noise,
        range_kpa: [f64; 2],
        pairs: impl Iterator<Item = (f64, f64)>,
        prior_scans: f64,
    ) -> Self {
        let step_kpa = (range_kpa[1] - range_kpa[0]) / (KNOTS - 1) as f64;
        let knot = |k: usize| range_kpa[0] + step_kpa * k as f64;
        let (mut n, mut squares) = ([0.0; KNOTS], [0.0; KNOTS]);
        for (reading, kpa) in pairs.filter(|(reading, _)| reading.is_finite()) {
            let place = ((reading - range_kpa[0]) / step_kpa).clamp(-2.0, KNOTS as f64 + 1.0);
            for k in (place - 1.5).max(0.0) as usize..((place + 2.5).max(0.0) as usize).min(KNOTS) {
                if (reading - knot(k)).abs() <= step_kpa {
                    n[k] += 1.0;
                    squares[k] += (reading - kpa).powi(2);
                }
            }
        }
        let sigma_kpa = std::array::from_fn(|k| {
            let u = curve.counts_at(knot(k));
            let s = noise.at(u);
            let width = curve.inverse(u + s) - curve.inverse((u - s).max(curve.counts[0]));
            let prior = (width / 2.0).max(LEAST_KPA);
            ((squares[k] + prior_scans * prior * prior) / (n[k] + prior_scans)).sqrt()
        });
        Self { first_kpa: range_kpa[0], step_kpa, sigma_kpa }
    }

    /// The standard deviation of a reading, both in kPa.
    pub fn at(&self, kpa: f64) -> f64 {
        between_knots((kpa - self.first_kpa) / self.step_kpa, &self.sigma_kpa)
    }
}
