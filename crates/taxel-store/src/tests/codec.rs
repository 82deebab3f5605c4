//! MODELS.json there and back.

use proptest::prelude::*;
use serde_json::{Value, json};
use taxel_engine::model_set::{Maker, Recalibrated, Recorded, RecordedTaxel};
use taxel_engine::recalibration::LoadPoint;
use taxel_model::{Curve, Flag, GaugeUncertainty, PLAYS, Plays, Sign, Status};

use super::fixture::*;
use crate::models_json::{ModelsJsonError, from_elsewhere, from_json, to_json};

/// Shortest digits that read back, and the sign of zero: equal text is equal bits, but for NaN.
fn bits(set: &ModelSet) -> String {
    format!("{set:?}")
}

/// A set with every part that there is.
fn whole_set() -> ModelSet {
    let set = model_set(1);
    let plays = Plays {
        range: [170.0, 240.0],
        sign: Sign::Falling,
        radii_counts: [1.0; PLAYS],
        weights_kpa: [0.1; PLAYS],
        slack_counts: 0.3,
    };
    let taxel = RecordedTaxel { sensitivity: 0.7, plays: Some(plays) };
    let recorded = Recorded {
        smooth_s: 0.2,
        plays_mean_s: 0.1,
        module_size: 10,
        zero_return_counts: Some(0.4),
        unloading_share: Some(0.03),
        plays_error_ratio: None,
        taxels: vec![Some(taxel), None, None, None],
    };
    let point = LoadPoint { number: 1, read: 4.7, read_sigma: 0.1, known: 4.9, known_sigma: 0.01 };
    let recalibrated = Recalibrated {
        derived_from: "m-1".to_owned(),
        earlier: vec!["m-0".to_owned()],
        area_mm2: 19.5,
        filled: true,
        gain: 1.04,
        gain_sigma: 0.02,
        place_rel: 0.05,
        relative_sigma: 0.03,
        gain_in_all: 1.04,
        points: vec![point],
    };
    let mut set = ModelSet { recorded: Some(recorded), recalibrated: Some(recalibrated), ..set };
    set.baseline[3] = TaxelBaseline::UNKNOWN;
    set.dead_zone_kpa = 0.3;
    set.taxels[1].gauge = GaugeUncertainty { gain_rel: 0.005, offset_kpa: 0.1, noise_kpa: 0.2 };
    let quality = &mut set.taxels[1].quality;
    (quality.repeatability_kpa, quality.interval_kpa, quality.interval_share) = (Some(0.1), Some(0.7), Some(0.95));
    set.maker.software = "taxeld 7".to_owned();
    with_id(set)
}

/// The names of all fields of a JSON text, those of a list's entries by its first one.
fn names(value: &Value) -> String {
    match value {
        Value::Object(fields) => {
            let fields: Vec<_> = fields.iter().map(|(name, value)| format!("{name}{}", names(value))).collect();
            format!("{{{}}}", fields.join(" "))
        }
        Value::Array(entries) => entries.first().map_or(String::new(), names),
        _ => String::new(),
    }
}

