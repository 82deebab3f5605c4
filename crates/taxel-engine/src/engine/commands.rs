//! What each command does, and why it is refused where it is.

use std::sync::Arc;

use crate::boundary::command::{Command, Done, Reply};
use crate::boundary::output::Output;
use crate::boundary::record::Record;
use crate::calibration::transition::Trigger;
use crate::calibration::view::{SessionState, SessionView};
use crate::engine::answer::Answer;
use crate::engine::pending::Effect;
use crate::engine::sessions::SessionRequest;
use crate::engine::step::Engine;
use crate::loads::load::KnownLoad;
use crate::model_set::ModelSet;
use crate::now::Now;
use crate::patch::owner::Patch;
use crate::request::{Rejection, RequestId};

impl Engine {
    pub(super) fn on_command(&mut self, now: Now, request: RequestId, command: Command, out: &mut Vec<Output>) {
        let answer = match command {
            Command::Tare { patch, confirmed_by } => self.tare(now, request, &patch, confirmed_by, out),
            Command::RecordLoad { patch, load } => self.start_load(now, request, &patch, load),
            Command::BringUp { patch, confirmed_by } => {
                self.bring_up(now, &patch, confirmed_by.is_some(), out).map(Answer::Now)
            }
            Command::StartSession { patch, target, branches, confirmed_by, leave_out } => {
                let asked = SessionRequest { target, branches, confirmed_by, leave_out };
                self.start_session(now, &patch, asked, out).map(Answer::Now)
            }
            Command::StartRamp { session } => self.command_session(now, request, session, Trigger::StartRamp, out),
            Command::FinishRamp { session } => self.command_session(now, request, session, Trigger::FinishRamp, out),
            Command::AbortSession { session } => self.command_session(now, request, session, Trigger::Abort, out),
            Command::DiscardSession { session } => self.discard(now, session, out).map(Answer::Now),
            Command::DeleteSession { session } => self.delete_session(now, request, session, out),
            Command::DeleteModelSet { model_set } => self.delete_model_set(now, request, model_set, out),
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
    pub(super) fn patch_named(&self, name: &str) -> Result<usize, Rejection> {
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
        self.room_for_load()?;
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

    fn bring_up(&mut self, now: Now, patch: &str, confirmed: bool, out: &mut Vec<Output>) -> Reply {
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
            if !confirmed {
                patch.check_unloaded()?;
            }
        }
        for member in group {
            self.with_patch(now, member, out, |patch, effects| patch.bring_up_again(now, confirmed, effects));
        }
        self.health_dirty.0 = true; // boards that were verified are not any more
        Ok(Done::BringUpStarted)
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
        self.refuse_if_set_is_deleted(id)?;
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
        if self.model_sets.iter().all(|known| known.id != set.id) {
            self.room_for_model_set()?;
        }
        // A set that is known already may still wait for the disk: it is written again, which the store finds done.
        let record = Record::ModelSet(Arc::clone(&set));
        self.commit(Effect::Import { request, set }, vec![record], out);
        Ok(Answer::Later)
    }
}
