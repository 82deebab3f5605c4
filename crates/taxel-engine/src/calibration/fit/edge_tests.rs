//! Where each limit of a fit lies, and what its figures are, on numbers that can be worked out by hand.

use super::dropouts::dropouts;
use super::scans::modules;
use super::smooth::half_width;
use super::zero::zero_return;
use super::*;
use crate::baseline::TaxelBaseline;

/// A recording of so many scans, one each so many seconds, with these columns.
fn scans<'a>(time_s: &'a [f64], counts: &[&'a [f64]]) -> Scans<'a> {
    Scans { time_s, pressure_kpa: None, counts: counts.to_vec() }
}

fn every(seconds: f64, scans: usize) -> Vec<f64> {
    (0..scans).map(|i| seconds * i as f64).collect()
}

#[test]
fn a_score_is_what_its_words_say() {
    let column = |kpa: [f64; 4], sigma_kpa: [f64; 4], beyond: bool| {
        Ok(Column { kpa: kpa.into(), sigma_kpa: sigma_kpa.into(), beyond: vec![false, false, false, beyond] })
    };
    let applied = Applied {
        columns: vec![
            column([12.0, 34.0, 44.0, 50.0], [1.0, 2.0, 2.0, 0.1], true),
            column([10.0, 30.0, 38.0, f64::NAN], [1.0; 4], false),
            Err("faulty in every scan".to_owned()),
        ],
        zero: Zero { moved: None, words: String::new() },
        masked: (1, 8),
    };
    let score = judge(&applied, &[10.0, 30.0, 40.0, 50.0]);
    let near = |is: f64, expected: f64| assert!((is - expected).abs() < 1e-9, "{is} is not {expected}: {score:?}");
    // Above 30 kPa are two scans; the mean over the taxels is off by 1 and by 0 kPa there.
    near(score.area_percent, 100.0 * 0.5 / 40.0);
    near(score.bias_kpa, 0.5);
    let rmse = [(4.0_f64 + 16.0 + 16.0) / 4.0, 4.0 / 3.0].map(f64::sqrt);
    near(score.taxel_rmse_kpa, 0.5 * (rmse[0] + rmse[1]));
    near(score.taxel_rmse_median_kpa, rmse[0]);
    assert_eq!(score.taxels, 2);
    // Of the seven readings those that are off by 2 and 4 kPa are outside, but for what is no further than 1.96 sigma.
    near(score.coverage_percent.unwrap(), 100.0 * 3.0 / 7.0);
    near(score.coverage_beyond_percent.unwrap(), 100.0);
    near(score.beyond_percent, 100.0 / 7.0);
    // What is a lower bound alone is far off or near, nobody knows: it does not count for the interval.
    let mut open = applied;
    open.columns[0].as_mut().unwrap().sigma_kpa[3] = f64::INFINITY;
    let open = judge(&open, &[10.0, 30.0, 40.0, 50.0]);
    near(open.coverage_percent.unwrap(), 100.0 * 2.0 / 6.0);
    assert_eq!((open.coverage_beyond_percent, open.beyond_percent), (None, 0.0));
}

#[test]
fn a_running_median_takes_out_what_is_shorter_than_half_of_its_width() {
    let with = |length: usize| -> Vec<f64> {
        (0..40).map(|i| if (15..15 + length).contains(&i) { 9.0 } else { 1.0 }).collect()
    };
    assert_eq!(running_median(&with(7), 15), [1.0; 40]);
    assert_eq!(running_median(&with(8), 15)[18..20], [9.0, 9.0]);
}

#[test]
fn a_recording_tells_its_pace_by_its_middle_step() {
    let at = |time_s: &[f64]| scans(time_s, &[]).period_s();
    assert_eq!(at(&[0.0, 0.0, 0.0, 0.0, 1.0]), 1.0, "scans at one time have no pace");
    assert_eq!([at(&[0.0, 0.25, 0.5, 7.0, 7.0, 6.0]), at(&[3.0]), at(&[])], [0.25, 0.0, 0.0]);
    assert_eq!(scans(&every(0.25, 40), &[]).scans_in(2.0), 8);
    assert_eq!(scans(&[1.0, 1.0], &[]).scans_in(5.0), 1, "nobody knows");
    assert_eq!(half_width(&scans(&[1.0, 1.0], &[]), 0.5), 0);
    assert_eq!(modules(25, 10), [0..10, 10..20, 20..25]);
}

#[test]
fn the_return_to_zero_is_that_of_the_last_five_seconds_if_these_are_at_rest() {
    // Twelve scans after the load, one each 0.5 s: the last ten of them count.
    let time_s = every(0.5, 30);
    let kpa = |end: f64| [vec![0.0], vec![100.0; 17], vec![end; 12]].concat();
    let column = |end: f64| [vec![50.0; 20], vec![end; 10]].concat();
    let (mut a, b, c) = (column(102.0), column(99.0), column(180.0));
    a[25] = f64::NAN;
    let recording = scans(&time_s, &[&a, &b, &c]);
    let rest = [TaxelBaseline { mean: 100.0, noise: 1.0 }; 3];
    let of = |kpa: &[f64], taxels: &[usize]| zero_return(&recording, &Masks::missing(&recording), kpa, &rest, taxels);
    let returned = of(&kpa(1.9), &[0, 1]).unwrap();
    assert!((returned - 2.5_f64.sqrt()).abs() < 1e-12, "{returned}");
    assert_eq!([of(&kpa(2.1), &[0, 1]), of(&kpa(f64::NAN), &[0, 1]), of(&kpa(1.9), &[])], [None; 3]);
    // A range does not begin at nothing.
    let high = |end: f64| kpa(end).iter().map(|p| p + 50.0).collect::<Vec<f64>>();
    assert_eq!([of(&high(1.9), &[0, 1]), of(&high(2.1), &[0, 1])], [Some(returned), None]);
}

/// Forty falling taxels that move by up to a count, six seconds from the seventh on, and what `spoil` does to them.
fn rest_of(tare: Tare, spoil: impl Fn(usize, usize, f64) -> f64) -> Zero {
    let set = crate::force::tests::set(40);
    let time_s: Vec<f64> = every(0.0625, 96).iter().map(|t| 7.0 + t).collect();
    let rest = f64::from(crate::force::tests::REST);
    let noise = |taxel: usize, i: usize| f64::from(u8::from((i * 7 + taxel * 13) % 11 < 5));
    let column = |taxel: usize| (0..96).map(|i| spoil(taxel, i, rest + noise(taxel, i))).collect();
    let columns: Vec<Vec<f64>> = (0..40).map(column).collect();
    let recording = Scans { time_s: &time_s, pressure_kpa: None, counts: columns.iter().map(Vec::as_slice).collect() };
    Zero::find(tare, &recording, &Masks::missing(&recording), &set, 10)
}

#[test]
fn a_recording_is_tared_from_two_seconds_that_are_at_rest_throughout() {
    let zero = rest_of(Tare::Auto, |_, _, count| count);
    assert!(zero.words.starts_with("tared from the first 2 s: unloaded: ") && zero.moved.is_some(), "{zero:?}");
    assert!((0..40).all(|taxel| zero.moved(taxel).is_some_and(|moved| (moved - 0.45).abs() < 0.1)), "{zero:?}");
    // All taxels of a module move within the window.
    let moves = rest_of(Tare::Auto, |taxel, i, count| if taxel < 10 && i >= 16 { count + 1.0 } else { count });
    assert!(moves.moved.is_none() && moves.words.contains("something moved on "), "{moves:?}");
    // Of 32 scans 29 are enough.
    let missing =
        |scans: usize| rest_of(Tare::Seconds(2.0), move |t, i, c| if t == 3 && i < scans { f64::NAN } else { c });
    assert_eq!([1, 3, 4].map(|scans| missing(scans).moved(3).is_some()), [true, true, false]);
}

/// A taxel that hung for a tenth of the window: what it read then is in no zero.
#[test]
fn a_zero_is_of_scans_that_are_sound() {
    let set = crate::force::tests::set(2);
    let (time_s, rest) = (every(0.0625, 64), f64::from(crate::force::tests::REST));
    let (still, hung): (Vec<f64>, Vec<f64>) = (0..64).map(|i| (rest, if i < 3 { 90.0 } else { rest })).unzip();
    let holes: Vec<f64> = hung.iter().map(|count| if *count < rest { f64::NAN } else { *count }).collect();
    let masks = Masks::missing(&scans(&time_s, &[&still, &holes]));
    let zero = Zero::find(Tare::Seconds(2.0), &scans(&time_s, &[&still, &hung]), &masks, &set, 10);
    assert_eq!([0, 1].map(|taxel| zero.moved(taxel)), [Some(0.0); 2]);
}

#[test]
fn what_is_lighter_later_takes_a_tare_back_and_is_told_with_its_time() {
    for (from, after) in [(32, " 2.0 s later"), (64, " 4.0 s later")] {
        let lighter = rest_of(Tare::Auto, |t, i, count| if t < 3 && i >= from { count + 12.0 } else { count });
        assert!(lighter.moved.is_none() && lighter.words.ends_with(after), "{lighter:?}");
    }
}

#[test]
fn what_the_gauge_reads_at_rest_is_its_zero_where_nothing_moves_and_no_bag_could_press() {
    let time_s = every(0.0625, 132);
    // Two seconds at rest, of two halves, and then from `low` to 200 kPa above that.
    let find = |rest_kpa: [f64; 2], low: f64, count: f64| {
        let half = |i: usize| usize::from(i >= 16);
        let kpa: Vec<f64> =
            (0..132).map(|i| if i < 32 { rest_kpa[half(i)] } else { low + 2.0 * (i - 31) as f64 }).collect();
        let column: Vec<f64> = (0..132).map(|i| 200.0 + count * half(i) as f64).collect();
        let recording = scans(&time_s, &[&column, &column]);
        gauge_zero::find(&recording, &kpa, &Masks::missing(&recording))
    };
    let near = |is: f64, expected: f64| assert!((is - expected).abs() < 1e-9, "{is} is not {expected}");
    near(find([4.0, 4.0], 4.0, 0.0), 4.0);
    near(find([4.0, 4.4], 4.0, 0.0), 4.2); // by less than a tenth
    near(find([4.0, 4.45], 4.0, 0.0), 0.0);
    near(find([4.0, 4.0], 4.0, 0.09), 4.0); // counts may move by a tenth of one
    near(find([4.0, 4.0], 4.0, 0.11), 0.0);
    near(find([9.9, 9.9], 9.9, 0.0), 9.9); // from 10 kPa on it is a pressure
    near(find([10.1, 10.1], 10.1, 0.0), 0.0);
    near(find([5.8, 5.8], 0.0, 0.0), 5.8); // the least reading is 2 kPa there, and 2 % of the range are 3.96 kPa
    near(find([6.0, 6.0], 0.0, 0.0), 0.0);
    let (short, still) = (every(0.0625, 19), [200.0; 19]);
    let recording = scans(&short, &[&still, &still]);
    near(gauge_zero::find(&recording, &[4.0; 19], &Masks::missing(&recording)), 0.0); // too few scans
}

#[test]
fn a_reading_stands_alone_by_more_than_three_counts_and_five_deviations() {
    let found = |change: &[(usize, f64)], noise: f64| {
        let mut counts: Vec<f64> = (0..60).map(|i| 100.0 + noise * f64::from(i % 3 - 1)).collect();
        change.iter().for_each(|(at, count)| counts[*at] = *count);
        dropouts(&counts, &[false; 60])
    };
    assert_eq!(found(&[(30, 103.0)], 0.0), [0_usize; 0]);
    assert_eq!(found(&[(30, 103.5)], 0.0), [30]);
    assert_eq!(found(&[(0, 90.0), (30, 96.0), (59, 0.0)], 0.0), [0, 30, 59], "at the ends, too");
    let step: Vec<(usize, f64)> = (30..60).map(|i| (i, 60.0)).collect();
    assert_eq!(found(&step, 0.0), [0_usize; 0], "nor is a step one reading");
    // Deviations of one count: 5 times 1.48 of them.
    assert_eq!(found(&[(30, 107.0)], 1.0), [0_usize; 0]);
    assert_eq!(found(&[(30, 108.0)], 1.0), [30]);
    // Seven scans to each side are what it is compared with: a ramp goes far beyond them.
    let mut ramp: Vec<f64> = (0..120).map(|i| 240.0 - 0.5 * f64::from(i)).collect();
    ramp[30] += 20.0;
    assert_eq!(dropouts(&ramp, &[false; 120]), [30]);
}
