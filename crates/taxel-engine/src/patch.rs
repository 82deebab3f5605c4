//! One patch: it holds the organs, hands each what it needs, and turns what they return into outputs.
//!
//! No organ knows another. The order in which a scan goes through them is [`Patch::on_scan`]'s: the zero first, so that
//! no force is made of a scan that shows that the zero is lost.

use std::sync::Arc;
use taxel_skin::{Kilopascal, Time};
use taxel_wire::icub::Refusal;
use taxel_wire::{Frame, TimedFrame};

use crate::boundary::output::Output;
use crate::boundary::record::Record;
use crate::boundary::snapshot::PatchSnapshot;
use crate::calibration::calibrate::{Calibration, CalibrationEvent};
use crate::calibration::job::FitOutcome;
use crate::calibration::samples::SessionSamples;
use crate::calibration::session::SessionRecord;
use crate::calibration::transition::Trigger;
use crate::calibration::view::SessionView;
use crate::force::owner::{Force, ZeroState};
use crate::force::taxels::{Basis, ModuleAge, Taxels};
use crate::intake::faults::fault::FaultSet;
use crate::intake::health::BoardHealth;
use crate::intake::receive::{Intake, IntakeEvent};
use crate::loads::load::{KnownLoad, Load};
use crate::loads::owner::{LoadRead, Loads};
use crate::loads::validation::Validation;
use crate::model_set::ModelSet;
use crate::now::Now;
use crate::plan::PatchPlan;
use crate::request::{Rejection, RequestId};
use crate::zero::holder::{Surroundings, Zero, ZeroEvent};
use crate::zero::view::TareView;
use crate::zero::watch::Purpose;

/// What must be on disk before it takes effect.
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
}

/// What a patch puts out in a step.
pub struct Effects<'a> {
    /// To be done by the shell.
    pub out: &'a mut Vec<Output>,
    /// To be written down first.
    pub intents: &'a mut Vec<Intent>,
}

/// One patch.
#[derive(Debug)]
pub struct Patch {
    index: usize,
    plan: PatchPlan,
    intake: Intake,
    zero: Zero,
    force: Force,
    calibration: Calibration,
    loads: Loads,
    sequence: u64,
    /// The faults of each taxel as last published, and the soundness that they belong to.
    faults: (Option<u64>, Arc<[FaultSet]>),
    /// Something changed that readers must see before the next scan.
    dirty: bool,
}

impl Patch {
    /// Nothing heard, nothing sent; `loads` are those of earlier runs.
    #[must_use]
    pub fn new(index: usize, plan: PatchPlan, loads: Vec<Arc<Load>>) -> Self {
        let intake = Intake::new(plan.intake());
        let regions = intake.regions().clone();
        Self {
            index,
            zero: Zero::new(plan.zero(), regions.clone()),
            force: Force::new(plan.force()),
            calibration: Calibration::new(plan.calibration()),
            loads: Loads::new(plan.loads(), loads),
            sequence: 0,
            faults: (None, vec![FaultSet::default(); regions.taxels()].into()),
            dirty: true,
            intake,
            plan,
        }
    }

    /// Its plan.
    #[must_use]
    pub const fn plan(&self) -> &PatchPlan {
        &self.plan
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        self.plan.patch.name()
    }

    /// How many taxels it has.
    #[must_use]
    pub fn taxels(&self) -> usize {
        self.intake.regions().taxels()
    }

    /// Its calibration.
    #[must_use]
    pub const fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    /// The model set in use.
    #[must_use]
    pub const fn models(&self) -> Option<&Arc<ModelSet>> {
        self.force.models()
    }

    /// How many known loads are kept.
    #[must_use]
    pub const fn loads(&self) -> usize {
        self.loads.count()
    }

    /// Starts the boards and waits for rest.
    pub fn start(&mut self, now: Now, effects: &mut Effects<'_>) {
        let mut events = Vec::new();
        self.zero.lose("no zero has been taken since start", &mut events);
        self.on_zero_events(now, events, effects);
        self.intake.start_bring_up(now.time);
    }

    /// Configures the boards again: the zero is lost.
    pub fn bring_up_again(&mut self, now: Now, effects: &mut Effects<'_>) {
        self.lose_zero(now, "the boards are being configured, which takes their zero anew", effects);
        self.intake.start_bring_up(now.time);
    }

