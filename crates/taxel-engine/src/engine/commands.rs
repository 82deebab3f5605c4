//! What each command does and why it is refused where it is, what takes effect once it is on disk, and scans that a program hands
//! over: these enter a patch as those of described devices do.

use std::sync::Arc;

use crate::boundary::command::{Command, Done, Reply};
use crate::boundary::output::Output;
use crate::boundary::pushed::PushedScan;
use crate::calibration::job::FitOutcome;
use crate::calibration::transition::Trigger;
use crate::engine::pending::{Answer, Effect, Origin};
use crate::engine::sessions::SessionRequest;
use crate::engine::step::Engine;
use crate::intake::health::{BusNotice, BusState};
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

    /// A fit came back. A model set is written down before the session says that it has one.
    pub(super) fn on_fitted(&mut self, now: Now, outcome: FitOutcome) {
        // Aborted meanwhile: the samples are kept, the fit is not. Also asked again once the model set is on disk.
        let Some(patch) = self.patches.iter().position(|p| p.awaits(&outcome)) else { return };
        let Ok(set) = &outcome.result else { return self.end_fit(now, patch, &outcome) };
        let set = Arc::clone(set);
        if let Err(refusal) = self.keep(None, set, Origin::Session(patch, outcome.clone())) {
            let outcome = FitOutcome { result: Err(format!("the model set: {refusal}")), ..outcome };
            self.end_fit(now, patch, &outcome);
        }
    }

    pub(super) fn end_fit(&mut self, now: Now, patch: usize, outcome: &FitOutcome) {
        self.with_patch(now, patch, |patch| {
            patch.with_session(now, |session, _| session.on_fitted(now, outcome));
        });
    }

    /// Records that were handed out under a ticket are on disk, or why not.
    pub(super) fn on_committed(&mut self, now: Now, ticket: u64, result: Result<(), String>) {
        let Some((request, effect)) = self.pending.take(ticket) else { return };
        let reply = match result {
            Ok(()) => self.take_effect(now, effect),
            Err(why) => Err(self.leave_undone(now, effect, &why)),
        };
        self.out.extend(request.map(|request| Output::Reply(request, reply)));
    }

    fn take_effect(&mut self, now: Now, effect: Effect) -> Reply {
        match effect {
            Effect::Activate(patch, set) => Ok(self.put_to_use(now, patch, &set)),
            Effect::Keep(set, origin) => Ok(self.on_kept(now, set, origin)),
            Effect::TakeUp(..) | Effect::ReadSet(_) => {
                let why = "what waits to be read was written, which is a fault of this program".to_owned();
                Err(ErrorReason::ProgramFault.because(why))
            }
            Effect::Zero(patch, request) => {
                self.with_patch(now, patch, |patch| patch.adopt_zero(request)).map(Done::Tared)
            }
            Effect::Load(patch, load) => {
                self.patches[patch].keep_load(Arc::clone(&load));
                self.catalogue_dirty = true;
                Ok(Done::LoadRecorded(load))
            }
            Effect::Forget(what) => {
                self.forget(&what);
                Ok(Done::Deleted)
            }
            Effect::End(command, view) => self.end_session(now, command, view),
        }
    }

    fn leave_undone(&mut self, now: Now, effect: Effect, why: &str) -> Rejection {
        let why = format!("it could not be written to disk, and nothing has changed: {why}");
        match effect {
            Effect::Keep(_, Origin::Session(patch, outcome)) => {
                let outcome = FitOutcome { result: Err(format!("the model set: {why}")), ..outcome };
                self.end_fit(now, patch, &outcome);
            }
            Effect::Zero(patch, request) => self.patches[patch].reject_zero(request),
            _ => {}
        }
        Rejection::Unavailable(ErrorReason::StoreUnavailable, why)
    }

    pub(super) fn begin_push(&mut self, now: Now, patch: &str) -> Reply {
        let index = self.patch_named(patch)?;
        let plan = &self.plan.patches[index];
        if let Some(gauge) = plan.gauge.as_ref().filter(|gauge| gauge.pushed) {
            let bus = usize::from(gauge.bus.0);
            self.buses.get_mut(bus).into_iter().for_each(|line| drop(line.on_notice(now.time, BusNotice::Up)));
            self.health_dirty.0 = true;
            return Ok(Done::PushBegun);
        }
        ErrorReason::NotPushed.unless(plan.pushed.is_some(), || {
            let name = self.patches[index].name();
            format!("the scans of patch `{name}` come over its bus, and its gauge's readings too: nobody can push any")
        })?;
        if let Some(line) = self.line_of(index) {
            line.on_notice(now.time, BusNotice::Up);
        }
        self.health_dirty.0 = true;
        self.with_patch(now, index, |patch| patch.begin_push(now));
        Ok(Done::PushBegun)
    }

    /// The service has seen to it that the patch takes pushed scans, and that this is one of it.
    pub(super) fn on_pushed(&mut self, now: Now, scan: &PushedScan) {
        self.health_dirty.1 = true;
        let news = self.line_of(scan.patch).is_some_and(|line| {
            line.health.frames += 1;
            line.on_frames(now.time)
        });
        self.health_dirty.0 |= news;
        // As with frames: what it brings about happens at its own time.
        let now = now.at(scan.time);
        self.with_patch(now, scan.patch, |patch| patch.on_pushed(now, scan));
    }

    /// The state of what the scans of a patch come over.
    fn line_of(&mut self, patch: usize) -> Option<&mut BusState> {
        let bus = self.plan.patches.get(patch)?.patch.boards().first()?.bus;
        self.buses.get_mut(usize::from(bus.0))
    }
}
