//! MODELS.json there and back.

use proptest::prelude::*;
use serde_json::{Value, json};
use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::model_set::{Maker, ModelSet};
use taxel_model::{
    Curve, Estimator, FitOptions, Flag, GaugeUncertainty, Order, Quality, Samples, SigmaProfile, Status, TaxelModel,
};

use super::fixture::{model_set, with_id};
use crate::models_json::{ModelsJsonError, from_elsewhere, from_json, to_json};

/// Shortest digits that read back, and the sign of zero: equal text is equal bits, but for NaN.
fn bits(set: &ModelSet) -> String {
    format!("{set:?}")
}

#[test]
fn the_file_looks_as_documented() {
    let text = to_json(&model_set(1)).unwrap();
    let file: Value = serde_json::from_str(&text).unwrap();
    assert_eq!((&file["format"], &file["version"]), (&json!("taxeld-models"), &json!(1)));
    assert_eq!(file["id"], json!(model_set(1).id));
    assert_eq!(file["baseline"][3], json!({"mean": 241.0, "noise": 0.7}));
    let taxels = file["taxels"].as_array().unwrap();
    let keys: Vec<_> = taxels[2].as_object().unwrap().keys().map(String::as_str).collect();
    let mut expected = vec![
        "taxel",
        "status",
        "reason",
        "figures",
        "order",
        "coefficients",
        "range",
        "sign",
        "curve",
        "sigma",
        "estimator",
        "repaired",
        "gauge",
        "quality",
        "flags",
    ];
    expected.sort_unstable();
    assert_eq!(keys, expected);
    assert_eq!((&taxels[0]["taxel"], &taxels[0]["status"], &taxels[0]["order"]), (&json!(0), &json!("ok"), &json!(5)));
    assert_eq!(taxels[0]["coefficients"].as_array().unwrap().len(), 6);
    assert_eq!((&taxels[0]["sign"], &taxels[1]["sign"]), (&json!("falling"), &json!("rising")));
    assert_eq!((&taxels[2]["status"], &taxels[2]["figures"]), (&json!("dead"), &json!({"count": 128.0})));
    assert_eq!((&taxels[3]["status"], &taxels[3]["coefficients"]), (&json!("no_data"), &Value::Null));
    assert_eq!(text.lines().count(), 4 + 2, "one line for all, one per taxel");
}

#[test]
fn order_of_keys_and_white_space_do_not_matter() {
    let set = model_set(1);
    let file: Value = serde_json::from_str(&to_json(&set).unwrap()).unwrap();
    let pretty = serde_json::to_string_pretty(&file).unwrap();
    assert_eq!(bits(&from_json(&pretty).unwrap()), bits(&set));
}

#[test]
fn a_taxel_without_baseline_is_null() {
    let mut set = model_set(1);
    set.baseline[3] = TaxelBaseline { mean: f64::NAN, noise: f64::NAN };
    let set = with_id(set);
    let text = to_json(&set).unwrap();
    assert!(text.contains("null],\"pressure_max_kpa\""), "{text}");
    assert_eq!(bits(&from_json(&text).unwrap()), bits(&set));
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
    assert!(matches!(refused, ModelsJsonError::Id { .. }), "{refused}");
    let accepted = changed(false, method).unwrap();
    assert_eq!(accepted.method, "by hand");
    assert_ne!(accepted.id, model_set(1).id);
    assert_eq!(changed(false, |_| ()).unwrap().id, model_set(1).id);
}

#[test]
fn when_by_what_and_in_which_session_a_set_was_made_goes_with_it_and_is_no_part_of_its_id() {
    let set = model_set(1);
    let maker = Maker { software: "taxeld 7".to_owned(), simulated: true };
    let again = with_id(ModelSet { created_wall_ns: 77, session: None, maker: maker.clone(), ..set.clone() });
    assert_eq!(again.id, set.id);
    let back = from_json(&to_json(&again).unwrap()).unwrap();
    assert_eq!((back.created_wall_ns, back.session, &back.maker, &back.id), (77, None, &maker, &set.id));
    let other = with_id(ModelSet { method: "order 4".to_owned(), ..set.clone() });
    assert_ne!(other.id, set.id);
}

#[test]
fn of_a_set_from_elsewhere_no_session_here_is_believed() {
    let set = model_set(1);
    assert!(set.session.is_some());
    let imported = from_elsewhere(&to_json(&set).unwrap()).unwrap();
    assert_eq!(bits(&imported), bits(&ModelSet { session: None, ..set }));
    assert_eq!(bits(&from_elsewhere(&to_json(&imported).unwrap()).unwrap()), bits(&imported));
}

