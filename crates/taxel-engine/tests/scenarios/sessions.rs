//! Commands with wrong names, and sessions after a restart; what is refused in which state is in `tests/sessions`.

use crate::prelude::*;

/// A session that ramps.
pub fn ramping(kpa: f64) -> (Bench, u64) {
    let mut bench = fresh();
    let number = bench.start_session(None);
    bench.ramp(74.0, 4.0);
    bench.until_pressure(kpa);
    (bench, number)
}

pub fn in_review(kpa: f64) -> (Bench, u64) {
    let (mut bench, session) = ramping(kpa);
    bench.finish(session);
    bench.vent(5.0);
    (bench, session)
}

#[test]
fn a_session_says_when_it_began_and_who_confirms_its_rest() {
    let mut bench = fresh();
    let began = EPOCH_NS + bench.now().as_nanos();
    let (patch, leave_out, confirmed_by) = (String::new(), Vec::new(), Some("Ada".to_owned()));
    let start = Command::StartSession { patch, target: None, branches: None, confirmed_by, leave_out };
    let view = session_of(bench.ask(start));
    assert_eq!((view.started_wall_ns, view.confirmed_by.as_deref()), (began, Some("Ada")));
}

#[test]
fn an_activation_may_name_the_set_that_is_active_before_it() {
    let mut bench = fresh();
    let (first, second) = (small().set.id.as_str(), "m-other");
    bench.import(Arc::clone(&small().set));
    bench.import(say::other(second));
    let mut activate = |model_set: &str, expected: &str| {
        let (model_set, expected) = (model_set.to_owned(), Some(expected.to_owned()));
        match bench.ask(Command::Activate { patch: String::new(), model_set, expected }) {
            Ok(Done::Activated { previous, .. }) => Ok(previous),
            Ok(other) => panic!("{other:?}"),
            Err(refused) => Err(refused.to_string()),
        }
    };
    assert_eq!(activate(first, second), Err("expected `m-other` to be active, but it is none".to_owned()));
    assert_eq!(activate(first, ""), Ok(None));
    assert!(activate(second, "").is_err() && activate(second, second).is_err());
    assert_eq!(activate(second, first), Ok(Some(first.to_owned())));
}

/// Whether the file of a set says of which session it is, or of another, or when it was made: what is known of it stays.
#[test]
fn what_is_known_of_a_set_is_not_changed_by_its_file() {
    let (mut bench, session) = in_review(30.0);
    let listed = |bench: &Bench| {
        bench.host.catalogue.model_sets.iter().map(|set| (set.session, set.created_wall_ns)).collect::<Vec<_>>()
    };
    let before = listed(&bench);
    assert_eq!(before[0].0, Some(session));
    let stored = bench.host.set(0);
    for (session, created_wall_ns) in [(None, before[0].1), (Some(7), 1)] {
        bench.import(Arc::new(ModelSet { session, created_wall_ns, ..ModelSet::clone(&stored) }));
        assert_eq!(listed(&bench), before);
    }
}

/// All but the labels of a run.
pub fn content(set: &ModelSet) -> String {
    format!("{:?} {:?} {:?} {:?}", set.taxels, set.baseline, set.pressure_max_kpa, set.method)
}

#[test]
fn a_session_whose_samples_are_damaged_or_of_another_layout_cannot_go_on_and_is_aborted_without_them() {
    let (bench, session) = ramping(30.0);
    let mut disk = bench.host.disk.clone();
    let mut narrow = disk.samples.remove(&session).unwrap();
    let mut resumed = Bench::after(bench.world.clone(), bench.host.plan.clone(), disk);
    let why = resumed.refused(Command::FinishRamp { session });
    assert_eq!(why, "session 1 cannot go on, its samples are damaged on disk: they are not there; start a new one");
    narrow.samples.iter_mut().for_each(|sample| sample.counts = sample.counts.counts().slice(0..70).into());
    resumed.host.disk.samples.insert(session, narrow);
    let why = resumed.refused(Command::FinishRamp { session });
    assert!(why.contains("session 1 is of another layout of patch `small`"), "{why}");
    assert!(resumed.host.sessions.is_empty(), "the patch holds no session");
    resumed.host.disk.samples.clear();
    let view = session_of(resumed.ask(Command::AbortSession { session, reason: None }));
    assert_eq!((view.state, view.reason.as_str()), (SessionState::Aborted, "an operator aborted it"));
    assert_eq!(resumed.host.catalogue.sessions[0].state, SessionState::Aborted);
}

