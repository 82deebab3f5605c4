//! The zero of a recording: proven, refused, and confirmed.

use super::*;

#[test]
fn a_recording_at_rest_is_tared_and_read_right() {
    let set = fitted(&Skin::cycle(8.0), &FitRecipe::default());
    let mut skin = Skin::new(cycle(4.0, 150.0), 8.0, 2.0, 77);
    skin.spoil(11, 0.5..1.0, |_| 255.0);
    let applied = apply(&skin.scans(), &set, Tare::Auto).unwrap();
    assert!(applied.zero.moved.is_some(), "{}", applied.zero.words);
    assert!((applied.zero.moved(0).unwrap() - 2.0).abs() < 0.4);
    let why = applied.columns[11].as_ref().unwrap_err();
    assert_eq!(why, "no zero: faulty while the others were tared");
    // What the gauge reads at rest is no pressure.
    let beyond: Vec<f64> = skin.kpa.iter().map(|p| p - 4.0).collect();
    let score = judge(&applied, &beyond);
    assert_eq!(score.taxels, TAXELS - 1);
    assert!(score.area_percent < 3.0 && score.taxel_rmse_kpa < 6.0, "{score:?}");
    assert!(score.coverage_percent.unwrap() > 93.0, "{score:?}");
    let untared = apply(&skin.scans(), &set, Tare::None).unwrap();
    assert!(judge(&untared, &beyond).area_percent > 3.0 * score.area_percent);
}
