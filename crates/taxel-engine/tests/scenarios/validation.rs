//! Known loads on the skin.

use taxel_engine::command::Reply;
use taxel_engine::loads::{KnownLoad, Load, Validation, Weight};
use taxel_skin::Newton;

use crate::prelude::*;

fn known(weight: Weight) -> KnownLoad {
    KnownLoad { weight, relative_sigma: 0.005, note: "brass".to_owned(), by: "Ada".to_owned(), replaces: None }
}

fn record(weight: Weight) -> Command {
    Command::RecordLoad { patch: String::new(), load: known(weight) }
}

/// The load that a command came to.
fn load_of(reply: Reply) -> Arc<Load> {
    match reply {
        Ok(Done::LoadRecorded(load)) => load,
        other => panic!("expected a load, got {other:?}"),
    }
}

fn validation(bench: &Bench) -> &Validation {
    &bench.host.catalogue.validations[0]
}

/// Lays a mass down, lets it settle, has it read, and takes it away again.
fn weigh_known(bench: &mut Bench, kilogram: f64, centre: u16) -> Arc<Load> {
    bench.lay(kilogram, centre);
    bench.seconds(1.5);
    let load = load_of(bench.ask(record(Weight::Kilogram(kilogram))));
    bench.world.clear();
    bench.seconds(2.0);
    load
}

const MASSES: [(f64, u16); 3] = [(0.4, 33), (0.6, 22), (0.8, 44)];

#[test]
fn what_a_skin_reads_under_known_masses_is_kept_and_judged_also_after_a_restart() {
    let mut bench = small().in_use();
    for (n, (kilogram, centre)) in MASSES.into_iter().enumerate() {
        let load = weigh_known(&mut bench, kilogram, centre);
        assert_eq!(load.number, n as u64 + 1);
        assert!((load.force_n - 9.80665 * kilogram).abs() < 1e-12 && load.mass_kg == Some(kilogram), "{load:?}");
        assert!((load.force_sigma_n - 0.005 * load.force_n).abs() < 1e-12);
        assert!(load.read.scans >= 19 && load.is_within_two_sigma(), "{load:?}");
        assert_eq!((load.by.as_str(), load.note.as_str()), ("Ada", "brass"));
    }
    let view = validation(&bench).clone();
    assert!(view.loads.iter().all(|judged| judged.counts() && judged.outdated_because.is_empty()));
    assert_eq!(view.loads.iter().map(|judged| judged.load.number).collect::<Vec<_>>(), [3, 2, 1]);
    let mean = view.loads.iter().map(|judged| judged.load.error().abs()).sum::<f64>() / 3.0;
    assert!((view.mean_absolute_error.unwrap() - mean).abs() < 1e-12);
    let written = bench.host.records.iter();
    let written = written.filter_map(|r| if let Record::Load(load) = r { Some(load.clone()) } else { None });
    let loads: Vec<Arc<Load>> = written.collect();
    assert_eq!(loads.len(), 3, "each was written once");
    let restarted = |times: f64| {
        let larger = |area: &mut SquareMillimetre| area.0 *= times;
        let restored = Restored { loads: loads.clone(), next_load: 4, ..small().restored() };
        let mut bench = small().listening(restored, |plan| plan.areas.iter_mut().for_each(larger));
        bench.until_force(5.0, ForceState::Ok);
        bench
    };
    let mut kept = restarted(1.0);
    assert_eq!(*validation(&kept), view);
    assert_eq!(weigh_known(&mut kept, 0.5, 33).number, 4);
    // With other areas they say nothing.
    let other = restarted(1.1);
    assert_eq!(validation(&other).mean_absolute_error, None);
    assert!(validation(&other).loads.iter().all(|judged| judged.outdated_because.contains("areas")));
}

