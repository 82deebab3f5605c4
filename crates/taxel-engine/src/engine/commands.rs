//! What each command does, and why it is refused where it is.

use std::sync::Arc;
use taxel_skin::Kilopascal;

use crate::boundary::command::{Command, Done, Reply};
use crate::boundary::output::Output;
use crate::boundary::record::Record;
use crate::calibration::branch::Branch;
use crate::calibration::transition::{Trigger, commanded};
use crate::calibration::view::{SessionState, SessionView};
use crate::engine::pending::Effect;
use crate::engine::step::Engine;
use crate::loads::load::KnownLoad;
use crate::loads::owner::LOADS_MAX;
use crate::model_set::ModelSet;
use crate::now::Now;
use crate::patch::owner::Patch;
use crate::request::{Rejection, RequestId};

/// Targets beyond this are not a vacuum bag's, nor a pressure chamber's for skin.
const TARGET_MAX_KPA: f64 = 1_000.0;

/// Model sets that are held in memory; a set of the forearm takes about a megabyte.
const MODEL_SETS_MAX: usize = 1_000;

/// What a session is started with.
pub(super) struct SessionRequest {
    target: Option<Kilopascal>,
    branches: Option<Branch>,
    confirmed_by: Option<String>,
    leave_out: Vec<(u8, u8)>,
}

/// A command is answered at once, or its effect answers it later.
enum Answer {
    Now(Done),
    Later,
}

impl Engine {
    pub(super) fn on_command(&mut self, now: Now, request: RequestId, command: Command, out: &mut Vec<Output>) {
        let answer = match command {
            Command::Tare { patch, confirmed_by } => self.tare(now, request, &patch, confirmed_by, out),
            Command::RecordLoad { patch, load } => self.start_load(now, request, &patch, load),
            Command::BringUp { patch } => self.bring_up(now, &patch, out).map(Answer::Now),
            Command::StartSession { patch, target, branches, confirmed_by, leave_out } => {
                let asked = SessionRequest { target, branches, confirmed_by, leave_out };
                self.start_session(now, &patch, asked, out).map(Answer::Now)
            }
            Command::StartRamp { session } => self.command_session(now, session, Trigger::StartRamp, out),
            Command::FinishRamp { session } => self.command_session(now, session, Trigger::FinishRamp, out),
            Command::AbortSession { session } => self.command_session(now, session, Trigger::Abort, out),
            Command::DiscardSession { session } => self.discard(now, session, out),
            Command::Activate { patch, model_set, expected } => {
                self.activate(now, request, &patch, &model_set, expected, out)
            }
            Command::Import { model_set } => self.import(request, model_set, out),
        };
        match answer {
            Ok(Answer::Now(done)) => out.push(Output::Reply(request, Ok(done))),
            Ok(Answer::Later) => {}
            Err(rejection) => out.push(Output::Reply(request, Err(rejection))),
        }
    }

    /// The patch of this name; an empty name stands for the only one.
    fn patch_named(&self, name: &str) -> Result<usize, Rejection> {
        if name.is_empty() && self.patches.len() == 1 {
            return Ok(0);
        }
        let names = || self.patches.iter().map(Patch::name).collect::<Vec<_>>().join(", ");
        if name.is_empty() {
            let problem = format!("must name one of the patches: {}", names());
            return Err(Rejection::InvalidArgument { field: "patch", problem });
        }
        let found = self.patches.iter().position(|p| p.name() == name);
        found.ok_or_else(|| Rejection::NotFound(format!("patch `{name}`; this daemon has {}", names())))
    }

    pub(super) fn store_takes_records(&self) -> Result<(), Rejection> {
        self.store_problem.as_ref().map_or(Ok(()), |why| Err(Rejection::Unavailable(why.clone())))
    }

    fn tare(
        &mut self,
        now: Now,
        request: RequestId,
        patch: &str,
        confirmed_by: Option<String>,
        out: &mut Vec<Output>,
    ) -> Result<Answer, Rejection> {
        let index = self.patch_named(patch)?;
        self.store_takes_records()?;
        self.with_patch(now, index, out, |patch, effects| patch.tare(now, request, confirmed_by, effects))?;
        Ok(Answer::Later)
    }

    fn start_load(&mut self, now: Now, request: RequestId, patch: &str, load: KnownLoad) -> Result<Answer, Rejection> {
        let index = self.patch_named(patch)?;
        load.force()?;
        self.store_takes_records()?;
        if self.patches.iter().map(Patch::loads).sum::<usize>() >= LOADS_MAX {
            let why = format!("there are {LOADS_MAX} loads already, which is the limit");
            return Err(Rejection::FailedPrecondition(why));
        }
        self.patches[index].begin_load(now, request, load)?;
        Ok(Answer::Later)
    }

