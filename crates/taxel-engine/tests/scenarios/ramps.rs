//! What enters a session and what does not: only scans of the whole skin, while the pressure rises and is known.

use taxel_model::{Status, TaxelModel};
use taxel_sim::Skin;

use crate::prelude::*;
use crate::rig::triangles;
use crate::say::{self, start};

fn refused(bench: &Bench, reason: SampleRefusal) -> u64 {
    bench.host.session().refused.get(reason)
}

/// Samples on record count up from 0 and never lie below the highest so far by more than the noise band, ramp by ramp.
fn samples_rise(bench: &Bench, session: u64) {
    let indexes = bench.host.records.iter().filter_map(|record| match record {
        Record::Sample { session: of, index, .. } if *of == session => Some(*index),
        _ => None,
    });
    assert!(indexes.enumerate().all(|(n, index)| n as u64 == index), "positions without gaps");
    let samples = bench.host.samples(session);
    assert_eq!(samples.len() as u64, bench.host.session().accepted, "what was accepted is on record");
    let band = bench.host.plan.patches[0].session.noise_band.0;
    for ramp in samples.chunk_by(|a, b| a.ramp == b.ramp) {
        let mut highest = f64::NEG_INFINITY;
        for sample in ramp {
            assert!(sample.pressure_kpa >= highest - band, "{} kPa after {highest} kPa", sample.pressure_kpa);
            highest = highest.max(sample.pressure_kpa);
        }
    }
}

#[test]
fn a_session_is_refused_at_once_while_the_gauge_is_silent_and_so_is_a_ramp() {
    let mut bench = fresh();
    let number = bench.start_session(None);
    bench.ask(Command::AbortSession { session: number, reason: None }).unwrap();
    bench.inject(Fault::GaugeSilent);
    bench.seconds(3.0);
    for command in [start(), Command::StartRamp { session: number }] {
        let refused = bench.refused(command);
        assert!(refused.starts_with("the gauge is silent: the last pressure came 3"), "{refused}");
    }
    let mut bench = bench.restarted(bench.host.plan.clone(), |_| ());
    bench.seconds(3.0);
    let refused = bench.refused(start());
    assert!(refused.starts_with("the gauge is silent: no pressure has been heard: is the gauge on"), "{refused}");
}

/// A bag that leaks as much as the pump takes out, or ends at the ambient pressure.
#[test]
fn a_rise_that_cannot_get_further_says_so_and_ends_with_what_it_has() {
    let mut bench = fresh();
    let number = bench.start_session(None);
    bench.ramp(40.0, 2.0);
    let offer = format!("taxeld sessions end {number} --fit");
    bench.until(60.0, "the offer", |host| host.session().reason.contains(&offer));
    let session = bench.host.session();
    assert_eq!(session.state, SessionState::Ramping);
    assert!(session.reason.starts_with("the pressure did not rise for 5 s: it is 40."), "{}", session.reason);
    bench.ramp(45.0, 2.0);
    bench.until(10.0, "no offer", |host| host.session().reason.is_empty());
    bench.until_state(90.0, SessionState::Review);
    let session = bench.host.session();
    assert!(
        session.reason.starts_with("the rise ended early: the pressure did not rise for 60 s"),
        "{}",
        session.reason
    );
    let set = bench.host.newest_set();
    assert!((44.0..46.0).contains(&set.pressure_max_kpa), "{}", set.pressure_max_kpa);
}

#[test]
fn a_target_is_above_zero_and_at_most_what_a_bag_reaches_unless_the_skin_lies_in_a_chamber() {
    let mut bench = fresh();
    for target in [0.0, -5.0, f64::NAN, f64::INFINITY, 95.1, 700.0] {
        let why = bench.ask(say::start_on("", Some(target), &[])).unwrap_err().to_string();
        let said = why.starts_with("target_kpa: ") && why.contains("at most 95: ");
        assert!(said && why.contains("pressurised_chamber = true"), "{target}: {why}");
    }
    assert_eq!(session_of(bench.ask(say::start_on("", Some(95.0), &[]))).target_kpa.to_bits(), 95.0_f64.to_bits());
    let chamber = |plan: &mut PatchPlan| plan.session.pressurised_chamber = true;
    fresh_with(chamber).ask(say::start_on("", Some(700.0), &[])).unwrap();
}

