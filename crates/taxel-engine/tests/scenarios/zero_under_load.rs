//! What lies on the skin is no zero, however few taxels it lies on, and whatever its boards do meanwhile.

use taxel_sim::Footprint;
use taxel_skin::Kilopascal;

use crate::prelude::*;
use crate::say::tare;

/// Something with an edge that presses on exactly two taxels, both of one module.
fn lay_an_edge(bench: &mut Bench) {
    let at = |centre: u16, turn: u8| {
        let mut footprint = Footprint::disc(TaxelIndex(centre), 60.0);
        (footprint.semi_axes_mm, footprint.turn) = ([6.5, 1.5], 0.3 * f64::from(turn));
        Mass { kilogram: 0.5, footprint }
    };
    let places = (20..40).flat_map(|centre| (0..10).map(move |turn| at(centre, turn)));
    let on_two = |mass: &Mass| {
        let mut world = bench.world.clone();
        world.lay(*mass).unwrap();
        let pressed =
            world.true_taxel_pressures().enumerate().filter(|(_, kpa)| kpa.0 > 1.0).map(|(taxel, _)| taxel / 10);
        let modules: Vec<usize> = pressed.collect();
        modules.len() == 2 && modules[0] == modules[1]
    };
    let edge = places.into_iter().find(on_two).expect("a place");
    bench.world.lay(edge).unwrap();
}

#[test]
fn a_load_on_two_taxels_of_a_module_is_no_rest_at_a_start_or_for_a_tare() {
    let mut bench = small().in_use();
    lay_an_edge(&mut bench);
    bench.seconds(2.0);
    let mark = bench.mark();
    let why = bench.refused(tare());
    assert!(why.contains("something presses on board 13 module") && why.contains("counts on two taxels"), "{why}");
    bench.seconds(2.0);
    bench.is_truthful_since(mark, "a tare under a load on two taxels of a module");
    let mut bench = Bench::new(bench.world, bench.host.plan, small().restored());
    bench.seconds(5.0);
    assert_eq!(bench.host.state(), ForceState::TareInvalid);
    assert!(bench.host.reasons().contains("counts on two taxels"), "{}", bench.host.reasons());
    bench.world.clear();
    bench.until_force(3.0, ForceState::Ok);
}

/// The boards keep their zeros while the daemon is away, and so does what was found of them.
#[test]
fn a_restart_does_not_forget_that_a_board_took_a_zero_under_a_load() {
    for configures in [false, true] {
        let mut bench = ordinary().in_use();
        bench.lay(1.0, 33);
        bench.seconds(3.0);
        bench.inject(Fault::SilentRetare(board(13)));
        bench.until(3.0, "the finding", |host| host.snapshot().tare.as_ref().is_some_and(|tare| !tare.valid));
        bench.seconds(1.0);
        let mut zeros = bench.host.disk.restored.zeros.clone();
        assert!(zeros.iter().all(|(_, zero)| zero.needs_confirmation.is_some() && zero.zero.is_none()), "{zeros:?}");
        assert_eq!(zeros.len(), 1);
        for _ in 0..2 {
            let patch = patch_plan(&ordinary().skin);
            let bring_up = if configures { patch.bring_up.clone() } else { Vec::new() };
            let patch = PatchPlan { bring_up, ..patch };
            zeros[0].1.configured = Some(patch.settings_sum());
            let restored = Restored { zeros: zeros.clone(), ..ordinary().restored() };
            bench = Bench::new(bench.world, plan(patch), restored);
            bench.seconds(4.0);
            assert_eq!(bench.host.state(), ForceState::TareInvalid, "{configures}: {}", bench.host.reasons());
            assert!(bench.host.reasons().contains("it has taken a new zero"), "{}", bench.host.reasons());
            let why = bench.refused(tare());
            assert!(why.contains("it has taken a new zero") && why.contains("--confirmed-by"), "{why}");
            assert_eq!(noted(&bench), None, "nothing new was found");
        }
        bench.world.clear();
        bench.seconds(1.0);
        if configures {
            bench.configure_again(Some("Ada"));
            bench.tare(None).unwrap();
        } else {
            let now = bench.now();
            bench.world.bring_up_boards(now); // by the robot's own software
            bench.seconds(2.0);
            bench.tare(Some("Ada")).unwrap();
        }
        assert_eq!(noted(&bench), Some(None), "somebody has confirmed the zero");
    }
}

