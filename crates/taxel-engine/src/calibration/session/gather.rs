//! From scans and pressure to samples: what enters a session, when its ramp ends, and why nothing enters any more.

use std::sync::Arc;
use std::time::Duration;
use taxel_skin::{Kilopascal, Time};

use super::{SessionEvent, SessionRun};
use crate::calibration::branch::Direction;
use crate::calibration::fit::scans::RECORDING_SCANS_MIN;
use crate::calibration::job::refuse_gaps;
use crate::calibration::limits::PROBATION;
use crate::calibration::ramp::Gate;
use crate::calibration::samples::{Pending, Sample};
use crate::calibration::transition::Trigger;
use crate::calibration::view::SampleRefusal;
use crate::counts::Counts;
use crate::intake::gauge::GaugeHistory;
use crate::now::Now;

/// A rise that gains nothing for so long is reported as one that cannot get further.
const STALLED_AFTER: Duration = Duration::from_secs(5);

/// Scans that wait for the gauge and for the end of their probation: at the longest gauge timeout of 1 s and the
/// shortest period of 5 ms there are 400.
const PENDING_MAX: usize = 512;

impl SessionRun {
    /// A scan ended; `None` if a module that the session needs was silent, or the zero does not hold.
    pub fn on_scan(&mut self, scan: Option<Pending>) {
        if !self.is_ramping() {
            return;
        }
        self.dirty = true;
        let Some(scan) = scan else {
            self.stale_since_progress += 1;
            self.view.refused.add(SampleRefusal::StaleModule, 1);
            return;
        };
        if self.pending.back().is_some_and(|newest| newest.time == scan.time) {
            return; // the same scan once more has nothing to say
        }
        self.rise.on_scan(&scan.counts);
        if self.pending.len() >= PENDING_MAX {
            self.pending.pop_front();
            self.view.refused.add(SampleRefusal::NoPressure, 1);
        }
        self.pending.push_back(scan);
    }

    /// Moves waiting scans through the gates, as far as the gauge has come and their probation is over. `silence` says which
    /// modules are silent.
    pub fn advance(&mut self, now: Now, gauge: &GaugeHistory, silence: impl FnOnce() -> String) {
        if !self.is_ramping() {
            return;
        }
        if self.plateaus.is_some() {
            return self.wait_for_plateau(now, silence);
        }
        if let Some((_, Kilopascal(kpa))) = gauge.newest() {
            self.rise.on_gauge(kpa - self.gauge_zero_kpa());
        }
        let ripe = |scan: &Pending| now.time.since(scan.time) >= PROBATION;
        while let Some(time) = self.pending.front().filter(|scan| ripe(scan)).map(|scan| scan.time) {
            let gate = self.ramp.judge(now.time, time, gauge, &self.limits);
            if gate == Gate::Wait {
                break;
            }
            let Some(scan) = self.pending.pop_front() else { break };
            match gate {
                Gate::Accept(pressure) if !self.accept(scan, pressure) => return self.fit(now),
                Gate::Refuse(reason) => self.view.refused.add(reason, 1),
                _ => {}
            }
            if let Some(why) = self.ramp.why_void(time, gauge, &self.limits) {
                self.view.untrusted.clone_from(&why);
                // The models of earlier ramps are good, and may be in use.
                let end = if self.view.model_set.is_none() { Trigger::Void } else { Trigger::Fail };
                return self.trigger(now, end, why);
            }
            if self.is_over(time, gate, gauge) {
                return self.end_branch(now, time);
            }
        }
        self.give_up_if_hopeless(now, gauge, silence);
    }

    /// What was gathered is fitted, unless the fall is to be gathered, too.
    fn end_branch(&mut self, now: Now, time: Time) {
        if !self.turn(time) {
            self.fit(now);
        }
    }

    /// Nothing can come of it.
    pub(super) fn fail(&mut self, now: Now, why: String, silence: impl FnOnce() -> String) {
        let silence = match self.stale_since_progress {
            0 => String::new(),
            _ => format!(": {}; leave them out of the session or mend them", silence()),
        };
        self.trigger(now, Trigger::Fail, why + &silence);
    }

    /// Whether the branch has reached its end with the scan at `time`. A fall has also where no sample entered any
    /// more: the bag was vented.
    fn is_over(&self, time: Time, gate: Gate, gauge: &GaugeHistory) -> bool {
        match self.view.direction {
            Direction::Rising => {
                matches!(gate, Gate::Accept(pressure) if pressure.0 - self.gauge_zero_kpa() >= self.limits.target.0)
            }
            Direction::Falling => {
                gauge.trend(time).is_some_and(|trend| trend.level_kpa - self.gauge_zero_kpa() <= self.limits.fall_end.0)
            }
        }
    }

