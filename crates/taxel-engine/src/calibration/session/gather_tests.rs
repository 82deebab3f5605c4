//! Where each limit of a session lies, and what its operator is told of it.

use std::sync::Arc;
use taxel_skin::{Board, BoardAddress, BusIndex, Kilopascal, Module, ModuleKind, Patch, Time};

use super::{SessionEvent, SessionRun};
use crate::baseline::TaxelBaseline;
use crate::calibration::branch::{Branch, Direction};
use crate::calibration::limits::SessionLimits;
use crate::calibration::samples::{Pending, Sample, SessionSamples};
use crate::calibration::view::{SampleRefusal, SessionState, SessionView};
use crate::counts::SharedCounts;
use crate::intake::gauge::GaugeHistory;
use crate::now::Now;
use crate::plan::PatchPlan;

const TAXELS: usize = 3;

fn ms(ms: i64) -> Time {
    Time::from_nanos(ms * 1_000_000)
}

fn at(time: Time) -> Now {
    Now { time, wall_ns: 7_000_000_000 + time.as_nanos() }
}

fn scan(time: Time, counts: [u16; TAXELS]) -> Option<Pending> {
    Some(Pending { time, counts: SharedCounts::from(counts.to_vec()) })
}

fn plan(session: SessionLimits) -> Arc<PatchPlan> {
    let modules = vec![(Module::new(0).unwrap(), ModuleKind::Cells(TAXELS as u8))];
    let board = Board { bus: BusIndex(0), address: BoardAddress::new(1).unwrap(), modules };
    Arc::new(PatchPlan { session, ..PatchPlan::new(Patch::new("p", vec![board]).unwrap()) })
}

/// A session whose ramp has begun at time 0, and its gauge.
struct Scene {
    run: SessionRun,
    gauge: GaugeHistory,
    /// The newest pressure, and when it was read.
    kpa: f64,
    ms: i64,
}

impl Scene {
    fn new(branches: Branch, target_kpa: f64) -> Self {
        Self::with(branches, target_kpa, |_| {})
    }

    fn with(branches: Branch, target_kpa: f64, change: impl FnOnce(&mut SessionLimits)) -> Self {
        let mut limits = SessionLimits::default();
        change(&mut limits);
        let view = SessionView { number: 1, target_kpa, branches, ..SessionView::default() };
        let gauge = GaugeHistory::at_rest_until(ms(0));
        let mut run = SessionRun::start(at(ms(0)), &plan(limits), view);
        run.on_zero_taken(at(ms(0)), vec![TaxelBaseline { mean: 200.0, noise: 0.5 }; TAXELS], &gauge);
        run.take_events();
        Self { run, gauge, kpa: 0.0, ms: 0 }
    }

    /// The pressure goes on for so many seconds, read every 10 ms, with a scan every 50 ms, until the branch ends.
    fn go(&mut self, kpa_per_s: f64, seconds: f64) -> SessionState {
        let direction = self.run.view.direction;
        let (begin_ms, begin_kpa) = (self.ms, self.kpa);
        for _ in 0..(100.0 * seconds).round() as i64 {
            self.ms += 10;
            self.kpa = begin_kpa + kpa_per_s * (self.ms - begin_ms) as f64 / 1000.0;
            self.gauge.push(ms(self.ms), Kilopascal(self.kpa));
            if self.ms % 50 == 0 {
                self.run.on_scan(scan(ms(self.ms), [200, 200 - self.kpa.max(0.0) as u16, 200]));
            }
            if self.advance(self.ms) != SessionState::Ramping || self.run.view.direction != direction {
                break;
            }
        }
        self.run.view.state
    }

    fn advance(&mut self, until_ms: i64) -> SessionState {
        self.run.advance(at(ms(until_ms)), &self.gauge, || "module 2 is silent".to_owned());
        self.run.view.state
    }

    fn shown(&mut self) -> &SessionView {
        self.run.refreshed(ms(self.ms), &self.gauge);
        &self.run.view
    }

