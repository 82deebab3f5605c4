//! What pressed unseen in the last half second.
//!
//! The remainder of one scan has the noise of that scan. A light load that lies on many taxels is taken away by it now and
//! then, and a floor worked out from that scan alone would sink with it below what lies there. The mean over half a second
//! has a third of the noise, or less, so the floor counts whichever is more: what came at once is in the scan, what stays
//! is in the mean.

use taxel_skin::Time;

use crate::statistics::exponential_share;

/// Time constant of the mean, seconds.
const LATELY_S: f64 = 0.5;

/// Exponential mean of a force, exact in the time step.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lately {
    last: Option<Time>,
    mean_n: f64,
}

impl Lately {
    /// The force of a scan at `time`, N, or the mean with it, whichever is more. A scan that is read again changes nothing.
    pub fn at_least(&mut self, time: Time, newton: f64) -> f64 {
        let share = self.last.map_or(1.0, |last| exponential_share(time.seconds_since(last).max(0.0), LATELY_S));
        self.last = Some(time);
        self.mean_n += share * (newton - self.mean_n);
        self.mean_n.max(newton)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: f64) -> Time {
        Time::from_nanos((seconds * 1e9) as i64)
    }

    #[test]
    fn one_scan_that_reads_less_takes_nothing_away() {
        let mut lately = Lately::default();
        assert_eq!(lately.at_least(at(0.0), 1.0), 1.0);
        let told = lately.at_least(at(0.05), 0.0);
        assert!((told - (-0.1_f64).exp()).abs() < 1e-12, "{told}");
        assert_eq!(lately.at_least(at(0.05), 0.0), told, "the same scan once more");
        assert_eq!(lately.at_least(at(0.10), 2.0), 2.0, "what comes is there at once");
    }

    #[test]
    fn what_has_gone_is_forgotten() {
        let mut lately = Lately::default();
        lately.at_least(at(0.0), 1.0);
        assert!(lately.at_least(at(1.0), 0.0) < 0.14);
        assert!(lately.at_least(at(60.0), 0.0) < 1e-12);
    }
}
