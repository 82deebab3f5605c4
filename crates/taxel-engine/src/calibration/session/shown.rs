//! What an operator sees of a session while it gathers: pressure, rate, coverage, the time left, taxels that do not respond.

use std::sync::Arc;
use std::time::Duration;

use taxel_model::skin::SWING_MIN;
use taxel_skin::Time;

use super::SessionRun;
use crate::calibration::branch::Direction;
use crate::calibration::plateau::PlateauView;
use crate::calibration::view::{SessionState, SessionView};
use crate::intake::gauge::GaugeHistory;
use crate::statistics::median;

/// While a session is open its view is shown this often, besides at each change of state.
const SHOW_EVERY: Duration = Duration::from_millis(200);

/// In review a pressure that moved by less is not shown anew: that is the gauge's noise.
const REVIEW_STEP_KPA: f64 = 0.5;

impl SessionRun {
    /// The session with pressure, rate, coverage and the time left as they are now.
    pub fn refreshed(&mut self, now: Time, gauge: &GaugeHistory) -> Arc<SessionView> {
        self.refresh(now, gauge);
        (self.dirty, self.shown) = (false, now);
        Arc::new(self.view.clone())
    }

    /// An open session's progress for readers, a few times a second. In review it goes on while the bag is being vented.
    pub fn show(&mut self, now: Time, gauge: &GaugeHistory) -> Option<Arc<SessionView>> {
        self.deadline().filter(|deadline| now >= *deadline)?;
        let idle = !self.dirty && !self.view.state.is_open();
        let before = self.view.pressure_kpa;
        let view = self.refreshed(now, gauge);
        let moved = match (before, view.pressure_kpa) {
            (Some(before), Some(kpa)) => (before - kpa).abs() > REVIEW_STEP_KPA,
            (before, kpa) => before.is_some() != kpa.is_some(),
        };
        if idle && !moved {
            self.view.pressure_kpa = before; // the next one is compared with what was shown
            return None;
        }
        Some(view)
    }

    /// When the progress is to be shown next; a session that holds its patch is looked at then, too.
    pub fn deadline(&self) -> Option<Time> {
        let changes = self.dirty || self.view.state.is_open() || self.view.state == SessionState::Review;
        changes.then(|| self.shown + SHOW_EVERY)
    }

    /// Brings pressure, rate, coverage and the time left up to date.
    fn refresh(&mut self, now: Time, gauge: &GaugeHistory) {
        let fresh = gauge.newest().filter(|&(time, _)| now.since(time) <= self.limits.gauge_timeout);
        self.view.gauge_zero_kpa = self.gauge_zero_kpa();
        self.view.pressure_kpa = fresh.map(|(_, p)| p.0 - self.view.gauge_zero_kpa);
        self.view.rate_kpa_per_s = fresh.and_then(|(time, _)| gauge.trend(time)).map(|trend| trend.rate_kpa_per_s);
        self.view.coverage = self.covered.iter().filter(|c| **c).count() as f64 / self.covered.len() as f64;
        self.count_responding();
        if let Some(plateaus) = &self.plateaus {
            let (ramping, last_kpa) = (self.is_ramping(), plateaus.last_kpa());
            let (settled, taken) = (ramping && plateaus.is_settled(), self.samples.plateaus());
            self.view.typed = Some(PlateauView { settled, taken: taken as u16, last_kpa });
            if ramping {
                self.view.reason = plateaus.advice(taken, &self.limits);
            }
            self.view.pressure_kpa = last_kpa.filter(|_| ramping).map(|kpa| kpa - self.view.gauge_zero_kpa);
            return;
        }
        let direction = self.view.direction;
        let end = if direction == Direction::Rising { self.limits.target } else { self.limits.fall_end };
        let left = self.view.pressure_kpa.map(|kpa| (direction.sign() * (end.0 - kpa)).max(0.0));
        let rate = self.view.rate_kpa_per_s.map(|rate| direction.sign() * rate).filter(|rate| *rate > 0.02);
        self.view.remaining_s = left.zip(rate).filter(|_| self.is_ramping()).map(|(left, rate)| left / rate);
    }

    pub(super) fn count_responding(&mut self) {
        let moved = |(low, high): &(f64, f64)| high - low;
        // As the fit will ask: less is noise.
        let of_median = SWING_MIN * median(self.extremes.iter().map(moved)).unwrap_or(0.0);
        let least = of_median.max(f64::from(self.limits.responding_counts));
        let still = |extremes: &(f64, f64)| moved(extremes) < least;
        let taxels = (0_u16..).zip(&self.extremes);
        let unmoved: Vec<u16> = taxels.filter(|(_, extremes)| still(extremes)).map(|(taxel, _)| taxel).collect();
        self.view.responding.0 = (self.extremes.len() - unmoved.len()) as u32;
        if *self.view.not_responding != *unmoved {
            self.view.not_responding = unmoved.into();
        }
    }
}
