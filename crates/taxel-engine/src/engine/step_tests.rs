//! When the health is shown, when the engine wants to be woken, and whom a frame reaches.

use std::sync::Arc;

use taxel_sim::GaugeConfig;
use taxel_skin::{BusIndex, ModuleKind, Patch, Time};
use taxel_wire::array::{CountField, FrameSpec};
use taxel_wire::bits::{BitField, ByteOrder, FrameMatch, Selector};
use taxel_wire::signal::{PressureMeaning, PressureUnit, SignalSpec};
use taxel_wire::{CanId, Frame, TimedFrame, reading};

use super::step::Engine;
use crate::boundary::catalogue::Restored;
use crate::boundary::command::{Command, Done};
use crate::boundary::input::Input;
use crate::boundary::output::Output;
use crate::boundary::snapshot::Health;
use crate::force;
use crate::intake::health::BusNotice;
use crate::now::Now;
use crate::patch::edge_tests::configuring;
use crate::plan::{DevicePlan, Gauge, PatchPlan, Plan};
use crate::request::RequestId;
use crate::tests::{board, patch};

const BUS: BusIndex = BusIndex(0);

fn ms(ms: i64) -> Time {
    Time::from_nanos(ms * 1_000_000)
}

fn now(at_ms: i64) -> Now {
    Now { time: ms(at_ms), wall_ns: 0 }
}

/// An engine without a patch, so that nothing but its health has a deadline.
struct Bare(Engine);

impl Bare {
    /// Started at 1.25 s, which shows its first health.
    fn new() -> Self {
        let mut bare = Self(Engine::new(Arc::new(Plan { buses: 2, patches: Vec::new() }), Restored::default()));
        assert_eq!(bare.wakes(), None, "nothing happens before the first step");
        let first = bare.health_at(1_250).unwrap();
        assert_eq!((first.buses.len(), first.problems.len()), (2, 0));
        assert_eq!(bare.wakes(), None, "and then there is nothing to be woken for");
        bare
    }

    fn step(&mut self, at_ms: i64, input: Input<'_>) -> Vec<Output> {
        let mut out = Vec::new();
        self.0.step(now(at_ms), input, &mut out);
        out
    }

    /// The health that a tick shows.
    fn health_at(&mut self, at_ms: i64) -> Option<Arc<Health>> {
        self.step(at_ms, Input::Tick).into_iter().find_map(|output| match output {
            Output::Health(health) => Some(health),
            _ => None,
        })
    }

    fn wakes(&self) -> Option<i64> {
        self.0.next_deadline().map(|at| at.as_nanos() / 1_000_000)
    }

    fn frames(&mut self, at_ms: i64, bus: BusIndex, frames: usize) {
        let frame = Frame::data(CanId::Standard(0x101), &[1]).unwrap();
        let frames = vec![TimedFrame { time: ms(at_ms), frame }; frames];
        self.step(at_ms, Input::Frames(bus, &frames));
    }
}

#[test]
fn what_changed_is_shown_within_a_quarter_of_a_second_and_counters_within_a_second() {
    let mut bare = Bare::new();
    bare.frames(1_300, BUS, 2);
    assert_eq!(bare.wakes(), Some(1_500), "the bus is up: that is news");
    assert!(bare.health_at(1_499).is_none());
    let health = bare.health_at(1_500).unwrap();
    assert_eq!((health.buses[0].up, health.buses[0].foreign, health.buses[1].up), (true, 2, false));
    bare.frames(1_600, BUS, 3);
    assert_eq!(bare.wakes(), Some(2_500));
    assert!(bare.health_at(2_499).is_none());
    assert_eq!(bare.health_at(2_500).unwrap().buses[0].foreign, 5);
    bare.frames(2_600, BUS, 0);
    assert_eq!(bare.wakes(), None, "no frame is no news");
    bare.frames(2_700, BusIndex(2), 1);
    assert!(bare.health_at(3_700).is_none(), "frames of a bus that is not there");
}

#[test]
fn what_is_to_be_shown_is_not_forgotten_because_of_what_comes_after_it() {
    let mut bare = Bare::new();
    bare.frames(1_300, BUS, 1);
    bare.frames(1_310, BUS, 1);
    bare.frames(1_320, BUS, 0);
    assert!(bare.health_at(1_330).is_none());
    assert_eq!(bare.health_at(1_500).unwrap().buses[0].foreign, 2);
}

