//! Force that no taxel can show: it is in the uncertainty, the detection floor, or the total says that it is a bound.

use std::f64::consts::PI;
use std::ops::Range;
use std::sync::Arc;

use taxel_engine::command::{Command, Done};
use taxel_engine::force::neighbours::{Neighbours, Reading};
use taxel_engine::model_set::ModelSet;
use taxel_engine::snapshot::ForceState;
use taxel_model::Status;
use taxel_sim::{Config, Fault, Footprint, Layer, LoadPath, Mass, Skin, World};
use taxel_skin::{Geometry, TaxelIndex};

use crate::bench::Bench;
use crate::shared::{Calibrated, layered, ordinary, small};

/// The skin in use with a model set that leaves these taxels out.
pub fn without(skin: &Calibrated, taxels: Range<usize>) -> Bench {
    let mut bench = skin.in_use();
    let mut set = ModelSet { id: "m-without".to_owned(), session: None, ..ModelSet::clone(&skin.set) };
    set.taxels[taxels].iter_mut().for_each(|model| model.status = Status::Dead { count: 0.0 });
    assert!(matches!(
        bench.ask(Command::Import { model_set: Arc::new(set), insist: false }),
        Ok(Done::Imported { .. })
    ));
    bench.activate("m-without").unwrap();
    bench.until(2.0, "a force", |host| host.snapshot().force.total.is_some());
    bench.seconds(0.2);
    bench
}

/// Every force since `mark` has an uncertainty and a floor.
fn is_never_certain(bench: &Bench, mark: usize) {
    for snapshot in &bench.host.snapshots[mark..] {
        let force = &snapshot.force;
        assert!(force.total_sigma.is_none_or(|sigma| sigma.0 > 0.005), "{force:?}");
        assert!(force.undetected.is_none_or(|undetected| undetected.at_most().0 > 0.005), "{force:?}");
    }
}

#[test]
fn an_unloaded_skin_has_an_uncertainty_and_a_floor() {
    for skin in [small(), ordinary()] {
        let mut bench = skin.in_use();
        let mark = bench.mark();
        bench.seconds(5.0);
        is_never_certain(&bench, mark);
        bench.is_truthful_since(mark, "an unloaded skin");
    }
}

#[test]
fn a_load_about_the_activation_threshold_is_within_the_interval() {
    for skin in [small(), ordinary()] {
        for gram in [5.0, 10.0, 20.0, 30.0, 40.0, 60.0, 80.0, 120.0] {
            let mut bench = skin.in_use();
            let mark = bench.mark();
            for centre in [14, 35, 70] {
                bench.world.lay(Mass::on_disc(gram / 1_000.0, TaxelIndex(centre), 600.0)).unwrap();
                bench.seconds(2.0);
            }
            is_never_certain(&bench, mark);
            bench.is_truthful_since(mark, &format!("{gram} g"));
        }
    }
}

/// The whole load lies on a module that the models do not cover.
fn carries_the_load(bench: &mut Bench, what: &str) {
    let mark = bench.mark();
    bench.world.lay(Mass::on_disc(0.5, TaxelIndex(35), 60.0)).unwrap();
    bench.seconds(3.0);
    is_never_certain(bench, mark);
    bench.is_truthful_since(mark, what);
    let force = &bench.host.snapshot().force;
    assert_eq!((force.state, force.unbounded), (ForceState::Degraded, true), "{what}: {force:?}");
    assert!(bench.host.reasons().contains("lower bound"), "{what}: {}", bench.host.reasons());
}

#[test]
fn an_excluded_module_that_carries_the_whole_load_makes_the_total_a_lower_bound() {
    carries_the_load(&mut without(small(), 30..40), "an excluded module");
    let mut bench = without(small(), 20..50);
    carries_the_load(&mut bench, "three excluded modules");
}

#[test]
fn a_faulty_module_that_carries_the_whole_load_makes_the_total_a_lower_bound() {
    let mut bench = small().in_use();
    for taxel in 30..40 {
        bench.inject(Fault::TaxelFrozen(TaxelIndex(taxel)));
    }
    bench.seconds(8.0); // so long do readings have to stand still
    carries_the_load(&mut bench, "a frozen module");
}

