//! The one owner of the zero: takes it, follows it, loses it.
//!
//! Order of calls: [`Zero::watch`] when somebody wants a zero, [`Zero::on_scan`] for each scan, [`Zero::tick`] when time
//! passed, [`Zero::lose`] and [`Zero::doubt`] when something else says that it does not hold. [`Zero::zero`] is `None`
//! unless it holds.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;
use taxel_skin::Time;

use crate::baseline::TaxelBaseline;
use crate::force::reason::{Reason, ReasonCode, positions};
use crate::model_set::ModelSet;
use crate::now::Now;
use crate::regions::Regions;
use crate::request::{ErrorReason, RequestId};
use crate::scan::Scan;
use crate::zero::events::{Surroundings, ZeroEvent};
use crate::zero::evidence::{Evidence, Finding, UNSEEN_COUNTS};
use crate::zero::ground::Ground;
use crate::zero::kept::TakenZero;
use crate::zero::offset::Offset;
use crate::zero::plan::ZeroPlan;
use crate::zero::proven::{Known, Proven};
use crate::zero::residue::Memory;
use crate::zero::rest::window::RestWindow;
use crate::zero::view::TareView;
use crate::zero::watch::{Purpose, Watch};

/// What is said while it is not known whether a board took a new zero under its load.
const VANISHED: &str =
    "a load vanished from a whole board at once, and whether the board took a new zero is being looked at";

/// What is said from when the boards are configured until rest is proven, or shown not to be.
const CONFIGURED: &str = "the boards were configured, which took their zero anew, and no rest has been proven since: unload the skin and tare";

/// A zero that no models were there to judge.
#[derive(Clone, Debug)]
pub(super) struct Unjudged {
    /// What was held against the boards when it was taken. It is again once the models are others than those of the session.
    pub(super) held: Option<String>,
    pub(super) models: Models,
    /// Of the models of that session those that were in use last, perhaps before the daemon started.
    pub(super) own: Option<OwnModels>,
}

/// Models of the boards as they are, and all of the same rest.
#[derive(Clone, Debug)]
pub(super) struct OwnModels {
    pub(super) id: String,
    /// One per taxel; empty until they are in use.
    pub(super) rest: Vec<TaxelBaseline>,
}

/// Whether two sets of models refer to one zero, to the bit.
pub(super) fn have_same_rest(a: &[TaxelBaseline], b: &[TaxelBaseline]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.mean.to_bits() == b.mean.to_bits())
}

impl Unjudged {
    /// Whether this set was made in the session, or by known loads of one that was.
    pub(super) fn owns(&self, set: &ModelSet) -> bool {
        self.own.as_ref().is_some_and(|own| own.id == set.id || have_same_rest(&own.rest, &set.baseline))
    }
}

/// Which models are in use at a zero that none have judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Models {
    /// None.
    None,
    /// Those of a session, which are of the boards as they are.
    OfSession,
    /// Others. The ramp that it was taken for goes on, but there is no force.
    Others,
}

/// What is said of a zero that the models in use have not judged.
const UNJUDGED: &str =
    "the zero was taken in a session without models to judge it by, and those in use are not of that session: tare";

/// What is said of a zero that other models judged than those that are in use since.
const OTHER_MODELS: &str = "another model set came into use: tare again";

/// The zero of one patch.
#[derive(Debug)]
pub struct Zero {
    pub(super) plan: ZeroPlan,
    pub(super) regions: Regions,
    pub(super) view: TareView,
    pub(super) baseline: Option<Vec<TaxelBaseline>>,
    pub(super) taken: Time,
    pub(super) proven: Option<Proven>,
    pub(super) watch: Option<Watch>,
    pub(super) offset: Offset,
    pub(super) evidence: Evidence,
    /// Whether the zero of a board is in doubt, as last told.
    pub(super) doubted: bool,
    /// Whether the boards were being configured when the last scan came, or are since.
    pub(super) configuring: bool,
    /// The last zero as it was taken, which outlives the daemon.
    pub(super) kept: Option<Arc<TakenZero>>,
    /// It is of before the start, and the counts have not shown yet that the boards still have theirs.
    pub(super) on_trial: bool,
    /// The zero that somebody vouched for since the boards took theirs.
    pub(super) vouched: Option<Arc<[TaxelBaseline]>>,
    /// The zeros that sessions have taken since then, the newest last.
    pub(super) session_rests: VecDeque<Vec<TaxelBaseline>>,
    /// Why nobody knows what lay on the skin then.
    pub(super) unseen: Option<String>,
    /// That no models were there to judge the zero of a first session, and what is in use since.
    pub(super) unjudged: Option<Unjudged>,
    /// The last zero with its drift, or that of the models.
    pub(super) ground: Ground,
    /// What the skin remembers of earlier loads.
    pub(super) memory: Memory,
}

