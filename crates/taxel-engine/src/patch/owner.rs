//! One patch: it holds the organs, hands each what it needs, and turns what they return into outputs.
//!
//! No organ knows another. The order in which a scan goes through them is [`Patch::on_scan`]'s: the zero first, so that
//! no force is made of a scan that shows that the zero is lost.

use std::sync::Arc;
use std::time::Duration;
use taxel_skin::{Board, BusIndex, Kilopascal, Newton, Time};

use crate::boundary::output::Output;
use crate::boundary::pushed::PushedScan;
use crate::boundary::record::Record;
use crate::boundary::snapshot::GaugeReading;
use crate::calibration::samples::Pending;
use crate::calibration::session::SessionRun;
use crate::calibration::view::SessionView;
use crate::force::owner::Force;
use crate::intake::boards::{BoardNews, Suspicion, ZeroSign};
use crate::intake::faults::fault::FaultSet;
use crate::intake::gauge::GaugeAtRest;
use crate::intake::health::BoardHealth;
use crate::intake::receive::{Intake, IntakeEvent};
use crate::loads::load::Load;
use crate::loads::owner::{LoadRead, Loads};
use crate::model_set::ModelSet;
use crate::now::Now;
use crate::plan::PatchPlan;
use crate::request::RequestId;
use crate::zero::bag::Bag;
use crate::zero::events::Surroundings;
use crate::zero::holder::Zero;
use crate::zero::kept::KeptZero;
use crate::zero::watch::Purpose;

/// Why a patch has no zero while its boards are configured.
pub(super) const BEING_CONFIGURED: &str = "the boards are being configured, which takes their zero anew";

/// What a patch cannot do alone: what must be on disk before it takes effect, and what concerns a board that other patches
/// have, too.
#[derive(Clone, Debug)]
pub enum Intent {
    /// A zero that was proven for an operator.
    Zero {
        /// Whom to answer.
        request: RequestId,
        /// What is written down.
        record: Record,
    },
    /// A known load that was read, or why not.
    Load(LoadRead),
    /// Other patches that have this board must know.
    News {
        /// Position of the board in this patch.
        board: usize,
        /// What.
        news: BoardNews,
    },
}

/// One patch.
#[derive(Debug)]
pub struct Patch {
    pub(super) index: usize,
    pub(super) plan: Arc<PatchPlan>,
    pub(super) intake: Intake,
    pub(super) zero: Zero,
    pub(super) force: Force,
    /// The session that holds the patch or was the last to.
    pub(super) session: Option<SessionRun>,
    pub(super) loads: Loads,
    pub(super) sequence: u64,
    /// The faults of each taxel as last published, and the soundness that they belong to.
    pub(super) faults: (Option<u64>, Arc<[FaultSet]>),
    /// Something changed that readers must see before the next scan.
    pub(super) dirty: bool,
    /// When the daemon began to listen.
    pub(super) started: Time,
    /// It has been listened whether the boards stream, and they were configured where they had to be.
    pub(super) has_begun: bool,
    /// The force that was published last, and from how many taxels; none of them if it is below what can be told from
    /// nothing.
    pub(super) felt: Option<(Newton, usize)>,
    /// How the boards are set, as a sum.
    pub(super) settings: u32,
    /// What is known of zeros, as last written down.
    pub(super) noted: KeptZero,
    /// What follows of what happened last, to be done by the shell.
    pub out: Vec<Output>,
    /// What of it is to be written down first, or concerns other patches.
    pub intents: Vec<Intent>,
}

impl Patch {
    /// Nothing heard, nothing sent; `loads` are those of earlier runs, `known` what was known then of its zero,
    /// `shared` says which boards other patches have, too.
    pub fn new(index: usize, plan: PatchPlan, loads: Vec<Arc<Load>>, known: KeptZero, shared: Vec<bool>) -> Self {
        let plan = Arc::new(plan);
        let intake = Intake::new(Arc::clone(&plan), shared);
        let regions = intake.regions().clone();
        let mut zero = Zero::new(Arc::clone(&plan), regions.clone());
        zero.remember(&known);
        Self {
            index,
            zero,
            force: Force::new(plan.force()),
            session: None,
            loads: Loads::new(plan.loads(), loads),
            sequence: 0,
            faults: (None, vec![FaultSet::default(); regions.taxels()].into()),
            dirty: true,
            started: Time::default(),
            has_begun: false,
            felt: None,
            settings: plan.settings_sum(),
            noted: known,
            out: Vec::new(),
            intents: Vec::new(),
            intake,
            plan,
        }
    }

