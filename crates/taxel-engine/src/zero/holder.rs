//! The one owner of the zero: takes it, follows it, loses it.
//!
//! Order of calls: [`Zero::watch`] when somebody wants a zero, [`Zero::on_scan`] for each scan, [`Zero::tick`] when time
//! passed, [`Zero::lose`] and [`Zero::suspect`] when something else says that it does not hold. [`Zero::zero`] is `None`
//! unless it holds.

use std::sync::Arc;
use std::time::Duration;
use taxel_skin::{Newton, Time};

use crate::baseline::TaxelBaseline;
use crate::force::owner::ZeroState;
use crate::force::reason::{Reason, ReasonCode, positions};
use crate::model_set::ModelSet;
use crate::now::Now;
use crate::plan::PatchPlan;
use crate::regions::Regions;
use crate::request::ErrorReason;
use crate::scan::Scan;
use crate::zero::events::{Surroundings, ZeroEvent};
use crate::zero::evidence::Evidence;
use crate::zero::ground::Ground;
use crate::zero::kept::{TakenZero, Unjudged};
use crate::zero::offset::Offset;
use crate::zero::rest::window::RestWindow;
use crate::zero::view::TareView;
use crate::zero::watch::{Findings, Purpose, Watch, Writing};

/// While it is not known whether a board took a new zero under its load.
const VANISHED: &str = "a whole board lost its load in one scan; checking whether it took a new zero (about 8 scans); until then \
                        nothing bounds the force above";

/// From when the boards are configured until the skin is shown to be unloaded, or loaded.
const CONFIGURED: &str = "the boards were configured and took a new zero, but nothing has shown yet that the skin was unloaded: unload it and tare";

/// Of a zero that the models in use have not judged.
const UNJUDGED: &str =
    "the zero was taken in a session without models to judge it by, and those in use are not of that session: tare";

/// Of a zero that other models judged than those that are in use since.
const OTHER_MODELS: &str = "another model set came into use: tare again";

/// Whether a patch has a zero. Why it has none is in its view.
#[derive(Debug)]
pub(super) enum Trust {
    /// None since the start: one is taken by itself, if it is proven.
    None,
    /// One that holds, unless it is in check.
    Held(Held),
    /// One was, and is lost: somebody has to want another.
    Lost,
}

/// A zero, as it was taken.
#[derive(Debug)]
pub(super) struct Held {
    /// One per taxel.
    pub(super) baseline: Vec<TaxelBaseline>,
    /// The same as it outlives the daemon.
    pub(super) kept: Arc<TakenZero>,
    /// Whether a board is suspect, as last reported.
    pub(super) in_check: bool,
    /// It is of before the start, and the counts have not shown yet that the boards still have theirs.
    pub(super) on_trial: bool,
}

/// The zero of one patch.
#[derive(Debug)]
pub struct Zero {
    pub(super) plan: Arc<PatchPlan>,
    pub(super) regions: Regions,
    pub(super) view: TareView,
    pub(super) trust: Trust,
    pub(super) watch: Option<Watch>,
    pub(super) writing: Option<Writing>,
    /// The zero that somebody confirmed since the boards took theirs.
    pub(super) confirmed: Option<Arc<[TaxelBaseline]>>,
    /// That no models were there to judge the zero of a first session, and what is in use since.
    pub(super) unjudged: Option<Unjudged>,
    /// Whether the boards were being configured when the last scan came, or are since.
    pub(super) configuring: bool,
    pub(super) evidence: Evidence,
    pub(super) offset: Offset,
    /// The last zero with its drift, or that of the models.
    pub(super) ground: Ground,
}

impl Zero {
    /// No zero.
    pub fn new(plan: Arc<PatchPlan>, regions: Regions) -> Self {
        Self {
            view: TareView::default(),
            trust: Trust::None,
            watch: None,
            writing: None,
            confirmed: None,
            unjudged: None,
            configuring: false,
            evidence: Evidence::new(&regions, &plan.patch),
            offset: Offset::new(plan.follow_drift, &regions),
            ground: Ground::new(&regions),
            plan,
            regions,
        }
    }

    /// The zero that is held, whether or not it is in check.
    pub(super) const fn held(&self) -> Option<&Held> {
        if let Trust::Held(held) = &self.trust { Some(held) } else { None }
    }

    /// Whether the boards still have it, as far as the counts show.
    pub fn holds(&self) -> bool {
        self.held().is_some_and(|held| !held.in_check)
    }

    /// The zero as it was taken, one per taxel, if there is one.
    pub fn baseline(&self) -> Option<&[TaxelBaseline]> {
        self.held().map(|held| held.baseline.as_slice())
    }

