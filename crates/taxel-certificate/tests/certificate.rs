//! Certificates of a skin whose figures can be worked out by hand: what reads P = 240 - C, and 2 kPa more while the
//! pressure falls.

#![allow(clippy::unwrap_used)] // clippy exempts only functions that are tests themselves

use std::sync::Arc;

use serde_json::Value;
use taxel_certificate::{Certificate, Entered, Evidence};
use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::calibration::export::About;
use taxel_engine::calibration::{Branch, RampBaseline, Sample, SessionSamples, SessionState, SessionView};
use taxel_engine::loads::{Load, Reading};
use taxel_engine::model_set::{Maker, ModelSet};
use taxel_model::{Curve, GaugeUncertainty, Sign, Status, TaxelModel};

/// Everything that evidence borrows.
struct Case {
    set: ModelSet,
    session: SessionView,
    samples: SessionSamples,
    about: About,
    loads: Vec<Arc<Load>>,
    entered: Entered,
    places: Vec<String>,
}

fn line() -> TaxelModel {
    TaxelModel {
        status: Status::Ok,
        order: 1,
        sign: Sign::Falling,
        range: Some([160.0, 240.0]),
        curve: Some(Curve { centre: 200.0, half_width: 40.0, chebyshev: vec![40.0, -40.0] }),
        ..TaxelModel::without_curve(Status::Ok, GaugeUncertainty::default())
    }
}

fn zero(mean: f64) -> Vec<TaxelBaseline> {
    vec![TaxelBaseline { mean, noise: 0.5 }; 3]
}

/// Two ramps of 0 to 70 kPa and back, a kPa a scan and a scan a second; the second one at a zero one count higher.
/// Taxel 2 is dead.
fn case() -> Case {
    let mut samples = Vec::new();
    for ramp in 0..2_u16 {
        let rise = (0..=70).map(|kpa| (kpa, 0));
        for (kpa, hysteresis) in rise.chain((0..70).rev().map(|kpa| (kpa, 2))) {
            let count = (240 - kpa - hysteresis + i32::from(ramp)) as u8;
            let time_ns = samples.len() as i64 * 1_000_000_000;
            let counts = [count, count, 7].as_slice().into();
            samples.push(Sample { ramp, time_ns, pressure_kpa: f64::from(kpa), counts });
        }
    }
    let begun = |ramp, taxels| RampBaseline { ramp, taxels, gauge_kpa: Some(0.0) };
    let ramps = vec![begun(0, zero(240.0)), begun(1, zero(241.0))];
    let dead = TaxelModel::without_curve(Status::Dead { count: 7.0 }, GaugeUncertainty::default());
    let set = ModelSet {
        id: "m-1".to_owned(),
        patch: "palm".to_owned(),
        created_wall_ns: 1_700_000_000_000_000_000,
        session: Some(4),
        method: "order 1".to_owned(),
        board_settings: vec!["board 13".to_owned()],
        baseline: zero(240.0),
        pressure_max_kpa: 70.0,
        gauge_gain_rel: 0.001,
        gauge_offset_kpa: 0.0,
        taxels: vec![line(), line(), dead],
        recorded: None,
        recalibrated: None,
        maker: Maker::this(false),
    };
    let session = SessionView {
        number: 4,
        patch: "palm".to_owned(),
        state: SessionState::Active,
        started_wall_ns: 1_700_000_000_000_000_000,
        branches: Branch::Both,
        target_kpa: 70.0,
        model_set: Some("m-1".into()),
        ..SessionView::default()
    };
    let places = (0..3).map(|taxel| format!("board 13 module 0 taxel {taxel}")).collect();
    let samples = SessionSamples { ramps, samples };
    let about = About { modules: std::iter::once(0..3).collect(), ..About::default() };
    Case { set, session, samples, about, loads: Vec::new(), entered: Entered::default(), places }
}

fn certificate(case: &Case) -> Result<Certificate, String> {
    Certificate::of(&Evidence {
        set: &case.set,
        models_json: "{}",
        session: &case.session,
        samples: &case.samples,
        about: &case.about,
        loads: &case.loads,
        entered: &case.entered,
        places: &case.places,
        left_out: &[],
        software: "taxeld test",
    })
}

