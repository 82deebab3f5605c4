//! Hysteresis, live: a session over both branches, its plays in use, and what they are worth on a further cycle.

use taxel_engine::calibration::Direction;
use taxel_sim::BagConfig;

use crate::prelude::*;

/// Readings of a cycle: gauge and mean over the taxels, kPa, while the pressure rises and while it falls.
#[derive(Default)]
struct Cycle {
    rising: Vec<(f64, f64)>,
    falling: Vec<(f64, f64)>,
}

/// Mean of |read - P| / P above 10 kPa.
fn error(readings: &[(f64, f64)]) -> f64 {
    let errors = readings.iter().filter(|(kpa, _)| *kpa > 10.0).map(|(kpa, read)| (read - kpa).abs() / kpa);
    let errors: Vec<f64> = errors.collect();
    errors.iter().sum::<f64>() / errors.len() as f64
}

/// A skin with much friction and no creep, off the rails, calibrated over both branches up to 60 kPa: twice, so that
/// the plays are tried on the second cycle, which they have not seen.
fn calibrated(bag: BagConfig) -> (Bench, Arc<ModelSet>) {
    let dielectric = DielectricConfig {
        tare_bias_counts: 1.0,
        tare_residue_counts: 0.5,
        friction: [0.10, 0.14],
        creep_share: 0.0,
        ..DielectricConfig::default()
    };
    let world = World::new(small_skin(), Config { dielectric, bag, ..Config::seeded(5) });
    let mut bench = Bench::new(world, plan(patch_plan(&small().skin)), Restored::default());
    bench.brought_up();
    bench.start_session_over(Branch::Both, Some(60.0));
    for ramp in 0..2 {
        if ramp > 0 {
            bench.vent(10.0);
            bench.ramp_again(1);
        }
        bench.ramp(61.0, 2.0);
        bench.until(60.0, "the turn", |host| host.session().direction == Direction::Falling);
        bench.seconds(1.0);
        bench.ramp(0.0, 2.0);
        bench.until_state(60.0, SessionState::Review);
    }
    let set = bench.host.newest_set();
    (bench, set)
}

/// The same set without its plays.
fn without_plays(set: &ModelSet) -> Arc<ModelSet> {
    let mut without = ModelSet { id: "m-without".to_owned(), ..set.clone() };
    let taxels = without.recorded.as_mut().unwrap().taxels.iter_mut().flatten();
    taxels.for_each(|taxel| taxel.plays = None);
    Arc::new(without)
}

/// Puts a set into use on the vented, tared skin.
fn put_to_use(bench: &mut Bench, set: &Arc<ModelSet>) {
    bench.vent(20.0);
    bench.import(Arc::clone(set));
    bench.activate(&set.id).unwrap();
    bench.tare(None).unwrap();
}

/// Takes it through a cycle to 50 kPa.
fn cycle(bench: &mut Bench, set: &Arc<ModelSet>) -> Cycle {
    put_to_use(bench, set);
    let mut cycle = Cycle::default();
    for (target, rising) in [(50.0, true), (5.0, false)] {
        bench.ramp(target, 2.0);
        for _ in 0..if rising { 250 } else { 220 } {
            bench.seconds(0.1);
            let taxels = &bench.host.snapshot().taxels;
            let read: Vec<f64> = taxels.iter().filter_map(|t| t.pressure_kpa.map(f64::from)).collect();
            let reading = (bench.world.true_pressure().0, read.iter().sum::<f64>() / read.len() as f64);
            if rising { &mut cycle.rising } else { &mut cycle.falling }.push(reading);
        }
    }
    cycle
}

#[test]
fn plays_of_a_session_take_the_hysteresis_out_of_the_live_force() {
    let (mut bench, with) = calibrated(BagConfig::default());
    let recorded = with.recorded.as_ref().expect("a session over both branches knows the skin in use");
    assert!(recorded.taxels.iter().flatten().any(|taxel| taxel.plays.is_some()), "{:?}", recorded.plays_error_ratio);
    let bent = cycle(&mut bench, &with);
    let plain = cycle(&mut bench, &without_plays(&with));
    let whole = |cycle: &Cycle| error(&[cycle.rising.as_slice(), &cycle.falling].concat());
    let (with, without) = (whole(&bent), whole(&plain));
    let branches = |cycle: &Cycle| format!("rising {:.3}, falling {:.3}", error(&cycle.rising), error(&cycle.falling));
    eprintln!("relative error with plays: {}; without: {}", branches(&bent), branches(&plain));
    assert!(without > 0.08, "the friction shows without plays: {without}");
    assert!(with < 0.7 * without, "with plays {with}, without {without}");
    assert!(error(&bent.falling) < error(&plain.falling), "no branch pays for the other");
}

/// In a bag that presses and lets go within a scan or two.
#[test]
fn a_squeeze_while_the_zero_is_in_check_is_not_forgotten() {
    let quick = BagConfig { pump_kpa_per_s: 1_000.0, vent_s: 0.05, ..BagConfig::default() };
    let (mut bench, set) = calibrated(quick);
    put_to_use(&mut bench, &set);
    let squeeze = |bench: &mut Bench, kpa: f64, kpa_per_s: f64| {
        bench.ramp(kpa, kpa_per_s);
        while (bench.world.true_pressure().0 - kpa).abs() > 0.5 {
            bench.seconds(0.02);
        }
    };
    let mut errors = [0.0; 2];
    for (error, in_check) in errors.iter_mut().zip([false, true]) {
        squeeze(&mut bench, 15.0, 10.0);
        bench.seconds(2.0);
        let mark = bench.mark();
        if in_check {
            // A lost acknowledgement is no proof of a new zero, and has to be looked at.
            bench.inject(Fault::ModuleNoAck(board(12), module(0)));
            bench.until(3.0, "the check", |host| host.reasons().contains("looked at"));
            bench.repair(Fault::ModuleNoAck(board(12), module(0)));
        }
        squeeze(&mut bench, 60.0, 250.0);
        squeeze(&mut bench, 15.0, 250.0);
        assert_eq!(bench.host.snapshot().force.total.is_some(), !in_check, "{}", bench.host.reasons());
        bench.until(10.0, "the end of the check", |host| host.snapshot().force.total.is_some());
        bench.seconds(2.0);
        let (force, truth) = (bench.host.snapshot().force.total.unwrap().0, bench.world.true_force().0);
        *error = force / truth - 1.0;
        bench.is_truthful_since(mark, "squeezed");
        bench.vent(20.0);
    }
    assert!((errors[1] - errors[0]).abs() < 0.05, "{errors:?}: without and with a check");
}
