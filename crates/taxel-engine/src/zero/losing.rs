//! What takes the zero away or puts it in check, and how a patch goes on after a restart of the daemon or of its boards.

use std::sync::Arc;

use crate::baseline::TaxelBaseline;
use crate::force::reason::ReasonCode;
use crate::model_set::ModelSet;
use crate::request::ErrorReason;
use crate::zero::events::ZeroEvent;
use crate::zero::holder::{Trust, Zero};
use crate::zero::kept::{KeptZero, Models, TakenZero, Unjudged, have_same_rest};
use crate::zero::watch::Purpose;

/// Why a zero of before the start is checked in its first scans.
const AWAY: &str = "the daemon did not run, and a board may have taken a new zero meanwhile";

impl Zero {
    /// Something may have moved the zero of a board: the counts have to show that it did not.
    pub fn suspect(&mut self, board: usize, why: &str, events: &mut Vec<ZeroEvent>) {
        self.refuse_watch(why, events);
        self.evidence.suspect(board, why.to_owned());
        self.tell_check(events);
    }

    /// A board says that it is not well: what it sends says nothing until it is, and what it read before is kept, as of a
    /// silent one.
    pub fn on_unwell(&mut self, board: usize) {
        self.evidence.on_unwell(board);
    }

    /// It is well again, and may have taken a new zero; `certain`: after so long a time that its zero counts as lost.
    pub fn on_well(&mut self, board: usize, why: &str, certain: bool, events: &mut Vec<ZeroEvent>) {
        self.evidence.on_well(board);
        if certain { self.lose_by_board(board, why, events) } else { self.suspect(board, why, events) }
    }

    /// Something has moved the zero: there is none until rest is proven again.
    ///
    /// A watch has seen what was before, so every watch ends, too, and a zero that is being written down.
    pub fn lose(&mut self, code: ReasonCode, reason: impl Into<String>, events: &mut Vec<ZeroEvent>) {
        let reason = reason.into();
        self.refuse_watch(&reason, events);
        // With models of a session no confirmation is needed, and with others it is already.
        let without_models = self.unjudged.take_if(|unjudged| unjudged.models != Models::OfSession);
        if let Some(why) = without_models.and_then(|unjudged| unjudged.needs_confirmation) {
            self.evidence.require_confirmation(why);
        }
        let on_trial = match &self.trust {
            Trust::Held(held) => held.on_trial,
            Trust::None if self.view.code.is_none() => true, // nothing was said yet
            _ => return,
        };
        // One that is refuted before it was ever trusted is as none: another is taken as after any start.
        self.trust = if on_trial { Trust::None } else { Trust::Lost };
        self.view.epoch += 1;
        self.view.invalidate(code, reason.clone());
        self.offset.end();
        events.push(ZeroEvent::Lost(reason));
    }

    /// As [`Zero::lose`], by what a board has sent, which takes a new zero now: whatever lies on it reads as nothing then.
    pub fn lose_by_board(&mut self, board: usize, reason: &str, events: &mut Vec<ZeroEvent>) {
        self.evidence.suspect(board, reason.to_owned());
        self.lose_boards_zero(reason, events);
    }

    /// As [`Zero::lose_by_board`], by what another patch has seen of the board some scans later: its load has vanished here,
    /// too, if one lay here.
    pub fn lose_by_another(&mut self, board: usize, reason: &str, events: &mut Vec<ZeroEvent>) {
        self.evidence.moved(board, reason);
        self.lose_boards_zero(reason, events);
    }

    pub(super) fn lose_boards_zero(&mut self, reason: &str, events: &mut Vec<ZeroEvent>) {
        self.confirmed = None;
        self.lose(ReasonCode::ZeroLost, reason, events);
    }

    /// Ends a watch because of what has happened meanwhile. A zero that is being written down is none any more; who
    /// asked for it hears of it when that has ended, by [`Zero::adopt`].
    fn refuse_watch(&mut self, why: &str, events: &mut Vec<ZeroEvent>) {
        self.writing.iter_mut().for_each(|writing| writing.spoil(why));
        self.end_watch(ErrorReason::ZeroLost, format!("meanwhile {why}"), events);
    }

    /// If a zero needed confirmation before the daemon started, it still does.
    pub fn remember(&mut self, known: &KeptZero) {
        if let own @ Some(_) = known.excused.clone() {
            // It needs one as soon as other models are in use.
            let needs_confirmation = known.needs_confirmation.clone();
            self.unjudged = Some(Unjudged { needs_confirmation, own, ..Unjudged::default() });
        } else if let Some(why) = &known.needs_confirmation {
            self.evidence.require_confirmation(why.clone());
        }
    }

