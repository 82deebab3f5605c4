//! Invariant: a board's re-tare, power cycle or lost acknowledgement invalidates live force until rest is proven again.

use taxel_engine::snapshot::{Reason, ReasonCode};

use crate::prelude::*;

/// The zero is lost for this reason, stays lost, and comes back with a tare alone.
fn is_lost_until_tared(bench: &mut Bench, reason: &str) {
    bench.until_force(5.0, ForceState::TareInvalid);
    assert!(bench.host.reasons().contains(reason), "{}", bench.host.reasons());
    bench.seconds(5.0);
    assert_eq!(bench.host.state(), ForceState::TareInvalid, "{}", bench.host.reasons());
    assert!(bench.host.reasons().contains(reason), "the first reason is kept: {}", bench.host.reasons());
    let snapshot = bench.host.snapshot();
    let tare = snapshot.tare.as_ref().unwrap();
    assert_eq!((tare.valid, tare.code), (false, Some(ReasonCode::ZeroLost)));
    let codes: Vec<ReasonCode> = snapshot.force.reasons.iter().map(Reason::code).collect();
    assert_eq!(codes, [ReasonCode::ZeroLost], "the same for programs");
    bench.tare(None).unwrap();
    bench.until_force(1.0, ForceState::Ok);
}

#[test]
fn a_power_cycle_invalidates_the_force_until_a_tare() {
    let mut bench = small().in_use();
    bench.inject(Fault::PowerCycle { board: board(12), off: Duration::from_millis(1_200) });
    bench.until_force(0.3, ForceState::Stale);
    bench.seconds(1.5);
    let now = bench.now();
    bench.world.bring_up_boards(now); // as another host on the bus would
    is_lost_until_tared(&mut bench, "board 12 was silent for");
}

/// Lets the module report so many lost acknowledgements, one with each scan.
fn lose_acknowledgements(bench: &mut Bench, count: u32) {
    let fault = Fault::ModuleNoAck(board(13), module(1));
    let errors = |host: &Host| host.health().boards[0].status_errors;
    bench.seconds(1.2); // the health has the present count
    let before = errors(&bench.host);
    bench.inject(fault);
    bench.seconds(0.05 * f64::from(count));
    bench.repair(fault);
    bench.seconds(1.2);
    assert_eq!(errors(&bench.host) - before, u64::from(count), "lost acknowledgements");
}

/// How far the board had counted before is not known, so that each of them takes the force away until the counts have shown that
/// the zero is the same. The board counts over any time: the fifth takes its zero anew.
#[test]
fn four_lost_acknowledgements_are_borne_and_a_fifth_later_invalidates_the_force_until_a_tare() {
    let mut bench = small().in_use();
    let (first, epoch) = (bench.host.snapshots.len(), bench.host.snapshot().tare.as_ref().unwrap().epoch);
    lose_acknowledgements(&mut bench, 4);
    let without = bench.host.snapshots[first..].iter().filter(|s| s.force.total.is_none()).count();
    assert!((10..=24).contains(&without), "eight scans and more after the last of four: {without}");
    bench.seconds(3.0); // taxels that read all zeros are faulty for a while yet
    assert_eq!(bench.host.state(), ForceState::Ok, "{}", bench.host.reasons());
    assert_eq!(bench.host.snapshot().tare.as_ref().unwrap().epoch, epoch, "the same zero");
    bench.seconds(20.0);
    lose_acknowledgements(&mut bench, 1);
    is_lost_until_tared(&mut bench, "5 lost acknowledgements");
}

/// In a long pause boards may have been without power, and the skin may have warmed or cooled: the zero of before proves nothing.
#[test]
fn a_bus_off_and_a_long_pause_of_the_daemon_invalidate_the_force_until_a_tare() {
    let pause = |bench: &mut Bench| bench.host.input(bench.host.now, Input::Resumed(Duration::from_secs(3600)));
    for (happens, why) in
        [(Bench::bus_off as fn(&mut Bench), "bus-off"), (pause, "the daemon did not run for 3600.0 s")]
    {
        let mut bench = small().in_use();
        happens(&mut bench);
        is_lost_until_tared(&mut bench, why);
    }
}

