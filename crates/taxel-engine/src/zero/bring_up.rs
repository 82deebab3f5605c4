//! The zero while boards are configured, and what is held against them from one start of the daemon to the next: they take
//! zeros of their own.

use std::sync::Arc;

use crate::baseline::TaxelBaseline;
use crate::model_set::ModelSet;
use crate::scan::Scan;
use crate::zero::boards::{BoardZeros, HiddenCounts};
use crate::zero::count_sums::CountSums;
use crate::zero::events::Surroundings;
use crate::zero::holder::{Models, OwnModels, Unjudged, Zero, have_same_rest};

/// So many scans tell what boards read that were just configured: a mean of these is known to a fifth of a count.
const FIRST_SCANS: u64 = 16;

/// So many zeros of sessions are remembered, those of the newest ramps.
pub(super) const SESSION_RESTS: usize = 64;

impl Zero {
    /// Goes on from what was known of the boards' zeros before the daemon started.
    pub fn go_on(&mut self, known: &BoardZeros) {
        let (taxels, noted) = (self.regions.taxels(), known.hidden.as_ref().map(|hidden| hidden.counts.len()));
        let other = noted.filter(|noted| *noted != taxels);
        let other =
            other.map(|noted| format!("what was noted of the boards' zeros is of {noted} taxels, not {taxels}"));
        self.hidden = known.hidden.clone().filter(|_| other.is_none());
        match (&known.unproven, &known.excused) {
            // It is held against the boards as soon as other models are in use.
            (held @ Some(_), Some(set)) => {
                let own = OwnModels { id: set.clone(), rest: Vec::new() };
                self.unjudged = Some(Unjudged { held: held.clone(), models: Models::None, own: Some(own) });
            }
            (Some(why), None) => self.continuity.distrust(why.clone()),
            (None, _) => {}
        }
        other.into_iter().for_each(|why| self.continuity.distrust(why));
    }

    /// Why the counts cannot show whether the skin is at rest; also after a restart.
    #[must_use]
    pub fn distrusted(&self) -> Option<&str> {
        self.continuity.unproven()
    }

    /// What is known of the boards' zeros, if that is no more what was `noted`.
    #[must_use]
    pub fn news_of_boards(&self, noted: &BoardZeros) -> Option<BoardZeros> {
        let is_one = |hidden: &Arc<HiddenCounts>| noted.hidden.as_ref().is_some_and(|noted| Arc::ptr_eq(hidden, noted));
        let (unproven, excused) = (self.held_over_restarts(), self.excused());
        let same = (unproven, excused) == (noted.unproven.as_deref(), noted.excused.as_deref())
            && (self.hidden.as_ref().is_some_and(is_one) || self.hidden == noted.hidden);
        let zeros = || BoardZeros {
            unproven: unproven.map(str::to_owned),
            excused: excused.map(str::to_owned),
            hidden: self.hidden.clone(),
        };
        (!same).then(zeros)
    }

    /// What is held against the boards, and what will be once other models than those of a session are in use.
    pub(super) fn held_over_restarts(&self) -> Option<&str> {
        self.distrusted().or_else(|| self.unjudged.as_ref()?.held.as_deref())
    }

    /// The set for which that does not count.
    fn excused(&self) -> Option<&str> {
        let unjudged =
            self.unjudged.as_ref().filter(|unjudged| unjudged.held.as_deref() == self.held_over_restarts())?;
        unjudged.held.as_ref().and(unjudged.own.as_ref()).map(|own| own.id.as_str())
    }

    /// The boards are being configured, and take zeros of their own on a skin that was looked at, that somebody has `vouched`
    /// for, or neither. What was let pass when they were configured before still lies there as far as this look knows: the
    /// boards' zeros hide it from the look. `models` is the zero of the models in use, `unseen` why nobody knows what lay on the
    /// skin, if that is so: it is held against the zeros of the boards until there is another, and so is what was held against them
    /// before, unless somebody has vouched.
    pub fn on_bring_up(&mut self, models: Option<&[TaxelBaseline]>, vouched: bool, unseen: Option<&'static str>) {
        self.configuring = true;
        if vouched {
            self.continuity.forget();
            self.unjudged = None;
        }
        self.unseen = unseen.or(self.continuity.unproven()).map(str::to_owned);
        self.hold_unseen();
        self.session_rests.clear();
        self.vouched = None;
        self.first_scans = Some(CountSums::new(self.regions.taxels()));
        let looked = self.looked.take().zip(models);
        let earlier = self.hidden.take().filter(|_| !vouched);
        self.hidden = match looked.filter(|_| !vouched) {
            Some((looked, models)) => {
                Some(Arc::new(HiddenCounts::of(&looked, models, earlier.as_deref(), self.regions.modules())))
            }
            None => earlier, // boards that nobody hears may not be reached either
        };
    }

    /// The scans after the boards were configured tell what the taxels read with the zeros that they took.
    pub(super) fn settle_boards(&mut self, scan: &Scan<'_>, around: &Surroundings<'_>) {
        let Some(first) = &mut self.first_scans else { return };
        if around.configuring {
            first.restart();
            return;
        }
        first.push(scan);
        if first.scans() < FIRST_SCANS {
            return;
        }
        if let Some(hidden) = &mut self.hidden {
            *hidden = Arc::new(hidden.settled(&first.baseline(), self.regions.modules()));
        }
        self.first_scans = None;
    }

    /// Somebody vouches for a zero: until a board takes another, what a zero may hide is told from this one, too.
    pub(super) fn on_vouched(&mut self, zero: &[TaxelBaseline]) {
        self.unjudged = None;
        self.vouched = Some(zero.into());
    }

    /// The zero that somebody vouched for, one per taxel, if there is one with the zeros that the boards have.
    #[must_use]
    pub const fn vouched(&self) -> Option<&Arc<[TaxelBaseline]>> {
        self.vouched.as_ref()
    }

    /// The zero that holds, if somebody vouched for this very one.
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
        if let Some(unjudged) = &mut self.unjudged {
            let is_own = is_of_session || unjudged.owns(set);
            let models = if is_own { Models::OfSession } else { Models::Others };
            let before = std::mem::replace(&mut unjudged.models, models);
            match &unjudged.held {
                Some(held) if !is_own => self.continuity.distrust(held.clone()),
                Some(held) if before == Models::Others => self.continuity.trust_again(held),
                _ => {}
            }
            if is_own {
                unjudged.own = Some(OwnModels { id: set.id.clone(), rest: rest.clone() });
            }
        }
        if let Some(hidden) = self.hidden.as_mut().filter(|_| is_of_session) {
            *hidden = Arc::new(hidden.for_models_at(rest, self.ground.signs()));
        }
    }

    pub(super) fn hold_unseen(&mut self) {
        self.unseen.iter().for_each(|why| self.continuity.distrust(why.clone()));
    }

    /// What the zeros of the boards hide beside what the present zero does.
    #[must_use]
    pub const fn hidden(&self) -> Option<&Arc<HiddenCounts>> {
        self.hidden.as_ref()
    }
}