impl Zero {
    /// No zero.
    #[must_use]
    pub fn new(plan: ZeroPlan, regions: Regions) -> Self {
        let offset = Offset::new(plan.drift, &regions, plan.sites.clone());
        Self {
            view: TareView::default(),
            baseline: None,
            taken: Time::default(),
            proven: None,
            watch: None,
            offset,
            evidence: Evidence::new(&regions, &plan.board_names),
            doubted: false,
            configuring: false,
            kept: None,
            on_trial: false,
            vouched: None,
            session_rests: VecDeque::new(),
            unseen: None,
            unjudged: None,
            ground: Ground::new(&regions, plan.activation),
            memory: Memory::default(),
            plan,
            regions,
        }
    }

    /// The zero with its drift, one per taxel, if it holds.
    #[must_use]
    pub fn zero(&self) -> Option<&[TaxelBaseline]> {
        self.holds().then_some(self.ground.zero())
    }

    /// The same for a live force, which needs one that the models in use are of, or have judged.
    #[must_use]
    pub fn in_force(&self) -> Option<&[TaxelBaseline]> {
        self.zero().filter(|_| !self.is_of_other_models())
    }

    fn is_of_other_models(&self) -> bool {
        self.unjudged.as_ref().is_some_and(|unjudged| unjudged.models == Models::Others)
    }