#[test]
fn a_tare_under_a_mass_is_refused_with_figures() {
    let mut bench = small().in_use();
    bench.press_everywhere(10.0);
    bench.seconds(1.0);
    let before = bench.host.snapshot().tare.clone();
    let why = refused_as(ErrorReason::TareLoaded, bench.tare(None));
    for part in ["tare refused: something presses on ", " counts, limit ", "`taxeld tare --confirmed-by NAME`"] {
        assert!(why.contains(part), "`{part}` is not in: {why}");
    }
    assert_eq!(bench.host.snapshot().tare, before, "the earlier zero still holds");
}

/// Nothing can prove a tare without models, and nothing needs it.
#[test]
fn without_a_model_set_the_zero_and_a_tare_say_to_calibrate() {
    let Bench { world, .. } = small().started();
    let mut bench = Bench::new(world, plan(patch_plan(&small().skin)), Restored::default());
    bench.brought_up();
    bench.seconds(2.0);
    let tare = bench.host.snapshot().tare.clone().unwrap();
    let calibrate = "no model set is in use: `taxeld calibrate` takes the zero and makes one";
    assert_eq!((tare.valid, tare.reason.as_str()), (false, calibrate));
    let why = refused_as(ErrorReason::NoModelSet, bench.tare(None));
    assert_eq!(why, format!("tare refused: {calibrate}"));
    assert!(bench.tare(Some("Ada")).is_ok(), "who confirms has a zero all the same");
}

/// An operator's word is asked for where it helps alone.
#[test]
fn a_tare_that_no_word_would_have_helped_asks_for_none() {
    let mut bench = small().in_use();
    let tare = |confirmed_by| Command::Tare { patch: String::new(), confirmed_by };
    let overtaken = bench.host.command(tare(None));
    bench.seconds(0.5);
    assert!(bench.tare(None).is_ok());
    let why = refused_as(ErrorReason::TareSuperseded, bench.host.reply(overtaken).unwrap());
    assert!(why.contains("another tare began") && !why.contains("confirmed"), "{why}");
    let moved = bench.host.command(tare(Some("Ada".to_owned())));
    bench.seconds(0.5);
    bench.press_everywhere(1.5);
    bench.seconds(5.0);
    let why = refused_as(ErrorReason::TareUnsteady, bench.host.reply(moved).unwrap());
    assert!(why.contains("moved") && !why.contains("confirmed"), "{why}");
    assert!(why.ends_with(". Tare while nothing touches the skin and nothing moves it"), "{why}");
}

/// What presses a few taxels to the end of their range takes them out of every comparison: they have a fault. So they look
/// as broken ones do, and only somebody who sees the skin can tell.
#[test]
fn no_tare_is_taken_beside_taxels_that_stand_at_their_rail_unless_somebody_confirms() {
    let mut bench = small().in_use();
    let stuck = |taxel: u16| Fault::TaxelStuck { taxel: TaxelIndex(taxel), value: 0 };
    bench.inject(stuck(43));
    bench.seconds(5.0);
    assert!(bench.tare(None).is_ok(), "one may be broken");
    bench.inject(stuck(44));
    bench.seconds(5.0);
    let before = bench.host.snapshot().tare.clone();
    let why = refused_as(ErrorReason::TareLoaded, bench.tare(None));
    assert!(why.contains("something presses on board 13 module 4, or 2 taxels are broken"), "{why}");
    assert_eq!(bench.host.snapshot().tare, before, "the earlier zero still holds");
    assert!(bench.tare(Some("Ada")).is_ok());
}