fn json(case: &Case) -> Value {
    serde_json::from_str(&certificate(case).unwrap().to_json().unwrap()).unwrap()
}

fn near(value: &Value, want: f64) {
    let got = value.as_f64().unwrap_or(f64::NAN);
    assert!((got - want).abs() < 1e-12 * want.abs().max(1.0), "{got}, expected {want}");
}

/// A gauge that reads half a kPa at rest before the first ramp, and a quarter below nothing before the second.
#[test]
fn what_the_gauge_reads_at_rest_is_taken_off_and_stays_in_the_budget() {
    let mut off = case();
    let zeros = [0.5, -0.25];
    off.samples.samples.iter_mut().for_each(|sample| sample.pressure_kpa += zeros[usize::from(sample.ramp)]);
    off.samples.ramps.iter_mut().zip(zeros).for_each(|(ramp, zero)| ramp.gauge_kpa = Some(zero));
    off.entered.reference_expanded_uncertainty_kpa = Some(0.4);
    let (off, plain) = (json(&off), json(&case()));
    assert_eq!(off["taxels"][0]["rmse_kpa"], plain["taxels"][0]["rmse_kpa"]);
    assert_eq!(off["levels"], plain["levels"]);
    near(&off["ramps"][0]["gauge_zero_kpa"], 0.5);
    near(&off["ramps"][1]["gauge_zero_kpa"], -0.25);
    near(&off["ramps"][1]["top_kpa"], 70.0);
    near(&off["budget"][0]["taxel_kpa"], 0.2_f64.hypot(0.5 / 3.0_f64.sqrt()));
}

#[test]
fn the_figures_are_those_of_the_hand() {
    let all = json(&case());
    let taxel = &all["taxels"][0];
    let rmse = (4.0 * 70.0 / 141.0_f64).sqrt(); // 70 of 141 scans of a ramp are 2 kPa off
    near(&taxel["rmse_kpa"], rmse);
    near(&taxel["bias_kpa"], 140.0 / 141.0);
    near(&taxel["max_error_kpa"], 2.0);
    near(&taxel["hysteresis_kpa"], 2.0);
    near(&taxel["hysteresis_percent"], 2.5); // of the 80 kPa of the curve
    near(&taxel["repeatability_kpa"], 0.0);
    near(&taxel["linearity_percent"], 0.0);
    near(&taxel["sensitivity_counts_per_kpa"], 1.0);
    near(&taxel["zero_shift_counts"], 1.0);
    near(&taxel["outside_share"], 0.0);
    near(&taxel["lower_limit_kpa"], 2.4 * (4.0 * 140.0 / 280.0_f64).sqrt());
    let (reference, zero) = (0.07, 1.0 / 3.0_f64.sqrt());
    near(&taxel["expanded_uncertainty_kpa"], 2.0 * (reference * reference + rmse * rmse + zero * zero).sqrt());
    near(&all["expanded"]["mean_kpa"], 2.0 * (reference * reference + rmse * rmse + zero * zero).sqrt());
    near(&all["ramps"][1]["zero_rms_counts"], 1.0);
    near(&all["ramps"][1]["rise_kpa_per_s"], 1.0);
    near(&all["ramps"][1]["fall_kpa_per_s"], -1.0);
    assert_eq!(all["ramps"][0]["scans_falling"], 70);
    let levels = all["levels"].as_array().unwrap();
    assert_eq!(levels.len(), 20);
    near(&levels[10]["error_kpa"], 2.0);
    near(&levels[10]["reference_kpa"], 3.0); // 0 to 6 kPa
    assert_eq!((&all["excluded"][0]["taxel"], &all["excluded"][0]["status"]), (&2.into(), &"dead".into()));
    assert_eq!(all["session"]["started"], "2023-11-14T22:13:20Z");
}

