//! Where f64 ends. The stability suite, with exact references, is `stability.rs`.

use taxel_model::{
    Accumulator, Estimator, FitOptions, FixedPressure, Flag, Order, Rails, Samples, Shape, Status, TaxelModel, fit,
};

#[test]
fn a_count_far_from_all_others_costs_order_and_not_digits() {
    for far in [1e6, 1e9, 1e12] {
        let mut counts: Vec<f64> = (0..200).map(|k| far + f64::from(k % 9)).collect();
        let mut kpa: Vec<f64> = (0..200).map(|k| 10.0 - f64::from(k % 9)).collect();
        counts.push(0.0);
        kpa.push(65.0);
        let options = FitOptions { estimator: Estimator::PerSample, shape: Shape::Report, ..FitOptions::default() };
        let model = fit(&Samples::new(&counts, &kpa), &options);
        let reduced = model.flags.iter().any(|flag| matches!(flag, Flag::RankReduced { asked: 5, used } if *used < 5));
        assert!(reduced, "{far:e}: {:?}", model.flags);
        // The pressures lie on a line but for the far one, and the curve passes through that one.
        for (count, kpa) in counts.iter().zip(&kpa).filter(|_| model.order > 1) {
            let got = model.evaluate(*count).unwrap().kpa;
            assert!((got - kpa).abs() < 1e-6, "{far:e}: {got} kPa at {count}, expected {kpa} kPa");
        }
    }
}

#[test]
fn a_reading_beyond_a_rail_is_clipped_in_every_estimator() {
    let kpa: Vec<f64> = (0..3000).map(|k| 70.0 * f64::from(k) / 3000.0).collect();
    let counts: Vec<f64> = kpa.iter().map(|p| (4000.0 - 30.0 * p).round()).collect();
    let beyond: Vec<f64> = counts.iter().enumerate().map(|(k, c)| if k % 40 == 0 { 9000.0 } else { *c }).collect();
    for estimator in [Estimator::PerSample, Estimator::PressureBinned] {
        let options = FitOptions { estimator, rails: Rails::At { low: 0.0, high: 4095.0 }, ..FitOptions::default() };
        let model = fit(&Samples::new(&beyond, &kpa), &options);
        assert!(model.flags.iter().any(|f| matches!(f, Flag::RailDropped { count: 9000.0, .. })), "{:?}", model.flags);
        let got = model.evaluate(2500.0).unwrap().kpa;
        assert!((got - 50.0).abs() < 0.1, "{estimator:?}: {got} kPa");
        // The pressure alone is that of the reading, beyond the range and of no count, too.
        for count in [f64::NAN, f64::INFINITY, -1.0, 0.0, 1900.0, 2500.5, 4000.0, 1e300] {
            assert_eq!(model.kpa(count), model.evaluate(count).map(|reading| reading.kpa), "{count}");
        }
    }
}

#[test]
fn what_is_beyond_any_number_does_not_end_up_in_a_file() {
    // Between counts that lie 1e10 apart a deviation of order 7 overflows ...
    let wide = [0.0, 0.0, 0.0, 0.0, 0.0, 2.5, 150.6, 154.5, 191.0, 197.9, 226.4, 2e10];
    let wide_kpa = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 16.5, 0.0, 0.0, 0.0, 0.0];
    // ... and in powers of counts of 1e-300 so does any coefficient.
    let (tiny, tiny_kpa) = ([1e-308, 1e-300, 2e-300, 3e-300], [0.0, 7.0, 15.0, 22.0]);
    for (counts, kpa, order) in [(&wide[..], &wide_kpa[..], 7), (&tiny[..], &tiny_kpa[..], 2)] {
        let options =
            FitOptions { order: Order::Fixed(order), estimator: Estimator::PerSample, ..FitOptions::default() };
        let model = fit(&Samples::new(counts, kpa), &options);
        assert_eq!(model.validate(), Ok(()));
        let file = serde_json::to_string(&model).unwrap();
        assert_eq!(serde_json::from_str::<TaxelModel>(&file).unwrap().validate(), Ok(()), "order {order}: {file}");
    }
}

#[test]
fn the_paper_leaves_nothing_out_and_repairs_nothing() {
    let kpa: Vec<f64> = (0..1000).map(|k| 0.07 * f64::from(k)).collect();
    let mut counts: Vec<f64> = kpa.iter().map(|p| (240.0 - 30.0 * p / (p + 40.0)).round()).collect();
    (counts[300], counts[301], counts[999]) = (0.0, 255.0, 180.0); // two rails and an outlier, each once
    let options = FitOptions { estimator: Estimator::Paper, ..FitOptions::default() };
    let model = fit(&Samples::new(&counts, &kpa), &options);
    assert_eq!((model.status, model.range), (Status::Ok, Some([0.0, 255.0])));
    assert_eq!((model.estimator, model.repaired, model.quality.samples), (Estimator::Paper, false, 1000));
    assert!(model.flags.iter().any(|flag| matches!(flag, Flag::NotMonotone { .. })), "{:?}", model.flags);
    assert_eq!(model.validate(), Ok(()));
    let mut swing = options;
    swing.exclusion.min_swing_counts = 255.5;
    let status = fit(&Samples::new(&counts, &kpa), &swing).status;
    assert_eq!(status, Status::InsufficientSwing { swing_counts: 255.0, needed_counts: 255.5 });
    // From the bus the same samples, their pressures rounded to a thousandth of a pascal.
    let mut sums = Accumulator::new();
    sums.extend(counts.iter().zip(&kpa).map(|(c, p)| (*c as u8, FixedPressure::from_kpa(*p))), 0);
    let live = sums.fit(&options);
    assert_eq!((live.status, live.range, live.estimator), (Status::Ok, model.range, Estimator::Paper));
}
