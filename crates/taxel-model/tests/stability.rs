//! The stability suite, whose failures have the numbers of their cases, and any recording at all. See `taxel_model::stability`.

#![allow(clippy::unwrap_used)] // Tests; the exemption knows only functions marked as such.

use proptest::prelude::*;
use taxel_model::stability::{GROUPS, failures};
use taxel_model::{FitOptions, GaugeUncertainty, OneByOne, Samples, TaxelModel, fit, skin};

#[test]
fn every_case_of_the_suite_holds() {
    let broken: Vec<String> = GROUPS.iter().flat_map(failures).collect();
    assert!(broken.is_empty(), "\n{}", broken.join("\n"));
}

/// Readings as a broken converter or gauge might give them.
fn any_reading(usual: std::ops::Range<f64>) -> impl Strategy<Value = f64> {
    prop_oneof![
        12 => usual.clone(),
        12 => usual.prop_map(f64::round),
        1 => any::<f64>(),
        1 => prop::sample::select(vec![
            f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -0.0, 255.0, 1e15, -1e15, 1e-15, 1e-300, 5e-324, 1e300,
        ]),
    ]
}

fn any_options() -> impl Strategy<Value = FitOptions> {
    let noise = prop_oneof![5 => Just(0.0), 1 => 0.0..20.0_f64];
    let swing = prop_oneof![3 => Just(0.0), 1 => 0.0..200.0_f64];
    (any::<u8>(), noise, swing).prop_map(|(order, noise_kpa, min_swing_counts)| FitOptions {
        order,
        min_swing_counts,
        gauge: GaugeUncertainty { gain_rel: 0.01, offset_kpa: 0.1, noise_kpa },
        ..FitOptions::default()
    })
}

/// A recording of a few taxels: mostly a rise, with whatever may stand in its cells.
fn any_recording() -> impl Strategy<Value = (Vec<f64>, Vec<Vec<f64>>)> {
    let scans = prop_oneof![3 => 0..60_usize, 1 => 280..400_usize];
    (scans, 1..5_usize, any::<bool>()).prop_flat_map(|(scans, taxels, rises)| {
        let kpa = (0..scans).map(move |scan| {
            let rising = 70.0 * scan as f64 / scans as f64;
            prop_oneof![19 => Just(rising), 1 => any_reading(0.0..70.0)]
        });
        let kpa: Vec<_> = kpa.collect();
        let column = move |taxel: usize| {
            let cell = move |scan: usize| {
                let law = 240.0 - (40 + 20 * taxel) as f64 * scan as f64 / scans as f64;
                let usual = if rises { law - 1.0..law + 1.0 } else { 100.0..140.0 };
                prop_oneof![19 => usual.clone().prop_map(f64::round), 1 => any_reading(usual)]
            };
            (0..scans).map(cell).collect::<Vec<_>>()
        };
        (kpa, (0..taxels).map(column).collect::<Vec<_>>())
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever a skin shows is fitted soundly, or refused.
    #[test]
    fn no_recording_breaks_the_fit_of_a_skin((kpa, columns) in any_recording(), hysteresis: bool) {
        let counts: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let time_s: Vec<f64> = (0..kpa.len()).map(|scan| 0.05 * scan as f64).collect();
        let gathered = skin::Gathered { time_s: &time_s, pressure_kpa: &kpa, counts: &counts, zeros: None };
        if let Ok(fitted) = skin::fit(&gathered, hysteresis, &OneByOne) {
            for (taxel, column) in columns.iter().enumerate() {
                let model = fitted.model(taxel, column, &FitOptions::default());
                prop_assert_eq!(model.validate(), Ok(()));
                for count in column.iter().filter(|count| count.is_finite()) {
                    let Some(reading) = model.evaluate(*count) else { continue };
                    prop_assert!(reading.kpa.is_finite() && !reading.sigma_kpa.is_nan(), "{:?} at {}", reading, count);
                    prop_assert!(reading.sigma_kpa > 0.0 || !model.is_usable(), "{:?} at {}", reading, count);
                }
            }
        }
    }

    /// Whatever comes, and whatever is asked: an answer, a sound one, and the same in another order.
    #[test]
    fn no_samples_and_no_options_break_a_fit(
        samples in prop_oneof![
            3 => proptest::collection::vec((any_reading(0.0..255.0), any_reading(0.0..70.0)), 0..40),
            1 => proptest::collection::vec((any_reading(150.0..160.0), any_reading(0.0..70.0)), 280..330),
        ],
        options in any_options(),
    ) {
        let (counts, kpa): (Vec<f64>, Vec<f64>) = samples.iter().copied().unzip();
        let model = fit(&Samples::new(&counts, &kpa), &options);
        prop_assert_eq!(model.validate(), Ok(()));
        let file = serde_json::to_string(&model).unwrap();
        let read: Result<TaxelModel, _> = serde_json::from_str(&file);
        prop_assert!(read.as_ref().is_ok_and(|read| read.validate().is_ok()), "{:?} from {}", read, file);
        for count in counts.iter().chain(&[0.0, 127.5, 255.0, 1e15, -1e300]) {
            if let Some(reading) = model.evaluate(*count) {
                prop_assert!(count.is_finite() && reading.kpa.is_finite(), "{:?} at {}", reading, count);
                prop_assert!(reading.sigma_kpa > 0.0 || !model.is_usable(), "{:?} at {}", reading, count);
            }
        }
        let (counts, kpa): (Vec<f64>, Vec<f64>) = samples.iter().rev().copied().unzip();
        // As text, because a figure that is not a number is not equal to itself.
        prop_assert_eq!(format!("{:?}", fit(&Samples::new(&counts, &kpa), &options)), format!("{model:?}"));
    }
}
