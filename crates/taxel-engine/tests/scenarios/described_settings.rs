//! A device that is described by its signals is used as it was at the calibration, with what it was sent then.

use std::sync::Arc;
use std::time::Duration;

use taxel_engine::Restored;
use taxel_engine::command::Command;
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::Plan;
use taxel_engine::snapshot::ForceState;
use taxel_wire::{CanId, Frame};

use crate::described::{Scene, patch_plan, plan};
use crate::shared::configured;

/// The same set with these words for the commands; with none it is one of an earlier version, which did not tell them.
fn told(set: &ModelSet, commands: &str) -> Arc<ModelSet> {
    let mut set = set.clone();
    assert!(set.board_settings[0].contains("; no commands"), "{:?}", set.board_settings);
    set.board_settings[0] = set.board_settings[0].replace("; no commands", commands);
    Arc::new(set)
}

/// What lies on a device that streams with other commands, or none, is not known while it is configured.
#[test]
fn a_described_device_gets_its_commands_at_a_start_unless_it_streams_with_them() {
    let set = told(&Scene::in_use().newest_set(), "");
    let start = Frame::of(CanId::Extended(0x18FD_0001), [1]);
    let mut plan = plan();
    plan.patches[0].devices[0].commands = vec![(Duration::from_millis(50), start)];
    for known in [false, true] {
        let zero = configured(&plan.patches[0]);
        let restored = Restored {
            active: vec![("array".to_owned(), set.id.clone())],
            model_sets: vec![set.clone().into()],
            zeros: Some(("array".to_owned(), zero)).filter(|_| known).into_iter().collect(),
            ..Restored::default()
        };
        let mut scene = Scene::new(plan.clone(), restored);
        scene.seconds(6.0);
        let sent = scene.host.sent.iter().any(|(_, frame)| *frame == start);
        let state = if known { ForceState::Ok } else { ForceState::TareInvalid };
        assert_eq!((sent, scene.host.state()), (!known, state), "{}", scene.host.reasons());
    }
}

/// Each of the two models would be used for the other's taxel, and nothing at rest would tell.
#[test]
fn a_set_of_taxels_that_lie_elsewhere_in_the_frames_now_has_no_force() {
    let set = Scene::in_use().newest_set();
    let mut plan = plan();
    let counts = &mut plan.patches[0].devices[0].frames[0].counts;
    (counts[0].1, counts[1].1) = (counts[1].1, counts[0].1);
    let active = vec![("array".to_owned(), set.id.clone())];
    let mut scene = Scene::new(plan, Restored { model_sets: vec![set.into()], active, ..Restored::default() });
    scene.seconds(4.0);
    assert_eq!(scene.host.state(), ForceState::Uncalibrated);
    assert!(scene.host.reasons().contains("as its taxels on device 1"), "{}", scene.host.reasons());
}

/// A command may set the gain of the array, which nothing at rest would tell.
#[test]
fn a_device_that_is_sent_other_commands_than_at_the_calibration_has_no_force() {
    let set = Scene::in_use().newest_set();
    let with = |gathered_with: &str, command: Option<[u8; 2]>| {
        let mut plan = plan();
        let frame = |data| (Duration::ZERO, Frame::of(CanId::Standard(5), data));
        plan.patches[0].devices[0].commands = command.map(frame).into_iter().collect();
        let set = told(&set, gathered_with);
        let active = vec![("array".to_owned(), set.id.clone())];
        let model_sets = vec![set.into()];
        let zeros = vec![("array".to_owned(), configured(&plan.patches[0]))];
        let mut scene = Scene::new(plan, Restored { model_sets, active, zeros, ..Restored::default() });
        scene.seconds(6.0);
        (scene.host.state(), scene.host.reasons())
    };
    let ok = (ForceState::Ok, String::new());
    assert_eq!(with("; commands 0101", Some([1, 1])), ok);
    assert_eq!(with("; no commands", None), ok);
    assert_eq!(with("", Some([1, 1])), ok, "what an earlier version did not tell is not known");
    let of_one = "commands 0101";
    for (then, command, now) in
        [(of_one, Some([1, 2]), "commands 0102"), (of_one, None, "no commands"), ("no commands", Some([1, 1]), of_one)]
    {
        let (state, why) = with(&format!("; {then}"), command);
        assert_eq!(state, ForceState::Uncalibrated);
        let said = format!("was gathered with {then} on device 1, where the configuration has {now}");
        assert!(why.contains(&said), "{why}");
    }
}

/// Sixteen bits of a number that are left out or not, and where it begins: the range of the counts is the same.
#[test]
fn numbers_that_become_counts_in_another_way_than_at_the_calibration_have_no_force() {
    let set = Scene::in_use().newest_set();
    let with = |low: i64, shift: u8, lines: Option<&str>| {
        let mut plan = plan();
        let specs = plan.patches[0].devices[0].frames.iter_mut();
        for (_, field) in specs.flat_map(|spec| &mut spec.counts) {
            (field.low, field.shift) = (low, shift);
        }
        let mut set = ModelSet::clone(&set);
        set.board_settings = lines.map_or(set.board_settings, |line| vec![line.to_owned()]);
        let active = vec![("array".to_owned(), set.id.clone())];
        let model_sets = vec![Arc::new(set).into()];
        let mut scene = Scene::new(plan, Restored { model_sets, active, ..Restored::default() });
        scene.seconds(4.0);
        (scene.host.state(), scene.host.reasons())
    };
    assert_eq!(with(0, 0, None), (ForceState::Ok, String::new()));
    let (state, why) = with(0, 1, None);
    assert_eq!(state, ForceState::Uncalibrated);
    let said =
        "numbers from 0, lowest 0 bits left out on device 1, where the configuration has numbers from 0, lowest 1 bits";
    assert!(why.contains(said), "{why}");
    assert!(with(-100, 0, None).1.contains("where the configuration has numbers from -100, lowest 0 bits left out"));
    // Of an earlier version, which told the range alone.
    let range = "device 1: counts from 0 to 65535, 256 to a unit";
    assert_eq!(with(0, 0, Some(range)).0, ForceState::Ok);
    let (state, why) = with(0, 0, Some("device 1: counts from 0 to 4095, 16 to a unit"));
    assert_eq!(state, ForceState::Uncalibrated);
    assert!(
        why.contains("4095, 16 to a unit on device 1, where the configuration has counts from 0 to 65535"),
        "{why}"
    );
}

/// Another patch reads the same device and has the commands for it.
#[test]
fn a_device_is_configured_by_one_of_its_patches_and_both_lose_their_zero() {
    let scene = Scene::in_use();
    let set = told(&scene.newest_set(), "");
    let mut half = patch_plan("half", 0x18FE_0000);
    half.devices[0].commands = vec![(Duration::ZERO, Frame::data(CanId::Extended(0x18FD_0001), &[1]).unwrap())];
    let plan = Plan { buses: 1, patches: vec![patch_plan("array", 0x18FE_0000), half] };
    let active = vec![("array".to_owned(), set.id.clone())];
    let mut scene = Scene::new(plan, Restored { model_sets: vec![set.into()], active, ..Restored::default() });
    scene.seconds(5.0);
    assert_eq!(scene.host.sent.len(), 1, "one of them sends it");
    assert_eq!(scene.host.state(), ForceState::TareInvalid, "nobody saw what lay on it");
    scene.ask(Command::BringUp { patch: "array".to_owned(), confirmed_by: Some("Ada".to_owned()) });
    scene.seconds(1.0);
    assert_eq!(scene.host.sent.len(), 2, "whoever asks for one of them asks for both");
}