    /// Something has moved the zero of the boards.
    pub fn lose_zero(&mut self, now: Now, why: impl Into<String>, effects: &mut Effects<'_>) {
        let mut events = Vec::new();
        self.zero.lose(why, &mut events);
        self.on_zero_events(now, events, effects);
    }

    /// The host lost frames of a bus that boards of this patch sit on.
    pub fn on_frames_lost(&mut self) {
        self.intake.on_frames_lost();
    }

    /// A frame with an identifier of one of this patch's modules.
    ///
    /// # Errors
    /// [`Refusal`] if its content is not a message; the caller counts it.
    pub fn on_module_frame(
        &mut self,
        now: Now,
        module: usize,
        frame: &TimedFrame,
        effects: &mut Effects<'_>,
    ) -> Result<(), Refusal> {
        let mut events = Vec::new();
        self.intake.on_module_frame(module, frame, &mut events)?;
        self.on_intake_events(now, events, effects);
        Ok(())
    }

    /// A frame with another identifier of one of this patch's boards.
    ///
    /// # Errors
    /// [`Refusal`] if its content is not a message; the caller counts it.
    pub fn on_board_frame(&mut self, board: usize, frame: &Frame) -> Result<(), Refusal> {
        self.intake.on_board_frame(board, frame)
    }

    /// A reading of the gauge that this patch's bag has.
    pub fn on_pressure(&mut self, now: Now, time: Time, pressure: Kilopascal, effects: &mut Effects<'_>) {
        self.intake.on_pressure(time, pressure);
        self.advance_session(now, effects);
    }

    fn on_intake_events(&mut self, now: Now, events: Vec<IntakeEvent>, effects: &mut Effects<'_>) {
        for event in events {
            match event {
                IntakeEvent::Scan => self.on_scan(now, effects),
                IntakeEvent::BoardDoubted { why, certain: true, .. } => self.lose_zero(now, why, effects),
                IntakeEvent::BoardDoubted { board, why, certain: false } => {
                    let mut events = Vec::new();
                    self.zero.doubt(board, &why, &mut events);
                    self.on_zero_events(now, events, effects);
                }
                IntakeEvent::Changed => self.dirty = true,
            }
        }
    }

    fn on_scan(&mut self, now: Now, effects: &mut Effects<'_>) {
        let mut events = Vec::new();
        let left_out = self.calibration.session().is_some_and(|view| view.state.is_open() && !view.left_out.is_empty());
        let around = Surroundings {
            models: self.force.models().map(Arc::as_ref),
            boards_ready: self.intake.bring_up().is_done(),
            session_open: self.calibration.open().is_some(),
            parts_left_out: left_out,
            pressing: self.calibration.is_ramping() && !self.pressure_falls(now.time),
        };
        self.zero.on_scan(now, &self.intake.scan(), around, &mut events);
        self.on_zero_events(now, events, effects);
        self.offer_to_session(now, left_out, effects);
        self.force.follow(&self.intake.scan());
        self.publish(now, effects);
    }

    /// Whether the bag is letting go, so that loads may vanish.
    fn pressure_falls(&self, now: Time) -> bool {
        self.intake.gauge().trend(now).is_none_or(|trend| trend.rate_kpa_per_s < -0.5)
    }

    fn offer_to_session(&mut self, now: Now, left_out: bool, effects: &mut Effects<'_>) {
        let fresh_within = self.plan.period + self.plan.period / 2;
        let complete = if left_out {
            self.intake.is_whole_without(fresh_within, |module| self.calibration.leaves_out(module))
        } else {
            self.intake.scan().whole && self.intake.is_whole_without(fresh_within, |_| false)
        };
        self.calibration.on_scan(&self.intake.scan(), complete && self.zero.holds());
        self.advance_session(now, effects);
    }

    fn advance_session(&mut self, now: Now, effects: &mut Effects<'_>) {
        let mut events = Vec::new();
        let intake = &self.intake;
        self.calibration.advance(now, intake.gauge(), || intake.silence(now.time), &mut events);
        self.on_calibration_events(now, events, effects);
    }

    /// Time passed.
    pub fn tick(&mut self, now: Now, effects: &mut Effects<'_>) {
        let (mut frames, mut events) = (Vec::new(), Vec::new());
        self.intake.tick(now.time, &mut frames, &mut events);
        for (board, frame) in frames {
            effects.out.push(Output::Send(self.plan.patch.boards()[board].bus, frame));
        }
        self.on_intake_events(now, events, effects);
        let mut events = Vec::new();
        let intake = &self.intake;
        self.zero.tick(now.time, || intake.silence(now.time), &mut events);
        self.on_zero_events(now, events, effects);
        self.advance_session(now, effects);
        if self.dirty {
            self.publish(now, effects);
        }
        if let Some(read) = self.loads.tick(now.time) {
            effects.intents.push(Intent::Load(read));
        }
        let mut events = Vec::new();
        self.calibration.show(now.time, self.intake.gauge(), &mut events);
        self.on_calibration_events(now, events, effects);
    }

