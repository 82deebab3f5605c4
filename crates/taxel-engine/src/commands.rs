//! What each command does, and why it is refused where it is.

use std::sync::Arc;
use taxel_skin::Kilopascal;

use crate::command::{Command, Done, Rejection, Reply, RequestId};
use crate::engine::Engine;
use crate::io::{Now, Output};
use crate::model_set::ModelSet;
use crate::record::Record;
use crate::recording::Branch;
use crate::session::{SessionState, SessionView};

/// Targets beyond this are not a vacuum bag's, nor a pressure chamber's for skin.
const TARGET_MAX_KPA: f64 = 1_000.0;

impl Engine {
    pub(crate) fn on_command(&mut self, now: Now, request: RequestId, command: Command, out: &mut Vec<Output>) {
        let reply = match command {
            Command::Tare { patch, confirmed_by } => match self.patch_named(&patch) {
                Ok(index) => return self.patches[index].start_tare(now, request, confirmed_by, out),
                Err(rejection) => Err(rejection),
            },
            Command::RecordLoad { patch, load } => match self.start_load(now, request, &patch, load) {
                Ok(()) => return,
                Err(rejection) => Err(rejection),
            },
            Command::BringUp { patch } => self.bring_up(now, &patch),
            Command::StartSession { patch, target, branches, confirmed_by } => {
                self.start_session(now, &patch, target, branches, confirmed_by, out)
            }
            Command::StartRamp { session } => self.start_ramp(now, session, out),
            Command::FinishRamp { session } => self.finish_ramp(now, session, out),
            Command::AbortSession { session } => self.abort(now, session, out),
            Command::DiscardSession { session } => self.discard(now, session, out),
            Command::Activate { patch, model_set, expected } => self.activate(now, &patch, &model_set, expected, out),
            Command::Import { model_set } => self.import(model_set, out),
        };
        out.push(Output::Reply(request, reply));
    }

    /// The patch of this name; an empty name stands for the only one.
    pub(crate) fn patch_named(&self, name: &str) -> Result<usize, Rejection> {
        if name.is_empty() && self.patches.len() == 1 {
            return Ok(0);
        }
        let names = || self.patches.iter().map(|p| p.plan.patch.name()).collect::<Vec<_>>().join(", ");
        if name.is_empty() {
            let problem = format!("must name one of the patches: {}", names());
            return Err(Rejection::InvalidArgument { field: "patch", problem });
        }
        let found = self.patches.iter().position(|p| p.plan.patch.name() == name);
        found.ok_or_else(|| Rejection::NotFound(format!("patch `{name}`; this daemon has {}", names())))
    }

    fn bring_up(&mut self, now: Now, patch: &str) -> Reply {
        let patch = self.patch_named(patch)?;
        let patch = &mut self.patches[patch];
        if patch.plan.bring_up.is_empty() {
            let why = "the daemon only listens (listen_only): it sends nothing to the boards".to_owned();
            return Err(Rejection::FailedPrecondition(why));
        }
        if let Some(session) = patch.session.as_ref().filter(|s| s.view().state.is_open()) {
            let (number, state) = (session.view().number, session.view().state.name());
            return Err(Rejection::FailedPrecondition(format!("session {number} is {state}; abort it first")));
        }
        patch.check_vented(now)?; // a board that takes its zero under vacuum takes the load for rest
        patch.bring_up_again(now);
        Ok(Done::BringUpStarted)
    }

    fn start_session(
        &mut self,
        now: Now,
        patch: &str,
        target: Option<Kilopascal>,
        branches: Option<Branch>,
        confirmed_by: Option<String>,
        out: &mut Vec<Output>,
    ) -> Reply {
        let index = self.patch_named(patch)?;
        self.store_takes_records()?;
        let number = self.next_session;
        let patch = &mut self.patches[index];
        if patch.plan.gauge.is_none() {
            let why = "this patch has no pressure sensor in the configuration: it cannot be calibrated".to_owned();
            return Err(Rejection::FailedPrecondition(why));
        }
        let target = target.unwrap_or(patch.plan.session.target).0;
        if !(target > 0.0 && target <= TARGET_MAX_KPA) {
            let problem = format!("{target} is not in (0, {TARGET_MAX_KPA}]");
            return Err(Rejection::InvalidArgument { field: "target_kpa", problem });
        }
        if let Some(open) = patch.session.as_ref().filter(|s| s.view().state.is_open()) {
            let (other, state) = (open.view().number, open.view().state.name());
            let why = format!("session {other} is {state}; finish or abort it first");
            return Err(Rejection::FailedPrecondition(why));
        }
        patch.check_vented(now)?;
        let view = SessionView {
            number,
            patch: patch.plan.patch.name().to_owned(),
            started_wall_ns: now.wall_ns,
            confirmed_by,
            target_kpa: target,
            branches: branches.unwrap_or(patch.plan.session.branches),
            ..SessionView::default()
        };
        patch.start_session(now, view, out);
        self.next_session += 1;
        self.session_reply(index)
    }

