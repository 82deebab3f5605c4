//! A zero that is lost stays lost, and takes every watch with it that saw what was before.

use crate::prelude::*;

#[test]
fn a_zero_taken_under_a_load_stays_lost_when_the_load_comes_back() {
    let everywhere = |bench: &mut Bench| bench.press_everywhere(1.5);
    let heavier = |bench: &mut Bench| bench.press_everywhere(6.0);
    let on_one_module = |bench: &mut Bench| {
        bench.lay(0.3, 33);
    };
    let loads: [&dyn Fn(&mut Bench); 3] = [&everywhere, &heavier, &on_one_module];
    for (n, load) in loads.into_iter().enumerate() {
        let mut bench = small().in_use();
        load(&mut bench);
        bench.seconds(2.0);
        bench.tare(Some("Ada")).unwrap();
        bench.seconds(3.0); // Ada is right until the counts say otherwise
        bench.world.clear();
        bench.until(5.0, "the finding", |host| {
            host.snapshot().tare.as_ref().is_some_and(|tare| tare.reason.contains("taken under a load"))
        });
        let found = bench.mark();
        bench.seconds(3.0);
        load(&mut bench);
        bench.seconds(6.0);
        bench.world.clear();
        bench.seconds(3.0);
        assert!(!bench.has_force_since(found), "load {n}: a force of a zero that was proven bad");
        assert!(bench.host.reasons().contains("taken under a load"), "load {n}: {}", bench.host.reasons());
        bench.tare(None).unwrap();
        bench.until_force(1.0, ForceState::Ok);
    }
}

/// What happens to a zero: by name, how it begins before somebody watches, and what comes so many seconds into the watch.
type Event = (&'static str, fn(&mut Bench), f64, fn(&mut Bench));

const EVENTS: [Event; 3] = [
    ("bus-off", |_| (), 0.9, Bench::bus_off),
    (
        "lost acknowledgements",
        |_| (),
        0.7,
        |bench| {
            bench.inject(Fault::ModuleNoAck(board(13), module(1)));
            bench.seconds(0.3);
            bench.repair(Fault::ModuleNoAck(board(13), module(1)));
        },
    ),
    (
        "power cycle",
        |bench| {
            bench.inject(Fault::PowerCycle { board: board(12), off: Duration::from_millis(1_200) });
            bench.seconds(0.3);
        },
        0.9,
        |bench| {
            let now = bench.now();
            bench.world.bring_up_boards(now); // as another host on the bus would
            bench.seconds(0.2);
        },
    ),
];

#[test]
fn whatever_loses_a_zero_ends_the_watch_of_a_tare() {
    let bring_up: Event = ("bring-up", |_| (), 0.9, |bench| drop(bench.ask(say::bring_up(None)).unwrap()));
    for (what, begins, after_s, happens) in EVENTS.into_iter().chain([bring_up]) {
        let mut bench = small().in_charge();
        begins(&mut bench);
        let request = bench.host.command(say::tare());
        bench.seconds(after_s);
        happens(&mut bench);
        let reply = bench.host.reply(request);
        let Some(Err(Rejection::FailedPrecondition(_, why))) = reply else { panic!("{what}: {reply:?}") };
        assert!(why.contains("meanwhile"), "{what}: {why}");
        bench.seconds(0.1);
        let mark = bench.mark();
        bench.seconds(4.0);
        assert!(!bench.has_force_since(mark), "{what}");
        assert_eq!(bench.host.state(), ForceState::TareInvalid, "{what}");
        bench.tare(None).unwrap();
        bench.until_force(1.0, ForceState::Ok);
    }
}

/// With models and without them: its ramp begins after a second of rest that came later.
#[test]
fn a_session_watches_a_whole_second_after_its_zero_was_lost() {
    for (what, begins, after_s, happens) in EVENTS {
        for mut bench in [small().in_charge(), fresh()] {
            begins(&mut bench);
            bench.ask(say::start()).unwrap();
            bench.seconds(after_s);
            happens(&mut bench);
            let over = bench.now();
            assert_eq!(bench.host.session().state, SessionState::Taring, "{what}: {:?}", bench.host.session());
            bench.until_state(10.0, SessionState::Ramping);
            let watched = bench.now().since(over);
            assert!(watched >= Duration::from_millis(840), "{what}: the ramp began {watched:?} later");
        }
    }
}

/// There is no zero, a load lies on the skin, and a board that takes a new zero under it reads as at rest from then on: a
/// tare has nothing to see the load by, but the load was seen before.
#[test]
fn a_board_that_takes_a_zero_under_a_load_while_there_is_none_is_not_tared() {
    let mut bench = small().in_charge();
    bench.lay(0.8, 33);
    bench.seconds(3.0);
    bench.bus_off();
    bench.seconds(1.0);
    bench.inject(Fault::BoardSilent(board(13)));
    bench.seconds(0.5);
    bench.inject(Fault::SilentRetare(board(13)));
    bench.repair(Fault::BoardSilent(board(13)));
    bench.seconds(2.0);
    let mark = bench.mark();
    let why = bench.tare(None).unwrap_err().to_string();
    assert!(why.contains("lost its load while it was silent") && why.contains("taxeld bring-up"), "{why}");
    bench.is_truthful_since(mark, "a tare after a new zero of a board");
    bench.world.clear();
    bench.seconds(1.0);
    for confirmed_by in [None, Some("Ada")] {
        bench.configure_again(confirmed_by);
        assert_eq!(bench.tare(None).is_ok(), confirmed_by.is_some(), "no counts can show that nothing lies there");
    }
    bench.until_force(1.0, ForceState::Ok);
}
