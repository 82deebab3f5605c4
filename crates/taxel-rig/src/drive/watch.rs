//! What ends a procedure at once: limits that hold whatever the programme says, and what cannot be.

use std::collections::VecDeque;
use std::time::Duration;

use super::given::{Limits, Seen};
use super::stop::{NOT_TAKEN, Stop};

/// A gauge that says nothing new for so long is silent.
pub(super) const GAUGE_AGE_MAX: Duration = Duration::from_millis(200);
/// One reading may be missing: two intervals and what a computer adds are less than that.
const GAUGE_EVERY_MAX: Duration = Duration::from_millis(80);
/// A reading that is newer by less is the same one: its age is known so well.
const SAME_WITHIN: Duration = Duration::from_millis(10);
/// A drive that has not answered for so long does not.
const ANSWER_AGE_MAX: Duration = Duration::from_millis(500);
/// It is called twenty times a second; after so long the bag is another one.
const HELD_MAX: Duration = Duration::from_secs(2);
/// Noise of a gauge, and what a regulator overshoots by, kPa.
const BEYOND_KPA: f64 = 1.0;
/// Below ambient a gauge reads noise only, kPa; more is another sign or another reference.
const BELOW_ZERO_KPA: f64 = 3.0;
/// The bag and its set point, or two gauges, are so far apart, kPa and of the latter, for so long: one of the two is wrong.
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
    /// Since when bag and set point have been apart, and the two gauges.
    apart: Option<Duration>,
    gauges_apart: Option<Duration>,
    /// Readings of the last second.
    lately: VecDeque<(Duration, f64)>,
}

impl Watch {
    pub(super) fn new(begun: Duration) -> Self {
        Self { begun, looked: begun, ..Self::default() }
    }

    /// Whether it is called as often as it should be.
    ///
    /// # Errors
    /// For how long it was not.
    pub(super) fn runs(&mut self, now: Duration) -> Result<(), Stop> {
        let held = now.saturating_sub(std::mem::replace(&mut self.looked, now));
        let words = || format!("this program was held up for {:.1} s", held.as_secs_f64());
        if held > HELD_MAX { Err(Stop(words())) } else { Ok(()) }
    }

    /// A reading that is fresh, in kPa below ambient, of a drive that answers.
    ///
    /// # Errors
    /// Which of them says nothing.
    pub(super) fn hear(seen: &Seen) -> Result<f64, Stop> {
        let answer_age = seen.answer_age.as_secs_f64();
        match seen.gauge {
            None => Err(Stop("the bag's gauge says nothing: `taxeld health` says why".to_owned())),
            Some((kpa, age)) if age > GAUGE_AGE_MAX || !kpa.is_finite() => {
                let age = age.as_secs_f64();
                Err(Stop(format!("the bag's gauge has said nothing for {age:.1} s; check its line, then begin anew")))
            }
            Some((kpa, _)) if seen.answer_age <= ANSWER_AGE_MAX => Ok(kpa),
            Some(_) => Err(Stop(format!("{NOT_TAKEN} for {answer_age:.1} s"))),
        }
    }

    /// Whether such a reading is within the limits.
    ///
    /// # Errors
    /// Why the procedure cannot go on.
    pub(super) fn look(&mut self, now: Duration, kpa: f64, limits: &Limits, kpa_per_s: f64) -> Result<(), Stop> {
        if kpa > limits.highest_kpa + BEYOND_KPA {
            return Err(Stop(format!("the bag is at {kpa:.1} kPa, limit {:.1}", limits.highest_kpa)));
        }
        if kpa < -BELOW_ZERO_KPA {
            return Err(Stop(format!(
                "the gauge reads {kpa:.1} kPa: expected pressure below ambient as a positive number; check its sign and reference"
            )));
        }
        if now.saturating_sub(self.begun) > limits.total {
            return Err(Stop(format!("it takes longer than {:.0} s (total_s)", limits.total.as_secs_f64())));
        }
        self.lately.push_back((now, kpa));
        while self.lately.front().is_some_and(|(at, _)| now.saturating_sub(*at) > SECOND) {
            self.lately.pop_front();
        }
        let least = self.lately.iter().map(|(_, kpa)| *kpa).fold(f64::INFINITY, f64::min);
        if kpa - least > FASTER * kpa_per_s + FASTER_KPA {
            return Err(Stop(format!("the pressure rises by {:.1} kPa in a second", kpa - least)));
        }
        Ok(())
    }