#[test]
fn what_contradicts_itself_is_refused_by_name() {
    type Change = fn(&mut Value);
    let cases: [(Change, &str); 24] = [
        (|f| f["format"] = json!("other"), "`format` is \"other\""),
        (|f| f["version"] = json!(2), "`version` is 2"),
        (|f| drop(f.as_object_mut().unwrap().remove("version")), "`version` is missing"),
        (|f| f["speed"] = json!(1), "unknown field `speed`"),
        (|f| drop(f.as_object_mut().unwrap().remove("patch")), "missing field `patch`"),
        (|f| f["patch"] = json!(""), "`patch` is empty"),
        (|f| f["taxels"] = json!([]), "`taxels` has 0 entries"),
        (|f| f["baseline"] = json!([null]), "`baseline` has 1 entries, expected 4"),
        (|f| f["gauge_gain_rel"] = json!(-0.1), "`gauge_gain_rel` is -0.1"),
        (|f| f["gauge_gain_rel"] = json!(null), "null"),
        (|f| f["taxels"][1]["taxel"] = json!(2), "taxel 1: its entry says `taxel` 2"),
        (|f| f["taxels"][1]["colour"] = json!(2), "taxel 1: unknown field `colour`"),
        (
            |f| f["taxels"][1]["status"] = json!("fine"),
            "taxel 1: `status` \"fine\" and its `figures`: unknown variant `Fine`",
        ),
        (|f| f["taxels"][2]["figures"] = json!({}), "taxel 2: `status` \"dead\" and its `figures`"),
        (|f| f["taxels"][1]["order"] = json!(4), "taxel 1: `curve` has 6 terms, expected 5 for `order` 4"),
        (|f| f["taxels"][1]["order"] = json!(11), "taxel 1: `order` is 11"),
        (|f| f["taxels"][0]["coefficients"] = json!([1.0]), "taxel 0: `coefficients` has 1 entries, expected 6"),
        (|f| f["taxels"][0]["coefficients"][0] = json!(3.5), "taxel 0: at count"),
        (|f| f["taxels"][0]["range"] = json!([200.0, 100.0]), "taxel 0: `range` goes from 200 to 100"),
        (|f| f["taxels"][0]["range"] = Value::Null, "taxel 0: it has a `curve` but no `range`"),
        (|f| f["taxels"][0]["curve"] = Value::Null, "taxel 0: it has `coefficients`"),
        (|f| f["taxels"][0]["sigma"] = Value::Null, "taxel 0: its `status` is \"ok\", but"),
        (|f| f["taxels"][0]["sigma"]["sigma_kpa"] = json!([]), "taxel 0: `sigma_kpa` of `sigma`"),
        (|f| f["taxels"][0]["sign"] = json!("up"), "taxel 0: `sign` is \"up\", expected rising or falling"),
    ];
    for (change, expected) in cases {
        let refused = changed(false, change).unwrap_err().to_string();
        assert!(refused.contains(expected), "{refused}, expected {expected}");
    }
}

#[test]
fn what_is_json_of_another_shape_is_refused_with_its_place() {
    type Change = fn(&mut Value);
    let cases: [(Change, &str); 4] = [
        (|f| f["taxels"][0]["range"] = json!([1.0]), "taxel 0: invalid length 1"),
        (|f| f["taxels"][0]["order"] = json!(300), ", in `order`"),
        (|f| f["pressure_max_kpa"] = json!("7"), ", in `pressure_max_kpa`"),
        (|f| f["baseline"][0] = json!(7), ", in `baseline[0]`"),
    ];
    for (change, expected) in cases {
        let refused = changed(false, change).unwrap_err().to_string();
        assert!(refused.contains(expected), "{refused}, expected {expected:?}");
    }
}

#[test]
fn texts_and_settings_are_written_up_to_their_limits() {
    const TEXT_MAX: usize = 2 << 10;
    const SETTINGS_MAX: usize = 256;
    let written = |change: fn(&mut ModelSet, usize), size: usize| {
        let mut set = model_set(1);
        change(&mut set, size);
        to_json(&with_id(set)).map_err(|error| error.to_string())
    };
    let method: fn(&mut ModelSet, usize) = |set, size| set.method = "x".repeat(size);
    let lines: fn(&mut ModelSet, usize) = |set, size| set.board_settings = vec![String::new(); size];
    let line: fn(&mut ModelSet, usize) = |set, size| set.board_settings = vec!["x".repeat(size)];
    for (change, most) in [(method, TEXT_MAX), (line, TEXT_MAX), (lines, SETTINGS_MAX)] {
        assert_eq!(from_json(&written(change, most).unwrap()).err(), None);
        let refused = written(change, most + 1).unwrap_err();
        assert!(
            refused.contains(&format!("the limit is {most}")) || refused.contains("which is the limit"),
            "{refused}"
        );
    }
}