/// Nor what waited for its second when that began.
#[test]
fn nothing_enters_while_the_pressure_falls_or_the_gauge_or_a_module_is_silent() {
    let module = Fault::ModuleSilent(board(12), module(0));
    for (fault, why, settles_s, seconds, least) in [
        // The rate is that of the last second, and a scan waits for one.
        (None, SampleRefusal::NotRising, 2.2, 4.0, 75),
        (Some(Fault::GaugeSilent), SampleRefusal::NoPressure, 1.2, 1.5, 20),
        (Some(module), SampleRefusal::StaleModule, 1.2, 0.7, 12),
    ] {
        let (mut bench, number) = ramping(30.0);
        let began = bench.now().as_nanos();
        match fault {
            Some(fault) => bench.inject(fault),
            None => bench.ramp(10.0, 4.0),
        }
        bench.seconds(settles_s);
        let (accepted, before) = (bench.host.session().accepted, refused(&bench, why));
        bench.seconds(seconds);
        let session = bench.host.session();
        assert_eq!(session.accepted, accepted, "{why:?}");
        assert!(refused(&bench, why) >= before + least, "{session:?}");
        assert!(fault.is_none() || bench.host.samples(number).iter().all(|sample| sample.time_ns < began));
        let is_known = session.pressure_kpa.is_some();
        assert_eq!(is_known, !matches!(fault, Some(Fault::GaugeSilent)), "an old pressure is not the present one");
        if let Some(fault) = fault {
            bench.repair(fault);
        }
        bench.ramp(74.0, 4.0);
        bench.until_state(40.0, SessionState::Review);
        samples_rise(&bench, number);
    }
}

/// Boards that take a new zero between two ramps shift every count; each ramp brings its own zero to the fit.
#[test]
fn a_second_ramp_at_another_zero_is_added_and_all_is_fitted_again() {
    let (mut bench, session) = ramping(35.0);
    let kept = bench.finish(session);
    bench.vent(1.0);
    bench.ramp(3.0, 5.0); // the new zero is taken under 3 kPa, so that it differs
    bench.seconds(2.0);
    bench.ask(say::bring_up(None)).unwrap();
    bench.seconds(1.0);
    bench.vent(20.0);
    bench.ramp_again(session);
    bench.ramp(40.0, 4.0);
    bench.seconds(8.0);
    let id = bench.finish(session);
    samples_rise(&bench, session);
    let fitted = &bench.host.fits[1].samples;
    let rest = |ramp: usize| fitted.ramps[ramp].taxels.iter().map(|t| t.mean).sum::<f64>() / 80.0;
    assert!((rest(1) - rest(0)).abs() > 3.0, "rest at {} and {} counts", rest(0), rest(1));
    let per_ramp = [0, 1].map(|ramp| fitted.samples.iter().filter(|s| s.ramp == ramp).count());
    assert!(
        per_ramp.iter().all(|&n| n > 100) && per_ramp.iter().sum::<usize>() as u64 == bench.host.session().accepted
    );
    let [first, set] = [0, 1].map(|position| bench.host.set(position));
    assert_eq!((id, kept), (set.id.clone(), first.id.clone()), "the first set is kept");
    let mut kpa: Vec<f64> = set.taxels.iter().filter_map(|m| m.quality.repeatability_kpa).collect();
    kpa.sort_by(f64::total_cmp);
    assert!(kpa.len() >= 70 && kpa[kpa.len() / 2] < 0.7, "the ramps differ by {kpa:.2?} kPa");
}

