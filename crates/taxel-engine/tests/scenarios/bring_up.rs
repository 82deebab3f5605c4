//! Boards are configured, proven by their frames, and not touched where the scene only listens.

use taxel_model::GaugeUncertainty;
use taxel_sim::GaugeConfig;
use taxel_skin::Kilopascal;
use taxel_wire::icub;

use crate::prelude::*;
use crate::say::bring_up;

#[test]
fn a_bring_up_loses_the_zero_and_is_verified_again() {
    let mut bench = small().in_charge();
    let sent = bench.host.sent.len();
    bench.ask(bring_up(None)).unwrap();
    bench.until_force(0.1, ForceState::TareInvalid);
    assert!(bench.host.reasons().contains("boards are being configured"), "{}", bench.host.reasons());
    bench.until(3.0, "configuring", |host| host.health().boards.iter().all(|b| b.bring_up == "configuring"));
    bench.brought_up();
    let commands = bench.host.sent[sent..].iter().map(|(_, f)| icub::Command::decode(f).unwrap().1);
    assert_eq!(commands.filter(|c| matches!(c, icub::Command::Start)).count(), 2, "both boards were started");
    bench.seconds(3.0);
    assert_ne!(bench.host.state(), ForceState::Ok, "no zero was taken yet");
    let reasons = bench.host.reasons();
    assert!(reasons.contains("were configured") && reasons.contains("tare"), "{reasons}");
    assert!(!reasons.contains("being configured"), "it is over: {reasons}");
    bench.tare(None).unwrap();
    bench.until_force(1.0, ForceState::Ok);
}

#[test]
fn boards_that_bear_a_load_are_configured_only_if_somebody_confirms_the_skin() {
    let mut bench = small().in_charge();
    bench.lay(0.5, 33);
    bench.seconds(1.0);
    let why = refused_as(ErrorReason::SkinLoaded, bench.ask(bring_up(None)));
    assert!(why.contains("unload the skin first"), "{why}");
    assert!(matches!(bench.ask(bring_up(Some("Ada"))), Ok(Done::BringUpStarted)));
}

/// The daemon counts lost acknowledgements from the last bring-up. The status words say so and nothing is wrong, so that
/// the counts show no new zero.
#[test]
fn lost_acknowledgements_are_counted_anew_after_a_bring_up() {
    let mut bench = small().in_charge();
    let left = bench.reports_lost_acknowledgements(0x4D1);
    for _ in 0..3 {
        left.set(3);
        bench.seconds(4.0);
        assert_eq!((left.get(), bench.host.state()), (0, ForceState::Ok), "{}", bench.host.reasons());
        bench.configure_again(None);
        bench.tare(None).unwrap();
        bench.until_force(1.0, ForceState::Ok);
    }
    left.set(3);
    bench.seconds(4.0);
    assert_eq!(bench.host.state(), ForceState::Ok, "{}", bench.host.reasons());
    left.set(2);
    bench.until(0.3, "five", |host| host.reasons().contains("reported 5 lost acknowledgements"));
}

#[test]
fn an_incomplete_bring_up_names_the_modules_also_where_no_frame_comes() {
    let words = |bench: &Bench| bench.host.health().boards.iter().map(|b| b.bring_up.clone()).collect::<Vec<_>>();
    for (silent, expected) in [
        (
            [2, 5].map(|n| Fault::ModuleSilent(board(13), module(n))),
            ["incomplete: no frame from modules 2, 5", "verified"],
        ),
        (
            [13, 12].map(|address| Fault::BoardSilent(board(address))),
            ["incomplete: no frame from modules 0, 1, 2, 3, 4, 5", "incomplete: no frame from modules 0, 1"],
        ),
    ] {
        let mut bench = Bench::new(small_world(), plan(patch_plan(&small().skin)), Restored::default());
        silent.into_iter().for_each(|fault| bench.inject(fault));
        bench.seconds(4.0);
        assert_eq!(words(&bench), expected);
        if let [Fault::ModuleSilent(..), _] = silent {
            bench.repair(silent[0]);
            bench.seconds(0.5);
            assert_eq!(words(&bench), expected, "one is missing yet");
            bench.repair(silent[1]);
            bench.brought_up();
        }
    }
}

