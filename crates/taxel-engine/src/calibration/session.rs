//! One session under way: from scans and pressure to samples, and what the operator sees of it.

mod shown;
mod typed;

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;
use taxel_skin::{Kilopascal, Time};

use crate::baseline::TaxelBaseline;
use crate::calibration::branch::{Branch, Direction};
use crate::calibration::fit::scans::RECORDING_SCANS_MIN;
use crate::calibration::job::{FitJob, refuse_gaps};
use crate::calibration::limits::{PROBATION, SessionLimits};
use crate::calibration::plateau::Plateaus;
use crate::calibration::ramp::{Gate, Ramp};
use crate::calibration::rise::Rise;
use crate::calibration::samples::{Pending, RampBaseline, Sample, SessionSamples};
use crate::calibration::view::{SampleRefusal, SessionState, SessionView};
use crate::counts::Counts;
use crate::intake::gauge::{GaugeAtRest, GaugeHistory};
use crate::now::Now;

/// A rise that gains nothing for so long is told as one that cannot get further.
const STALLED_AFTER: Duration = Duration::from_secs(5);

/// Scans that wait for the gauge and for the end of their probation: at the longest gauge timeout of 1 s and the
/// shortest period of 5 ms there are 400.
const PENDING_MAX: usize = 512;

/// What a step of the session came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// It goes on.
    On,
    /// The rise has ended and the falling branch begins.
    Turned,
    /// The ramp reached its end, or the session is full; the view says why if it ended early.
    RampEnded,
    /// It can not succeed; the view has the reason.
    Failed,
    /// What it gathered cannot be trusted; the view has the reason.
    Void,
}

/// What follows of what happens to a session.
#[derive(Clone, Debug)]
pub enum SessionEvent {
    /// The skin is to be watched at rest, for the zero of a ramp.
    WantsZero,
    /// No zero is wanted any more.
    ZeroNotWanted,
    /// A ramp began at this zero: to disk.
    Ramp(RampBaseline),
    /// A scan entered: to disk.
    Sample {
        /// Position of the sample in the session, from 0.
        index: u64,
        /// The sample.
        sample: Sample,
    },
    /// It reached another state, or its view changed for good: to disk and to readers.
    Changed,
    /// This is to be computed outside the engine.
    Fit(Box<FitJob>),
}

/// A session that holds its patch or waits for review.
#[derive(Debug)]
pub struct SessionRun {
    pub(crate) view: SessionView,
    limits: SessionLimits,
    pub(crate) samples: Arc<SessionSamples>,
    ramp: Ramp,
    rise: Rise,
    /// Where a dial is typed: the plateaus of the present ramp.
    pub(super) plateaus: Option<Plateaus>,
    pending: VecDeque<Pending>,
    /// One flag per 1 kPa step from 0 to the target.
    covered: Vec<bool>,
    /// Least and greatest count per taxel so far, in units.
    extremes: Vec<(f64, f64)>,
    /// Scans whose modules were not all fresh, since the last sample: they explain a failure.
    pub(super) stale_since_progress: u64,
    /// Whether it was told that the rise cannot get further.
    stalled: bool,
    /// When it reached its present state, on the run's clock.
    pub(super) entered: Time,
}

impl SessionRun {
    /// A session that is about to watch the skin at rest.
    pub fn new(now: Now, view: SessionView, mut limits: SessionLimits, taxels: usize) -> Self {
        limits.target = Kilopascal(view.target_kpa);
        let mut run = Self {
            covered: vec![false; view.target_kpa.ceil().max(1.0) as usize],
            extremes: vec![(f64::INFINITY, f64::NEG_INFINITY); taxels],
            ramp: Ramp::new(now.time, view.direction, None),
            rise: Rise::default(),
            plateaus: limits.typed.then(|| Plateaus::begin(now.time)),
            view,
            limits,
            samples: Arc::default(),
            pending: VecDeque::new(),
            stale_since_progress: 0,
            stalled: false,
            entered: now.time,
        };
        run.view.responding = (0, taxels as u32);
        run
    }

    /// Takes up an interrupted session with the samples that were on disk.
    pub fn resume(now: Now, view: SessionView, limits: SessionLimits, taxels: usize, samples: SessionSamples) -> Self {
        let mut run = Self::new(now, view, limits, taxels);
        samples.pressures_kpa().into_iter().for_each(|kpa| run.cover(kpa));
        for sample in &samples.samples {
            run.note_extremes(sample.counts.counts());
        }
        run.view.accepted = samples.samples.len() as u64;
        run.view.durable = run.view.accepted;
        run.view.ramps = samples.ramps.len() as u16;
        run.samples = Arc::new(samples);
        run.count_responding();
        run
    }

