//! What follows from each thing that happens to a session, and how often it is shown.

use std::time::Duration;
use taxel_skin::{Board, BoardAddress, BusIndex, Kilopascal, Module, ModuleKind, Patch, Time};

use super::{SessionEvent, SessionRun};
use crate::baseline::TaxelBaseline;
use crate::calibration::branch::{Branch, Direction};
use crate::calibration::limits::SessionLimits;
use crate::calibration::samples::Pending;
use crate::calibration::transition::Trigger;
use crate::calibration::view::{SampleRefusal, SessionState, SessionView};
use crate::intake::gauge::GaugeHistory;
use crate::now::Now;
use crate::plan::PatchPlan;

const TAXELS: usize = 4;
const SHOW_EVERY: Duration = Duration::from_millis(200);

fn ms(ms: i64) -> Time {
    Time::from_nanos(ms * 1_000_000)
}

/// A patch of two modules of two taxels.
pub fn plan() -> PatchPlan {
    let modules = [0, 1].map(|module| (Module::new(module).unwrap(), ModuleKind::Cells(2))).to_vec();
    let board = Board { bus: BusIndex(0), address: BoardAddress::new(1).unwrap(), modules };
    let session = SessionLimits { patience: Duration::from_secs(3), ..SessionLimits::default() };
    PatchPlan { session, ..PatchPlan::new(Patch::new("p", vec![board]).unwrap()) }
}

/// A session, its gauge, and what followed last.
struct Scene {
    run: SessionRun,
    gauge: GaugeHistory,
    events: Vec<SessionEvent>,
    ms: i64,
}

impl Scene {
    fn of(run: SessionRun) -> Self {
        Self { run, gauge: GaugeHistory::at_rest_until(ms(1_000)), events: Vec::new(), ms: 1_000 }
    }

    /// A session that watches for its zero.
    fn started(branches: Branch) -> Self {
        let view = SessionView { number: 3, target_kpa: 50.0, branches, left_out: vec![1], ..SessionView::default() };
        let mut scene = Self::of(SessionRun::start(Now { time: ms(1_000), wall_ns: 1_000 }, &plan().into(), view));
        scene.settle();
        scene
    }

    fn ramping(branches: Branch) -> Self {
        let mut scene = Self::started(branches);
        scene.take_zero();
        scene
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
        self.run.command(self.now(), command, "").unwrap();
        self.settle();
    }

    fn refuse_zero(&mut self) {
        self.run.on_zero_refused(self.now(), "it moves");
        self.settle();
    }

    fn now(&self) -> Now {
        Now { time: ms(self.ms), wall_ns: self.ms }
    }

    fn take_zero(&mut self) {
        let baseline = vec![TaxelBaseline { mean: 200.0, noise: 0.5 }; TAXELS];
        self.run.on_zero_taken(self.now(), baseline, &self.gauge);
        self.settle();
    }

    fn scan(&mut self) {
        self.run.on_scan(Some(Pending { time: ms(self.ms), counts: vec![200; TAXELS].into() }));
    }

    /// The pressure goes on for so many seconds.
    fn go(&mut self, from_kpa: f64, kpa_per_s: f64, seconds: f64) {
        for i in 0..(100.0 * seconds) as i64 {
            self.ms += 10;
            self.gauge.push(ms(self.ms), Kilopascal(from_kpa + 0.01 * kpa_per_s * i as f64));
            if i % 5 == 0 {
                self.scan();
            }
            self.run.advance(self.now(), &self.gauge, String::new);
            self.settle();
        }
    }

    /// What is shown after so much time.
    fn shown_after(&mut self, ms_later: i64) -> Option<SessionView> {
        self.ms += ms_later;
        let view = self.run.show(ms(self.ms), &self.gauge)?;
        Some(SessionView::clone(&view))
    }

    fn state(&self) -> SessionState {
        self.run.view.state
    }

    fn count(&self, which: impl Fn(&SessionEvent) -> bool) -> usize {
        self.events.iter().filter(|event| which(event)).count()
    }
}

fn wants_zero(event: &SessionEvent) -> bool {
    matches!(event, SessionEvent::WantsZero)
}

#[test]
fn rest_that_is_not_proven_is_waited_for_as_long_as_patience_goes() {
    let mut scene = Scene::started(Branch::Rising);
    scene.ms += 3_000;
    scene.refuse_zero();
    assert_eq!((scene.state(), scene.count(wants_zero)), (SessionState::Taring, 2));
    assert_eq!(scene.run.view.reason, "waiting for an unloaded skin: it moves");
    scene.ms += 1;
    scene.refuse_zero();
    assert_eq!((scene.state(), scene.count(wants_zero)), (SessionState::Failed, 2));
}

