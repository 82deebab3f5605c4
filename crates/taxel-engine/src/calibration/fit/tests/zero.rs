//! The zero of a recording: proven, refused, and vouched for.

use super::*;

#[test]
fn a_recording_at_rest_is_tared_and_read_right() {
    let set = fitted(&Skin::cycle(8.0), &FitRecipe::default());
    let mut skin = Skin::new(cycle(4.0, 150.0), 8.0, 2.0, 77);
    skin.spoil(11, 0.5..1.0, |_| 255.0);
    let applied = apply(&skin.scans(), &set, Tare::Auto).unwrap();
    assert!(applied.zero.moved.is_some(), "{}", applied.zero.told);
    assert!((applied.zero.moved(0).unwrap() - 2.0).abs() < 0.4);
    assert_eq!(applied.unread[11].as_deref(), Some("no zero: faulty while the others were tared"));
    assert!(applied.pressure_kpa[11].is_empty());
    // What the gauge reads at rest is no pressure.
    let beyond: Vec<f64> = skin.kpa.iter().map(|p| p - 4.0).collect();
    let score = judge(&applied, &beyond);
    assert_eq!(score.taxels, TAXELS - 1);
    assert!(score.area_percent < 3.0 && score.taxel_rmse_kpa < 6.0, "{score:?}");
    assert!(score.coverage_percent.unwrap() > 93.0, "{score:?}");
    let untared = apply(&skin.scans(), &set, Tare::None).unwrap();
    assert!(judge(&untared, &beyond).area_percent > 3.0 * score.area_percent);
}

#[test]
fn a_beginning_under_load_is_refused_a_tare() {
    let set = fitted(&Skin::cycle(0.0), &FitRecipe::default());
    let verdict = |kpa: Vec<f64>| apply(&Skin::new(kpa, 0.0, 0.0, 5).scans(), &set, Tare::Auto).unwrap();
    let loaded = verdict([vec![197.0; 600], cycle(150.0, 190.0)].concat()).zero;
    assert!(loaded.told.contains("is not shown to be unloaded; something presses on "), "{}", loaded.told);
    assert_eq!(loaded.moved(0), Some(0.0), "the zero of the calibration stays");
    let ramping = verdict((0..2000).map(|i| 4.0 + 0.05 * f64::from(i)).collect()).zero;
    assert!(ramping.told.contains("is not shown to be unloaded; the whole skin moved"), "{}", ramping.told);
    // 20 kPa look like another day. They show when they go.
    let light = verdict([vec![20.0; 400], vec![4.0; 400], cycle(4.0, 100.0)].concat()).zero;
    assert!(light.told.contains(" lighter than its zero") && light.moved.is_none(), "{}", light.told);
}