    /// What the gauge read when the ramp began: the pressure is counted from there.
    pub(super) fn gauge_zero_kpa(&self) -> f64 {
        self.samples.ramps.last().and_then(|ramp| ramp.gauge_kpa).unwrap_or(0.0)
    }

    /// A scan enters; false if the session is full.
    pub(super) fn accept(&mut self, scan: Pending, pressure: Kilopascal) -> bool {
        if self.samples.samples.len() >= self.limits.scans_max {
            self.view.refused.add(SampleRefusal::Full, 1);
            return false;
        }
        self.cover(pressure.0 - self.gauge_zero_kpa());
        self.note_extremes(scan.counts.counts());
        self.stale_since_progress = 0;
        let sample = Sample {
            ramp: self.view.ramps.saturating_sub(1),
            time_ns: scan.time.as_nanos(),
            pressure_kpa: pressure.0,
            counts: scan.counts,
        };
        let index = self.view.accepted;
        self.view.accepted += 1;
        Arc::make_mut(&mut self.samples).samples.push(sample.clone());
        self.events.push(SessionEvent::Sample { index, sample });
        true
    }

    pub(super) fn cover(&mut self, kpa: f64) {
        if let Some(step) = self.covered.get_mut(kpa.max(0.0) as usize) {
            *step = true;
        }
    }

    pub(super) fn note_extremes(&mut self, counts: Counts<'_>) {
        for ((low, high), count) in self.extremes.iter_mut().zip(counts.iter_units()) {
            *low = count.min(*low);
            *high = count.max(*high);
        }
    }

    /// Says that nothing enters any more, and ends the ramp after a while. What a rise has gathered is fitted where it is enough; a
    /// fall leaves a whole rise to be fitted.
    fn give_up_if_hopeless(&mut self, now: Now, gauge: &GaugeHistory, silence: impl FnOnce() -> String) {
        let nothing_for = now.time.since(self.ramp.progress);
        let rising = self.view.direction == Direction::Rising;
        if nothing_for <= self.limits.patience + PROBATION {
            let stalled = rising && self.ramp.has_begun() && nothing_for > STALLED_AFTER + PROBATION;
            if stalled {
                let why = self.why_nothing_enters(now.time, gauge, STALLED_AFTER);
                let offer = if self.has_enough() { self.offer() } else { String::new() };
                self.view.reason = why + &offer;
            } else if self.stalled {
                self.view.reason.clear();
            }
            self.stalled = stalled;
            return;
        }
        let why = self.why_nothing_enters(now.time, gauge, self.limits.patience);
        if rising && !self.has_enough() {
            return self.fail(now, why, silence);
        }
        let branch = if rising { "rise" } else { "falling branch" };
        self.view.reason = format!("the {branch} ended early: {why}");
        self.end_branch(now, now.time);
    }

    /// What an operator can do about a rise that cannot get further.
    fn offer(&self) -> String {
        let (scans, number) = (self.samples.samples.len(), self.view.number);
        format!("; to end the ramp here, with {scans} scans: taxeld sessions end {number} --fit")
    }

    /// Whether a fit can come of what was gathered.
    pub(super) fn has_enough(&self) -> bool {
        self.check_plateaus().is_ok()
            && self.samples.samples.len() >= RECORDING_SCANS_MIN
            && refuse_gaps(&self.samples.pressures_kpa()).is_ok()
    }

    fn why_nothing_enters(&self, now: Time, gauge: &GaugeHistory, patience: Duration) -> String {
        let seconds = patience.as_secs();
        if let Some(silence) = gauge.silence(now, self.limits.gauge_timeout) {
            return silence;
        }
        let kpa = gauge.newest().map_or(0.0, |(_, pressure)| pressure.0 - self.gauge_zero_kpa());
        match self.view.direction {
            _ if self.stale_since_progress > 0 => {
                format!("{} scans in {seconds} s had silent modules", self.stale_since_progress)
            }
            Direction::Falling => format!(
                "the pressure did not fall for {seconds} s: it is {kpa:.1} kPa, the branch ends at {:.1} kPa",
                self.limits.fall_end.0
            ),
            Direction::Rising => self.rise.why(kpa, patience, &self.limits),
        }
    }
}
