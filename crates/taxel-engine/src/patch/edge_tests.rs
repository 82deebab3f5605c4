//! Where each limit of what is asked of a patch lies, and when its boards are configured.

use std::time::Duration;

use taxel_model::{FitOptions, GaugeUncertainty};
use taxel_sim::HOST_BOARD_CONFIG;
use taxel_skin::{Board, BoardAddress, BusIndex, Kilopascal, Module, ModuleKind, Time};
use taxel_wire::icub::TriangleConfig;

use super::owner::{Effects, Intent, Patch, Ready};
use crate::boundary::output::Output;
use crate::force;
use crate::now::Now;
use crate::plan::{BoardSetup, PatchPlan};
use crate::request::{ErrorReason, Rejection};
use crate::zero::boards::BoardZeros;
use crate::zero::watch::Purpose;

/// Ten taxels on one board.
const TAXELS: usize = 10;

fn now(ms: i64) -> Now {
    Now { time: Time::from_nanos(ms * 1_000_000), wall_ns: 0 }
}

fn listening() -> PatchPlan {
    let board = Board {
        bus: BusIndex(0),
        address: BoardAddress::new(1).unwrap(),
        modules: vec![(Module::new(0).unwrap(), ModuleKind::Triangle)],
    };
    PatchPlan::new(taxel_skin::Patch::new("p", vec![board]).unwrap())
}

/// The same, with a board that has to be configured.
pub fn configuring() -> PatchPlan {
    let module = Module::new(0).unwrap();
    let triangle = TriangleConfig { first: module, last: module, shift: 2, enabled: true, cdc_offset: 0x2200 };
    let setup = BoardSetup { board: HOST_BOARD_CONFIG, triangles: vec![triangle] };
    PatchPlan { bring_up: vec![setup], ..listening() }
}

/// A patch, and what it put out last.
struct Scene {
    patch: Patch,
    out: Vec<Output>,
    intents: Vec<Intent>,
}

impl Scene {
    fn new(plan: PatchPlan, with_models: bool, shares_its_board: bool) -> Self {
        let mut patch = Patch::new(0, plan, Vec::new(), BoardZeros::default(), vec![shares_its_board]);
        if with_models {
            patch.set_models(force::tests::set(TAXELS));
        }
        Self { patch, out: Vec::new(), intents: Vec::new() }
    }

