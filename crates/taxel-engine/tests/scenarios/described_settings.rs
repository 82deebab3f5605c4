//! A device that is described by its signals is used as it was at the calibration, with what it was sent then.

use crate::array::Scene as _;
use crate::described::{Scene, patch_plan, plan};
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

/// Another patch reads the same device and has the commands for it.
#[test]
fn a_device_is_configured_by_one_of_its_patches_and_both_lose_their_zero() {
    let scene = Scene::in_use();
    let set = told(&scene.host.newest_set(), "");
    let mut half = patch_plan("half", 0x18FE_0000);
    half.devices[0].commands = vec![(Duration::ZERO, Frame::data(CanId::Extended(0x18FD_0001), &[1]).unwrap())];
    let plan = Plan { buses: 1, patches: vec![patch_plan("array", 0x18FE_0000), half] };
    let mut scene = Scene::new(plan, Disk::with(vec![set], &[]).found());
    scene.seconds(5.0);
    assert_eq!(scene.host.sent.len(), 1, "one of them sends it");
    assert_eq!(scene.host.state(), ForceState::TareInvalid, "nobody saw what lay on it");
    scene.ask(Command::BringUp { patch: "array".to_owned(), confirmed_by: Some("Ada".to_owned()) });
    scene.seconds(1.0);
    assert_eq!(scene.host.sent.len(), 2, "whoever asks for one of them asks for both");
}
