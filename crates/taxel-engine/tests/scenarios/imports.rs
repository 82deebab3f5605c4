//! Model sets from elsewhere: what cannot be of this patch is refused, unless an operator insists.

use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::snapshot::ForceState;

use crate::prelude::*;
use crate::say::other_with;

/// The set of the small skin with something changed, and what a refusal names.
type Case = (fn(&mut ModelSet), &'static str);

fn refused(bench: &mut Bench, command: Command) -> String {
    match bench.ask(command) {
        Err(Rejection::InvalidArgument { field: "json", problem }) => problem,
        other => panic!("expected a refusal, got {other:?}"),
    }
}

/// As a fit of a table without a scan at rest.
#[test]
fn a_set_without_a_zero_takes_it_from_the_next_confirmed_tare() {
    let unknown = |set: &mut ModelSet| set.baseline.iter_mut().for_each(|rest| *rest = TaxelBaseline::UNKNOWN);
    let mut bench = small().in_use();
    bench.import(other_with("m-changed", unknown));
    bench.activate("m-changed").unwrap();
    bench.until_force(2.0, ForceState::TareInvalid);
    let reasons = format!("{:?}", bench.host.snapshot().force.reasons);
    assert!(reasons.contains("taxeld tare --confirmed-by NAME"), "{reasons}");
    let refused = format!("{:?}", bench.tare(None));
    assert!(refused.contains("no calibration to compare with") && refused.contains("--confirmed-by"), "{refused}");
    bench.tare(Some("Ada")).unwrap();
    bench.until_force(2.0, ForceState::Ok);
    let laid = bench.lay(0.5, 33);
    bench.seconds(3.0);
    let read = bench.host.snapshot().force.total.unwrap();
    assert!((read.0 / laid.0 - 1.0).abs() < 0.3, "{read:?} of {laid:?}");
    // From then on the skin can show rest by itself, and does not under the load.
    assert!(format!("{:?}", bench.tare(None)).contains("TareLoaded"));
}

/// An operator who insists gets no force without a warning: what says that it may be off by more than a number holds is none.
#[test]
fn a_set_that_cannot_be_of_the_patch_is_refused_and_one_whose_uncertainty_is_no_number_has_no_force() {
    let scaled = |set: &mut ModelSet| {
        set.taxels.iter_mut().for_each(|model| model.points = model.scaled(1000.0, 0.0).points);
    };
    let cases: [Case; 3] = [
        (scaled, "its curve gives"),
        (|set| set.baseline.iter_mut().for_each(|rest| rest.noise = 1e30), "its `baseline` has a noise of"),
        (|set| set.baseline[0].mean = 1e308, "its `baseline` is"),
    ];
    for (n, (change, why)) in cases.into_iter().enumerate() {
        let set = other_with("m-changed", change);
        let mut bench = small().in_use();
        let refused = refused(&mut bench, Command::Import { model_set: Arc::clone(&set), insist: false });
        assert!(refused.contains("taxel ") && refused.contains(why) && refused.contains("`insist`"), "{refused}");
        assert_eq!(bench.host.catalogue.model_sets.len(), 1, "what is refused has no effect");
        bench.ask(Command::Import { model_set: set, insist: true }).unwrap();
        if n == 0 {
            continue; // its force is as wrong as the operator insists on
        }
        bench.activate("m-changed").unwrap();
        let mark = bench.mark();
        bench.host.command(Command::Tare { patch: String::new(), confirmed_by: Some("Ada".to_owned()) });
        bench.seconds(2.0);
        bench.lay(0.5, 33);
        bench.seconds(3.0);
        bench.is_truthful_since(mark, why);
        let force = &bench.host.snapshot().force;
        let numbers = [force.total, force.total_sigma, force.most(1.0)];
        let all = numbers.iter().all(|n| n.is_some_and(|n| n.0.is_finite()));
        assert!(all || numbers.iter().all(Option::is_none), "{why}: {force:?}");
    }
}
