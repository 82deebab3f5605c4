//! What follows from each thing that happens to a session, where each of its limits lies, and what its operator is told.

use std::sync::Arc;
use std::time::Duration;
use taxel_skin::{Kilopascal, ModuleKind, Time};

use super::{SessionEvent, SessionRun};
use crate::baseline::TaxelBaseline;
use crate::calibration::branch::{Branch, Direction};
use crate::calibration::limits::SessionLimits;
use crate::calibration::samples::{Pending, Sample, SessionSamples};
use crate::calibration::transition::Trigger;
use crate::calibration::view::{SampleRefusal, SessionState, SessionView};
use crate::counts::SharedCounts;
use crate::intake::gauge::GaugeHistory;
use crate::now::Now;
use crate::plan::PatchPlan;
use crate::tests::patch;

const TAXELS: usize = 4;
const SHOW_EVERY: Duration = Duration::from_millis(200);

fn ms(ms: i64) -> Time {
    Time::from_nanos(ms * 1_000_000)
}

fn at(ms_now: i64) -> Now {
    Now { time: ms(ms_now), wall_ns: 7_000_000_000 + 1_000_000 * ms_now }
}

fn scan(time: Time, counts: [u16; TAXELS]) -> Option<Pending> {
    Some(Pending { time, counts: SharedCounts::from(counts.to_vec()) })
}

/// A patch of two modules of two taxels.
pub fn plan() -> PatchPlan {
    PatchPlan::new(patch(&[ModuleKind::Cells(2); 2]))
}

fn view(branches: Branch, target_kpa: f64) -> SessionView {
    SessionView { number: 3, target_kpa, branches, ..SessionView::default() }
}

/// A session that was begun at time 0, its gauge, and what followed.
struct Scene {
    run: SessionRun,
    gauge: GaugeHistory,
    events: Vec<SessionEvent>,
    /// The newest pressure, and when it was read.
    kpa: f64,
    ms: i64,
}

impl Scene {
    fn of(run: SessionRun) -> Self {
        Self { run, gauge: GaugeHistory::at_rest_until(ms(0)), events: Vec::new(), kpa: 0.0, ms: 0 }
    }

    /// It watches for its zero.
    fn started(branches: Branch, target_kpa: f64, session: SessionLimits) -> Self {
        let plan = Arc::new(PatchPlan { session, ..plan() });
        let mut scene = Self::of(SessionRun::start(at(0), &plan, view(branches, target_kpa)));
        scene.settle();
        scene
    }

    /// Its ramp has begun.
    fn with(branches: Branch, target_kpa: f64, session: SessionLimits) -> Self {
        let mut scene = Self::started(branches, target_kpa, session);
        let zero = vec![TaxelBaseline { mean: 200.0, noise: 0.5 }; TAXELS];
        scene.run.on_zero_taken(at(0), zero, &scene.gauge);
        scene.settle();
        scene
    }

    fn ramping(branches: Branch, target_kpa: f64) -> Self {
        Self::with(branches, target_kpa, SessionLimits::default())
    }

    /// What followed is done.
    fn settle(&mut self) {
        for event in self.run.take_events() {
            if matches!(event, SessionEvent::Changed) {
                self.run.refreshed(ms(self.ms), &self.gauge);
            }
            self.events.push(event);
        }
    }

    fn command(&mut self, command: Trigger) {
        self.run.command(at(self.ms), command, "").unwrap();
        self.settle();
    }