/// What a gauge reads beyond what a vented bag may keep would be in every model, also if it jumps while the zero of the ramp is
/// taken.
#[test]
fn no_session_begins_with_a_gauge_that_reads_more_than_a_vented_bag_may_keep() {
    let mut bench = fresh();
    let off = Fault::GaugeOffset { kpa: 12.5 };
    bench.inject(off);
    bench.seconds(1.0);
    let why = bench.refused(start());
    assert!(why.contains("the bag is at 12.") && why.contains("the gauge's scale or offset is wrong"), "{why}");
    bench.repair(off);
    bench.seconds(1.0);
    session_of(bench.ask(start()));
    bench.inject(off);
    bench.until(10.0, "a refusal", |host| host.session().reason.contains("the gauge's scale or offset is wrong"));
    assert_eq!(bench.host.session().accepted, 0);
}

/// The median over its calibrated counts of how far two models of one taxel lie apart, kPa.
fn apart_kpa(a: &TaxelModel, b: &TaxelModel) -> f64 {
    let [low, high] = a.range.unwrap();
    let mut apart: Vec<f64> = (low as u32..=high as u32)
        .map(|count| (a.evaluate(count.into()).unwrap().kpa - b.evaluate(count.into()).unwrap().kpa).abs())
        .collect();
    apart.sort_by(f64::total_cmp);
    apart[apart.len() / 2]
}

/// What a taxel says while it is broken does not enter its curve; broken for too long it is left out by name.
#[test]
fn a_fault_during_a_ramp_does_not_spoil_the_fit() {
    let calibrated = |fault_s: f64| {
        let mut bench = fresh();
        let session = bench.start_session(None);
        bench.ramp(74.0, 2.0);
        bench.seconds(10.0);
        let faults = [5, 37].map(|taxel| Fault::TaxelFrozen(TaxelIndex(taxel)));
        faults.into_iter().for_each(|fault| bench.inject(fault));
        bench.seconds(fault_s);
        faults.into_iter().for_each(|fault| bench.repair(fault));
        bench.seconds(24.0 - fault_s);
        bench.finish(session);
        bench.host.set(0)
    };
    let (sound, shortly, long) = (calibrated(0.0), calibrated(6.0), calibrated(14.0));
    for taxel in [5, 37] {
        let model = &shortly.taxels[taxel];
        assert!(model.is_usable(), "{}", model.status);
        assert!(model.quality.samples < sound.taxels[taxel].quality.samples - 100, "{:?}", model.quality);
        let apart = apart_kpa(&sound.taxels[taxel], model);
        assert!(apart < 0.5, "taxel {taxel} is {apart} kPa off");
        assert!(
            matches!(long.taxels[taxel].status, Status::Frozen { share } if share > 0.3),
            "{:?}",
            long.taxels[taxel]
        );
    }
    let usable = |set: &ModelSet| set.taxels.iter().filter(|m| m.is_usable()).count();
    assert_eq!((usable(&shortly), usable(&long)), (usable(&sound), usable(&sound) - 2), "no other taxel is touched");
}

/// Every board sends when it likes: between the first and the last of three may lie two thirds of a period.
#[test]
fn a_sample_has_all_boards_of_one_scan_and_none_of_the_next() {
    let skin = Skin::sleeve(triangles("small", &[(13, 0..3), (12, 0..2), (11, 0..2)]));
    let plan = plan(patch_plan(&skin));
    let mut mixed = 0;
    for seed in 1..=8 {
        let world = World::new(skin.clone(), Config::seeded(seed));
        let mut bench = Bench::new(world, Arc::clone(&plan), Restored::default());
        bench.brought_up();
        bench.start_session(None);
        bench.ramp(74.0, 4.0);
        bench.seconds(3.0);
        let stale = |bench: &Bench| bench.host.session().refused.get(SampleRefusal::StaleModule);
        assert!(stale(&bench) == 0 && bench.host.session().accepted > 0, "seed {seed}: {:?}", bench.host.session());
        // Every board misses one scan, of the same number or of two.
        for offset_ms in (0..50).step_by(5) {
            let from = bench.now() + Duration::from_millis(offset_ms);
            let missed = from..from + bench.host.plan.patches[0].period;
            bench.passes = Box::new(move |frame| !missed.contains(&frame.time));
            bench.seconds(0.5);
        }
        mixed += stale(&bench);
    }
    // 26, and 2 if whatever has every module once were one scan.
    assert!(mixed > 20, "the first boards of a scan and the last ones of the next were taken for one: {mixed} refused");
}
