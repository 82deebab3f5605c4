//! Whether a load decreases: what hysteresis may hide is stated from then on, and not of loads that were put on.

use taxel_skin::Newton;

/// A load decreases where the mean of the last scans is below this share of its highest, or one scan below that.
const MEAN_SHARE: f64 = 0.95;
const SCAN_SHARE: f64 = 0.85;

/// The mean is over about so many scans.
const SCANS: f64 = 8.0;

/// The course of the force of a patch since it was last unloaded.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unloading {
    last_n: f64,
    mean_n: f64,
    highest_n: f64,
}

impl Unloading {
    /// Nobody knows how the load came that lies there.
    pub const UNKNOWN: Self = Self { last_n: 0.0, mean_n: 0.0, highest_n: f64::INFINITY };

    /// Whether the load has decreased by the last scan.
    pub fn is_under_way(&self) -> bool {
        self.mean_n < MEAN_SHARE * self.highest_n || self.last_n < SCAN_SHARE * self.highest_n
    }

    /// The force of the next scan; none where nothing touches.
    pub fn follow(&mut self, total: Option<Newton>) {
        let Some(Newton(newton)) = total.filter(|total| total.0 > 0.0) else {
            *self = Self::default();
            return;
        };
        let mean_n = if self.mean_n > 0.0 { self.mean_n + (newton - self.mean_n) / SCANS } else { newton };
        *self = Self { last_n: newton, mean_n, highest_n: self.highest_n.max(mean_n) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(mut unloading: Unloading, newtons: &[f64]) -> bool {
        newtons.iter().for_each(|newton| unloading.follow(Some(Newton(*newton))));
        unloading.is_under_way()
    }

    #[test]
    fn a_load_decreases_until_it_has_gone() {
        let begin = Unloading::default;
        let steady: Vec<f64> = (0..400).map(|scan| 5.0 + 0.2 * f64::from(scan * 7 % 11 - 5) / 5.0).collect();
        assert!(!after(begin(), &steady), "noise is no course");
        assert!(!after(begin(), &[1.0, 2.0, 3.0, 4.0, 5.0, 5.0]));
        assert!(after(begin(), &[5.0, 5.0, 2.5]), "at once");
        assert!(after(begin(), &[steady.clone(), vec![4.5; 40]].concat()));
        assert!(!after(begin(), &[5.0, 2.5, 0.0, 2.5]), "another load");
        assert!(after(Unloading::UNKNOWN, &[5.0; 100]) && !after(Unloading::UNKNOWN, &[5.0, 0.0, 5.0]));
    }
}
