//! The zero while boards are configured, and what is held against them from one start of the daemon to the next: they take
//! zeros of their own.

use crate::baseline::TaxelBaseline;
use crate::zero::holder::Zero;

impl Zero {
    /// Before the daemon started it was found that the counts cannot show whether the skin is at rest.
    pub fn distrust(&mut self, why: String) {
        self.continuity.distrust(why);
    }

    /// Why the counts cannot show whether the skin is at rest; also after a restart.
    #[must_use]
    pub fn distrusted(&self) -> Option<&str> {
        self.continuity.unproven()
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
        let earlier = self.configured_at.take();
        self.configured_at = self.looked.take().map(|mut looked| {
            if let (Some(earlier), Some(models)) = (earlier, models) {
                for ((now, then), models) in looked.iter_mut().zip(earlier).zip(models) {
                    let hidden = then.mean - models.mean;
                    now.mean += if hidden.is_finite() { hidden } else { 0.0 };
                }
            }
            looked
        });
    }

    pub(super) fn hold_unseen(&mut self) {
        self.unseen.iter().for_each(|why| self.continuity.distrust((*why).to_owned()));
    }

    /// What the boards sent before they were configured and took zeros of their own, one per taxel, if that was looked at.
    #[must_use]
    pub fn before_bring_up(&self) -> Option<&[TaxelBaseline]> {
        self.configured_at.as_deref()
    }
}
