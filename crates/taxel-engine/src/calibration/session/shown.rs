//! What an operator sees of a session while it gathers: pressure, rate, coverage, the time left, taxels that do not respond.

use taxel_model::skin::SWING_MIN;
use taxel_skin::Time;

use super::SessionRun;
use crate::calibration::branch::Direction;
use crate::calibration::plateau::PlateauView;
use crate::calibration::view::SessionState;
use crate::intake::gauge::GaugeHistory;
use crate::statistics::median;

impl SessionRun {
    /// Brings pressure, rate, coverage and the time left up to date.
    pub fn refresh(&mut self, now: Time, gauge: &GaugeHistory) {
        let fresh = gauge.newest().filter(|&(time, _)| now.since(time) <= self.limits.gauge_timeout);
        self.view.gauge_zero_kpa = self.gauge_zero_kpa();
        self.view.pressure_kpa = fresh.map(|(_, p)| p.0 - self.view.gauge_zero_kpa);
        self.view.rate_kpa_per_s = fresh.and_then(|(time, _)| gauge.trend(time)).map(|trend| trend.rate_kpa_per_s);
        self.view.coverage = self.covered.iter().filter(|c| **c).count() as f64 / self.covered.len() as f64;
        self.count_responding();
        if let Some(plateaus) = &self.plateaus {
            let (ramping, last_kpa) = (self.view.state == SessionState::Ramping, plateaus.last_kpa());
            let (settled, taken) = (ramping && plateaus.is_settled(), self.samples.plateaus());
            self.view.typed = Some(PlateauView { settled, taken: taken as u16, last_kpa });
            if ramping {
                self.view.reason = plateaus.advice(taken, &self.limits);
            }
            self.view.pressure_kpa = last_kpa.filter(|_| ramping).map(|kpa| kpa - self.view.gauge_zero_kpa);
            return;
        }
        let direction = self.ramp.direction();
        let end = if direction == Direction::Rising { self.limits.target } else { self.limits.fall_end };
        let left = self.view.pressure_kpa.map(|kpa| (direction.sign() * (end.0 - kpa)).max(0.0));
        let rate = self.view.rate_kpa_per_s.map(|rate| direction.sign() * rate).filter(|rate| *rate > 0.02);
        let ramping = self.view.state == SessionState::Ramping;
        self.view.remaining_s = left.zip(rate).filter(|_| ramping).map(|(left, rate)| left / rate);
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
