//! Known loads correct the gain of a model set: a new set that nobody uses before an operator says so, made once and never
//! corrected twice.

use taxel_engine::loads::{KnownLoad, Load, LoadsPlan, Validation, Weight, judge};
use taxel_engine::recalibration::{Assumptions, Chosen, Proposal, Recalibration, propose};

use crate::prelude::*;

/// The configured areas are this much too small, which reads as a gain that is off.
const OFF: f64 = 1.1;

/// Masses in kg at five places, and three that no correction has seen.
const MASSES: [(f64, u16); 5] = [(0.4, 33), (0.6, 22), (0.8, 44), (0.5, 14), (0.7, 55)];
const OTHERS: [(f64, u16); 3] = [(0.45, 24), (0.55, 35), (0.65, 53)];

fn too_small(plan: &mut PatchPlan) {
    plan.areas.iter_mut().for_each(|area| *area = SquareMillimetre(area.0 / OFF));
}

/// Lays masses down one after the other and has each read as what `noted` says; the numbers of the loads.
fn weigh(bench: &mut Bench, masses: &[(f64, u16)], noted: impl Fn(usize, f64) -> f64) -> Vec<u64> {
    let one = |(n, (kilogram, centre)): (usize, &(f64, u16))| {
        bench.lay(*kilogram, *centre);
        bench.seconds(1.5);
        let (weight, note, by) = (Weight::Kilogram(noted(n, *kilogram)), String::new(), "Ada".to_owned());
        let load = KnownLoad { weight, relative_sigma: 0.005, note, by, replaces: None };
        let Ok(Done::LoadRecorded(load)) = bench.ask(Command::RecordLoad { patch: String::new(), load }) else {
            panic!("load {n} was refused")
        };
        bench.world.clear();
        bench.seconds(2.0);
        load.number
    };
    masses.iter().enumerate().map(one).collect()
}

fn validation(bench: &Bench) -> &Validation {
    &bench.host.catalogue.validations[0]
}

fn proposal(bench: &Bench, source: &ModelSet, chosen: &Chosen) -> Proposal {
    propose(validation(bench), source, chosen, Assumptions::MASSES, 1).unwrap()
}

/// Mean of what is read over what lies there, over masses that no correction has seen.
fn ratio(bench: &mut Bench) -> f64 {
    let mut sum = 0.0;
    for (kilogram, centre) in OTHERS {
        let weight = bench.lay(kilogram, centre).0;
        bench.seconds(1.5);
        sum += bench.weigh(10) / weight / OTHERS.len() as f64;
        bench.world.clear();
        bench.seconds(2.0);
    }
    sum
}

/// The set of a proposal, as the service would name it.
fn named(proposal: &Proposal, id: &str) -> Arc<ModelSet> {
    Arc::new(ModelSet { id: id.to_owned(), ..proposal.set.clone().unwrap() })
}

/// A skin that was weighed, and what that made of its set.
fn corrected() -> (Bench, Arc<ModelSet>) {
    let mut bench = small().in_use_with(too_small);
    weigh(&mut bench, &MASSES, |_, kilogram| kilogram);
    let set = named(&proposal(&bench, &small().set, &Chosen::default()), "m-corrected");
    (bench, set)
}

fn keep(set: &Arc<ModelSet>) -> Command {
    Command::KeepRecalibration { model_set: Arc::clone(set) }
}

#[test]
fn five_masses_correct_a_gain_that_is_a_tenth_off_and_only_activation_uses_it() {
    let mut bench = small().in_use_with(too_small);
    let before = ratio(&mut bench);
    weigh(&mut bench, &MASSES, |_, kilogram| kilogram);
    let found = proposal(&bench, &small().set, &Chosen::default());
    let gain = found.found.line.gain;
    eprintln!("gain {gain:.4} +- {:.4}, relative {:.4}", found.found.gain_sigma(), found.found.relative_sigma());
    assert!(found.found.is_sound() && found.found.is_needed(), "{:?}", found.found);
    assert!((gain / OFF - 1.0).abs() < 2.0 * found.found.relative_sigma(), "{gain}");
    let set = named(&found, "m-corrected");
    let Ok(Done::Kept { known: false, .. }) = bench.ask(keep(&set)) else { panic!("it was not kept") };
    assert!(bench.host.records.iter().any(|r| matches!(r, Record::ModelSet(kept) if kept.id == "m-corrected")));
    let unused = ratio(&mut bench);
    assert!((unused / before - 1.0).abs() < 0.02, "kept and not used: {unused}, {before} before");
    bench.activate("m-corrected").unwrap();
    let after = ratio(&mut bench);
    eprintln!("read over laid on: {before:.3} before, {after:.3} after");
    assert!((after / before / gain - 1.0).abs() < 0.02, "{after} after, {before} before, gain {gain}");
    assert!((after - 1.0).abs() < 0.5 * (before - 1.0).abs(), "{after} after, {before} before");
    let sample = &bench.host.snapshot().force;
    assert_eq!(sample.model_set.as_deref(), Some("m-corrected"));
    // The uncertainty of the correction is in that of every force.
    assert!(set.gauge_gain_rel >= found.found.relative_sigma() && set.gauge_gain_rel > small().set.gauge_gain_rel);
    // The way back.
    bench.activate(&small().set.id).unwrap();
    let back = ratio(&mut bench);
    assert!((back / before - 1.0).abs() < 0.02, "{back}");
}

