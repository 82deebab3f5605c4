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

    /// The boards are being configured, and take zeros of their own on a skin that was looked at.
    pub fn on_bring_up(&mut self) {
        self.configuring = true;
        self.configured_at = self.looked.take();
    }

    /// What the boards sent before they were configured and took zeros of their own, one per taxel, if that was looked at.
    #[must_use]
    pub fn before_bring_up(&self) -> Option<&[TaxelBaseline]> {
        self.configured_at.as_deref()
    }
}
