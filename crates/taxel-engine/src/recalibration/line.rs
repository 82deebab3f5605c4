//! The straight line of the weighted least squares: known = gain read + offset, with or without the offset.
//!
//! The standard deviation s_i of each point is known beforehand, so the covariance is C = (sum x x^T / s^2)^-1 and a
//! point's residual over its own standard deviation, s_i sqrt(1 - h_i) with h_i = x_i^T C x_i / s_i^2, is standard normal.
//! It equals the point's distance from the line through all others over the standard deviation of that distance.

/// A point of the line.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LinePoint {
    pub(crate) read: f64,
    pub(crate) known: f64,
    pub(crate) sigma: f64,
    /// Which place it lies at, and what of `sigma` all points of that place have in common.
    pub(crate) place: usize,
    pub(crate) place_sigma: f64,
}

/// The line with its covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// What readings are multiplied by.
    pub gain: f64,
    /// What is added then; 0 if it was not looked for.
    pub offset: f64,
    /// Variance of the gain, covariance of both, variance of the offset.
    pub(crate) covariance: [f64; 3],
    /// Sum of the squared residuals over their variances.
    pub chi2: f64,
    /// Points less parameters.
    pub dof: f64,
}

impl Line {
    /// The line of these points; `None` if they do not determine it.
    pub(crate) fn through(points: &[LinePoint], offset: bool) -> Option<Self> {
        let weighted =
            |term: &dyn Fn(&LinePoint) -> f64| points.iter().map(|p| term(p) / (p.sigma * p.sigma)).sum::<f64>();
        let (xx, xy) = (weighted(&|p| p.read * p.read), weighted(&|p| p.read * p.known));
        let (gain, constant, covariance) = if offset {
            let (x, y, one) = (weighted(&|p| p.read), weighted(&|p| p.known), weighted(&|_| 1.0));
            let determinant = xx * one - x * x;
            // Points at one load only: whatever is left is rounding.
            if determinant.is_nan() || determinant <= xx * one * DETERMINED_MIN {
                return None;
            }
            let covariance = [one / determinant, -x / determinant, xx / determinant];
            ((one * xy - x * y) / determinant, (xx * y - x * xy) / determinant, covariance)
        } else {
            (xy / xx, 0.0, [1.0 / xx, 0.0, 0.0])
        };
        let line =
            Self { gain, offset: constant, covariance, chi2: 0.0, dof: points.len() as f64 - 1.0 - f64::from(offset) };
        let chi2 = points.iter().map(|p| (line.residual(p) / p.sigma).powi(2)).sum::<f64>();
        (gain.is_finite() && constant.is_finite() && chi2.is_finite()).then_some(Self { chi2, ..line })
    }

    /// By how much the covariance is more because points at one place are off together: with the change `a = C x / s^2` of
    /// the line by each point's error, and the part `p` of it that the place has in common, the sum of `a a^T p p` over all
    /// pairs of different points of one place.
    pub(crate) fn shared(&self, points: &[LinePoint], offset: bool) -> [f64; 3] {
        let [gain, both, constant] = self.covariance;
        let moves = |p: &LinePoint| {
            let (x, one, share) = (p.read, f64::from(offset), p.place_sigma / (p.sigma * p.sigma));
            [share * (gain * x + both * one), share * (both * x + constant * one)]
        };
        let mut sums = vec![[0.0; 2]; points.iter().map(|p| p.place + 1).max().unwrap_or(0)];
        let mut alone = [0.0; 3];
        for point in points {
            let [by_gain, by_offset] = moves(point);
            sums[point.place][0] += by_gain;
            sums[point.place][1] += by_offset;
            alone = plus(alone, [by_gain * by_gain, by_gain * by_offset, by_offset * by_offset]);
        }
        let together = sums.iter().fold([0.0; 3], |sum, [g, o]| plus(sum, [g * g, g * o, o * o]));
        [0, 1, 2].map(|i| together[i] - alone[i])
    }

    /// How much more lay at a point than the line says.
    pub(crate) fn residual(&self, point: &LinePoint) -> f64 {
        point.known - self.at(point.read)
    }

    /// What the line says of a reading.
    #[must_use]
    pub fn at(&self, read: f64) -> f64 {
        self.gain * read + self.offset
    }

    /// Variance of the line at a reading, where every point lies at a place of its own.
    #[must_use]
    pub fn variance_at(&self, read: f64) -> f64 {
        of_reading(self.covariance, read)
    }

    /// A point's residual in standard deviations, and the share of the line at that point which it decides itself.
    pub(crate) fn deviation(&self, point: &LinePoint) -> (f64, f64) {
        let leverage = self.variance_at(point.read) / (point.sigma * point.sigma);
        (self.residual(point) / (point.sigma * (1.0 - leverage).max(f64::MIN_POSITIVE).sqrt()), leverage)
    }
}

