//! One patch: it holds the organs, hands each what it needs, and turns what they return into outputs.
//!
//! No organ knows another. The order in which a scan goes through them is [`Patch::on_scan`]'s: the zero first, so that
//! no force is made of a scan that shows that the zero is lost.

use std::sync::Arc;
use std::time::Duration;
use taxel_skin::{Kilopascal, Newton, Time};
use taxel_wire::icub::Refusal;
use taxel_wire::{Frame, TimedFrame};

use crate::boundary::output::Output;
use crate::boundary::record::Record;
use crate::calibration::calibrate::Calibration;
use crate::force::owner::Force;
use crate::intake::faults::fault::FaultSet;
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
use crate::zero::watch::Purpose;

/// Why a patch has no zero while its boards are configured.
pub(super) const BEING_CONFIGURED: &str = "the boards are being configured, which takes their zero anew";

/// Boards that were not heard for so long after the start do not stream: three of the longest periods.
const SILENT_BOARDS_AFTER: Duration = Duration::from_millis(300);

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
    pub(super) index: usize,
    pub(super) plan: PatchPlan,
    pub(super) intake: Intake,
    pub(super) zero: Zero,
    pub(super) force: Force,
    pub(super) calibration: Calibration,
    pub(super) loads: Loads,
    pub(super) sequence: u64,
    /// The faults of each taxel as last published, and the soundness that they belong to.
    pub(super) faults: (Option<u64>, Arc<[FaultSet]>),
    /// Something changed that readers must see before the next scan.
    pub(super) dirty: bool,
    /// The boards are to be configured once it is known that nothing presses on them, or that they are silent.
    pub(super) bring_up_waits: bool,
    silent_until: Time,
    /// The force that was published last, and from how many taxels; none of them if it is below what can be told from
    /// nothing.
    pub(super) felt: Option<(Newton, usize)>,
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
            bring_up_waits: false,
            silent_until: Time::default(),
            felt: None,
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
        // Boards that stream already show whether something lies on them.
        self.bring_up_waits = !self.plan.bring_up.is_empty() && self.force.models().is_some();
        if self.bring_up_waits {
            self.silent_until = now.time + SILENT_BOARDS_AFTER;
        } else {
            self.configure_boards(now.time);
        }
    }

    /// Boards that do not stream are configured at once; the others are looked at first.
    fn begin_bring_up(&mut self, now: Now, effects: &mut Effects<'_>) {
        if !self.bring_up_waits || self.zero.watching().is_some() {
            return;
        }
        if self.intake.newest().is_some() {
            self.look_before_bring_up(now, effects);
        } else if now.time >= self.silent_until {
            self.bring_up_waits = false;
            self.configure_boards(now.time);
        }
    }

    pub(super) fn configure_boards(&mut self, now: Time) {
        self.zero.on_bring_up();
        self.intake.start_bring_up(now);
    }

    /// Configures the boards again: the zero is lost. Where there is no force that would show a load, boards that stream
    /// are looked at first, unless it is confirmed that nothing touches the skin.
    pub fn bring_up_again(&mut self, now: Now, confirmed: bool, effects: &mut Effects<'_>) {
        let streams = self.intake.silent_taxels() < self.taxels();
        let feels = self.zero.holds() && self.felt.is_some();
        self.bring_up_waits = !confirmed && !feels && self.force.models().is_some() && streams;
        self.lose_zero(now, BEING_CONFIGURED, effects);
        if self.bring_up_waits {
            self.look_before_bring_up(now, effects);
        } else {
            self.configure_boards(now.time);
        }
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
        if !events.is_empty() {
            self.on_intake_events(now, events, effects);
        }
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
        let no_rest = self.end_watch_of_no_rest(now, effects);
        let mut events = Vec::new();
        let left_out = self.calibration.session().is_some_and(|view| view.state.is_open() && !view.left_out.is_empty());
        let around = Surroundings {
            models: self.force.models().map(Arc::as_ref),
            configuring: !self.intake.bring_up().is_done(),
            boards_ready: self.intake.bring_up().is_done() && !self.bring_up_waits,
            parts_left_out: left_out,
            no_rest,
            bag: Bag {
                session_open: self.calibration.open().is_some(),
                presses: self.bag_presses(now),
                holds: self.calibration.is_ramping() && !self.pressure_falls(now.time),
            },
        };
        self.zero.on_scan(now, &self.intake.scan(), around, &mut events);
        self.on_zero_events(now, events, effects);
        self.offer_to_session(now, left_out, effects);
        self.force.follow(&self.intake.scan());
        self.publish(now, effects);
    }

    /// A ramp's zero is taken of boards that keep theirs, and of a skin that nothing presses on. In its first session a
    /// skin has no models that would show a bag that stands at a pressure, but the gauge does.
    /// Returns whether that is not so.
    fn end_watch_of_no_rest(&mut self, now: Now, effects: &mut Effects<'_>) -> bool {
        if !matches!(self.zero.watching(), Some(Purpose::Session { .. })) {
            return false;
        }
        let Err(why) = self.check_set_up().and_then(|()| self.check_vented(now)) else { return false };
        let mut events = Vec::new();
        self.zero.end_watch(why.to_string(), &mut events);
        self.on_zero_events(now, events, effects);
        true
    }

    fn bag_presses(&self, now: Now) -> bool {
        let limits = &self.plan.session;
        let newest = self.intake.gauge().newest();
        newest.is_some_and(|(time, kpa)| now.time.since(time) <= limits.gauge_timeout && kpa > limits.vented_below)
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
        self.begin_bring_up(now, effects);
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
        if self.dirty {
            return Some(Time::from_nanos(i64::MIN)); // now
        }
        let bring_up = (self.bring_up_waits && self.zero.watching().is_none()).then_some(self.silent_until);
        let organs = [self.intake.deadline(), self.zero.deadline(), self.loads.deadline(), self.calibration.deadline()];
        organs.into_iter().chain([bring_up]).flatten().min()
    }

    /// One entry per board.
    #[must_use]
    pub fn board_health(&self) -> Vec<BoardHealth> {
        self.intake.board_health()
    }
}