#[test]
fn a_load_that_moves_or_is_not_there_is_refused() {
    let mut bench = small().in_use();
    let nothing = bench.refused(record(Weight::Kilogram(0.5)));
    assert!(nothing.contains("feels nothing"), "{nothing}");
    bench.lay(0.3, 33);
    bench.seconds(1.5);
    let reading = bench.host.command(record(Weight::Kilogram(0.3)));
    let twice = bench.refused(record(Weight::Kilogram(0.3)));
    assert!(twice.contains("another load"), "{twice}");
    bench.seconds(0.1);
    bench.lay(0.3, 33);
    bench.until(5.0, "the answer", |host| host.replied(reading));
    let Some(Err(Rejection::FailedPrecondition(_, why))) = bench.host.reply(reading) else { panic!("it was taken") };
    assert!(why.contains("unsteady"), "{why}");
    assert!(bench.host.records.iter().all(|record| !matches!(record, Record::Load(_))), "nothing was written");
    let load = load_of(bench.ask(record(Weight::Force(Newton(0.6 * 9.81)))));
    assert_eq!((load.number, load.mass_kg), (1, None));
}

#[test]
fn without_models_zero_or_vent_nothing_is_read() {
    let world = small_world();
    let mut bench = Bench::new(world, plan(patch_plan(&small_skin())), Restored::default());
    bench.brought_up();
    assert!(bench.refused(record(Weight::Kilogram(0.5))).contains("no model set"));

    let mut bench = small().started();
    bench.seconds(0.5);
    let refused = bench.refused(record(Weight::Kilogram(0.5)));
    assert_eq!(refused, "there is no valid zero: no zero has been taken since start");

    let mut bench = small().in_use();
    bench.world.pump(PumpCommand::Ramp { target: taxel_skin::Kilopascal(30.0), kpa_per_s: 10.0 });
    bench.seconds(4.0);
    assert!(bench.refused(record(Weight::Kilogram(0.5))).contains("vent it"));
    bench.world.pump(PumpCommand::Vent);
    bench.seconds(10.0);
    bench.host.notice(taxel_engine::BusNotice::BusOff);
    assert!(bench.refused(record(Weight::Kilogram(0.5))).contains("no valid zero"));
    for (weight, field) in [
        (Weight::Kilogram(0.0), "mass_kg"),
        (Weight::Kilogram(f64::NAN), "mass_kg"),
        (Weight::Force(Newton(1e5)), "force_n"),
    ] {
        let refused = bench.ask(record(weight));
        assert!(matches!(&refused, Err(Rejection::InvalidArgument { field: f, .. }) if *f == field), "{refused:?}");
    }
}

#[test]
fn loads_beyond_the_range_replaced_ones_and_those_of_other_models_do_not_count() {
    let mut bench = small().in_use();
    for (kilogram, centre) in MASSES {
        weigh_known(&mut bench, kilogram, centre);
    }
    let heavy = weigh_known(&mut bench, 12.0, 33);
    assert!(heavy.read.out_of_range > 0);
    assert!(!validation(&bench).loads[0].counts() && validation(&bench).loads[0].outdated_because.is_empty());

    bench.lay(0.5, 22);
    bench.seconds(1.5);
    let patch = String::new;
    let wrong = load_of(bench.ask(record(Weight::Kilogram(4.0))));
    let load = KnownLoad { replaces: Some(wrong.number), ..known(Weight::Kilogram(0.5)) };
    load_of(bench.ask(Command::RecordLoad { patch: patch(), load }));
    let view = validation(&bench);
    assert_eq!(view.loads.iter().filter(|judged| judged.counts()).count(), 4, "{view:?}");
    assert_eq!(view.loads[1].outdated_because, format!("load {} replaces it", wrong.number + 1));
    let load = KnownLoad { replaces: Some(99), ..known(Weight::Kilogram(0.5)) };
    let refused = bench.ask(Command::RecordLoad { patch: patch(), load });
    assert!(matches!(&refused, Err(Rejection::NotFound(_, what)) if what.contains("load 99")), "{refused:?}");
    bench.world.clear();
    bench.run(Duration::from_secs(2));

    bench.import(say::other("m-other"));
    bench.activate("m-other").unwrap();
    let view = validation(&bench);
    assert_eq!(view.mean_absolute_error, None);
    assert!(view.loads.iter().all(|judged| !judged.outdated_because.is_empty()));
    bench.activate(&small().set.id).unwrap();
    assert!(validation(&bench).loads[0].counts(), "the loads of the earlier set count again with it");
}