    fn refuse_zero(&mut self) {
        self.run.on_zero_refused(at(self.ms), "it moves");
        self.settle();
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
                self.run.on_scan(scan(ms(self.ms), [200, 200 - self.kpa.max(0.0) as u16, 200, 200]));
            }
            if self.advance(self.ms) != SessionState::Ramping || self.run.view.direction != direction {
                break;
            }
        }
        self.run.view.state
    }

    fn advance(&mut self, until_ms: i64) -> SessionState {
        self.run.advance(at(until_ms), &self.gauge, || "module 2 is silent".to_owned());
        self.settle();
        self.run.view.state
    }

    /// How it is now.
    fn refreshed(&mut self) -> &SessionView {
        self.run.refreshed(ms(self.ms), &self.gauge);
        &self.run.view
    }

    /// What is shown after so much time.
    fn shown_after(&mut self, ms_later: i64) -> Option<SessionView> {
        self.ms += ms_later;
        let view = self.run.show(ms(self.ms), &self.gauge)?;
        Some(SessionView::clone(&view))
    }

    fn refused(&self, why: SampleRefusal) -> u64 {
        self.run.view.refused.get(why)
    }
}

fn patient_for(seconds: u64) -> SessionLimits {
    SessionLimits { patience: Duration::from_secs(seconds), ..SessionLimits::default() }
}

#[test]
fn rest_that_is_not_proven_is_waited_for_as_long_as_patience_goes() {
    let mut scene = Scene::started(Branch::Rising, 50.0, patient_for(3));
    let state = |scene: &Scene| {
        let zeros = scene.events.iter().filter(|event| matches!(event, SessionEvent::WantsZero)).count();
        (scene.run.view.state, zeros)
    };
    scene.ms = 3_000;
    scene.refuse_zero();
    assert_eq!(state(&scene), (SessionState::Taring, 2));
    assert_eq!(scene.run.view.reason, "waiting for an unloaded skin: it moves");
    scene.ms += 1;
    scene.refuse_zero();
    assert_eq!(state(&scene), (SessionState::Failed, 2));
}

#[test]
fn a_scan_enters_when_the_zero_has_stood_for_a_second_after_it() {
    let mut scene = Scene::ramping(Branch::Rising, 50.0);
    (1..=200).for_each(|i| scene.gauge.push(ms(10 * i), Kilopascal(0.02 * i as f64)));
    scene.run.on_scan(scan(ms(1_500), [200; TAXELS]));
    scene.advance(2_499);
    assert_eq!(scene.run.view.accepted, 0);
    scene.advance(2_500);
    assert_eq!(scene.run.view.accepted, 1);
    let Some(SessionEvent::Sample { index, sample }) = scene.events.pop() else { panic!("no sample") };
    assert_eq!((index, sample.ramp, sample.time_ns), (0, 0, 1_500_000_000));
    assert!((sample.pressure_kpa - 3.0).abs() < 1e-9, "{}", sample.pressure_kpa);
}

/// A board that took a new zero unnoticed is found within the second for which scans wait: those are not valid. At 5 ms and
/// 1 s of patience with the gauge there are 400; more than 512 would wait for ever.
#[test]
fn scans_that_wait_while_the_zero_comes_into_check_never_enter_and_no_more_than_512_wait() {
    let mut scene = Scene::ramping(Branch::Rising, 50.0);
    (1..=512).for_each(|i| scene.run.on_scan(scan(ms(i), [200; TAXELS])));
    assert_eq!(scene.refused(SampleRefusal::NoPressure), 0);
    scene.run.on_scan(scan(ms(513), [200; TAXELS]));
    assert_eq!(scene.refused(SampleRefusal::NoPressure), 1, "the oldest goes first");
    scene.run.drop_waiting();
    let shown = scene.shown_after(200).unwrap();
    assert_eq!((shown.refused.get(SampleRefusal::ZeroInCheck), shown.accepted), (512, 0));
}

#[test]
fn a_ramp_ends_when_the_session_is_full() {
    let mut scene = Scene::with(Branch::Rising, 50.0, SessionLimits { scans_max: 5, ..SessionLimits::default() });
    assert_eq!(scene.go(2.0, 10.0), SessionState::Fitting);
    assert_eq!((scene.run.view.accepted, scene.run.samples.samples.len()), (5, 5));
    assert_eq!(scene.refused(SampleRefusal::Full), 1);
}

