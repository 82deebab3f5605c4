//! The zero while somebody watches the skin for one: what a watch takes in, and what follows from it.

use std::sync::Arc;

use crate::baseline::with_noise_known;
use crate::model_set::ModelSet;
use crate::now::Now;
use crate::request::{ErrorReason, RequestId};
use crate::scan::Scan;
use crate::zero::events::{Surroundings, ZeroEvent};
use crate::zero::holder::{Trust, Zero};
use crate::zero::kept::{TakenZero, Unjudged};
use crate::zero::rest::judge::{Reference, judge};
use crate::zero::rest::verdict::RestVerdict;
use crate::zero::view::TareView;
use crate::zero::watch::{Purpose, Watch, Writing};

impl Zero {
    pub(super) fn watch_rest(
        &mut self,
        now: Now,
        scan: &Scan<'_>,
        around: Surroundings<'_>,
        events: &mut Vec<ZeroEvent>,
    ) {
        let by_itself = self.plan.tare.at_start && matches!(self.trust, Trust::None) && around.models.is_some();
        // A zero that waits for the disk is somebody's, and comes first.
        if by_itself && self.watch.is_none() && self.writing.is_none() && around.boards_ready {
            self.watch(now.time, Purpose::AtStart, events);
        }
        let Some(watch) = &mut self.watch else { return };
        // A session needs every module. A live zero does without the silent ones: they have none, and no force.
        let for_session = matches!(watch.purpose, Purpose::Session { .. });
        if for_session && (around.no_rest || (!scan.whole && !around.parts_left_out)) {
            return;
        }
        watch.push(now.time, scan);
        if let Some(watch) = self.watch.take_if(|watch| watch.is_over(now.time)) {
            self.conclude(now, watch, around.models, events);
        }
    }

    /// The watch has seen enough: rest is proven, confirmed, or refused.
    fn conclude(&mut self, now: Now, watch: Watch, models: Option<&ModelSet>, events: &mut Vec<ZeroEvent>) {
        let Watch { purpose, window, .. } = watch;
        // Models without a rest of their own have nothing to compare with.
        let models = models.filter(|set| set.knows_rest());
        let reference = Reference {
            models: models.map(|set| set.baseline.as_slice()),
            zero: self.zero(),
            sign: self.ground.signs(),
        };
        let verdict = judge(&window, reference);
        // In its first session a skin has nothing to be compared with: its zero is what the models refer to, and the
        // gauge shows that the bag does not press. Whatever was found of the boards, the models are of them as they are. With other
        // models the zero needs confirmation.
        let first = matches!((&verdict, &purpose), (RestVerdict::Unproven { .. }, Purpose::Session { .. }));
        let rest = first || verdict.is_rest();
        let words = verdict.in_words(|module| self.plan.patch.module_name(module));
        // Nobody can confirm a skin that moved while it was watched: a mean over that is no zero.
        let confirmed = purpose.confirmed_by().filter(|_| verdict.is_still());
        let needed = self.needs_confirmation().filter(|_| !first);
        if confirmed.is_none() && (!rest || needed.is_some()) {
            // Who confirmed already hears what else keeps the zero away.
            let needed = needed.filter(|_| purpose.confirmed_by().is_none());
            let refused = needed.map(|why| (ErrorReason::TareUnproven, why.to_owned()));
            let (reason, why) = refused.unwrap_or((verdict.refusal(), words));
            events.push(ZeroEvent::Refused(purpose, reason, why));
            return;
        }
        let reason = match confirmed {
            Some(who) => format!("{who} confirms that nothing touches the skin; {words}"),
            None => words,
        };
        let confirmed = confirmed.is_some();
        let baseline = with_noise_known(window.steady_baseline(), models.map_or(&[], |set| &set.baseline));
        let zero = Arc::new(TakenZero {
            epoch: self.view.epoch + 1,
            at_rest: rest,
            wall_ns: now.wall_ns,
            reason,
            confirmed: confirmed || self.is_confirmed(&baseline),
            mean: baseline.iter().map(|taxel| taxel.mean).collect(),
            noise: baseline.iter().map(|taxel| taxel.noise).collect(),
            pads: self.offset.pads(),
        });
        if let Purpose::Operator { request, .. } = purpose {
            let findings = self.findings();
            self.writing = Some(Writing { request, findings, confirmed, zero: Ok(Arc::clone(&zero)) });
            events.push(ZeroEvent::Proven { request, zero });
        } else {
            self.writing = None; // of an earlier moment
            if first && !confirmed {
                let why = self.needs_confirmation_later().map(str::to_owned);
                self.unjudged = Some(Unjudged::after(self.unjudged.take(), why));
            }
            self.take(zero, confirmed, !first);
            events.push(ZeroEvent::Taken(purpose));
        }
    }

    /// The zero that was proven for `request` is on disk: it holds from now on.
    ///
    /// # Errors
    /// What has moved the zero meanwhile, in words.
    pub fn adopt(&mut self, request: RequestId) -> Result<TareView, String> {
        let writing = self.writing.take_if(|writing| writing.request == request).ok_or("a newer zero was taken")?;
        let zero = writing.zero?;
        // What was found of the boards since they were watched would be forgotten with this zero.
        let mut findings = self.findings().into_iter().zip(writing.findings);
        if let Some((Some(why), _)) = findings.find(|(now, then)| now.is_some() && now != then) {
            return Err(why);
        }
        self.take(zero, writing.confirmed, true);
        Ok(self.view.clone())
    }

    /// The zero that was proven for `request` could not be written down: the earlier one stays.
    pub fn reject(&mut self, request: RequestId) {
        self.writing.take_if(|writing| writing.request == request);
    }

    /// A zero holds from now on that somebody confirmed, or models have `judged`. Until a board takes another, what a zero may hide
    /// is judged from one that somebody confirmed, too.
    fn take(&mut self, zero: Arc<TakenZero>, confirmed: bool, judged: bool) {
        self.unjudged.take_if(|unjudged| confirmed || (judged && unjudged.is_of_other_models()));
        self.hold(zero);
    }
}