/// The variance of a line with this covariance at a reading.
pub(crate) fn of_reading([gain, both, offset]: [f64; 3], read: f64) -> f64 {
    gain * read * read + 2.0 * both * read + offset
}

pub(crate) fn plus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| a[i] + b[i])
}

/// An offset is looked for only where the readings differ by more than rounding.
const DETERMINED_MIN: f64 = 1e-6;

/// What a standard normal deviate exceeds with probability `p`, 0 < p <= 0.5; within 5e-4 (Abramowitz and Stegun 26.2.23).
pub(crate) fn normal_quantile(p: f64) -> f64 {
    let t = (-2.0 * p.ln()).sqrt();
    t - (2.515_517 + 0.802_853 * t + 0.010_328 * t * t)
        / (1.0 + 1.432_788 * t + 0.189_269 * t * t + 0.001_308 * t.powi(3))
}

/// What a chi-square of `dof` degrees of freedom exceeds with probability `p`; within 2 % (Wilson and Hilferty 1931).
pub(crate) fn chi2_quantile(p: f64, dof: f64) -> f64 {
    let share = 2.0 / (9.0 * dof);
    dof * (1.0 - share + normal_quantile(p) * share.sqrt()).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(read: f64, known: f64, sigma: f64) -> LinePoint {
        LinePoint { read, known, sigma, place: 0, place_sigma: 0.0 }
    }

    /// The mean of n equal points of which everything is common to a place has the variance of one where they all lie
    /// there, and n times less where each lies elsewhere; a line through two places has that of their mean points.
    #[test]
    fn points_at_one_place_count_as_one() {
        let at = |place: usize, read: f64| LinePoint { place, place_sigma: 0.2, ..point(read, read, 0.2) };
        let variance = |places: [usize; 4], offset: bool| {
            let reads = if offset { [2.0, 2.0, 8.0, 8.0] } else { [5.0; 4] };
            let points: Vec<LinePoint> = places.iter().zip(reads).map(|(place, read)| at(*place, read)).collect();
            let line = Line::through(&points, offset).unwrap();
            [0, 1, 2].map(|i| line.covariance[i] + line.shared(&points, offset)[i])
        };
        let near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        let one = (0.2_f64 / 5.0).powi(2);
        assert!(near(variance([0, 1, 2, 3], false), [one / 4.0, 0.0, 0.0]));
        assert!(near(variance([0, 0, 0, 0], false), [one, 0.0, 0.0]));
        assert!(near(variance([0, 0, 0, 1], false), [one * 10.0 / 16.0, 0.0, 0.0]));
        let two = Line::through(&[at(0, 2.0), at(1, 8.0)], true).unwrap();
        assert!(near(variance([0, 0, 1, 1], true), two.covariance));
    }

    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (p, want) in [(0.025, 1.960), (0.005, 2.576), (0.001, 3.090), (0.0005, 3.291)] {
            assert!((normal_quantile(p) - want).abs() < 1e-3, "{p}");
        }
        for (dof, want) in [(4.0, 18.467), (9.0, 27.877), (19.0, 43.820)] {
            assert!((chi2_quantile(0.001, dof) / want - 1.0).abs() < 0.02, "{dof}");
        }
    }

    #[test]
    fn gain_and_offset_of_exact_points_come_back_and_one_load_gives_no_offset() {
        let of = |gain: f64, offset: f64, reads: &[f64]| {
            reads.iter().map(|&read| point(read, gain * read + offset, 0.1 * read)).collect::<Vec<_>>()
        };
        let line = Line::through(&of(1.1, -2.0, &[10.0, 20.0, 50.0, 90.0, 150.0]), true).unwrap();
        assert!((line.gain - 1.1).abs() < 1e-12 && (line.offset + 2.0).abs() < 1e-9 && line.chi2 < 1e-12, "{line:?}");
        assert_eq!(Line::through(&of(1.1, -2.0, &[10.0; 5]), true), None);
    }

    #[test]
    fn a_deviation_is_the_distance_from_the_line_through_the_others() {
        let points: Vec<LinePoint> = [(2.0, 2.1), (4.0, 3.9), (6.0, 6.9), (8.0, 8.1), (9.0, 9.2)]
            .map(|(read, known)| point(read, known, 0.03 * read + 0.05))
            .to_vec();
        for offset in [false, true] {
            let line = Line::through(&points, offset).unwrap();
            for left_out in 0..points.len() {
                let mut others = points.clone();
                let point = others.remove(left_out);
                let rest = Line::through(&others, offset).unwrap();
                let sigma = (point.sigma.powi(2) + rest.variance_at(point.read)).sqrt();
                assert!((line.deviation(&point).0 - rest.residual(&point) / sigma).abs() < 1e-9);
            }
        }
    }
}