    /// When [`Patch::tick`] has something to do at the latest, if nothing comes before.
    #[must_use]
    pub fn deadline(&self) -> Option<Time> {
        let organs = [self.intake.deadline(), self.zero.deadline(), self.loads.deadline(), self.calibration.deadline()];
        organs.into_iter().flatten().min()
    }

    /// What the zero says goes to whoever depends on it.
    fn on_zero_events(&mut self, now: Now, events: Vec<ZeroEvent>, effects: &mut Effects<'_>) {
        for event in events {
            self.dirty = true;
            let mut follows = Vec::new();
            let gauge = self.intake.gauge();
            match event {
                ZeroEvent::Proven { request, view, baseline } => {
                    let patch = self.name().to_owned();
                    let record = Record::Tared { patch, tare: view, baseline };
                    effects.intents.push(Intent::Zero { request, record });
                }
                ZeroEvent::Taken(purpose) => {
                    self.use_zero();
                    let baseline = self.zero.baseline().unwrap_or_default().to_vec();
                    let (patch, tare) = (self.name().to_owned(), self.zero.view());
                    effects.out.push(Output::Record(Record::Tared { patch, tare, baseline: baseline.clone() }));
                    if matches!(purpose, Purpose::Session { .. }) {
                        self.calibration.on_zero_taken(now, baseline, self.intake.gauge(), &mut follows);
                    }
                }
                ZeroEvent::Refused(Purpose::AtStart, why) => self.zero.explain(format!("rest is not proven: {why}")),
                ZeroEvent::Refused(Purpose::Operator { request, .. }, why) => {
                    let hint = "if nothing touches the skin, say so with confirmed_by";
                    let why = Rejection::FailedPrecondition(format!("rest is not proven: {why}; {hint}"));
                    effects.out.push(Output::Reply(request, Err(why)));
                }
                ZeroEvent::Refused(Purpose::Session { .. }, why) => {
                    self.calibration.on_zero_refused(now, &why, gauge, &mut follows);
                }
                ZeroEvent::Lost(why) => {
                    self.force.set_zero(None);
                    self.calibration.on_zero_lost(now, &why, gauge, &mut follows);
                }
                ZeroEvent::Doubted => {
                    self.force.move_zero(None);
                    self.calibration.on_zero_doubted();
                }
                ZeroEvent::Moved | ZeroEvent::Cleared => self.force.move_zero(self.zero.zero()),
            }
            self.on_calibration_events(now, follows, effects);
        }
    }

    fn use_zero(&mut self) {
        self.force.set_zero(self.zero.zero());
        if let Some(baseline) = self.zero.baseline() {
            self.intake.expect_noise(baseline);
        }
    }

    /// What the calibration wants goes to the zero, to disk and to readers.
    fn on_calibration_events(&mut self, now: Now, events: Vec<CalibrationEvent>, effects: &mut Effects<'_>) {
        for event in events {
            match event {
                CalibrationEvent::WantsZero { confirmed_by } => {
                    let mut follows = Vec::new();
                    self.zero.watch(now.time, Purpose::Session { confirmed_by }, &mut follows);
                    self.on_zero_events(now, follows, effects);
                }
                CalibrationEvent::ZeroNotWanted => {
                    if matches!(self.zero.watching(), Some(Purpose::Session { .. })) {
                        self.zero.stop_watching();
                    }
                }
                CalibrationEvent::Record(record) => {
                    let session = self.calibration.session().map_or(0, |view| view.number);
                    effects.out.push(Output::Record(match record {
                        SessionRecord::Ramp { ramp, baseline } => Record::Ramp { session, ramp, baseline },
                        SessionRecord::Sample { index, sample } => Record::Sample { session, index, sample },
                    }));
                }
                CalibrationEvent::Session(view) => {
                    effects.out.push(Output::Record(Record::Session(Arc::clone(&view))));
                    effects.out.push(Output::Session(self.index, view));
                }
                CalibrationEvent::Progress(view) => effects.out.push(Output::Session(self.index, view)),
                CalibrationEvent::Fit(job) => effects.out.push(Output::Fit(job)),
            }
        }
    }

