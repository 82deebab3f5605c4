//! What a fit makes of the samples of a session, with ramps whose zeros differ, and why there is none.

use std::sync::Arc;

use super::branch::Branch;
use super::calibration_plan::CalibrationPlan;
use super::job::FitJob;
use super::limits::SessionLimits;
use super::samples::{RampBaseline, Sample, SessionSamples};
use super::view::{SampleRefusal, SessionState};
use crate::baseline::TaxelBaseline;
use crate::intake::faults::limits::FaultLimits;
use crate::model_set::ModelSet;

const TAXELS: usize = 4;

/// Counts fall by two and a little more a kilopascal. Each ramp goes up to 60 kPa in 20 s, and down again if it `falls`,
/// from a zero of its own.
fn gathered(zeros: &[u8], falls: bool) -> SessionSamples {
    let mut all = SessionSamples::default();
    for (ramp, &zero) in (0..).zip(zeros) {
        let rest = TaxelBaseline { mean: f64::from(zero), noise: 0.5 };
        all.ramps.push(RampBaseline { ramp, taxels: vec![rest; TAXELS], gauge_kpa: Some(0.0) });
        let up = 0..=400_i64;
        let down = (0..if falls { 400 } else { 0 }).rev();
        for (k, step) in (0..).zip(up.chain(down)) {
            let pressure_kpa = 0.15 * step as f64;
            let count = |taxel: usize| f64::from(zero) - (2.0 + 0.1 * taxel as f64) * pressure_kpa;
            let counts: Vec<u8> = (0..TAXELS).map(|taxel| count(taxel).round() as u8).collect();
            let time_ns = (i64::from(ramp) * 100_000 + 50 * k) * 1_000_000;
            all.samples.push(Sample { ramp, time_ns, pressure_kpa, counts: counts.into() });
        }
    }
    all
}

fn job(samples: SessionSamples, branch: Branch) -> FitJob {
    let plan = CalibrationPlan {
        patch: "p".to_owned(),
        modules: vec![0..2, 2..4],
        taxels: TAXELS,
        session: SessionLimits::default(),
        fit: taxel_model::FitOptions::default(),
        faults: FaultLimits::default(),
        board_settings: vec!["as they are".to_owned()],
    };
    FitJob {
        session: 7,
        together: Vec::new(),
        fit: 1,
        wall_ns: 5,
        samples: Arc::new(samples),
        left_out: Vec::new(),
        recipe: plan.recipe(branch),
        patch: plan.patch,
        board_settings: plan.board_settings,
        modules: plan.modules,
    }
}

fn set(job: &FitJob) -> Arc<ModelSet> {
    job.run(|_| "m-1".to_owned()).result.unwrap()
}

#[test]
fn ramps_from_different_zeros_are_one_curve_about_the_zero_of_the_first() {
    for zeros in [[240, 230], [230, 240]] {
        let set = set(&job(gathered(&zeros, false), Branch::Rising));
        for (taxel, model) in set.taxels.iter().enumerate() {
            let at_30_kpa = f64::from(zeros[0]) - 30.0 * (2.0 + 0.1 * taxel as f64);
            let read = model.evaluate(at_30_kpa).unwrap().kpa;
            assert!((read - 30.0).abs() < 0.5 && model.quality.rmse_kpa < 0.5, "taxel {taxel}: {read} kPa, {model:?}");
        }
        assert_eq!(set.baseline[0].mean, f64::from(zeros[0]));
        assert_eq!((set.session, set.pressure_max_kpa, set.recorded.is_none()), (Some(7), 60.0, true));
    }
}

#[test]
fn what_a_zero_is_off_by_after_a_ramp_is_what_it_was_off_by_from_ramp_to_ramp() {
    let returned = |zeros: &[u8]| {
        let set = set(&job(gathered(zeros, true), Branch::Both));
        let recorded = set.recorded.as_ref().unwrap();
        (recorded.zero_return_counts, recorded.zero_return_common_counts.unwrap())
    };
    let near = |is: (f64, f64), expected: f64| {
        assert!((is.0 - expected).abs() < 1e-9 && (is.1 - expected).abs() < 1e-9, "{is:?} is not {expected}");
    };
    near(returned(&[240, 239]), 1.0);
    near(returned(&[240, 242, 242]), 2.0_f64.sqrt());
    near(returned(&[240, 230, 229]), 1.0); // a board that took a new zero is no return
    near(returned(&[240, 237]), 3.0);
    assert_eq!(
        returned(&[240]),
        (1.2, 0.9),
        "a ramp that does not end at rest tells nothing: what a recorded skin does"
    );
}

#[test]
fn modules_that_were_left_out_get_no_model_and_the_others_do() {
    let without = FitJob { left_out: vec![1], ..job(gathered(&[240], false), Branch::Rising) };
    let usable: Vec<bool> = set(&without).taxels.iter().map(taxel_model::TaxelModel::is_usable).collect();
    assert_eq!(usable, [true, true, false, false]);
}

#[test]
fn a_set_says_what_it_was_fitted_of() {
    let rising = job(gathered(&[240], false), Branch::Rising);
    assert_eq!(set(&rising).method, "order 5, pressure-binned");
    let both = job(gathered(&[240], true), Branch::Both);
    let several = FitJob { together: vec![3, 7], ..both.clone() };
    assert_eq!(set(&both).method, "order 5, pressure-binned, rising and falling");
    assert_eq!(set(&several).method, "order 5, pressure-binned, rising and falling, of sessions 3, 7 together");
}

#[test]
fn why_there_is_no_set_is_told() {
    let why = |samples: SessionSamples| job(samples, Branch::Rising).run(|_| String::new()).result.unwrap_err();
    let nothing = "no sample was gathered: the pressure never rose while every module was heard";
    assert_eq!(why(SessionSamples::default()), nothing);
    let mut still = gathered(&[240], false);
    still.samples.iter_mut().for_each(|sample| sample.counts = vec![240; TAXELS].into());
    let why = why(still);
    assert!(why.starts_with("none of the 4 taxels gives a usable model from 401 samples; taxel 0: "), "{why}");
}

#[test]
fn states_and_refusals_have_the_words_of_the_service() {
    for state in SessionState::ALL {
        assert_eq!(SessionState::from_name(state.name()), Some(state));
    }
    assert_eq!(SessionState::from_name("SLEEPING"), None);
    let words = SampleRefusal::ALL.map(SampleRefusal::name).join(" ");
    let expected =
        "not_rising too_fast no_pressure stale_module full gauge_spike not_falling zero_in_doubt gauge_stuck";
    assert_eq!(words, expected);
}
