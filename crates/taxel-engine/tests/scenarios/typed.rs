//! A bag whose pressure an operator reads off a dial and types, plateau by plateau.

use taxel_engine::calibration::PLATEAUS_MIN;
use taxel_engine::command::Reply;
use taxel_engine::plan::SessionLimits;
use taxel_model::{FitOptions, GaugeUncertainty};
use taxel_sim::Skin;
use taxel_skin::{Kilopascal, Newton};

use crate::prelude::*;
use crate::rig::start_session;

/// To so many kPa the dial is read.
const RESOLUTION_KPA: f64 = 0.5;
const TARGET_KPA: f64 = 70.0;

/// The same patch with a dial in the place of its gauge.
fn typed(plan: PatchPlan) -> PatchPlan {
    let gauge = GaugeUncertainty { offset_kpa: RESOLUTION_KPA / 12.0_f64.sqrt(), ..GaugeUncertainty::default() };
    PatchPlan {
        gauge: None,
        session: SessionLimits { typed: true, ..plan.session },
        fit: FitOptions { gauge, ..plan.fit },
        ..plan
    }
}

fn bench_of(world: World) -> Bench {
    let patch = typed(patch_plan(world.skin()));
    let mut bench = Bench::new(world, plan(patch), Restored::default());
    bench.brought_up();
    bench
}

/// Holds the bag at a pressure, waits until the skin has settled, and types what the dial shows.
fn plateau(bench: &mut Bench, session: u64, kpa: f64) -> Reply {
    bench.ramp(kpa, 2.0);
    bench.until(120.0, "a settled skin", |host| host.session().typed.is_some_and(|typed| typed.settled));
    bench.seconds(1.0); // somebody has to look and to type
    let shown = (bench.world.true_pressure().0 / RESOLUTION_KPA).round() * RESOLUTION_KPA;
    bench.ask(Command::Plateau { session, kpa: Kilopascal(shown) })
}

/// The vented bag and so many plateaus up to the target, evenly spaced.
fn climb(bench: &mut Bench, session: u64, plateaus: usize) {
    for k in 0..=plateaus {
        // The last one lies a little above the target, so that the dial shows it.
        let kpa = TARGET_KPA * k as f64 / plateaus as f64 + if k == plateaus { RESOLUTION_KPA } else { 0.0 };
        plateau(bench, session, kpa).unwrap();
    }
    bench.until_state(2.0, SessionState::Review);
    bench.world.pump(PumpCommand::Vent);
    bench.seconds(20.0);
}

#[test]
fn eight_typed_plateaus_make_a_calibration() {
    let mut bench = bench_of(small_world());
    let session = bench.start_session(None);
    assert!(bench.host.session().look.is_empty(), "nobody waits for a gauge: {:?}", bench.host.session().look);
    climb(&mut bench, session, PLATEAUS_MIN);
    let view = bench.host.session().clone();
    assert_eq!(view.typed.map(|typed| usize::from(typed.taken)), Some(PLATEAUS_MIN));
    assert!((view.coverage - 1.0).abs() < 1e-9 && view.gauge == "typed by an operator", "{view:?}");
    let set = bench.host.newest_set();
    let usable = set.taxels.iter().filter(|model| model.is_usable()).count();
    assert!(usable * 10 >= set.taxels.len() * 8, "{usable} of {}", set.taxels.len());
    let resolution = RESOLUTION_KPA / 12.0_f64.sqrt();
    let offset = set.gauge_offset_kpa;
    assert!(
        (resolution..3.0 * resolution).contains(&offset),
        "the dial's resolution and the plateaus' scatter: {offset}"
    );
    let pressures: Vec<f64> = bench.host.samples(session).iter().map(|sample| sample.pressure_kpa).collect();
    let least = pressures.chunk_by(|a, b| a == b).map(<[f64]>::len).min();
    assert!(least >= Some(35), "each plateau is a group of its scans: {least:?}");
}

#[test]
fn a_plateau_below_the_last_is_refused_and_too_few_are_not_fitted() {
    let mut bench = bench_of(small_world());
    let session = bench.start_session(None);
    for kpa in [0.0, 10.0, 20.0] {
        plateau(&mut bench, session, kpa).unwrap();
    }
    let taken = bench.host.samples(session).len();
    let why = plateau(&mut bench, session, 15.0).unwrap_err().to_string();
    assert!(why.contains("is not above the 20 kPa of the plateau before"), "{why}");
    assert_eq!(bench.host.samples(session).len(), taken, "nothing of it entered");
    let why = bench.refused(Command::FinishRamp { session });
    assert!(why.contains("2 plateaus above the vented bag, and 8 make a calibration"), "{why}");
    // What was taken counts in another ramp.
    bench.ask(Command::AbortSession { session, reason: None }).unwrap();
    bench.world.pump(PumpCommand::Vent);
    bench.seconds(20.0);
    bench.ask(Command::StartRamp { session }).unwrap();
    bench.until_state(20.0, SessionState::Ramping);
    for kpa in [0.0, 8.0] {
        plateau(&mut bench, session, kpa).unwrap();
    }
    assert_eq!(bench.host.session().typed.map(|typed| typed.taken), Some(3));
}

