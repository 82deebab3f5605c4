//! The table of time: what a pass does to a zero that is waited for, and to the open session.

use taxel_engine::calibration::SessionState as S;

use super::state::{Model, Pending, Since};
use super::step::{Disk, PASS_S, PATIENCE_S, PROBATION_S, Passing, RISE_KPA, Step, TARGET_KPA, TOP_KPA};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rises {
    /// Beyond all pressure of the ramp.
    Further,
    /// To what the ramp has had.
    Again,
    No,
}

impl Model {
    /// Whether the table knows what comes of a step. What it cannot know is where a patience ends within a pass.
    pub fn knows(&self, step: Step) -> bool {
        let Step::Pass(how) = step else { return self.makes_sense(step) };
        if how == Passing::Rise && self.kpa + RISE_KPA > TOP_KPA {
            return false;
        }
        if how == Passing::ModuleSilent && self.tare.is_some() {
            return false; // half a skin may be at rest
        }
        if self.just_trusted && how != Passing::Hold {
            return false; // whether the watch that goes on ends before that
        }
        let zero_waits = self.pending.iter().any(|pending| matches!(pending, Pending::Zero { good: true, .. }));
        if how == Passing::Vent && self.kpa > 0 && zero_waits {
            return false; // whether so much vanishes at once that the zero counts as lost before it is on disk
        }
        match self.open() {
            // Without a gauge nobody sees that the bag presses.
            Some((_, S::Taring)) if self.kpa > 0 && how == Passing::GaugeSilent => false,
            // The vent itself spoils the last zero that there is patience for.
            Some((_, S::Taring)) if self.kpa > 0 && how == Passing::Vent => {
                self.idle_s.1 + f64::from(PASS_S) < PATIENCE_S
            }
            Some((_, S::Taring)) => {
                !matches!(how, Passing::ModuleSilent | Passing::GaugeSilent)
                    || self.presses()
                    || self.idle_s.1 + f64::from(PASS_S) < PATIENCE_S
            }
            Some((_, S::Ramping)) => {
                let ((least, most), limit, pass) = (self.idle_s, PATIENCE_S + PROBATION_S, f64::from(PASS_S));
                match self.rises(how) {
                    Rises::Further => most + 2.3 < limit,
                    Rises::Again => most + pass < limit - 0.3,
                    Rises::No => most + pass < limit - 0.3 || least + pass > limit + 0.2,
                }
            }
            _ => true,
        }
    }

    fn makes_sense(&self, step: Step) -> bool {
        match step {
            Step::FitEnds { fit, .. } => self.fits.get(fit).is_some_and(|fit| fit.out),
            Step::DiskSlow => self.disk == Disk::Fast,
            Step::DiskWrites | Step::DiskFast => self.disk == Disk::Slow,
            Step::DiskFails => self.disk != Disk::Failed,
            // Of a module that was silent while its board took a zero, what it read before is of another one.
            Step::BusOff => self.whole,
            // Whether a load is felt depends on the zero, which is not in the table.
            Step::BringUp if self.falsely_confirmed => false,
            Step::BringUp => self.kpa == 0 || self.presses() || self.open().is_some(),
            _ => true,
        }
    }

    fn rises(&self, how: Passing) -> Rises {
        match how {
            Passing::Rise if self.kpa >= self.reached_kpa => Rises::Further,
            Passing::Rise if self.kpa + RISE_KPA >= self.reached_kpa => Rises::Again,
            _ => Rises::No,
        }
    }

    /// Lets time pass.
    pub(super) fn pass(&mut self, how: Passing) {
        let (before, rises) = (self.kpa, self.rises(how));
        match how {
            Passing::Rise => self.kpa += RISE_KPA,
            Passing::Vent => self.kpa = 0,
            _ => {}
        }
        (self.heard, self.just_trusted) = (true, false);
        self.whole |= how != Passing::ModuleSilent;
        self.gauge_fresh = how != Passing::GaugeSilent;
        self.boards_ready = true;
        let still = before == self.kpa;
        if let Some((request, confirmed)) = self.tare.take() {
            let proven = self.live.active.is_some() && self.kpa == 0 && !self.unseen;
            if still && (confirmed || proven) && self.disk != Disk::Failed {
                self.void_zeros();
                self.falsely_confirmed |= confirmed && self.kpa > 0;
                self.pending.push(Pending::Zero { request, good: true, confirmed });
            } else {
                self.settle(request, false);
            }
        }
        match self.open() {
            Some((number, S::Taring)) => self.pass_taring(number, how),
            Some((number, S::Ramping)) => self.pass_ramping(number, rises),
            _ => {}
        }
    }

    fn pass_taring(&mut self, number: u64, how: Passing) {
        // A ramp begins at the zero of skin and gauge, which nobody can prove for boards that were configured unseen. But
        // the first session of a skin need not.
        let provable = !self.unseen || self.live.active.is_none();
        if provable && self.kpa == 0 && !matches!(how, Passing::ModuleSilent | Passing::GaugeSilent) {
            self.void_zeros();
            // Sessions from before the boards lost their zero say nothing of the one they have now.
            if self.unseen && self.unjudged.replace(Since::Nothing).is_none() {
                self.begun.clear();
            }
            self.unseen = false;
            self.zeros += 1;
            self.begun.insert(self.zeros);
            self.rests.insert(number, self.zeros);
            self.recorded.ramped.insert(number);
            self.enter(number, S::Ramping);
            (self.idle_s, self.reached_kpa) = ((0.6, 3.0), 0);
            return;
        }
        self.idle_s.0 += f64::from(PASS_S);
        self.idle_s.1 += f64::from(PASS_S);
        if self.idle_s.1 > PATIENCE_S {
            self.enter(number, S::Failed);
        }
    }

    fn pass_ramping(&mut self, number: u64, rises: Rises) {
        let pass = f64::from(PASS_S);
        match rises {
            Rises::Further => {
                self.grew = true;
                // The rate is that of the last second: samples enter for a while after the rise.
                (self.idle_s, self.reached_kpa) = ((-1.0, 0.1), self.kpa);
                if self.kpa > TARGET_KPA {
                    self.fit(number);
                }
            }
            Rises::Again => self.idle_s = (-1.0, self.idle_s.1 + pass),
            Rises::No => {
                self.idle_s.0 += pass;
                self.idle_s.1 += pass;
                if self.idle_s.0 > PATIENCE_S + PROBATION_S {
                    self.enter(number, S::Failed);
                }
            }
        }
    }
}