    /// Whether the boards still have it, as far as the counts show.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.view.valid && !self.doubted
    }

    /// What readers see.
    #[must_use]
    pub fn view(&self) -> TareView {
        let mut view = self.view.clone();
        if let Some(why) = self.evidence.doubted().filter(|_| self.doubted) {
            view.valid = false;
            view.reason = format!("{why}; this is being looked at");
            view.code = Some(ReasonCode::ZeroDoubted);
        } else if view.valid && self.is_of_other_models() {
            view.valid = false;
            view.reason = UNJUDGED.to_owned();
            view.code = Some(ReasonCode::RestNotProven);
        }
        view
    }

    /// Why there is no zero, in words.
    #[must_use]
    pub fn reason(&self) -> String {
        self.view().reason
    }

    /// Why there is none, if there is none.
    #[must_use]
    pub fn lacks(&self) -> Option<Reason> {
        if self.in_force().is_some() {
            return None;
        }
        let view = self.view();
        Some(Reason::new(view.code.unwrap_or(ReasonCode::ZeroNotTaken), view.reason))
    }

    /// Who wants a zero that is being watched for.
    #[must_use]
    pub fn watching(&self) -> Option<&Purpose> {
        self.watch.as_ref().map(Watch::purpose)
    }

    /// Standard uncertainty, in counts, of the zero that all taxels share.
    #[must_use]
    pub fn sigma_counts(&self) -> f64 {
        self.offset.sigma_counts().hypot(UNSEEN_COUNTS)
    }

    /// How far the zero lies towards load from that of the models, as far as that may be what the skin remembers of earlier
    /// loads, counts.
    #[must_use]
    pub fn residue_counts(&self) -> f64 {
        self.memory.residue_counts(self.offset.followed_counts())
    }

    /// That a load has just vanished from a whole board, if one has: nothing bounds a force above until the counts have shown that
    /// the board did not take a new zero.
    #[must_use]
    pub fn load_vanished(&self) -> Option<Reason> {
        let mut boards = self.evidence.unloaded().peekable();
        boards.peek()?;
        let taxels = boards.flat_map(|board| self.regions.boards()[board].clone());
        Some(Reason::about(positions(taxels), ReasonCode::LoadVanished, VANISHED))
    }

    /// Begins to watch the skin. An earlier watch is given up, and whoever wanted it told.
    pub fn watch(&mut self, now: Time, purpose: Purpose, events: &mut Vec<ZeroEvent>) {
        if let Some(earlier) = self.stop_watching() {
            let why = "another tare began before this one had seen enough".to_owned();
            events.push(ZeroEvent::Refused(earlier, ErrorReason::TareSuperseded, why));
        }
        let window = RestWindow::new(self.regions.taxels(), self.regions.modules());
        self.watch = Some(Watch::new(now, self.plan.tare.duration, window, purpose));
    }

    /// Gives up the watch; who wanted it.
    pub fn stop_watching(&mut self) -> Option<Purpose> {
        self.watch.take().map(|watch| watch.end().0)
    }

    /// The active model set changed: which way pressure moves the counts.
    pub fn on_models(&mut self, set: Option<&ModelSet>) {
        if let Some(set) = set {
            self.proven.iter_mut().for_each(|proven| proven.spoil(OTHER_MODELS));
            self.ground.set_signs(set.signs());
            let zero = self.baseline.as_deref().filter(|_| self.view.valid);
            self.memory.on_models(&set.baseline, zero, self.ground.signs());
            if !self.view.valid {
                self.ground.take(&set.baseline); // without a zero, loads are told from the models'
            }
            self.evidence.compare_with(&self.ground);
            self.on_rest_of_models(set);
        }
        self.offset.restart();
    }

    /// Takes a scan.
    pub fn on_scan(&mut self, now: Now, scan: &Scan<'_>, around: Surroundings<'_>, events: &mut Vec<ZeroEvent>) {
        self.check_evidence(scan, &around, events);
        self.watch_rest(now, scan, around, events);
        self.follow_offset(scan, around.bag.session_open, events);
    }

    fn check_evidence(&mut self, scan: &Scan<'_>, around: &Surroundings<'_>, events: &mut Vec<ZeroEvent>) {
        if !self.view.valid {
            self.evidence.on_scan(scan, around.bag);
            self.spoil_proven();
            if std::mem::replace(&mut self.configuring, around.configuring) {
                self.evidence.begin(true); // boards that were configured have taken zeros of their own
                self.hold_unseen();
                if !around.configuring && self.view.code == Some(ReasonCode::BoardsNotConfigured) {
                    self.explain(ReasonCode::RestNotProven, CONFIGURED.to_owned());
                }
            }
            return;
        }
        match self.evidence.on_scan(scan, around.bag) {
            Some((board, Finding::NewZero(why))) => {
                self.vouched = None;
                self.lose(ReasonCode::ZeroLost, why.clone(), events);
                events.push(ZeroEvent::BoardMoved { board, why });
            }
            Some((_, Finding::Doubt(_))) | None => {
                self.spoil_proven();
                self.tell_doubt(events);
            }
        }
    }

    /// A zero that is being written down is of before: what is found since would be forgotten with it.
    fn spoil_proven(&mut self) {
        if self.proven.is_some() {
            let found = self.held_against();
            self.proven.iter_mut().for_each(|proven| proven.spoil_by(&found));
        }
    }

    pub(super) fn held_against(&self) -> Known {
        Known {
            doubted: self.evidence.doubted().map(str::to_owned),
            vanished: self.evidence.unloaded().next().map(|_| VANISHED.to_owned()),
            unproven: self.evidence.unproven().map(str::to_owned),
        }
    }

    pub(super) fn tell_doubt(&mut self, events: &mut Vec<ZeroEvent>) {
        let doubted = self.evidence.doubted().is_some();
        self.on_trial &= doubted;
        if doubted != self.doubted {
            self.doubted = doubted;
            events.push(if doubted { ZeroEvent::Doubted } else { ZeroEvent::Cleared });
        }
    }

    /// The zero that was proven for `request` is on disk: it holds from now on.
    ///
    /// # Errors
    /// What has moved the zero meanwhile, in words.
    pub fn adopt(&mut self, now: Now, request: RequestId) -> Result<TareView, String> {
        let proven = self.proven.take_if(|proven| proven.is_for(request));
        let (mut view, baseline, vouched) = proven.ok_or("a newer zero was taken")?.zero()?;
        view.epoch = self.view.epoch + 1;
        if vouched {
            self.on_vouched(&baseline);
        }
        self.unjudged.take_if(|unjudged| unjudged.models == Models::Others); // these have judged this one
        self.take(now.time, view.clone(), baseline);
        Ok(view)
    }

    /// The zero that was proven for `request` could not be written down: the earlier one stays.
    pub fn reject(&mut self, request: RequestId) {
        self.proven.take_if(|proven| proven.is_for(request));
    }

    pub(super) fn take(&mut self, now: Time, view: TareView, baseline: Vec<TaxelBaseline>) {
        let pads = self.offset.pads();
        self.take_at(now, view, baseline, &pads);
        self.keep(pads);
    }

    /// The same of a zero that was taken with this mean of each module's thermal pads, counts.
    pub(super) fn take_at(&mut self, now: Time, view: TareView, baseline: Vec<TaxelBaseline>, pads: &[Option<f64>]) {
        self.view = view;
        self.taken = now;
        self.ground.take(&baseline);
        self.memory.begin(&baseline, self.ground.signs());
        let residue = self.memory.residue_counts(0.0);
        self.offset.begin(residue, pads);
        self.view.drift = *self.offset.view();
        self.baseline = Some(baseline);
        self.unseen = None;
        self.evidence.begin(self.view.at_rest);
        self.evidence.compare_with(&self.ground);
        self.doubted = false;
        self.on_trial = false;
    }

    /// The zero as it was taken, one per taxel, if there is one.
    #[must_use]
    pub fn baseline(&self) -> Option<&[TaxelBaseline]> {
        self.baseline.as_deref().filter(|_| self.view.valid)
    }

    /// Time passed: a watch that gets no scans ends. `silence` says which modules are silent.
    pub fn tick(&mut self, now: Time, silence: impl FnOnce() -> String, events: &mut Vec<ZeroEvent>) {
        if self.watch.as_ref().is_some_and(|watch| now > watch.give_up_at())
            && let Some(purpose) = self.stop_watching()
        {
            events.push(ZeroEvent::Refused(
                purpose,
                ErrorReason::SkinSilent,
                format!("no rest could be watched: {}", silence()),
            ));
        }
    }

    /// When [`Zero::tick`] has something to do.
    #[must_use]
    pub fn deadline(&self) -> Option<Time> {
        self.watch.as_ref().map(|watch| watch.give_up_at() + Duration::from_nanos(1))
    }

    /// Why no zero was taken by itself, for readers; a valid one is left alone.
    pub fn explain(&mut self, code: ReasonCode, reason: String) {
        if !self.view.valid {
            self.view.reason = reason;
            self.view.code = Some(code);
        }
    }
}