/// Why zeros need confirmation, as last written down.
fn noted(bench: &Bench) -> Option<Option<String>> {
    bench.host.records.iter().rev().find_map(|record| match record {
        Record::Zero { zero, .. } => Some(zero.needs_confirmation.clone()),
        _ => None,
    })
}

/// One taxel that is far from where it was may be a broken one, and no reason to refuse. What may press on it is in the
/// interval.
#[test]
fn a_load_on_a_single_taxel_that_is_taken_for_rest_is_within_the_interval() {
    for kilogram in [0.05, 0.1, 0.2, 0.3] {
        let mut bench = small().in_use();
        bench.world.lay(Mass::on_disc(kilogram, TaxelIndex(33), 50.0)).unwrap();
        bench.seconds(2.0);
        bench.tare(None).unwrap();
        let mark = bench.mark();
        bench.seconds(2.0);
        bench.is_truthful_since(mark, &format!("{kilogram} kg on a single taxel"));
    }
}

/// Nor does it cost anything where loads are lifted while there is no zero.
#[test]
fn a_load_that_is_lifted_without_a_zero_leaves_a_skin_at_rest() {
    for skin in [small(), ordinary()] {
        let mut bench = skin.in_use();
        for (kilogram, centre) in [(0.5, 33), (1.0, 70), (2.0, 14)] {
            bench.bus_off();
            bench.lay(kilogram, centre);
            bench.seconds(2.0);
            bench.world.clear();
            bench.seconds(1.5);
            bench.tare(None).unwrap();
        }
    }
}

/// A zero that somebody confirmed shows what the boards hide, and the next one, which nobody did, may hide it once more.
#[test]
fn a_load_that_is_lifted_for_a_confirmed_zero_and_comes_back_is_within_the_interval() {
    for skin in [small(), ordinary()] {
        let mut bench = skin.started();
        let mass = Mass::on_disc(0.3, TaxelIndex(33), 3000.0);
        bench.world.lay(mass).unwrap();
        bench.until(6.0, "a force", |host| host.snapshot().force.total.is_some());
        bench.world.clear();
        bench.seconds(1.0);
        bench.tare(Some("Ada")).unwrap();
        bench.world.lay(mass).unwrap();
        bench.seconds(1.0);
        let mark = bench.mark();
        if bench.tare(None).is_ok() {
            bench.until(3.0, "a force", |host| host.snapshot().force.total.is_some());
        }
        bench.seconds(1.0);
        bench.is_truthful_since(mark, "0.3 kg that came back after a confirmed zero");
    }
}

/// A skin that became colder lies away from load everywhere, and so hides a light load.
#[test]
fn a_light_load_on_a_colder_skin_that_is_taken_for_rest_is_within_the_interval() {
    for kelvin in [-2.0, -4.0, -6.0] {
        let mut forces = 0;
        for (kilogram, centre) in [(0.1, 33), (0.2, 70), (0.3, 14), (0.4, 45)] {
            let mut world = small().world.clone();
            world.inject(Fault::Warming { kelvin, over: Duration::from_secs(1) }).unwrap();
            world.advance(world.now() + Duration::from_secs(10), &mut Vec::new());
            let patch = PatchPlan { bring_up: Vec::new(), ..patch_plan(&small().skin) };
            let mut bench = Bench::new(world, plan(patch), small().restored());
            bench.world.lay(Mass::on_disc(kilogram, TaxelIndex(centre), 2500.0)).unwrap();
            bench.seconds(4.0);
            forces += usize::from(bench.has_force_since(0));
            bench.is_truthful_since(0, &format!("{kilogram} kg at {kelvin} K"));
        }
        assert!(forces >= 1, "a light load passes for another day");
    }
}

/// Warmth that comes within a second or two while something lies on all of the skin shows on the pads alone.
#[test]
fn a_skin_that_warms_at_once_while_all_of_it_is_touched_is_within_the_interval() {
    for (kelvin, kpa_per_s) in [(6.0, 2.0), (6.0, 4.0), (8.0, 2.0), (8.0, 4.0), (-8.0, 2.0)] {
        let mut bench = small().in_use();
        bench.ask(tare()).unwrap();
        let mark = bench.mark();
        bench.world.pump(PumpCommand::Ramp { target: Kilopascal(40.0), kpa_per_s });
        bench.seconds(0.3);
        bench.inject(Fault::Warming { kelvin, over: Duration::from_millis(900) });
        bench.seconds(3.0);
        assert!(bench.has_force_since(mark));
        bench.is_truthful_since(mark, &format!("{kelvin} K while a bag presses by {kpa_per_s} kPa more each second"));
    }
}