#[test]
fn a_rise_ends_at_its_target_and_a_fall_where_the_bag_is_vented() {
    let mut scene = Scene::ramping(Branch::Both, 10.0);
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
fn a_fall_that_ended_early_says_so_until_the_session_is_left_and_a_ramp_that_went_well_says_nothing() {
    let mut scene = Scene::with(Branch::Both, 50.0, patient_for(3));
    scene.go(4.0, 5.0);
    scene.command(Trigger::FinishRamp);
    assert_eq!(scene.run.view.direction, Direction::Falling);
    assert_eq!(scene.go(0.0, 4.2), SessionState::Fitting);
    let reason = &scene.run.view.reason;
    assert!(reason.starts_with("the falling branch ended early: "), "{reason}");
    // What a session failed of is no reason of the fit that follows.
    let mut scene = Scene::with(Branch::Rising, 50.0, patient_for(3));
    assert_eq!(scene.go(0.0, 4.2), SessionState::Failed);
    scene.command(Trigger::FinishRamp);
    let view = &scene.run.view;
    assert_eq!((view.state, view.reason.as_str()), (SessionState::Fitting, ""));
}

#[test]
fn why_nothing_enters_is_told_from_what_is_missing() {
    let why = |scene: &Scene| scene.run.view.reason.clone();
    let mut deaf = Scene::ramping(Branch::Rising, 50.0);
    assert_eq!(deaf.advance(62_000), SessionState::Failed);
    assert_eq!(why(&deaf), "the last pressure came 62.0 s ago");
    let mut silent = Scene::ramping(Branch::Rising, 50.0);
    silent.gauge.push(ms(61_500), Kilopascal(0.0));
    (0..3).for_each(|_| silent.run.on_scan(None));
    assert_eq!(silent.advance(62_000), SessionState::Failed);
    assert_eq!(
        why(&silent),
        "3 scans in 60 s had silent modules: module 2 is silent; leave them out of the session or mend them"
    );
    let mut still = Scene::ramping(Branch::Rising, 50.0);
    still.gauge.push(ms(61_500), Kilopascal(0.0));
    assert_eq!(still.advance(62_000), SessionState::Failed);
    assert!(why(&still).starts_with("the pressure did not rise for 60 s"), "{}", why(&still));
}

/// Modules that were silent for a moment long ago are not what keeps samples out now.
#[test]
fn what_was_silent_before_the_last_sample_explains_nothing() {
    let mut scene = Scene::ramping(Branch::Rising, 50.0);
    scene.run.on_scan(None);
    assert!(scene.run.stale_since_progress > 0);
    scene.go(2.0, 3.0);
    assert!(scene.run.view.accepted > 0 && scene.run.stale_since_progress == 0);
    scene.run.on_scan(None);
    scene.run.view.state = SessionState::Taring;
    scene.run.on_zero_taken(at(scene.ms), Vec::new(), &scene.gauge);
    assert!(scene.run.stale_since_progress == 0, "nor what was silent in an earlier ramp");
}

#[test]
fn the_time_left_is_what_is_missing_to_the_end_of_the_branch_at_the_present_rate() {
    let mut scene = Scene::ramping(Branch::Both, 10.0);
    scene.go(2.0, 3.0);
    let view = scene.refreshed();
    assert_eq!(view.pressure_kpa.map(|p| (p * 1e6).round() / 1e6), Some(6.0));
    assert!((view.rate_kpa_per_s.unwrap() - 2.0).abs() < 0.05, "{view:?}");
    assert!((view.remaining_s.unwrap() - 2.0).abs() < 0.1, "4 kPa at 2 kPa/s: {view:?}");
    scene.go(2.0, 4.0);
    scene.go(-1.5, 2.0);
    let view = scene.refreshed().clone();
    assert_eq!(view.direction, Direction::Falling);
    let expected = (view.pressure_kpa.unwrap() - 1.0) / 1.5;
    assert!((view.remaining_s.unwrap() - expected).abs() < 0.1, "down to 1 kPa: {view:?}");
    scene.go(0.0, 2.0);
    assert_eq!(scene.refreshed().remaining_s, None, "a pressure that stands still never arrives");
}

#[test]
fn every_kilopascal_with_a_sample_is_covered_and_a_taxel_that_moved_by_six_counts_responds() {
    let sample = |pressure_kpa: f64, counts: [u16; TAXELS]| Sample {
        ramp: 0,
        time_ns: 0,
        pressure_kpa,
        counts: SharedCounts::from(counts.to_vec()),
    };
    let resumed = |target_kpa: f64, samples: Vec<Sample>| {
        let samples = SessionSamples { ramps: Vec::new(), samples };
        SessionRun::resume(at(0), &plan().into(), view(Branch::Rising, target_kpa), samples)
    };
    let mut samples = [-0.4, 0.3, 1.0, 1.9, 3.5, 12.0].map(|kpa| sample(kpa, [200; TAXELS]));
    samples[3].counts = SharedCounts::from(vec![195, 194, 206, 206]);
    let mut run = resumed(9.5, samples.into());
    assert_eq!((run.view.responding, &*run.view.not_responding), ((3, 4), [0_u16].as_slice()));
    assert_eq!((run.view.accepted, run.view.durable), (6, 6));
    run.refreshed(ms(0), &GaugeHistory::default());
    assert!((run.view.coverage - 0.3).abs() < 1e-9, "steps 0, 1 and 3 of ten: {}", run.view.coverage);
    // By less than the fit asks for is not enough.
    let run = resumed(70.0, vec![sample(1.0, [200; TAXELS]), sample(60.0, [181, 120, 100, 100])]);
    assert_eq!((run.view.responding, &*run.view.not_responding), ((3, 4), [0_u16].as_slice()));
}

#[test]
fn an_open_session_is_shown_five_times_a_second_and_one_that_is_over_when_something_changed() {
    let mut scene = Scene::ramping(Branch::Rising, 50.0);
    assert_eq!(scene.run.deadline(), Some(ms(scene.ms) + SHOW_EVERY));
    assert!(scene.shown_after(199).is_none());
    assert!(scene.shown_after(1).is_some() && scene.shown_after(199).is_none() && scene.shown_after(1).is_some());
    let now = ms(scene.ms);
    scene.command(Trigger::Abort);
    assert_eq!(scene.run.deadline(), None, "nothing of it changes any more ...");
    scene.run.on_durable(4, 7);
    assert_eq!(scene.run.deadline(), None);
    scene.run.on_durable(3, 7);
    assert_eq!(scene.run.deadline(), Some(now + SHOW_EVERY), "... but what of it is on disk");
    assert_eq!(scene.shown_after(200).map(|view| view.durable), Some(7));
    assert_eq!(scene.run.deadline(), None);
}

/// The bag is vented during the review, and the operator looks at the pressure; a gauge's noise is nothing to look at.
#[test]
fn in_review_the_pressure_is_shown_when_it_moved() {
    let view = SessionView { state: SessionState::Review, ..view(Branch::Rising, 50.0) };
    let mut scene = Scene::of(SessionRun::resume(Now::default(), &plan().into(), view, Default::default()));
    scene.ms = 1_000;
    let read = |scene: &mut Scene, kpa: f64| {
        scene.ms += 200;
        scene.gauge.push(ms(scene.ms), Kilopascal(kpa));
        scene.shown_after(0).map(|view| view.pressure_kpa)
    };
    assert_eq!(read(&mut scene, 40.0), Some(Some(40.0)), "a gauge that is heard again");
    assert_eq!(read(&mut scene, 40.4), None);
    assert_eq!(read(&mut scene, 39.5), None, "half a kilopascal is noise yet");
    assert_eq!(read(&mut scene, 40.6), Some(Some(40.6)), "against what was shown, not what was read last");
    assert_eq!(scene.shown_after(600).map(|view| view.pressure_kpa), Some(None), "a gauge that fell silent");
    assert!(scene.run.deadline().is_some(), "it is looked at for as long as it is in review");
}
