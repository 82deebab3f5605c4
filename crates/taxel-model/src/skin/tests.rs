use super::super::form::Warp;
use super::*;
use crate::OneByOne;

/// `made_up_skin` of the reference (`check.py`): whole counts that fall by about 1 a kPa, with a loop of 1.2 counts and a
/// fixed sequence for noise, over a ramp of 60 s and a fall of 15 s.
fn made_up() -> (Vec<f64>, Vec<f64>, Vec<Vec<f64>>) {
    let time: Vec<f64> = (0..1700).map(|scan| f64::from(scan) * 0.05).collect();
    let ramp =
        |t: f64| if t < 65.0 { ((t - 5.0) / 60.0 * 60.0).max(0.0) } else { (60.0 - (t - 65.0) / 15.0 * 60.0).max(0.0) };
    let kpa: Vec<f64> = time.iter().map(|t| ramp(*t)).collect();
    let mut highest = 0.0_f64;
    let tops: Vec<f64> = kpa
        .iter()
        .map(|p| {
            highest = highest.max(*p);
            highest
        })
        .collect();
    let column = |taxel: f64| {
        let response = |kpa: f64| (1.0 + 0.2 * taxel.sin()) * kpa / (1.0 + kpa / 200.0);
        let count = |scan: usize| {
            let k = scan as f64;
            let noise = 1.4 * (12.9898 * k + 78.233 * taxel + 0.37 * k * taxel).sin();
            let (now, most) = (response(kpa[scan]), response(tops[scan]));
            (240.0 - now.min(most - 1.2).max(now - 1.2).max(0.0) + noise).round_ties_even()
        };
        (0..kpa.len()).map(count).collect::<Vec<f64>>()
    };
    let columns = (0..40).map(|taxel| column(f64::from(taxel))).collect();
    (time, kpa, columns)
}

/// To what the reference prints with twelve digits, its plays weighted as here: by the inverse square of the load and 6 kPa.
fn agree(name: &str, found: &[f64], expected: &[f64]) {
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= 1e-6 * expected.abs().max(1.0), "{name}: {found} {expected}");
    }
}

#[test]
fn a_made_up_skin_is_fitted_as_the_reference_fits_it() {
    let (time, kpa, columns) = made_up();
    let counts: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    let of = Gathered { time_s: &time, pressure_kpa: &kpa, counts: &counts, zeros: None };
    // The reference takes the simplest form within 2 % of the least error.
    let form = Form { warp: Warp::Log(0.02), order: 5, dead_zone: true, free_zero: false };
    assert!(fit(&of, true, &OneByOne).unwrap().form.dead_zone);
    let skin = fit_as(Some(form), &of, true, &OneByOne).unwrap();
    let taxels: Vec<&FittedTaxel> = skin.taxels.iter().flatten().collect();
    assert!(taxels.len() == 40 && taxels.iter().all(|taxel| taxel.status.is_ok() && taxel.soft.is_none()));
    let of = |value: fn(&FittedTaxel) -> f64| taxels.iter().map(|taxel| value(taxel)).collect::<Vec<f64>>();
    agree("zone", &[median(of(|taxel| taxel.curve.zone_kpa))], &[1.067_724_540_311_174]);
    assert!((skin.dead_zone_kpa - 1.1).abs() < 0.2, "{} kPa", skin.dead_zone_kpa);
    agree("noise", &[median(of(|taxel| taxel.noise_counts))], &[0.875_827_687_852_033]);
    agree("zero", &of(|taxel| taxel.zero_counts), &[239.970_297_029_703, 240.019_801_980_198, 239.970_297_029_703]);
    agree("error", &of(|taxel| taxel.error_kpa), &[1.509_620_088_105, 1.221_805_330_749, 1.266_186_867_368]);
    agree("shared", &[skin.shared_kpa.unwrap()], &[0.187_384_757_532_924]);
    let first = taxels[0];
    agree("counts at 30 kPa", &[first.curve.counts_at(30.0)], &[24.889_998_156_901]);
    let read = [-1.0, 0.0, 5.0, 20.0, 45.0, 60.0].map(|load| first.curve.inverse(load));
    let inverse = [1.075_150_282_885, 1.075_150_282_885, 6.452_034_899_555, 23.702_017_152_324, 60.086_401_148_631];
    agree("inverse", &read, &[&inverse[..], &[83.578_089_589_816]].concat());
    assert!(skin.plays_error_ratio.unwrap() < 1.0);
    agree("plays of 0", &first.plays_kpa.unwrap(), &[0.0, 0.049_053_345_328, 0.181_864_222_745, 0.0]);
    agree("plays of 1", &taxels[1].plays_kpa.unwrap(), &[1.100_336_080_187, 0.0, 0.0, 0.001_988_405_947]);
    let knots: Vec<f64> = (0..13).map(|k| first.sigma.at(skin.range_kpa[1] / 12.0 * f64::from(k))).collect();
    agree(
        "sigma",
        &knots,
        &[
            1.410_073_862_247,
            1.389_612_269_638,
            1.223_531_866_759,
            1.260_223_958_466,
            1.304_418_268_951,
            1.380_677_643_896,
            1.430_273_627_687,
            1.460_874_729_465,
            1.542_459_619_793,
            1.612_516_353_652,
            1.693_746_843_660,
            1.738_624_634_680,
            1.842_419_217_739,
        ],
    );
}