/// They agree with each other whatever the rest of the skin does, and the correction would be stated as good everywhere.
#[test]
fn masses_at_fewer_than_three_places_correct_nothing() {
    let mut bench = small().in_use_with(too_small);
    weigh(&mut bench, &[(0.4, 33), (0.5, 33), (0.6, 33), (0.7, 33), (0.8, 33)], |_, kilogram| kilogram);
    for (places, more) in [(1, (0.6, 55)), (2, (0.5, 14))] {
        let found = proposal(&bench, &small().set, &Chosen::default());
        let why = found.set.unwrap_err();
        assert!(why.contains(&format!("lie at {places} of at least 3 places")), "{why}");
        assert_eq!(found.found.places, places);
        weigh(&mut bench, &[more], |_, kilogram| kilogram);
    }
    let found = proposal(&bench, &small().set, &Chosen::default());
    assert!(found.found.is_sound() && found.found.places == 3, "{:?}", found.found);
    // Five of the seven are off together, so the gain is less certain than that of seven places.
    let points: Vec<_> = found.found.points.iter().map(|judged| judged.point).collect();
    let places: Vec<usize> = (0..points.len()).collect();
    let apart = Recalibration::of(&points, &places, Assumptions::MASSES).unwrap();
    assert!(found.found.gain_sigma() > 1.3 * apart.gain_sigma(), "{:?}, {:?} apart", found.found, apart);
    assert_eq!(found.found.line, apart.line, "the gain itself is the same");
}

#[test]
fn a_mass_that_was_noted_wrong_is_named_makes_no_set_and_can_be_left_out() {
    let mut bench = small().in_use_with(too_small);
    let numbers = weigh(&mut bench, &MASSES, |n, kilogram| if n == 2 { 2.0 * kilogram } else { kilogram });
    let found = proposal(&bench, &small().set, &Chosen::default());
    assert_eq!(found.found.contradicts, Some(numbers[2]));
    let why = found.set.unwrap_err();
    assert!(why.contains(&format!("point {} contradicts the others", numbers[2])), "{why}");
    // Four are left, which are too few.
    let without = Chosen { leave_out: vec![numbers[2]], ..Chosen::default() };
    let few = propose(validation(&bench), &small().set, &without, Assumptions::MASSES, 1).unwrap_err();
    assert!(few.contains("4 known loads so far; at least 5"), "{few}");
    weigh(&mut bench, &OTHERS[..1], |_, kilogram| kilogram);
    let found = proposal(&bench, &small().set, &without);
    assert!(found.found.is_sound(), "{:?}", found.found);
    for (chosen, says) in [
        (Chosen { loads: vec![99], ..Chosen::default() }, "no load 99"),
        (Chosen { loads: numbers[..4].to_vec(), ..Chosen::default() }, "4 known loads so far"),
    ] {
        let refused = propose(validation(&bench), &small().set, &chosen, Assumptions::MASSES, 1).unwrap_err();
        assert!(refused.contains(says), "{refused}");
    }
    // With another set in use the loads say nothing, and a set that was proposed before is not kept.
    let set = named(&found, "m-corrected");
    bench.import(say::other("m-other"));
    bench.activate("m-other").unwrap();
    let refused = bench.refused(keep(&set));
    assert!(refused.contains("m-other is active now"), "{refused}");
    assert!(bench.host.catalogue.model_sets.iter().all(|known| known.id != "m-corrected"));
}

#[test]
fn the_set_that_a_correction_came_from_stays_while_the_corrected_one_is_in_use() {
    let (mut bench, set) = corrected();
    assert_eq!((set.derived_from(), set.session), (Some(small().set.id.as_str()), None));
    bench.ask(keep(&set)).unwrap();
    let Ok(Done::Kept { known: true, .. }) = bench.ask(keep(&set)) else { panic!("twice is once") };
    bench.activate("m-corrected").unwrap();
    let refused = bench.refused(say::delete_set(&small().set.id));
    assert!(refused.contains("`m-corrected`, which is in use, was made of"), "{refused}");
    bench.activate(&small().set.id).unwrap();
    bench.ask(say::delete_set("m-corrected")).unwrap();
}