/// A name that changes here changes the id of every set.
#[test]
fn the_file_looks_as_documented() {
    let text = to_json(&whole_set()).unwrap();
    assert_eq!(text.lines().count(), 4 + 2, "one line for all, one per taxel");
    let file: Value = serde_json::from_str(&text).unwrap();
    assert_eq!((&file["format"], &file["version"]), (&json!("taxeld-models"), &json!(1)));
    assert_eq!(
        (&file["baseline"][2], &file["baseline"][3]),
        (&json!({"mean": 240.0 + 2.0 / 3.0, "noise": 0.7}), &Value::Null)
    );
    let curve = "curve{centre chebyshev half_width}";
    let recorded = "recorded{module_size plays_error_ratio plays_mean_s smooth_s \
                    taxels{plays{radii_counts range sign slack_counts weights_kpa} sensitivity} unloading_share zero_return_counts}";
    let quality = "quality{distinct_counts dof interval_kpa interval_share max_leverage rank repeatability_kpa rmse_kpa samples swing_counts}";
    let taxels = format!(
        "taxels{{coefficients {curve} flags gauge{{gain_rel noise_kpa offset_kpa}} order {quality} range \
         sigma{{first_count sigma_kpa step_counts}} sign status taxel}}"
    );
    let recalibrated = "recalibrated{area_mm2 derived_from earlier filled gain gain_in_all gain_sigma \
                        place_rel points{known known_sigma number read read_sigma} relative_sigma}";
    let all = format!(
        "{{baseline{{mean noise}} board_settings created_wall_ns dead_zone_kpa fitted_by format gauge_gain_rel gauge_offset_kpa id method patch \
         pressure_max_kpa {recalibrated} {recorded} session simulated {taxels} version}}"
    );
    assert_eq!(names(&file), all);
    let taxels = file["taxels"].as_array().unwrap();
    assert_eq!((&taxels[0]["taxel"], &taxels[0]["status"], &taxels[0]["order"]), (&json!(0), &json!("ok"), &json!(5)));
    assert_eq!((&taxels[0]["sign"], &taxels[1]["sign"]), (&json!("falling"), &json!("rising")));
    assert_eq!((&taxels[2]["status"], &taxels[2]["figures"]), (&json!("dead"), &json!({"count": 128.0})));
    assert_eq!((&taxels[2]["reason"], &taxels[3]["status"]), (&json!("the count stayed at 128"), &json!("no_data")));
}

#[test]
fn a_set_with_all_its_parts_comes_back_whatever_the_order_of_keys_and_white_space() {
    let text = to_json(&whole_set()).unwrap();
    let file: Value = serde_json::from_str(&text).unwrap();
    for text in [serde_json::to_string_pretty(&file).unwrap(), format!("\u{feff}{text}"), text] {
        assert_eq!(bits(&from_json(&text).unwrap()), bits(&whole_set()));
    }
}

/// Reads the good file after `change`, without its id unless it is kept.
fn changed(keep_id: bool, change: impl Fn(&mut Value)) -> Result<ModelSet, ModelsJsonError> {
    let mut file: Value = serde_json::from_str(&to_json(&model_set(1)).unwrap()).unwrap();
    if !keep_id {
        file.as_object_mut().unwrap().remove("id");
    }
    change(&mut file);
    from_json(&file.to_string())
}

#[test]
fn a_change_needs_a_new_id() {
    let method = |file: &mut Value| file["method"] = json!("by hand");
    let refused = changed(true, method).unwrap_err();
    assert!(refused.to_string().contains("remove `id` if that was meant"), "{refused}");
    let accepted = changed(false, method).unwrap();
    assert_eq!(accepted.method, "by hand");
    assert_ne!(accepted.id, model_set(1).id);
    assert_eq!(changed(false, |_| ()).unwrap().id, model_set(1).id);
}

#[test]
fn when_by_what_and_in_which_session_a_set_was_made_goes_with_it_and_is_no_part_of_its_id() {
    let set = model_set(1);
    let maker = Maker { software: "taxeld 7".to_owned(), simulated: true };
    let again = with_id(ModelSet { created_wall_ns: 77, session: None, maker, ..set.clone() });
    assert_eq!(again.id, set.id);
    assert_eq!(bits(&from_json(&to_json(&again).unwrap()).unwrap()), bits(&again));
}

#[test]
fn of_a_set_from_elsewhere_no_session_here_is_used() {
    let set = model_set(1);
    assert!(set.session.is_some());
    let imported = from_elsewhere(&to_json(&set).unwrap()).unwrap();
    assert_eq!(bits(&imported), bits(&ModelSet { session: None, ..set }));
    assert_eq!(bits(&from_elsewhere(&to_json(&imported).unwrap()).unwrap()), bits(&imported));
}

