//! What a fit makes of the samples of a session, with ramps whose zeros differ, and why there is none.

use std::sync::Arc;

use super::branch::Branch;
use super::job::{FitJob, refuse_gaps};
use super::samples::{RampBaseline, Sample, SessionSamples};
use super::session::tests::plan;
use super::view::{SampleRefusal, SessionState};
use crate::baseline::{Activation, TaxelBaseline};
use crate::force::tables::Tables;
use crate::model_set::ModelSet;
use taxel_skin::SquareMillimetre;

const TAXELS: usize = 4;

/// Counts fall by two and a little more a kilopascal. Each ramp goes up to 60 kPa in 20 s, and down again if it `falls`,
/// from a zero of its own.
fn gathered(zeros: &[u16], falls: bool) -> SessionSamples {
    let mut all = SessionSamples::default();
    for (ramp, &zero) in (0..).zip(zeros) {
        let rest = TaxelBaseline { mean: f64::from(zero), noise: 0.5 };
        all.ramps.push(RampBaseline { ramp, taxels: vec![rest; TAXELS], gauge_kpa: Some(0.0) });
        let up = 0..=400_i64;
        let down = (0..if falls { 400 } else { 0 }).rev();
        for (k, step) in (0..).zip(up.chain(down)) {
            let pressure_kpa = 0.15 * step as f64;
            let count = |taxel: usize| f64::from(zero) - (2.0 + 0.1 * taxel as f64) * pressure_kpa;
            let counts: Vec<u16> = (0..TAXELS).map(|taxel| count(taxel).round() as u16).collect();
            let time_ns = (i64::from(ramp) * 100_000 + 50 * k) * 1_000_000;
            all.samples.push(Sample { ramp, time_ns, pressure_kpa, counts: counts.into() });
        }
    }
    all
}

fn job(samples: SessionSamples, branch: Branch) -> FitJob {
    FitJob {
        sessions: vec![7],
        wall_ns: 5,
        board_settings: vec!["as they are".to_owned()],
        ..FitJob::new(&plan(), branch, Arc::new(samples))
    }
}

fn set(job: &FitJob) -> Arc<ModelSet> {
    job.run(|_| "m-1".to_owned()).result.unwrap()
}

#[test]
fn ramps_from_different_zeros_are_one_curve_about_the_zero_of_the_last() {
    for zeros in [[240, 230], [230, 240]] {
        let set = set(&job(gathered(&zeros, false), Branch::Rising));
        for (taxel, model) in set.taxels.iter().enumerate() {
            let at_30_kpa = f64::from(zeros[1]) - 30.0 * (2.0 + 0.1 * taxel as f64);
            let read = model.evaluate(at_30_kpa).unwrap().kpa;
            assert!((read - 30.0).abs() < 0.5 && model.quality.rmse_kpa < 0.5, "taxel {taxel}: {read} kPa, {model:?}");
        }
        assert_eq!(set.baseline[0].mean, f64::from(zeros[1]));
        assert_eq!((set.session, set.pressure_max_kpa, set.recorded.is_none()), (Some(7), 60.0, true));
    }
}

/// From the first sample of a ramp on.
#[test]
fn another_zero_of_a_ramp_changes_no_curve() {
    let curves = |zeros: &[u16]| set(&job(gathered(zeros, false), Branch::Rising)).taxels.clone();
    assert_eq!(curves(&[240, 240, 240]), curves(&[225, 216, 240]));
    // What a ramp without a zero of a taxel reads changes nothing, its first sample neither.
    let with = |first: u16| {
        let mut samples = gathered(&[240; 8], false);
        samples.ramps[1].taxels[2].mean = f64::NAN;
        let of_ramp = samples.samples.iter_mut().find(|sample| sample.ramp == 1).unwrap();
        of_ramp.counts = vec![240, 240, first, 240].into();
        set(&job(samples, Branch::Rising)).taxels.clone()
    };
    assert!(with(200)[2].is_usable());
    assert_eq!(with(200), with(240));
}

