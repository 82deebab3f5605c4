//! What is asked of sessions, and how one that no patch holds is taken up again with its samples.

use std::sync::Arc;
use taxel_skin::Kilopascal;

use crate::boundary::command::{Done, Reply};
use crate::boundary::output::Output;
use crate::boundary::record::Record;
use crate::calibration::branch::Branch;
use crate::calibration::samples::{NotLoaded, SessionSamples};
use crate::calibration::transition::{Trigger, commanded};
use crate::calibration::view::{SessionState, SessionView};
use crate::engine::pending::{Answer, Effect, Forgotten};
use crate::engine::step::Engine;
use crate::now::Now;
use crate::patch::owner::Patch;
use crate::request::{ErrorReason, Rejection, RequestId};

/// Why a target is refused that a chamber could reach.
const NO_CHAMBER: &str = ": a vacuum bag ends at the ambient pressure; for a chamber under pressure set \
                          `pressurised_chamber = true` in [patch.session]";

/// What a session is started with.
pub(super) struct SessionRequest {
    /// Where the rise of a ramp ends by itself.
    pub target: Option<Kilopascal>,
    /// Which branches it gathers.
    pub branches: Option<Branch>,
    /// Who confirms that nothing touches the skin.
    pub confirmed_by: Option<String>,
    /// Modules to do without.
    pub leave_out: Vec<(u8, u8)>,
}

impl Engine {
    pub(super) fn start_session(&mut self, now: Now, patch: &str, asked: SessionRequest) -> Reply {
        let index = self.patch_named(patch)?;
        self.store_takes_records()?;
        let patch = self.check_begin(now, index)?;
        let branches = asked.branches.unwrap_or(patch.plan().session.branches);
        if patch.plan().session.typed && branches == Branch::Both {
            return Err(Rejection::invalid("branches", "a dial is typed while the pressure rises: expected RISING"));
        }
        let target = asked.target.unwrap_or(patch.plan().session.target).0;
        let most = patch.plan().session.target_max_kpa();
        if !(target > 0.0 && target <= most) {
            let why = if patch.plan().session.pressurised_chamber { "" } else { NO_CHAMBER };
            let problem = format!("{target} kPa is not above 0 and at most {most}{why}");
            return Err(Rejection::invalid("target_kpa", problem));
        }
        let left_out = left_out(patch, &asked.leave_out)?;
        let view = SessionView {
            number: self.next_session,
            started_wall_ns: now.wall_ns,
            patch: patch.name().to_owned(),
            confirmed_by: asked.confirmed_by,
            look: patch.look(now, &left_out).into(),
            left_out,
            board_settings: patch.plan().board_settings().into(),
            gauge: patch.plan().gauge_words(),
            target_kpa: target,
            branches,
            ..SessionView::default()
        };
        self.next_session += 1;
        self.with_patch(now, index, |patch| patch.start_session(now, view));
        self.patches[index].held_session().map(Done::Session)
    }

    /// The patch at this position, if a session can begin on it now.
    fn check_begin(&self, now: Now, index: usize) -> Result<&Patch, Rejection> {
        let patch = &self.patches[index];
        ErrorReason::NoPressureSensor.unless(patch.plan().can_calibrate(), || {
            "this patch has no pressure sensor in the configuration: it cannot be calibrated".to_owned()
        })?;
        patch.check_no_session("finish or abort it first")?;
        patch.check_gauge_heard(now)?;
        patch.check_vented(now)?;
        Ok(patch)
    }

    /// What an operator asks of a session, and why. The samples of one that no patch holds are read first.
    pub(super) fn command_session(
        &mut self,
        now: Now,
        request: RequestId,
        number: u64,
        (command, why): (Trigger, &str),
    ) -> Answer {
        let done = self.go_on(now, number, (command, why), None)?;
        if done.is_none() && command == Trigger::Abort {
            return self.end_on_disk(now, request, number, (command, why));
        }
        if done.is_none() {
            let ticket = self.pending.keep(Some(request), Effect::TakeUp(number, command));
            self.out.push(Output::Load { ticket, session: number });
        }
        Ok(done)
    }