    /// The patches that share a board with this one, directly or through others: their boards are configured together,
    /// because a board that is configured forgets all its modules.
    fn sharing_boards(&self, index: usize) -> Vec<usize> {
        let share = |a: usize, b: usize| {
            let boards = |p: usize| self.plan.patches[p].patch.boards().iter().map(|board| (board.bus, board.address));
            boards(a).any(|board| boards(b).any(|other| other == board))
        };
        let mut group = vec![index];
        let mut next = 0;
        while let Some(&member) = group.get(next) {
            next += 1;
            let others = (0..self.patches.len()).filter(|other| !group.contains(other) && share(member, *other));
            let others: Vec<usize> = others.collect();
            group.extend(others);
        }
        group
    }

    fn bring_up(&mut self, now: Now, patch: &str, out: &mut Vec<Output>) -> Reply {
        let index = self.patch_named(patch)?;
        if self.patches[index].plan().bring_up.is_empty() {
            let why = "the daemon only listens (listen_only): it sends nothing to the boards".to_owned();
            return Err(Rejection::FailedPrecondition(why));
        }
        let group = self.sharing_boards(index);
        for &member in &group {
            let patch = &self.patches[member];
            patch.calibration().refuse_if_open("abort it first")?;
            patch.check_vented(now)?; // a board that takes its zero under vacuum takes the load for rest
        }
        for member in group {
            self.with_patch(now, member, out, |patch, effects| patch.bring_up_again(now, effects));
        }
        Ok(Done::BringUpStarted)
    }

    fn start_session(&mut self, now: Now, patch: &str, asked: SessionRequest, out: &mut Vec<Output>) -> Reply {
        let index = self.patch_named(patch)?;
        self.store_takes_records()?;
        let patch = &self.patches[index];
        if patch.plan().gauge.is_none() {
            let why = "this patch has no pressure sensor in the configuration: it cannot be calibrated".to_owned();
            return Err(Rejection::FailedPrecondition(why));
        }
        let target = asked.target.unwrap_or(patch.plan().session.target).0;
        if !(target > 0.0 && target <= TARGET_MAX_KPA) {
            let problem = format!("{target} is not in (0, {TARGET_MAX_KPA}]");
            return Err(Rejection::InvalidArgument { field: "target_kpa", problem });
        }
        patch.calibration().refuse_if_open("finish or abort it first")?;
        patch.check_vented(now)?;
        let view = SessionView {
            number: self.next_session,
            patch: patch.name().to_owned(),
            started_wall_ns: now.wall_ns,
            confirmed_by: asked.confirmed_by,
            left_out: left_out(patch, &asked.leave_out)?,
            target_kpa: target,
            branches: asked.branches.unwrap_or(patch.plan().session.branches),
            ..SessionView::default()
        };
        self.next_session += 1;
        self.with_patch(now, index, out, |patch, effects| patch.start_session(now, view, effects));
        let view = self.patches[index].calibration().session().cloned();
        view.map(|view| Done::Session(Arc::new(view))).ok_or_else(|| Rejection::NotFound("session".to_owned()))
    }

    fn command_session(
        &mut self,
        now: Now,
        number: u64,
        command: Trigger,
        out: &mut Vec<Output>,
    ) -> Result<Answer, Rejection> {
        self.store_takes_records()?;
        if matches!(command, Trigger::Abort | Trigger::Discard) && self.held(number).is_none() {
            return self.end_session_of_earlier(now, number, command, out);
        }
        let index = self.hold_session(now, number, command)?;
        let view = self.with_patch(now, index, out, |patch, effects| patch.command_session(now, command, effects))?;
        Ok(Answer::Now(Done::Session(view)))
    }

    fn discard(&mut self, now: Now, number: u64, out: &mut Vec<Output>) -> Result<Answer, Rejection> {
        let view = self.sessions.get(&number).ok_or_else(|| Rejection::NotFound(format!("session {number}")))?;
        let in_use = |id: &str| {
            self.patches.iter().any(|patch| patch.models().is_some_and(|set| set.id == id))
                || self.pending.brings_into_use(id)
        };
        if view.model_set.as_deref().is_some_and(in_use) {
            let why = format!("the models of session {number} are in use; activate others first");
            return Err(Rejection::FailedPrecondition(why));
        }
        self.command_session(now, number, Trigger::Discard, out)
    }

    /// Ends a session that no patch holds: the one that its patch holds stays there, with its samples.
    fn end_session_of_earlier(
        &mut self,
        now: Now,
        number: u64,
        command: Trigger,
        out: &mut Vec<Output>,
    ) -> Result<Answer, Rejection> {
        let view = self.sessions.get(&number).ok_or_else(|| Rejection::NotFound(format!("session {number}")))?;
        let mut view = SessionView::clone(view);
        view.state = commanded(number, view.state, command)?;
        view.reason = command.reason().to_owned();
        view.changed_wall_ns = now.wall_ns;
        if view.state == SessionState::Discarded {
            self.resumable.remove(&number);
        }
        let view = Arc::new(view);
        out.push(Output::Record(Record::Session(Arc::clone(&view))));
        Ok(Answer::Now(Done::Session(view)))
    }