/// A skin that bends nine times as much at rest as at the upper end: by ([`steeper_at_rest`](super::gauge_zero)) 8 over the root
/// of 3 the uncertainty of the zero.
#[test]
fn a_zero_of_the_gauge_is_less_certain_on_a_skin_that_bends_more_at_rest() {
    let offset_kpa = |count: fn(f64) -> f64| {
        let mut samples = gathered(&[240], false);
        samples.ramps[0].gauge_kpa = Some(0.06);
        for sample in &mut samples.samples {
            sample.counts = vec![count(sample.pressure_kpa).round() as u16; TAXELS].into();
            sample.pressure_kpa += 0.06;
        }
        let set = set(&job(samples.clone(), Branch::Rising));
        [set.gauge_offset_kpa, samples.gauge_zero_sigma_kpa(&set)] // a certificate asks for the second
    };
    let (straight, bent) = (offset_kpa(|kpa| 240.0 - 2.0 * kpa), offset_kpa(|kpa| 240.0 - 20.0 * kpa.sqrt()));
    let own = straight[0].powi(2) - (0.06_f64.powi(2)) / 3.0;
    let raised = ((bent[0].powi(2) - own) / (straight[0].powi(2) - own)).sqrt();
    assert!((2.0..7.0).contains(&raised), "{straight:?} {bent:?} {raised}");
    assert!((bent[1] / straight[1] - raised).abs() < 1e-6, "{straight:?} {bent:?} {raised}");
}

#[test]
fn what_a_zero_is_off_by_after_a_ramp_is_what_it_was_off_by_from_ramp_to_ramp() {
    let returned = |zeros: &[u16]| {
        let set = set(&job(gathered(zeros, true), Branch::Both));
        let recorded = set.recorded.as_ref().unwrap();
        recorded.zero_return_counts
    };
    let near = |is: Option<f64>, expected: f64| {
        assert!((is.unwrap() - expected).abs() < 1e-9, "{is:?} is not {expected}");
    };
    near(returned(&[240, 239]), 1.0);
    near(returned(&[240, 242, 242]), 2.0_f64.sqrt());
    near(returned(&[240, 230, 229]), 1.0); // a board that took a new zero is no return
    near(returned(&[240, 237]), 3.0);
    assert_eq!(returned(&[240]), None, "a ramp that does not end unloaded tells nothing");
}

#[test]
fn why_there_is_no_set_is_told() {
    let why = |samples: SessionSamples| job(samples, Branch::Rising).run(|_| String::new()).result.unwrap_err();
    let nothing = "no sample was gathered: the pressure never rose while every module was heard";
    assert_eq!(why(SessionSamples::default()), nothing);
    let never_fell = job(gathered(&[240], false), Branch::Both).run(|_| String::new()).result.unwrap_err();
    assert!(never_fell.starts_with("nothing was gathered while the pressure fell"), "{never_fell}");
    let mut still = gathered(&[240], false);
    still.samples.iter_mut().for_each(|sample| sample.counts = vec![240; TAXELS].into());
    let why = why(still);
    assert!(why.starts_with("no taxel moves: all counts stay the same"), "{why}");
}

#[test]
fn a_gap_between_the_pressures_gives_no_set() {
    let without = |from: f64, to: f64| {
        let mut samples = gathered(&[240], false);
        samples.samples.retain(|sample| !(from..to).contains(&sample.pressure_kpa));
        job(samples, Branch::Rising).run(|_| String::new()).result.map(|set| set.pressure_max_kpa)
    };
    let why = without(3.0, 40.0).unwrap_err();
    let expected = "nothing was gathered between 2.9 and 40.0 kPa, because the pressure rose too fast or a module was not heard: \
                    pump slowly all the way, so that no gap is wider than 30 % of the 60.0 kPa that were reached";
    assert_eq!(why, expected);
    assert_eq!(without(20.0, 37.0), Ok(60.0));
    assert!(without(0.0, 5.1).unwrap_err().starts_with("nothing was gathered below 5.1 kPa"));
    // Up to both limits, and not beyond.
    assert_eq!(refuse_gaps(&[5.0, 20.0, 38.0, 55.0, 60.0]), Ok(()));
    assert!(refuse_gaps(&[5.001, 20.0, 38.0, 55.0, 60.0]).is_err());
    assert!(refuse_gaps(&[5.0, 20.0, 38.001, 55.0, 60.0]).is_err());
}