    /// Changes the state; the reason is for people.
    pub fn enter(&mut self, now: Now, state: SessionState, reason: impl Into<String>) {
        self.view.state = state;
        self.view.reason = reason.into();
        self.view.changed_wall_ns = now.wall_ns;
        self.entered = now.time;
        self.view.remaining_s = None;
        if state != SessionState::Ramping {
            self.pending.clear();
        }
    }

    /// The scans that wait are not to be believed: the zero was lost or is in doubt.
    pub fn drop_waiting(&mut self) {
        let dropped = self.pending.len() as u64;
        self.pending.clear();
        self.plateaus.iter_mut().for_each(Plateaus::forget_scans);
        self.view.refused.add(SampleRefusal::ZeroInDoubt, dropped);
    }

    /// Rest is proven: the ramp begins at this zero.
    pub fn begin_ramp(&mut self, now: Now, taxels: Vec<TaxelBaseline>, gauge: &GaugeHistory) -> SessionEvent {
        let (gauge_kpa, newest) = match gauge.at_rest(now.time, self.limits.gauge_rest()) {
            GaugeAtRest::Still { kpa, newest } => (Some(kpa.0), Some(newest)),
            GaugeAtRest::Moves(..) | GaugeAtRest::NotHeard => (None, None),
        };
        self.plateaus.iter_mut().for_each(|plateaus| *plateaus = Plateaus::begin(now.time));
        let ramp = RampBaseline { ramp: self.view.ramps, taxels, gauge_kpa };
        self.view.ramps += 1;
        self.begin_branch(Ramp::new(now.time, Direction::Rising, newest));
        Arc::make_mut(&mut self.samples).ramps.push(ramp.clone());
        self.enter(now, SessionState::Ramping, "");
        SessionEvent::Ramp(ramp)
    }

    /// Ends the rise: the falling branch begins. False if the session gathers none, or it has begun.
    pub fn turn(&mut self, now: Time) -> bool {
        let turns = self.view.state == SessionState::Ramping
            && self.view.branches == Branch::Both
            && self.view.direction == Direction::Rising;
        if turns {
            self.begin_branch(self.ramp.turned(now, Direction::Falling));
        }
        turns
    }

    fn begin_branch(&mut self, branch: Ramp) {
        self.view.direction = branch.direction();
        self.ramp = branch;
        self.rise = Rise::default();
        (self.stale_since_progress, self.stalled) = (0, false);
    }

