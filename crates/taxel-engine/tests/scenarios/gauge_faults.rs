//! A gauge that is wrong for a while in a ramp: nothing of that while enters the models.

use taxel_engine::calibration::Refit;
use taxel_engine::plan::Gauge;
use taxel_sim::GaugeConfig;
use taxel_wire::signal::{PressureMeaning, SignalSpec};

use crate::prelude::*;

#[test]
fn a_gauge_that_jumps_and_stays_ends_the_ramp_by_name() {
    for kpa in [3.0, -3.0] {
        let mut bench = fresh();
        let session = bench.start_session(None);
        bench.ramp(74.0, 4.0);
        bench.until_pressure(20.0);
        let before = bench.world.true_pressure().0;
        bench.inject(Fault::GaugeOffset { kpa });
        bench.until_state(10.0, SessionState::Discarded);
        let reason = bench.host.session().reason.clone();
        assert!(reason.starts_with(&format!("the gauge jumped by {kpa:+.1} kPa")), "{reason}");
        for again in [Command::FinishRamp { session }, Command::StartRamp { session }] {
            bench.ask(again).unwrap_err();
        }
        assert_eq!(bench.host.session().reason, reason, "what it gathered stays out of every fit");
        let last = bench.host.samples(session).last().map_or(0.0, |sample| sample.pressure_kpa);
        assert!((before - 1.0..before + 0.2).contains(&last), "{last} entered, the gauge jumped at {before}");
    }
}

/// The set that the ramps before it gave stays good. It is asked for in every way: on the patch, after a
/// restart, and with the set in use.
#[test]
fn a_further_ramp_in_which_the_gauge_jumped_stays_out_of_every_fit() {
    let (mut bench, session) = in_review(30.0);
    bench.ask(Command::StartRamp { session }).unwrap();
    bench.until_state(30.0, SessionState::Ramping);
    bench.ramp(74.0, 4.0);
    bench.until_pressure(20.0);
    bench.inject(Fault::GaugeOffset { kpa: 3.0 });
    bench.until_state(10.0, SessionState::Failed);
    let view = bench.host.session().clone();
    assert!(view.reason.starts_with("the gauge jumped by +3.0 kPa"), "{}", view.reason);
    let said = format!("what session {session} gathered is not fitted: {}", view.reason);
    let (finish, ramp) = (Command::FinishRamp { session }, Command::StartRamp { session });
    let stays_out = |bench: &mut Bench, when: &str, commands: &[&Command]| {
        for again in commands {
            let why = bench.refused(Command::clone(again));
            assert!(why.contains(&said), "{when}, {again:?}: {why}");
        }
        let view = bench.host.catalogue.sessions.iter().find(|view| view.number == session).unwrap();
        let refit = Refit::plan(bench.host.plan.patches[0].clone(), vec![Arc::clone(view)]);
        let why = refit.unwrap_err().to_string();
        assert!(why.contains(&said), "{when}, refit: {why}");
    };
    bench.repair(Fault::GaugeOffset { kpa: 3.0 });
    bench.vent(20.0);
    stays_out(&mut bench, "once the bag is vented", &[&finish, &ramp]);
    let mut bench = {
        let plan = Arc::clone(&bench.host.plan);
        bench.again(plan)
    };
    bench.brought_up();
    stays_out(&mut bench, "after a restart", &[&finish, &ramp]);
    bench.activate(view.model_set.as_deref().unwrap()).unwrap();
    stays_out(&mut bench, "with its set in use", &[]);
    let why = bench.refused(ramp);
    assert!(why.starts_with("session 1 is ACTIVE; a ramp can begin only in"), "{why}");
}

#[test]
fn a_gauge_that_is_back_within_a_second_costs_the_ramp_only_what_it_said_meanwhile() {
    let mut bench = fresh();
    let session = bench.start_session(None);
    bench.ramp(74.0, 4.0);
    bench.until_pressure(20.0);
    bench.inject(Fault::GaugeOffset { kpa: 3.0 });
    bench.seconds(0.6);
    bench.repair(Fault::GaugeOffset { kpa: 3.0 });
    bench.until(60.0, "the end of the ramp", |host| host.session().state != SessionState::Ramping);
    assert_ne!(bench.host.session().state, SessionState::Failed, "{}", bench.host.session().reason);
    let samples = bench.host.samples(session);
    assert!(samples.len() > 150, "the rest of the ramp enters: {}", samples.len());
    let rises = samples.windows(2).map(|pair| pair[1].pressure_kpa - pair[0].pressure_kpa);
    let falls = rises.filter(|step| *step < -0.3).count();
    assert_eq!(falls, 0, "a sample of an offset that ended would be above those after it");
}

