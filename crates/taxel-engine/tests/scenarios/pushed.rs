//! A skin whose scans are pushed by a program obeys the rules of skin boards: 48 taxels of twelve bits, every 20 ms.

use std::sync::Arc;
use std::time::Duration;

use taxel_engine::calibration::SessionState;
use taxel_engine::command::{Command, Rejection};
use taxel_engine::plan::{DevicePlan, Gauge, PatchPlan, Plan, PushPlan};
use taxel_engine::record::Record;
use taxel_engine::snapshot::ForceState;
use taxel_engine::{BusNotice, Input, PushedScan, Restored};
use taxel_skin::{
    Board, BoardAddress, BusIndex, CountRange, Kilopascal, Module, ModuleKind, Patch, SquareMillimetre, Time,
};
use taxel_wire::signal::{ByteOrder, PressureMeaning, PressureUnit, SignalSpec};
use taxel_wire::{CanId, Frame, TimedFrame};

use crate::host::Host;
use crate::rig::BUS;

const TAXELS: usize = 48;
const PERIOD: Duration = Duration::from_millis(20);
const REST: f64 = 230.0;
const AREA_MM2: f64 = 16.0;
const TOP: u16 = 4095;
/// The bus on which a gauge sends, where the pressure is not pushed.
const GAUGE_BUS: BusIndex = BusIndex(1);
const GAUGE: CanId = CanId::Standard(0x200);

fn plan(pressure: bool) -> Plan {
    let modules = (0..4).map(|module| (Module::from_nibble(module), ModuleKind::Cells(12))).collect();
    let board = Board { bus: BUS, address: BoardAddress::new(1).unwrap(), modules };
    let patch = Patch::new("glove", vec![board]).unwrap().with_counts(CountRange::to(TOP).unwrap());
    let signal = SignalSpec {
        id: GAUGE,
        start_bit: 0,
        length_bits: 32,
        byte_order: ByteOrder::Little,
        signed: true,
        scale: 0.001,
        offset: 0.0,
        unit: PressureUnit::Kilopascal,
        meaning: PressureMeaning::Differential,
    };
    let plan = PatchPlan {
        devices: vec![DevicePlan::without_frames()],
        pushed: Some(PushPlan { pressure }),
        period: PERIOD,
        areas: vec![SquareMillimetre(AREA_MM2); TAXELS],
        gauge: (!pressure).then_some(Gauge::new(GAUGE_BUS, signal)),
        ..PatchPlan::new(patch)
    };
    Plan { buses: 2, patches: vec![plan] }
}

/// The skin in front of an engine.
struct Scene {
    host: Host,
    pressure: bool,
    bits: u64,
    bag_kpa: f64,
    /// Pressure on the first taxels, beside the bag's.
    load: (usize, f64),
}

impl Scene {
    fn new(pressure: bool) -> Self {
        let host = Host::new(Arc::new(plan(pressure)), Restored::default(), Time::default());
        Self { host, pressure, bits: 0x9E37_79B9_7F4A_7C15, bag_kpa: 0.0, load: (0, 0.0) }
    }

    fn counts(&mut self) -> Vec<u16> {
        let count = |taxel: usize, chance: f64| {
            let kpa = self.bag_kpa + if taxel < self.load.0 { self.load.1 } else { 0.0 };
            (16.0 * (REST - (90.0 + taxel as f64) * kpa / (kpa + 60.0) + chance)) as u16
        };
        let chances: Vec<f64> = (0..TAXELS).map(|_| chance(&mut self.bits)).collect();
        chances.into_iter().enumerate().map(|(taxel, chance)| count(taxel, chance)).collect()
    }

    /// Hands over a scan that comes `after` the newest input.
    fn push(&mut self, after: Duration, counts: Vec<u16>) {
        self.push_late(after, Duration::ZERO, counts);
    }

    /// The same of a scan that is taken then, and may have waited for so long.
    fn push_late(&mut self, after: Duration, waited: Duration, counts: Vec<u16>) {
        let taken = self.host.now + after;
        let time = taken - waited;
        let pressure = self.pressure.then_some(Kilopascal(self.bag_kpa));
        if pressure.is_none() {
            let pascal = (self.bag_kpa * 1e3).round() as i32;
            let frame = TimedFrame { time, frame: Frame::of(GAUGE, pascal.to_le_bytes()) };
            self.host.input(time, Input::Frames(GAUGE_BUS, &[frame]));
        }
        self.host.input(taken, Input::Pushed(&PushedScan { patch: 0, time, taken, counts, pressure }));
    }

    fn scan(&mut self) {
        let counts = self.counts();
        self.push(PERIOD / 2, counts);
        self.host.tick(self.host.now + PERIOD / 2);
    }

    fn seconds(&mut self, seconds: f64) {
        (0..(seconds / PERIOD.as_secs_f64()).round() as u32).for_each(|_| self.scan());
    }

