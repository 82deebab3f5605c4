//! Another ramp after a session that is in use: a session of its own begins, with the samples of that one.
//!
//! The session in use stays as it is, with its samples and its model set. Its successor has a copy of the samples on disk,
//! so that each can be exported, fitted again and deleted without the other.

use std::sync::Arc;

use crate::boundary::command::{Done, Reply};
use crate::boundary::output::Output;
use crate::calibration::samples::SessionSamples;
use crate::calibration::transition::Trigger;
use crate::calibration::view::{SessionState, SessionView};
use crate::engine::step::Engine;
use crate::now::Now;
use crate::request::{ErrorReason, Rejection};

impl Engine {
    /// Whether a command to a session begins a successor of it.
    pub(super) fn is_succeeded(&self, number: u64, command: Trigger) -> bool {
        let in_use = |view: &Arc<SessionView>| self.seen(view).state == SessionState::Active;
        command == Trigger::StartRamp && self.sessions.get(&number).is_some_and(in_use)
    }

    /// The patch on which a session in use can be succeeded.
    pub(super) fn check_successor(&self, now: Now, number: u64) -> Result<usize, Rejection> {
        let view = self.sessions.get(&number).ok_or_else(|| Rejection::no_session(number))?;
        view.check_trusted()?;
        let index = self.patch_named(&view.patch)?;
        let patch = &self.patches[index];
        self.room_for_session()?;
        self.room_for_model_set()?;
        if !patch.plan().has_gauge() {
            let why = "this patch has no pressure sensor in the configuration: it cannot be calibrated".to_owned();
            return Err(Rejection::FailedPrecondition(ErrorReason::NoPressureSensor, why));
        }
        let modules = patch.plan().patch.modules().len();
        if view.left_out.iter().any(|module| usize::from(*module) >= modules) {
            let why = format!("session {number} is of another layout of patch `{}` and cannot go on", patch.name());
            return Err(Rejection::FailedPrecondition(ErrorReason::LayoutChanged, why));
        }
        patch.calibration().refuse_if_open("finish or abort it first")?;
        patch.check_gauge_heard(now)?;
        patch.check_vented(now)?;
        Ok(index)
    }

    /// Begins it. Everything was checked, and nothing has happened since.
    pub(super) fn begin_successor(
        &mut self,
        now: Now,
        index: usize,
        number: u64,
        samples: SessionSamples,
        out: &mut Vec<Output>,
    ) -> Reply {
        let of = self.sessions.get(&number).ok_or_else(|| Rejection::no_session(number))?;
        let view = SessionView {
            number: self.next_session,
            patch: of.patch.clone(),
            started_wall_ns: now.wall_ns,
            confirmed_by: of.confirmed_by.clone(),
            predecessor: Some(number),
            left_out: of.left_out.clone(),
            board_settings: Arc::clone(&of.board_settings),
            gauge: of.gauge.clone(),
            target_kpa: of.target_kpa,
            branches: of.branches,
            ..SessionView::default()
        };
        self.next_session += 1;
        self.with_patch(now, index, out, |patch, effects| patch.succeed_session(now, view, samples, effects));
        let view = self.patches[index].calibration().session().cloned();
        view.map(|view| Done::Session(Arc::new(view)))
            .ok_or_else(|| Rejection::NotFound(ErrorReason::SessionUnknown, "session".to_owned()))
    }
}