#[test]
fn nothing_is_typed_where_a_gauge_says_the_pressure_or_while_it_falls() {
    let (mut bench, session) = ramping(5.0);
    let why = bench.refused(Command::Plateau { session, kpa: Kilopascal(5.0) });
    assert!(why.contains("a gauge says the pressure of this patch"), "{why}");
    let mut bench = bench_of(small_world());
    let refused = bench.ask(start_session("", None, Some(Branch::Both)));
    assert!(matches!(refused, Err(Rejection::InvalidArgument { field: "branches", .. })), "{refused:?}");
}

#[test]
fn a_session_that_nobody_types_in_ends() {
    let mut bench = bench_of(small_world());
    bench.start_session(None);
    bench.until_state(16.0 * 60.0, SessionState::Failed);
    assert!(bench.host.session().reason.contains("nothing was typed for 15 minutes"));
}

/// How the pressure comes to its target.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Course {
    /// A pump that keeps its rate.
    Ramp,
    /// A hand pump: strokes of 0.2 to 0.8 s at 0 to 6 kPa/s, every fourth a pause of the hand, in which the valve lets 0.5 kPa/s in.
    Hand,
    /// So many plateaus, typed.
    Plateaus(usize),
}

/// One stroke of a hand pump, other ones for other seeds.
fn stroke(bench: &mut Bench, seed: u64, stroke: u64) {
    // Two fractions of 0 to 1 by the golden and the silver ratio: spread evenly, without a pattern that a stroke could follow.
    let [long, fast] = [0.618_034, 0.414_214].map(|ratio| ((stroke + 1_000 * seed) as f64 * ratio).fract());
    let (target_kpa, kpa_per_s) = if stroke % 4 == 3 { (0.0, 0.5) } else { (TARGET_KPA + 4.0, 6.0 * fast) };
    bench.ramp(target_kpa, kpa_per_s);
    bench.seconds(0.2 + 0.6 * long);
}

/// Of masses on the forearm, with models by such a course: the mean absolute error in percent, and the share whose 95 % interval holds
/// the weight.
fn weighed(seed: u64, course: Course) -> (f64, f64) {
    let world = World::new(Skin::forearm().unwrap(), Config::seeded(seed));
    let mut bench = if matches!(course, Course::Plateaus(_)) {
        bench_of(world)
    } else {
        let mut bench = Bench::new(world.clone(), plan(patch_plan(world.skin())), Restored::default());
        bench.brought_up();
        bench
    };
    let session = bench.start_session(Some(TARGET_KPA));
    match course {
        Course::Plateaus(plateaus) => climb(&mut bench, session, plateaus),
        Course::Ramp => bench.ramp(74.0, 2.0),
        Course::Hand => {
            let mut strokes = 0..1_000;
            while bench.host.session().state == SessionState::Ramping {
                stroke(&mut bench, seed, strokes.next().unwrap());
            }
        }
    }
    if !matches!(course, Course::Plateaus(_)) {
        bench.until_state(100.0, SessionState::Review);
        bench.world.pump(PumpCommand::Vent);
        bench.seconds(20.0);
    }
    let set = bench.host.newest_set().id.clone();
    bench.activate(&set).unwrap();
    bench.tare(Some("Ada")).unwrap();
    bench.until_force(10.0, ForceState::Ok);
    let (mut errors, mut held, taxels) = (Vec::new(), 0, bench.world.skin().patch().taxels().len());
    for (m, kilogram) in [0.2, 0.4, 0.6, 0.8, 1.0].into_iter().enumerate() {
        for place in 0..4 {
            let centre = (place * taxels / 4 + 20 * m + 7 * seed as usize) % taxels;
            let centre = TaxelIndex(u16::try_from(centre).unwrap());
            let weight = bench.world.lay(Mass::on_disc(kilogram, centre, 600.0)).unwrap().0;
            bench.seconds(1.0);
            errors.push(100.0 * (bench.weigh(10) / weight - 1.0).abs());
            let force = &bench.host.snapshots.last().unwrap().force;
            let reaches = |end: Option<Newton>, sign: f64| end.is_none_or(|end| sign * (end.0 - weight) >= 0.0);
            held += usize::from(reaches(force.low(), -1.0) && reaches(force.high(), 1.0));
            bench.world.clear();
            bench.run(Duration::from_secs(2));
        }
    }
    let n = errors.len() as f64;
    (errors.iter().sum::<f64>() / n, held as f64 / n)
}

#[test]
fn twelve_typed_plateaus_are_as_good_as_a_ramp_to_one_point() {
    let ((ramp, _), (typed, held)) = (weighed(7, Course::Ramp), weighed(7, Course::Plateaus(12)));
    assert!(typed <= ramp + 1.0, "{typed:.2} % by 12 plateaus, {ramp:.2} % by the ramp");
    assert!(held >= 0.9, "the stated interval held {held:.2} of the weights");
}

/// The figures: `cargo test -p taxel-engine --test scenarios typed::figures -- --ignored --nocapture`.
#[test]
#[ignore = "takes minutes and prints figures: cargo test -p taxel-engine --test scenarios -- --ignored --nocapture typed::figures"]
fn figures() {
    let plateaus = [8, 12, 20].map(Course::Plateaus);
    for course in [Course::Ramp, Course::Hand].into_iter().chain(plateaus) {
        let (errors, held): (Vec<f64>, Vec<f64>) = (1..=5).map(|seed| weighed(seed, course)).unzip();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        let held = 100.0 * held.iter().sum::<f64>() / held.len() as f64;
        println!(
            "{course:?}: {mean:.2} %, {held:.0} % held ({})",
            errors.iter().map(|e| format!("{e:.2}")).collect::<Vec<_>>().join(", ")
        );
    }
}