    /// Time without a scan.
    fn silence(&mut self, seconds: f64) {
        let until = self.host.now + Duration::from_secs_f64(seconds);
        while self.host.now < until {
            self.host.tick(self.host.now + PERIOD);
        }
    }

    fn ask(&mut self, command: Command) {
        let request = self.host.command(command);
        self.host.reply(request).expect("answered at once").expect("not refused");
    }

    fn begin(&mut self) {
        self.ask(Command::BeginPush { patch: String::new() });
    }

    /// A skin that was calibrated and weighs.
    fn in_use(pressure: bool) -> Self {
        let mut scene = Self::new(pressure);
        scene.begin();
        scene.seconds(1.0);
        let (patch, target, branches, confirmed_by) = (String::new(), None, None, None);
        scene.ask(Command::StartSession { patch, target, branches, confirmed_by, leave_out: vec![] });
        scene.seconds(2.0);
        assert_eq!(scene.host.session().state, SessionState::Ramping, "{}", scene.host.session().reason);
        while scene.host.session().state == SessionState::Ramping && scene.bag_kpa < 80.0 {
            scene.bag_kpa += 0.05;
            scene.scan();
        }
        scene.bag_kpa = 0.0;
        scene.seconds(1.0);
        assert_eq!(scene.host.session().state, SessionState::Review, "{}", scene.host.session().reason);
        let mut sets = scene.host.records.iter().filter_map(|record| match record {
            Record::ModelSet(set) => Some(set.id.clone()),
            _ => None,
        });
        let model_set = sets.next_back().expect("a model set");
        scene.ask(Command::Activate { patch: "glove".to_owned(), model_set, expected: None });
        scene.seconds(3.0);
        assert_eq!(scene.host.state(), ForceState::Ok, "{}", scene.host.reasons());
        scene
    }

    fn last_malformed(&mut self) -> String {
        self.host.tick(self.host.now + Duration::from_millis(1_100));
        self.host.health().buses[0].last_malformed.clone()
    }
}

#[test]
fn a_pushed_skin_is_calibrated_by_the_same_session_and_weighs() {
    for pressure in [true, false] {
        let mut scene = Scene::in_use(pressure);
        scene.load = (16, 25.0);
        scene.seconds(1.0);
        let force = &scene.host.snapshot().force;
        let (truth, total) = (16.0 * 25.0 * AREA_MM2 * 1e-3, force.total.unwrap().0);
        assert!((total / truth - 1.0).abs() < 0.03, "{total} N, not {truth}: {:?}", force.reasons);
        assert!((total - truth).abs() <= 2.0 * force.total_sigma.unwrap().0, "{force:?}");
        let bus = &scene.host.health().buses[0];
        assert!(bus.up && bus.frames > 100 && bus.malformed == 0, "{bus:?}");
    }
}

#[test]
fn a_pushed_skin_that_falls_silent_is_stale_and_then_has_no_zero() {
    let mut scene = Scene::in_use(true);
    scene.load = (16, 25.0);
    scene.seconds(1.0);
    scene.host.input(scene.host.now, Input::Bus(BUS, BusNotice::Down("unplugged".to_owned())));
    scene.silence(0.3);
    let force = &scene.host.snapshot().force;
    assert_eq!((force.state, force.total), (ForceState::Stale, None), "{:?}", force.reasons);
    assert!(!scene.host.health().buses[0].up);
    scene.silence(2.0);
    scene.seconds(3.0);
    assert_eq!(scene.host.state(), ForceState::TareInvalid, "{}", scene.host.reasons());
    assert!(scene.host.reasons().contains("silent"), "{}", scene.host.reasons());
}

#[test]
fn another_stream_of_scans_has_no_force_by_the_zero_of_the_one_before() {
    let mut scene = Scene::in_use(true);
    scene.load = (16, 25.0);
    scene.seconds(1.0);
    scene.begin();
    scene.seconds(5.0);
    assert_eq!(scene.host.state(), ForceState::TareInvalid, "{}", scene.host.reasons());
    assert!(scene.host.reasons().contains("another stream of scans"), "{}", scene.host.reasons());
}

/// The program that pushed was exchanged for another one, which takes a zero by software under what lies there.
#[test]
fn a_load_that_another_stream_has_taken_for_its_zero_keeps_a_zero_from_being_proven() {
    let mut scene = Scene::in_use(true);
    scene.load = (16, 25.0);
    scene.seconds(1.0);
    scene.begin();
    scene.load = (0, 0.0);
    scene.seconds(5.0);
    let request = scene.host.command(Command::Tare { patch: String::new(), confirmed_by: None });
    scene.seconds(3.0);
    let why = scene.host.reply(request).expect("answered").expect_err("what lay there may lie there still");
    assert!(why.to_string().contains("it has taken a new zero under it, or the load was lifted"), "{why}");
    assert_eq!(scene.host.snapshot().force.total, None);
}

