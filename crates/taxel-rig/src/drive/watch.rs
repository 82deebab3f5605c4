//! What ends a procedure at once: limits that hold whatever the programme says, and what cannot be.

use std::collections::VecDeque;
use std::time::Duration;

use super::given::{Limits, Seen};
use super::stop::Stop;

/// A gauge that says nothing new for so long is silent.
const GAUGE_AGE_MAX: Duration = Duration::from_millis(200);
/// A drive that has not answered for so long does not.
const ANSWER_AGE_MAX: Duration = Duration::from_millis(500);
/// It is called twenty times a second; after so long the bag is another one.
const HELD_MAX: Duration = Duration::from_secs(2);
/// Noise of a gauge, and what a regulator overshoots by, kPa.
const BEYOND_KPA: f64 = 1.0;
/// Below ambient a gauge reads noise only, kPa; more is another sign or another reference.
const BELOW_ZERO_KPA: f64 = 3.0;
/// The bag and its set point are so far apart, kPa and of the set point, for so long: one of the two is wrong.
const APART_KPA: f64 = 4.0;
const APART_SHARE: f64 = 0.1;
const APART_FOR: Duration = Duration::from_secs(4);
/// A pressure rises at most so many times as fast as asked for, and so much more, kPa, in a second.
const FASTER: f64 = 3.0;
const FASTER_KPA: f64 = 3.0;
const SECOND: Duration = Duration::from_secs(1);

/// What was seen lately.
#[derive(Clone, Debug, Default)]
pub(super) struct Watch {
    begun: Duration,
    looked: Duration,
    /// Since when bag and set point have been apart.
    apart: Option<Duration>,
    /// Readings of the last second.
    lately: VecDeque<(Duration, f64)>,
}

impl Watch {
    pub(super) fn new(begun: Duration) -> Self {
        Self { begun, looked: begun, ..Self::default() }
    }

    /// A reading that is fresh, in kPa below ambient.
    ///
    /// # Errors
    /// Why the procedure cannot go on.
    pub(super) fn look(&mut self, seen: &Seen, limits: &Limits, kpa_per_s: f64) -> Result<f64, Stop> {
        let held = seen.now.saturating_sub(std::mem::replace(&mut self.looked, seen.now));
        if held > HELD_MAX {
            return Err(Stop::Held(held));
        }
        let kpa = match seen.gauge {
            Some((kpa, age)) if age <= GAUGE_AGE_MAX && kpa.is_finite() => kpa,
            Some((_, age)) => return Err(Stop::GaugeSilent(age)),
            None => return Err(Stop::GaugeSilent(Duration::MAX)),
        };
        if seen.answer_age > ANSWER_AGE_MAX {
            return Err(Stop::DriveSilent(seen.answer_age));
        }
        if kpa > limits.highest_kpa + BEYOND_KPA {
            return Err(Stop::TooHigh { kpa, highest_kpa: limits.highest_kpa });
        }
        if kpa < -BELOW_ZERO_KPA {
            return Err(Stop::BelowZero(kpa));
        }
        if seen.now.saturating_sub(self.begun) > limits.total {
            return Err(Stop::TooLong(limits.total));
        }
        self.lately.push_back((seen.now, kpa));
        while self.lately.front().is_some_and(|(at, _)| seen.now.saturating_sub(*at) > SECOND) {
            self.lately.pop_front();
        }
        let least = self.lately.iter().map(|(_, kpa)| *kpa).fold(f64::INFINITY, f64::min);
        if kpa - least > FASTER * kpa_per_s + FASTER_KPA {
            return Err(Stop::TooFast { kpa_per_s: kpa - least });
        }
        Ok(kpa)
    }

    /// Whether the bag follows what the drive was told.
    ///
    /// # Errors
    /// If it has not for some seconds.
    pub(super) fn compare(&mut self, now: Duration, gauge_kpa: f64, set_kpa: f64) -> Result<(), Stop> {
        let apart = (gauge_kpa - set_kpa).abs() > APART_KPA + APART_SHARE * set_kpa;
        let since = *self.apart.get_or_insert(now);
        if !apart {
            self.apart = None;
        } else if now.saturating_sub(since) > APART_FOR {
            return Err(Stop::Apart { gauge_kpa, set_kpa });
        }
        Ok(())
    }

    /// The drive is told nothing to compare with.
    pub(super) fn forget(&mut self) {
        self.apart = None;
        self.lately.clear();
    }
}