#[test]
fn who_only_listens_never_sends() {
    let listening = PatchPlan { bring_up: Vec::new(), ..patch_plan(&small().skin) };
    let mut world = small_world();
    world.bring_up_boards(world.now());
    let mut bench = Bench::new(world, plan(listening), Restored::default());
    bench.seconds(1.0);
    assert!(bench.host.health().boards.iter().all(|b| b.bring_up == "listening"), "{:?}", bench.host.health());
    let why = bench.refused(bring_up(None));
    assert!(why.contains("only listens"), "{why}");
    bench.start_session(Some(20.0));
    bench.ramp(25.0, 4.0);
    bench.until(10.0, "a model set", |host| host.session().model_set.is_some());
    let set = bench.host.session().model_set.clone().unwrap();
    bench.activate(&set).unwrap();
    bench.world.pump(taxel_sim::PumpCommand::Vent);
    bench.seconds(5.0);
    bench.tare(Some("Ada")).unwrap();
    bench.inject(Fault::PowerCycle { board: board(12), off: std::time::Duration::from_secs(1) });
    bench.seconds(5.0);
    bench.host.notice(taxel_engine::BusNotice::BusOff);
    bench.seconds(1.0);
    assert_eq!(bench.host.sent, [], "not a single frame");
}

/// The boards stream as this daemon configured them: a restart neither zeroes nor hides what lies on them.
#[test]
fn a_restart_under_a_load_goes_on_with_the_zero_of_before_within_two_seconds() {
    for (configures, follow) in [(true, false), (true, true), (false, false)] {
        let patch = || {
            let mut patch = patch_plan(&small().skin);
            patch.bring_up.retain(|_| configures);
            patch.follow_drift = follow;
            plan(patch)
        };
        let mut bench = Bench::new(small().world.clone(), patch(), small().restored());
        bench.until_force(5.0, ForceState::Ok);
        let weight = bench.lay(0.5, 33).0;
        bench.seconds(2.0);
        let before = bench.weigh(20);
        assert!((before - weight).abs() < 0.2 * weight, "{before} N of {weight} N");
        let mut bench = bench.again(patch());
        bench.until_force(2.0, ForceState::Ok);
        assert_eq!(bench.host.sent, [], "boards that stream are left alone");
        let after = bench.weigh(20);
        assert!((after - before).abs() < 0.1, "{before} N before, {after} N after the restart");
        bench.is_truthful_since(0, "a restart under a load");
        let word = if configures { "verified" } else { "listening" };
        assert!(bench.host.health().boards.iter().all(|board| board.bring_up == word));
    }
}

/// Of two boards one has no power while the daemon starts: it is configured, and the zero of the patch is taken anew.
#[test]
fn a_board_that_is_silent_at_the_start_is_configured_alone_and_the_zero_is_proven_anew() {
    let mut bench = small().started();
    bench.until_force(5.0, ForceState::Ok);
    bench.inject(Fault::PowerCycle { board: board(12), off: std::time::Duration::from_millis(10) });
    let mut bench = bench.again(plan(patch_plan(&small().skin)));
    bench.seconds(1.0);
    let to: std::collections::BTreeSet<u8> =
        bench.host.sent.iter().map(|(_, frame)| icub::Command::decode(frame).unwrap().0.get()).collect();
    assert_eq!(to, [12].into(), "the other one keeps its zero");
    bench.brought_up();
    bench.until_force(3.0, ForceState::Ok);
}

/// Without a model set nothing shows what lies on boards that stream, and what lies on them when they are configured reads as
/// nothing to the set that is activated later.
#[test]
fn a_set_that_comes_after_the_boards_were_configured_unseen_takes_no_zero_unless_somebody_confirms_the_skin() {
    // At the start, and by an operator who confirmed once and asked again without confirming: the newest counts.
    configured_unseen(&[], false);
    configured_unseen(&[Some("Ada"), None], false);
    // A session takes its zero there nevertheless, but not for these models.
    configured_unseen(&[], true);
}

