//! The rules on a synthetic skin of three modules, and the filters against what they are defined as.

mod paper;
mod zero;

use proptest::prelude::*;
use taxel_model::{FitOptions, Flag, PLAYS, Samples, Status};

use super::scans::modules;
use super::*;
use crate::intake::faults::fault::Fault;
use crate::intake::faults::limits::FaultLimits;
use crate::zero::rest::tests::Noise;

pub const PERIOD_S: f64 = 0.02;
const TAXELS: usize = 30;

/// A recording that owns its columns.
#[derive(Clone)]
pub struct Skin {
    pub time_s: Vec<f64>,
    pub kpa: Vec<f64>,
    pub counts: Vec<Vec<f64>>,
}

impl Skin {
    /// Falling counts that follow `kpa` through a play of `slack_kpa`, shifted by `shift` counts.
    fn new(kpa: Vec<f64>, slack_kpa: f64, shift: f64, seed: u64) -> Self {
        let mut noise = Noise(seed);
        let felt = felt(&kpa, slack_kpa);
        let column = |taxel: usize| {
            let gain = 30.0 + taxel as f64;
            let count = |p: &f64| 235.0 + shift - gain * p / (p + 200.0);
            felt.iter().map(|p| (count(p) + 1.0 * noise.normal()).round()).collect()
        };
        let counts = (0..TAXELS).map(column).collect();
        Self { time_s: (0..kpa.len()).map(|i| i as f64 * PERIOD_S).collect(), kpa, counts }
    }

    /// Rest, up to 200 kPa in 30 s, down again, rest.
    fn cycle(slack_kpa: f64) -> Self {
        Self::new(cycle(4.0, 200.0), slack_kpa, 0.0, 1)
    }

    pub fn scans(&self) -> Scans<'_> {
        Scans {
            time_s: &self.time_s,
            pressure_kpa: Some(&self.kpa),
            counts: self.counts.iter().map(Vec::as_slice).collect(),
        }
    }

    fn spoil(&mut self, taxel: usize, seconds: std::ops::Range<f64>, count: impl Fn(usize) -> f64) {
        let scans = (seconds.start / PERIOD_S) as usize..(seconds.end / PERIOD_S) as usize;
        for i in scans {
            self.counts[taxel][i] = count(i);
        }
    }
}

/// The pressure after a play.
fn felt(kpa: &[f64], slack_kpa: f64) -> Vec<f64> {
    let follow = |felt: &mut f64, p: &f64| {
        *felt = felt.max(p - slack_kpa).min(p + slack_kpa);
        Some(*felt)
    };
    kpa.iter().scan(kpa[0], follow).collect()
}

fn cycle(rest: f64, top: f64) -> Vec<f64> {
    let ramp = |n: usize, from: f64, to: f64| (0..n).map(move |i| from + (to - from) * i as f64 / n as f64);
    ramp(400, rest, rest)
        .chain(ramp(1500, rest, top))
        .chain(ramp(1500, top, rest))
        .chain(ramp(400, rest, rest))
        .collect()
}

fn fitted(skin: &Skin, recipe: &FitRecipe) -> crate::model_set::ModelSet {
    fit(&skin.scans(), recipe, &OneByOne).unwrap()
}

fn find(skin: &Skin) -> Masks {
    Masks::find(&skin.scans(), &modules(TAXELS, 10), &FaultLimits::default())
}

/// First and last masked time of a taxel, seconds.
fn masked(masks: &Masks, taxel: usize) -> Option<(f64, f64)> {
    let masked = masks.of(taxel);
    let first = masked.iter().position(|m| *m)?;
    Some((first as f64 * PERIOD_S, masked.iter().rposition(|m| *m)? as f64 * PERIOD_S))
}

