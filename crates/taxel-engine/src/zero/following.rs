//! The zero follows the temperature, and says what may have gone into it meanwhile.

use taxel_skin::Newton;

use crate::baseline::TaxelBaseline;
use crate::force::reason::Reason;
use crate::now::Now;
use crate::scan::Scan;
use crate::zero::drift::follow::Drift;
use crate::zero::events::ZeroEvent;
use crate::zero::holder::Zero;

impl Zero {
    /// How much of a load that lies on the whole patch may have gone into the zero since it was taken: what it followed of
    /// what the thermal pads do not explain.
    #[must_use]
    pub fn absorbed(&self) -> Newton {
        self.drift.as_ref().filter(|_| self.view.valid).map_or(Newton(0.0), |drift| drift.view().absorbed)
    }

    /// How much a count more of each taxel weighs, N, negative where counts fall with load; empty while nobody knows.
    pub fn weigh(&mut self, newton_per_count: impl FnOnce() -> Vec<f64>) {
        if let Some(drift) = &mut self.drift {
            drift.weigh(&newton_per_count());
        }
    }

    /// The zero as it was taken, with what the skin has recovered since and without drift, if it holds: what a load of that
    /// time would still hide in.
    #[must_use]
    pub fn without_drift(&self) -> Option<Vec<TaxelBaseline>> {
        let taken = self.baseline.as_ref().filter(|_| self.holds())?;
        Some(self.memory.applied_to(taken, self.ground.signs()))
    }

    /// What keeps a force at this zero from being a good one.
    #[must_use]
    pub fn shortcoming(&self) -> Option<Reason> {
        self.drift.as_ref().and_then(Drift::shortcoming)
    }

    /// The zero follows the temperature, where that is asked for and no session holds the patch.
    pub(super) fn follow_drift(&mut self, now: Now, scan: &Scan<'_>, session_open: bool, events: &mut Vec<ZeroEvent>) {
        let Some(drift) = self.drift.as_mut().filter(|_| self.view.valid) else { return };
        let pads = |module: usize| (!scan.silent[module]).then_some(scan.pads[module]);
        let now = Now { time: scan.time, ..now };
        let moved = if session_open || self.doubted {
            drift.hold(now, pads);
            false
        } else {
            drift.on_scan(now, scan.counts, pads, |taxel| scan.sound[taxel])
        };
        self.view.drift = *drift.view();
        if moved {
            self.renew_zero(events);
        }
    }

    /// The zero as it was taken, with its drift and what the skin has recovered since.
    pub(super) fn renew_zero(&mut self, events: &mut Vec<ZeroEvent>) {
        let Some(baseline) = &self.baseline else { return };
        let drifted = self.drift.as_ref().map(|drift| drift.applied_to(baseline));
        let zero = self.memory.applied_to(drifted.as_ref().unwrap_or(baseline), self.ground.signs());
        self.ground.follow(zero);
        self.continuity.compare_with(&self.ground);
        events.push(ZeroEvent::Moved);
    }
}
