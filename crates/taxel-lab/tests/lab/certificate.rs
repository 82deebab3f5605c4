//! Certificates of a skin whose figures can be worked out by hand: what reads P = 240 - C, and 2 kPa more while the
//! pressure falls.

use serde_json::Value;
use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::calibration::export::{sample_row, table_head};
use taxel_engine::calibration::{Branch, RampBaseline, Sample, SessionSamples, SessionView};
use taxel_engine::model_set::{Maker, ModelSet};
use taxel_engine::plan::PatchPlan;
use taxel_lab::certificate::{Certificate, Evidence, Stated};
use taxel_model::{Curve, GaugeUncertainty, SigmaProfile, Sign, Status, TaxelModel};
use taxel_proto::v1::{Load, Session, SessionState, Skin, TaxelLayout, Vector3};
use taxel_skin::{Board, BoardAddress, BusIndex, Module, ModuleKind, Patch};
use taxel_store::models_json;

/// Everything that evidence is made of.
struct Case {
    set: ModelSet,
    session: Session,
    samples: SessionSamples,
    plan: PatchPlan,
    view: SessionView,
    loads: Vec<Load>,
    stated: Stated,
}

fn line() -> TaxelModel {
    TaxelModel {
        status: Status::Ok,
        order: 1,
        raw_coefficients: vec![240.0, -1.0],
        sigma: Some(SigmaProfile { first_count: 160.0, step_counts: 80.0, sigma_kpa: vec![0.5; 2] }),
        sign: Sign::Falling,
        range: Some([160.0, 240.0]),
        curve: Some(Curve { centre: 200.0, half_width: 40.0, chebyshev: vec![40.0, -40.0] }),
        ..TaxelModel::without_curve(Status::Ok, GaugeUncertainty::default())
    }
}

fn zero(mean: f64) -> Vec<TaxelBaseline> {
    vec![TaxelBaseline { mean, noise: 0.5 }; 3]
}

/// Two ramps of 0 to 70 kPa and back, a kPa a scan and a scan a second; the first one at a zero one count higher.
/// Taxel 2 is dead.
fn case() -> Case {
    let mut samples = Vec::new();
    for ramp in 0..2_u16 {
        let rise = (0..=70).map(|kpa| (kpa, 0));
        for (kpa, hysteresis) in rise.chain((0..70).rev().map(|kpa| (kpa, 2))) {
            let count = (241 - kpa - hysteresis - i32::from(ramp)) as u16;
            let time_ns = samples.len() as i64 * 1_000_000_000;
            let counts = [count, count, 7].into();
            samples.push(Sample { ramp, time_ns, pressure_kpa: f64::from(kpa), counts });
        }
    }
    let begun = |ramp, taxels| RampBaseline { ramp, taxels, gauge_kpa: Some(0.0) };
    let ramps = vec![begun(0, zero(241.0)), begun(1, zero(240.0))];
    let dead = TaxelModel::without_curve(Status::Dead { count: 7.0 }, GaugeUncertainty::default());
    let set = ModelSet {
        patch: "palm".to_owned(),
        created_wall_ns: 1_700_000_000_000_000_000,
        session: Some(4),
        method: "order 1".to_owned(),
        board_settings: vec!["board 13".to_owned()],
        baseline: zero(240.0),
        pressure_max_kpa: 70.0,
        gauge_gain_rel: 0.001,
        taxels: vec![line(), line(), dead],
        maker: Maker::this(false),
        ..ModelSet::default()
    };
    let session = Session { session: 4, patch: "palm".to_owned(), target_kpa: 70.0, ..Session::default() };
    let samples = SessionSamples { ramps, samples };
    let modules = vec![(Module::from_nibble(0), ModuleKind::Cells(3))];
    let board = Board { bus: BusIndex(0), address: BoardAddress::new(13).unwrap(), modules };
    let plan = PatchPlan::new(Patch::new("palm", vec![board]).unwrap());
    let view = SessionView { branches: Branch::Both, ..SessionView::default() };
    Case { set, session, samples, plan, view, loads: Vec::new(), stated: Stated::default() }
}

