//! What takes the zero away, or puts it in doubt, and ends whoever watches for another one.

use crate::force::reason::ReasonCode;
use crate::request::ErrorReason;
use crate::zero::drift::view::DriftView;
use crate::zero::events::ZeroEvent;
use crate::zero::holder::{Models, Zero};

impl Zero {
    /// Something may have moved the zero of a board: the counts have to show that it did not.
    pub fn doubt(&mut self, board: usize, why: &str, events: &mut Vec<ZeroEvent>) {
        self.refuse_watch(why, events);
        self.evidence.doubt(board, why.to_owned());
        if self.view.valid {
            self.tell_doubt(events);
        }
    }

    /// A board says that it is not well: what it sends says nothing until it is, and what it read before is kept, as of a
    /// silent one.
    pub fn on_unwell(&mut self, board: usize) {
        self.evidence.on_unwell(board);
    }

    /// It is well again, and may have taken a new zero; `certain`: after so long a time that its zero counts as lost.
    pub fn on_well(&mut self, board: usize, why: &str, certain: bool, events: &mut Vec<ZeroEvent>) {
        self.evidence.on_well(board, why.to_owned());
        if certain {
            self.vouched = None;
            self.lose(ReasonCode::ZeroLost, why, events);
            return;
        }
        self.refuse_watch(why, events);
        if self.view.valid {
            self.tell_doubt(events);
        }
    }

    /// Something has moved the zero: there is none until rest is proven again.
    ///
    /// Whoever watches has seen what was before, so every watch ends, too, and a zero that is being written down.
    pub fn lose(&mut self, code: ReasonCode, reason: impl Into<String>, events: &mut Vec<ZeroEvent>) {
        let reason = reason.into();
        self.refuse_watch(&reason, events);
        // For models of a session nothing is held against the boards, and for others it is already.
        let without_models = self.unjudged.take_if(|unjudged| unjudged.models != Models::OfSession);
        if let Some(held) = without_models.and_then(|unjudged| unjudged.held) {
            self.evidence.distrust(held);
        }
        if self.view.valid || self.view.reason.is_empty() {
            self.view.epoch += 1;
            self.view.valid = false;
            self.view.reason.clone_from(&reason);
            self.view.code = Some(code);
            self.view.drift = DriftView::default();
            if std::mem::take(&mut self.on_trial) {
                self.baseline = None; // as if there had been none: another is taken as after any start
            }
            self.offset.end();
            self.doubted = false;
            events.push(ZeroEvent::Lost(reason));
        }
    }

    /// As [`Zero::lose`], by what a board has sent, which takes a new zero now: whatever lies on it reads as nothing then.
    pub fn lose_by_board(&mut self, board: usize, reason: &str, events: &mut Vec<ZeroEvent>) {
        self.evidence.doubt(board, reason.to_owned());
        self.vouched = None;
        self.lose(ReasonCode::ZeroLost, reason, events);
    }

    /// As [`Zero::lose_by_board`], by what another patch has seen of the board some scans later: its load has vanished here,
    /// too, if one lay here.
    pub fn lose_by_another(&mut self, board: usize, reason: &str, events: &mut Vec<ZeroEvent>) {
        self.evidence.moved(board, reason);
        self.vouched = None;
        self.lose(ReasonCode::ZeroLost, reason, events);
    }

    /// Ends a watch because of what has happened meanwhile. A zero that is being written down is none any more; who
    /// asked for it is told when that has ended, by [`Zero::adopt`].
    fn refuse_watch(&mut self, why: &str, events: &mut Vec<ZeroEvent>) {
        if let Some(proven) = &mut self.proven {
            proven.spoil(why);
        }
        self.end_watch(ErrorReason::ZeroLost, format!("meanwhile {why}"), events);
    }

    /// Ends a watch of a skin that cannot be at rest; whoever wanted it is told why.
    pub fn end_watch(&mut self, reason: ErrorReason, why: String, events: &mut Vec<ZeroEvent>) {
        if let Some(purpose) = self.stop_watching() {
            events.push(ZeroEvent::Refused(purpose, reason, why));
        }
    }
}
