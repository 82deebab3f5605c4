//! What has to hold after every step.

use std::collections::BTreeMap;

use taxel_engine::calibration::SessionState;
use taxel_engine::command::Done;
use taxel_engine::record::Record;

use crate::daemon::{Daemon, id_of};
use crate::model::{Answer, Facts, Model, Step};

/// What was seen before the step.
#[derive(Default)]
pub struct Seen {
    /// Samples that each session had accepted.
    accepted: BTreeMap<u64, u64>,
    /// Every number that a session was given while its start is on record.
    number: Option<u64>,
}

impl Seen {
    /// Takes note of what a step must not change.
    pub fn before(&mut self, daemon: &Daemon, step: Step) {
        if step == Step::Restart {
            survives(daemon);
        }
    }
}

/// The engine is where the table says, and has done nothing that it may not.
pub fn check(daemon: &Daemon, seen: &mut Seen, model: &Model, step: Step) {
    let reasons: Vec<&str> = daemon.catalogue.sessions.iter().map(|view| view.reason.as_str()).collect();
    assert_eq!(facts(daemon), named(&model.live), "what readers see; reasons {reasons:?}");
    one_open(daemon);
    answers(daemon, model, step);
    if step == Step::Restart {
        seen.accepted.clear();
        seen.number = daemon.catalogue.sessions.iter().map(|view| view.number).max();
    }
    if let (Step::StartSession, Some(Answer::Done)) = (step, model.answer) {
        let number = daemon.catalogue.sessions.iter().map(|view| view.number).max();
        assert!(number > seen.number, "number {number:?} after {:?}", seen.number);
        seen.number = number;
    }
    samples(daemon, seen, model);
}

/// What readers see, with the sets by their ids.
type Named = (BTreeMap<u64, (SessionState, Option<String>)>, Vec<String>, Option<String>);

fn facts(daemon: &Daemon) -> Named {
    let catalogue = &daemon.catalogue;
    let view =
        |view: &taxel_engine::calibration::SessionView| (view.state, view.model_set.as_deref().map(str::to_owned));
    let sessions = catalogue.sessions.iter().map(|v| (v.number, view(v))).collect();
    let mut sets: Vec<String> = catalogue.model_sets.iter().map(|set| set.id.clone()).collect();
    sets.sort();
    (sessions, sets, catalogue.active.first().and_then(|(_, set)| set.clone()))
}

fn named(facts: &Facts) -> Named {
    let sessions = facts
        .sessions
        .iter()
        .filter_map(|(number, (_, set))| Some((*number, (facts.seen(*number)?, set.map(id_of)))))
        .collect();
    let mut sets: Vec<String> = facts.known.iter().copied().map(id_of).collect();
    sets.sort();
    (sessions, sets, facts.active.map(id_of))
}

fn one_open(daemon: &Daemon) {
    let open = daemon.catalogue.sessions.iter().filter(|view| view.state.is_open()).count();
    assert!(open <= 1, "{open} sessions are open");
    for view in daemon.catalogue.sessions.iter().filter(|view| view.state == SessionState::Active) {
        assert_eq!(view.model_set.as_deref(), daemon.catalogue.active[0].1.as_deref(), "an ACTIVE session's set");
    }
    if let Some(view) = &daemon.session {
        let listed = daemon.catalogue.sessions.iter().find(|listed| listed.number == view.number);
        assert_eq!(listed.map(|listed| listed.state), Some(view.state), "the list and the session itself");
    }
}

/// Every request is answered once, the present one as the table says, and a refusal is all that comes of it.
fn answers(daemon: &Daemon, model: &Model, step: Step) {
    for request in daemon.requests.1 + 1..=daemon.requests.0 {
        let answers = daemon.answers.get(&request).map_or(0, Vec::len);
        let expected = usize::from(!model.waiting.contains(&request));
        assert_eq!(answers, expected, "answers to request {request}: {:?}", daemon.answers.get(&request));
    }
    for (request, done) in &model.settled {
        let reply = &daemon.answers[request][0].reply;
        assert_eq!(reply.is_ok(), *done, "request {request}: {reply:?}");
    }
    let Some(answer) = model.answer else { return };
    let reply = daemon.answers.get(&model.requests).map(|answers| &answers[0].reply);
    match answer {
        Answer::Done => assert!(reply.is_some_and(Result::is_ok), "{step:?}: {reply:?}"),
        Answer::Refused => {
            assert!(reply.is_some_and(Result::is_err), "{step:?}: {reply:?}");
            assert!(daemon.changes.is_empty(), "{step:?} was refused and changed {:?}", daemon.changes);
            assert_eq!(daemon.replies, 1);
        }
        Answer::Later => {
            let waits = model.waiting.contains(&model.requests);
            assert_eq!(reply.is_none(), waits, "{step:?}: {reply:?}");
        }
    }
}

/// Accepted samples never become fewer, are more after a rise of a ramp, and none is on disk that was not accepted.
fn samples(daemon: &Daemon, seen: &mut Seen, model: &Model) {
    for view in &daemon.catalogue.sessions {
        let newest = daemon.session.as_ref().filter(|session| session.number == view.number).unwrap_or(view);
        assert!(newest.durable <= newest.accepted, "{newest:?}");
        let before = seen.accepted.insert(view.number, newest.accepted).unwrap_or(0);
        assert!(newest.accepted >= before, "session {} had {before} samples: {newest:?}", view.number);
        if model.grew && (view.state.is_open()) && view.state != SessionState::Taring {
            assert!(newest.accepted >= before + 10, "session {} had {before} samples: {newest:?}", view.number);
        }
    }
}

/// What was acknowledged is among what a restart finds.
fn survives(daemon: &Daemon) {
    let on_disk = daemon.store.on_disk();
    for done in daemon.acknowledged() {
        let kept = on_disk.iter().any(|record| match (done, record) {
            (Done::Session(view), Record::Session(kept)) => (view.number, view.state) == (kept.number, kept.state),
            (Done::Kept { model_set, .. }, Record::ModelSet(set)) => model_set.id == set.id,
            (Done::Activated { model_set, .. }, Record::Activated { model_set: kept, .. }) => model_set == kept,
            (Done::Tared(view), Record::Zero { zero, .. }) => {
                zero.zero.as_ref().is_some_and(|zero| zero.wall_ns == view.wall_ns)
            }
            _ => false,
        });
        assert!(kept || matches!(done, Done::BringUpStarted), "{done:?} is not on disk");
    }
}