    fn act<T>(&mut self, act: impl FnOnce(&mut Patch, &mut Effects<'_>) -> T) -> T {
        (self.out, self.intents) = (Vec::new(), Vec::new());
        act(&mut self.patch, &mut Effects { out: &mut self.out, intents: &mut self.intents })
    }

    /// Whether anything is sent to the boards with the tick at this time.
    fn sends(&mut self, ms: i64) -> bool {
        self.act(|patch, effects| patch.tick(now(ms), effects));
        self.out.iter().any(|output| matches!(output, Output::Send(..)))
    }
}

#[test]
fn a_bag_is_vented_within_what_its_gauge_may_be_off_by() {
    // The noise that sessions allow for is 0.3 kPa, and three times 0.5 kPa are stated of the gauge.
    let gauge = GaugeUncertainty { gain_rel: 0.0, offset_kpa: 0.3, noise_kpa: 0.4 };
    let plan = PatchPlan { fit: FitOptions { gauge, ..FitOptions::default() }, ..listening() };
    let at = |kpa: f64, ms: i64| {
        let mut scene = Scene::new(plan.clone(), false, false);
        let read = now(1_000);
        scene.act(|patch, effects| patch.on_pressure(read, read.time, Kilopascal(kpa), effects));
        scene.patch.check_vented(now(1_000 + ms)).map_err(|refusal| match refusal {
            Rejection::FailedPrecondition(reason, why) => (reason, why),
            other => panic!("{other:?}"),
        })
    };
    for kpa in [-1.79, 0.0, 9.99, 10.0] {
        assert_eq!(at(kpa, 0), Ok(()), "{kpa} kPa");
    }
    let (reason, why) = at(10.1, 0).unwrap_err();
    assert_eq!(reason, ErrorReason::BagPresses);
    assert!(why.starts_with("the bag is at 10.1 kPa and presses on the skin: vent it below 10.0 kPa first"), "{why}");
    let (reason, why) = at(-1.81, 0).unwrap_err();
    assert_eq!(reason, ErrorReason::GaugeOffset);
    assert!(why.starts_with("the gauge reads -1.81 kPa, and a vented bag has no less than -1.80 kPa"), "{why}");
    // What it said half a second ago is what it says; later nobody knows, and the ramp itself waits for it.
    assert!(at(40.0, 500).is_err());
    assert_eq!(at(40.0, 501), Ok(()));
    assert_eq!(Scene::new(plan.clone(), false, false).patch.check_vented(now(1_000)), Ok(()));
}

#[test]
fn boards_that_were_not_heard_for_three_periods_are_configured_without_a_look() {
    let mut scene = Scene::new(configuring(), true, false);
    scene.act(|patch, effects| patch.start(now(1_000), effects));
    assert!(scene.patch.check_looked_at().is_err());
    let why = scene.patch.check_set_up().unwrap_err().to_string();
    assert!(
        why.ends_with("the boards are being configured, which takes their zero anew: ask again when they are verified"),
        "{why}"
    );
    assert!(!scene.sends(1_000) && !scene.sends(1_299));
    assert_eq!(scene.patch.deadline(), Some(now(1_300).time), "it wants to be woken for that");
    assert!(scene.sends(1_300));
    assert_ne!(scene.patch.deadline(), Some(now(1_300).time), "it waits for that no longer");
    assert!(scene.patch.check_looked_at().is_ok());
    assert!(scene.patch.check_set_up().is_err(), "they are not verified yet");
}

/// Silent boards show nothing, however long one looks.
#[test]
fn silent_boards_are_configured_again_at_once() {
    let mut scene = Scene::new(configuring(), true, false);
    scene.act(|patch, effects| patch.start(now(1_000), effects));
    assert!(scene.sends(1_300));
    scene.act(|patch, effects| patch.bring_up_again(now(60_000), false, effects));
    assert!(scene.patch.check_looked_at().is_ok() && scene.sends(60_000));
}

#[test]
fn boards_whose_load_no_model_would_show_are_configured_without_a_look_and_those_of_a_listener_never() {
    let mut scene = Scene::new(configuring(), false, false);
    scene.act(|patch, effects| patch.start(now(1_000), effects));
    assert!(!scene.sends(1_000));
    assert_eq!(scene.patch.deadline(), Some(now(1_300).time), "it wants to be woken, whoever watches meanwhile");
    scene.act(|patch, _| patch.zero.watch(now(1_000).time, Purpose::Session { confirmed_by: None }, &mut Vec::new()));
    assert_eq!(scene.patch.deadline(), Some(now(1_300).time));
    assert!(!scene.sends(1_299) && scene.sends(1_300), "whether they stream is heard first");
    assert!(scene.patch.check_looked_at().is_ok());
    let mut scene = Scene::new(listening(), true, false);
    scene.act(|patch, effects| patch.start(now(1_000), effects));
    assert!(scene.patch.check_looked_at().is_ok() && scene.patch.check_set_up().is_ok());
    assert!(!scene.sends(1_000) && !scene.sends(2_000));
}

#[test]
fn a_board_that_is_shared_waits_for_the_others_and_is_looked_at_meanwhile() {
    let mut scene = Scene::new(configuring(), false, true);
    assert!(!scene.patch.is_ready_for_bring_up());
    scene.act(|patch, effects| patch.start(now(1_000), effects));
    assert!(!scene.sends(1_300));
    assert!(matches!(scene.intents[..], [Intent::BoardsReady]), "{:?}", scene.intents);
    assert!(scene.patch.is_ready_for_bring_up() && !scene.sends(1_500));
    assert_eq!(scene.patch.deadline(), None, "nothing of its own is to be done");
    scene.act(|patch, effects| patch.on_looked(now(1_500), Err("loaded".to_owned()), effects));
    assert!(!scene.patch.is_ready_for_bring_up(), "a load has come meanwhile");
    scene.act(|patch, effects| patch.on_looked(now(2_500), Ok(Ready::Seen), effects));
    assert!(matches!(scene.intents[..], [Intent::BoardsReady]), "{:?}", scene.intents);
    assert!(scene.patch.is_ready_for_bring_up());
    assert_eq!(scene.patch.looked(), Some(now(2_500).time));
    scene.patch.look_again();
    assert!(!scene.patch.is_ready_for_bring_up() && scene.patch.looked().is_none(), "what it saw is too old");
    let scene = Scene::new(listening(), false, true);
    assert!(scene.patch.is_ready_for_bring_up(), "a patch that configures nothing keeps nobody waiting");
}

#[test]
fn who_vouches_for_a_patch_that_waits_for_another_is_believed_for_ten_seconds() {
    for with_models in [true, false] {
        believed_for_ten_seconds(Scene::new(configuring(), with_models, true));
    }
}

fn believed_for_ten_seconds(mut scene: Scene) {
    scene.act(|patch, effects| patch.start(now(1_000), effects));
    scene.act(|patch, effects| patch.bring_up_again(now(2_000), true, effects));
    assert!(matches!(scene.intents[..], [Intent::BoardsReady]), "{:?}", scene.intents);
    scene.patch.look_again();
    assert!(scene.patch.is_ready_for_bring_up() && scene.patch.looked().is_none(), "nobody has to look");
    scene.act(|patch, effects| patch.tick(now(11_999), effects));
    assert!(scene.intents.is_empty() && scene.patch.deadline() == Some(now(12_000).time), "{:?}", scene.intents);
    scene.act(|patch, effects| patch.tick(now(12_000), effects));
    assert!(matches!(scene.intents[..], [Intent::BoardsReady]), "silent boards need no word: {:?}", scene.intents);
}

#[test]
fn a_look_takes_the_time_of_a_tare_or_of_ten_scans_and_ends_with_a_scan() {
    let of = |period: u64| {
        let plan = PatchPlan { period: Duration::from_millis(period), ..configuring() };
        Scene::new(plan, true, true).patch.look_lasts().map(|lasts| lasts.as_millis())
    };
    assert_eq!((of(50), of(200)), ([1_000, 1_050], [2_000, 2_200]));
}