#[test]
fn faults_are_masked_from_their_onset_until_they_are_over() {
    let mut skin = Skin::cycle(5.0);
    skin.spoil(3, 20.0..30.0, |_| 240.0);
    skin.spoil(5, 20.0..20.5, |_| 255.0);
    let mut noise = Noise(9);
    let jumps: Vec<f64> = (0..4000).map(|_| (210.0 + 7.0 * noise.normal()).clamp(1.0, 254.0).round()).collect();
    skin.spoil(7, 20.0..30.0, |i| jumps[i]);
    let masks = find(&skin);
    let (begin, end) = masked(&masks, 3).unwrap();
    assert!((19.9..=20.02).contains(&begin), "a freeze counts from its beginning, not from its discovery: {begin}");
    assert!((31.9..32.5).contains(&end), "and is over 2 s after the first change: {end}");
    let (begin, end) = masked(&masks, 5).unwrap();
    assert!((19.98..=20.02).contains(&begin) && (22.3..22.6).contains(&end), "rail {begin} {end}");
    let (begin, end) = masked(&masks, 7).unwrap();
    assert!((18.5..20.0).contains(&begin), "a flicker counts from before it was found: {begin}");
    assert!((31.0..37.0).contains(&end), "jumping until {end}");
    let faults = [3, 5, 7].map(|t| masks.main_fault(t));
    assert_eq!(faults, [Some(Fault::Frozen), Some(Fault::Rail), Some(Fault::Jumping)]);
    for sound in (0..TAXELS).filter(|t| ![3, 5, 7].contains(t)) {
        assert_eq!(masked(&masks, sound), None, "taxel {sound}");
        assert_eq!(masks.main_fault(sound), None);
    }
}

#[test]
fn taxels_that_cannot_be_fitted_say_why() {
    let mut skin = Skin::cycle(5.0);
    skin.spoil(0, 0.0..40.0, |_| 255.0);
    skin.spoil(1, 20.0..60.0, |_| 240.0);
    skin.spoil(2, 0.0..76.0, |_| 240.0);
    skin.spoil(4, 0.0..40.0, |_| f64::NAN);
    skin.spoil(4, 50.0..51.0, |_| 255.0); // for a shorter time than it is missing
    for (i, count) in skin.counts[6].iter_mut().enumerate() {
        *count += ((i as f64 / 300.0).sin() * 4.0).round(); // sound to every detector, and wrong
    }
    skin.counts[8][2000] = 0.0; // one bad reading is no reason
    let set = fitted(&skin, &FitRecipe::default());
    let status = |taxel: usize| set.taxels[taxel].status;
    assert!(matches!(status(0), Status::Railed { share } if share > 0.5), "{:?}", status(0));
    assert!(matches!(status(1), Status::Frozen { .. }), "{:?}", status(1));
    assert!(matches!(status(2), Status::Dead { .. }), "{:?}", status(2));
    assert!(matches!(status(4), Status::Missing { .. }), "{:?}", status(4));
    assert!(matches!(status(6), Status::PoorFit { .. }), "{:?}", status(6));
    assert_eq!(status(8), Status::Ok);
    let usable = set.taxels.iter().filter(|model| model.is_usable()).count();
    assert_eq!(usable, TAXELS - 5);
}

#[test]
fn plays_take_the_loop_out_of_what_was_not_fitted() {
    let with = fitted(&Skin::cycle(8.0), &FitRecipe::default());
    let recorded = with.recorded.unwrap();
    assert!(recorded.plays_error_ratio.unwrap() < 0.7, "{:?}", recorded.plays_error_ratio);
    assert!(recorded.taxels.iter().flatten().all(|taxel| taxel.plays.is_some()));
    let without = fitted(&Skin::cycle(0.0), &FitRecipe::default()).recorded.unwrap();
    assert!(without.plays_error_ratio.unwrap() > 0.9, "{:?}", without.plays_error_ratio);
    assert!(without.taxels.iter().flatten().all(|taxel| taxel.plays.is_none()));
    let rising = FitRecipe { branch: Branch::Rising, ..FitRecipe::default() };
    assert_eq!(fitted(&Skin::cycle(8.0), &rising).recorded.unwrap().plays_error_ratio, None);
}