#[test]
fn a_zero_is_two_numbers_or_none() {
    use taxel_engine::baseline::TaxelBaseline;
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
fn the_mark_of_an_encoding_before_a_set_is_none_of_it() {
    let (set, mark) = (model_set(1), '\u{feff}');
    let text = to_json(&set).unwrap();
    assert_eq!(to_json(&from_json(&format!("{mark}{text}")).unwrap()).unwrap(), text);
    assert!(from_json(&format!("{mark}{mark}{text}")).is_err());
}

#[test]
fn what_is_no_json_is_refused_with_its_place() {
    let refused = from_json("{\"format\": \"taxeld-models\",\n \"version\": NaN}").unwrap_err().to_string();
    assert!(refused.contains("line 2 column"), "{refused}");
    assert!(from_json("[]").is_err());
    assert!(from_json("").is_err());
    let deep = "[".repeat(100_000);
    assert!(from_json(&deep).is_err());
    let huge = to_json(&model_set(1)).unwrap().replace("69.9", "1e999");
    assert!(from_json(&huge).unwrap_err().to_string().contains("out of range"));
}

#[test]
fn a_number_that_is_not_finite_is_not_written() {
    type Change = fn(&mut TaxelModel);
    let cases: [(Change, &str); 5] = [
        (|m| m.quality.rmse_kpa = f64::NAN, "quality.rmse_kpa"),
        (|m| m.flags = vec![Flag::Repaired { rmse_ratio: f64::NAN }], "flags[0]"),
        (|m| m.status = Status::Dead { count: f64::NAN }, "`status` \"dead\" and its `figures`"),
        (|m| m.curve.as_mut().unwrap().chebyshev[2] = f64::NAN, "chebyshev"),
        (|m| m.sigma.as_mut().unwrap().sigma_kpa[0] = f64::INFINITY, "sigma_kpa"),
    ];
    for (change, place) in cases {
        let mut set = model_set(1);
        change(&mut set.taxels[1]);
        let refused = to_json(&with_id(set)).unwrap_err().to_string();
        let says = ["taxel 1: ", "null", place];
        assert!(says.iter().all(|says| refused.contains(says)), "{refused}, expected {says:?}");
    }
}

fn finite() -> impl Strategy<Value = f64> {
    use proptest::num::f64::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL, ZERO};
    NORMAL | SUBNORMAL | ZERO | POSITIVE | NEGATIVE
}

fn positive() -> impl Strategy<Value = f64> {
    finite().prop_map(f64::abs)
}

fn any_status() -> impl Strategy<Value = Status> {
    prop_oneof![
        Just(Status::NoData),
        finite().prop_map(|pressure_sd_kpa| Status::NoExcitation { pressure_sd_kpa }),
        finite().prop_map(|count| Status::Dead { count }),
        (finite(), finite())
            .prop_map(|(swing_counts, needed_counts)| Status::InsufficientSwing { swing_counts, needed_counts }),
        (0..1_u64 << 53).prop_map(|samples| Status::Unproven { samples }),
        finite().prop_map(|rmse_ratio| Status::NotMonotone { rmse_ratio }),
        (finite(), finite()).prop_map(|(share, limit)| Status::IntervalTooWide { share, limit }),
        Just(Status::Ok),
    ]
}

fn any_flag() -> impl Strategy<Value = Flag> {
    prop_oneof![
        any::<(u8, u8)>().prop_map(|(asked, used)| Flag::RankReduced { asked, used }),
        any::<(u32, u32)>().prop_map(|(distinct, wanted)| Flag::FewDistinctCounts { distinct, wanted }),
        (finite(), finite()).prop_map(|(count, leverage)| Flag::HighLeverage { count, leverage }),
        (finite(), finite()).prop_map(|(count, share)| Flag::RailDropped { count, share }),
        any::<u64>().prop_map(|samples| Flag::Dropouts { samples }),
        (finite(), finite()).prop_map(|(from, to)| Flag::Gap { from, to }),
        finite().prop_map(|rmse_ratio| Flag::Repaired { rmse_ratio }),
        finite().prop_map(|count| Flag::NotMonotone { count }),
        any::<u64>().prop_map(|samples| Flag::NotBinned { samples }),
        any::<u64>().prop_map(|samples| Flag::Rejected { samples }),
    ]
}