    /// The same without what has left the skin since, if it holds: what a load of that time would still hide in.
    pub fn as_taken(&self) -> Option<Vec<TaxelBaseline>> {
        let taken = self.baseline().filter(|_| self.holds())?;
        Some(self.offset.what_stays_of(taken, self.ground.signs()))
    }

    /// The zero with its drift, one per taxel, if it holds.
    pub fn zero(&self) -> Option<&[TaxelBaseline]> {
        self.holds().then_some(self.ground.zero())
    }

    /// The same for a live force, which needs one that the models in use are of, or have judged.
    pub fn in_force(&self) -> Option<&[TaxelBaseline]> {
        self.zero().filter(|_| !self.is_of_other_models())
    }

    fn is_of_other_models(&self) -> bool {
        self.unjudged.as_ref().is_some_and(Unjudged::is_of_other_models)
    }

    /// What readers see.
    pub fn view(&self) -> TareView {
        let mut view = self.view.clone();
        view.drift = *self.offset.view();
        if let Some(why) = self.evidence.suspicion().filter(|_| self.held().is_some_and(|held| held.in_check)) {
            view.invalidate(ReasonCode::ZeroInCheck, format!("{why}; this is being looked at"));
        } else if view.valid && self.is_of_other_models() {
            view.invalidate(ReasonCode::NotUnloaded, UNJUDGED);
        }
        view
    }

    /// Whether a zero waits for the disk.
    pub const fn is_being_written(&self) -> bool {
        self.writing.is_some()
    }

    /// Who wants a zero that is being watched for.
    pub fn watching(&self) -> Option<&Purpose> {
        self.watch.as_ref().map(|watch| &watch.purpose)
    }

    /// What a live force has to know of it.
    pub fn state(&self) -> ZeroState {
        let lacks = || {
            let view = self.view();
            Reason::new(view.code.unwrap_or(ReasonCode::ZeroNotTaken), view.reason)
        };
        ZeroState {
            lacks: self.in_force().is_none().then(lacks),
            sigma_counts: self.offset.sigma_counts(),
            missed_counts: self.evidence.missed_counts(),
            sigma: Newton(self.offset.sigma().0.hypot(self.evidence.missed_n())),
            hides: self.offset.hides(),
            shortcoming: self.offset.shortcoming(),
            load_vanished: self.load_vanished(),
        }
    }

    /// How far the zero lies towards load from that of the models, as far as that may be what the skin remembers of earlier
    /// loads, counts.
    pub fn residue_counts(&self) -> f64 {
        self.ground.residue_counts(self.offset.followed_counts())
    }

    /// That a load has just vanished from a whole board, if one has: nothing bounds a force above until the counts have shown that
    /// the board did not take a new zero.
    fn load_vanished(&self) -> Option<Reason> {
        let mut boards = self.evidence.unloaded().peekable();
        boards.peek()?;
        let taxels = boards.flat_map(|board| self.regions.boards()[board].clone());
        Some(Reason::about(positions(taxels), ReasonCode::LoadVanished, VANISHED))
    }

    pub(super) fn findings(&self) -> Findings {
        let vanished = self.evidence.unloaded().next().map(|_| VANISHED);
        [self.evidence.suspicion(), vanished, self.evidence.needs_confirmation()].map(|why| why.map(str::to_owned))
    }

    /// How much a count more of each taxel weighs, N, negative where counts fall with load; empty while nobody knows.
    pub fn weigh(&mut self, newton_per_count: &[f64]) {
        self.offset.weigh(newton_per_count);
        self.evidence.weigh(newton_per_count);
    }

    /// Begins to watch the skin. An earlier watch is given up, and its caller hears of it.
    pub fn watch(&mut self, now: Time, purpose: Purpose, events: &mut Vec<ZeroEvent>) {
        let why = "another tare began before this one had seen enough".to_owned();
        self.end_watch(ErrorReason::TareSuperseded, why, events);
        let window = RestWindow::new(self.regions.taxels(), self.regions.modules());
        self.watch = Some(Watch::new(now, self.plan.tare.duration, window, purpose));
    }

    /// Gives up the watch; who wanted it hears why.
    pub fn end_watch(&mut self, reason: ErrorReason, why: String, events: &mut Vec<ZeroEvent>) {
        events.extend(self.watch.take().map(|watch| ZeroEvent::Refused(watch.purpose, reason, why)));
    }

    /// Gives up the watch, if a session wanted it.
    pub fn end_watch_of_session(&mut self) {
        self.watch.take_if(|watch| matches!(watch.purpose, Purpose::Session { .. }));
    }

    /// The active model set changed: which way pressure moves the counts.
    pub fn on_models(&mut self, set: &ModelSet) {
        self.writing.iter_mut().for_each(|writing| writing.spoil(OTHER_MODELS));
        let taken = if let Trust::Held(held) = &self.trust { Some(held.baseline.as_slice()) } else { None };
        self.ground.set_models(set, taken);
        self.evidence.compare_with(&self.ground);
        self.on_rest_of_models(set);
        self.offset.restart();
    }

