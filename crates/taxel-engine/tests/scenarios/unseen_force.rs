//! Force that no taxel can show: it is in the uncertainty, in the undetected force, or nothing bounds the force above.

use std::ops::Range;

use taxel_model::Status;

use crate::prelude::*;

/// The small skin in use with a model set that leaves these taxels out.
pub fn without(taxels: Range<usize>) -> Bench {
    let mut bench = small().in_use();
    let dead = |set: &mut ModelSet| {
        set.taxels[taxels].iter_mut().for_each(|model| model.status = Status::Dead { count: 0.0 });
    };
    bench.import(say::other_with("m-without", dead));
    bench.activate("m-without").unwrap();
    bench.until(2.0, "a force", |host| host.snapshot().force.total.is_some());
    bench.seconds(0.2);
    bench
}

/// Every force since `mark` has an uncertainty and an undetected force.
fn is_never_certain(bench: &Bench, mark: usize) {
    for snapshot in &bench.host.snapshots[mark..] {
        let force = &snapshot.force;
        assert!(force.total_sigma.is_none_or(|sigma| sigma.0 > 0.005), "{force:?}");
        assert!(force.undetected.is_none_or(|undetected| undetected.at_most().0 > 0.005), "{force:?}");
    }
}

/// The whole load lies on a module that the models do not cover.
fn carries_the_load(bench: &mut Bench, what: &str) {
    let mark = bench.mark();
    bench.world.lay(Mass::on_disc(0.5, TaxelIndex(35), 60.0)).unwrap();
    bench.seconds(3.0);
    is_never_certain(bench, mark);
    bench.is_truthful_since(mark, what);
    let force = &bench.host.snapshot().force;
    assert_eq!((force.state, force.unbounded), (ForceState::Degraded, true), "{what}: {force:?}");
    assert!(bench.host.reasons().contains("no upper bound"), "{what}: {}", bench.host.reasons());
}

#[test]
fn an_excluded_module_that_carries_the_whole_load_leaves_no_upper_bound() {
    carries_the_load(&mut without(30..40), "an excluded module");
    let mut bench = without(20..50);
    carries_the_load(&mut bench, "three excluded modules");
}

#[test]
fn a_faulty_module_that_carries_the_whole_load_leaves_no_upper_bound() {
    let mut bench = small().in_use();
    for taxel in 30..40 {
        bench.inject(Fault::TaxelFrozen(TaxelIndex(taxel)));
    }
    bench.seconds(8.0); // so long do readings have to stand still
    carries_the_load(&mut bench, "a frozen module");
}

#[test]
fn a_skin_of_which_nothing_is_usable_has_no_force() {
    let mut bench = small().in_use();
    for taxel in 0..80 {
        bench.inject(Fault::TaxelFrozen(TaxelIndex(taxel)));
    }
    bench.seconds(8.0);
    let mark = bench.mark();
    bench.lay(1.0, 35);
    bench.seconds(3.0);
    assert!(!bench.has_force_since(mark), "{:?}", bench.host.snapshot().force);
}

#[test]
fn a_single_excluded_taxel_under_a_load_is_within_the_interval() {
    for taxel in [33, 35, 39] {
        let mut bench = without(taxel..taxel + 1);
        let mark = bench.mark();
        bench.lay(0.5, 35);
        bench.seconds(3.0);
        bench.is_truthful_since(mark, &format!("taxel {taxel} excluded"));
    }
}
