//! What enters a session and what does not: only scans of the whole skin, while the pressure rises and is known.

use std::sync::Arc;
use std::time::Duration;

use taxel_engine::Restored;
use taxel_engine::calibration::{SampleRefusal, SessionState};
use taxel_engine::command::{Command, Rejection};
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::PatchPlan;
use taxel_engine::record::Record;
use taxel_model::{Status, TaxelModel};
use taxel_sim::{Config, Fault, PumpCommand, Skin, World};
use taxel_skin::{Board, Kilopascal, ModuleKind, Patch, TaxelIndex};

use crate::bench::{Bench, session_of};
use crate::rig::{BUS, board, module, patch_plan, plan, small_world};
use crate::shared::small;

/// Boards brought up, no session yet.
fn fresh(change: impl FnOnce(&mut PatchPlan)) -> Bench {
    let mut patch = patch_plan(&small().skin);
    change(&mut patch);
    let mut bench = Bench::new(small_world(), plan(patch), Restored::default());
    bench.brought_up();
    bench
}

/// A session on its way up, the bag at about `kpa`.
fn ramping(kpa: f64) -> (Bench, u64) {
    let mut bench = fresh(|_| {});
    let number = bench.start_session(None);
    bench.ramp(74.0, 4.0);
    bench.until(30.0, "pressure", |host| host.session().pressure_kpa.is_some_and(|p| p >= kpa));
    (bench, number)
}

fn refused(bench: &Bench, reason: SampleRefusal) -> u64 {
    bench.host.session().refused.get(reason)
}

