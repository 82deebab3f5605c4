//! The straight line through nothing of the weighted least squares: known = gain read.
//!
//! The standard deviation s_i of each point is known beforehand, so the variance of the gain is V = 1 / sum (x / s)^2 and a
//! point's residual over its own standard deviation, s_i sqrt(1 - h_i) with h_i = V (x_i / s_i)^2, is standard normal.
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

/// The line with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// What readings are multiplied by.
    pub gain: f64,
    /// Variance of the gain, where every point lies at a place of its own.
    pub(crate) variance: f64,
    /// Sum of the squared residuals over their variances.
    pub chi2: f64,
    /// Points less one.
    pub dof: f64,
}

impl Line {
    /// The line of these points; `None` if they do not determine it.
    pub(crate) fn through(points: &[LinePoint]) -> Option<Self> {
        let weighted =
            |term: &dyn Fn(&LinePoint) -> f64| points.iter().map(|p| term(p) / (p.sigma * p.sigma)).sum::<f64>();
        let (xx, xy) = (weighted(&|p| p.read * p.read), weighted(&|p| p.read * p.known));
        let line = Self { gain: xy / xx, variance: 1.0 / xx, chi2: 0.0, dof: points.len() as f64 - 1.0 };
        let chi2 = points.iter().map(|p| (line.residual(p) / p.sigma).powi(2)).sum::<f64>();
        (line.gain.is_finite() && chi2.is_finite()).then_some(Self { chi2, ..line })
    }

    /// By how much the variance is more because points at one place are off together: with the change `a = V x / s^2` of
    /// the gain by each point's error, and the part `p` of it that the place has in common, the sum of `a a p p` over all
    /// pairs of different points of one place.
    pub(crate) fn shared(&self, points: &[LinePoint]) -> f64 {
        let mut sums = vec![0.0; points.iter().map(|p| p.place + 1).max().unwrap_or(0)];
        let mut alone = 0.0;
        for p in points {
            let moves = self.variance * p.read * p.place_sigma / (p.sigma * p.sigma);
            sums[p.place] += moves;
            alone += moves * moves;
        }
        sums.iter().map(|sum| sum * sum).sum::<f64>() - alone
    }

    /// How much more lay at a point than the line says.
    fn residual(&self, point: &LinePoint) -> f64 {
        point.known - self.gain * point.read
    }

    /// A point's residual in standard deviations, and the share of the line at that point which it decides itself.
    pub(crate) fn deviation(&self, point: &LinePoint) -> (f64, f64) {
        let leverage = self.variance * (point.read / point.sigma).powi(2);
        (self.residual(point) / (point.sigma * (1.0 - leverage).max(f64::MIN_POSITIVE).sqrt()), leverage)
    }
}

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
    /// there, and n times less where each lies elsewhere.
    #[test]
    fn points_at_one_place_count_as_one() {
        let variance = |places: [usize; 4]| {
            let at = |place: usize| LinePoint { place, place_sigma: 0.2, ..point(5.0, 5.0, 0.2) };
            let points = places.map(at);
            let line = Line::through(&points).unwrap();
            line.variance + line.shared(&points)
        };
        let one = (0.2_f64 / 5.0).powi(2);
        for (places, expected) in [([0, 1, 2, 3], 0.25), ([0, 0, 0, 0], 1.0), ([0, 0, 0, 1], 10.0 / 16.0)] {
            assert!((variance(places) - expected * one).abs() < 1e-12, "{places:?}");
        }
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
    fn a_deviation_is_the_distance_from_the_line_through_the_others() {
        let points: Vec<LinePoint> = [(2.0, 2.1), (4.0, 3.9), (6.0, 6.9), (8.0, 8.1), (9.0, 9.2)]
            .map(|(read, known)| point(read, known, 0.03 * read + 0.05))
            .to_vec();
        let line = Line::through(&points).unwrap();
        for left_out in 0..points.len() {
            let mut others = points.clone();
            let point = others.remove(left_out);
            let rest = Line::through(&others).unwrap();
            let sigma = (point.sigma.powi(2) + rest.variance * point.read.powi(2)).sqrt();
            assert!((line.deviation(&point).0 - rest.residual(&point) / sigma).abs() < 1e-9);
        }
    }
}
