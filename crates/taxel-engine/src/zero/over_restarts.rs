//! The zero over a restart of the daemon: what is kept of it, and how a patch goes on with it; and what is held against the zeros
//! that boards take when they are configured.

use std::sync::Arc;

use crate::baseline::TaxelBaseline;
use crate::model_set::ModelSet;
use crate::now::Now;
use crate::zero::events::ZeroEvent;
use crate::zero::holder::{Models, OwnModels, Unjudged, Zero, have_same_rest};
use crate::zero::kept::{KeptZero, TakenZero};
use crate::zero::view::TareView;

/// So many zeros of sessions are remembered, those of the newest ramps.
const SESSION_RESTS: usize = 64;

/// Why a zero of before the start is in doubt for its first scans.
const AWAY: &str = "the daemon did not run, and a board may have taken a new zero meanwhile";

impl Zero {
    /// What was held against the boards before the daemon started still is.
    pub fn remember(&mut self, known: &KeptZero) {
        match &known.excused {
            // It is held against the boards as soon as other models are in use.
            Some(set) => {
                let own = Some(OwnModels { id: set.clone(), rest: Vec::new() });
                self.unjudged = Some(Unjudged { held: known.unproven.clone(), models: Models::None, own });
            }
            None => known.unproven.iter().for_each(|why| self.evidence.distrust(why.clone())),
        }
    }

    /// The boards still have the zeros of before the daemon started, as far as is known: the patch goes on with its own. The
    /// next scans have to show that no board has taken another meanwhile.
    pub fn go_on(&mut self, now: Now, kept: &Arc<TakenZero>, events: &mut Vec<ZeroEvent>) {
        let taxels = self.regions.taxels();
        if (kept.mean.len(), kept.noise.len()) != (taxels, taxels) || self.distrusted().is_some() {
            return; // of another layout, or it needs confirmation
        }
        let baseline = kept.baseline();
        let view = TareView::taken(kept.epoch, kept.wall_ns, kept.reason.clone(), kept.at_rest, &baseline);
        if kept.confirmed {
            self.vouched = Some(baseline.as_slice().into());
        }
        self.take_at(now.time, view, baseline, &kept.pads);
        self.kept = Some(Arc::clone(kept));
        (0..self.regions.boards().len()).for_each(|board| self.evidence.doubt(board, AWAY.to_owned()));
        self.on_trial = true;
        events.push(ZeroEvent::Restored);
        self.tell_doubt(events);
    }

    /// Why the counts cannot show whether the skin is unloaded; also after a restart.
    #[must_use]
    pub fn distrusted(&self) -> Option<&str> {
        self.evidence.unproven()
    }

    /// What is known of the zero, if that is no more what was `noted`. The boards are set as the
    /// sum says.
    #[must_use]
    pub fn news(&self, settings: u32, noted: &KeptZero) -> Option<KeptZero> {
        let configured = Some(settings);
        let (unproven, excused, zero) = (self.held_over_restarts(), self.excused(), self.kept());
        let same = (configured, unproven, excused)
            == (noted.configured, noted.unproven.as_deref(), noted.excused.as_deref())
            && zero.map(Arc::as_ptr) == noted.zero.as_ref().map(Arc::as_ptr);
        let news = || KeptZero {
            configured,
            unproven: unproven.map(str::to_owned),
            excused: excused.map(str::to_owned),
            zero: zero.cloned(),
        };
        (!same).then(news)
    }

    /// The zero that is valid, unless no models have judged it yet.
    fn kept(&self) -> Option<&Arc<TakenZero>> {
        let judged = self.unjudged.as_ref().is_none_or(|unjudged| unjudged.own.is_some());
        self.kept.as_ref().filter(|_| self.view.valid && judged)
    }

    pub(super) fn keep(&mut self, pads: Vec<Option<f64>>) {
        let confirmed = self.vouched_now().is_some();
        let taken = self.baseline().map(|baseline| TakenZero::of(&self.view, baseline, confirmed, pads));
        self.kept = taken.map(Arc::new);
    }

    /// What is held against the boards, and what will be once other models than those of a session are in use.
    pub(super) fn held_over_restarts(&self) -> Option<&str> {
        self.distrusted().or_else(|| self.unjudged.as_ref()?.held.as_deref())
    }

    /// The set for which that does not count.
    fn excused(&self) -> Option<&str> {
        let unjudged =
            self.unjudged.as_ref().filter(|unjudged| unjudged.held.as_deref() == self.held_over_restarts())?;
        unjudged.own.as_ref().map(|own| own.id.as_str())
    }

    /// The boards are being configured, and take zeros of their own. Somebody has `confirmed` that nothing touches the skin, or
    /// nobody could see what lay on it: then that is held against the zeros of the boards, and so is what was before, until
    /// somebody confirms a zero.
    pub fn on_bring_up(&mut self, confirmed: bool, unseen: Option<&'static str>) {
        self.configuring = true;
        if confirmed {
            self.evidence.forget();
            self.unjudged = None;
        }
        self.unseen = unseen.or(self.evidence.unproven()).map(str::to_owned);
        self.hold_unseen();
        self.session_rests.clear();
        self.vouched = None;
    }

    /// Somebody confirms a zero: until a board takes another, what a zero may hide is told from this one, too.
    pub(super) fn on_vouched(&mut self, zero: &[TaxelBaseline]) {
        self.unjudged = None;
        self.vouched = Some(zero.into());
    }

    /// The zero that somebody confirmed, if there is one with the zeros that the boards have.
    #[must_use]
    pub const fn vouched(&self) -> Option<&Arc<[TaxelBaseline]>> {
        self.vouched.as_ref()
    }

    /// The zero that holds, if somebody confirmed this very one.
    #[must_use]
    pub fn vouched_now(&self) -> Option<&[TaxelBaseline]> {
        let (zero, vouched) = (self.baseline()?, self.vouched.as_deref()?);
        have_same_rest(zero, vouched).then_some(zero)
    }

    /// A session has taken a zero, and `zero` is that of its first ramp, which is the rest of the models that it makes: they are of
    /// the skin as the boards see it now.
    pub fn note_session_rest(&mut self, zero: &[TaxelBaseline]) {
        if self.session_rests.len() == SESSION_RESTS {
            self.session_rests.pop_front();
        }
        self.session_rests.push_back(zero.to_vec());
    }

    /// Models are in use whose rest is this; it may be that of a session since the boards were configured.
    pub(super) fn on_rest_of_models(&mut self, set: &ModelSet) {
        let rest = &set.baseline;
        let is_of_session = self.session_rests.iter().any(|of_session| have_same_rest(of_session, rest));
        let Some(unjudged) = &mut self.unjudged else { return };
        let is_own = is_of_session || unjudged.owns(set);
        let models = if is_own { Models::OfSession } else { Models::Others };
        let before = std::mem::replace(&mut unjudged.models, models);
        match &unjudged.held {
            Some(held) if !is_own => self.evidence.distrust(held.clone()),
            Some(held) if before == Models::Others => self.evidence.trust_again(held),
            _ => {}
        }
        if is_own {
            unjudged.own = Some(OwnModels { id: set.id.clone(), rest: rest.clone() });
        }
    }

    pub(super) fn hold_unseen(&mut self) {
        self.unseen.iter().for_each(|why| self.evidence.distrust(why.clone()));
    }
}