    fn start_ramp(&mut self, now: Now, number: u64, out: &mut Vec<Output>) -> Reply {
        self.store_takes_records()?;
        let index = self.hold_session(now, number, "a ramp can begin", |s| {
            matches!(s, SessionState::Review | SessionState::Interrupted | SessionState::Failed | SessionState::Aborted)
        })?;
        self.patches[index].start_ramp(now, out)?;
        self.session_reply(index)
    }

    fn finish_ramp(&mut self, now: Now, number: u64, out: &mut Vec<Output>) -> Reply {
        self.store_takes_records()?;
        let index = self.hold_session(now, number, "a ramp can be finished", |s| {
            matches!(s, SessionState::Ramping | SessionState::Interrupted | SessionState::Failed)
        })?;
        self.patches[index].finish_ramp(now, out);
        self.session_reply(index)
    }

    fn abort(&mut self, now: Now, number: u64, out: &mut Vec<Output>) -> Reply {
        let allowed = |s: SessionState| s.is_open() || s == SessionState::Interrupted;
        let index = self.hold_session(now, number, "a session can be aborted", allowed)?;
        self.patches[index].enter(now, SessionState::Aborted, "an operator aborted it", out);
        self.session_reply(index)
    }

    fn discard(&mut self, now: Now, number: u64, out: &mut Vec<Output>) -> Reply {
        if self.held(number).is_none() {
            return self.discard_stored(now, number, out);
        }
        let allowed = |s: SessionState| !s.is_open() && s != SessionState::Active;
        let index = self.hold_session(now, number, "a session can be discarded", allowed)?;
        self.patches[index].enter(now, SessionState::Discarded, "an operator laid it aside", out);
        self.session_reply(index)
    }

    /// A session of an earlier run that no patch holds any more.
    fn discard_stored(&mut self, now: Now, number: u64, out: &mut Vec<Output>) -> Reply {
        let view = self.sessions.get(&number).ok_or_else(|| Rejection::NotFound(format!("session {number}")))?;
        if view.state == SessionState::Active {
            let why = format!("session {number} is ACTIVE; a session can be discarded unless its models are in use");
            return Err(Rejection::FailedPrecondition(why));
        }
        let mut view = SessionView::clone(view);
        view.state = SessionState::Discarded;
        view.reason = "an operator laid it aside".to_owned();
        view.changed_wall_ns = now.wall_ns;
        self.resumable.remove(&number);
        let view = Arc::new(view);
        out.push(Output::Record(Record::Session(Arc::clone(&view))));
        Ok(Done::Session(view))
    }

    fn activate(&mut self, now: Now, patch: &str, id: &str, expected: Option<String>, out: &mut Vec<Output>) -> Reply {
        let index = self.patch_named(patch)?;
        self.store_takes_records()?;
        let set = self.model_sets.iter().find(|set| set.id == id).cloned();
        let set = set.ok_or_else(|| Rejection::NotFound(format!("model set `{id}`")))?;
        let patch = &mut self.patches[index];
        let name = patch.plan.patch.name().to_owned();
        if set.patch != name {
            let problem = format!("`{id}` is for patch `{}`, not for `{name}`", set.patch);
            return Err(Rejection::InvalidArgument { field: "model_set", problem });
        }
        let (given, taxels) = (set.taxels.len(), patch.plan.patch.taxels().len());
        if given != taxels {
            let why = format!("`{id}` has {given} taxels, patch `{name}` has {taxels}: its layout has changed");
            return Err(Rejection::FailedPrecondition(why));
        }
        let previous = patch.model_set.as_ref().map(|set| set.id.clone());
        if let Some(expected) = expected.filter(|e| previous.as_deref().unwrap_or("") != e) {
            let is = previous.as_deref().unwrap_or("none");
            let why = format!("expected `{expected}` to be active, but it is {is}");
            return Err(Rejection::FailedPrecondition(why));
        }
        let state = set.session.and_then(|n| self.sessions.get(&n)).map(|s| s.state);
        if state == Some(SessionState::Discarded) {
            let why = format!("the session of `{id}` is DISCARDED: its models are not to be used");
            return Err(Rejection::FailedPrecondition(why));
        }
        patch.set_model_set(Arc::clone(&set));
        out.push(Output::Record(Record::Activated { patch: name, model_set: set.id.clone(), wall_ns: now.wall_ns }));
        let before = self.model_sets.iter().find(|set| Some(&set.id) == previous.as_ref()).and_then(|set| set.session);
        if let Some(number) = before.filter(|&number| Some(number) != set.session) {
            self.change_use(now, number, SessionState::Review, "another model set is in use", out);
        }
        if let Some(number) = set.session {
            self.change_use(now, number, SessionState::Active, "", out);
        }
        self.catalogue_dirty = true;
        Ok(Done::Activated { model_set: set.id.clone(), previous })
    }

