//! What a set carries along, of a recording and of known loads, comes back and is checked.

use taxel_engine::model_set::{GaugeClock, ModelSet, Recalibrated, Recorded, RecordedTaxel, ZeroReturn};
use taxel_engine::recalibration::LoadPoint;
use taxel_model::{Plays, Sign};

use super::fixture::{model_set, with_id};
use crate::models_json::{from_json, to_json};

#[test]
fn what_a_recording_adds_comes_back_and_is_checked() {
    let plays = Plays {
        curve: model_set(1).taxels[0].curve.clone().unwrap(),
        range: [160.0, 240.0],
        sign: Sign::Falling,
        radii_counts: [3.0, 0.1 + 0.2],
        weights_kpa: [0.0, 0.7],
    };
    let taxel = RecordedTaxel { rmse_kpa: 5.3, sensitivity: 0.12, hysteresis_kpa: Some(-1.5), plays: Some(plays) };
    let recorded = Recorded {
        smooth_s: 0.5,
        module_size: 10,
        lag_s: -0.1,
        zero_return: Some(ZeroReturn { rms: 1.2, common: 0.9 }),
        clock: Some(GaugeClock { offset_s: -0.7, rate: 3e-4, error_ratio: 0.8, applied: true }),
        plays_error_ratio: Some(0.58),
        taxels: vec![Some(taxel), None, None, None],
    };
    let set = with_id(ModelSet { recorded: Some(recorded.clone()), ..model_set(1) });
    assert_ne!(set.id, model_set(1).id);
    let back = from_json(&to_json(&set).unwrap()).unwrap();
    assert_eq!(back.recorded, Some(recorded.clone()));
    type Change = fn(&mut Recorded);
    fn curve(recorded: &mut Recorded) -> &mut Vec<f64> {
        &mut recorded.taxels[0].as_mut().unwrap().plays.as_mut().unwrap().curve.chebyshev
    }
    let mut longest = recorded.clone();
    curve(&mut longest).resize(11, 0.5);
    let longest = to_json(&with_id(ModelSet { recorded: Some(longest), ..model_set(1) }));
    assert!(from_json(&longest.unwrap()).is_ok());
    let cases: [(Change, &str); 8] = [
        (|r| curve(r).resize(12, 0.5), "`recorded.taxels[0].plays.curve` has 12 terms, the limit is 11"),
        (|r| curve(r).clear(), "`recorded.taxels[0].plays.curve` is empty or not finite"),
        (|r| curve(r)[0] = f64::INFINITY, "`recorded.taxels[0].plays.curve` is empty or not finite"),
        (|r| r.smooth_s = f64::NAN, "`recorded.smooth_s` is NaN"),
        (|r| r.taxels.truncate(1), "`recorded.taxels` has 1 entries, expected 4"),
        (|r| r.clock.as_mut().unwrap().rate = f64::INFINITY, "`recorded.clock.rate` is inf"),
        (|r| r.module_size = 0, "`recorded.module_size` is 0"),
        (|r| r.taxels[0].as_mut().unwrap().plays.as_mut().unwrap().weights_kpa[0] = -1.0, "plays` is -1"),
    ];
    for (change, says) in cases {
        let mut wrong = recorded.clone();
        change(&mut wrong);
        let refused = to_json(&with_id(ModelSet { recorded: Some(wrong), ..model_set(1) })).unwrap_err();
        assert!(refused.to_string().contains(says), "{refused}");
    }
}

#[test]
fn what_known_loads_corrected_comes_back_and_is_checked() {
    let point = LoadPoint { number: 7, read: 4.5, read_sigma: 0.01, known: 0.1 + 0.2, known_sigma: 0.05 };
    let recalibrated = Recalibrated {
        derived_from: model_set(1).id,
        earlier: vec!["m-0".to_owned()],
        area_mm2: Some(42.1),
        filled: Some(true),
        gain: 1.1,
        gain_sigma: 0.012,
        offset_kpa: -0.3,
        offset_sigma_kpa: 0.1,
        place_rel: 0.03,
        relative_sigma: 0.032,
        gain_in_all: 1.21,
        points: vec![point; 5],
    };
    let set = with_id(ModelSet { recalibrated: Some(recalibrated.clone()), ..model_set(1) });
    assert_ne!(set.id, model_set(1).id);
    assert_eq!(from_json(&to_json(&set).unwrap()).unwrap().recalibrated, Some(recalibrated.clone()));
    assert!(!to_json(&model_set(1)).unwrap().contains("recalibrated"), "files of sets without one stay as they were");
    type Change = fn(&mut Recalibrated);
    let most = Recalibrated {
        derived_from: "m".repeat(2_048),
        earlier: vec!["m".to_owned(); 32],
        points: vec![point; 100],
        ..recalibrated.clone()
    };
    let most = to_json(&with_id(ModelSet { recalibrated: Some(most), ..model_set(1) }));
    assert!(from_json(&most.unwrap()).is_ok());
    let cases: [(Change, &str); 10] = [
        (|r| r.derived_from = "m".repeat(2_049), "`recalibrated.derived_from` has 2049 bytes, expected 1 to 2048"),
        (|r| r.derived_from.clear(), "`recalibrated.derived_from` has 0 bytes"),
        (|r| r.earlier[0].clear(), "`recalibrated.earlier` has 0 bytes"),
        (|r| r.earlier = vec!["m".to_owned(); 33], "`recalibrated.earlier` has 33 entries, the limit is 32"),
        (|r| r.area_mm2 = Some(0.0), "`recalibrated.area_mm2` is 0"),
        (|r| r.gain = 0.0, "`recalibrated.gain` is 0"),
        (|r| r.gain_in_all = f64::NAN, "`recalibrated.gain_in_all` is NaN"),
        (|r| r.relative_sigma = -1.0, "`recalibrated.relative_sigma` is -1"),
        (|r| r.points[2].known = 0.0, "`recalibrated.points`: point 7: the known load is 0"),
        (|r| r.points = vec![r.points[0]; 101], "`recalibrated.points` has 101 entries, the limit is 100"),
    ];
    for (change, says) in cases {
        let mut wrong = recalibrated.clone();
        change(&mut wrong);
        let refused = to_json(&with_id(ModelSet { recalibrated: Some(wrong), ..model_set(1) })).unwrap_err();
        assert!(refused.to_string().contains(says), "{refused}");
    }
}
