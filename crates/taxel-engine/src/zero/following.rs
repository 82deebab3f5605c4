//! The zero follows its offset, and says what may have gone into it meanwhile.

use taxel_skin::Newton;

use crate::baseline::TaxelBaseline;
use crate::force::reason::{Reason, ReasonCode};
use crate::scan::Scan;
use crate::zero::events::ZeroEvent;
use crate::zero::holder::Zero;

impl Zero {
    /// How much of a load that lies on the whole patch may have gone into the zero since it was taken: what was taken of a
    /// heavier skin for an offset.
    #[must_use]
    pub fn absorbed(&self) -> Newton {
        if self.view.valid { self.offset.view().absorbed } else { Newton(0.0) }
    }

    /// How much a count more of each taxel weighs, N, negative where counts fall with load; empty while nobody knows.
    pub fn weigh(&mut self, newton_per_count: impl FnOnce() -> Vec<f64>) {
        self.offset.weigh(&newton_per_count());
    }

    /// The zero as it was taken, if it holds: what a load of that time would still hide in.
    #[must_use]
    pub fn as_taken(&self) -> Option<Vec<TaxelBaseline>> {
        self.baseline.clone().filter(|_| self.holds())
    }

    /// What keeps a force at this zero from being a good one.
    #[must_use]
    pub fn shortcoming(&self) -> Option<Reason> {
        self.offset.shortcoming()
    }

    /// The offset takes a scan. A skin that becomes lighter than its zero was not at rest when that was taken: it is lost until
    /// another is taken.
    pub(super) fn follow_offset(&mut self, scan: &Scan<'_>, session_open: bool, events: &mut Vec<ZeroEvent>) {
        let counts = !session_open && self.holds();
        let taken = self.baseline.as_deref().filter(|_| self.view.valid);
        let limits = (self.regions.modules(), &self.plan.tare.rest);
        let told = self.offset.on_scan(scan, counts, (&self.ground, taken), limits);
        self.view.drift = *self.offset.view();
        if let Some(found) = told.lighter.filter(|_| self.holds() && self.watch.is_none()) {
            let found = found.told(|module| self.plan.module_name(module));
            let why = "the zero was taken under a load, or is another; unload the skin and tare";
            self.lose(ReasonCode::ZeroLost, format!("{found}: {why}"), events);
        } else if told.moves {
            self.renew_zero(events);
        }
    }

    fn renew_zero(&mut self, events: &mut Vec<ZeroEvent>) {
        let Some(baseline) = &self.baseline else { return };
        self.ground.follow(self.offset.applied_to(baseline, self.ground.signs()));
        self.evidence.compare_with(&self.ground);
        events.push(ZeroEvent::Moved);
    }
}
