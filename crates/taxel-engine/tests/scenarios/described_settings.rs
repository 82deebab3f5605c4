//! A device that is described by its signals is used as it was at the calibration, with what it was sent then.

use crate::array::Scene as _;
use crate::described::{Scene, plan};
use crate::prelude::*;

/// The same set with these words for the commands; with none it is one of an earlier version, which did not tell them.
fn told(set: &ModelSet, commands: &str) -> Arc<ModelSet> {
    let mut set = set.clone();
    assert!(set.board_settings[0].contains("; commands none"), "{:?}", set.board_settings);
    set.board_settings[0] = set.board_settings[0].replace("; commands none", commands);
    Arc::new(set)
}

/// What lies on a device that streams with other commands, or none, is not known while it is configured.
#[test]
fn a_described_device_gets_its_commands_at_a_start_unless_it_streams_with_them() {
    let set = told(&Scene::in_use().host.newest_set(), "");
    let start = Frame::of(CanId::Extended(0x18FD_0001), [1]);
    let mut plan = plan();
    plan.patches[0].devices[0].commands = vec![(Duration::from_millis(50), start)];
    for known in [false, true] {
        let disk = Disk::with(vec![set.clone()], if known { &plan.patches } else { &[] });
        let mut scene = Scene::new(plan.clone(), disk.found());
        scene.seconds(6.0);
        let sent = scene.host.sent.iter().any(|(_, frame)| *frame == start);
        let state = if known { ForceState::Ok } else { ForceState::TareInvalid };
        assert_eq!((sent, scene.host.state()), (!known, state), "{}", scene.host.reasons());
    }
}