    /// An operator asks for a zero; the answer comes later.
    ///
    /// # Errors
    /// [`Rejection`] while a session takes the zero itself, or while the boards are being configured.
    pub fn tare(
        &mut self,
        now: Now,
        request: RequestId,
        confirmed_by: Option<String>,
        effects: &mut Effects<'_>,
    ) -> Result<(), Rejection> {
        self.calibration.refuse_if_open("it takes the zero itself; abort it first")?;
        if !self.intake.bring_up().is_done() {
            let why = "the boards are being configured, which takes their zero anew: tare when they are verified";
            return Err(Rejection::FailedPrecondition(why.to_owned()));
        }
        let mut events = Vec::new();
        self.zero.watch(now.time, Purpose::Operator { request, confirmed_by }, &mut events);
        self.on_zero_events(now, events, effects);
        Ok(())
    }

    /// The zero that was proven for `request` is on disk, or why not. Returns the zero that holds now.
    ///
    /// # Errors
    /// [`Rejection`] if something moved the zero meanwhile.
    pub fn adopt_zero(&mut self, now: Now, request: RequestId) -> Result<TareView, Rejection> {
        let view = self.zero.adopt(now, request);
        let lost = || Rejection::FailedPrecondition(format!("the zero was lost meanwhile: {}", self.zero.reason()));
        let view = view.ok_or_else(lost)?;
        self.use_zero();
        self.dirty = true;
        Ok(view)
    }

    /// The zero that was proven for `request` could not be written down.
    pub fn reject_zero(&mut self, request: RequestId) {
        self.zero.reject(request);
    }

    /// Refuses what needs a skin at rest while the bag presses on it.
    ///
    /// # Errors
    /// [`Rejection::FailedPrecondition`] with the pressure and the limit.
    pub fn check_vented(&self, now: Now) -> Result<(), Rejection> {
        let limits = &self.plan.session;
        // Without a reading the ramp itself waits for the gauge.
        let Some((time, pressure)) = self.intake.gauge().newest() else { return Ok(()) };
        if now.time.since(time) > limits.gauge_timeout || pressure <= limits.vented_below {
            return Ok(());
        }
        let (kpa, limit) = (pressure.0, limits.vented_below.0);
        let why = format!("the bag is at {kpa:.1} kPa and presses on the skin: vent it below {limit:.1} kPa first");
        Err(Rejection::FailedPrecondition(why))
    }

    /// Begins a session. The caller has checked that none is open.
    pub fn start_session(&mut self, now: Now, view: SessionView, effects: &mut Effects<'_>) {
        let mut events = Vec::new();
        self.calibration.start(now, view, self.intake.gauge(), &mut events);
        self.on_calibration_events(now, events, effects);
    }

    /// Takes up a session of an earlier run.
    pub fn resume_session(&mut self, now: Now, view: SessionView, samples: SessionSamples) {
        self.calibration.resume(now, view, samples);
    }

    /// What an operator asks of the session that the patch holds.
    ///
    /// # Errors
    /// [`Rejection`] if it cannot be in the session's present state, or while the bag presses.
    pub fn command_session(
        &mut self,
        now: Now,
        command: Trigger,
        effects: &mut Effects<'_>,
    ) -> Result<Arc<SessionView>, Rejection> {
        if command == Trigger::StartRamp {
            self.check_vented(now)?;
        }
        let mut events = Vec::new();
        self.calibration.command(now, command, self.intake.gauge(), &mut events)?;
        self.on_calibration_events(now, events, effects);
        let view = self.calibration.session().cloned();
        view.map(Arc::new).ok_or_else(|| Rejection::NotFound("session".to_owned()))
    }

    /// Something from outside changes the state of the session that the patch holds.
    pub fn trigger_session(&mut self, now: Now, trigger: Trigger, reason: &str, effects: &mut Effects<'_>) {
        let mut events = Vec::new();
        self.calibration.trigger(now, trigger, reason, self.intake.gauge(), &mut events);
        self.on_calibration_events(now, events, effects);
    }

    /// The fit that its session awaits came back.
    pub fn on_fitted(&mut self, now: Now, outcome: &FitOutcome, effects: &mut Effects<'_>) {
        let mut events = Vec::new();
        self.calibration.on_fitted(now, &outcome.result, self.intake.gauge(), &mut events);
        self.on_calibration_events(now, events, effects);
    }