    /// Whether the bag follows what the drive was told.
    ///
    /// # Errors
    /// If it has not for some seconds.
    pub(super) fn compare(&mut self, now: Duration, kpa: f64, set_kpa: f64) -> Result<(), Stop> {
        let lasts = is_apart_for_long(&mut self.apart, now, kpa, set_kpa);
        if lasts { Err(Self::does_not_follow(kpa, set_kpa)) } else { Ok(()) }
    }

    pub(super) fn does_not_follow(kpa: f64, set_kpa: f64) -> Stop {
        Stop(format!(
            "the bag does not follow the drive: gauge {kpa:.1} kPa, set point {set_kpa:.1} kPa; is the bag tight, and are both in kPa below ambient?"
        ))
    }

    /// Whether the drive's own gauge reads what the bag's does.
    ///
    /// # Errors
    /// If it has not for some seconds.
    pub(super) fn compare_gauges(&mut self, now: Duration, kpa: f64, own_kpa: f64) -> Result<(), Stop> {
        let lasts = is_apart_for_long(&mut self.gauges_apart, now, kpa, own_kpa);
        let words = || {
            format!(
                "the bag's gauge reads {kpa:.1} kPa and the drive's own {own_kpa:.1} kPa: is the tube open, and are both in kPa below ambient?"
            )
        };
        if lasts { Err(Stop(words())) } else { Ok(()) }
    }

    /// The drive is told nothing to compare with.
    pub(super) fn forget(&mut self) {
        self.apart = None;
        self.lately.clear();
    }
}

/// How often a gauge gives a new reading.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pace {
    first: Duration,
    newest: Duration,
    readings: u32,
    /// How often no new one had come.
    repeats: u32,
}

impl Pace {
    /// What is seen now is a reading of this age.
    pub(super) fn push(&mut self, now: Duration, age: Duration) {
        let at = now.saturating_sub(age);
        if self.readings == 0 {
            self.first = at;
        } else if at < self.newest + SAME_WITHIN {
            self.repeats += 1;
            return;
        }
        (self.newest, self.readings) = (at, self.readings + 1);
    }

    /// Whether it is fast enough for a drive. Where each look finds a new reading, only the looks are too rare.
    ///
    /// # Errors
    /// How fast it is, and what to do.
    pub(super) fn is_enough(self) -> Result<(), Stop> {
        let every = self.newest.saturating_sub(self.first) / self.readings.saturating_sub(1).max(1);
        if every <= GAUGE_EVERY_MAX || 10 * self.repeats < self.readings {
            return Ok(());
        }
        let per_s = |every: Duration| 1.0 / every.as_secs_f64();
        Err(Stop(format!(
            "the bag's gauge gives {:.1} readings a second, and a drive needs {:.1}, because it vents when none has come for {:.1} s; set the gauge to 20 a second, or pump by hand: taxeld calibrate",
            per_s(every),
            per_s(GAUGE_EVERY_MAX),
            GAUGE_AGE_MAX.as_secs_f64()
        )))
    }
}

fn is_apart_for_long(since: &mut Option<Duration>, now: Duration, kpa: f64, from_kpa: f64) -> bool {
    if (kpa - from_kpa).abs() <= APART_KPA + APART_SHARE * from_kpa.abs() {
        *since = None;
        return false;
    }
    now.saturating_sub(*since.get_or_insert(now)) > APART_FOR
}
