//! A skin whose scans are pushed by a program obeys the rules of skin boards: 48 taxels of twelve bits.

use taxel_engine::PushedScan;
use taxel_engine::plan::{DevicePlan, PushPlan};
use taxel_skin::{BusIndex, Kilopascal};

use crate::array::{PERIOD, Scene as _, Skin, gauge, patch_of};
use crate::prelude::*;

const TOP: u16 = 4095;
/// The bus on which a gauge sends, where the pressure is not pushed.
const GAUGE_BUS: BusIndex = BusIndex(1);
const GAUGE: CanId = CanId::Standard(0x200);

fn plan(pressure: bool) -> Plan {
    let patch = PatchPlan {
        devices: vec![DevicePlan::without_frames()],
        pushed: Some(PushPlan { pressure }),
        gauge: (!pressure).then_some(gauge(GAUGE_BUS, GAUGE)),
        ..patch_of("glove", 4, TOP)
    };
    Plan { buses: 2, patches: vec![patch] }
}

/// The skin in front of an engine.
struct Scene {
    host: Host,
    skin: Skin,
    pressure: bool,
}

impl Scene {
    fn new(pressure: bool) -> Self {
        let host = Host::new(Arc::new(plan(pressure)), Restored::default(), Time::default());
        Self { host, skin: Skin::new(), pressure }
    }

    /// Hands over a scan that comes `after` the newest input.
    fn push(&mut self, after: Duration, counts: Vec<u16>) {
        self.push_late(after, Duration::ZERO, counts);
    }

    /// The same of a scan that is taken then, and may have waited for so long.
    fn push_late(&mut self, after: Duration, waited: Duration, counts: Vec<u16>) {
        let taken = self.host.now + after;
        let time = taken - waited;
        let pressure = self.pressure.then_some(Kilopascal(self.skin.bag_kpa));
        if pressure.is_none() {
            let frame = TimedFrame { time, frame: Frame::of(GAUGE, self.skin.pascal()) };
            self.host.input(time, Input::Frames(GAUGE_BUS, &[frame]));
        }
        self.host.input(taken, Input::Pushed(&PushedScan { patch: 0, time, taken, counts, pressure }));
    }

    fn begin(&mut self) {
        self.ask(Command::BeginPush { patch: String::new() });
    }

    /// A skin that was calibrated and weighs.
    fn in_use(pressure: bool) -> Self {
        let mut scene = Self::new(pressure);
        scene.begin();
        scene.calibrated()
    }

    /// The same under a load.
    fn loaded() -> Self {
        let mut scene = Self::in_use(true);
        scene.skin.load = (16, 25.0);
        scene.seconds(1.0);
        scene
    }

    fn warnings(&self) -> String {
        self.host.health().boards[0].warnings.join("; ")
    }
}

impl crate::array::Scene for Scene {
    const PATCH: &str = "glove";

    fn host(&mut self) -> &mut Host {
        &mut self.host
    }

    fn skin(&mut self) -> &mut Skin {
        &mut self.skin
    }

    fn scan(&mut self) {
        let counts = self.skin.counts(16.0);
        self.push(PERIOD / 2, counts);
        self.host.tick(self.host.now + PERIOD / 2);
    }
}

#[test]
fn a_pushed_skin_is_calibrated_by_the_same_session_and_weighs() {
    for pressure in [true, false] {
        let mut scene = Scene::in_use(pressure);
        scene.weighs();
        let bus = &scene.host.health().buses[0];
        assert!(bus.up && bus.frames > 100 && bus.malformed == 0, "{bus:?}");
    }
}

#[test]
fn another_stream_of_scans_has_no_force_by_the_zero_of_the_one_before() {
    let mut scene = Scene::loaded();
    scene.begin();
    scene.seconds(5.0);
    scene.is(ForceState::TareInvalid);
    assert!(scene.host.reasons().contains("another stream of scans"), "{}", scene.host.reasons());
}

/// The program that pushed was exchanged for another one, which takes a zero by software under what lies there.
#[test]
fn a_load_that_another_stream_has_taken_for_its_zero_keeps_a_zero_from_being_proven() {
    let mut scene = Scene::loaded();
    scene.begin();
    scene.skin.load = (0, 0.0);
    scene.seconds(5.0);
    let why = scene.refused_tare();
    assert!(why.contains("it has taken a new zero under it, or the load was lifted"), "{why}");
    assert_eq!(scene.host.snapshot().force.total, None);
}

/// One scan waited while the daemon stood still, and the next ones come in time.
#[test]
fn a_scan_that_waited_is_as_old_as_it_may_be_and_comes_no_faster_than_it_was_taken() {
    let mut scene = Scene::in_use(true);
    let before = scene.host.snapshot().time;
    let (stood, waited) = (3 * PERIOD, 3 * PERIOD - Duration::from_millis(1));
    scene.host.input(scene.host.now + stood - PERIOD / 2, Input::Resumed(stood));
    let counts = scene.skin.counts(16.0);
    scene.push_late(Duration::ZERO, waited, counts);
    let snapshot = scene.host.snapshot();
    assert_eq!(snapshot.time, before + Duration::from_millis(1), "its age is told from here");
    assert_eq!(snapshot.force.state, ForceState::Ok, "{:?}", snapshot.force.reasons);
    scene.host.tick(scene.host.now + PERIOD / 2);
    scene.seconds(2.0);
    scene.is(ForceState::Ok);
    assert_eq!(scene.warnings(), "");
}

/// What a session that begins now says before the pump runs.
fn look(scene: &mut Scene) -> String {
    scene.ask(say::start());
    scene.host.session().look.join("; ")
}

#[test]
fn a_session_says_before_the_pump_runs_what_is_silent_too_slow_or_stands_still() {
    let mut scene = Scene::new(false);
    scene.begin();
    let said = look(&mut scene);
    assert!(said.contains("4 modules are silent: board 1 module 0 (never heard)"), "{said}");
    assert!(said.contains("no pressure has been heard: is the gauge on"), "{said}");

    let mut scene = Scene::new(false);
    for _ in 0..100 {
        scene.scan();
        scene.host.tick(scene.host.now + PERIOD); // every second scan is missing
    }
    let said = look(&mut scene);
    assert!(said.contains("board 1: sends every 40 ms, the configuration says 20 ms"), "{said}");
    assert!(said.contains("the gauge has read exactly 0.000 kPa for 4.0 s"), "{said}");

    let mut scene = Scene::new(false);
    for n in 0..100 {
        scene.skin.bag_kpa = 0.002 * f64::from(n % 3);
        scene.scan();
    }
    assert_eq!(look(&mut scene), "");
    assert!(scene.host.session().look.is_empty());
}

#[test]
fn nobody_pushes_the_scans_of_boards() {
    let mut scene = Scene::new(true);
    let mut plan = plan(true);
    plan.patches[0].pushed = None;
    scene.host = Host::new(Arc::new(plan), Restored::default(), Time::default());
    let request = scene.host.command(Command::BeginPush { patch: String::new() });
    let reply = scene.host.reply(request).expect("answered at once");
    assert!(matches!(reply, Err(Rejection::FailedPrecondition(..))), "{reply:?}");
}
