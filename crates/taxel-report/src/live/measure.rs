//! Time of several contenders in one run, taken in turns.

use std::time::Instant;

/// Median with 5 and 95 % points.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spread {
    /// Half of the runs were faster.
    pub median: f64,
    /// 5 % of the runs were faster.
    pub p5: f64,
    /// 5 % of the runs were slower.
    pub p95: f64,
}

impl Spread {
    /// Of any number of values; NaN of none.
    #[must_use]
    pub fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let last = values.len().saturating_sub(1);
            values.get((share * last as f64).round() as usize).copied().unwrap_or(f64::NAN)
        };
        Self { median: at(0.5), p5: at(0.05), p95: at(0.95) }
    }

    /// All three points times `factor`.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self { median: factor * self.median, p5: factor * self.p5, p95: factor * self.p95 }
    }
}

/// Nanoseconds of each contender's run, over `repetitions` rounds in which every contender runs once: whatever else the
/// machine does meanwhile then meets them all alike.
///
/// Each run is preceded by one that is not timed, so that no contender pays for the cache that another one filled.
pub fn in_turns(contenders: &mut [&mut dyn FnMut()], repetitions: usize) -> Vec<Spread> {
    let mut times_ns = vec![Vec::with_capacity(repetitions); contenders.len()];
    for _ in 0..repetitions {
        for (contender, times_ns) in contenders.iter_mut().zip(&mut times_ns) {
            contender();
            let begun = Instant::now();
            contender();
            times_ns.push(begun.elapsed().as_nanos() as f64);
        }
    }
    times_ns.into_iter().map(Spread::of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_a_spread() {
        let spread = Spread::of((0..=100).rev().map(f64::from).collect());
        assert_eq!(spread, Spread { median: 50.0, p5: 5.0, p95: 95.0 });
        assert!(Spread::of(Vec::new()).median.is_nan());
    }

    #[test]
    fn everybody_runs_as_often() {
        let (mut a, mut b) = (0, 0);
        let spreads = in_turns(&mut [&mut || a += 1, &mut || b += 1], 5);
        assert_eq!((a, b, spreads.len()), (10, 10, 2));
    }
}