    /// The samples of a session were read, or why not: the command that needs them goes on.
    pub(super) fn on_loaded(&mut self, now: Now, ticket: u64, result: Result<SessionSamples, NotLoaded>) {
        let Some((request, Effect::TakeUp(number, command))) = self.pending.take(ticket) else { return };
        let fault = "the samples were read, and are still missing, which is a fault of this program";
        let fault = || ErrorReason::ProgramFault.because(fault.to_owned());
        let reply = self.go_on(now, number, (command, ""), Some(result)).and_then(|done| done.ok_or_else(fault));
        self.out.extend(request.map(|request| Output::Reply(request, reply)));
    }

    /// Does what is asked of a session, with its samples if they were `read`. `None` if they have to be, or are not needed for a session
    /// that no patch holds. Everything may change while they are read, so that everything is asked again then.
    fn go_on(
        &mut self,
        now: Now,
        number: u64,
        (command, why): (Trigger, &str),
        read: Option<Result<SessionSamples, NotLoaded>>,
    ) -> Answer {
        // What waits for the disk concerns no session that gathers: its operator is not kept waiting.
        let view = self.sessions.get(&number).ok_or_else(|| Rejection::no_session(number))?;
        if view.state.is_open() {
            self.store_takes_records()?
        } else {
            self.check_changes(&view.patch)?
        }
        self.refuse_if_in_use(number, command)?;
        if command == Trigger::StartRamp && read.is_none() {
            self.check_settings(number)?;
        }
        if let Some(index) = self.held(number) {
            return self.command_held(now, index, (command, why)).map(Some);
        }
        if command == Trigger::Abort {
            return Ok(None);
        }
        let index = self.check_take_up(now, number, command)?;
        let Some(read) = read else { return Ok(None) };
        let damaged =
            |what| format!("session {number} cannot go on, its samples are damaged on disk: {what}; start a new one");
        let samples = read.map_err(|why| why.refusal(damaged))?;
        let patch = &self.patches[index].plan().patch;
        ErrorReason::LayoutChanged.unless(samples.is_of(patch), || {
            format!("session {number} is of another layout of patch `{}` and cannot go on", patch.name())
        })?;
        let view = self.sessions.get(&number).ok_or_else(|| Rejection::no_session(number))?;
        self.patches[index].resume_session(now, SessionView::clone(view), samples);
        self.command_held(now, index, (command, why)).map(Some)
    }

    /// A session whose models are in use stays as it is.
    fn refuse_if_in_use(&self, number: u64, command: Trigger) -> Result<(), Rejection> {
        let state = self.sessions.get(&number).map(|view| self.seen(view).state);
        match state.filter(|state| *state == SessionState::Active) {
            Some(state) => commanded(number, state, command).map(|_| ()),
            None => Ok(()),
        }
    }

    /// Refuses another ramp of boards or a gauge that are set otherwise than in the ramps before: no fit could tell them apart.
    /// What is there may still be fitted, with models of the boards as they were.
    fn check_settings(&self, number: u64) -> Result<(), Rejection> {
        let view = self.sessions.get(&number).ok_or_else(|| Rejection::no_session(number))?;
        let plan = self.patches[self.patch_named(&view.patch)?].plan();
        let found = plan.differs_from(&view.board_settings).or_else(|| plan.gauge_differs_from(&view.gauge));
        let Some(found) = found else { return Ok(()) };
        let why = format!("session {number} cannot go on: it {found}: set it as it was, or start a new session");
        Err(ErrorReason::LayoutChanged.because(why))
    }

    fn command_held(&mut self, now: Now, index: usize, command: (Trigger, &str)) -> Reply {
        let view = self.with_patch(now, index, |patch| patch.command_session(now, command))?;
        Ok(Done::Session(view))
    }

    /// What a dial shows, of a session that a patch holds.
    pub(super) fn plateau(&mut self, now: Now, number: u64, kpa: f64) -> Reply {
        self.store_takes_records()?;
        let view = self.sessions.get(&number).ok_or_else(|| Rejection::no_session(number))?;
        let Some(index) = self.held(number) else {
            let why = format!("session {number} is {}; a plateau is typed only in RAMPING", view.state.name());
            return Err(ErrorReason::SessionWrongState.because(why));
        };
        let view = self.with_patch(now, index, |patch| patch.take_plateau(now, kpa))?;
        Ok(Done::Session(view))
    }

