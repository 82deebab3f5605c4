//! The two writings of a polynomial in MODELS.json, of which the printed one is for people and the other is served.

use taxel_engine::model_set::ModelSet;
use taxel_model::{Curve, TaxelModel};

use super::fixture::*;
use crate::models_json::{from_json, to_json};

/// What is said of a set whose first taxel has this curve and these coefficients over this range.
fn said(curve: &[f64], coefficients: &[f64], range: [f64; 2]) -> Result<(), String> {
    let set = model_set(1);
    let [low, high] = range;
    let first = TaxelModel {
        order: coefficients.len() as u8 - 1,
        raw_coefficients: coefficients.to_vec(),
        range: Some(range),
        curve: Some(Curve {
            centre: f64::midpoint(low, high),
            half_width: (high - low) / 2.0,
            chebyshev: curve.to_vec(),
        }),
        ..set.taxels[0].clone()
    };
    let taxels = [&[first][..], &set.taxels[1..]].concat();
    to_json(&with_id(ModelSet { taxels, ..set })).map(drop).map_err(|error| error.to_string())
}

#[test]
fn polynomials_that_differ_in_the_middle_alone_are_not_the_same() {
    // At both ends they give 1 kPa.
    let why = said(&[0.0, 0.0, 1.0], &[1.0, 0.0, 0.0], [1.0, 3.0]).unwrap_err();
    assert!(why.contains("`coefficients` give 1 kPa and `curve` gives -0.7"), "{why}");
    assert_eq!(said(&[1.0, 0.0, 0.0], &[1.0, 0.0, 0.0], [1.0, 3.0]), Ok(()));
}

#[test]
fn what_differs_by_more_than_rounding_is_refused_and_rounding_is_not() {
    assert_eq!(said(&[1000.0, 0.0], &[1000.0 + 2.2e-11, 0.0], [1.0, 3.0]), Ok(()));
    for off in [5e-11, 0.001, 1.0] {
        assert!(
            said(&[1000.0, 0.0], &[1000.0 + off, 0.0], [1.0, 3.0]).unwrap_err().contains("same polynomial"),
            "{off}"
        );
    }
}

#[test]
fn without_a_curve_there_is_neither_an_order_nor_a_coefficient() {
    let without = |order: u8, coefficients: &[f64]| {
        let set = model_set(1);
        let none = TaxelModel { order, raw_coefficients: coefficients.to_vec(), ..set.taxels[3].clone() };
        let taxels = [&set.taxels[..3], &[none][..]].concat();
        to_json(&with_id(ModelSet { taxels, ..set })).map(drop).map_err(|error| error.to_string())
    };
    assert_eq!(without(0, &[]), Ok(()));
    for (order, coefficients) in [(3, &[][..]), (0, &[1.0][..]), (1, &[1.0, 2.0][..])] {
        let why = without(order, coefficients).unwrap_err();
        assert!(why.contains("it has `coefficients` or an `order` but no `curve`"), "{why}");
    }
}

/// All of them 1e308: the sum overflows, and infinity is not further from anything than infinity.
#[test]
fn coefficients_that_overflow_agree_with_no_curve() {
    for coefficients in [[1e308; 6], [1e308, -1e308, 1e308, -1e308, 1e308, -1e308]] {
        let set = model_set(1);
        let mut first = set.taxels[0].clone();
        assert_eq!(first.raw_coefficients.len(), coefficients.len());
        first.raw_coefficients = coefficients.to_vec();
        let taxels = [&[first][..], &set.taxels[1..]].concat();
        let text = to_json(&model_set(1)).unwrap();
        let why = to_json(&with_id(ModelSet { taxels, ..set })).unwrap_err().to_string();
        assert!(why.contains("taxel 0: at count") && why.contains("not the same polynomial"), "{why}");
        // And so they are not imported.
        let at = text.find("\"coefficients\":[").unwrap();
        let end = at + text[at..].find(']').unwrap();
        let numbers: Vec<String> = coefficients.iter().map(|number| format!("{number:e}")).collect();
        let changed = format!("{}\"coefficients\":[{}{}", &text[..at], numbers.join(","), &text[end..]);
        let id = text.find("\"id\":").unwrap();
        let id = &text[id..id + text[id..].find(',').unwrap() + 1];
        let why = from_json(&changed.replacen(id, "", 1)).unwrap_err().to_string();
        assert!(why.contains("not the same polynomial"), "{why}");
    }
}

/// A polynomial that is zero at three places is none other's there.
#[test]
fn coefficients_that_agree_at_both_ends_and_in_the_middle_alone_are_not_the_same() {
    let why = said(&[0.0, 0.0, 0.0, 0.0], &[-6.0, 11.0, -6.0, 1.0], [1.0, 3.0]).unwrap_err();
    assert!(why.contains("not the same polynomial"), "{why}");
}