    fn refused(&self, why: SampleRefusal) -> u64 {
        self.run.view.refused.get(why)
    }
}

#[test]
fn a_scan_enters_when_the_zero_has_stood_for_a_second_after_it() {
    let mut scene = Scene::new(Branch::Rising, 50.0);
    (1..=200).for_each(|i| scene.gauge.push(ms(10 * i), Kilopascal(0.02 * i as f64)));
    scene.run.on_scan(scan(ms(1_500), [200; TAXELS]));
    scene.advance(2_499);
    assert_eq!(scene.run.view.accepted, 0);
    scene.advance(2_500);
    assert_eq!(scene.run.view.accepted, 1);
    let Some(SessionEvent::Sample { index, sample }) = scene.run.take_events().pop() else { panic!("no sample") };
    assert_eq!((index, sample.ramp, sample.time_ns), (0, 0, 1_500_000_000));
    assert!((sample.pressure_kpa - 3.0).abs() < 1e-9, "{}", sample.pressure_kpa);
}

/// At 5 ms and 1 s of patience with the gauge there are 400; more than 512 would wait for ever.
#[test]
fn no_more_than_512_scans_wait_and_the_oldest_goes_first() {
    let mut scene = Scene::new(Branch::Rising, 50.0);
    (1..=512).for_each(|i| scene.run.on_scan(scan(ms(i), [200; TAXELS])));
    assert_eq!(scene.refused(SampleRefusal::NoPressure), 0);
    scene.run.on_scan(scan(ms(513), [200; TAXELS]));
    assert_eq!(scene.refused(SampleRefusal::NoPressure), 1);
    scene.run.drop_waiting();
    assert_eq!(scene.refused(SampleRefusal::ZeroInDoubt), 512);
}

#[test]
fn a_ramp_ends_when_the_session_is_full() {
    let mut scene = Scene::with(Branch::Rising, 50.0, |limits| limits.scans_max = 5);
    assert_eq!(scene.go(2.0, 10.0), SessionState::Fitting);
    assert_eq!((scene.run.view.accepted, scene.run.samples.samples.len()), (5, 5));
    assert_eq!(scene.refused(SampleRefusal::Full), 1);
}

#[test]
fn a_rise_ends_at_its_target_and_a_fall_where_the_bag_is_vented() {
    let mut scene = Scene::new(Branch::Both, 10.0);
    assert_eq!(scene.go(2.0, 7.0), SessionState::Ramping);
    assert_eq!(scene.run.view.direction, Direction::Falling);
    let highest = scene.run.samples.samples.iter().map(|s| s.pressure_kpa).fold(0.0, f64::max);
    assert!((10.0..10.2).contains(&highest), "{highest}");
    assert_eq!(scene.go(-2.0, 10.0), SessionState::Fitting);
    let last = scene.run.samples.samples.last().unwrap().pressure_kpa;
    assert!((0.9..1.2).contains(&last), "the branch ends at 1 kPa: {last}");
    assert!(!scene.run.turn(ms(scene.ms)), "a fall turns no more");
}

#[test]
fn why_nothing_enters_is_told_from_what_is_missing() {
    let why = |scene: &Scene| scene.run.view.reason.clone();
    let mut deaf = Scene::new(Branch::Rising, 50.0);
    assert_eq!(deaf.advance(62_000), SessionState::Failed);
    assert_eq!(why(&deaf), "the last pressure frame came 62.0 s ago");
    let mut silent = Scene::new(Branch::Rising, 50.0);
    silent.gauge.push(ms(61_500), Kilopascal(0.0));
    (0..3).for_each(|_| silent.run.on_scan(None));
    assert_eq!(silent.advance(62_000), SessionState::Failed);
    assert_eq!(
        why(&silent),
        "3 scans in 60 s had silent modules: module 2 is silent; leave them out of the session or mend them"
    );
    assert!(silent.run.stale_since_progress > 0);
    let mut still = Scene::new(Branch::Rising, 50.0);
    still.gauge.push(ms(61_500), Kilopascal(0.0));
    assert_eq!(still.advance(62_000), SessionState::Failed);
    assert!(why(&still).starts_with("the pressure did not rise for 60 s"), "{}", why(&still));
    assert!(still.run.stale_since_progress == 0);
    assert_eq!(still.refused(SampleRefusal::StaleModule), 0);
}