/// Time passes while samples are read from disk, and everything may change in it.
#[test]
fn what_changed_while_samples_were_read_counts() {
    let (bench, session) = ramping(30.0);
    let mut resumed = bench.restarted(bench.host.plan.clone(), |_| ());
    resumed.host.disk_is_slow = true;
    let [first, second] = [(); 2].map(|()| resumed.host.command(Command::StartRamp { session }));
    resumed.seconds(0.5);
    assert!(!resumed.host.replied(first) && resumed.host.sessions.is_empty(), "nothing happens before they are there");
    resumed.host.load();
    assert_eq!(session_of(resumed.host.reply(first).unwrap()).state, SessionState::Taring);
    let refused = |reply, expected: &str| {
        let Some(Err(Rejection::FailedPrecondition(_, why))) = reply else { panic!("not refused") };
        assert!(why.contains(expected), "{why}");
    };
    refused(resumed.host.reply(second), "session 1 is TARING");
    let reason = Some("the gauge is silent".to_owned());
    assert_eq!(session_of(resumed.ask(Command::AbortSession { session, reason })).reason, "the gauge is silent");
    let other = session_of(resumed.ask(say::start())).number;
    session_of(resumed.ask(Command::AbortSession { session: other, reason: None }));
    let late = resumed.host.command(Command::StartRamp { session });
    session_of(resumed.ask(say::start()));
    resumed.host.load();
    refused(resumed.host.reply(late), "session 3 is TARING; finish or abort it first");
}

#[test]
fn without_a_tare_at_start_a_restart_waits_for_one() {
    let mut patch = patch_plan(&small().skin);
    patch.tare.at_start = false;
    let mut bench = Bench::new(small().world.clone(), plan(patch), small().restored());
    bench.seconds(5.0);
    assert_eq!(bench.host.state(), ForceState::TareInvalid, "{}", bench.host.reasons());
    bench.tare(None).unwrap();
    bench.until_force(1.0, ForceState::Ok);
}

#[test]
fn a_fit_that_panics_ends_its_session_and_keeps_the_samples() {
    let (mut bench, session) = ramping(30.0);
    bench.host.fits_panic = true;
    bench.ask(Command::FinishRamp { session }).unwrap();
    bench.until_state(1.0, SessionState::Failed);
    let failed = bench.host.session().clone();
    assert!(failed.reason.contains("internal error"), "{}", failed.reason);
    bench.host.fits_panic = false;
    bench.finish(session);
    assert_eq!(bench.host.session().accepted, failed.accepted);
}

#[test]
fn a_module_that_is_silent_all_the_time_can_be_left_out() {
    let mut bench = fresh();
    bench.inject(Fault::ModuleSilent(board(13), module(3)));
    bench.seconds(0.5);
    let all = [(13, 0..6), (12, 0..2)].map(|(board, modules)| modules.map(move |module| (board, module)));
    let all: Vec<(u8, u8)> = all.into_iter().flatten().collect();
    for (names, what) in [
        ([(13, 6)].as_slice(), "has no module 6 on board 13"),
        (&[(11, 0)], "has no module 0 on board 11"),
        (&all, "every module is left out"),
    ] {
        let why = bench.ask(say::start_on("", None, names)).unwrap_err().to_string();
        assert!(why.starts_with("leave_out: ") && why.contains(what), "{why}");
    }
    let session = session_of(bench.ask(say::start_on("", None, &[(13, 3), (13, 3)]))).number;
    bench.until_state(10.0, SessionState::Ramping);
    assert_eq!(bench.host.session().left_out, [3]);
    bench.ramp(42.0, 4.0);
    bench.seconds(2.0);
    let stale = |bench: &Bench| bench.host.session().refused.get(SampleRefusal::StaleModule);
    assert_eq!(stale(&bench), 0, "what is left out is missed by no sample");
    let silent = bench.now()..bench.now() + Duration::from_millis(100);
    bench.passes = Box::new(move |frame| frame.frame.id != CanId::Standard(0x4D2) || !silent.contains(&frame.time));
    bench.seconds(0.3);
    assert_eq!(stale(&bench), 2, "two missed scans");
    bench.seconds(8.7);
    let id = bench.finish(session);
    let set = bench.host.set(0);
    assert!(set.taxels[30..40].iter().all(|model| !model.is_usable()), "nothing is made of what was not heard");
    assert!(set.taxels.iter().filter(|model| model.is_usable()).count() >= 60);
    bench.vent(20.0);
    bench.activate(&id).unwrap();
    bench.tare(None).unwrap();
    let mark = bench.mark();
    bench.lay(0.5, 14);
    bench.seconds(2.0);
    assert_eq!(bench.host.state(), ForceState::Degraded, "{}", bench.host.reasons());
    assert!(bench.host.snapshot().force.unbounded);
    bench.is_truthful_since(mark, "a module was left out");
}
