//! A skin that is described by its signals obeys the rules of skin boards: 48 taxels of 16 bits in two frames of CAN FD.

use std::sync::Arc;
use std::time::Duration;

use taxel_engine::calibration::SessionState;
use taxel_engine::command::Command;
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::{DevicePlan, DeviceSignal, Gauge, PatchPlan, Plan, ScanBegin, Sender};
use taxel_engine::record::Record;
use taxel_engine::snapshot::{Fault, ForceState};
use taxel_engine::{BusNotice, Restored};
use taxel_skin::{Board, BoardAddress, CountRange, Module, ModuleKind, Patch, SquareMillimetre, Time};
use taxel_wire::array::{CountField, FrameSpec};
use taxel_wire::bits::{BitField, ByteOrder, FrameMatch};
use taxel_wire::signal::{PressureMeaning, PressureUnit, SignalSpec};
use taxel_wire::{CanId, Frame, TimedFrame};

use crate::host::Host;
use crate::rig::BUS;

const TAXELS: usize = 48;
const PERIOD: Duration = Duration::from_millis(20);
const REST: f64 = 230.0;
const AREA_MM2: f64 = 16.0;
const STATUS_ID: u32 = 0x18FD_0002;

pub fn plan() -> Plan {
    Plan { buses: 1, patches: vec![patch_plan("array", 0x18FE_0000)] }
}

/// An array whose frames have identifiers from this one on.
pub fn patch_plan(name: &str, first_id: u32) -> PatchPlan {
    let of_frame = |frame: u16| FrameSpec {
        frames: FrameMatch { id: CanId::Extended(first_id + u32::from(frame)), selectors: vec![] },
        counts: (0..24)
            .map(|n| {
                let field = BitField::new(16 * n, 16, ByteOrder::Little, false).unwrap();
                (24 * frame + n, CountField { field, low: 0, shift: 0, top: u16::MAX })
            })
            .collect(),
    };
    let device = DevicePlan {
        frames: (0..2).map(of_frame).collect(),
        scans: ScanBegin::Time,
        status: None,
        temperature: None,
        commands: vec![],
        sender: Sender::Patch,
    };
    let modules = (0..4).map(|module| (Module::from_nibble(module), ModuleKind::Cells(12))).collect();
    let board = Board { bus: BUS, address: BoardAddress::new(1).unwrap(), modules };
    let patch = Patch::new(name, vec![board]).unwrap().with_counts(CountRange::to(u16::MAX).unwrap());
    let signal = SignalSpec {
        id: CanId::Extended(0x18FF_0010),
        start_bit: 0,
        length_bits: 32,
        byte_order: ByteOrder::Little,
        signed: true,
        scale: 0.001,
        offset: 0.0,
        unit: PressureUnit::Kilopascal,
        meaning: PressureMeaning::Differential,
    };
    PatchPlan {
        devices: vec![device],
        period: PERIOD,
        areas: vec![SquareMillimetre(AREA_MM2); TAXELS],
        gauge: Some(Gauge { bus: BUS, signal }),
        ..PatchPlan::new(patch)
    }
}

/// The array in front of an engine.
pub struct Scene {
    pub host: Host,
    scans: i64,
    bits: u64,
    /// What the bag presses with, kPa, and what beside it lies on the first taxels.
    bag_kpa: f64,
    pub load: (usize, f64),
    /// What the device has taken for nothing, units by taxel.
    taken: Vec<f64>,
    /// A frame that does not come.
    mute: Option<usize>,
    /// A taxel at the end of its range.
    railed: Option<usize>,
    /// It has no power.
    off: bool,
    /// What it says of itself, where it does.
    status: Option<u8>,
    /// Another array on the bus, at rest: the identifier of its first frame.
    beside: Option<u32>,
}

impl Scene {
    pub fn new(plan: Plan, restored: Restored) -> Self {
        let host = Host::new(Arc::new(plan), restored, Time::default());
        let taken = vec![0.0; TAXELS];
        Self {
            host,
            scans: 0,
            bits: 0x9E37_79B9_7F4A_7C15,
            bag_kpa: 0.0,
            load: (0, 0.0),
            taken,
            mute: None,
            railed: None,
            off: false,
            status: None,
            beside: None,
        }
    }