fn impatient(plan: &mut PatchPlan) {
    plan.session.patience = Duration::from_secs(3);
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

fn start() -> Command {
    let (patch, leave_out) = (String::new(), Vec::new());
    Command::StartSession { patch, target: None, branches: None, confirmed_by: None, leave_out }
}

#[test]
fn a_session_is_refused_at_once_while_the_gauge_is_silent_and_so_is_a_ramp() {
    let mut bench = fresh(|_| {});
    let number = bench.start_session(None);
    bench.ask(Command::AbortSession { session: number }).unwrap();
    bench.inject(Fault::GaugeSilent);
    bench.seconds(3.0);
    for command in [start(), Command::StartRamp { session: number }] {
        let refused = bench.refused(command);
        assert!(refused.starts_with("the gauge is silent: its last reading came 3 s ago"), "{refused}");
    }
    let mut world = small_world();
    world.inject(Fault::GaugeSilent).unwrap();
    let mut bench = Bench::new(world, plan(patch_plan(&small().skin)), Restored::default());
    bench.brought_up();
    bench.seconds(3.0);
    let refused = bench.refused(start());
    assert!(refused.starts_with("the gauge is silent: no reading has come since the daemon started"), "{refused}");
}

/// A bag that leaks as much as the pump takes out, or ends at the ambient pressure.
#[test]
fn a_rise_that_cannot_get_further_says_so_and_ends_with_what_it_has() {
    let mut bench = fresh(|_| {});
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
fn a_target_that_no_bag_reaches_is_refused_unless_the_skin_lies_in_a_chamber() {
    let with = |target: f64| {
        let (patch, leave_out) = (String::new(), Vec::new());
        Command::StartSession { patch, target: Some(Kilopascal(target)), branches: None, confirmed_by: None, leave_out }
    };
    let mut bench = fresh(|_| {});
    let refused = format!("{:?}", bench.ask(with(700.0)));
    assert!(refused.contains("at most 95") && refused.contains("pressurised_chamber = true"), "{refused}");
    bench.ask(with(95.0)).unwrap();
    let mut bench = fresh(|plan| plan.session.pressurised_chamber = true);
    bench.ask(with(700.0)).unwrap();
}

#[test]
fn a_session_that_failed_keeps_its_samples_and_can_be_fitted() {
    let mut bench = fresh(impatient);
    let number = bench.start_session(None);
    bench.ramp(74.0, 4.0);
    bench.seconds(8.0);
    bench.inject(Fault::GaugeSilent);
    bench.until_state(6.0, SessionState::Failed);
    let accepted = bench.host.session().accepted;
    assert!(accepted > 100, "{:?}", bench.host.session());
    samples_rise(&bench, number);
    session_of(bench.ask(Command::FinishRamp { session: number }));
    bench.until_state(1.0, SessionState::Review);
    assert_eq!(bench.host.fits[0].samples.samples, bench.host.samples(number));
}

#[test]
fn a_pressure_that_does_not_rise_fails_the_session() {
    let mut bench = fresh(impatient);
    bench.start_session(None);
    bench.until_state(5.0, SessionState::Failed);
    let session = bench.host.session();
    assert!(session.reason.starts_with("the pressure did not rise for 3 s: it is "), "{session:?}");
    assert_eq!(session.accepted, 0);
    assert!(refused(&bench, SampleRefusal::NotRising) > 40, "{session:?}");
}

#[test]
fn too_fast_a_rise_is_refused_and_counted() {
    let mut bench = fresh(|_| {});
    bench.start_session(None);
    bench.ramp(60.0, 9.0);
    bench.seconds(6.0);
    let session = bench.host.session();
    assert!(refused(&bench, SampleRefusal::TooFast) > 80, "{session:?}");
    assert!(session.accepted < 20, "only while the pump gets going: {session:?}");
}

/// Of what is lighter than the first sample nothing is known, and skin is softest there.
#[test]
fn a_ramp_whose_beginning_was_lost_gives_no_models() {
    let mut bench = fresh(|_| {});
    bench.start_session(Some(40.0));
    bench.ramp(12.0, 400.0);
    bench.seconds(3.0);
    bench.ramp(50.0, 4.0);
    bench.until_state(40.0, SessionState::Failed);
    let session = bench.host.session();
    assert!(session.reason.contains("nothing was gathered below 1"), "{session:?}");
    assert!(session.reason.ends_with("so that there are samples below 5 kPa"), "{session:?}");
    assert!(session.accepted > 50 && session.model_set.is_none(), "{session:?}");
}

#[test]
fn nothing_enters_while_the_pressure_falls() {
    let (mut bench, number) = ramping(30.0);
    bench.ramp(10.0, 4.0);
    bench.seconds(2.2); // the rate is that of the last second, and a scan waits for one
    let (accepted, falling) = (bench.host.session().accepted, refused(&bench, SampleRefusal::NotRising));
    bench.seconds(4.0);
    assert_eq!(bench.host.session().accepted, accepted);
    assert!(refused(&bench, SampleRefusal::NotRising) >= falling + 75, "{:?}", bench.host.session());
    bench.ramp(74.0, 4.0);
    bench.until_state(40.0, SessionState::Review);
    samples_rise(&bench, number);
}

#[test]
fn nothing_enters_while_the_gauge_is_silent() {
    let (mut bench, number) = ramping(20.0);
    let silent_since = bench.now();
    bench.inject(Fault::GaugeSilent);
    bench.seconds(1.2); // what came before has waited for a second
    let accepted = bench.host.session().accepted;
    bench.seconds(1.5);
    assert_eq!(bench.host.session().accepted, accepted);
    assert!(bench.host.samples(number).iter().all(|sample| sample.time_ns < silent_since.as_nanos()));
    assert!(refused(&bench, SampleRefusal::NoPressure) >= 20, "{:?}", bench.host.session());
    assert_eq!(bench.host.session().pressure_kpa, None, "an old pressure is not shown as the present one");
    bench.repair(Fault::GaugeSilent);
    bench.until_state(40.0, SessionState::Review);
    samples_rise(&bench, number);
}

#[test]
fn nothing_enters_while_a_module_is_silent() {
    let (mut bench, number) = ramping(20.0);
    let silent_since = bench.now();
    bench.inject(Fault::ModuleSilent(board(12), module(0)));
    bench.seconds(1.2); // what came before has waited for a second
    let accepted = bench.host.session().accepted;
    bench.seconds(0.7);
    assert_eq!(bench.host.session().accepted, accepted);
    assert!(bench.host.samples(number).iter().all(|sample| sample.time_ns < silent_since.as_nanos()));
    assert!(refused(&bench, SampleRefusal::StaleModule) >= 30, "{:?}", bench.host.session());
    bench.repair(Fault::ModuleSilent(board(12), module(0)));
    bench.until_state(40.0, SessionState::Review);
    samples_rise(&bench, number);
}

/// Counts of two zeros in one ramp would make a wrong model of every taxel of the board.
#[test]
fn a_zero_that_is_lost_during_a_ramp_ends_the_ramp() {
    let (mut bench, _) = ramping(30.0);
    bench.inject(Fault::SilentRetare(board(12)));
    bench.seconds(1.0);
    let session = bench.host.session();
    assert_ne!(session.state, SessionState::Ramping, "the tare is {:?}", bench.host.snapshot().tare);
    assert!(session.reason.contains("board 12"), "{session:?}");
}

#[test]
fn a_ramp_finished_before_its_target_fits_what_is_there() {
    let (mut bench, number) = ramping(30.0);
    session_of(bench.ask(Command::FinishRamp { session: number }));
    bench.until_state(1.0, SessionState::Review);
    let set = bench.host.set(0);
    assert_eq!(Some(set.id.as_str()), bench.host.session().model_set.as_deref());
    // At 4 kPa/s the scans of the last second, which have not waited for long enough, are worth 4 kPa.
    assert!((25.5..27.5).contains(&set.pressure_max_kpa), "{} kPa", set.pressure_max_kpa);
    assert!(set.taxels.iter().filter(|m| m.is_usable()).count() >= 70);
    assert!((0.35..0.40).contains(&bench.host.session().coverage), "{:?}", bench.host.session());
}

#[test]
fn a_second_ramp_after_venting_is_added_and_all_is_fitted_again() {
    let (mut bench, number) = ramping(35.0);
    let why = bench.refused(Command::StartRamp { session: number });
    assert!(why.contains("is RAMPING"), "{why}");
    session_of(bench.ask(Command::FinishRamp { session: number }));
    bench.until_state(1.0, SessionState::Review);
    let why = bench.refused(Command::StartRamp { session: number });
    assert!(why.contains("vent it below 10.0 kPa first"), "{why}");
    bench.world.pump(PumpCommand::Vent);
    bench.seconds(20.0);
    session_of(bench.ask(Command::StartRamp { session: number }));
    bench.until_state(30.0, SessionState::Ramping);
    bench.ramp(40.0, 4.0);
    bench.seconds(8.0);
    session_of(bench.ask(Command::FinishRamp { session: number }));
    bench.until_state(1.0, SessionState::Review);
    samples_rise(&bench, number);
    let (session, fit) = (bench.host.session(), &bench.host.fits[1]);
    assert_eq!((session.ramps, fit.samples.ramps.len()), (2, 2));
    let per_ramp = [0, 1].map(|ramp| fit.samples.samples.iter().filter(|s| s.ramp == ramp).count());
    assert!(per_ramp.iter().all(|&n| n > 100) && per_ramp.iter().sum::<usize>() as u64 == session.accepted);
    let sets = [0, 1].map(|position| bench.host.set(position));
    assert_eq!(bench.host.catalogue.model_sets.len(), 2, "the set of the first fit is kept");
    let ids = (session.model_set.as_deref(), sets[0].taxels[0].quality.repeatability_kpa);
    assert_eq!(ids, (Some(sets[1].id.as_str()), None));
    let usable = sets[1].taxels.iter().filter(|m| m.is_usable());
    assert!(usable.clone().count() >= 70 && usable.clone().all(|m| m.quality.repeatability_kpa.is_some()));
}

/// Boards that take a new zero between two ramps shift every count; each ramp brings its own zero to the fit.
#[test]
fn ramps_at_different_zeros_are_brought_to_one() {
    let (mut bench, session) = ramping(35.0);
    bench.ask(Command::FinishRamp { session }).unwrap();
    bench.until_state(1.0, SessionState::Review);
    bench.world.pump(PumpCommand::Vent);
    bench.seconds(1.0);
    bench.ramp(3.0, 5.0); // the new zero is taken under 3 kPa, so that it differs
    bench.seconds(2.0);
    bench.ask(Command::BringUp { patch: String::new(), confirmed_by: None }).unwrap();
    bench.seconds(1.0);
    bench.world.pump(PumpCommand::Vent);
    bench.seconds(20.0);
    session_of(bench.ask(Command::StartRamp { session }));
    bench.until_state(30.0, SessionState::Ramping);
    bench.ramp(40.0, 4.0);
    bench.seconds(8.0);
    bench.ask(Command::FinishRamp { session }).unwrap();
    bench.until_state(1.0, SessionState::Review);
    let rest = |ramp: usize| bench.host.fits[1].samples.ramps[ramp].taxels.iter().map(|t| t.mean).sum::<f64>() / 80.0;
    assert!((rest(1) - rest(0)).abs() > 3.0, "rest at {} and {} counts", rest(0), rest(1));
    let set = &bench.host.set(1);
    let mut kpa: Vec<f64> = set.taxels.iter().filter_map(|m| m.quality.repeatability_kpa).collect();
    kpa.sort_by(f64::total_cmp);
    assert!(kpa.len() >= 70 && kpa[kpa.len() / 2] < 0.7, "the ramps differ by {kpa:.2?} kPa");
}

#[test]
fn an_aborted_session_keeps_its_samples_for_a_further_ramp() {
    let (mut bench, number) = ramping(30.0);
    let view = session_of(bench.ask(Command::AbortSession { session: number }));
    assert_eq!((view.state, view.reason.as_str()), (SessionState::Aborted, "an operator aborted it"));
    bench.seconds(1.0);
    assert_eq!(bench.host.session().accepted, view.accepted, "nothing enters any more");
    samples_rise(&bench, number);
    bench.world.pump(PumpCommand::Vent);
    bench.seconds(20.0);
    session_of(bench.ask(Command::StartRamp { session: number }));
    bench.until_state(30.0, SessionState::Ramping);
    bench.ramp(40.0, 4.0);
    bench.seconds(8.0);
    session_of(bench.ask(Command::FinishRamp { session: number }));
    bench.until_state(1.0, SessionState::Review);
    assert!(bench.host.session().accepted > view.accepted + 100);
    assert_eq!(bench.host.fits[0].samples.samples, bench.host.samples(number));
}

#[test]
fn no_session_begins_in_a_bag_under_vacuum() {
    let mut bench = fresh(|_| {});
    bench.ramp(20.0, 10.0);
    bench.seconds(4.0);
    let why = bench.refused(Command::StartSession {
        patch: String::new(),
        target: None,
        branches: None,
        confirmed_by: None,
        leave_out: Vec::new(),
    });
    assert!(why.contains("the bag is at 20.") && why.contains("vent it below 10.0 kPa first"), "{why}");
}

/// A vented bag is at the air's pressure: what a gauge reads below that is its own offset, and would be in every model.
#[test]
fn no_session_begins_with_a_gauge_that_reads_less_than_a_vented_bag_can_have() {
    let mut bench = fresh(|_| {});
    bench.inject(Fault::GaugeOffset { kpa: -7.8 });
    bench.seconds(1.0);
    let why = bench.refused(Command::StartSession {
        patch: String::new(),
        target: None,
        branches: None,
        confirmed_by: None,
        leave_out: Vec::new(),
    });
    assert!(why.contains("the gauge reads -7.") && why.contains("set the gauge's zero"), "{why}");
    bench.repair(Fault::GaugeOffset { kpa: -7.8 });
    bench.seconds(1.0);
    bench.start_session(None);
}

/// And what it reads beyond what a vented bag may keep would be, too.
#[test]
fn no_session_begins_with_a_gauge_that_reads_more_than_a_vented_bag_may_keep() {
    let mut bench = fresh(|_| {});
    bench.inject(Fault::GaugeOffset { kpa: 12.5 });
    bench.seconds(1.0);
    let start = || Command::StartSession {
        patch: String::new(),
        target: None,
        branches: None,
        confirmed_by: None,
        leave_out: Vec::new(),
    };
    let why = bench.refused(start());
    assert!(why.contains("the bag is at 12.") && why.contains("the gauge's scale or offset is wrong"), "{why}");
    bench.repair(Fault::GaugeOffset { kpa: 12.5 });
    bench.seconds(1.0);
    session_of(bench.ask(start()));
    // It jumps while the zero of the ramp is taken.
    bench.inject(Fault::GaugeOffset { kpa: 12.5 });
    bench.until(10.0, "a refusal", |host| host.session().reason.contains("the gauge's scale or offset is wrong"));
    assert_eq!(bench.host.session().accepted, 0);
}

#[test]
fn a_session_waits_for_rest_and_fails_when_it_never_comes() {
    let mut bench = fresh(|plan| plan.session.patience = Duration::from_secs(6));
    bench.inject(Fault::ModuleSilent(board(13), module(3)));
    bench.seconds(0.5);
    session_of(bench.ask(Command::StartSession {
        patch: String::new(),
        target: None,
        branches: None,
        confirmed_by: None,
        leave_out: Vec::new(),
    }));
    bench.until(4.0, "a word why", |host| host.session().reason.contains("board 13 module 3"));
    assert_eq!(bench.host.session().state, SessionState::Taring);
    bench.until_state(12.0, SessionState::Failed);
    assert!(bench.host.session().reason.starts_with("rest was never proven"), "{:?}", bench.host.session());
}

#[test]
fn a_store_that_fails_ends_the_session_and_takes_no_new_one() {
    let (mut bench, number) = ramping(10.0);
    bench.host.store_failed("the disk is full");
    let session = bench.host.session();
    assert_eq!((session.state, session.reason.as_str()), (SessionState::Failed, "the store failed: the disk is full"));
    let start = Command::StartSession {
        patch: String::new(),
        target: None,
        branches: None,
        confirmed_by: None,
        leave_out: Vec::new(),
    };
    for command in [start, Command::StartRamp { session: number }, Command::FinishRamp { session: number }] {
        assert!(matches!(bench.ask(command), Err(Rejection::Unavailable(_, why)) if why.contains("the disk is full")));
    }
    bench.seconds(0.5);
    assert!(bench.host.health().problems[0].contains("the disk is full"));
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
        let mut bench = fresh(|_| {});
        let session = bench.start_session(None);
        bench.ramp(74.0, 2.0);
        bench.seconds(10.0);
        for taxel in [5, 37] {
            bench.inject(Fault::TaxelFrozen(TaxelIndex(taxel)));
        }
        bench.seconds(fault_s);
        for taxel in [5, 37] {
            bench.repair(Fault::TaxelFrozen(TaxelIndex(taxel)));
        }
        bench.seconds(24.0 - fault_s);
        bench.ask(Command::FinishRamp { session }).unwrap();
        bench.until_state(1.0, SessionState::Review);
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

/// Scans that are refused for a while look like a standstill of every taxel, and are none.
#[test]
fn a_pause_of_the_intake_is_no_fault_of_the_taxels() {
    let (mut bench, session) = ramping(30.0);
    bench.ramp(30.0, 4.0); // a hold: nothing enters
    bench.seconds(12.0);
    bench.ramp(74.0, 4.0);
    bench.until_state(40.0, SessionState::Review);
    samples_rise(&bench, session);
    let set = &bench.host.set(0);
    let faulty = set.taxels.iter().filter(|m| matches!(m.status, Status::Frozen { .. } | Status::Dead { .. })).count();
    assert_eq!(faulty, 0);
    assert!(set.taxels.iter().filter(|m| m.is_usable()).count() >= 70);
}

/// Every board sends when it likes: between the first and the last of three may lie two thirds of a period.
#[test]
fn a_sample_has_all_boards_of_one_scan_and_none_of_the_next() {
    let boards = [(13, 3), (12, 2), (11, 2)].map(|(address, modules)| Board {
        bus: BUS,
        address: board(address),
        modules: (0..modules).map(|m| (module(m), ModuleKind::Triangle)).collect(),
    });
    let skin = Skin::sleeve(Patch::new("small", boards.into()).unwrap());
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