    /// Samples of a session are on disk.
    pub fn on_durable(&mut self, session: u64, samples: u64) {
        self.calibration.on_durable(session, samples);
    }

    /// Another model set is in use from now on.
    pub fn set_models(&mut self, set: Arc<ModelSet>) {
        self.intake.expect_noise(&set.baseline);
        self.zero.on_models(Some(&set));
        self.force.set_models(set);
        self.dirty = true;
    }

    /// Begins to read a known load.
    ///
    /// # Errors
    /// [`Rejection`] if there is no force to read, or the load cannot be.
    pub fn begin_load(&mut self, now: Now, request: RequestId, load: KnownLoad) -> Result<(), Rejection> {
        self.calibration.refuse_if_open("finish or abort it first")?;
        self.check_vented(now)?;
        let refuse = |why: String| Err(Rejection::FailedPrecondition(why));
        if self.force.models().is_none() {
            return refuse("no model set is active: there is no force to compare".to_owned());
        }
        if !self.force.is_ready() {
            return refuse(format!("there is no valid zero: {}", self.zero.reason()));
        }
        self.loads.begin(now.time, request, load)
    }

    /// A load that was read, with all that it depends on.
    ///
    /// # Errors
    /// [`Rejection`] if it could not be read.
    pub fn complete_load(&self, now: Now, number: u64, read: LoadRead) -> Result<Arc<Load>, Rejection> {
        let set = self.force.models().map(|set| set.id.clone()).unwrap_or_default();
        let reading = read.outcome.map_err(Rejection::FailedPrecondition)?;
        self.loads.complete(now, number, &set, reading).map(Arc::new)
    }

    /// A load that is on disk.
    pub fn keep_load(&mut self, load: Arc<Load>) {
        self.loads.keep(load);
    }

    /// All known loads, judged; the areas follow the factor where the plan asks for it.
    pub fn validate(&mut self) -> Validation {
        let view = self.loads.validation(self.force.models().map(|set| set.id.clone()));
        if let Some((areas, uncertainty)) = self.loads.apply(&view) {
            self.force.set_areas(areas, uncertainty);
            self.dirty = true;
        }
        view
    }

    /// One entry per board.
    #[must_use]
    pub fn board_health(&self) -> Vec<BoardHealth> {
        self.intake.board_health()
    }

    /// Publishes the present state under the next sequence number.
    fn publish(&mut self, now: Now, effects: &mut Effects<'_>) {
        self.dirty = false;
        self.sequence += 1;
        let scan = self.intake.scan();
        let zero = ZeroState {
            lacks: if self.zero.holds() { String::new() } else { self.zero.reason() },
            sigma_counts: self.zero.sigma_counts(),
            shortcoming: self.zero.shortcoming(),
            load_vanished: self.zero.load_vanished(),
        };
        let measured = self.force.sample(&scan, self.intake.silent_taxels(), &zero);
        let time = self.intake.newest().unwrap_or_default();
        let tare = self.zero.view();
        if let Some(read) = self.loads.on_sample(time, tare.epoch, &measured.sample) {
            effects.intents.push(Intent::Load(read));
        }
        if self.faults.0 != Some(scan.soundness) {
            self.faults = (Some(scan.soundness), (0..self.taxels()).map(|t| self.intake.faults(t)).collect());
        }
        let age_ns = now.time.as_nanos().saturating_sub(time.as_nanos());
        let snapshot = PatchSnapshot {
            sequence: self.sequence,
            time,
            wall_ns: now.wall_ns.saturating_sub(age_ns),
            seen: self.intake.newest().is_some(),
            taxels: self.taxel_states(measured.active),
            force: measured.sample,
            tare: Some(tare),
        };
        effects.out.push(Output::Patch(self.index, Arc::new(snapshot)));
    }

    /// What the states of the taxels can be worked out from later: copies of what changes, and what is shared.
    fn taxel_states(&self, active: Box<[u16]>) -> Taxels {
        let scan = self.intake.scan();
        let ages = self.intake.last_heard().zip(scan.silent).map(|(last, &stale)| ModuleAge { last, stale });
        let (tables, offset_kpa) = self.force.tables().unzip();
        Taxels::of(Basis {
            counts: scan.counts.into(),
            modules: ages.collect(),
            module_of: Arc::clone(self.intake.regions().module_of()),
            faults: Arc::clone(&self.faults.1),
            tables,
            offset_kpa: offset_kpa.flatten(),
            active,
            model_set: self.force.models().cloned(),
        })
    }
}
