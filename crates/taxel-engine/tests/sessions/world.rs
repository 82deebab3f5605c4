//! A skin of two modules in a bag, and its gauge, as the frames that they send. Counts are a plain function of the
//! pressure.

use std::sync::Arc;
use std::time::Duration;

use taxel_engine::plan::{BoardSetup, Gauge, PatchPlan, Plan};
use taxel_sim::GaugeConfig;
use taxel_skin::{Board, BoardAddress, BusIndex, Kilopascal, Module, ModuleKind, Patch, Time};
use taxel_wire::TimedFrame;
use taxel_wire::icub::{BoardConfig, Message, StatusWord, TriangleConfig};
use taxel_wire::signal::SignalSpec;

use crate::model::step::{PASS_S, PATIENCE_S, Passing, RISE_KPA, TARGET_KPA};

pub const PATCH: &str = "palm";
pub const BUS: BusIndex = BusIndex(0);
/// The boards' period; everything happens in slots of this length.
const PERIOD: Duration = Duration::from_millis(100);
/// A vent takes so long.
const VENT_S: f64 = 1.0;

fn board() -> BoardAddress {
    BoardAddress::new(13).unwrap()
}

fn signal() -> SignalSpec {
    GaugeConfig::default().signal
}

/// The scene: one patch that is brought up, with sessions that lose their patience within three passes.
pub fn plan() -> Arc<Plan> {
    let modules: Vec<Module> = (0..2).map(|m| Module::new(m).unwrap()).collect();
    let on_board = modules.iter().map(|module| (*module, ModuleKind::Triangle)).collect();
    let patch = Patch::new(PATCH, vec![Board { bus: BUS, address: board(), modules: on_board }]).unwrap();
    let triangles = TriangleConfig { first: modules[0], last: modules[1], shift: 2, enabled: true, cdc_offset: 0x2200 };
    let mut plan = PatchPlan {
        bring_up: vec![BoardSetup {
            board: BoardConfig { kind: 0, period_ms: 100, no_load: 240 },
            triangles: vec![triangles],
        }],
        period: PERIOD,
        gauge: Some(Gauge::new(BUS, signal())),
        ..PatchPlan::new(patch)
    };
    plan.live.stale_after = Duration::from_millis(350);
    plan.session.target = Kilopascal(f64::from(TARGET_KPA));
    plan.session.patience = Duration::from_secs_f64(PATIENCE_S);
    Arc::new(Plan { buses: 1, patches: vec![plan] })
}

/// What happens in one slot.
pub struct Slot {
    pub frames: Vec<TimedFrame>,
    pub end: Time,
}

#[derive(Clone, Debug, Default)]
pub struct World {
    pub now: Time,
    kpa: f64,
    scans: u64,
}

impl World {
    /// The frames of [`PASS_S`] seconds.
    pub fn pass(&mut self, how: Passing) -> Vec<Slot> {
        let (begin, before) = (self.now, self.kpa);
        let pressure = |time: Time| {
            let s = time.seconds_since(begin);
            match how {
                Passing::Rise => before + s / f64::from(PASS_S) * f64::from(RISE_KPA),
                Passing::Vent => before * (1.0 - s / VENT_S).max(0.0),
                Passing::Hold | Passing::GaugeSilent | Passing::ModuleSilent => before,
            }
        };
        let slots = f64::from(PASS_S) / PERIOD.as_secs_f64();
        let slots = (0..slots.round() as u32).map(|_| self.slot(how, pressure)).collect();
        self.kpa = pressure(self.now);
        slots
    }

    fn slot(&mut self, how: Passing, pressure: impl Fn(Time) -> f64) -> Slot {
        let mut frames = Vec::new();
        if how != Passing::GaugeSilent {
            let time = self.now + Duration::from_millis(10);
            frames.push(TimedFrame { time, frame: signal().encode(Kilopascal(pressure(time))).unwrap() });
        }
        self.scans += 1;
        let modules = if how == Passing::ModuleSilent { 1 } else { 2 };
        for module in 0..modules {
            let time = self.now + Duration::from_millis(50 + module);
            // No load reaches a thermal pad.
            let is_pad = |slot: u64| ModuleKind::Triangle.thermal_slots().iter().any(|pad| u64::from(*pad) == slot);
            let value = |slot: u64| {
                let kpa = if is_pad(slot) { 0.0 } else { pressure(time) };
                self.count(kpa, 12 * module + slot)
            };
            let module = Module::new(module as u8).unwrap();
            let head = Message::Head { board: board(), module, values: std::array::from_fn(|i| value(i as u64)) };
            let values = std::array::from_fn(|i| value(7 + i as u64));
            let tail = Message::Tail { board: board(), module, values, status: StatusWord(0) };
            frames.push(TimedFrame { time, frame: head.encode() });
            frames.push(TimedFrame { time: time + Duration::from_micros(300), frame: tail.encode() });
        }
        self.now = self.now + PERIOD;
        Slot { frames, end: self.now }
    }

    /// Two counts per kPa below a rest of its own, and noise of half a count, so that nothing seems frozen.
    fn count(&self, kpa: f64, input: u64) -> u8 {
        let mixed = (self.scans * 64 + input).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let noise = (mixed ^ mixed >> 29).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 63;
        (200.0 + input as f64 - 2.0 * kpa).round() as u8 + noise as u8
    }
}