    pub(super) fn discard(&mut self, now: Now, request: RequestId, number: u64) -> Answer {
        let view = self.sessions.get(&number).ok_or_else(|| Rejection::no_session(number))?;
        self.check_changes(&view.patch)?;
        if view.model_set.as_deref().is_some_and(|id| self.refuse_if_set_is_used(id).is_err()) {
            let state = self.seen(view).state.name();
            let why = format!("session {number} is {state} and its models are in use; activate others first");
            return Err(ErrorReason::ModelSetInUse.because(why));
        }
        self.end_on_disk(now, request, number, (Trigger::Discard, Trigger::Discard.reason()))
    }

    /// A session that gathers nothing ends once that is on disk.
    fn end_on_disk(&mut self, now: Now, request: RequestId, number: u64, (command, why): (Trigger, &str)) -> Answer {
        let held = self.held(number).and_then(|index| self.patches[index].session());
        let view = held.or_else(|| self.sessions.get(&number).map(Arc::as_ref));
        let mut view = view.cloned().ok_or_else(|| Rejection::no_session(number))?;
        view.state = commanded(number, view.state, command)?;
        view.reason = why.to_owned();
        view.changed_wall_ns = now.wall_ns;
        let view = Arc::new(view);
        let record = Record::Session(Arc::clone(&view));
        self.commit(Some(request), Effect::End(command, view), vec![record]);
        Ok(None)
    }

    /// That it has ended is on disk. One that a patch holds stays there, with its samples.
    pub(super) fn end_session(&mut self, now: Now, command: Trigger, view: Arc<SessionView>) -> Reply {
        if let Some(index) = self.held(view.number) {
            // Everybody sees the time that is on disk.
            let then = Now { wall_ns: view.changed_wall_ns, ..now };
            let before = self.out.len();
            self.command_held(then, index, (command, &view.reason))?;
            let is_known = |output: &mut Output| matches!(output, Output::Record(Record::Session(known)) if known.number == view.number);
            self.out.extract_if(before.., is_known).for_each(drop);
        }
        self.sessions.insert(view.number, Arc::clone(&view));
        self.catalogue_dirty = true;
        Ok(Done::Session(view))
    }

    /// The patch that could take up a session for `command`.
    fn check_take_up(&self, now: Now, number: u64, command: Trigger) -> Result<usize, Rejection> {
        let view = self.sessions.get(&number).ok_or_else(|| Rejection::no_session(number))?;
        commanded(number, view.state, command)?;
        view.check_trusted()?;
        let index = self.patch_named(&view.patch)?;
        self.patches[index].check_no_session("finish or abort it first")?;
        if command == Trigger::StartRamp {
            self.patches[index].check_gauge_heard(now)?;
            self.patches[index].check_vented(now)?;
        }
        Ok(index)
    }

    /// The patch that holds a session.
    pub(super) fn held(&self, number: u64) -> Option<usize> {
        self.patches.iter().position(|p| p.session().is_some_and(|s| s.number == number))
    }

    pub(super) fn delete_session(&mut self, request: RequestId, number: u64) -> Answer {
        let view = self.sessions.get(&number).ok_or_else(|| Rejection::no_session(number))?;
        self.check_changes(&view.patch)?;
        view.check_closed("abort it first")?;
        if let Some(id) = view.model_set.as_deref() {
            self.refuse_if_set_is_used(id)?;
        }
        let record = Record::SessionDeleted { session: number };
        self.commit(Some(request), Effect::Forget(Forgotten::Session(number)), vec![record]);
        Ok(None)
    }

    /// It is gone from the disk.
    pub(super) fn forget(&mut self, what: &Forgotten) {
        match what {
            Forgotten::ModelSet(id) => self.model_sets.retain(|known| known.id != *id),
            Forgotten::Session(number) => {
                self.sessions.remove(number);
                if let Some(index) = self.held(*number) {
                    self.patches[index].forget_session();
                    self.out.push(Output::SessionGone(index));
                }
            }
        }
        self.catalogue_dirty = true;
    }
}

/// The positions of the modules that an operator leaves out, given as board address and module number.
fn left_out(patch: &Patch, names: &[(u8, u8)]) -> Result<Vec<u16>, Rejection> {
    let layout = &patch.plan().patch;
    let invalid = |problem: String| Err(Rejection::invalid("leave_out", problem));
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