#[test]
fn a_skin_of_which_nothing_is_usable_has_no_force() {
    let mut bench = small().in_use();
    for taxel in 0..80 {
        bench.inject(Fault::TaxelFrozen(TaxelIndex(taxel)));
    }
    bench.seconds(8.0);
    let mark = bench.mark();
    bench.lay(1.0, 35);
    bench.seconds(3.0);
    assert!(!bench.has_force_since(mark), "{:?}", bench.host.snapshot().force);
}

#[test]
fn a_single_excluded_taxel_under_a_load_is_within_the_interval() {
    for taxel in [33, 35, 39] {
        let mut bench = without(small(), taxel..taxel + 1);
        let mark = bench.mark();
        bench.lay(0.5, 35);
        bench.seconds(3.0);
        bench.is_truthful_since(mark, &format!("taxel {taxel} excluded"));
    }
}

/// The multiples that `neighbours/tip.rs` names, of contacts of 4 mm radius and more on the simulated layer: what a taxel that cannot
/// be read may bear is no less than what it does.
#[test]
fn a_contact_on_a_taxel_that_cannot_be_read_bears_no_more_than_those_beside_it_say() {
    let skin = Skin::forearm().unwrap();
    let geometry = Geometry::parse(&skin.positions_file(), skin.patch()).unwrap();
    let (neighbours, area_mm2) = (Neighbours::new(&geometry), skin.taxel_area().0);
    let config = Config { loads: LoadPath::Layer(Layer::default()), ..Config::seeded(1) };
    let mut world = World::new(skin.clone(), config);
    let (mut amid, mut at_rim) = (0.0_f64, 0.0_f64);
    for missing in (0..230).step_by(7) {
        for (radius_mm, offset_mm) in
            [(4.0, [0.0, 0.0]), (4.0, [3.0, 0.0]), (4.0, [1.6, 2.4]), (5.0, [0.0, 1.6]), (7.0, [0.0, 0.0])]
        {
            world.clear();
            let footprint =
                Footprint { offset_mm, ..Footprint::disc(TaxelIndex(missing), PI * f64::powi(radius_mm, 2)) };
            let on_it = (footprint.share_on_skin(&skin).unwrap() > 0.5).then_some(footprint);
            let Some(footprint) = on_it else { continue };
            let weight = world.lay(Mass { kilogram: 1.0, footprint }).unwrap().0;
            let kpa: Vec<f64> = world.true_taxel_pressures().map(|kpa| kpa.0).collect();
            let missing = usize::from(missing);
            let elsewhere: f64 = (0..230).filter(|&taxel| taxel != missing).map(|taxel| kpa[taxel]).sum();
            let borne_kpa = weight * 1e3 / area_mm2 - elsewhere;
            let reading = |taxel: usize| (taxel != missing).then(|| Reading { kpa: kpa[taxel], noise_kpa: 0.0 });
            let said_kpa = neighbours.untouched_kpa(missing, reading);
            let of = if neighbours.is_at_rim(missing) { &mut at_rim } else { &mut amid };
            *of = of.max(borne_kpa / said_kpa);
        }
    }
    assert!((0.8..1.0).contains(&amid), "amid the skin it bears {amid:.2} of what is said");
    assert!((0.5..1.0).contains(&at_rim), "at the rim it bears {at_rim:.2} of what is said");
}

/// One that no taxel feels enough of to be active.
#[test]
fn a_light_fingertip_on_a_taxel_that_cannot_be_read_is_within_the_floor() {
    for missing in [35, 14, 57] {
        let mut bench = without(layered(), missing..missing + 1);
        for gram in [40.0, 80.0, 120.0, 160.0] {
            let mark = bench.mark();
            bench.world.clear();
            bench.world.lay(Mass::on_disc(gram / 1e3, TaxelIndex(missing as u16), 51.0)).unwrap();
            bench.seconds(2.0);
            bench.is_truthful_since(mark, &format!("{gram} g on taxel {missing}"));
        }
    }
}