/// A board that took a new zero unseen is found within the second for which scans wait: those are not to be believed.
#[test]
fn scans_that_wait_while_the_zero_comes_into_doubt_never_enter() {
    let mut scene = Scene::ramping(Branch::Rising);
    scene.go(0.0, 2.0, 0.9);
    scene.run.drop_waiting();
    assert_eq!(scene.run.view.refused.get(SampleRefusal::ZeroInDoubt), 18);
    let shown = scene.shown_after(200).unwrap();
    assert_eq!((shown.refused.get(SampleRefusal::ZeroInDoubt), shown.accepted), (18, 0));
}

#[test]
fn a_fall_that_ended_early_says_so_until_the_session_is_left_and_a_ramp_that_went_well_says_nothing() {
    let mut scene = Scene::ramping(Branch::Both);
    scene.go(0.0, 4.0, 5.0);
    scene.command(Trigger::FinishRamp);
    assert_eq!(scene.run.view.direction, Direction::Falling);
    scene.go(20.0, 0.0, 4.2);
    let view = &scene.run.view;
    assert_eq!(view.state, SessionState::Fitting);
    assert!(view.reason.starts_with("the falling branch ended early: "), "{}", view.reason);
    // What a session failed of is no reason of the fit that follows.
    let mut scene = Scene::ramping(Branch::Rising);
    scene.go(0.0, 0.0, 4.2);
    assert_eq!(scene.state(), SessionState::Failed);
    scene.command(Trigger::FinishRamp);
    let view = &scene.run.view;
    assert_eq!((view.state, view.reason.as_str()), (SessionState::Fitting, ""));
}

#[test]
fn an_open_session_is_shown_five_times_a_second_and_one_that_is_over_when_something_changed() {
    let mut scene = Scene::ramping(Branch::Rising);
    assert_eq!(scene.run.deadline(), Some(scene.now().time + SHOW_EVERY));
    assert!(scene.shown_after(199).is_none());
    assert!(scene.shown_after(1).is_some() && scene.shown_after(199).is_none() && scene.shown_after(1).is_some());
    let now = scene.now();
    scene.command(Trigger::Abort);
    assert_eq!(scene.run.deadline(), None, "nothing of it changes any more ...");
    scene.run.on_durable(4, 7);
    assert_eq!(scene.run.deadline(), None);
    scene.run.on_durable(3, 7);
    assert_eq!(scene.run.deadline(), Some(now.time + SHOW_EVERY), "... but what of it is on disk");
    assert_eq!(scene.shown_after(200).map(|view| view.durable), Some(7));
    assert_eq!(scene.run.deadline(), None);
}

/// The bag is vented during the review, and the operator looks at the pressure; a gauge's noise is nothing to look at.
#[test]
fn in_review_the_pressure_is_shown_when_it_moved() {
    let view = SessionView { number: 3, state: SessionState::Review, target_kpa: 50.0, ..SessionView::default() };
    let mut scene = Scene::of(SessionRun::resume(Now::default(), &plan().into(), view, Default::default()));
    let read = |scene: &mut Scene, kpa: f64| {
        scene.ms += 200;
        scene.gauge.push(ms(scene.ms), Kilopascal(kpa));
        scene.shown_after(0).map(|view| view.pressure_kpa)
    };
    assert_eq!(read(&mut scene, 40.0), Some(Some(40.0)), "a gauge that is heard again");
    assert_eq!(read(&mut scene, 40.4), None);
    assert_eq!(read(&mut scene, 39.5), None, "half a kilopascal is noise yet");
    assert_eq!(read(&mut scene, 40.6), Some(Some(40.6)), "against what was shown, not what was read last");
    assert_eq!(read(&mut scene, 40.0), Some(Some(40.0)));
    assert_eq!(scene.shown_after(600).map(|view| view.pressure_kpa), Some(None), "a gauge that fell silent");
    assert_eq!(scene.shown_after(600).map(|view| view.pressure_kpa), None);
    assert!(scene.run.deadline().is_some(), "it is looked at for as long as it is in review");
    scene.ms += 200;
    scene.run.on_durable(3, 9);
    assert_eq!(read(&mut scene, 0.3).map(|kpa| kpa.is_some()), Some(true));
}