    /// From -1 to 1, more often near 0.
    fn chance(&mut self) -> f64 {
        let one = |bits: &mut u64| {
            *bits ^= *bits << 13;
            *bits ^= *bits >> 7;
            *bits ^= *bits << 17;
            (*bits >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..4).map(|_| one(&mut self.bits)).sum::<f64>() - 2.0
    }

    /// Units by which a taxel has moved.
    fn moved(&self, taxel: usize) -> f64 {
        let (loaded, kpa) = self.load;
        let kpa = self.bag_kpa + if taxel < loaded { kpa } else { 0.0 };
        (90.0 + taxel as f64) * kpa / (kpa + 60.0)
    }

    fn scan(&mut self) {
        let begin = Time::default() + PERIOD * self.scans as u32;
        self.scans += 1;
        let pascal = (self.bag_kpa * 1e3).round() as i32;
        let mut frames = vec![Frame::of(CanId::Extended(0x18FF_0010), pascal.to_le_bytes())];
        let mut counts = Vec::new();
        for taxel in 0..TAXELS {
            let units = REST - self.moved(taxel) + self.taken[taxel] + self.chance();
            let raw = if self.railed == Some(taxel) { u16::MAX } else { (256.0 * units) as u16 };
            counts.extend(raw.to_le_bytes());
        }
        frames.extend(self.status.map(|status| Frame::of(CanId::Extended(STATUS_ID), [status])));
        for (frame, bytes) in counts.chunks(48).enumerate().filter(|(frame, _)| self.mute != Some(*frame) && !self.off)
        {
            frames.push(Frame::fd(CanId::Extended(0x18FE_0000 + frame as u32), bytes).unwrap());
        }
        if let Some(first_id) = self.beside {
            let rest: Vec<u8> = (0..24).flat_map(|_| ((256.0 * (REST + self.chance())) as u16).to_le_bytes()).collect();
            let of_frame = |frame| Frame::fd(CanId::Extended(first_id + frame), &rest).unwrap();
            frames.extend((0..2).map(of_frame));
        }
        let timed =
            (1..).zip(frames).map(|(n, frame)| TimedFrame { time: begin + Duration::from_micros(300) * n, frame });
        self.host.frames(&timed.collect::<Vec<_>>());
        self.host.tick(begin + PERIOD / 2);
    }

    pub fn seconds(&mut self, seconds: f64) {
        (0..(seconds / PERIOD.as_secs_f64()).round() as u32).for_each(|_| self.scan());
    }

    pub fn ask(&mut self, command: Command) {
        let request = self.host.command(command);
        self.host.reply(request).expect("answered at once").expect("not refused");
    }

    pub fn newest_set(&self) -> Arc<ModelSet> {
        let mut sets = self.host.records.iter().rev().filter_map(|record| match record {
            Record::ModelSet(set) => Some(Arc::clone(set)),
            _ => None,
        });
        sets.next().expect("a model set")
    }

    /// An array that was calibrated and weighs.
    pub fn in_use() -> Self {
        Self::new(plan(), Restored::default()).calibrated()
    }

    fn calibrated(mut self) -> Self {
        let scene = &mut self;
        scene.seconds(1.0);
        let (patch, target, branches, confirmed_by) = ("array".to_owned(), None, None, None);
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
        let set = scene.newest_set();
        assert!(set.board_settings[0].contains("counts from 0 to 65535, 256 to a unit"), "{:?}", set.board_settings);
        scene.ask(Command::Activate { patch: "array".to_owned(), model_set: set.id.clone(), expected: None });
        scene.seconds(3.0);
        assert_eq!(scene.host.state(), ForceState::Ok, "{}", scene.host.reasons());
        self
    }

    /// The array takes what lies on it for nothing, and leaves no residue that would show it.
    fn take_zero(&mut self) {
        self.taken = (0..TAXELS).map(|taxel| self.moved(taxel)).collect();
    }
}

/// Two arrays on one bus. Each is the first device of its patch, and one of them is heard while the other has no power.
#[test]
fn a_described_device_that_was_without_power_has_no_force_whatever_else_is_on_the_bus() {
    for beside in [None, Some(0x18FC_0000)] {
        let mut plan = plan();
        plan.patches.extend(beside.map(|first_id| patch_plan("palm", first_id)));
        let mut scene = Scene { beside, ..Scene::new(plan, Restored::default()) }.calibrated();
        scene.off = true;
        scene.seconds(3.0);
        assert_eq!(scene.host.state(), ForceState::Stale);
        scene.load = (16, 25.0);
        scene.seconds(2.0);
        scene.take_zero();
        scene.off = false;
        for _ in 0..250 {
            scene.scan();
            let force = &scene.host.snapshot().force;
            assert_eq!(force.total, None, "6.4 N lie there, beside {beside:?}: {force:?}");
        }
        assert!(scene.host.reasons().contains("was silent for 5.0 s"), "{}", scene.host.reasons());
    }
}

/// It goes on sending while it calibrates itself, and says so.
#[test]
fn a_described_device_that_was_not_well_by_its_own_status_may_have_taken_a_new_zero() {
    let signal = DeviceSignal {
        frames: FrameMatch { id: CanId::Extended(STATUS_ID), selectors: vec![] },
        field: BitField::new(0, 8, ByteOrder::Little, false).unwrap(),
    };
    let mut plan = plan();
    plan.patches[0].devices[0].status = Some((signal, 0));
    let new = || Scene { status: Some(0), ..Scene::new(plan.clone(), Restored::default()) }.calibrated();
    for not_well_s in [0.3, 0.8, 1.5] {
        let mut scene = new();
        scene.load = (16, 25.0);
        scene.seconds(1.0);
        assert!(scene.host.snapshot().force.total.unwrap().0 > 5.0);
        scene.status = Some(1);
        scene.seconds(0.5 * not_well_s);
        scene.take_zero();
        scene.seconds(0.5 * not_well_s);
        scene.status = Some(0);
        for _ in 0..500 {
            scene.scan();
            let force = &scene.host.snapshot().force;
            assert_eq!(force.total, None, "6.4 N lie there, after {not_well_s} s: {force:?}");
        }
        assert_eq!(scene.host.state(), ForceState::TareInvalid, "{}", scene.host.reasons());
        assert!(scene.host.reasons().contains("board 1 "), "{}", scene.host.reasons());
    }
    // Between two scans.
    let mut scene = new();
    scene.load = (16, 25.0);
    scene.seconds(1.0);
    for status in [1_u8, 0] {
        let time = scene.host.now + Duration::from_millis(3);
        scene.host.frames(&[TimedFrame { time, frame: Frame::of(CanId::Extended(STATUS_ID), [status]) }]);
        scene.take_zero();
    }
    scene.seconds(5.0);
    assert_eq!(scene.host.snapshot().force.total, None, "{}", scene.host.reasons());
    // For a moment, and nothing happened: the force comes back by itself.
    let mut scene = new();
    scene.load = (16, 25.0);
    scene.status = Some(1);
    scene.seconds(0.3);
    scene.status = Some(0);
    scene.seconds(4.0);
    assert!(scene.host.snapshot().force.total.is_some_and(|total| total.0 > 5.0), "{}", scene.host.reasons());
}

/// Of modules of three taxels two speak for each.
#[test]
fn a_load_on_one_of_many_small_modules_is_no_rest() {
    let small = || {
        let mut plan = plan();
        let modules = (0..16).map(|module| (Module::from_nibble(module), ModuleKind::Cells(3))).collect();
        let board = Board { bus: BUS, address: BoardAddress::new(1).unwrap(), modules };
        let patch = Patch::new("array", vec![board]).unwrap().with_counts(CountRange::to(u16::MAX).unwrap());
        plan.patches[0].patch = patch;
        plan
    };
    let before = Scene::new(small(), Restored::default()).calibrated();
    let set = before.newest_set();
    let active = vec![("array".to_owned(), set.id.clone())];
    let mut scene = Scene::new(small(), Restored { model_sets: vec![set.into()], active, ..Restored::default() });
    scene.load = (3, 10.0);
    scene.seconds(4.0);
    assert_eq!(scene.host.state(), ForceState::TareInvalid, "0.5 N lie there");
    assert!(scene.host.reasons().contains("module"), "{}", scene.host.reasons());
    scene.load = (0, 0.0);
    scene.seconds(4.0);
    assert_eq!(scene.host.state(), ForceState::Ok, "{}", scene.host.reasons());
}

#[test]
fn a_described_array_is_calibrated_by_the_same_session_and_weighs() {
    let mut scene = Scene::in_use();
    assert!(scene.host.snapshot().taxels[0].count > 50_000, "raw counts are served");
    scene.load = (16, 25.0);
    scene.seconds(1.0);
    let force = &scene.host.snapshot().force;
    let (truth, total) = (16.0 * 25.0 * AREA_MM2 * 1e-3, force.total.unwrap().0);
    assert!((total / truth - 1.0).abs() < 0.03, "{total} N, not {truth}: {:?}", force.reasons);
    assert!((total - truth).abs() <= 2.0 * force.total_sigma.unwrap().0, "{force:?}");
    scene.load = (0, 0.0);
    scene.seconds(1.0);
    assert!(scene.host.snapshot().force.total.unwrap().0 < 0.02);
}

/// What the machine's sleep or a bus that was off may have hidden is held against the next zero, as a silence is.
#[test]
fn a_load_that_was_gone_after_a_loss_of_the_bus_keeps_a_zero_from_being_proven() {
    {
        let lost = BusNotice::BusOff;
        let mut scene = Scene::in_use();
        scene.load = (16, 25.0);
        scene.seconds(1.0);
        scene.host.notice(lost.clone());
        scene.take_zero();
        scene.host.notice(BusNotice::Up);
        scene.seconds(2.0);
        let request = scene.host.command(Command::Tare { patch: "array".to_owned(), confirmed_by: None });
        scene.seconds(3.0);
        let refused = scene.host.reply(request).expect("answered").unwrap_err().to_string();
        assert!(refused.contains("lost its load while it was silent or reported a fault"), "{lost:?}: {refused}");
        assert_eq!(scene.host.snapshot().force.total, None, "6.4 N lie there");
    }
}

/// A zero is of the second before it goes to disk. What is found while it waits there is of afterwards.
#[test]
fn what_is_found_while_a_zero_goes_to_disk_is_not_forgotten_with_it() {
    let mut scene = Scene::in_use();
    scene.host.disk_is_slow = true;
    let request = scene.host.command(Command::Tare { patch: "array".to_owned(), confirmed_by: None });
    scene.seconds(1.5);
    assert_eq!(scene.host.commits.len(), 1, "it is proven, and waits");
    scene.load = (16, 25.0);
    scene.seconds(0.3);
    scene.take_zero();
    scene.seconds(0.1);
    scene.host.commit(Ok(()));
    scene.seconds(0.1);
    let refused = scene.host.reply(request).expect("answered").unwrap_err().to_string();
    assert!(refused.contains("a load vanished from a whole board at once"), "{refused}");
}

#[test]
fn a_described_device_that_takes_a_new_zero_under_a_load_has_no_force() {
    let mut scene = Scene::in_use();
    scene.load = (16, 25.0);
    scene.seconds(1.0);
    assert!(scene.host.snapshot().force.total.unwrap().0 > 5.0);
    // What lies on it reads as nothing from now on, and each input has another residue.
    let residues: Vec<f64> = (0..TAXELS).map(|_| 2.0 * scene.chance()).collect();
    scene.taken = (0..TAXELS).map(|taxel| scene.moved(taxel) + residues[taxel]).collect();
    scene.seconds(2.0);
    assert_eq!(scene.host.state(), ForceState::TareInvalid, "{:?}", scene.host.snapshot().force);
    assert!(scene.host.reasons().contains("board 1 "), "{}", scene.host.reasons());
    scene.seconds(5.0);
    assert_eq!(scene.host.state(), ForceState::TareInvalid, "it does not come back by itself");
}

#[test]
fn a_described_frame_that_falls_silent_takes_its_taxels_along() {
    let mut scene = Scene::in_use();
    scene.mute = Some(1);
    scene.seconds(1.0);
    let snapshot = scene.host.snapshot();
    assert_eq!((snapshot.force.state, snapshot.force.stale), (ForceState::Stale, 24), "{:?}", snapshot.force.reasons);
    assert!(snapshot.taxels[24].stale && !snapshot.taxels[23].stale);
    assert!(snapshot.force.total.is_none());
}

#[test]
fn a_taxel_at_the_end_of_its_own_range_has_a_fault_and_no_other_has() {
    let mut scene = Scene::in_use();
    scene.railed = Some(7);
    scene.seconds(1.0);
    let taxels = &scene.host.snapshot().taxels;
    assert!(taxels[7].faults.contains(Fault::Rail), "{}", taxels[7].faults);
    assert!(taxels.iter().enumerate().all(|(taxel, state)| taxel == 7 || state.faults.is_empty()));
}

#[test]
fn a_described_frame_that_is_too_short_is_counted_and_changes_nothing() {
    let mut scene = Scene::in_use();
    let before = scene.host.snapshot().taxels[0].count;
    let frame = Frame::fd(CanId::Extended(0x18FE_0000), &[0; 12]).unwrap();
    scene.host.frames(&[TimedFrame { time: scene.host.now, frame }]);
    scene.host.tick(scene.host.now + Duration::from_millis(1_100));
    let bus = &scene.host.health().buses[0];
    assert_eq!(bus.malformed, 1);
    assert!(bus.last_malformed.contains("frame 18FE0000 has 12 bytes, expected at least 48"), "{}", bus.last_malformed);
    assert_eq!(scene.host.snapshot().taxels[0].count, before);
}