prop_compose! {
    fn any_quality()(
        samples: u64, distinct_counts: u32, rank: u8, n in proptest::array::uniform4(finite()),
        o in proptest::array::uniform6(proptest::option::of(finite())),
    ) -> Quality {
        Quality {
            samples, distinct_counts, rank, swing_counts: n[0], dof: n[1], rmse_kpa: n[2], max_leverage: n[3],
            pure_error_kpa: o[0], press_kpa: o[1], lack_of_fit_f: o[2], repeatability_kpa: o[3], interval_kpa: o[4],
            interval_share: o[5], press_by_order: Vec::new(),
        }
    }
}

prop_compose! {
    /// A constant curve of any value, and any figures beside it.
    fn any_model()(
        status in any_status(), flags in proptest::collection::vec(any_flag(), 0..4), value in finite(),
        range in (-1e9..1e9_f64, 0.0..1e9_f64), sigma in proptest::collection::vec(positive(), 1..20), first in finite(),
        gauge in (finite(), finite(), finite()), quality in any_quality(), repaired: bool,
        estimator in proptest::sample::select(Estimator::ALL.to_vec()),
    ) -> TaxelModel {
        TaxelModel {
            status, flags, quality, repaired, estimator,
            range: Some([range.0, range.0 + range.1]),
            curve: Some(Curve { centre: range.0, half_width: range.1 + 1.0, chebyshev: vec![value] }),
            raw_coefficients: vec![value],
            sigma: Some(SigmaProfile { first_count: first, step_counts: 0.1, sigma_kpa: sigma }),
            gauge: GaugeUncertainty { gain_rel: gauge.0, offset_kpa: gauge.1, noise_kpa: gauge.2 },
            ..TaxelModel::without_curve(status, GaugeUncertainty::default())
        }
    }
}

proptest! {
    #[test]
    fn every_set_comes_back_bit_for_bit(
        taxels in proptest::collection::vec((any_model(), finite(), positive()), 1..5), patch in ".+", method in ".*",
        boards in proptest::collection::vec(".*", 0..3), wall: i64, session: Option<u64>,
        gauge in (finite(), positive(), positive()),
    ) {
        let set = with_id(ModelSet {
            id: String::new(),
            patch, method, session,
            created_wall_ns: wall,
            board_settings: boards,
            baseline: taxels.iter().map(|&(_, mean, noise)| TaxelBaseline { mean, noise }).collect(),
            pressure_max_kpa: gauge.0,
            gauge_gain_rel: gauge.1,
            gauge_offset_kpa: gauge.2,
            taxels: taxels.into_iter().map(|(model, ..)| model).collect(),
            recorded: None,
            recalibrated: None,
            maker: taxel_engine::model_set::Maker::default(),
        });
        let text = to_json(&set).unwrap();
        let back = from_json(&text).unwrap();
        prop_assert_eq!(bits(&back), bits(&set));
        prop_assert_eq!(to_json(&back).unwrap(), text);
    }

    #[test]
    fn every_fit_that_is_finite_can_be_written_and_read(
        samples in proptest::collection::vec((prop_oneof![0.0..255.0_f64, (0_u8..=255).prop_map(f64::from)], -5.0..200.0_f64), 0..60),
        order in 1_u8..=10, auto: bool, whole: bool, scale in prop_oneof![Just(1.0), Just(1e-9), Just(1e9)],
    ) {
        let counts: Vec<f64> = samples.iter().map(|s| if whole { s.0.round() } else { s.0 * scale }).collect();
        let pressure: Vec<f64> = samples.iter().map(|s| s.1).collect();
        let order = if auto { Order::Auto } else { Order::Fixed(order) };
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

    #[test]
    fn any_text_is_read_or_refused(text in ".{0,200}", at in 0.0..1.0_f64, byte: u8) {
        let _ = from_json(&text);
        let mut good = to_json(&model_set(1)).unwrap().into_bytes();
        let at = (at * good.len() as f64) as usize;
        good[at] = byte;
        if let Ok(set) = from_json(&String::from_utf8_lossy(&good)) {
            prop_assert_eq!(bits(&set), bits(&model_set(1)));
        }
    }
}