/// Twenty sensitive taxels in a bag up to 70 kPa that follow the pressure through a play of 8 kPa alone.
fn pure_play() -> Skin {
    let mut skin = Skin::new(cycle(0.0, 70.0), 8.0, 0.0, 1);
    let (mut noise, felt) = (Noise(11), felt(&skin.kpa, 8.0));
    skin.counts.truncate(20);
    for column in &mut skin.counts {
        column.iter_mut().zip(&felt).for_each(|(count, p)| *count = (230.0 - 1.5 * p + 0.7 * noise.normal()).round());
    }
    skin
}

#[test]
fn a_taxel_is_judged_with_its_plays() {
    let skin = pure_play();
    let error = |plays: bool| {
        let set = fitted(&skin, &FitRecipe { plays, ..FitRecipe::default() });
        assert!(set.taxels.iter().all(taxel_model::TaxelModel::is_usable), "{:?}", set.taxels[0].status);
        assert!(set.recorded.unwrap().taxels.iter().flatten().all(|taxel| taxel.plays.is_some() == plays));
        set.taxels.iter().map(|model| model.quality.rmse_kpa).fold(0.0, f64::max)
    };
    let (with, without) = (error(true), error(false));
    assert!(with < 3.0 && without > 2.0 * with, "{with} {without}");
}

#[test]
fn beyond_the_calibrated_range_readings_go_on_and_their_interval_grows() {
    let set = fitted(&Skin::cycle(0.0), &FitRecipe::default());
    let read = |top: f64| {
        let skin = Skin::new([vec![4.0; 300], cycle(4.0, top)].concat(), 0.0, 0.0, 3);
        let applied = apply(&skin.scans(), &set, Tare::Auto).unwrap();
        let beyond: Vec<f64> = skin.kpa.iter().map(|p| p - 4.0).collect();
        (judge(&applied, &beyond), applied)
    };
    let (score, applied) = read(300.0);
    let highest = applied.columns.iter().flatten().flat_map(|column| &column.kpa).copied().fold(0.0, f64::max);
    assert!((245.0..340.0).contains(&highest), "{highest}");
    // This skin stiffens without end: its curves bend more and more, always to the same side of a straight line.
    assert!(score.beyond_percent > 10.0 && score.coverage_beyond_percent.unwrap() > 75.0, "{score:?}");
    // Too far for a straight line: the pressure stays, and the uncertainty goes on.
    let (_, applied) = read(900.0);
    let widest = applied.columns.iter().flatten().flat_map(|column| &column.sigma_kpa).copied().fold(0.0, f64::max);
    assert!(widest > 100.0, "{widest}");
}

#[test]
fn a_recording_without_pressure_or_scans_is_no_panic() {
    let skin = Skin::cycle(0.0);
    let without = Scans { pressure_kpa: None, ..skin.scans() };
    assert_eq!(fit(&without, &FitRecipe::default(), &OneByOne).unwrap_err(), RecordingError::NoPressure);
    let nothing = vec![f64::NAN; skin.kpa.len()];
    let gone = Scans { pressure_kpa: Some(&nothing), ..skin.scans() };
    assert!(fit(&gone, &FitRecipe::default(), &OneByOne).is_err());
    let set = fitted(&skin, &FitRecipe::default());
    for scans in [0, 1, 29] {
        let time_s = vec![0.0; scans];
        let counts = skin.counts.iter().map(|column| &column[..scans]).collect();
        let short = Scans { time_s: &time_s, pressure_kpa: None, counts };
        assert!(apply(&short, &set, Tare::Auto).unwrap().zero.moved.is_none());
    }
    let mut fewer = skin.scans();
    fewer.counts.pop();
    let error = apply(&fewer, &set, Tare::Auto).unwrap_err();
    assert_eq!(error, RecordingError::Taxels { recorded: TAXELS - 1, models: TAXELS });
}

