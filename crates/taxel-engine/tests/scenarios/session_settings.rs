//! The samples of a session are of boards that are set in one way, however often the daemon starts meanwhile.

use taxel_wire::signal::SignalSpec;

use crate::board_settings::with_shift;
use crate::prelude::*;

const RAMP: Command = Command::StartRamp { session: 1 };

/// A session with shift 1, up to 30 kPa.
fn ramped() -> Bench {
    let mut bench = Bench::new(small_world(), with_shift(1), Restored::default());
    bench.brought_up();
    bench.start_session(None);
    bench.ramp(74.0, 4.0);
    bench.until_pressure(30.0);
    bench
}

fn is_refused(bench: &mut Bench, command: Command) {
    let why = refused_as(ErrorReason::LayoutChanged, bench.ask(command));
    assert_eq!(
        why,
        "session 1 cannot go on: it was gathered with shift 0-5 = 1 on board 13, where the configuration has shift 0-5 = 2 \
         (and 1 more): set it as it was, or start a new session"
    );
}

/// What the gauge reads at rest is of no account, since each ramp counts from it; all else is.
#[test]
fn a_session_takes_no_ramp_of_a_gauge_that_is_read_in_another_way() {
    let with_gauge = |change: fn(&mut SignalSpec)| {
        let mut plan = Plan::clone(&with_shift(1));
        change(&mut plan.patches[0].gauge.as_mut().unwrap().signal);
        Arc::new(plan)
    };
    let first = ramped();
    let mut bench = first.restarted(with_gauge(|signal| signal.scale *= 1.2), |_| ());
    let why = refused_as(ErrorReason::LayoutChanged, bench.ask(RAMP));
    let expected = "session 1 cannot go on: it was gathered by a gauge that was configured as `";
    assert!(why.starts_with(expected) && why.ends_with("now: set it as it was, or start a new session"), "{why}");
    assert_eq!(why.matches("kPa a step, differential`").count(), 2, "{why}");
    assert_eq!(bench.host.catalogue.sessions[0].state, SessionState::Interrupted, "what is refused has no effect");
    session_of(first.restarted(with_gauge(|signal| signal.offset += 0.1), |_| ()).ask(RAMP));
}

#[test]
fn a_session_takes_no_ramp_of_boards_that_are_set_in_another_way() {
    // Interrupted.
    let first = ramped();
    let mut bench = first.restarted(with_shift(2), |_| ());
    is_refused(&mut bench, RAMP);
    assert_eq!(bench.host.catalogue.sessions[0].state, SessionState::Interrupted, "what is refused has no effect");
    session_of(first.restarted(with_shift(1), |_| ()).ask(RAMP));
    // In review, and in use until the restart: its set is not used after it, so that it would go on.
    let mut first = first;
    let set = first.finish(1);
    is_refused(&mut first.restarted(with_shift(2), |_| ()), RAMP);
    first.vent(20.0);
    first.activate(&set).unwrap();
    let mut bench = first.restarted(with_shift(2), |_| ());
    is_refused(&mut bench, RAMP);
}

#[test]
fn a_session_in_use_takes_no_ramp_and_says_how_both_are_fitted_together() {
    let mut bench = ramped();
    let set = bench.finish(1);
    bench.vent(20.0);
    bench.activate(&set).unwrap();
    let why = bench.refused(RAMP);
    assert!(why.ends_with("Gather it in a new session, and fit both: taxeld sessions refit 1 NEW"), "{why}");
    assert_eq!(bench.host.catalogue.sessions[0].state, SessionState::Active, "what is refused has no effect");
}

/// The models are of the boards as they were, whatever the configuration says when they are computed.
#[test]
fn what_an_interrupted_session_gathered_is_fitted_with_the_settings_that_it_was_gathered_with() {
    let mut bench = ramped().restarted(with_shift(2), |_| ());
    bench.finish(1);
    let set = bench.host.newest_set();
    assert!(set.board_settings[0].contains("shift 0-5 = 1; cdc_offset 0-5 = 0x2200"), "{:?}", set.board_settings);
    let why = bench.refused(say::activate(&set.id));
    assert!(why.contains("shift 0-5 = 1 on board 13, where the configuration has shift 0-5 = 2"), "{why}");
    is_refused(&mut bench, RAMP);
    // With the boards as they were all of it goes on.
    let mut later = bench.restarted(with_shift(1), |_| ());
    session_of(later.ask(RAMP));
    session_of(later.ask(Command::AbortSession { session: 1, reason: None }));
    later.activate(&set.id).unwrap();
}
