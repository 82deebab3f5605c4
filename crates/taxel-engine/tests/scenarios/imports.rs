//! Model sets from elsewhere: what cannot be of this patch is refused, unless an operator insists.

use std::sync::Arc;

use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::command::{Command, Done, Rejection};
use taxel_engine::model_set::ModelSet;
use taxel_engine::snapshot::ForceState;
use taxel_model::TaxelModel;

use crate::bench::Bench;
use crate::rig::{patch_plan, plan, small_world};
use crate::shared::small;

/// The set of the small skin with one thing changed in the first taxel in use, and what a refusal names.
type Case = (fn(&mut TaxelModel), &'static str);

/// The same of a whole set.
type CaseOfSet = (fn(&mut ModelSet), &'static str);

fn scaled(model: &mut TaxelModel, by: f64) {
    let curve = model.curve.as_mut().unwrap();
    curve.chebyshev.iter_mut().chain(&mut model.raw_coefficients).for_each(|c| *c *= by);
}

fn changed(change: impl Fn(&mut TaxelModel)) -> Arc<ModelSet> {
    let mut set = ModelSet { id: "m-changed".to_owned(), session: None, ..ModelSet::clone(&small().set) };
    change(set.taxels.iter_mut().find(|model| model.is_usable()).unwrap());
    Arc::new(set)
}

fn refused(bench: &mut Bench, command: Command) -> String {
    match bench.ask(command) {
        Err(Rejection::InvalidArgument { field: "json", problem }) => problem,
        other => panic!("expected a refusal, got {other:?}"),
    }
}

#[test]
fn curves_that_cannot_be_of_the_patch_are_refused_unless_the_operator_insists() {
    let cases: [Case; 5] = [
        (|model| scaled(model, 1000.0), "its curve gives"),
        (|model| scaled(model, -1.0), "its curve gives"),
        (|model| scaled(model, 1e200), "its curve gives"),
        (|model| scaled(model, f64::MAX), "its curve gives"),
        // A curve that falls where it must rise, and stays within the pressures of the calibration.
        (
            |model| {
                let curve = model.curve.as_mut().unwrap();
                curve.chebyshev.iter_mut().skip(1).for_each(|c| *c = -*c);
            },
            "against its `sign`",
        ),
    ];
    for (change, why) in cases {
        let set = changed(change);
        let mut bench = Bench::new(small_world(), plan(patch_plan(&small().skin)), small().restored());
        let refused = refused(&mut bench, Command::Import { model_set: Arc::clone(&set), insist: false });
        assert!(refused.contains("taxel ") && refused.contains(why) && refused.contains("`insist`"), "{refused}");
        assert_eq!(bench.host.catalogue.model_sets.len(), 1, "what is refused has no effect");
        let taken = bench.ask(Command::Import { model_set: set, insist: true });
        assert!(matches!(taken, Ok(Done::Imported { .. })), "{taken:?}");
    }
}

#[test]
fn a_calibration_far_beyond_the_pressure_of_the_patch_is_refused() {
    for kpa in [0.0, -70.0, 7_000.0, f64::INFINITY] {
        let set = Arc::new(ModelSet { id: "m-far".to_owned(), pressure_max_kpa: kpa, ..ModelSet::clone(&small().set) });
        let mut bench = Bench::new(small_world(), plan(patch_plan(&small().skin)), small().restored());
        let refused = refused(&mut bench, Command::Import { model_set: set, insist: false });
        assert!(refused.contains("`pressure_max_kpa` is") && refused.contains("700"), "{refused}");
    }
}

#[test]
fn what_this_skin_was_calibrated_to_is_taken_as_it_is() {
    let mut bench = Bench::new(small_world(), plan(patch_plan(&small().skin)), small().restored());
    let taken = bench.ask(Command::Import { model_set: changed(|_| ()), insist: false });
    assert!(matches!(taken, Ok(Done::Imported { .. })), "{taken:?}");
}

/// As a fit of a table without a scan at rest.
#[test]
fn a_set_without_a_zero_takes_it_from_the_next_confirmed_tare() {
    let mut set = ModelSet { id: "m-changed".to_owned(), session: None, ..ModelSet::clone(&small().set) };
    set.baseline.iter_mut().for_each(|rest| *rest = TaxelBaseline::UNKNOWN);
    let mut bench = small().in_use();
    bench.ask(Command::Import { model_set: Arc::new(set), insist: false }).unwrap();
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

/// Whoever insists gets no force that nobody would doubt: what says that it may be off by more than a number holds is none.
#[test]
fn a_set_whose_uncertainty_is_no_number_has_no_force() {
    let cases: [CaseOfSet; 2] = [
        (|set| set.baseline.iter_mut().for_each(|rest| rest.noise = 1e30), "its `baseline` has a noise of"),
        (|set| set.baseline[0].mean = 1e308, "its `baseline` is"),
    ];
    for (change, why) in cases {
        let mut set = ModelSet { id: "m-changed".to_owned(), session: None, ..ModelSet::clone(&small().set) };
        change(&mut set);
        let set = Arc::new(set);
        let mut bench = small().in_use();
        let refused = refused(&mut bench, Command::Import { model_set: Arc::clone(&set), insist: false });
        assert!(refused.contains(why), "{refused}");
        bench.ask(Command::Import { model_set: set, insist: true }).unwrap();
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