    /// Its plan.
    pub fn plan(&self) -> &PatchPlan {
        &self.plan
    }

    /// Its name.
    pub fn name(&self) -> &str {
        self.plan.patch.name()
    }

    /// How many taxels it has.
    pub fn taxels(&self) -> usize {
        self.intake.regions().taxels()
    }

    /// The session that holds it or was the last to.
    pub fn session(&self) -> Option<&SessionView> {
        self.session.as_ref().map(|session| &session.view)
    }

    /// The model set in use.
    pub const fn models(&self) -> Option<&Arc<ModelSet>> {
        self.force.models()
    }

    /// Why this set says nothing of the boards or the areas that are configured, in words.
    pub fn unfit(&self, set: &ModelSet) -> Option<String> {
        self.plan.unfit_for_settings(set).or_else(|| set.unfit_for_sum(self.loads.plan()))
    }

    /// The host may have lost frames of a bus, of all without one, of so long a time before `now`.
    pub fn on_frames_lost(&mut self, now: Time, bus: Option<BusIndex>, gap: Duration) {
        self.intake.on_frames_lost(now, bus, gap);
    }

    /// A bus was lost for a time, and with it what its boards did meanwhile: they may have taken new zeros under what lies
    /// on them.
    pub fn on_bus_lost(&mut self, now: Now, bus: BusIndex, why: &str) {
        self.lose_zeros(now, |board| board.bus == bus, why);
    }

    fn lose_zeros(&mut self, now: Now, of: impl Fn(&Board) -> bool, why: &str) {
        let boards: Vec<bool> = self.plan.patch.boards().iter().map(of).collect();
        self.with_zero(now, |zero, events| {
            (0..boards.len()).filter(|&board| boards[board]).for_each(|board| zero.lose_by_board(board, why, events));
        });
    }

    /// Something comes in, such as a frame, and what follows from it.
    pub fn with_intake<T>(&mut self, now: Now, act: impl FnOnce(&mut Intake, &mut Vec<IntakeEvent>) -> T) -> T {
        let mut events = Vec::new();
        let result = act(&mut self.intake, &mut events);
        self.on_intake_events(now, events);
        result
    }

    /// A program begins to hand over scans. Whatever handed them over before may have been another device, or the same
    /// with another zero.
    pub fn begin_push(&mut self, now: Now) {
        if self.intake.newest().is_some() {
            let why = "another stream of scans has begun: what pushes them may have taken a new zero";
            self.lose_zeros(now, |_| true, why);
        }
    }

    /// A scan that was handed over whole, with one count per taxel.
    pub fn on_pushed(&mut self, now: Now, scan: &PushedScan) {
        if let Some(pressure) = scan.pressure {
            self.on_pressure(now, scan.time, pressure);
        }
        self.with_intake(now, |intake, events| intake.on_pushed(scan, events));
    }

    /// A reading of the gauge that this patch's bag has.
    pub fn on_pressure(&mut self, now: Now, time: Time, pressure: Kilopascal) {
        self.intake.on_pressure(time, pressure);
        self.out.push(Output::Gauge(self.index, GaugeReading { time, kpa: pressure.0 }));
        self.advance_session(now);
    }

    fn on_intake_events(&mut self, now: Now, events: Vec<IntakeEvent>) {
        for event in events {
            match event {
                IntakeEvent::Scan => self.on_scan(now),
                IntakeEvent::Board(board, sign) => self.with_zero(now, |zero, events| match sign {
                    ZeroSign::Suspect(Suspicion { why, certain: true }) => zero.lose_by_board(board, &why, events),
                    ZeroSign::Suspect(suspicion) => zero.suspect(board, &suspicion.why, events),
                    ZeroSign::Unwell => zero.on_unwell(board),
                    ZeroSign::Well(suspicion) => zero.on_well(board, &suspicion.why, suspicion.certain, events),
                    ZeroSign::Moved(why) => zero.lose_by_another(board, &why, events),
                }),
                IntakeEvent::News(board, news) => self.intents.push(Intent::News { board, news }),
                IntakeEvent::Changed => self.dirty = true,
            }
        }
    }