/// A load that the boards hide lies there from before they were configured, while a session takes it for rest and after a restart.
#[test]
fn what_was_held_against_the_boards_is_after_a_restart_for_all_sets_but_that_of_the_session() {
    let mut earlier = small().started();
    earlier.brought_up();
    earlier.lay(0.5, 33);
    let plan = || plan(patch_plan(&small().skin));
    let mut bench = Bench::new(earlier.world, plan(), Restored::default());
    bench.brought_up();
    bench.start_session(Some(20.0)); // a first one, which needs nobody's word
    bench.ramp(25.0, 4.0);
    bench.until_state(15.0, SessionState::Review);
    let own = bench.host.session().model_set.clone().unwrap();
    bench.vent(20.0);
    bench.activate(&own).unwrap();
    bench.until_force(2.0, ForceState::Ok);
    for story in ["before a restart", "with it in use"] {
        let mark = bench.mark();
        bench.import(Arc::clone(&small().set));
        bench.activate(&small().set.id).unwrap();
        bench.seconds(3.0);
        bench.is_truthful_since(mark, story);
        assert_eq!(bench.host.state(), ForceState::TareInvalid, "{story}: {}", bench.host.reasons());
        assert!(bench.tare(None).is_err(), "{story}: it was configured unseen");
        bench.activate(&own).unwrap();
        bench.until_force(2.0, ForceState::Ok);
        bench = bench.again(plan());
        bench.brought_up();
        bench.until_force(5.0, ForceState::Ok);
    }
}

fn configured_unseen(again: &[Option<&str>], session: bool) {
    let mut earlier = small().started();
    earlier.brought_up();
    earlier.lay(0.5, 33);
    let Bench { world, .. } = earlier; // its boards stream
    let mut bench = Bench::new(world, plan(patch_plan(&small().skin)), Restored::default());
    bench.brought_up();
    for who in again {
        bench.configure_again(*who);
    }
    if session {
        begun_and_aborted(&mut bench);
    }
    let mark = bench.mark();
    bench.import(Arc::clone(&small().set));
    bench.activate(&small().set.id).unwrap();
    bench.seconds(5.0);
    bench.is_truthful_since(mark, "a load that was configured into the zero of the boards");
    assert_eq!(bench.host.state(), ForceState::TareInvalid);
    let why = refused_as(ErrorReason::TareUnproven, bench.tare(None));
    assert!(why.contains("were configured while there was no force") && why.contains("--confirmed-by"), "{why}");
    let mut bench = bench.again(plan(patch_plan(&small().skin)));
    bench.seconds(5.0);
    assert_ne!(bench.host.state(), ForceState::Ok, "a restart knows it, too");
    bench.world.clear();
    bench.configure_again(Some("Ada"));
    bench.tare(None).unwrap();
    bench.until_force(1.0, ForceState::Ok);
}

fn begun_and_aborted(bench: &mut Bench) {
    let session = bench.start_session(Some(20.0));
    bench.until_state(10.0, SessionState::Ramping);
    bench.ask(Command::AbortSession { session, reason: None }).unwrap();
}

/// A vented bag is at 10 kPa at most, and at no less than 0.3 kPa and three standard deviations of the gauge below none.
#[test]
fn what_a_bag_may_be_at_when_boards_are_configured() {
    for (kpa, later_ms, refused) in [
        (-1.79, 100, None),
        (-1.81, 100, Some((ErrorReason::GaugeOffset, "no less than -1.80 kPa: set the gauge's zero"))),
        (10.0, 100, None),
        (10.01, 100, Some((ErrorReason::BagPresses, "vent it below 10.0 kPa first"))),
        (10.01, 500, Some((ErrorReason::BagPresses, "presses on the skin"))),
        // A reading that is older says nothing any more.
        (10.01, 501, None),
        (-1.81, 501, None),
    ] {
        let mut patch = patch_plan(&small().skin);
        patch.fit.gauge = GaugeUncertainty { gain_rel: 0.5, offset_kpa: 0.3, noise_kpa: 0.4 };
        let mut host = Host::new(plan(patch), Restored::default(), Time::default());
        let time = Time::from_seconds(1.0);
        let frame = GaugeConfig::default().signal.encode(Kilopascal(kpa)).unwrap();
        host.frames(&[TimedFrame { time, frame }]);
        host.now = time + Duration::from_millis(later_ms);
        let request = host.command(bring_up(Some("Ada")));
        match (host.reply(request).unwrap(), refused) {
            (Ok(Done::BringUpStarted), None) => {}
            (Err(Rejection::FailedPrecondition(is, why)), Some((reason, words))) => {
                assert!(is == reason && why.contains(words), "{kpa} kPa: {why}");
            }
            (reply, _) => panic!("{kpa} kPa, {later_ms} ms later: {reply:?}"),
        }
    }
}
