//! Where each limit of what is asked of a patch lies, and when its boards are configured.

use taxel_sim::HOST_BOARD_CONFIG;
use taxel_skin::{Module, ModuleKind, Time};
use taxel_wire::icub::{StatusWord, TriangleConfig};

use super::owner::Patch;
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
    PatchPlan::new(crate::tests::patch(&[ModuleKind::Triangle]))
}

/// The same, with a board that has to be configured.
pub fn configuring() -> PatchPlan {
    let module = Module::new(0).unwrap();
    let triangle = TriangleConfig { first: module, last: module, shift: 2, enabled: true, cdc_offset: 0x2200 };
    let setup = BoardSetup { board: HOST_BOARD_CONFIG, triangles: vec![triangle] };
    PatchPlan { bring_up: vec![setup], ..listening() }
}

fn knowing(plan: PatchPlan, known: KeptZero) -> Patch {
    Patch::new(0, plan, Vec::new(), known, vec![false])
}

/// Whether anything is sent to the boards with the tick at this time.
fn sends(patch: &mut Patch, ms: i64) -> bool {
    patch.out.clear();
    patch.tick(now(ms));
    patch.out.iter().any(|output| matches!(output, Output::Send(..)))
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
        let mut patch = knowing(plan.clone(), known);
        patch.start(now(1_000));
        if streams {
            let heard = BoardNews::Heard(now(1_250).time, StatusWord(0));
            patch.with_intake(now(1_250), |intake, events| intake.on_news(0, &heard, events));
        }
        assert_eq!(patch.boards_to_configure(now(1_300).time), [wanted]);
        assert!(patch.check_set_up().is_err(), "it is still listened");
        patch.begin(now(1_300), &[wanted]);
        assert_eq!(sends(&mut patch, 1_300), wanted);
        // Something may have lain on a board that streamed.
        assert_eq!(patch.zero.needs_confirmation().is_some(), wanted && streams);
    }
    let mut patch = knowing(listening(), KeptZero::default());
    patch.set_models(force::tests::set(TAXELS));
    patch.start(now(1_000));
    assert!(patch.boards_to_configure(now(1_300).time) == [false] && patch.check_set_up().is_ok());
}