    /// The patch that holds a session; a restored one is taken up with its samples, if `command` can be given to it.
    fn hold_session(&mut self, now: Now, number: u64, command: Trigger) -> Result<usize, Rejection> {
        if let Some(index) = self.held(number) {
            return Ok(index);
        }
        let view = self.sessions.get(&number).cloned();
        let view = view.ok_or_else(|| Rejection::NotFound(format!("session {number}")))?;
        commanded(number, view.state, command)?;
        let index = self.patch_named(&view.patch)?;
        self.patches[index].calibration().refuse_if_open("finish or abort it first")?;
        if command == Trigger::StartRamp {
            self.patches[index].check_vented(now)?;
        }
        let Some(samples) = self.resumable.remove(&number) else {
            let why = format!("session {number} is {} and has ended; start a new one", view.state.name());
            return Err(Rejection::FailedPrecondition(why));
        };
        self.patches[index].resume_session(now, SessionView::clone(&view), samples);
        Ok(index)
    }

    /// The patch that holds a session.
    pub(super) fn held(&self, number: u64) -> Option<usize> {
        self.patches.iter().position(|p| p.calibration().session().is_some_and(|s| s.number == number))
    }

    fn activate(
        &mut self,
        now: Now,
        request: RequestId,
        patch: &str,
        id: &str,
        expected: Option<String>,
        out: &mut Vec<Output>,
    ) -> Result<Answer, Rejection> {
        let index = self.patch_named(patch)?;
        self.store_takes_records()?;
        let set = self.model_sets.iter().find(|set| set.id == id).cloned();
        let set = set.ok_or_else(|| Rejection::NotFound(format!("model set `{id}`")))?;
        let patch = &self.patches[index];
        let name = patch.name().to_owned();
        if set.patch != name {
            let problem = format!("`{id}` is for patch `{}`, not for `{name}`", set.patch);
            return Err(Rejection::InvalidArgument { field: "model_set", problem });
        }
        let refuse = |why: String| Err(Rejection::FailedPrecondition(why));
        let (given, taxels) = (set.taxels.len(), patch.taxels());
        if given != taxels {
            return refuse(format!("`{id}` has {given} taxels, patch `{name}` has {taxels}: its layout has changed"));
        }
        if self.pending.activates(index) {
            return refuse(format!("another model set of patch `{name}` is being activated: ask again"));
        }
        let is = patch.models().map_or("none", |set| set.id.as_str());
        if let Some(expected) = expected.filter(|e| if e.is_empty() { is != "none" } else { e != is }) {
            return refuse(format!("expected `{expected}` to be active, but it is {is}"));
        }
        if self.session_of(&set).is_some_and(|view| view.state == SessionState::Discarded) {
            return refuse(format!("the session of `{id}` is DISCARDED: its models are not to be used"));
        }
        let record = Record::Activated { patch: name, model_set: set.id.clone(), wall_ns: now.wall_ns };
        self.commit(Effect::Activate { request, patch: index, set }, vec![record], out);
        Ok(Answer::Later)
    }

    /// The session of this daemon that a set came from. The number that a set carries is that of the robot where it was
    /// made, so it proves nothing: the session has to name the set.
    pub(super) fn session_of(&self, set: &ModelSet) -> Option<&Arc<SessionView>> {
        let view = self.sessions.get(&set.session?)?;
        (view.model_set.as_deref() == Some(set.id.as_str())).then_some(view)
    }

    fn import(&mut self, request: RequestId, set: Arc<ModelSet>, out: &mut Vec<Output>) -> Result<Answer, Rejection> {
        self.store_takes_records()?;
        let index = self.patch_named(&set.patch)?;
        let (taxels, given) = (self.patches[index].taxels(), set.taxels.len());
        if taxels != given {
            let problem = format!("the set has {given} taxels, patch `{}` has {taxels}", set.patch);
            return Err(Rejection::InvalidArgument { field: "json", problem });
        }
        let known = self.model_sets.iter().any(|known| known.id == set.id);
        if !known && self.model_sets.len() >= MODEL_SETS_MAX {
            let why = format!("there are {MODEL_SETS_MAX} model sets already, which is the limit");
            return Err(Rejection::FailedPrecondition(why));
        }
        // A set that is known already may still wait for the disk: it is written again, which the store finds done.
        let record = Record::ModelSet(Arc::clone(&set));
        self.commit(Effect::Import { request, set }, vec![record], out);
        Ok(Answer::Later)
    }
}

/// The positions of the modules that an operator leaves out, given as board address and module number.
fn left_out(patch: &Patch, names: &[(u8, u8)]) -> Result<Vec<u16>, Rejection> {
    let layout = &patch.plan().patch;
    let invalid = |problem: String| Err(Rejection::InvalidArgument { field: "leave_out", problem });
    let mut positions = Vec::new();
    for &(board, module) in names {
        let found = layout.modules().iter().position(|site| {
            layout.boards()[usize::from(site.board)].address.get() == board && site.module.get() == module
        });
        match found.and_then(|position| u16::try_from(position).ok()) {
            Some(position) => positions.push(position),
            None => return invalid(format!("patch `{}` has no module {module} on board {board}", patch.name())),
        }
    }
    positions.sort_unstable();
    positions.dedup();
    if positions.len() == layout.modules().len() {
        return invalid("every module is left out: nothing would be calibrated".to_owned());
    }
    Ok(positions)
}
