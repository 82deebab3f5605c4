//! A zero that is lost stays lost, and takes every watch with it that saw what was before.

use std::time::Duration;

use taxel_engine::BusNotice;
use taxel_engine::calibration::SessionState;
use taxel_engine::command::{Command, Rejection, Reply};
use taxel_engine::snapshot::ForceState;
use taxel_sim::Fault;

use crate::bench::Bench;
use crate::rig::{board, module, patch_plan, plan, small_world};
use crate::shared::small;

fn tare() -> Command {
    Command::Tare { patch: String::new(), confirmed_by: None }
}

/// Boards brought up by the daemon, the model set in use, a force.
fn in_charge() -> Bench {
    let mut bench = Bench::new(small().world.clone(), plan(patch_plan(&small().skin)), small().restored());
    bench.brought_up();
    bench.until_force(5.0, ForceState::Ok);
    bench
}

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
        bench.seconds(3.0); // Ada is believed until the counts say otherwise
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

/// A tare is refused because of what happened while the skin was watched for it.
fn is_refused(reply: Option<Reply>, what: &str) {
    let Some(Err(Rejection::FailedPrecondition(_, why))) = reply else { panic!("{what}: {reply:?}") };
    assert!(why.contains("meanwhile"), "{what}: {why}");
}

fn stays_without_force(bench: &mut Bench, mark: usize, what: &str) {
    bench.seconds(4.0);
    assert!(!bench.has_force_since(mark), "{what}");
    assert_eq!(bench.host.state(), ForceState::TareInvalid, "{what}");
    bench.tare(None).unwrap();
    bench.until_force(1.0, ForceState::Ok);
}

#[test]
fn a_bring_up_ends_the_watch_of_a_tare() {
    let mut bench = in_charge();
    let request = bench.host.command(tare());
    bench.seconds(0.9);
    bench.ask(Command::BringUp { patch: String::new(), confirmed_by: None }).unwrap();
    is_refused(bench.host.reply(request), "bring-up");
    let mark = bench.mark();
    stays_without_force(&mut bench, mark, "bring-up");
}

#[test]
fn a_bus_off_ends_the_watch_of_a_tare() {
    let mut bench = in_charge();
    let request = bench.host.command(tare());
    bench.seconds(0.9);
    bench.host.notice(BusNotice::BusOff);
    bench.host.notice(BusNotice::Up);
    is_refused(bench.host.reply(request), "bus-off");
    bench.seconds(0.1);
    let mark = bench.mark();
    stays_without_force(&mut bench, mark, "bus-off");
}

#[test]
fn a_power_cycle_ends_the_watch_of_a_tare() {
    let mut bench = in_charge();
    bench.inject(Fault::PowerCycle { board: board(12), off: Duration::from_millis(1_200) });
    bench.seconds(0.3);
    let request = bench.host.command(tare());
    bench.seconds(0.9);
    let now = bench.now();
    bench.world.bring_up_boards(now); // as another host on the bus would
    bench.seconds(0.2);
    is_refused(bench.host.reply(request), "power cycle");
    let mark = bench.mark();
    stays_without_force(&mut bench, mark, "power cycle");
}

#[test]
fn lost_acknowledgements_end_the_watch_of_a_tare() {
    let mut bench = in_charge();
    let request = bench.host.command(tare());
    bench.seconds(0.7);
    bench.inject(Fault::ModuleNoAck(board(13), module(1)));
    bench.seconds(0.3);
    bench.repair(Fault::ModuleNoAck(board(13), module(1)));
    is_refused(bench.host.reply(request), "lost acknowledgements");
    let mark = bench.mark();
    stays_without_force(&mut bench, mark, "lost acknowledgements");
}

#[test]
fn a_zero_that_is_lost_while_it_is_written_down_is_not_taken() {
    let mut bench = in_charge();
    bench.host.disk_is_slow = true;
    let request = bench.host.command(tare());
    bench.seconds(1.3);
    assert!(!bench.host.commits.is_empty() && !bench.host.replied(request));
    bench.host.notice(BusNotice::BusOff);
    bench.host.notice(BusNotice::Up);
    bench.host.disk_is_slow = false;
    bench.host.commit(Ok(()));
    let Some(Err(Rejection::FailedPrecondition(_, why))) = bench.host.reply(request) else { panic!("taken") };
    assert!(why.starts_with("the zero was lost while it was written down: ") && why.contains("bus-off"), "{why}");
    bench.seconds(0.1);
    let mark = bench.mark();
    stays_without_force(&mut bench, mark, "bus-off while it was written down");
}

