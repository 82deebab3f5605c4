//! The zero while boards are configured, and what is held against them from one start of the daemon to the next: they take
//! zeros of their own.

use std::sync::Arc;

use crate::baseline::TaxelBaseline;
use crate::zero::boards::{BoardZeros, HiddenCounts};
use crate::zero::holder::Zero;

impl Zero {
    /// Goes on from what was known of the boards' zeros before the daemon started.
    pub fn go_on(&mut self, known: &BoardZeros) {
        let (taxels, noted) = (self.regions.taxels(), known.hidden.as_ref().map(|hidden| hidden.counts.len()));
        let other = noted.filter(|noted| *noted != taxels);
        let other =
            other.map(|noted| format!("what was noted of the boards' zeros is of {noted} taxels, not {taxels}"));
        self.hidden = known.hidden.clone().filter(|_| other.is_none());
        known.unproven.clone().or(other).into_iter().for_each(|why| self.continuity.distrust(why));
        self.counted = self.hidden.clone();
    }

    /// Why the counts cannot show whether the skin is at rest; also after a restart.
    #[must_use]
    pub fn distrusted(&self) -> Option<&str> {
        self.continuity.unproven()
    }

    /// What is known of the boards' zeros, if that is no more what was `noted`.
    #[must_use]
    pub fn news_of_boards(&self, noted: &BoardZeros) -> Option<BoardZeros> {
        let same = self.distrusted() == noted.unproven.as_deref()
            && self.hidden.as_ref().map(Arc::as_ptr) == noted.hidden.as_ref().map(Arc::as_ptr);
        let zeros = || BoardZeros { unproven: self.distrusted().map(str::to_owned), hidden: self.hidden.clone() };
        (!same).then(zeros)
    }

    /// An operator asks for the boards to be configured, knowing what kept them from it.
    pub fn on_bring_up_asked(&mut self) {
        self.continuity.forget();
    }

    /// A force is felt at the zero that holds, and there is none: so that is what the boards are configured at.
    pub fn look_by_zero(&mut self) {
        self.looked = self.zero().map(<[TaxelBaseline]>::to_vec);
    }

    /// The boards are being configured, and take zeros of their own on a skin that was looked at, or that somebody vouches
    /// for. What was let pass when they were configured before still lies there as far as this look knows: the boards' zeros
    /// hide it from the look. `models` is the zero of the models in use, `unseen` why nobody knows what lay on the skin, if
    /// that is so: it is held against the zeros of the boards until there is another.
    pub fn on_bring_up(&mut self, models: Option<&[TaxelBaseline]>, unseen: Option<&'static str>) {
        self.configuring = true;
        self.unseen = unseen;
        self.hold_unseen();
        self.session = None;
        let earlier = self.hidden.take();
        self.hidden = self.looked.take().zip(models).map(|(looked, models)| {
            Arc::new(HiddenCounts::of(&looked, models, earlier.as_deref(), self.regions.modules()))
        });
        self.counted = self.hidden.clone();
    }

    /// A zero is used: the first one since the boards were configured tells what their zeros drew.
    pub fn settle_boards(&mut self, models: Option<&[TaxelBaseline]>) {
        let unsettled = self.hidden.as_ref().filter(|hidden| hidden.reads.is_empty());
        if let (Some(hidden), Some(models), Some(zero)) = (unsettled, models, self.baseline()) {
            self.hidden = Some(Arc::new(hidden.at(zero, models, self.regions.modules())));
        }
    }

    /// A session has taken its zero: what it makes is of the skin as the boards see it now.
    pub fn on_session_zero(&mut self, session: u64) {
        self.session = Some(session);
    }

    /// Models of a session are in use, if they came of one.
    pub(super) fn on_models_of(&mut self, session: Option<u64>) {
        if session.is_some() && session == self.session {
            (self.hidden, self.counted) = (None, None);
        }
    }

    pub(super) fn hold_unseen(&mut self) {
        self.unseen.iter().for_each(|why| self.continuity.distrust((*why).to_owned()));
    }

    /// What the zeros of the boards hide beside what the present zero does.
    #[must_use]
    pub const fn hidden(&self) -> Option<&Arc<HiddenCounts>> {
        self.counted.as_ref()
    }
}