#[test]
fn what_contradicts_itself_is_refused_with_its_place() {
    type Change = fn(&mut Value);
    let cases: [(Change, &str); 21] = [
        (|f| f["format"] = json!("other"), "`format` is \"other\""),
        (|f| f["version"] = json!(2), "`version` is 2"),
        (|f| f["speed"] = json!(1), "unknown field `speed`"),
        (|f| f["taxels"][2]["gain"] = json!(2), "`taxels[2]`: unknown field `gain`"),
        (|f| f["patch"] = json!(""), "`patch` is empty"),
        (|f| f["method"] = json!("x".repeat(2049)), "a text of 2049 bytes, the limit is 2048"),
        (|f| f["taxels"] = json!([]), "`taxels` has 0 entries"),
        (|f| f["baseline"] = json!([null]), "`baseline` has 1 entries, expected 4"),
        (|f| f["baseline"][0] = json!(7), "`baseline[0]`: invalid type"),
        (|f| f["gauge_gain_rel"] = json!(-0.1), "`gauge_gain_rel` is -0.1"),
        (|f| f["taxels"][1]["taxel"] = json!(2), "`taxels`: entry 1 says that it is another `taxel`"),
        (
            |f| f["taxels"][1]["order"] = json!(4),
            "taxel 1: `curve` has 6 terms, `coefficients` has 6, and `order` is 4",
        ),
        (|f| f["taxels"][0]["coefficients"] = json!([1.0]), "taxel 0: `curve` has 6 terms, `coefficients` has 1"),
        (|f| f["taxels"][0]["coefficients"][0] = json!(3.5), "taxel 0: at count"),
        (|f| f["taxels"][0]["range"] = json!([200.0, 100.0]), "taxel 0: range[1] is 100"),
        (|f| f["taxels"][0]["range"] = Value::Null, "taxel 0: status is `ok` but the model has no range"),
        (|f| f["taxels"][0]["curve"] = Value::Null, "taxel 0: status is `ok` but the model has no curve"),
        (|f| f["taxels"][3]["order"] = json!(3), "taxel 3: `curve` has 0 terms"),
        (|f| f["taxels"][0]["sigma"] = Value::Null, "taxel 0: `sigma` has no values"),
        (|f| f["taxels"][0]["sigma"]["sigma_kpa"] = json!([]), "taxel 0: sigma.sigma_kpa has 0 entries"),
        (|f| f["taxels"][0]["sign"] = json!("rising"), "taxel 0: the curve is not monotone"),
    ];
    for (change, expected) in cases {
        let refused = changed(false, change).unwrap_err().to_string();
        assert!(refused.contains(expected), "{refused}, expected {expected}");
    }
}

/// What is said of a set whose first taxel has this curve and these coefficients over this range.
fn said(curve: &[f64], coefficients: &[f64], range: [f64; 2]) -> Result<(), String> {
    let mut set = model_set(1);
    let [low, high] = range;
    let (centre, half_width) = (f64::midpoint(low, high), (high - low) / 2.0);
    let of_any_shape = Flag::NotMonotone { count: low };
    set.taxels[0] = TaxelModel {
        order: coefficients.len() as u8 - 1,
        raw_coefficients: coefficients.to_vec(),
        range: Some(range),
        curve: Some(Curve { centre, half_width, chebyshev: curve.to_vec() }),
        flags: vec![of_any_shape],
        ..set.taxels[0].clone()
    };
    to_json(&with_id(set)).map(drop).map_err(|error| error.to_string())
}

#[test]
fn coefficients_of_another_polynomial_than_the_curve_are_refused_and_rounding_is_not() {
    assert_eq!(said(&[1.0, 0.0, 0.0], &[1.0, 0.0, 0.0], [1.0, 3.0]), Ok(()));
    assert_eq!(said(&[1000.0, 0.0], &[1000.0 + 2.2e-11, 0.0], [1.0, 3.0]), Ok(()));
    let at_both_ends = said(&[0.0, 0.0, 1.0], &[1.0, 0.0, 0.0], [1.0, 3.0]).unwrap_err();
    assert!(at_both_ends.contains("`coefficients` give 1 kPa and `curve` gives -0.7"), "{at_both_ends}");
    let in_the_middle_too = said(&[0.0; 4], &[-6.0, 11.0, -6.0, 1.0], [1.0, 3.0]);
    let by_little = said(&[1000.0, 0.0], &[1000.0 + 5e-11, 0.0], [1.0, 3.0]);
    // The sum overflows, and infinity is not further from anything than infinity.
    let overflow = said(&[0.0; 6], &[1e308; 6], [170.0, 240.0]);
    let overflow_both_ways = said(&[0.0; 6], &[1e308, -1e308, 1e308, -1e308, 1e308, -1e308], [170.0, 240.0]);
    for refused in [in_the_middle_too, by_little, overflow, overflow_both_ways] {
        assert!(refused.clone().unwrap_err().contains("not the same polynomial"), "{refused:?}");
    }
}