/// The zero that a record has, and of which patch.
fn zero_of(record: &Record) -> Option<(&str, &taxel_engine::record::TakenZero)> {
    let Record::Zero { patch, zero } = record else { return None };
    Some((patch, zero.zero.as_deref()?))
}

#[test]
fn a_tare_that_somebody_confirms_is_taken_and_written_down_with_the_name() {
    let mut bench = small().in_use();
    bench.press_everywhere(1.5); // light, so that the skin does not step when it goes
    bench.seconds(1.0);
    let Ok(Done::Tared(view)) = bench.tare(Some("Ada")) else { panic!("refused") };
    let (patch, written) = bench.host.records.iter().rev().find_map(zero_of).expect("a record of the zero");
    assert_eq!((patch, written.mean.len(), written.confirmed), ("small", 80, true));
    assert_eq!((written.epoch, written.wall_ns, &written.reason), (view.epoch, view.wall_ns, &view.reason));
    assert!(
        view.reason.starts_with("Ada confirms that nothing touches the skin; something presses on "),
        "{}",
        view.reason
    );
    assert_eq!(bench.host.snapshot().tare.as_ref(), Some(&view));
}

#[test]
fn a_tare_of_a_silent_skin_is_refused_and_names_the_modules() {
    let mut bench = small().in_use();
    bench.inject(Fault::BoardSilent(board(12)));
    bench.inject(Fault::BoardSilent(board(13)));
    let why = refused_as(ErrorReason::SkinSilent, bench.tare(Some("Ada")));
    assert!(why.contains("8 modules are silent: board 13 module 0"), "{why}");
}

/// The daemon starts beside streaming boards, its model set in the store.
fn start(load: impl FnOnce(&mut Bench)) -> Bench {
    // The world goes on by itself first, so that the load lies there from before the start.
    let mut bench = small().listening(small().restored(), |_| ());
    load(&mut bench);
    Bench::new(bench.world, bench.host.plan, small().restored())
}

fn forces(bench: &Bench) -> usize {
    bench.host.snapshots.iter().filter(|s| s.force.total.is_some()).count()
}

#[test]
fn the_first_force_comes_after_a_second_of_rest() {
    let mut bench = start(|_| {});
    bench.until_force(2.0, ForceState::Ok);
    let whole = bench.host.snapshots.iter().position(|s| s.force.stale == 0).unwrap();
    let after = bench.host.published[bench.host.published.len() - 1].since(bench.host.published[whole]);
    assert!(after <= Duration::from_millis(1_100), "{after:?} after the first whole scan");
    assert_eq!(forces(&bench), 1, "none before");
    let tare = bench.host.snapshot().tare.clone().unwrap();
    assert!(tare.valid && tare.reason.starts_with("unloaded"), "{}", tare.reason);
    assert!(bench.host.records.iter().any(|record| zero_of(record).is_some()));
}

#[test]
fn no_force_begins_under_a_load_of_any_kind() {
    let everywhere = |bench: &mut Bench| bench.press_everywhere(10.0);
    let one_module = |bench: &mut Bench| {
        bench.lay(1.0, 33);
        bench.seconds(20.0);
    };
    for mut bench in [start(everywhere), start(one_module)] {
        bench.seconds(5.0);
        assert_eq!((bench.host.state(), forces(&bench)), (ForceState::TareInvalid, 0), "{}", bench.host.reasons());
        assert!(bench.host.reasons().contains("no zero yet: something presses on "), "{}", bench.host.reasons());
        bench.world.clear();
        bench.until_force(30.0, ForceState::Ok);
    }
}

#[test]
fn after_a_bring_up_no_zero_is_taken_before_the_boards_are_verified() {
    let mut bench = Bench::new(small_world(), plan(patch_plan(&small().skin)), small().restored());
    bench.until_force(5.0, ForceState::Ok);
    let (started, _) = bench.host.sent.last().expect("the boards were started");
    assert!(*bench.host.published.last().unwrap() >= *started + Duration::from_secs(1));
}