/// Modules that were silent for a moment long ago are not what keeps samples out now.
#[test]
fn what_was_silent_before_the_last_sample_explains_nothing() {
    let mut scene = Scene::new(Branch::Rising, 50.0);
    scene.run.on_scan(None);
    assert!(scene.run.stale_since_progress > 0);
    scene.go(2.0, 3.0);
    assert!(scene.run.view.accepted > 0 && scene.run.stale_since_progress == 0);
    scene.run.on_scan(None);
    scene.run.view.state = SessionState::Taring;
    scene.run.on_zero_taken(at(ms(scene.ms)), Vec::new(), &scene.gauge);
    assert!(scene.run.stale_since_progress == 0, "nor what was silent in an earlier ramp");
}

#[test]
fn the_time_left_is_what_is_missing_to_the_end_of_the_branch_at_the_present_rate() {
    let mut scene = Scene::new(Branch::Both, 10.0);
    scene.go(2.0, 3.0);
    let view = scene.shown();
    assert_eq!(view.pressure_kpa.map(|p| (p * 1e6).round() / 1e6), Some(6.0));
    assert!((view.rate_kpa_per_s.unwrap() - 2.0).abs() < 0.05, "{view:?}");
    assert!((view.remaining_s.unwrap() - 2.0).abs() < 0.1, "4 kPa at 2 kPa/s: {view:?}");
    scene.go(2.0, 4.0);
    scene.go(-1.5, 2.0);
    let view = scene.shown().clone();
    assert_eq!(view.direction, Direction::Falling);
    let expected = (view.pressure_kpa.unwrap() - 1.0) / 1.5;
    assert!((view.remaining_s.unwrap() - expected).abs() < 0.1, "down to 1 kPa: {view:?}");
    scene.go(0.0, 2.0);
    assert_eq!(scene.shown().remaining_s, None, "a pressure that stands still never arrives");
}

fn sample(pressure_kpa: f64, counts: [u16; TAXELS]) -> Sample {
    Sample { ramp: 0, time_ns: 0, pressure_kpa, counts: SharedCounts::from(counts.to_vec()) }
}

#[test]
fn every_kilopascal_with_a_sample_is_covered_and_a_taxel_that_moved_by_six_counts_responds() {
    let kpa = [-0.4, 0.3, 1.0, 1.9, 3.5, 12.0];
    let mut samples: Vec<Sample> = kpa.iter().map(|kpa| sample(*kpa, [200, 200, 200])).collect();
    samples[3].counts = SharedCounts::from(vec![195, 194, 206]);
    let samples = SessionSamples { ramps: Vec::new(), samples };
    let view = SessionView { target_kpa: 9.5, ..SessionView::default() };
    let mut run = SessionRun::resume(at(ms(0)), &plan(SessionLimits::default()), view, samples);
    assert_eq!((run.view.responding, &*run.view.not_responding), ((2, 3), [0_u16].as_slice()));
    assert_eq!((run.view.accepted, run.view.durable), (6, 6));
    run.refreshed(ms(0), &GaugeHistory::default());
    assert!((run.view.coverage - 0.3).abs() < 1e-9, "steps 0, 1 and 3 of ten: {}", run.view.coverage);
}

#[test]
fn a_taxel_that_moved_by_less_than_the_fit_asks_for_does_not_respond() {
    let samples = vec![sample(1.0, [200, 200, 200]), sample(60.0, [181, 120, 100])];
    let samples = SessionSamples { ramps: Vec::new(), samples };
    let run = SessionRun::resume(at(ms(0)), &plan(SessionLimits::default()), SessionView::default(), samples);
    assert_eq!((run.view.responding, &*run.view.not_responding), ((2, 3), [0_u16].as_slice()));
}