#[test]
fn known_loads_of_the_set_count_and_replaced_ones_do_not() {
    let mut case = case();
    let load = |number, read_n, model_set: &str, replaces| {
        let read = Reading { scans: 4, mean_n: read_n, sigma_n: 0.3, scatter_n: 0.0, ..Reading::default() };
        let model_set = model_set.to_owned();
        let laid = Load { number, force_n: 5.0, force_sigma_n: 0.4, area_factor: 1.0, read, ..Load::default() };
        Arc::new(Load { model_set, replaces, ..laid })
    };
    case.loads = vec![
        load(1, 9.0, "m-1", None),
        load(2, 5.5, "m-1", Some(1)),
        load(3, 4.0, "m-0", None),
        load(4, 7.0, "m-1", None),
    ];
    let all = json(&case);
    let numbers: Vec<u64> =
        all["loads"].as_array().unwrap().iter().map(|load| load["load"].as_u64().unwrap()).collect();
    assert_eq!(numbers, [2, 4]);
    near(&all["loads"][0]["error_percent"], 10.0);
    near(&all["loads"][0]["normalised_error"], 0.5);
    near(&all["loads_summary"]["mean_absolute_error_percent"], 25.0);
    assert_eq!((&all["loads_summary"]["within"], &all["loads_summary"]["area_factor"]), (&1.into(), &Value::Null));
}

/// As `GetValidation` has it: a fault and the filling are no property of the skin, and other areas are another skin.
#[test]
fn a_load_that_says_nothing_of_the_areas_has_no_say_in_their_factor() {
    let mut case = case();
    let load = |number, read_n: f64, change: &dyn Fn(&mut Load)| {
        let read = Reading { scans: 4, mean_n: read_n, sigma_n: 0.1, scatter_n: 0.01, ..Reading::default() };
        let (model_set, filled) = ("m-1".to_owned(), Some(true));
        let mut load = Load { number, model_set, filled, force_n: 5.0, area_factor: 1.0, read, ..Load::default() };
        (load.mean_area_mm2, load.force_sigma_n) = (20.0, 0.01);
        change(&mut load);
        Arc::new(load)
    };
    case.loads = vec![
        load(1, 9.0, &|load| load.mean_area_mm2 = 40.0),
        load(2, 9.0, &|load| load.filled = Some(false)),
        load(3, 4.0, &|load| load.read.reasons = vec!["2 taxels have a fault".to_owned()]),
        load(4, 4.0, &|load| load.read.filled_share = 0.21),
        load(5, 4.0, &|load| load.read.out_of_range = 1),
        load(6, 5.0, &|_| ()),
        load(7, 5.0, &|_| ()),
        load(8, 5.0, &|_| ()),
    ];
    let all = json(&case);
    let said = |key: &str| -> Vec<bool> {
        all["loads"].as_array().unwrap().iter().map(|load| !load[key].as_str().unwrap().is_empty()).collect()
    };
    assert_eq!(said("outdated_because"), [true, true, false, false, false, false, false, false]);
    assert_eq!(said("left_out_because"), [false, false, true, true, true, false, false, false]);
    let summary = &all["loads_summary"];
    assert_eq!((&summary["loads"], &summary["in_factor"]), (&6.into(), &3.into()));
    near(&summary["area_factor"], 1.0);
    near(&summary["mean_absolute_error_percent"], 10.0);
    let html = certificate(&case).unwrap().to_html();
    assert!(html.contains("does not count: the configured areas were 40.000 mm2"), "{html}");
    assert!(html.contains("not in the factor: the force had a shortcoming: 2 taxels have a fault"), "{html}");
}

#[test]
fn the_same_evidence_gives_the_same_bytes_and_any_other_another_number() {
    let (one, other) = (certificate(&case()).unwrap(), certificate(&case()).unwrap());
    assert_eq!((one.to_json(), one.to_html()), (other.to_json(), other.to_html()));
    let mut changed = case();
    changed.samples.samples[5].counts = [234, 235, 7].as_slice().into();
    let changed = certificate(&changed).unwrap();
    assert_ne!(one.number(), changed.number());
    let (one, changed): (Value, Value) =
        [one, changed].map(|c| serde_json::from_str(&c.to_json().unwrap()).unwrap()).into();
    assert_ne!(one["hashes"]["samples_csv"], changed["hashes"]["samples_csv"]);
}