/// A socket gives its error first, and then the frames that it held.
#[test]
fn a_bus_that_is_down_is_not_up_by_frames_of_before() {
    let mut bare = Bare::new();
    bare.frames(1_300, BUS, 1);
    bare.step(1_510, Input::Bus(BUS, BusNotice::Down("unplugged".to_owned())));
    let frame = TimedFrame { time: ms(1_509), frame: Frame::data(CanId::Standard(0x101), &[1]).unwrap() };
    bare.step(1_515, Input::Frames(BUS, &[frame]));
    let health = bare.health_at(1_760).unwrap();
    assert_eq!((health.buses[0].up, health.buses[0].problem.as_str()), (false, "unplugged"));
    bare.frames(1_770, BUS, 1);
    assert!(bare.health_at(2_010).unwrap().buses[0].up);
}

#[test]
fn what_a_bus_and_the_store_tell_is_shown_and_what_changes_nothing_is_not() {
    let mut bare = Bare::new();
    bare.step(1_300, Input::Bus(BusIndex(1), BusNotice::Down("unplugged".to_owned())));
    assert_eq!(bare.wakes(), Some(1_500));
    assert_eq!(bare.health_at(1_500).unwrap().buses[1].problem, "unplugged");
    bare.step(1_600, Input::Bus(BusIndex(1), BusNotice::Down("unplugged".to_owned())));
    assert!(bare.health_at(1_750).is_none(), "that is known");
    bare.step(1_800, Input::Bus(BusIndex(2), BusNotice::Up));
    assert_eq!(bare.wakes(), None, "a bus that is not there");
    bare.step(1_900, Input::StoreFailed("the disk is full".to_owned()));
    assert_eq!(bare.wakes(), Some(2_000));
    let health = bare.health_at(2_000).unwrap();
    let problem = "the store failed and takes nothing until a restart: the disk is full";
    assert_eq!(
        (health.problems.as_slice(), health.store.problem.as_deref()),
        ([problem.to_owned()].as_slice(), Some(problem))
    );
}

#[test]
fn a_program_may_push_the_gauge_of_a_skin_that_is_on_a_bus() {
    let signal = reading::signal(0, PressureUnit::Kilopascal, PressureMeaning::Differential);
    let gauge = Gauge { pushed: true, ..Gauge::new(BusIndex(1), signal) };
    let plan = PatchPlan { gauge: Some(gauge), ..PatchPlan::new(patch(&[ModuleKind::Triangle])) };
    let mut engine = Engine::new(Arc::new(Plan { buses: 2, patches: vec![plan] }), Restored::default());
    let mut out = Vec::new();
    engine.step(now(1_000), Input::Bus(BusIndex(1), BusNotice::Down("nobody".to_owned())), &mut out);
    let begin = Command::BeginPush { patch: "p".to_owned() };
    engine.step(now(1_000), Input::Command(RequestId(1), begin), &mut out);
    assert!(out.iter().any(|output| matches!(output, Output::Reply(RequestId(1), Ok(Done::PushBegun)))), "{out:?}");
    assert!(engine.buses[1].health.up);
    let frame = TimedFrame { time: ms(1_010), frame: reading::frame(0, 12.5) };
    engine.step(now(1_010), Input::Frames(BusIndex(1), &[frame]), &mut out);
    let read = out.iter().any(|output| matches!(output, Output::Gauge(0, reading) if reading.kpa == 12.5));
    assert!(read, "{out:?}");
}

#[test]
fn lines_that_are_no_reading_are_counted_on_a_bus_that_is_up() {
    let mut bare = Bare::new();
    bare.step(1_300, Input::Bus(BUS, BusNotice::Up));
    bare.step(1_310, Input::Bus(BUS, BusNotice::Unread(2, "line \"ERR\"".to_owned())));
    let health = bare.health_at(1_560).unwrap();
    let bus = &health.buses[0];
    assert_eq!((bus.up, bus.malformed, bus.last_malformed.as_str()), (true, 2, "line \"ERR\""));
}

/// An array of four taxels on each of two buses, with a gauge: page 1 of what its device sends under one identifier. The gauge
/// of the first bus has that identifier, too, for another page.
fn arrays(id: CanId) -> Engine {
    let byte = |n: u16| BitField::new(8 * n, 8, ByteOrder::Little, false).unwrap();
    let field = |n: u16| (n, CountField { field: byte(1 + n), low: 0, shift: 0, top: 255 });
    let selectors = vec![Selector { field: byte(0), values: vec![(1, 1)] }];
    let page = FrameSpec { frames: FrameMatch { id, selectors }, counts: (0..4).map(field).collect() };
    let device = DevicePlan { frames: vec![page], ..DevicePlan::without_frames() };
    let patch = |bus: u8| {
        let board = board(bus, 1, &[ModuleKind::Cells(4)]);
        let gauge = if bus == 0 { id } else { CanId::Standard(0x123) };
        let signal = SignalSpec { id: gauge, ..GaugeConfig::default().signal };
        let gauge = Some(Gauge::new(BusIndex(bus), signal));
        let patch = Patch::new(format!("array {bus}"), vec![board]).unwrap();
        PatchPlan { devices: vec![device.clone()], gauge, ..PatchPlan::new(patch) }
    };
    Engine::new(Arc::new(Plan { buses: 2, patches: vec![patch(0), patch(1)] }), Restored::default())
}