#[test]
fn a_gauge_that_is_off_since_before_the_ramp_is_taken_from_what_it_read_at_rest_and_that_stays_uncertain() {
    let benches = [0.0, 9.0].map(|kpa| {
        let mut bench = fresh();
        bench.inject(Fault::GaugeOffset { kpa });
        bench.seconds(1.5);
        bench.start_session(None);
        bench.ramp(90.0, 2.0);
        bench.until_state(60.0, SessionState::Review);
        bench
    });
    let counted_from = benches[1].host.session().gauge_zero_kpa;
    assert!((8.9..9.1).contains(&counted_from), "a session shows it: {counted_from}");
    let [right, off] = benches.map(|bench| bench.host.set(0));
    assert!(right.gauge_offset_kpa < 0.1 && !right.method.contains("at rest"), "{}", right.method);
    assert!((5.1..5.3).contains(&off.gauge_offset_kpa), "{}: 9 kPa over the root of 3", off.gauge_offset_kpa);
    assert!(off.method.ends_with(", less 9.0 kPa that the gauge read at rest"), "{}", off.method);
    assert!((off.pressure_max_kpa - right.pressure_max_kpa).abs() < 0.2, "{}", off.pressure_max_kpa);
    assert!(off.taxels.iter().all(|model| model.gauge.offset_kpa >= 5.1));
    for part in [-0.5, 0.0, 0.4, 0.8] {
        // Over the skin: single taxels read their own noise.
        let pairs = right.taxels.iter().zip(&off.taxels).filter(|(right, _)| right.is_usable());
        let apart = pairs.map(|(right, off)| {
            let curve = right.curve.as_ref().unwrap();
            let count = curve.centre + part * curve.half_width;
            off.evaluate(count).unwrap().kpa - right.evaluate(count).unwrap().kpa
        });
        let apart: Vec<f64> = apart.collect();
        let mean = apart.iter().sum::<f64>() / apart.len() as f64;
        assert!(mean.abs() < 0.3, "{mean} kPa apart at {part} of the range");
    }
}

#[test]
fn no_ramp_begins_before_the_gauge_is_heard() {
    let mut bench = fresh();
    bench.inject(Fault::GaugeSilent);
    bench.seconds(1.0);
    bench.ask(say::start()).unwrap();
    bench.seconds(8.0);
    let session = bench.host.session();
    assert_eq!((session.state, session.ramps), (SessionState::Taring, 0));
    assert!(session.reason.starts_with("waiting for an unloaded skin: the last pressure came"), "{}", session.reason);
    bench.repair(Fault::GaugeSilent);
    let young = "waiting for an unloaded skin: the gauge has been heard for less than a second, or not twice in each half of it";
    bench.until(3.0, young, |host| host.session().reason == young);
    bench.until_state(10.0, SessionState::Ramping);
    let samples = bench.host.disk.samples[&bench.host.session().number].clone();
    assert!(samples.ramps[0].gauge_kpa.unwrap().abs() < 0.1, "{:?}", samples.ramps[0].gauge_kpa);
}

/// On a hill the air has 97 kPa, and the configuration has what it has at sea level.
#[test]
fn an_absolute_gauge_takes_the_ambient_pressure_from_the_vented_bag() {
    let differential = GaugeConfig::default().signal;
    let absolute =
        move |ambient_kpa| SignalSpec { meaning: PressureMeaning::AbsoluteBag { ambient_kpa }, ..differential };
    let plan_of = |takes_ambient| {
        let gauge = Gauge { takes_ambient, ..Gauge::new(BUS, absolute(101.325)) };
        plan(PatchPlan { gauge: Some(gauge), ..patch_plan(&small().skin) })
    };
    let bench_of = |takes_ambient, air_kpa| {
        let mut bench = Bench::new(small_world(), plan_of(takes_ambient), Restored::default());
        bench.alters = Box::new(move |frame| {
            if let Ok(kpa) = differential.decode(&frame.frame) {
                frame.frame = absolute(air_kpa).encode(kpa).unwrap();
            }
        });
        bench.brought_up();
        bench
    };
    let mut bench = bench_of(true, 97.0);
    bench.start_session(None);
    let zero_kpa = bench.host.session().gauge_zero_kpa;
    assert!(zero_kpa.abs() < 0.2, "the air is no error of the gauge: {zero_kpa}");
    bench.ramp(20.0, 2.0);
    bench.until_pressure(15.0);
    let (read, truth) = (bench.host.session().pressure_kpa.unwrap(), bench.world.true_pressure().0);
    assert!((read - truth).abs() < 0.6, "{read} of {truth} kPa");
    let mut known = bench_of(false, 97.0);
    known.start_session(None);
    assert!(known.host.session().gauge_zero_kpa > 4.0, "a stated ambient pressure counts");
    // What no weather makes is a bag that is not vented.
    let mut pressed = bench_of(true, 88.0);
    let why = pressed.refused(say::start());
    assert!(why.contains("set `gauge.ambient_kpa`"), "{why}");
}
