//! A session whose pressure somebody types, plateau by plateau.

use std::sync::Arc;
use taxel_skin::Kilopascal;

use super::{SessionEvent, SessionRun};
use crate::calibration::plateau::{PLATEAU_PATIENCE, PLATEAUS_MIN};
use crate::now::Now;
use crate::request::{ErrorReason, Rejection};

impl SessionRun {
    /// The dial shows `kpa`, and the skin has settled there.
    ///
    /// # Errors
    /// [`Rejection`] if no ramp is under way, or why it is no plateau.
    pub fn take_plateau(&mut self, now: Now, kpa: f64) -> Result<(), Rejection> {
        let refused = |why: String| ErrorReason::SessionWrongState.because(why);
        if !self.is_ramping() {
            return Err(refused("no ramp is under way: taxeld calibrate".to_owned()));
        }
        let not_typed = || refused("a gauge says the pressure of this patch: nothing is typed".to_owned());
        let plateaus = self.plateaus.as_mut().ok_or_else(not_typed)?;
        let is_first = plateaus.last_kpa().is_none();
        let scans = plateaus.take(now.time, kpa, &self.limits).map_err(refused)?;
        if let (true, Some(ramp)) = (is_first, Arc::make_mut(&mut self.samples).ramps.last_mut()) {
            ramp.gauge_kpa = Some(kpa); // what the dial shows of the vented bag
            self.events.push(SessionEvent::Ramp(ramp.clone()));
        }
        let reached = kpa - self.gauge_zero_kpa();
        (0..reached.max(0.0) as usize).for_each(|step| self.cover(step as f64));
        let is_full = !scans.into_iter().all(|scan| self.accept(scan, Kilopascal(kpa)));
        if is_full || reached >= self.limits.target.0 && self.has_enough() {
            self.view.reason.clear();
            self.fit(now);
        } else {
            self.events.push(SessionEvent::Changed);
        }
        Ok(())
    }

    /// Watches the skin until somebody types what the dial shows; nobody needs for ever.
    pub(super) fn wait_for_plateau(&mut self, now: Now, silence: impl FnOnce() -> String) {
        let waiting = std::mem::take(&mut self.pending);
        let Some(plateaus) = &mut self.plateaus else { return };
        waiting.into_iter().for_each(|scan| plateaus.push(scan));
        if now.time.since(plateaus.since) <= PLATEAU_PATIENCE {
            return;
        }
        let why = format!("nothing was typed for {} minutes", PLATEAU_PATIENCE.as_secs() / 60);
        if self.has_enough() {
            self.view.reason = why;
            self.fit(now);
        } else {
            self.fail(now, why, silence);
        }
    }

    /// Refuses to fit plateaus that are too few to draw a curve through.
    ///
    /// # Errors
    /// How many there are, and what to do.
    pub(super) fn check_plateaus(&self) -> Result<(), Rejection> {
        let (taken, number) = (self.samples.plateaus(), self.view.number);
        ErrorReason::SessionWrongState.unless(self.plateaus.is_none() || taken >= PLATEAUS_MIN, || {
            format!(
                "{taken} plateaus above the vented bag, and {PLATEAUS_MIN} make a calibration: type more, or, to begin anew: \
                 taxeld sessions end {number}, then taxeld calibrate"
            )
        })
    }
}