#[test]
fn frames_of_a_device_are_counted_by_what_became_of_them_and_are_those_of_its_own_bus() {
    let id = CanId::Standard(0x200);
    let mut engine = arrays(id);
    let mut give = |at_ms: i64, bytes: &[u8]| {
        let frame = TimedFrame { time: ms(at_ms), frame: Frame::data(id, bytes).unwrap() };
        engine.step(now(at_ms), Input::Frames(BusIndex(1), &[frame]), &mut Vec::new());
        let bus = &engine.buses[1].health;
        let scans = [0, 1].map(|patch: usize| engine.patches[patch].board_health(Time::default())[0].scans);
        (bus.frames, bus.foreign, bus.malformed, scans)
    };
    assert_eq!(give(1_000, &[1, 200, 200, 200, 200]), (1, 0, 0, [0, 1]));
    assert_eq!(give(1_020, &[2, 9, 9, 9, 9]), (1, 1, 0, [0, 1]), "another page, and the gauge is not on this bus");
    assert_eq!(give(1_040, &[1, 200]), (1, 1, 1, [0, 1]), "too short");
}

#[test]
fn silence_is_shown_although_no_frame_comes() {
    let id = CanId::Standard(0x200);
    let mut engine = arrays(id);
    for at_ms in [1_000, 1_240] {
        let frame = TimedFrame { time: ms(at_ms), frame: Frame::data(id, &[1, 200, 200, 200, 200]).unwrap() };
        engine.step(now(at_ms), Input::Frames(BusIndex(1), &[frame]), &mut Vec::new());
    }
    let mut fresh_at = |at_ms: i64| {
        let mut out = Vec::new();
        engine.step(now(at_ms), Input::Tick, &mut out);
        out.into_iter().find_map(|output| match output {
            Output::Health(health) => Some(health.boards[1].modules.1),
            _ => None,
        })
    };
    assert_eq!(fresh_at(1_250), Some(1));
    assert_eq!(fresh_at(3_000), Some(0));
}

#[test]
fn a_set_that_was_in_use_is_used_again_if_it_is_there_and_of_the_layout() {
    let problems = |taxels: Option<usize>| {
        let restored = Restored {
            model_sets: taxels.map(|taxels| force::tests::set(taxels).into()).into_iter().collect(),
            active: vec![("p".to_owned(), "m-test".to_owned())],
            ..Restored::default()
        };
        let plan = PatchPlan { bring_up: Vec::new(), ..configuring() };
        let mut engine = Engine::new(Arc::new(Plan { buses: 1, patches: vec![plan] }), restored);
        let mut out = Vec::new();
        for at_ms in [1_000, 1_250] {
            engine.step(now(at_ms), Input::Tick, &mut out);
        }
        let health = out.iter().rev().find_map(|output| match output {
            Output::Health(health) => Some(health.problems.join("; ")),
            _ => None,
        });
        (engine.patches[0].models().is_some(), health.unwrap())
    };
    assert_eq!(problems(Some(10)), (true, String::new()));
    let why = "model set `m-test` is of another layout of patch `p`: it is not used; calibrate again";
    assert_eq!(problems(Some(20)), (false, why.to_owned()));
    assert_eq!(problems(None), (false, "the active model set `m-test` of patch `p` is lost".to_owned()));
}

/// Two patches with a module each of one board, of which one was configured otherwise before the start.
#[test]
fn a_board_is_configured_for_all_its_patches_or_for_none() {
    let plan = Plan { buses: 1, patches: vec![configuring(), configuring()] };
    let mut engine = Engine::new(Arc::new(plan), Restored::default());
    let mut out = Vec::new();
    engine.step(now(1_000), Input::Tick, &mut out);
    engine.step(now(1_250), Input::Tick, &mut out);
    assert_eq!(engine.next_deadline(), Some(ms(1_300)));
    engine.step(now(1_299), Input::Tick, &mut out);
    assert!(!out.iter().any(|output| matches!(output, Output::Send(..))));
    engine.step(now(1_300), Input::Tick, &mut out);
    let sent = out.iter().filter(|output| matches!(output, Output::Send(..))).count();
    assert_eq!(sent, 4, "two commands at once for each patch");
}