/// Whether the calibration that it came from was laid aside counts, not another one.
#[test]
fn a_correction_of_a_discarded_calibration_is_not_used() {
    let (_, set) = corrected();
    let own = small().set.id.as_str();
    for (discarded, sets) in [(false, [own, "m-laid-aside"]), (true, ["m-other", own])] {
        let known = |(number, state, set): (u64, SessionState, &str)| {
            Arc::new(SessionView { number, state, model_set: Some(set.into()), ..small().session.clone() })
        };
        let sessions = [(1, SessionState::Review, sets[0]), (2, SessionState::Discarded, sets[1])].map(known).into();
        let model_sets = vec![Arc::clone(&set).into(), Arc::clone(&small().set).into()];
        let restored = Restored { model_sets, sessions, next_session: 3, ..Restored::default() };
        let mut bench = small().listening(restored, too_small);
        bench.seconds(2.0);
        let refused = bench.activate("m-corrected").err().map(|refused| refused.to_string());
        assert_eq!(refused.is_some_and(|why| why.contains("DISCARDED")), discarded, "{sets:?}");
    }
}

#[test]
fn a_correction_says_nothing_of_other_areas_than_its_loads_were_read_with() {
    let (_, set) = corrected();
    for (active, areas_as_they_were) in [(true, true), (true, false), (false, true), (false, false)] {
        let in_use = if active { &set.id } else { &small().set.id };
        let restored = Restored {
            model_sets: vec![Arc::clone(&set).into(), Arc::clone(&small().set).into()],
            active: vec![(set.patch.clone(), in_use.clone())],
            ..Restored::default()
        };
        let areas = if areas_as_they_were { too_small } else { |_: &mut PatchPlan| () };
        let mut bench = small().listening(restored, areas);
        bench.seconds(3.0);
        if active {
            let used = bench.host.snapshot().force.model_set.as_deref() == Some("m-corrected");
            assert_eq!(used, areas_as_they_were);
            let told =
                bench.host.healths.last().unwrap().problems.iter().any(|p| p.contains("the configured areas were"));
            assert_eq!(told, !areas_as_they_were);
        } else {
            let refused = bench.activate("m-corrected").err();
            assert_eq!(refused.is_none(), areas_as_they_were, "{refused:?}");
        }
    }
}

#[test]
fn a_load_that_lay_under_a_degraded_force_counts_for_nothing() {
    let mut bench = small().in_use_with(too_small);
    let numbers = weigh(&mut bench, &MASSES, |_, kilogram| kilogram);
    let mut view = validation(&bench).clone();
    assert!(view.loads.iter().all(|judged| judged.counts()));
    let mut loads: Vec<_> = view.loads.iter().rev().map(|judged| (*judged.load).clone()).collect();
    loads[0].read.reasons = vec!["module 3 is silent: the total is a lower bound".to_owned()];
    let (area_mm2, of) = (loads[0].mean_area_mm2, view.model_set.clone());
    let loads: Vec<_> = loads.into_iter().map(Arc::new).collect();
    let plan = LoadsPlan { patch: view.patch.clone(), mean_area_mm2: area_mm2, fills: true };
    view = judge(&plan, &loads, of);
    let counted = view.loads.iter().filter(|judged| judged.counts()).count();
    assert_eq!(counted, MASSES.len() - 1);
    let chosen = Chosen { loads: numbers, ..Chosen::default() };
    let why = propose(&view, &small().set, &chosen, Assumptions::MASSES, 1).unwrap_err();
    assert!(why.contains("DEGRADED") && why.contains("module 3 is silent"), "{why}");
}

/// What lacks where nothing is filled goes into the gain, and would count twice once it is filled.
#[test]
fn loads_and_their_correction_say_nothing_of_a_sum_that_is_made_in_another_way() {
    let (bench, set) = corrected();
    let view = validation(&bench);
    let area_mm2 = view.loads[0].load.mean_area_mm2;
    let unfit = |fills| set.unfit_for_sum(&LoadsPlan { patch: view.patch.clone(), mean_area_mm2: area_mm2, fills });
    assert_eq!(unfit(true), None);
    let why = unfit(false).unwrap();
    assert!(why.contains("were read, faulty taxels were filled by their neighbours, and are not now"), "{why}");
    let loads: Vec<Arc<Load>> = view.loads.iter().rev().map(|judged| Arc::clone(&judged.load)).collect();
    let counted = |loads: &[Arc<Load>], fills| {
        let plan = LoadsPlan { patch: view.patch.clone(), mean_area_mm2: area_mm2, fills };
        let judged = judge(&plan, loads, view.model_set.clone());
        (judged.loads.iter().filter(|load| load.counts()).count(), judged.loads[0].outdated_because.clone())
    };
    let said = "faulty taxels were filled by their neighbours, and are not now".to_owned();
    assert_eq!([counted(&loads, true), counted(&loads, false)], [(MASSES.len(), String::new()), (0, said)]);
}
