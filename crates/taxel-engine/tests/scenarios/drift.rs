//! The zero follows the temperature of the skin, and nothing else.

use taxel_engine::snapshot::DriftView;
use taxel_sim::{BoardsConfig, ThermalConfig};

use crate::prelude::*;

/// The small skin once more, at boards that compensate half of the drift of one count per kelvin, warming up by so
/// many kelvin with a time constant of ten minutes.
fn warming(kelvin: f64, follow: bool) -> Bench {
    let dielectric =
        DielectricConfig { tare_bias_counts: 1.0, tare_residue_counts: 0.5, ..DielectricConfig::default() };
    let thermal = ThermalConfig { warm_up_k: kelvin, warm_up_s: 600.0, swing_k: 0.0, ..ThermalConfig::default() };
    let boards = BoardsConfig { start_streaming: true, drift_gain: 64, ..BoardsConfig::default() };
    let config = Config { dielectric, thermal, boards, ..Config::seeded(3) };
    let world = World::new(small_skin(), config);
    let patch = PatchPlan { bring_up: Vec::new(), follow_drift: follow, ..patch_plan(&small().skin) };
    let mut bench = Bench::new(world, plan(patch), Restored { next_session: 3, ..small().restored() });
    bench.until_force(3.0, ForceState::Ok);
    bench
}

/// Lets minutes pass and keeps only what is needed to go on; the mean force of all the time.
fn minutes(bench: &mut Bench, minutes: f64) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for _ in 0..(minutes * 6.0).round() as u64 {
        let last = bench.host.snapshots.len() - 1;
        bench.host.snapshots.drain(..last);
        bench.host.published.drain(..last);
        bench.seconds(10.0);
        for snapshot in &bench.host.snapshots {
            sum += snapshot.force.total.expect("a force").0;
            count += 1.0;
        }
    }
    sum / count
}

fn drift(bench: &Bench) -> DriftView {
    bench.host.snapshot().tare.as_ref().unwrap().drift
}

fn weigh_half_a_kilogram(bench: &mut Bench) -> f64 {
    bench.lay(0.5, 33);
    bench.seconds(1.0);
    let force = bench.weigh(100);
    bench.world.clear();
    bench.seconds(2.0);
    force
}

#[test]
fn a_warm_up_moves_the_force_unless_it_is_followed() {
    let cold = weigh_half_a_kilogram(&mut warming(0.0, true));
    let (mut followed, mut ignored) = (warming(5.0, true), warming(5.0, false));
    let at_rest = [minutes(&mut followed, 20.0), minutes(&mut ignored, 20.0)];
    let view = drift(&followed);
    let forces = [&mut followed, &mut ignored].map(|bench| weigh_half_a_kilogram(bench) / cold - 1.0);
    eprintln!("{view:?}; at rest {at_rest:?} N; half a kilogram off by {forces:?} of {cold} N");
    assert_eq!(drift(&ignored), DriftView::default());
    assert!((2.0..3.0).contains(&view.median_counts), "{view:?}");
    assert!(at_rest[0] < 0.01, "{at_rest:?} N");
    assert!(forces[0].abs() < 0.03 && forces[1] > 0.1, "{forces:?}");
    assert_eq!(followed.host.state(), ForceState::Ok, "{}", followed.host.reasons());
}

#[test]
fn a_load_that_creeps_in_on_a_module_is_not_eaten() {
    let mut bench = warming(0.0, true);
    for _ in 0..10 {
        bench.world.lay(Mass::on_disc(0.004, TaxelIndex(33), 330.0)).unwrap();
        minutes(&mut bench, 1.0);
        let (force, truth, view) = (&bench.host.snapshot().force, bench.world.true_force(), drift(&bench));
        assert!(force.high().is_none_or(|high| truth <= high), "{truth:?} of {:?}; {view:?}", force.high());
        assert!(view.absorbed.0 < 0.5, "{view:?}");
    }
    bench.world.clear();
    minutes(&mut bench, 2.0);
    let view = drift(&bench);
    assert!(view.max_counts.abs() < 0.2, "{view:?}");
    assert_eq!(bench.host.state(), ForceState::Ok, "{}", bench.host.reasons());
}

#[test]
fn at_its_bound_the_force_says_so_until_a_tare() {
    let mut bench = warming(12.0, true);
    minutes(&mut bench, 15.0);
    assert_eq!(bench.host.state(), ForceState::Degraded);
    let why = bench.host.reasons();
    assert!(why.contains("drift of +") && why.contains(" counts reached its bound of 3 counts: tare"), "{why}");
    bench.tare(Some("Ada")).unwrap();
    bench.until_force(1.0, ForceState::Ok);
    assert_eq!(drift(&bench).max_counts, 0.0);
    minutes(&mut bench, 2.0);
    assert_eq!(bench.host.state(), ForceState::Ok, "{}", bench.host.reasons());
}

/// A load lies on everything, comes as slowly as warmth and against it: the counts stand still, and only the pads know.
#[test]
fn a_slow_load_on_everything_while_the_skin_cools_does_not_vanish_in_the_zero() {
    let mut bench = warming(-4.5, true);
    minutes(&mut bench, 15.0);
    let mut most = 0.0_f64;
    for minute in 0..15 {
        let mass = Mass::on_disc(0.04, TaxelIndex(35), 20_000.0);
        bench.world.lay(mass).unwrap();
        minutes(&mut bench, 1.0);
        let (force, truth) = (&bench.host.snapshot().force, bench.world.true_force().0);
        let (total, sigma) = (force.total.unwrap().0, force.total_sigma.unwrap().0);
        let floor = force.undetected.unwrap().at_most().0;
        eprintln!("{minute}: {truth:.2} N, told {total:.2} +- {sigma:.2} N, floor {floor:.2} N; {:?}", drift(&bench));
        assert!(truth <= total + 2.0 * sigma + floor, "{truth} N: {total} +- {sigma} N, floor {floor} N");
        assert_eq!(force.state, ForceState::Ok, "{}", bench.host.reasons());
        most = most.max(drift(&bench).absorbed.0);
    }
    assert!(most <= 1.5, "{most} N: one that comes by readings, and what the pads say later");
}

/// While a session is open nothing is followed, and the pads tell of the cold all the same.
#[test]
fn a_cold_while_a_session_is_open_is_in_the_uncertainty() {
    for follow in [true, false] {
        for (kilogram, kelvin, over_s) in [(0.2, -3.0, 15), (0.3, -4.0, 20)] {
            let mut bench = warming(0.0, follow);
            bench.start_session(None);
            let mark = bench.mark();
            bench.inject(Fault::Warming { kelvin, over: Duration::from_secs(over_s) });
            for _ in 0..10 {
                bench.world.lay(Mass::on_disc(kilogram / 10.0, TaxelIndex(35), 20_000.0)).unwrap();
                bench.seconds(over_s as f64 / 10.0);
            }
            bench.seconds(10.0);
            let session = bench.host.session().number;
            bench.ask(Command::AbortSession { session, reason: None }).unwrap();
            bench.seconds(5.0);
            assert!(bench.has_force_since(mark));
            bench.is_truthful_since(mark, &format!("{kilogram} kg and {kelvin} K within {over_s} s of a session"));
        }
    }
}
