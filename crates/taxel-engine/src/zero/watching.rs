//! The zero while somebody watches the skin for one: what a watch takes in, and what follows from it.

use crate::baseline::with_noise_known;
use crate::model_set::ModelSet;
use crate::now::Now;
use crate::request::ErrorReason;
use crate::scan::Scan;
use crate::zero::events::{Surroundings, ZeroEvent};
use crate::zero::holder::{Models, Unjudged, Zero};
use crate::zero::proven::Proven;
use crate::zero::rest::judge::{Reference, judge};
use crate::zero::rest::verdict::RestVerdict;
use crate::zero::view::TareView;
use crate::zero::watch::{Purpose, Watch};

impl Zero {
    pub(super) fn watch_rest(
        &mut self,
        now: Now,
        scan: &Scan<'_>,
        around: Surroundings<'_>,
        events: &mut Vec<ZeroEvent>,
    ) {
        let by_itself = self.plan.tare.at_start && self.baseline.is_none() && around.models.is_some();
        // A zero that waits for the disk is somebody's, and comes first.
        if by_itself && self.watch.is_none() && self.proven.is_none() && around.boards_ready {
            self.watch(now.time, Purpose::AtStart, events);
        }
        let Some(watch) = &mut self.watch else { return };
        // A session needs every module. A live zero does without the silent ones: they have none, and no force.
        let for_session = matches!(watch.purpose(), Purpose::Session { .. });
        if for_session && (around.no_rest || (!scan.whole && !around.parts_left_out)) {
            return;
        }
        watch.push(now.time, scan.sound_counts(), scan.faulty_counts());
        if watch.is_over(now.time, self.plan.tare.rest.scans_min)
            && let Some(watch) = self.watch.take()
        {
            self.conclude(now, watch, around.models, events);
        }
    }

    /// The watch has seen enough: rest is proven, vouched for, or refused.
    fn conclude(&mut self, now: Now, watch: Watch, models: Option<&ModelSet>, events: &mut Vec<ZeroEvent>) {
        let (purpose, window) = watch.end();
        // Models without a rest of their own have nothing to compare with.
        let models = models.filter(|set| set.knows_rest());
        let minutes = now.time.seconds_since(self.taken) / 60.0;
        let reference = Reference {
            models: models.map(|set| set.baseline.as_slice()),
            zero: self.zero().map(|zero| (zero, minutes)),
            sign: self.ground.signs(),
        };
        let verdict = judge(&window, reference, &self.plan.tare.rest);
        let told = || verdict.told(|module| self.plan.module_name(module));
        // In its first session a skin has nothing to be compared with: its zero is what the models refer to, and the
        // gauge shows that the bag does not press. Whatever is held against the boards, the models are of them as they are; other
        // models are not, and what is held against the boards is held against them.
        let first = matches!((&verdict, &purpose), (RestVerdict::Unproven { .. }, Purpose::Session { .. }));
        let rest = first || matches!(verdict, RestVerdict::Rest { .. });
        // Nobody can vouch for a skin that moved while it was watched: a mean over that is no zero.
        let vouched = purpose.confirmed_by().filter(|_| verdict.is_still());
        let held = || self.held_over_restarts().map(str::to_owned);
        let unjudged = first.then(|| Unjudged { held: held(), models: Models::None, own: None });
        let held = self.evidence.unproven().filter(|_| !first);
        if vouched.is_none() && (!rest || held.is_some()) {
            let (reason, why) = match held {
                Some(why) => (ErrorReason::TareUnproven, why.to_owned()),
                None => (verdict.refusal(), told()),
            };
            events.push(ZeroEvent::Refused(purpose, reason, why));
            return;
        }
        let reason = match vouched {
            Some(who) => format!("{who} confirms that nothing touches the skin; {}", told()),
            None => told(),
        };
        let baseline = with_noise_known(window.steady_baseline(), models.map_or(&[], |set| &set.baseline));
        let view = TareView::taken(self.view.epoch + 1, now.wall_ns, reason, rest, &baseline);
        if let Purpose::Operator { request, .. } = purpose {
            let (vouched, known) = (vouched.is_some(), self.held_against());
            self.proven = Some(Proven::new(request, view.clone(), baseline.clone(), vouched, known));
            events.push(ZeroEvent::Proven { request, view, baseline });
        } else {
            self.proven = None; // of an earlier moment
            if vouched.is_some() {
                self.on_vouched(&baseline);
            } else if unjudged.is_some() {
                self.unjudged = unjudged;
            } else {
                self.unjudged.take_if(|unjudged| unjudged.models == Models::Others); // these have judged this one
            }
            self.take(now.time, view, baseline);
            events.push(ZeroEvent::Taken(purpose));
        }
    }
}
