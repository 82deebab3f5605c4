//! A session whose pressure somebody types, plateau by plateau.

use std::sync::Arc;
use taxel_skin::{Kilopascal, Time};

use super::{Progress, SessionEvent, SessionRun};
use crate::calibration::plateau::{PLATEAU_PATIENCE, PLATEAUS_MIN};

impl SessionRun {
    /// The dial shows `kpa`, and the skin has settled there. New samples go to `events`.
    ///
    /// # Errors
    /// Why it is no plateau, in words.
    pub fn take_plateau(&mut self, now: Time, kpa: f64, events: &mut Vec<SessionEvent>) -> Result<Progress, String> {
        let Some(plateaus) = &mut self.plateaus else {
            return Err("a gauge says the pressure of this patch: nothing is typed".to_owned());
        };
        let is_first = plateaus.last_kpa().is_none();
        let scans = plateaus.take(now, kpa, &self.limits)?;
        if let (true, Some(ramp)) = (is_first, Arc::make_mut(&mut self.samples).ramps.last_mut()) {
            ramp.gauge_kpa = Some(kpa); // what the dial shows of the vented bag
            events.push(SessionEvent::Ramp(ramp.clone()));
        }
        let reached = kpa - self.gauge_zero_kpa();
        (0..reached.max(0.0) as usize).for_each(|step| self.cover(step as f64));
        for scan in scans {
            if !self.accept(scan, Kilopascal(kpa), events) {
                return Ok(Progress::RampEnded);
            }
        }
        self.view.reason.clear();
        let ends = reached >= self.limits.target.0 && self.has_enough();
        Ok(if ends { Progress::RampEnded } else { Progress::On })
    }

    /// Watches the skin until somebody types what the dial shows; nobody needs for ever.
    pub(super) fn wait_for_plateau(&mut self, now: Time) -> Progress {
        let waiting = std::mem::take(&mut self.pending);
        let Some(plateaus) = &mut self.plateaus else { return Progress::On };
        waiting.into_iter().for_each(|scan| plateaus.push(scan));
        if now.since(plateaus.since()) <= PLATEAU_PATIENCE {
            return Progress::On;
        }
        let minutes = PLATEAU_PATIENCE.as_secs() / 60;
        self.view.reason = format!("nothing was typed for {minutes} minutes");
        if self.has_enough() { Progress::RampEnded } else { Progress::Failed }
    }

    /// Refuses to fit plateaus that are too few to draw a curve through.
    ///
    /// # Errors
    /// How many there are, and what to do.
    pub fn check_plateaus(&self) -> Result<(), String> {
        let taken = self.samples.plateaus();
        if self.plateaus.is_none() || taken >= PLATEAUS_MIN {
            return Ok(());
        }
        let number = self.view.number;
        Err(format!(
            "{taken} plateaus above the vented bag, and {PLATEAUS_MIN} make a calibration: type more, or, to begin another ramp: \
             taxeld sessions end {number}, then taxeld calibrate --session {number}"
        ))
    }
}