    /// Takes one scan; `None` if some module was silent.
    pub fn on_scan(&mut self, scan: Option<Pending>) {
        if self.view.state != SessionState::Ramping {
            return;
        }
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

    /// Moves waiting scans through the gates, as far as the gauge has come and their probation is over. New samples go
    /// to `events`.
    pub fn advance(&mut self, now: Time, gauge: &GaugeHistory, events: &mut Vec<SessionEvent>) -> Progress {
        if self.view.state != SessionState::Ramping {
            return Progress::On;
        }
        if self.plateaus.is_some() {
            return self.wait_for_plateau(now);
        }
        if let Some((_, Kilopascal(kpa))) = gauge.newest() {
            self.rise.on_gauge(kpa - self.gauge_zero_kpa());
        }
        while let Some(time) = self.pending.front().map(|scan| scan.time).filter(|time| now.since(*time) >= PROBATION) {
            let gate = self.ramp.judge(now, time, gauge, &self.limits);
            if gate == Gate::Wait {
                break;
            }
            let Some(scan) = self.pending.pop_front() else { break };
            match gate {
                Gate::Accept(pressure) => {
                    if !self.accept(scan, pressure, events) {
                        return Progress::RampEnded;
                    }
                }
                Gate::Refuse(reason) => self.view.refused.add(reason, 1),
                Gate::Wait => {}
            }
            if let Some(why) = self.ramp.why_void(time, gauge, &self.limits) {
                self.view.reason.clone_from(&why);
                self.view.untrusted = why;
                return Progress::Void;
            }
            if self.is_over(time, gate, gauge) {
                return if self.turn(time) { Progress::Turned } else { Progress::RampEnded };
            }
        }
        self.give_up_if_hopeless(now, gauge)
    }

    /// Whether the branch has reached its end with the scan at `time`. A fall has also where no sample entered any
    /// more: the bag was vented.
    fn is_over(&self, time: Time, gate: Gate, gauge: &GaugeHistory) -> bool {
        match self.ramp.direction() {
            Direction::Rising => {
                matches!(gate, Gate::Accept(pressure) if pressure.0 - self.gauge_zero_kpa() >= self.limits.target.0)
            }
            Direction::Falling => {
                gauge.trend(time).is_some_and(|trend| trend.level_kpa - self.gauge_zero_kpa() <= self.limits.fall_end.0)
            }
        }
    }

    /// What the gauge read when the ramp began: the pressure is counted from there.
    fn gauge_zero_kpa(&self) -> f64 {
        self.samples.ramps.last().and_then(|ramp| ramp.gauge_kpa).unwrap_or(0.0)
    }

    /// A scan enters; false if the session is full.
    fn accept(&mut self, scan: Pending, pressure: Kilopascal, events: &mut Vec<SessionEvent>) -> bool {
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
        events.push(SessionEvent::Sample { index, sample });
        true
    }

    fn cover(&mut self, kpa: f64) {
        if let Some(step) = self.covered.get_mut(kpa.max(0.0) as usize) {
            *step = true;
        }
    }

    fn note_extremes(&mut self, counts: Counts<'_>) {
        for ((low, high), count) in self.extremes.iter_mut().zip(counts.iter_units()) {
            *low = count.min(*low);
            *high = count.max(*high);
        }
    }

    /// Says that nothing enters any more, and ends the ramp after a while. What a rise has gathered is fitted where it is enough; a
    /// fall leaves a whole rise to be fitted.
    fn give_up_if_hopeless(&mut self, now: Time, gauge: &GaugeHistory) -> Progress {
        let silence = now.since(self.ramp.progress());
        let rising = self.ramp.direction() == Direction::Rising;
        if silence <= self.limits.patience + PROBATION {
            let stalled = rising && self.ramp.has_begun() && silence > STALLED_AFTER + PROBATION;
            if stalled {
                let why = self.why_nothing_enters(now, gauge, STALLED_AFTER);
                let offer = if self.has_enough() { self.offer() } else { String::new() };
                self.view.reason = why + &offer;
            } else if std::mem::replace(&mut self.stalled, stalled) {
                self.view.reason.clear();
            }
            self.stalled = stalled;
            return Progress::On;
        }
        let why = self.why_nothing_enters(now, gauge, self.limits.patience);
        let branch = if rising { "rise" } else { "falling branch" };
        if rising && !self.has_enough() {
            self.view.reason = why;
            return Progress::Failed;
        }
        self.view.reason = format!("the {branch} ended early: {why}");
        if self.turn(now) { Progress::Turned } else { Progress::RampEnded }
    }

    /// What an operator can do about a rise that cannot get further.
    fn offer(&self) -> String {
        let (scans, number) = (self.samples.samples.len(), self.view.number);
        format!("; to end the ramp here, with {scans} scans: taxeld sessions end {number} --fit")
    }

    /// Whether a fit can come of what was gathered.
    fn has_enough(&self) -> bool {
        self.check_plateaus().is_ok()
            && self.samples.samples.len() >= RECORDING_SCANS_MIN
            && refuse_gaps(&self.samples.pressures_kpa()).is_ok()
    }

    fn why_nothing_enters(&self, now: Time, gauge: &GaugeHistory, patience: Duration) -> String {
        let seconds = patience.as_secs();
        match gauge.newest() {
            None => format!("no pressure frame came in {seconds} s: is the gauge on, and is its CAN identifier right?"),
            Some((time, _)) if now.since(time) > self.limits.gauge_timeout => {
                format!("the last pressure frame came {:.1} s ago", now.since(time).as_secs_f64())
            }
            Some(_) if self.stale_since_progress > 0 => {
                format!("{} scans in {seconds} s had silent modules", self.stale_since_progress)
            }
            Some((_, Kilopascal(kpa))) if self.ramp.direction() == Direction::Falling => {
                let (kpa, end) = (kpa - self.gauge_zero_kpa(), self.limits.fall_end.0);
                format!(
                    "the pressure did not fall for {seconds} s: it is {kpa:.1} kPa, the branch ends at {end:.1} kPa"
                )
            }
            Some((_, Kilopascal(kpa))) => self.rise.why(kpa - self.gauge_zero_kpa(), patience, &self.limits),
        }
    }
}