    /// A session's models came into use or went out of it.
    fn change_use(&mut self, now: Now, number: u64, state: SessionState, reason: &str, out: &mut Vec<Output>) {
        if let Some(index) = self.held(number) {
            return self.patches[index].enter(now, state, reason, out);
        }
        if let Some(view) = self.sessions.get(&number).filter(|view| view.state != state) {
            let mut view = SessionView::clone(view);
            (view.state, view.reason, view.changed_wall_ns) = (state, reason.to_owned(), now.wall_ns);
            out.push(Output::Record(Record::Session(Arc::new(view))));
        }
    }

    fn import(&mut self, set: Arc<ModelSet>, out: &mut Vec<Output>) -> Reply {
        self.store_takes_records()?;
        let index = self.patch_named(&set.patch)?;
        let (taxels, given) = (self.plan.patches[index].patch.taxels().len(), set.taxels.len());
        if taxels != given {
            let problem = format!("the set has {given} taxels, patch `{}` has {taxels}", set.patch);
            return Err(Rejection::InvalidArgument { field: "json", problem });
        }
        let id = set.id.clone();
        if self.model_sets.iter().all(|known| known.id != id) {
            out.push(Output::Record(Record::ModelSet(Arc::clone(&set))));
            self.model_sets.push(set);
            self.catalogue_dirty = true;
        }
        Ok(Done::Imported { model_set: id })
    }

    pub(crate) fn store_takes_records(&self) -> Result<(), Rejection> {
        self.store_problem.as_ref().map_or(Ok(()), |why| Err(Rejection::Unavailable(why.clone())))
    }

    /// The patch that holds a session.
    fn held(&self, number: u64) -> Option<usize> {
        self.patches.iter().position(|p| p.session.as_ref().is_some_and(|s| s.view().number == number))
    }

    /// The patch that holds a session in one of the `allowed` states; a restored one is taken up with its samples.
    fn hold_session(
        &mut self,
        now: Now,
        number: u64,
        what: &str,
        allowed: impl Fn(SessionState) -> bool,
    ) -> Result<usize, Rejection> {
        if let Some(index) = self.held(number) {
            let state = self.patches[index].session.as_ref().map(|s| s.view().state).unwrap_or_default();
            return expect(number, state, what, allowed).map(|()| index);
        }
        let view = self.sessions.get(&number).cloned();
        let view = view.ok_or_else(|| Rejection::NotFound(format!("session {number}")))?;
        expect(number, view.state, what, allowed)?;
        let index = self.patch_named(&view.patch)?;
        if let Some(open) = self.patches[index].session.as_ref().filter(|s| s.view().state.is_open()) {
            let (other, state) = (open.view().number, open.view().state.name());
            let why = format!("session {other} of this patch is {state}; finish or abort it first");
            return Err(Rejection::FailedPrecondition(why));
        }
        let Some(samples) = self.resumable.remove(&number) else {
            let why = format!("session {number} is {} and has ended; start a new one", view.state.name());
            return Err(Rejection::FailedPrecondition(why));
        };
        self.patches[index].resume_session(now, SessionView::clone(&view), samples);
        Ok(index)
    }

    fn session_reply(&self, index: usize) -> Reply {
        let session = self.patches[index].session.as_ref();
        let session = session.ok_or_else(|| Rejection::NotFound("session".to_owned()))?;
        Ok(Done::Session(Arc::new(session.view().clone())))
    }
}

/// Refuses a session in another state, naming it and those in which it can be done.
fn expect(
    number: u64,
    state: SessionState,
    what: &str,
    allowed: impl Fn(SessionState) -> bool,
) -> Result<(), Rejection> {
    if allowed(state) {
        return Ok(());
    }
    let words: Vec<&str> = SessionState::ALL.into_iter().filter(|s| allowed(*s)).map(SessionState::name).collect();
    let why = format!("session {number} is {}; {what} only in {}", state.name(), words.join(", "));
    Err(Rejection::FailedPrecondition(why))
}