    fn on_scan(&mut self, now: Now) {
        let no_rest = self.end_watch_of_no_rest(now);
        let mut events = Vec::new();
        let session = self.session.as_ref();
        let around = Surroundings {
            models: self.force.models().map(Arc::as_ref),
            configuring: !self.intake.bring_up().is_done(),
            boards_ready: self.has_begun && self.intake.bring_up().is_done(),
            parts_left_out: session.is_some_and(SessionRun::leaves_out_any),
            no_rest,
            bag: Bag {
                session_open: session.is_some_and(|session| session.view.state.is_open()),
                presses: self.bag_presses(now),
                holds: session.is_some_and(SessionRun::is_ramping)
                    && (self.plan.session.typed || self.intake.gauge().is_holding(now.time)),
            },
        };
        self.zero.on_scan(now, &self.intake.scan(), around, &mut events);
        self.on_zero_events(now, events);
        self.offer_to_session(now);
        self.force.follow(&self.intake.scan());
        self.publish(now);
    }

    /// A ramp's zero is taken of boards that keep theirs, and of a skin that nothing presses on. In its first session a
    /// skin has no models that would show a bag that stands at a pressure, but the gauge does.
    /// Returns whether that is not so.
    fn end_watch_of_no_rest(&mut self, now: Now) -> bool {
        if !matches!(self.zero.watching(), Some(Purpose::Session { .. })) {
            return false;
        }
        let checked =
            self.check_set_up().and_then(|()| self.check_vented(now)).and_then(|()| self.check_gauge_at_rest(now));
        let Err(refusal) = checked else {
            self.take_ambient(now);
            return false;
        };
        self.with_zero(now, |zero, events| zero.end_watch(refusal.reason(), refusal.to_string(), events));
        true
    }

    /// The bag is vented and its gauge stands still: if that had to guess the ambient pressure, now it is known.
    fn take_ambient(&mut self, now: Now) {
        let limits = self.plan.session.gauge_rest();
        if let (true, GaugeAtRest::Still { kpa, .. }) =
            (self.plan.takes_ambient(), self.intake.gauge().at_rest(now.time, limits))
        {
            self.intake.count_gauge_from(kpa);
        }
    }

    fn bag_presses(&self, now: Now) -> bool {
        let limits = &self.plan.session;
        let newest = self.intake.gauge().newest();
        newest.is_some_and(|(time, kpa)| now.time.since(time) <= limits.gauge_timeout && kpa > limits.vented_below)
    }

    fn offer_to_session(&mut self, now: Now) {
        if let Some(session) = &mut self.session {
            let (scan, left_out) = (self.intake.scan(), &session.view.left_out);
            let fresh_within = self.plan.period + self.plan.period / 2;
            let is_left_out = |module: usize| left_out.iter().any(|of| usize::from(*of) == module);
            let whole = self.intake.is_whole_without(fresh_within, is_left_out);
            let complete = whole && (scan.whole || !left_out.is_empty()) && self.zero.holds();
            session.on_scan(complete.then(|| Pending { time: scan.time, counts: scan.counts.into() }));
        }
        self.advance_session(now);
    }

    fn advance_session(&mut self, now: Now) {
        self.with_session(now, |session, intake| {
            session.advance(now, intake.gauge(), || intake.silence(now.time));
        });
    }

    /// Time passed.
    pub fn tick(&mut self, now: Now) {
        let (mut frames, mut events) = (Vec::new(), Vec::new());
        self.intake.tick(now.time, &mut frames, &mut events);
        for (board, frame) in frames {
            self.out.push(Output::Send(self.plan.patch.boards()[board].bus, frame));
        }
        self.on_intake_events(now, events);
        let mut events = Vec::new();
        let intake = &self.intake;
        self.zero.tick(now.time, || intake.silence(now.time), &mut events);
        self.on_zero_events(now, events);
        self.advance_session(now);
        if self.dirty {
            self.publish(now);
        }
        if let Some(read) = self.loads.tick(now.time) {
            self.intents.push(Intent::Load(read));
        }
        if let Some(view) = self.session.as_mut().and_then(|session| session.show(now.time, self.intake.gauge())) {
            self.out.push(Output::Session(self.index, self.seen(&view)));
        }
    }

    /// When [`Patch::tick`] has something to do at the latest, if nothing comes before.
    pub fn deadline(&self) -> Option<Time> {
        let now = Time::from_nanos(i64::MIN);
        if self.dirty {
            return Some(now);
        }
        let session = self.session.as_ref().and_then(SessionRun::deadline);
        let organs = [self.intake.deadline(), self.zero.deadline(), self.loads.deadline(), session];
        organs.into_iter().flatten().min()
    }

    /// One entry per board.
    pub fn board_health(&self, now: Time) -> Vec<BoardHealth> {
        self.intake.board_health(now)
    }
}
