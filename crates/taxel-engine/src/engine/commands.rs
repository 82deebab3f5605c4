//! What each command does, and why it is refused where it is.

use crate::boundary::command::{Command, Done, Reply};
use crate::boundary::output::Output;
use crate::calibration::transition::Trigger;
use crate::engine::pending::{Answer, Effect, Forgotten, Origin};
use crate::engine::sessions::SessionRequest;
use crate::engine::step::Engine;
use crate::loads::load::KnownLoad;
use crate::now::Now;
use crate::patch::owner::Patch;
use crate::request::{ErrorReason, Rejection, RequestId};

impl Engine {
    pub(super) fn on_command(&mut self, now: Now, request: RequestId, command: Command) {
        let answer = match command {
            Command::Tare { patch, confirmed_by } => self.tare(now, request, &patch, confirmed_by),
            Command::RecordLoad { patch, load } => self.start_load(now, request, &patch, load),
            Command::BringUp { patch, confirmed_by } => self.bring_up(now, &patch, confirmed_by.is_some()).map(Some),
            Command::BeginPush { patch } => self.begin_push(now, &patch).map(Some),
            Command::StartSession { patch, target, branches, confirmed_by, leave_out } => {
                let asked = SessionRequest { target, branches, confirmed_by, leave_out };
                self.start_session(now, &patch, asked).map(Some)
            }
            Command::StartRamp { session } => self.command_session(now, request, session, (Trigger::StartRamp, "")),
            Command::Plateau { session, kpa } => self.plateau(now, session, kpa.0).map(Some),
            Command::FinishRamp { session } => self.command_session(now, request, session, (Trigger::FinishRamp, "")),
            Command::AbortSession { session, reason } => {
                let why = reason.as_deref().unwrap_or(Trigger::Abort.reason());
                self.command_session(now, request, session, (Trigger::Abort, why))
            }
            Command::DiscardSession { session } => self.discard(now, request, session),
            Command::DeleteSession { session } => self.delete_session(request, session),
            Command::DeleteModelSet { model_set } => self.delete_model_set(request, model_set),
            Command::Activate { patch, model_set, expected } => {
                self.activate(now, request, (&patch, model_set, expected))
            }
            Command::Import { model_set, insist } => self.keep(Some(request), model_set, Origin::Import { insist }),
            Command::KeepRefit { model_set, sessions } => self.keep(Some(request), model_set, Origin::Refit(sessions)),
            Command::KeepRecalibration { model_set } => self.keep(Some(request), model_set, Origin::Loads),
        };
        self.out.extend(answer.transpose().map(|reply| Output::Reply(request, reply)));
    }

    /// The patch of this name; an empty name stands for the only one.
    pub(super) fn patch_named(&self, name: &str) -> Result<usize, Rejection> {
        if name.is_empty() && self.patches.len() == 1 {
            return Ok(0);
        }
        let names = || self.patches.iter().map(Patch::name).collect::<Vec<_>>().join(", ");
        if name.is_empty() {
            return Err(Rejection::invalid("patch", format!("must name one of the patches: {}", names())));
        }
        let found = self.patches.iter().position(|p| p.name() == name);
        found.ok_or_else(|| {
            Rejection::NotFound(ErrorReason::PatchUnknown, format!("patch `{name}`; this daemon has {}", names()))
        })
    }

    pub(super) fn store_takes_records(&self) -> Result<(), Rejection> {
        self.store_problem
            .as_ref()
            .map_or(Ok(()), |why| Err(Rejection::Unavailable(ErrorReason::StoreUnavailable, why.clone())))
    }

    /// Refuses a change of the sessions and sets of a patch that could not be written down now, or may contradict one that is being
    /// written. Other patches are free to change theirs.
    pub(super) fn check_changes(&self, patch: &str) -> Result<(), Rejection> {
        self.store_takes_records()?;
        let words = self.pending.changes().find_map(|effect| {
            let (of, words) = match effect {
                Effect::Activate(_, set) => (set.patch.as_str(), format!("model set `{}` is being activated", set.id)),
                Effect::Forget(Forgotten::ModelSet(id)) => {
                    (self.known_set(id)?.patch.as_str(), format!("model set `{id}` is being deleted"))
                }
                Effect::Forget(Forgotten::Session(number)) => {
                    (self.sessions.get(number)?.patch.as_str(), format!("session {number} is being deleted"))
                }
                Effect::End(_, view) => (view.patch.as_str(), format!("session {} is being ended", view.number)),
                _ => return None,
            };
            (of == patch).then_some(words)
        });
        let refused = |words| Rejection::Unavailable(ErrorReason::ChangeUnderWay, format!("{words}: ask again"));
        words.map_or(Ok(()), |words| Err(refused(words)))
    }

    fn tare(&mut self, now: Now, request: RequestId, patch: &str, confirmed_by: Option<String>) -> Answer {
        let index = self.patch_named(patch)?;
        self.store_takes_records()?;
        self.with_patch(now, index, |patch| patch.tare(now, request, confirmed_by))?;
        Ok(None)
    }

    fn start_load(&mut self, now: Now, request: RequestId, patch: &str, load: KnownLoad) -> Answer {
        let index = self.patch_named(patch)?;
        load.force()?;
        self.store_takes_records()?;
        self.patches[index].begin_load(now, request, load)?;
        Ok(None)
    }

    /// It has been listened for long enough whether the boards stream: those that have to be configured are.
    pub(super) fn begin_bring_up(&mut self, now: Now) {
        let mut wanted: Vec<Vec<bool>> = self.patches.iter().map(|patch| patch.boards_to_configure(now.time)).collect();
        self.shared.spread(&mut wanted);
        for (index, wanted) in wanted.iter().enumerate() {
            self.with_patch(now, index, |patch| patch.begin(now, wanted));
        }
    }

    fn bring_up(&mut self, now: Now, patch: &str, confirmed: bool) -> Reply {
        let index = self.patch_named(patch)?;
        let why = || "the daemon only listens (listen_only): it sends nothing to the boards".to_owned();
        ErrorReason::ListenOnly.unless(self.patches[index].plan().configures(), why)?;
        // A board that is configured forgets the modules of all its patches.
        let mut wanted: Vec<Vec<bool>> =
            self.plan.patches.iter().map(|plan| vec![false; plan.patch.boards().len()]).collect();
        wanted[index].fill(true);
        self.shared.spread(&mut wanted);
        let members: Vec<usize> = (0..wanted.len()).filter(|member| wanted[*member].contains(&true)).collect();
        for &member in &members {
            let patch = &self.patches[member];
            patch.check_no_session("abort it first")?;
            patch.check_vented(now)?; // a board that takes its zero under vacuum takes the load for rest
            // Who confirms that nothing touches one skin knows nothing of another that shares a board with it.
            if !confirmed || member != index {
                patch.check_unloaded()?;
            }
        }
        for member in members {
            let (confirmed, wanted) = (confirmed && member == index, &wanted[member]);
            self.with_patch(now, member, |patch| patch.configure(now, wanted, confirmed));
        }
        self.health_dirty.0 = true; // boards that were verified are not any more
        Ok(Done::BringUpStarted)
    }
}
