//! Whether a load decreases: what hysteresis may hide is stated from then on, and not of loads that were put on.

use taxel_skin::Newton;

/// A load decreases where the mean of the last scans, or one scan, is below such a share of its highest mean ...
const MEAN_SHARE: f64 = 0.95;
const SCAN_SHARE: f64 = 0.85;
/// ... and below that by so many times the noise of a scan. The mean has 0.26 of it, and the highest of many means three times that.
const MEAN_SIGMAS: f64 = 1.2;
const SCAN_SIGMAS: f64 = 4.0;

/// The mean is over about so many scans.
const SCANS: f64 = 8.0;

/// The course of the force of a patch since it was last unloaded.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unloading {
    last_n: f64,
    mean_n: f64,
    highest_n: f64,
    noise_n: f64,
}

impl Unloading {
    /// Nobody knows how the load came that lies there.
    pub const UNKNOWN: Self = Self { last_n: 0.0, mean_n: 0.0, highest_n: f64::INFINITY, noise_n: 0.0 };

    /// Whether the load has decreased by the last scan.
    pub fn is_under_way(&self) -> bool {
        let below = |newton: f64, share: f64, sigmas: f64| {
            newton < share * self.highest_n && newton + sigmas * self.noise_n < self.highest_n
        };
        below(self.mean_n, MEAN_SHARE, MEAN_SIGMAS) || below(self.last_n, SCAN_SHARE, SCAN_SIGMAS)
    }

    /// By how much the load has decreased by the last scan, N; infinite where nobody knows how it came.
    pub fn gone_n(&self) -> f64 {
        if self.is_under_way() { self.highest_n - self.mean_n.min(self.last_n) } else { 0.0 }
    }

    /// The force of the next scan, none where nothing touches, and the standard uncertainty that noise makes of it.
    pub fn follow(&mut self, total: Option<Newton>, noise_n: f64) {
        let Some(Newton(newton)) = total.filter(|total| total.0 > 0.0) else {
            *self = Self::default();
            return;
        };
        let mean_n = if self.mean_n > 0.0 { self.mean_n + (newton - self.mean_n) / SCANS } else { newton };
        *self = Self { last_n: newton, mean_n, highest_n: self.highest_n.max(mean_n), noise_n };
    }
}

/// By how much a load may be read too high of which `gone_n` have gone, infinite where nobody knows how it came, and `left_n` are left,
/// N: a `share` of the root of both, as `ModelSet::unloading_share` has it. What creeps back stays longer than the load.
pub fn still_there_n(share: f64, gone_n: f64, left_n: f64) -> f64 {
    if gone_n > left_n && gone_n.is_finite() {
        (share * (gone_n * left_n).sqrt()).min(left_n)
    } else {
        share * gone_n.min(left_n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_load_is_read_too_high_by_no_more_than_has_gone_or_is_left() {
        let near = |is: f64, expected: f64| assert!((is - expected).abs() < 1e-12, "{is} N, expected {expected} N");
        near(still_there_n(0.1, 0.0, 5.0), 0.0);
        near(still_there_n(0.1, 2.0, 5.0), 0.2);
        near(still_there_n(0.1, 9.0, 4.0), 0.6);
        near(still_there_n(0.1, 90.0, 0.1), 0.1);
        near(still_there_n(0.1, f64::INFINITY, 5.0), 0.5);
    }

    #[test]
    fn what_has_gone_is_told_once_a_load_decreases() {
        let mut unloading = Unloading::default();
        (0..40).for_each(|_| unloading.follow(Some(Newton(5.0)), 0.15));
        assert!(unloading.gone_n().abs() < 1e-12);
        unloading.follow(Some(Newton(2.0)), 0.15);
        assert!((unloading.gone_n() - 3.0).abs() < 1e-9, "{}", unloading.gone_n());
        assert!(Unloading::UNKNOWN.gone_n().is_infinite());
    }

    fn after(mut unloading: Unloading, newtons: &[f64]) -> bool {
        newtons.iter().for_each(|newton| unloading.follow(Some(Newton(*newton)), 0.15));
        unloading.is_under_way()
    }

    #[test]
    fn a_load_decreases_until_it_has_gone() {
        let begin = Unloading::default;
        let steady: Vec<f64> = (0..400).map(|scan| 5.0 + 0.2 * f64::from(scan * 7 % 11 - 5) / 5.0).collect();
        assert!(!after(begin(), &steady), "noise is no course");
        let light: Vec<f64> = steady.iter().map(|newton| newton - 4.0).collect();
        assert!(!after(begin(), &light), "nor is that of a light load, a fifth of it");
        assert!(!after(begin(), &[1.0, 2.0, 3.0, 4.0, 5.0, 5.0]));
        assert!(after(begin(), &[5.0, 5.0, 2.5]), "at once");
        assert!(after(begin(), &[steady.clone(), vec![4.5; 40]].concat()));
        assert!(!after(begin(), &[5.0, 2.5, 0.0, 2.5]), "another load");
        assert!(after(Unloading::UNKNOWN, &[5.0; 100]) && !after(Unloading::UNKNOWN, &[5.0, 0.0, 5.0]));
    }
}