fn certificate(case: &Case) -> anyhow::Result<Certificate> {
    let set = ModelSet { id: models_json::content_id(&case.set), ..case.set.clone() };
    let mut table = table_head(&case.plan, &case.view, &case.samples);
    for sample in &case.samples.samples {
        let counts = sample.counts.counts();
        let raw = counts.all().iter().map(|&raw| raw.into());
        table += &sample_row(sample.time_ns, sample.pressure_kpa, raw, u32::from(sample.ramp) + 1);
    }
    let mut session = case.session.clone();
    if session.model_set.is_empty() {
        session.model_set.clone_from(&set.id);
    }
    let evidence = Evidence::of(models_json::to_json(&set)?, table, case.stated.clone())?;
    // Three taxels of a flat skin, 10 mm apart.
    let vector = |x| Vector3 { x, ..Vector3::default() };
    let taxel = |x| TaxelLayout { position_m: Some(vector(x)), ..TaxelLayout::default() };
    let skin = Skin { taxels: [0.0, 0.01, 0.02].map(taxel).to_vec(), ..Skin::default() };
    Certificate::of(&evidence.with(session, case.loads.clone(), &skin))
}

fn json(case: &Case) -> Value {
    serde_json::from_str(&certificate(case).unwrap().to_json()).unwrap()
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
    off.stated.reference_expanded_uncertainty_kpa = Some(0.4);
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
    near(&all["ramps"][0]["zero_rms_counts"], 1.0);
    near(&all["ramps"][1]["rise_kpa_per_s"], 1.0);
    near(&all["ramps"][1]["fall_kpa_per_s"], -1.0);
    assert_eq!(all["ramps"][0]["scans_falling"], 70);
    let levels = all["levels"].as_array().unwrap();
    assert_eq!(levels.len(), 20);
    near(&levels[10]["error_kpa"], 2.0);
    near(&levels[10]["reference_kpa"], 3.0); // 0 to 6 kPa
    assert_eq!((&all["excluded"][0]["taxel"], &all["excluded"][0]["status"]), (&2.into(), &"dead".into()));
    assert_eq!(all["set"]["made"], "2023-11-14T22:13:20Z");
}

#[test]
fn known_loads_of_the_set_count_and_replaced_ones_do_not() {
    let mut case = case();
    let own = json(&case)["set"]["id"].as_str().unwrap().to_owned();
    let load = |number, read_n, model_set: &str, replaces| Load {
        load: number,
        model_set: model_set.to_owned(),
        force_n: 5.0,
        force_sigma_n: 0.4,
        read_n,
        read_sigma_n: 0.3,
        scans: 4,
        replaces,
        ..Load::default()
    };
    case.loads = vec![load(4, 7.0, &own, 0), load(3, 4.0, "m-0", 0), load(2, 5.5, &own, 1), load(1, 9.0, &own, 0)];
    let all = json(&case);
    let numbers: Vec<u64> =
        all["loads"].as_array().unwrap().iter().map(|load| load["load"].as_u64().unwrap()).collect();
    assert_eq!(numbers, [2, 4]);
    near(&all["loads"][0]["error_percent"], 10.0);
    near(&all["loads"][0]["normalised_error"], 0.5);
    near(&all["loads_summary"]["mean_absolute_error_percent"], 25.0);
    assert_eq!(all["loads_summary"]["within"], 1);
}

#[test]
fn the_same_evidence_gives_the_same_bytes_and_any_other_another_number() {
    let (one, other) = (certificate(&case()).unwrap(), certificate(&case()).unwrap());
    assert_eq!(one.to_json(), other.to_json());
    assert_eq!(one.to_html().unwrap(), other.to_html().unwrap());
    let mut changed = case();
    changed.samples.samples[5].counts = [234, 235, 7].as_slice().into();
    assert_ne!(one.number(), certificate(&changed).unwrap().number());
    assert_ne!(json(&case())["hashes"]["samples_csv"], json(&changed)["hashes"]["samples_csv"]);
}