    /// Takes a scan.
    pub fn on_scan(&mut self, now: Now, scan: &Scan<'_>, around: Surroundings<'_>, events: &mut Vec<ZeroEvent>) {
        self.check_evidence(scan, &around, events);
        self.watch_rest(now, scan, around, events);
        self.follow_offset(scan, around.bag.session_open, events);
    }

    fn check_evidence(&mut self, scan: &Scan<'_>, around: &Surroundings<'_>, events: &mut Vec<ZeroEvent>) {
        let needs_confirmation = self.evidence.needs_confirmation().filter(|_| self.configuring).map(str::to_owned);
        let found = self.evidence.on_scan(scan, around.bag);
        if self.held().is_some()
            && let Some((board, why)) = found
        {
            self.confirmed = None;
            self.lose(ReasonCode::ZeroLost, why.clone(), events);
            events.push(ZeroEvent::BoardMoved { board, why });
            return;
        }
        self.tell_check(events);
        let configuring = std::mem::replace(&mut self.configuring, around.configuring);
        if configuring && self.held().is_none() {
            self.evidence.begin(true); // boards that were configured have taken zeros of their own
            needs_confirmation.into_iter().for_each(|why| self.evidence.require_confirmation(why));
            if !around.configuring && self.view.code == Some(ReasonCode::BoardsNotConfigured) {
                self.explain(ReasonCode::NotUnloaded, CONFIGURED.to_owned());
            }
        }
    }

    pub(super) fn tell_check(&mut self, events: &mut Vec<ZeroEvent>) {
        let Trust::Held(held) = &mut self.trust else { return };
        let in_check = self.evidence.suspicion().is_some();
        held.on_trial &= in_check;
        if in_check != std::mem::replace(&mut held.in_check, in_check) {
            events.push(if in_check { ZeroEvent::InCheck } else { ZeroEvent::Cleared });
        }
    }

    /// The offset takes a scan. A skin that becomes lighter than its zero was not at rest when that was taken: it is lost until
    /// another is taken.
    fn follow_offset(&mut self, scan: &Scan<'_>, session_open: bool, events: &mut Vec<ZeroEvent>) {
        let counts = !session_open && self.holds();
        let taken = if let Trust::Held(held) = &self.trust { Some(held.baseline.as_slice()) } else { None };
        let change = self.offset.on_scan(scan, counts, &self.ground, taken);
        if let Some(found) = change.lighter.filter(|_| self.holds() && self.watch.is_none()) {
            let found = found.lighter_in_words(|module| self.plan.patch.module_name(module));
            let why = "the zero was taken under a load, or is another; unload the skin and tare";
            self.lose(ReasonCode::ZeroLost, format!("{found}: {why}"), events);
        } else if change.moves
            && let Some(baseline) = self.baseline()
        {
            self.ground.follow(self.offset.applied_to(baseline, self.ground.signs()));
            self.evidence.compare_with(&self.ground);
            events.push(ZeroEvent::Moved);
        }
    }

    /// This zero is held from now on.
    pub(super) fn hold(&mut self, kept: Arc<TakenZero>) {
        let baseline = kept.baseline();
        if kept.confirmed {
            self.confirmed = Some(baseline.as_slice().into());
        }
        self.view = TareView::taken(kept.epoch, kept.wall_ns, kept.reason.clone(), kept.at_rest, &baseline);
        self.ground.take(&baseline);
        self.offset.begin(&kept.pads);
        self.evidence.begin(self.view.at_rest);
        self.evidence.compare_with(&self.ground);
        self.trust = Trust::Held(Held { baseline, kept, in_check: false, on_trial: false });
    }

    /// Time passed: a watch that gets no scans ends. `silence` says which modules are silent.
    pub fn tick(&mut self, now: Time, silence: impl FnOnce() -> String, events: &mut Vec<ZeroEvent>) {
        if self.watch.as_ref().is_some_and(|watch| now > watch.give_up_at()) {
            self.end_watch(ErrorReason::SkinSilent, format!("no rest could be watched: {}", silence()), events);
        }
    }

    /// When [`Zero::tick`] has something to do.
    pub fn deadline(&self) -> Option<Time> {
        self.watch.as_ref().map(|watch| watch.give_up_at() + Duration::from_nanos(1))
    }

    /// Why no zero was taken by itself, for readers; a valid one is left alone.
    pub fn explain(&mut self, code: ReasonCode, reason: String) {
        if self.held().is_none() {
            self.view.invalidate(code, reason);
        }
    }
}