#[test]
fn a_tare_while_boards_are_configured_is_refused() {
    let mut bench = in_charge();
    bench.ask(Command::BringUp { patch: String::new(), confirmed_by: None }).unwrap();
    for _ in 0..5 {
        let Err(Rejection::FailedPrecondition(_, why)) = bench.tare(Some("Ada")) else { panic!("taken") };
        assert!(why.contains("being configured"), "{why}");
        bench.seconds(0.1);
    }
    bench.until(3.0, "configuring", |host| host.health().boards.iter().all(|b| b.bring_up == "configuring"));
    bench.brought_up();
    bench.tare(None).unwrap();
}

/// What happens to a zero, by name.
type Event<'a> = (&'a str, &'a dyn Fn(&mut Bench));

/// Something happens 0.9 s into the watch of a session: its ramp begins after a second of rest that came later.
#[test]
fn a_session_watches_a_whole_second_after_its_zero_was_lost() {
    let bus_off = |bench: &mut Bench| {
        bench.host.notice(BusNotice::BusOff);
        bench.host.notice(BusNotice::Up);
    };
    let no_acks = |bench: &mut Bench| {
        bench.inject(Fault::ModuleNoAck(board(13), module(1)));
        bench.seconds(0.3);
        bench.repair(Fault::ModuleNoAck(board(13), module(1)));
    };
    let power_cycle = |bench: &mut Bench| {
        bench.inject(Fault::PowerCycle { board: board(12), off: Duration::from_millis(1_200) });
        bench.seconds(1.3);
        let now = bench.now();
        bench.world.bring_up_boards(now);
        bench.seconds(0.1);
    };
    let events: [Event<'_>; 3] =
        [("bus-off", &bus_off), ("lost acknowledgements", &no_acks), ("power cycle", &power_cycle)];
    for (name, happens) in events {
        for models in [true, false] {
            let mut bench = if models {
                in_charge()
            } else {
                let mut bench =
                    Bench::new(small_world(), plan(patch_plan(&small().skin)), taxel_engine::Restored::default());
                bench.brought_up();
                bench
            };
            bench.ask(session()).unwrap();
            bench.seconds(0.9 - if name == "lost acknowledgements" { 0.2 } else { 0.0 });
            happens(&mut bench);
            let over = bench.now();
            assert_eq!(bench.host.session().state, SessionState::Taring, "{name}: {:?}", bench.host.session());
            bench.until_state(10.0, SessionState::Ramping);
            let watched = bench.now().since(over);
            assert!(watched >= Duration::from_millis(940), "{name}: the ramp began {watched:?} later");
        }
    }
}

fn session() -> Command {
    Command::StartSession {
        patch: String::new(),
        target: None,
        branches: None,
        confirmed_by: None,
        leave_out: Vec::new(),
    }
}

/// There is no zero, a load lies on the skin, and a board that takes a new zero under it reads as at rest from then on: a
/// tare has nothing to see the load by, but the load was seen before.
#[test]
fn a_board_that_takes_a_zero_under_a_load_while_there_is_none_is_not_tared() {
    let mut bench = in_charge();
    bench.lay(0.8, 33);
    bench.seconds(3.0);
    bench.host.notice(BusNotice::BusOff);
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
    let bring_up = |bench: &mut Bench, confirmed_by: Option<&str>| {
        let confirmed_by = confirmed_by.map(str::to_owned);
        bench.ask(Command::BringUp { patch: String::new(), confirmed_by }).unwrap();
    };
    for confirmed_by in [None, Some("Ada")] {
        bring_up(&mut bench, confirmed_by);
        bench.until(3.0, "configuring", |host| host.health().boards.iter().all(|b| b.bring_up == "configuring"));
        bench.brought_up();
        assert_eq!(bench.tare(None).is_ok(), confirmed_by.is_some(), "no counts can show that nothing lies there");
    }
    bench.until_force(1.0, ForceState::Ok);
}