#[test]
fn what_was_not_measured_or_stated_is_said_and_not_invented() {
    let mut case = case();
    case.view.branches = Branch::Rising;
    // The rise of the second ramp alone.
    case.samples.ramps.remove(0);
    case.samples.samples.drain(..141);
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
    let html = certificate(&case).unwrap().to_html().unwrap();
    assert_eq!(html.matches(">not stated</td>").count(), 16, "every line");
}

#[test]
fn the_page_draws_loads_and_curves_and_links_to_no_file_beside_it() {
    let mut case = case();
    let model_set = json(&case)["set"]["id"].as_str().unwrap().to_owned();
    let load =
        |load| Load { load, model_set: model_set.clone(), force_n: 5.0, read_n: 5.5, scans: 4, ..Load::default() };
    case.loads = vec![load(1)];
    let html = certificate(&case).unwrap().to_html().unwrap();
    assert!(html.matches("<svg").count() == 2 && html.contains("not determined"), "no chart of a single load: {html}");
    case.loads.push(load(2));
    let html = certificate(&case).unwrap().to_html().unwrap();
    assert_eq!(html.matches("<svg").count(), 3);
    let map = html.split("<svg").find(|svg| svg.contains("The skin laid flat")).unwrap();
    assert!(map.contains("fit error 1.4 to 1.6 kPa") && !map.contains("fit error 1 to"), "{map}");
    for part in ["Known loads as they were read", "read + 2 sigma", "taxel 0 (", "taxel 1 ("] {
        assert!(html.contains(part), "{part}: {html}");
    }
    assert!(!html.contains(".svg"), "{html}");
}

#[test]
fn what_is_stated_stands_there_and_can_do_nothing() {
    let mut case = case();
    case.stated.customer = Some("<script>alert(1)</script>".to_owned());
    case.stated.reference_expanded_uncertainty_kpa = Some(4.0);
    let html = certificate(&case).unwrap().to_html().unwrap();
    assert!(html.contains("&lt;script&gt;") && !html.contains("<script"), "{html}");
    near(&json(&case)["budget"][0]["taxel_kpa"], 2.0);
}

#[test]
fn a_set_that_is_not_of_these_samples_is_not_certified() {
    let refused = |change: fn(&mut Case), words: &str| {
        let mut case = case();
        change(&mut case);
        let why = format!("{:#}", certificate(&case).unwrap_err());
        assert!(why.contains(words), "{why}");
    };
    refused(|case| case.set.session = None, "not made of one session");
    refused(|case| case.set.baseline[1].mean += 0.25, "its zero is not the one");
    refused(|case| case.samples.samples.clear(), "not one usable row");
    refused(|case| case.set.taxels = vec![case.set.taxels[2].clone(); 3], "no usable taxel");
}

#[test]
fn a_set_that_is_no_longer_that_of_its_session_says_so() {
    let mut case = case();
    case.session.model_set = "m-2".to_owned();
    case.session.set_state(SessionState::Discarded);
    let limits = json(&case)["limits"].to_string();
    assert!(limits.contains("another model set of its own now (m-2)") && limits.contains("DISCARDED"), "{limits}");
}

#[test]
fn a_certificate_of_no_real_skin_says_so_first_and_cannot_be_signed() {
    let real = certificate(&case()).unwrap().to_html().unwrap();
    assert!(real.contains("signature") && !real.contains("SIMULATED"), "{real}");
    let (mut by_set, mut by_session) = (case(), case());
    by_set.set.maker = Maker::this(true);
    by_session.plan.simulated = true;
    for case in [by_set, by_session] {
        let html = certificate(&case).unwrap().to_html().unwrap();
        assert!(!html.contains("signature") && html.matches("SIMULATED OR REPLAYED").count() == 2, "{html}");
        let all = json(&case);
        assert_eq!(all["simulated"], true);
        assert!(all["limits"][0].as_str().unwrap().starts_with("Simulated or replayed"), "{}", all["limits"]);
    }
    assert_eq!(json(&case())["simulated"], false);
}
