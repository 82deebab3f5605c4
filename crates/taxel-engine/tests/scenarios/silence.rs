//! Invariant: a stale value never goes out as a good one.

use taxel_engine::snapshot::TaxelState;

use crate::host::SLOT;
use crate::prelude::*;

/// Taxels of module 2 of board 13.
const MODULE_2: std::ops::Range<usize> = 20..30;

/// Lets something fall silent; how long after its last frame that was published.
fn time_to_tell(bench: &mut Bench, taxel: usize, fault: Fault) -> Duration {
    bench.inject(fault);
    bench.until(1.0, "silence", |host| host.snapshot().taxels[taxel].stale);
    let published: Time = bench.host.published[bench.host.published.len() - 1];
    published.since(bench.host.snapshot().taxels[taxel].time)
}

fn has_no_value(state: &TaxelState) -> bool {
    state.stale && !state.active && state.pressure_kpa.is_none() && state.sigma_kpa.is_none()
}

#[test]
fn a_silent_module_leaves_the_sum_within_stale_after_and_a_tick() {
    let mut bench = small().in_use_with(|plan| plan.outputs.fill = false);
    bench.lay(0.5, 23);
    bench.seconds(1.0);
    assert_eq!(bench.host.state(), ForceState::Ok, "{}", bench.host.reasons());
    let before = bench.host.snapshot().force.clone();
    assert!(bench.host.snapshot().taxels[MODULE_2].iter().any(|t| t.active));
    let limit = bench.host.plan.patches[0].live.stale_after;
    let silent = time_to_tell(&mut bench, MODULE_2.start, Fault::ModuleSilent(board(13), module(2)));
    assert!(silent > limit && silent <= limit + SLOT, "told after {silent:?}, the limit is {limit:?}");
    let snapshot = bench.host.snapshot();
    assert_eq!(snapshot.force.state, ForceState::Degraded);
    assert!(snapshot.force.unbounded, "{:?}", snapshot.force);
    assert!(snapshot.force.why().starts_with("10 taxels are silent"), "{} {:?}", bench.host.reasons(), snapshot.force);
    assert!(snapshot.taxels[MODULE_2].iter().all(has_no_value), "{:?}", &snapshot.taxels[MODULE_2]);
    let (was, is) = (before.total.unwrap().0, snapshot.force.total.unwrap().0);
    assert!(is < 0.8 * was, "{was} N before, {is} N without the module under the load");
    bench.seconds(0.5); // and so it stays
    assert!(bench.host.snapshot().taxels[MODULE_2].iter().all(has_no_value));
    bench.repair(Fault::ModuleSilent(board(13), module(2)));
    bench.seconds(0.2);
    assert_eq!(bench.host.snapshot().force.stale, 0);
}

#[test]
fn a_silent_board_is_too_much_and_there_is_no_total() {
    let mut bench = small().in_use();
    bench.lay(0.5, 23);
    bench.seconds(0.5);
    let limit = bench.host.plan.patches[0].live.stale_after;
    let silent = time_to_tell(&mut bench, 60, Fault::BoardSilent(board(12)));
    assert!(silent <= limit + SLOT, "told after {silent:?}");
    bench.until_force(0.1, ForceState::Stale);
    assert_eq!(bench.host.reasons(), "20 of 80 taxels are silent");
    assert_eq!(bench.host.snapshot().force.total, None);
    bench.repair(Fault::BoardSilent(board(12)));
    // Whether it comes back with the zero that it had is not known before its counts have shown it over some 20 scans.
    let back = bench.now();
    bench.until_force(0.1, ForceState::TareInvalid);
    assert!(bench.host.reasons().contains("board 12 was not heard for 0.2"), "{}", bench.host.reasons());
    bench.until(2.0, "a force", |host| host.snapshot().force.total.is_some());
    assert_eq!(bench.host.state(), ForceState::Ok, "{}", bench.host.reasons());
    let waited = bench.now().since(back);
    assert!((Duration::from_millis(750)..Duration::from_millis(1250)).contains(&waited), "{waited:?}");
}

#[test]
fn when_everything_is_silent_the_state_is_stale_and_the_total_absent() {
    let mut bench = small().in_use();
    for address in [12, 13] {
        bench.inject(Fault::BoardSilent(board(address)));
    }
    bench.inject(Fault::GaugeSilent);
    let last = bench.host.snapshot().time;
    bench.until_force(0.3, ForceState::Stale);
    bench.seconds(3.0);
    let snapshot = bench.host.snapshot();
    assert_eq!((snapshot.force.state, snapshot.force.total, snapshot.force.stale), (ForceState::Stale, None, 80));
    assert!(snapshot.taxels.iter().all(has_no_value));
    assert!(snapshot.time.since(last) < Duration::from_millis(60), "the time stays that of the newest frame");
    // A skin that was never heard is not silently fine, either.
    let mut host = Host::new(bench.host.plan.clone(), small().restored(), bench.now());
    host.play(&[], bench.now() + Duration::from_secs(1), |n| n);
    assert_eq!((host.state(), host.snapshot().force.stale), (ForceState::Stale, 80), "{}", host.reasons());
}

/// A host that stood still has heard nothing for that time, which says nothing of the boards' power.
#[test]
fn a_pause_of_the_host_is_no_silence_of_the_boards() {
    let after_a_pause = |told: bool| {
        let mut bench = small().in_use();
        bench.passes = Box::new(|_| false);
        bench.seconds(3.0);
        bench.passes = Box::new(|_| true);
        if told {
            let now = bench.now();
            bench.host.input(now, Input::Resumed(Duration::from_secs(3)));
        }
        bench.seconds(0.2);
        bench.host.reasons()
    };
    assert!(after_a_pause(false).contains("may have lost its power"), "{}", after_a_pause(false));
    assert!(!after_a_pause(true).contains("may have lost its power"), "{}", after_a_pause(true));
}
