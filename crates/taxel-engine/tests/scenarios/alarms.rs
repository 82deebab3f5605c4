//! An alarm that is always on is ignored: only what touches the total degrades it.

use crate::prelude::*;
use crate::unseen_force::without;

/// From now on taxel 30, the first of module 3 of board 13, reads 0 in every second scan.
fn flickers_on_its_rail(bench: &mut Bench) {
    let mut scan = 0;
    bench.alters = Box::new(move |timed: &mut TimedFrame| {
        let frame = timed.frame;
        let [0x40, _, rest @ ..] = frame.bytes() else { return };
        if frame.id == CanId::Standard(0x4D3) {
            scan += 1;
            let head: Vec<u8> = [0x40, if scan % 2 == 0 { 0 } else { 240 }].iter().chain(rest).copied().collect();
            timed.frame = Frame::data(frame.id, &head).unwrap();
        }
    });
}

#[test]
fn an_excluded_taxel_that_flickers_on_its_rail_degrades_nothing() {
    for (load, what) in [(None, "unloaded"), (Some(14), "a load beside it"), (Some(35), "a load on it")] {
        let mut bench = without(30..31);
        if let Some(centre) = load {
            bench.lay(0.5, centre);
            bench.seconds(1.0);
        }
        assert_eq!(bench.host.state(), ForceState::Ok, "{what}: {}", bench.host.reasons());
        flickers_on_its_rail(&mut bench);
        let mark = bench.mark();
        bench.seconds(3.0);
        let counts: Vec<u16> = bench.host.snapshots[mark..].iter().map(|s| s.taxels[30].count).collect();
        assert!(counts.iter().filter(|count| **count == 0).count() > 20, "it flickers: {counts:?}");
        let degraded = bench.host.snapshots[mark..].iter().filter(|s| s.force.state != ForceState::Ok).count();
        assert_eq!(degraded, 0, "{what}: {}", bench.host.reasons());
        bench.is_truthful_since(mark, what);
    }
}

#[test]
fn a_taxel_of_the_sum_that_flickers_under_a_load_degrades_it_and_far_from_it_does_not() {
    for (centre, degrades) in [(35, true), (70, false)] {
        let mut bench = small().in_use();
        bench.lay(0.5, centre);
        flickers_on_its_rail(&mut bench);
        bench.seconds(2.0);
        let mark = bench.mark();
        bench.seconds(3.0);
        let degraded = bench.host.snapshots[mark..].iter().filter(|s| s.force.state == ForceState::Degraded).count();
        assert_eq!(degraded > 0, degrades, "{degraded} snapshots, a load at {centre}: {}", bench.host.reasons());
        bench.is_truthful_since(mark, "a taxel that flickers");
    }
}

/// Found by the simulation, seed 1280006: a converter that flickers by less than would be told for its taxels, for as long as it
/// likes, and a force of one newton where nothing lies.
#[test]
fn a_module_that_flickers_by_a_little_makes_the_force_on_it_uncertain() {
    for (probability, depth_counts) in [(0.15, 6.4), (0.05, 7.0), (0.4, 5.0)] {
        let mut bench = small().in_use();
        bench.inject(Fault::ModuleFlicker { board: board(13), module: module(1), probability, depth_counts });
        bench.seconds(5.0);
        let mark = bench.mark();
        bench.seconds(20.0);
        let touched = bench.host.snapshots[mark..].iter().filter(|s| s.force.active > 5).count();
        assert!(touched > 10, "it reads as touched now and then, by {depth_counts} counts: {touched} snapshots");
        bench.is_truthful_since(mark, &format!("{probability} {depth_counts}"));
        let told = bench.host.health().boards[0].warnings.join("; ");
        assert!(told.contains("module 1 jumps by"), "{told}");
    }
}