#[test]
fn what_was_not_measured_or_stated_is_said_and_not_invented() {
    let mut case = case();
    case.session.branches = Branch::Rising;
    case.samples.ramps.truncate(1);
    case.samples.samples.truncate(71);
    let all = json(&case);
    let taxel = &all["taxels"][0];
    for figure in ["hysteresis_kpa", "hysteresis_percent", "repeatability_kpa", "zero_shift_counts"] {
        assert_eq!(taxel[figure], Value::Null, "{figure}");
    }
    near(&taxel["expanded_uncertainty_kpa"], 0.14);
    let limits = all["limits"].to_string();
    for words in ["Rising pressure only", "A single ramp", "Traceability", "temperature", "1 of 3 taxels (33.3 %)"] {
        assert!(limits.contains(words), "{words}: {limits}");
    }
    assert!(all["stated"].as_object().unwrap().values().all(Value::is_null));
    let html = certificate(&case).unwrap().to_html();
    assert_eq!(html.matches(">not stated</dd>").count(), 13, "every line but environment, patch and date");
}

#[test]
fn what_is_stated_stands_there_and_can_do_nothing() {
    let mut case = case();
    case.entered.customer = Some("<script>alert(1)</script>".to_owned());
    case.entered.reference_expanded_uncertainty_kpa = Some(4.0);
    let html = certificate(&case).unwrap().to_html();
    assert!(html.contains("&lt;script&gt;") && !html.contains("<script"), "{html}");
    near(&json(&case)["budget"][0]["taxel_kpa"], 2.0);
}

#[test]
fn a_set_that_is_not_of_these_samples_is_not_certified() {
    let refused = |change: fn(&mut Case), words: &str| {
        let mut case = case();
        change(&mut case);
        let why = certificate(&case).unwrap_err();
        assert!(why.contains(words), "{why}");
    };
    refused(|case| case.set.session = None, "not made of one session");
    refused(|case| case.set.session = Some(5), "session 5");
    refused(|case| case.set.baseline[1].mean += 0.25, "its zero is not the one");
    refused(|case| case.samples.samples.clear(), "no sample");
    refused(|case| case.samples.samples[3].counts = [1, 2].as_slice().into(), "another number of taxels");
    refused(|case| case.set.taxels.iter_mut().for_each(|taxel| taxel.curve = None), "no usable taxel");
}

#[test]
fn a_set_that_is_no_longer_that_of_its_session_says_so() {
    let mut case = case();
    case.session.model_set = Some("m-2".into());
    case.session.state = SessionState::Discarded;
    let limits = json(&case)["limits"].to_string();
    assert!(limits.contains("another model set of its own now (m-2)") && limits.contains("DISCARDED"), "{limits}");
}

#[test]
fn a_certificate_of_no_real_skin_says_so_first_and_cannot_be_signed() {
    let real = certificate(&case()).unwrap();
    assert!(real.to_html().contains("signature") && !real.to_html().contains("SIMULATED"), "{}", real.to_html());
    assert!(real.to_html().contains("<dt>Models fitted by</dt><dd>taxeld "), "{}", real.to_html());
    let (mut by_set, mut by_plan) = (case(), case());
    by_set.set.maker = Maker::this(true);
    by_plan.about.simulated = true;
    for case in [by_set, by_plan] {
        let html = certificate(&case).unwrap().to_html();
        assert!(!html.contains("signature") && html.matches("SIMULATED OR REPLAYED").count() == 2, "{html}");
        assert!(html.contains("<title>SIMULATED"), "{html}");
        let all = json(&case);
        assert_eq!(all["simulated"], true);
        assert!(all["limits"][0].as_str().unwrap().starts_with("Simulated or replayed"), "{}", all["limits"]);
    }
    assert_eq!(json(&case())["simulated"], false);
}