#[test]
fn what_is_a_recording_and_what_is_a_table() {
    let skin = Skin::cycle(0.0);
    assert!(skin.scans().is_recording());
    let mut one = skin.scans();
    one.counts.truncate(1);
    assert!(!one.is_recording(), "a single column is a table");
    let mut real = skin.clone();
    real.counts[0][5] = 0.5;
    assert!(!real.scans().is_recording(), "real abscissae");
    let mut wide = skin.clone();
    wide.counts[0][5] = 256.0;
    assert!(!wide.scans().is_recording(), "more than eight bits");
    let short: Vec<&[f64]> = skin.counts.iter().map(|c| &c[..279]).collect();
    let few = Scans { time_s: &skin.time_s[..279], pressure_kpa: None, counts: short };
    assert!(!few.is_recording(), "279 rows");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_running_mean_is_the_mean_of_what_is_sound(
        values in proptest::collection::vec((0_u8..=255, proptest::bool::weighted(0.2)), 1..60), half in 0_usize..10,
    ) {
        let (counts, masked): (Vec<f64>, Vec<bool>) = values.iter().map(|&(c, m)| (f64::from(c), m)).unzip();
        let got = smooth(&counts, &masked, half);
        for (i, got) in got.into_iter().enumerate() {
            let window = i.saturating_sub(half)..counts.len().min(i + half + 1);
            let sound: Vec<f64> = window.filter(|&k| !masked[k]).map(|k| counts[k]).collect();
            let want = sound.iter().sum::<f64>() / sound.len() as f64;
            prop_assert!(got == want || (got.is_nan() && sound.is_empty()), "{i}: {got} {want}");
        }
    }

    /// Whatever the columns hold, nothing panics, and what comes out is finite or not there.
    #[test]
    fn no_recording_panics(
        counts in proptest::collection::vec(proptest::collection::vec(
            prop_oneof![6 => (0_u8..=255).prop_map(f64::from), 1 => Just(f64::NAN), 2 => Just(240.0)], 300), 1..4),
        kpa in proptest::collection::vec(prop_oneof![9 => 0.0..300.0_f64, 1 => Just(f64::NAN)], 300),
        backwards: bool,
    ) {
        let time_s: Vec<f64> = (0..300).map(|i| f64::from(if backwards { 300 - i } else { i }) * 0.02).collect();
        let scans = Scans { time_s: &time_s, pressure_kpa: Some(&kpa), counts: counts.iter().map(Vec::as_slice).collect() };
        let Ok(set) = fit(&scans, &FitRecipe::default(), &OneByOne) else { return Ok(()) };
        let applied = apply(&scans, &set, Tare::Auto).unwrap();
        prop_assert!(applied.columns.iter().flatten().flat_map(|column| &column.kpa).all(|p| p.is_nan() || p.is_finite()));
        for taxel in set.recorded.iter().flat_map(|recorded| &recorded.taxels).flatten() {
            let weights: [f64; PLAYS] = taxel.plays.as_ref().map_or([0.0; PLAYS], |plays| plays.weights_kpa);
            prop_assert!(weights.iter().all(|w| *w >= 0.0) && taxel.sensitivity > 0.0);
        }
    }
}

#[test]
fn what_the_gauge_reads_at_rest_is_taken_off_where_it_is_shown() {
    let less = fitted(&Skin::cycle(5.0), &FitRecipe::default());
    let top = running_median(&Skin::cycle(5.0).kpa, legs::GAUGE_MEDIAN_SCANS).into_iter().fold(0.0, f64::max);
    assert!((top - less.pressure_max_kpa - 4.0).abs() < 1e-9, "{}", less.pressure_max_kpa);
    assert!(less.method.ends_with(", less 4.0 kPa that the gauge read at rest"), "{}", less.method);
    assert!(less.gauge_offset_kpa > 4.0 / 2.0, "and stays uncertain: {}", less.gauge_offset_kpa);
}
