//! A board that takes a new zero without a word, under a load: whatever lies on it would read as nothing.

use crate::prelude::*;

/// A board that may have taken a new zero and falls silent then has no part in the force: the check waits until it is
/// heard, and the other board's force comes meanwhile.
#[test]
fn the_check_of_a_silent_board_leaves_the_other_boards_their_force() {
    let mut bench = small().in_use_with(|plan| plan.live.stale_share_max = 0.3);
    bench.lay(0.5, 33);
    bench.seconds(3.0);
    bench.inject(Fault::ModuleNoAck(board(12), module(0)));
    bench.until(3.0, "the check", |host| host.reasons().contains("looked at"));
    bench.repair(Fault::ModuleNoAck(board(12), module(0)));
    bench.inject(Fault::BoardSilent(board(12)));
    let mark = bench.mark();
    bench.seconds(0.5);
    assert!(bench.host.snapshot().force.total.is_some(), "{}", bench.host.reasons());
    bench.repair(Fault::BoardSilent(board(12)));
    bench.until(1.0, "the check again", |host| host.snapshot().force.total.is_none());
    bench.until(2.0, "its end", |host| host.snapshot().force.total.is_some());
    bench.is_truthful_since(mark, "a silent suspect board");
}

#[test]
fn a_retare_in_a_ramp_fails_the_ramp_and_nothing_of_the_new_zero_is_in_the_session() {
    let ordinary = || World::new(small_skin(), Config::seeded(11));
    let worlds: [(&str, &dyn Fn() -> World); 2] = [("small residues", &small_world), ("ordinary", &ordinary)];
    for ((name, world), (kpa_per_s, kpa)) in
        worlds.into_iter().flat_map(|world| [(2.0, 3.0), (2.0, 6.0), (4.0, 4.0), (4.0, 8.0)].map(|at| (world, at)))
    {
        let mut bench = Bench::new(world(), plan(patch_plan(&small().skin)), Restored::default());
        bench.brought_up();
        let session = bench.start_session(None);
        bench.ramp(74.0, kpa_per_s);
        bench.until_pressure(kpa);
        let retare = bench.now();
        bench.inject(Fault::SilentRetare(board(12)));
        bench.seconds(5.0);
        let (view, story) = (bench.host.session(), format!("{name}: at {kpa} kPa and {kpa_per_s} kPa/s"));
        assert_eq!(view.state, SessionState::Failed, "{story}: {view:?}");
        assert!(view.reason.contains("board 12"), "{story}: {}", view.reason);
        let last = bench.host.samples(session).last().map(|sample| sample.time_ns);
        let limit = (retare + Duration::from_millis(10)).as_nanos();
        assert!(last.is_none_or(|last| last <= limit), "{story}: a sample {last:?} after {limit}");
        assert_ne!(bench.host.state(), ForceState::Ok);
    }
}

/// The gauge shows that the bag presses on, so a board that comes back without its load has taken a new zero under it.
#[test]
fn a_board_that_is_out_in_a_ramp_and_comes_with_a_new_zero_fails_the_ramp() {
    for skin in [small(), ordinary()] {
        let mut bench = skin.in_use();
        bench.start_session(None);
        bench.ramp(74.0, 2.0);
        bench.until_pressure(40.0);
        let mark = bench.mark();
        bench.inject(Fault::BoardSilent(board(13)));
        bench.seconds(0.7);
        bench.inject(Fault::SilentRetare(board(13)));
        bench.repair(Fault::BoardSilent(board(13)));
        bench.seconds(3.0);
        bench.is_truthful_since(mark, "a new zero of a board in a ramp");
        let view = bench.host.session();
        assert_eq!(view.state, SessionState::Failed, "{view:?}");
    }
}

/// Its load is gone when it comes back because the bag has let go, as the gauge shows.
#[test]
fn a_board_that_is_out_while_the_bag_is_vented_keeps_its_zero() {
    for skin in [small(), ordinary()] {
        let mut bench = skin.in_use();
        bench.ramp(40.0, 10.0);
        bench.seconds(6.0);
        let mark = bench.mark();
        bench.world.pump(PumpCommand::Vent);
        bench.seconds(0.6);
        bench.inject(Fault::BoardSilent(board(13)));
        bench.seconds(0.8);
        bench.repair(Fault::BoardSilent(board(13)));
        bench.until(3.0, "a force", |host| host.snapshot().force.total.is_some());
        bench.is_truthful_since(mark, "a board that is out while the bag is vented");
        assert!(bench.host.snapshot().tare.as_ref().unwrap().valid, "{}", bench.host.reasons());
    }
}
