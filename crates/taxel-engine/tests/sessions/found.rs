//! What random walks have found, one short walk each.

use taxel_engine::calibration::SessionState;
use taxel_engine::record::Record;

use crate::check::{Seen, check};
use crate::daemon::Daemon;
use crate::disk::EPOCH_NS;
use crate::model::Passing::{Hold, Rise, Vent};
use crate::model::Step::{self, *};
use crate::model::{Model, Set};

/// Walks these steps, and checks everything after each.
fn walk(steps: &[Step]) {
    let (mut daemon, mut seen, mut model) = (Daemon::new(), Seen::default(), Model::new());
    for step in steps {
        assert!(model.knows(*step), "the table does not know what comes of {step:?}");
        model.apply(*step);
        seen.before(&daemon, *step);
        daemon.apply(*step);
        check(&daemon, &mut seen, &model, *step);
    }
}

/// A session and its fit, which waits for review.
const REVIEW: [Step; 5] = [StartSession, Pass(Hold), Pass(Rise), FinishRamp(1), FitEnds { fit: 0, well: true }];

fn from_review(steps: &[Step]) {
    walk(&[&REVIEW, steps].concat());
}

/// The skin is still under a bag that stands at a pressure, and not at rest.
#[test]
fn no_ramp_begins_while_the_bag_presses() {
    walk(&[StartSession, Pass(Rise), Pass(Hold)]);
}

/// While boards are configured they take their zeros anew, and what is seen of them is of two zeros.
#[test]
fn the_zero_of_a_ramp_is_watched_when_the_boards_are_configured() {
    let mut daemon = Daemon::new();
    daemon.apply(StartSession);
    daemon.apply(Pass(Hold));
    let tared = daemon.store.on_disk().iter().find_map(|record| match record {
        Record::Session(view) if view.state == SessionState::Ramping => Some(view.changed_wall_ns - EPOCH_NS),
        _ => None,
    });
    // The boards are configured for half a second, and then the skin is watched for a second.
    assert!(tared.is_some_and(|ns| ns >= 1_500_000_000), "{tared:?}");
}

/// The fit of fewer samples, asked for before an abort, comes back while a second one is awaited.
#[test]
fn a_fit_from_before_an_abort_does_not_end_the_next_one() {
    let again = [Abort(1), Pass(Vent), StartRamp(1), Pass(Hold), Pass(Rise), FinishRamp(1)];
    let begin = [&REVIEW[..4], &again].concat();
    for well in [true, false] {
        walk(&[&begin[..], &[FitEnds { fit: 0, well }, FitEnds { fit: 1, well: true }]].concat());
    }
    let written_late = [&REVIEW[..4], &[DiskSlow, FitEnds { fit: 0, well: true }], &again, &[DiskWrites]];
    walk(&written_late.concat());
}

#[test]
fn a_tare_that_is_lost_while_it_is_written_is_answered_once() {
    let tare = [Pass(Hold), DiskSlow, Tare { confirmed: true }, Pass(Hold)];
    for loss in [BusOff, BringUp] {
        walk(&[&tare[..], &[loss, DiskWrites]].concat());
        walk(&[&tare[..], &[loss, DiskFails]].concat());
    }
}

/// An older zero must not take the place of that of the ramp.
#[test]
fn a_tare_that_was_being_written_when_a_ramp_took_its_zero_is_refused() {
    walk(&[Pass(Hold), DiskSlow, Tare { confirmed: true }, Pass(Hold), StartSession, Pass(Hold), DiskWrites]);
}

/// It was judged by the models of before.
#[test]
fn a_tare_beside_which_other_models_come_into_use_is_refused() {
    from_review(&[DiskSlow, Activate(Set::Fit(0)), Tare { confirmed: true }, Pass(Hold), DiskWrites]);
}

#[test]
fn a_session_whose_models_are_being_activated_cannot_be_laid_aside() {
    from_review(&[DiskSlow, Activate(Set::Fit(0)), Discard(1), DiskWrites]);
}

/// The activation reached the disk, what the sessions say of it did not.
#[test]
fn after_a_crash_within_an_activation_the_active_session_is_that_of_the_active_set() {
    from_review(&[DiskSlow, Activate(Set::Fit(0)), DiskWrites, Restart]);
    let (other, first) = (Set::Foreign(0), Activate(Set::Fit(0)));
    let away = [Import(other), first, DiskSlow, Activate(other), DiskWrites, Restart, Discard(1), Restart];
    from_review(&away);
}

#[test]
fn nothing_is_laid_aside_or_aborted_that_cannot_be_written_down() {
    from_review(&[Pass(Vent), StartSession, DiskFails, Discard(1)]);
    from_review(&[DiskSlow, Discard(1), StartRamp(1), Discard(1), DiskFails]);
    walk(&[StartSession, Pass(Hold), Restart, DiskFails, Abort(1)]);
}

#[test]
fn an_abort_of_an_older_session_takes_no_samples_from_the_newest() {
    let interrupted = [StartSession, Pass(Hold), Restart];
    let second = [StartSession, Pass(Hold), Pass(Rise), FinishRamp(2), FitEnds { fit: 0, well: true }];
    walk(&[&interrupted[..], &second, &[Abort(1), Pass(Vent), StartRamp(2)]].concat());
}

/// Where no zero holds, the daemon takes one by itself, but not in the place of one that an operator waits for.
#[test]
fn a_tare_that_is_being_written_is_not_overtaken_by_the_zero_after_start() {
    let begin = [Restart, Import(Set::Foreign(0)), Pass(Vent), Activate(Set::Foreign(0))];
    walk(&[&begin[..], &[DiskSlow, Tare { confirmed: false }, Pass(Hold), DiskWrites]].concat());
}

/// Somebody confirmed a zero under the bag's pressure: a skin that reads less than that afterwards is vented, and no board
/// has taken a new zero.
#[test]
fn a_zero_that_somebody_confirmed_under_pressure_leaves_the_next_session_alone() {
    let first =
        [StartSession, Pass(Hold), Pass(Rise), Pass(Rise), Pass(Rise), Pass(Vent), FitEnds { fit: 0, well: true }];
    let second = [StartSession, Pass(Hold), Pass(Rise), FinishRamp(2), FitEnds { fit: 1, well: true }];
    let confirmed = [Tare { confirmed: true }, Pass(Hold), Pass(Rise), Pass(Vent)];
    walk(&[&first[..], &second, &confirmed, &[StartSession, Pass(Vent)]].concat());
}

/// Models of a session from before the boards lost their zero are none of the boards as they are.
#[test]
fn a_set_of_a_session_before_a_bus_off_proves_no_rest_after_it() {
    let first = [StartSession, Pass(Vent), FinishRamp(1), FitEnds { fit: 0, well: true }, Pass(Hold), BusOff];
    walk(
        &[&first[..], &[StartSession, Pass(Hold), Abort(2), Activate(Set::Fit(0)), StartSession, Pass(Hold)]].concat(),
    );
}
