//! A skin that is described by its signals obeys the rules of skin boards: 48 taxels of 16 bits in two frames of CAN FD.

use taxel_engine::plan::{DevicePlan, DeviceSignal, ScanBegin, Sender};
use taxel_wire::array::{CountField, FrameSpec};
use taxel_wire::bits::{BitField, ByteOrder, FrameMatch};

use crate::array::{PERIOD, Scene as _, Skin, gauge, patch_of};
use crate::prelude::*;

const STATUS_ID: u32 = 0x18FD_0002;
const GAUGE: CanId = CanId::Extended(0x18FF_0010);

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
        sender: Sender::Patch,
        ..DevicePlan::without_frames()
    };
    PatchPlan { devices: vec![device], gauge: Some(gauge(BUS, GAUGE)), ..patch_of(name, 4, u16::MAX) }
}

/// The array in front of an engine.
pub struct Scene {
    pub host: Host,
    pub skin: Skin,
    scans: u32,
    /// A frame that does not come.
    mute: Option<usize>,
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
        Self { host, skin: Skin::new(), scans: 0, mute: None, off: false, status: None, beside: None }
    }

    /// An array that was calibrated and weighs.
    pub fn in_use() -> Self {
        Self::new(plan(), Restored::default()).calibrated()
    }

    /// There is no force in so many scans.
    fn has_no_force(&mut self, scans: u32, what: &str) {
        for _ in 0..scans {
            self.scan();
            let force = &self.host.snapshot().force;
            assert_eq!(force.total, None, "6.4 N lie there, {what}: {force:?}");
        }
    }
}

impl crate::array::Scene for Scene {
    const PATCH: &str = "array";

    fn host(&mut self) -> &mut Host {
        &mut self.host
    }

    fn skin(&mut self) -> &mut Skin {
        &mut self.skin
    }

    fn scan(&mut self) {
        let begin = Time::default() + PERIOD * self.scans;
        self.scans += 1;
        let in_frames = |counts: Vec<u16>, first_id: u32| {
            let bytes: Vec<u8> = counts.into_iter().flat_map(u16::to_le_bytes).collect();
            [0, 1].map(|n| Frame::fd(CanId::Extended(first_id + n as u32), &bytes[48 * n..][..48]).unwrap())
        };
        let mut frames = vec![Frame::of(GAUGE, self.skin.pascal())];
        frames.extend(self.status.map(|status| Frame::of(CanId::Extended(STATUS_ID), [status])));
        let own = in_frames(self.skin.counts(256.0), 0x18FE_0000).into_iter().enumerate();
        frames.extend(own.filter(|(n, _)| self.mute != Some(*n) && !self.off).map(|(_, frame)| frame));
        if let Some(first_id) = self.beside {
            frames.extend(in_frames(Skin::new().counts(256.0), first_id));
        }
        let time = |n: u32| begin + Duration::from_micros(300) * n;
        let timed = (1..).zip(frames).map(|(n, frame)| TimedFrame { time: time(n), frame });
        self.host.frames(&timed.collect::<Vec<_>>());
        self.host.tick(begin + PERIOD / 2);
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
        scene.skin.load = (16, 25.0);
        scene.seconds(2.0);
        scene.skin.take_zero();
        scene.off = false;
        scene.has_no_force(250, &format!("beside {beside:?}"));
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
        scene.skin.load = (16, 25.0);
        scene.seconds(1.0);
        assert!(scene.host.snapshot().force.total.unwrap().0 > 5.0);
        scene.status = Some(1);
        scene.seconds(0.5 * not_well_s);
        scene.skin.take_zero();
        scene.seconds(0.5 * not_well_s);
        scene.status = Some(0);
        scene.has_no_force(500, &format!("after {not_well_s} s"));
        scene.is(ForceState::TareInvalid);
        assert!(scene.host.reasons().contains("board 1 "), "{}", scene.host.reasons());
    }
    // Between two scans.
    let mut scene = new();
    scene.skin.load = (16, 25.0);
    scene.seconds(1.0);
    for status in [1_u8, 0] {
        let time = scene.host.now + Duration::from_millis(3);
        scene.host.frames(&[TimedFrame { time, frame: Frame::of(CanId::Extended(STATUS_ID), [status]) }]);
        scene.skin.take_zero();
    }
    scene.seconds(5.0);
    assert_eq!(scene.host.snapshot().force.total, None, "{}", scene.host.reasons());
    // For a moment, and nothing happened: the force comes back by itself.
    let mut scene = new();
    scene.skin.load = (16, 25.0);
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
        plan.patches[0].patch = patch_of("array", 16, u16::MAX).patch;
        plan
    };
    let before = Scene::new(small(), Restored::default()).calibrated();
    let mut scene = Scene::new(small(), Disk::with(vec![before.host.newest_set()], &[]).found());
    scene.skin.load = (3, 10.0);
    scene.seconds(4.0);
    assert_eq!(scene.host.state(), ForceState::TareInvalid, "0.5 N lie there");
    assert!(scene.host.reasons().contains("module"), "{}", scene.host.reasons());
    scene.skin.load = (0, 0.0);
    scene.seconds(4.0);
    scene.is(ForceState::Ok);
}

#[test]
fn a_described_array_is_calibrated_by_the_same_session_and_weighs() {
    let mut scene = Scene::in_use();
    assert!(scene.host.snapshot().taxels[0].count > 50_000, "raw counts are served");
    let told = &scene.host.newest_set().board_settings;
    assert!(told[0].contains("counts 0 to 65535, 256 to a unit"), "{told:?}");
    scene.weighs();
    scene.skin.load = (0, 0.0);
    scene.seconds(1.0);
    assert!(scene.host.snapshot().force.total.unwrap().0 < 0.02);
}

/// After the machine's sleep or a bus that was off the next zero needs confirmation, as after a silence.
#[test]
fn a_load_that_was_gone_after_a_loss_of_the_bus_keeps_a_zero_from_being_proven() {
    let mut scene = Scene::in_use();
    scene.skin.load = (16, 25.0);
    scene.seconds(1.0);
    scene.host.notice(BusNotice::BusOff);
    scene.skin.take_zero();
    scene.host.notice(BusNotice::Up);
    scene.seconds(2.0);
    let refused = scene.refused_tare();
    assert!(refused.contains("lost its load while it was silent or reported a fault"), "{refused}");
    assert_eq!(scene.host.snapshot().force.total, None, "6.4 N lie there");
}

/// A zero is of the second before it goes to disk. What is found while it waits there is of afterwards.
#[test]
fn what_is_found_while_a_zero_goes_to_disk_is_not_forgotten_with_it() {
    let mut scene = Scene::in_use();
    scene.host.disk_is_slow = true;
    let request = scene.host.command(say::tare());
    scene.seconds(1.5);
    assert_eq!(scene.host.commits.len(), 1, "it is proven, and waits");
    scene.skin.load = (16, 25.0);
    scene.seconds(0.3);
    scene.skin.take_zero();
    scene.seconds(0.1);
    scene.host.commit(Ok(()));
    scene.seconds(0.1);
    let refused = scene.host.reply(request).expect("answered").unwrap_err().to_string();
    assert!(refused.contains("a whole board lost its load in one scan"), "{refused}");
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
