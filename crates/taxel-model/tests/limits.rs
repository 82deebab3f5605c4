//! Where f64 ends. The stability suite, with exact references, is `stability.rs`.

use taxel_model::{FitOptions, Flag, Samples, Status, TaxelModel, fit};

#[test]
fn what_is_beyond_any_number_does_not_end_up_in_a_file() {
    // Between counts that lie 1e10 apart a deviation of order 7 overflows ...
    let wide = [0.0, 0.0, 0.0, 0.0, 0.0, 2.5, 150.6, 154.5, 191.0, 197.9, 226.4, 2e10];
    let wide_kpa = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 16.5, 0.0, 0.0, 0.0, 0.0];
    // ... and in powers of counts of 1e-300 so does any coefficient.
    let (tiny, tiny_kpa) = ([1e-308, 1e-300, 2e-300, 3e-300], [0.0, 7.0, 15.0, 22.0]);
    for (counts, kpa, order) in [(&wide[..], &wide_kpa[..], 7), (&tiny[..], &tiny_kpa[..], 2)] {
        let options = FitOptions { order, ..FitOptions::default() };
        let model = fit(&Samples::new(counts, kpa), &options);
        assert_eq!(model.validate(), Ok(()));
        let file = serde_json::to_string(&model).unwrap();
        assert_eq!(serde_json::from_str::<TaxelModel>(&file).unwrap().validate(), Ok(()), "order {order}: {file}");
    }
}

#[test]
fn the_polynomial_leaves_nothing_out_and_repairs_nothing() {
    let kpa: Vec<f64> = (0..1000).map(|k| 0.07 * f64::from(k)).collect();
    let mut counts: Vec<f64> = kpa.iter().map(|p| (240.0 - 30.0 * p / (p + 40.0)).round()).collect();
    (counts[300], counts[301], counts[999]) = (0.0, 255.0, 180.0); // two rails and an outlier, each once
    let options = FitOptions::default();
    let model = fit(&Samples::new(&counts, &kpa), &options);
    assert_eq!((model.status, model.range), (Status::Ok, Some([0.0, 255.0])));
    assert_eq!(model.quality.samples, 1000);
    assert!(model.flags.iter().any(|flag| matches!(flag, Flag::NotMonotone { .. })), "{:?}", model.flags);
    assert_eq!(model.validate(), Ok(()));
    let mut swing = options;
    swing.min_swing_counts = 255.5;
    let status = fit(&Samples::new(&counts, &kpa), &swing).status;
    assert_eq!(status, Status::InsufficientSwing { swing_counts: 255.0, needed_counts: 255.5 });
}