/// By how much the skin reads too much at the counts of each tenth of a ramp, over what all taxels have in common in their
/// uncertainty; the greatest. `truth` is what lies on a taxel while the gauge reads so much.
fn worst(samples: SessionSamples, truth: impl Fn(usize, f64) -> f64) -> f64 {
    let set = set(&job(samples, Branch::Rising));
    let areas = [SquareMillimetre(100.0); TAXELS];
    let activation = Activation { sigmas: 3.0, floor_counts: 2.0 };
    let tables = Tables::new(Arc::clone(&set), &set.baseline, &areas, activation);
    let of = |taxel: usize, kpa: f64| {
        let count = (240.0 - (2.0 + 0.1 * taxel as f64) * truth(taxel, kpa)).round() as u16;
        let reading = tables.reading(taxel, count, 0.0).unwrap();
        let off_kpa = (f64::from(reading.pressure_kpa) - truth(taxel, kpa)).abs() - 0.5; // less the rounding of counts
        if reading.active { off_kpa / f64::from(reading.shared_kpa) } else { 0.0 }
    };
    (0..TAXELS).flat_map(|taxel| (1..10).map(move |step| of(taxel, 6.0 * f64::from(step)))).fold(0.0, f64::max)
}

#[test]
fn what_two_ramps_lie_apart_is_in_the_uncertainty_of_a_sum() {
    let mut samples = gathered(&[240, 240], false);
    samples.samples.iter_mut().filter(|sample| sample.ramp == 1).for_each(|sample| sample.pressure_kpa += 6.0);
    let worst = worst(samples, |_, kpa| kpa);
    assert!(worst < 2.0, "{worst} standard uncertainties");
}

/// A bag that does not lie on everything at once: up to 6 kPa nothing presses on two taxels of four.
#[test]
fn what_a_curve_reads_at_its_own_zero_is_in_the_uncertainty_of_a_sum() {
    let snaps = |taxel: usize, kpa: f64| if taxel < 2 && kpa < 6.0 { 0.0 } else { kpa };
    let bridges = |taxel: usize, kpa: f64| if taxel < 2 { (kpa - 6.0).max(0.0) } else { kpa };
    let truths: [&dyn Fn(usize, f64) -> f64; 2] = [&snaps, &bridges];
    for truth in truths {
        let mut samples = gathered(&[240], false);
        for sample in &mut samples.samples {
            let count = |taxel: usize| 240.0 - (2.0 + 0.1 * taxel as f64) * truth(taxel, sample.pressure_kpa);
            sample.counts = (0..TAXELS).map(|taxel| count(taxel).round() as u16).collect::<Vec<u16>>().into();
        }
        let worst = worst(samples, truth);
        assert!(worst < 3.0, "{worst} standard uncertainties");
    }
}

/// Of the same skin, whose bag bridges two taxels up to 6 kPa, with counts that fall and with counts that rise.
#[test]
fn what_a_curve_reads_at_its_own_zero_is_as_much_where_counts_rise() {
    let curve_sigmas_kpa = |mirrored: bool| {
        let mirror = |count: f64| if mirrored { 255.0 - count } else { count };
        let mut samples = gathered(&[240], false);
        samples.ramps[0].taxels.iter_mut().for_each(|rest| rest.mean = mirror(rest.mean));
        for sample in &mut samples.samples {
            let pressed =
                |taxel: usize| if taxel < 2 { (sample.pressure_kpa - 6.0).max(0.0) } else { sample.pressure_kpa };
            let count = |taxel: usize| mirror((240.0 - (2.0 + 0.1 * taxel as f64) * pressed(taxel)).round());
            sample.counts = (0..TAXELS).map(|taxel| count(taxel) as u16).collect::<Vec<u16>>().into();
        }
        set(&job(samples, Branch::Rising)).curve_sigmas_kpa()
    };
    let (falling, rising) = (curve_sigmas_kpa(false), curve_sigmas_kpa(true));
    assert!(falling[0] > 1.0 && falling[3] < 0.5, "{falling:?}");
    assert!(falling.iter().zip(&rising).all(|(a, b)| (a - b).abs() < 1e-6), "{falling:?} {rising:?}");
}

#[test]
fn states_and_refusals_have_the_words_of_the_service() {
    let words = SessionState::ALL.map(SessionState::name).join(" ");
    assert_eq!(words, "TARING RAMPING FITTING REVIEW ACTIVE DISCARDED ABORTED FAILED INTERRUPTED");
    let words = SampleRefusal::ALL.map(SampleRefusal::name).join(" ");
    let expected =
        "not_rising too_fast no_pressure stale_module full gauge_spike not_falling zero_in_check gauge_stuck";
    assert_eq!(words, expected);
    let on_disk = SampleRefusal::ALL.map(|reason| serde_json::to_string(&reason).unwrap());
    assert_eq!(on_disk.join(" ").replace('"', ""), expected);
}