#[test]
fn scans_that_are_pushed_too_fast_are_refused_as_those_of_a_board() {
    let mut scene = Scene::in_use(true);
    for _ in 0..50 {
        let counts = scene.counts();
        scene.push(Duration::from_millis(1), counts);
    }
    scene.host.tick(scene.host.now + PERIOD);
    assert_eq!(scene.host.snapshot().force.total, None, "{}", scene.host.reasons());
    scene.host.tick(scene.host.now + Duration::from_millis(1_100));
    let warnings = scene.host.health().boards[0].warnings.join("; ");
    assert!(warnings.contains("arrived too fast"), "{warnings}");
}

/// One scan waited while the daemon stood still, and the next ones come in time.
#[test]
fn a_scan_that_waited_is_as_old_as_it_may_be_and_comes_no_faster_than_it_was_taken() {
    let mut scene = Scene::in_use(true);
    let before = scene.host.snapshot().time;
    let (stood, waited) = (3 * PERIOD, 3 * PERIOD - Duration::from_millis(1));
    scene.host.input(scene.host.now + stood - PERIOD / 2, Input::Resumed(stood));
    let counts = scene.counts();
    scene.push_late(Duration::ZERO, waited, counts);
    let snapshot = scene.host.snapshot();
    assert_eq!(snapshot.time, before + Duration::from_millis(1), "its age is told from here");
    assert_eq!(snapshot.force.state, ForceState::Ok, "{:?}", snapshot.force.reasons);
    scene.host.tick(scene.host.now + PERIOD / 2);
    scene.seconds(2.0);
    assert_eq!(scene.host.state(), ForceState::Ok, "{}", scene.host.reasons());
    let warnings = scene.host.health().boards[0].warnings.join("; ");
    assert_eq!(warnings, "");
}

#[test]
fn a_pushed_scan_that_is_none_of_the_patch_is_counted_and_changes_nothing() {
    let mut scene = Scene::in_use(true);
    let before = scene.host.snapshot().taxels[0].count;
    let mut counts = scene.counts();
    counts[17] = TOP + 1;
    scene.push(PERIOD, counts);
    assert_eq!(scene.last_malformed(), "taxel 17 is 4096, expected 0 to 4095");
    scene.push(PERIOD, vec![7; TAXELS - 1]);
    assert_eq!(scene.last_malformed(), "47 counts, expected 48");
    scene.bag_kpa = f64::NAN;
    scene.push(PERIOD, vec![7; TAXELS]);
    assert_eq!(scene.last_malformed(), "a pressure of NaN kPa");
    assert_eq!(scene.host.health().buses[0].malformed, 3);
    assert_eq!(scene.host.snapshot().taxels[0].count, before);
}

#[test]
fn a_pushed_skin_of_another_range_than_at_the_calibration_has_no_force() {
    let calibrated = Scene::in_use(true);
    let mut sets = calibrated.host.records.iter().rev().filter_map(|record| match record {
        Record::ModelSet(set) => Some(Arc::clone(set)),
        _ => None,
    });
    let set = sets.next().expect("a model set");
    let mut plan = plan(true);
    let patch = plan.patches[0].patch.clone();
    plan.patches[0].patch = patch.with_counts(CountRange::to(TOP / 2).unwrap());
    let active = vec![("glove".to_owned(), set.id.clone())];
    let restored = Restored { model_sets: vec![set.into()], active, ..Restored::default() };
    let mut host = Host::new(Arc::new(plan), restored, Time::default());
    host.tick(host.now + Duration::from_millis(1_100));
    let said = "counts from 0 to 4095, 16 to a unit on device 1, where the configuration has counts from 0 to 2047, 8 to a unit";
    assert!(host.health().problems[0].contains(said), "{:?}", host.health().problems);
    assert_eq!(host.state(), ForceState::Uncalibrated);
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
    scene.push(PERIOD, vec![7; TAXELS]);
    assert_eq!(scene.last_malformed(), "its scans come over a bus");
}

/// What a session that begins now says before the pump runs.
fn look(scene: &mut Scene) -> String {
    let (patch, target, branches, confirmed_by) = (String::new(), None, None, None);
    scene.ask(Command::StartSession { patch, target, branches, confirmed_by, leave_out: vec![] });
    scene.host.session().look.join("; ")
}

#[test]
fn a_session_says_before_the_pump_runs_what_is_silent_too_slow_or_stands_still() {
    let mut scene = Scene::new(false);
    scene.begin();
    let said = look(&mut scene);
    assert!(said.contains("4 modules are silent: board 1 module 0 (never heard)"), "{said}");
    assert!(said.ends_with("no pressure has been heard: is the gauge on?"), "{said}");

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
        scene.bag_kpa = 0.002 * f64::from(n % 3);
        scene.scan();
    }
    assert_eq!(look(&mut scene), "");
    assert!(scene.host.session().look.is_empty());
}

/// From -1 to 1, more often near 0.
fn chance(bits: &mut u64) -> f64 {
    let mut one = || {
        *bits ^= *bits << 13;
        *bits ^= *bits >> 7;
        *bits ^= *bits << 17;
        (*bits >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..4).map(|_| one()).sum::<f64>() - 2.0
}