    /// The boards still have the zeros of before the daemon started, as far as is known: the patch goes on with its own. The
    /// next scans have to show that no board has taken another meanwhile.
    pub fn go_on(&mut self, kept: Arc<TakenZero>, events: &mut Vec<ZeroEvent>) {
        let taxels = self.regions.taxels();
        if (kept.mean.len(), kept.noise.len()) != (taxels, taxels) || self.needs_confirmation().is_some() {
            return; // of another layout, or nobody can tell
        }
        self.hold(kept);
        (0..self.regions.boards().len()).for_each(|board| self.evidence.suspect(board, AWAY.to_owned()));
        if let Trust::Held(held) = &mut self.trust {
            held.on_trial = true;
        }
        events.push(ZeroEvent::Taken(Purpose::AtStart));
        self.tell_check(events);
    }

    /// Why the counts cannot show whether the skin is unloaded, so that somebody has to confirm it; also after a restart.
    pub fn needs_confirmation(&self) -> Option<&str> {
        self.evidence.needs_confirmation()
    }

    /// The same, or why it will once other models than those of a session are in use.
    pub(super) fn needs_confirmation_later(&self) -> Option<&str> {
        self.needs_confirmation().or_else(|| self.unjudged.as_ref()?.needs_confirmation.as_deref())
    }

    /// What is known of the zero, if that is no more what was `noted`. The boards are set as the
    /// sum says.
    pub fn news(&self, settings: u32, noted: &KeptZero) -> Option<KeptZero> {
        let (configured, why, unjudged) = (Some(settings), self.needs_confirmation_later(), self.unjudged.as_ref());
        // The set for which that does not count.
        let excused = unjudged.filter(|unjudged| unjudged.needs_confirmation.as_deref() == why);
        let excused = excused.and_then(|unjudged| unjudged.own.as_deref());
        // Not one that no models have judged yet.
        let judged = unjudged.is_none_or(|unjudged| unjudged.own.is_some());
        let zero = self.held().filter(|_| judged).map(|held| &held.kept);
        let same = (configured, why, excused)
            == (noted.configured, noted.needs_confirmation.as_deref(), noted.excused.as_deref())
            && zero.map(Arc::as_ptr) == noted.zero.as_ref().map(Arc::as_ptr);
        let news = || KeptZero {
            configured,
            needs_confirmation: why.map(str::to_owned),
            excused: excused.map(str::to_owned),
            zero: zero.cloned(),
        };
        (!same).then(news)
    }

    /// The boards are being configured, and take zeros of their own. Somebody has `confirmed` that nothing touches the skin, or
    /// nothing could show what lay on it, which is why their zeros need confirmation, as they may have before.
    pub fn on_bring_up(&mut self, confirmed: bool, unchecked: Option<&'static str>) {
        self.configuring = true;
        if confirmed {
            self.evidence.forget();
            self.unjudged = None;
        }
        unchecked.into_iter().for_each(|why| self.evidence.require_confirmation(why.to_owned()));
        self.confirmed = None;
    }

    /// The zero that somebody confirmed, if there is one with the zeros that the boards have.
    pub const fn confirmed(&self) -> Option<&Arc<[TaxelBaseline]>> {
        self.confirmed.as_ref()
    }

    /// The zero that holds, if somebody confirmed this very one.
    pub fn confirmed_now(&self) -> Option<&[TaxelBaseline]> {
        self.baseline().filter(|zero| self.is_confirmed(zero))
    }

    pub(super) fn is_confirmed(&self, zero: &[TaxelBaseline]) -> bool {
        self.confirmed.as_deref().is_some_and(|confirmed| have_same_rest(zero, confirmed))
    }

    /// A session has taken a zero, the rest of the models that it makes: they are of the skin as the boards see it now.
    pub fn note_session_rest(&mut self, zero: &[TaxelBaseline]) {
        self.unjudged.iter_mut().for_each(|unjudged| unjudged.note_rest(zero));
    }

    /// Models are in use, perhaps those of a session since the boards were configured.
    pub(super) fn on_rest_of_models(&mut self, set: &ModelSet) {
        let Some(unjudged) = &mut self.unjudged else { return };
        let is_own = unjudged.owns(set);
        let models = if is_own { Models::OfSession } else { Models::Others };
        let before = std::mem::replace(&mut unjudged.models, models);
        match &unjudged.needs_confirmation {
            Some(why) if !is_own => self.evidence.require_confirmation(why.clone()),
            Some(why) if before == Models::Others => self.evidence.no_longer_needs(why),
            _ => {}
        }
    }
}
