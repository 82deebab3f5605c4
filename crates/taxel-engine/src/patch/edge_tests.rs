//! Where each limit of what is asked of a patch lies, and when its boards are configured.

use taxel_sim::HOST_BOARD_CONFIG;
use taxel_skin::{Board, BoardAddress, BusIndex, Module, ModuleKind, Time};
use taxel_wire::icub::{StatusWord, TriangleConfig};

use super::owner::{Effects, Intent, Patch};
use crate::boundary::output::Output;
use crate::force;
use crate::intake::boards::BoardNews;
use crate::now::Now;
use crate::plan::{BoardSetup, PatchPlan};
use crate::zero::kept::KeptZero;

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
        let mut patch = Patch::new(0, plan, Vec::new(), KeptZero::default(), vec![shares_its_board]);
        if with_models {
            patch.set_models(force::tests::set(TAXELS));
        }
        Self { patch, out: Vec::new(), intents: Vec::new() }
    }

    fn knowing(plan: PatchPlan, known: KeptZero) -> Self {
        Self { patch: Patch::new(0, plan, Vec::new(), known, vec![false]), out: Vec::new(), intents: Vec::new() }
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
fn a_board_is_configured_if_it_is_silent_or_was_configured_otherwise() {
    let plan = configuring();
    let same = KeptZero { configured: Some(plan.settings_sum()), ..KeptZero::default() };
    for (known, streams, wanted) in [
        (same.clone(), true, false),
        (same.clone(), false, true),
        (KeptZero { configured: Some(1), ..same }, true, true),
        (KeptZero::default(), true, true),
    ] {
        let mut scene = Scene::knowing(plan.clone(), known);
        scene.act(|patch, effects| patch.start(now(1_000), effects));
        if streams {
            scene.act(|patch, effects| {
                let heard = BoardNews::Heard(now(1_250).time, StatusWord(0));
                patch.with_intake(now(1_250), effects, |intake, events| intake.on_news(0, &heard, events))
            });
        }
        assert_eq!(scene.patch.boards_to_configure(now(1_300).time), [wanted]);
        assert!(scene.patch.check_set_up().is_err(), "it is still listened");
        scene.act(|patch, effects| patch.begin(now(1_300), &[wanted], effects));
        assert_eq!(scene.sends(1_300), wanted);
        // Something may have lain on a board that streamed.
        assert_eq!(scene.patch.zero.needs_confirmation().is_some(), wanted && streams);
    }
    let mut scene = Scene::new(listening(), true, false);
    scene.act(|patch, effects| patch.start(now(1_000), effects));
    assert!(scene.patch.boards_to_configure(now(1_300).time) == [false] && scene.patch.check_set_up().is_ok());
}
