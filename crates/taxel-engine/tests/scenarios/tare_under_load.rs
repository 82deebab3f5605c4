//! A tare while a load arrives or leaves: what was moving while it was watched is no zero.

use crate::prelude::*;
use crate::say::tare;

/// The load comes and goes twice more, and all that was published since `mark` is true.
fn goes_on_truthfully(bench: &mut Bench, mark: usize, centre: u16, story: &str) {
    for _ in 0..2 {
        bench.world.clear();
        bench.seconds(3.0);
        bench.lay(0.5, centre);
        bench.seconds(2.0);
    }
    bench.is_truthful_since(mark, story);
    assert!(bench.host.snapshot().force.total.is_some(), "{story}: {}", bench.host.reasons());
    assert!((4.0..6.0).contains(&bench.weigh(10)), "{story}: half a kilogram");
}

/// Asks for a tare `before_s` before half a kilogram lands. Whether it was refused.
fn lands_after(skin: &Calibrated, before_s: f64, centre: u16) -> bool {
    let mut bench = skin.in_use();
    bench.seconds(1.0);
    let mark = bench.mark();
    let request = bench.host.command(tare());
    bench.seconds(before_s);
    bench.lay(0.5, centre);
    bench.seconds(3.0);
    let refused = bench.host.reply(request).expect("an answer").is_err();
    goes_on_truthfully(&mut bench, mark, centre, &format!("a tare {before_s} s before the load lands"));
    refused
}

fn leaves_after(skin: &Calibrated, before_s: f64, centre: u16) {
    let mut bench = skin.in_use();
    bench.seconds(1.0);
    bench.lay(0.5, centre);
    bench.seconds(3.0);
    let mark = bench.mark();
    let request = bench.host.command(tare());
    bench.seconds(before_s);
    bench.world.clear();
    bench.seconds(3.0);
    let reply = bench.host.reply(request).expect("an answer");
    assert!(matches!(reply, Err(Rejection::FailedPrecondition(..))), "{before_s} s before: {reply:?}");
    goes_on_truthfully(&mut bench, mark, centre, &format!("a tare {before_s} s before the load leaves"));
}

/// From 50 ms to a second before, on skins of small and of ordinary residues, and as in the demonstration.
#[test]
fn a_tare_shortly_before_a_load_lands_or_leaves_tells_no_lie() {
    let steps = || (1..=20).map(|step| 0.05 * f64::from(step));
    for before_s in steps() {
        // A scan is up to 100 ms old, and what lands after the last one changes nothing.
        let refused = lands_after(small(), before_s, 33);
        assert!(refused || before_s > 0.85, "a load that landed after {before_s} s was taken for rest");
        leaves_after(small(), before_s, 33);
    }
    for before_s in steps().step_by(3) {
        lands_after(ordinary(), before_s, 44);
        leaves_after(ordinary(), before_s, 44);
    }
    for before_s in [0.45, 0.75, 0.85] {
        lands_after(forearm(), before_s, 105);
        leaves_after(forearm(), before_s, 105);
    }
}