#[test]
fn a_zero_is_two_numbers_or_none() {
    let written = |mean, noise| {
        let mut set = model_set(1);
        set.baseline[0] = TaxelBaseline { mean, noise };
        to_json(&with_id(set)).is_ok()
    };
    assert!(written(240.0, 0.5) && written(240.0, 0.0) && written(f64::NAN, f64::NAN));
    for (mean, noise) in
        [(f64::NAN, 0.5), (240.0, f64::NAN), (240.0, -0.5), (f64::INFINITY, 0.5), (240.0, f64::INFINITY)]
    {
        assert!(!written(mean, noise), "{mean} {noise}");
    }
}

#[test]
fn a_number_that_is_not_finite_is_not_written() {
    type Change = fn(&mut TaxelModel);
    let cases: [(Change, &str); 5] = [
        (|m| m.quality.rmse_kpa = f64::NAN, "`taxels[1].quality.rmse_kpa`"),
        (|m| m.flags = vec![Flag::NotMonotone { count: f64::NAN }], "`taxels[1].flags[0]"),
        (|m| m.status = Status::Dead { count: f64::NAN }, "`taxels[1]`"),
        (|m| m.curve.as_mut().unwrap().chebyshev[2] = f64::NAN, "`taxels[1].curve.chebyshev"),
        (|m| m.sigma.as_mut().unwrap().sigma_kpa[0] = f64::INFINITY, "`taxels[1].sigma.sigma_kpa"),
    ];
    for (change, place) in cases {
        let mut set = model_set(1);
        change(&mut set.taxels[1]);
        let refused = to_json(&with_id(set)).unwrap_err().to_string();
        let says = ["null", place];
        assert!(says.iter().all(|says| refused.contains(says)), "{refused}, expected {says:?}");
    }
}

#[test]
fn every_status_and_flag_comes_back() {
    let flags = vec![
        Flag::RankReduced { asked: 7, used: 5 },
        Flag::FewDistinctCounts { distinct: 9, wanted: 40 },
        Flag::HighLeverage { count: 171.3, leverage: 0.1 + 0.2 },
        Flag::Dropouts { samples: u64::MAX },
        Flag::Gap { from: -0.0, to: 5e-324 },
        Flag::NotMonotone { count: 201.7 },
        Flag::Rejected { samples: 3 },
    ];
    for status in [
        Status::NoData,
        Status::NoExcitation { pressure_sd_kpa: 0.1 },
        Status::Dead { count: 128.0 },
        Status::InsufficientSwing { swing_counts: 1.0 / 3.0, needed_counts: 4.0 },
        Status::Unproven { samples: 17 },
        Status::PoorFit { rmse_kpa: f64::MAX, limit_kpa: 2.0 },
        Status::Ok,
    ] {
        let mut set = model_set(1);
        set.taxels[0] = TaxelModel { status, flags: flags.clone(), ..set.taxels[0].clone() };
        let set = with_id(set);
        assert_eq!(bits(&from_json(&to_json(&set).unwrap()).unwrap()), bits(&set));
    }
}

proptest! {
    #[test]
    fn every_fit_that_is_finite_can_be_written_and_read(
        samples in proptest::collection::vec((prop_oneof![0.0..255.0_f64, (0_u8..=255).prop_map(f64::from)], -5.0..200.0_f64), 0..60),
        order in 1_u8..=10, whole: bool, scale in prop_oneof![Just(1.0), Just(1e-9), Just(1e9)],
    ) {
        let counts: Vec<f64> = samples.iter().map(|s| if whole { s.0.round() } else { s.0 * scale }).collect();
        let pressure: Vec<f64> = samples.iter().map(|s| s.1).collect();
        let model = taxel_model::fit(&Samples::new(&counts, &pressure), &FitOptions { order, ..FitOptions::default() });
        let mut set = model_set(1);
        set.taxels[0] = model;
        let set = with_id(set);
        match to_json(&set) {
            Ok(text) => prop_assert_eq!(bits(&from_json(&text).unwrap()), bits(&set)),
            // A fit of samples that lie on one curve may have an infinite ratio of errors in its diagnostics.
            Err(error) => prop_assert!(error.to_string().contains("finite"), "{error}"),
        }
    }
}
