//! One patch: its live counts, zero, models, session and boards, owned in one place.

use std::ops::Range;
use std::sync::Arc;
use taxel_skin::Time;
use taxel_wire::icub::{Message, ModuleScan, Refusal, decode};
use taxel_wire::{Frame, TimedFrame};

use crate::boards::BoardLive;
use crate::bring_up::{BringUp, BringUpState};
use crate::compensate::Compensator;
use crate::drift::{Drift, drift_sites};
use crate::evaluate::{Activation, Evaluator};
use crate::faults::{Fault, FaultDetector, FaultSet};
use crate::force::ForceParts;
use crate::gauge::GaugeHistory;
use crate::io::{Now, Output};
use crate::live::{Live, ScanEnd};
use crate::model_set::ModelSet;
use crate::plan::PatchPlan;
use crate::rest::{Lift, RestStatistics, TaxelBaseline};
use crate::session::SessionRun;
use crate::tare::Tare;

/// All state of one patch. The parts are shared between this crate's modules, each of which tells one story:
/// `patch` takes frames, `zero` the tare, `publish` the snapshots, `procedure` the session.
#[derive(Debug)]
pub struct PatchEngine {
    pub(crate) index: usize,
    pub(crate) plan: PatchPlan,
    pub(crate) live: Live,
    pub(crate) boards: Vec<BoardLive>,
    pub(crate) gauge: GaugeHistory,
    pub(crate) faults: FaultDetector,
    pub(crate) tare: Tare,
    /// How far the counts at rest have moved from the zero; `None` where that is not followed.
    pub(crate) drift: Option<Drift>,
    /// Watches whether the skin becomes lighter than its zero, window by window.
    pub(crate) lift_watch: RestStatistics,
    pub(crate) lift: Option<Lift>,
    /// Which taxels form each module.
    pub(crate) modules: Vec<Range<usize>>,
    pub(crate) bring_up: BringUp,
    pub(crate) model_set: Option<Arc<ModelSet>>,
    pub(crate) evaluator: Option<Evaluator>,
    pub(crate) parts: ForceParts,
    pub(crate) session: Option<SessionRun>,
    pub(crate) sequence: u64,
    pub(crate) uncovered_share: f64,
    /// Hysteresis of the active model set at the present zero, where it is compensated.
    pub(crate) compensator: Option<Compensator>,
    /// The module of each taxel.
    pub(crate) module_of: Arc<[u16]>,
    /// The faults of each taxel as last published.
    pub(crate) faults_seen: Arc<[FaultSet]>,
    /// Which taxels were silent when the evaluator's selection was last made; empty if it was never.
    pub(crate) selected_with: Vec<bool>,
    /// Something changed that readers must see before the next scan.
    pub(crate) dirty: bool,
    pub(crate) session_dirty: bool,
    pub(crate) session_shown: Time,
}

impl PatchEngine {
    /// Nothing heard, nothing sent.
    #[must_use]
    pub fn new(index: usize, plan: PatchPlan) -> Self {
        let taxels = plan.patch.taxels().len();
        let (modules, boards) = taxel_ranges(&plan);
        Self {
            index,
            live: Live::new(&plan.patch, plan.period),
            boards: vec![BoardLive::default(); plan.patch.boards().len()],
            gauge: GaugeHistory::default(),
            faults: FaultDetector::new(taxels, &modules, &boards, plan.faults)
                .with_kinds(plan.patch.modules().iter().map(|site| site.kind)),
            lift_watch: RestStatistics::new(taxels).in_modules(modules.iter().cloned()),
            lift: None,
            modules,
            tare: Tare::default(),
            drift: plan.drift.follow.then(|| Drift::new(plan.drift, activation(&plan), drift_sites(&plan))),
            bring_up: BringUp::new(plan.patch.modules().len()),
            model_set: None,
            evaluator: None,
            parts: ForceParts::new(&plan),
            session: None,
            sequence: 0,
            uncovered_share: 1.0,
            compensator: None,
            module_of: plan.patch.taxels().iter().map(|site| site.module).collect(),
            faults_seen: Arc::from(vec![FaultSet::default(); taxels]),
            selected_with: Vec::new(),
            dirty: true,
            session_dirty: false,
            session_shown: Time::default(),
            plan,
        }
    }

    /// Starts the boards and waits for rest.
    pub fn start(&mut self, now: Now) {
        self.tare.lose("no zero has been taken since start");
        self.bring_up.start(now.time, &self.plan.patch, &self.plan.bring_up);
    }

    /// Configures the boards again: the zero is lost.
    pub fn bring_up_again(&mut self, now: Now) {
        self.lose_zero("the boards are being configured, which takes their zero anew");
        self.bring_up.start(now.time, &self.plan.patch, &self.plan.bring_up);
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
        out: &mut Vec<Output>,
    ) -> Result<(), Refusal> {
        match decode(&frame.frame)? {
            Message::Head { values, .. } => self.live.pairer(module).head(frame.time, values),
            Message::Tail { values, status, .. } => {
                if let Some(scan) = self.live.pairer(module).tail(frame.time, values, status) {
                    self.on_module(now, module, &scan, out);
                }
            }
            other => {
                let board = self.plan.patch.modules()[module].board as usize;
                self.on_board_message(board, other);
            }
        }
        Ok(())
    }

    /// A frame with another identifier of one of this patch's boards.
    ///
    /// # Errors
    /// [`Refusal`] if its content is not a message; the caller counts it.
    pub fn on_board_frame(&mut self, board: usize, frame: &Frame) -> Result<(), Refusal> {
        self.on_board_message(board, decode(frame)?);
        Ok(())
    }

    fn on_board_message(&mut self, board: usize, message: Message) {
        let live = &mut self.boards[board];
        match message {
            Message::Thermometer { deci_celsius, .. } => live.on_temperature(deci_celsius),
            Message::FirmwareVersion { version, .. } => live.on_firmware(version),
            Message::BoardOverflow { .. } => live.on_overflow(),
            Message::Head { .. } | Message::Tail { .. } => {} // a module that the plan does not read
        }
    }

    fn on_module(&mut self, now: Now, module: usize, scan: &ModuleScan, out: &mut Vec<Output>) {
        let site = self.plan.patch.modules()[module];
        let end = self.live.on_module(&self.plan.patch, module, scan);
        self.bring_up.heard(module);
        let first = site.first_taxel as usize;
        let taxels = first..first + site.kind.taxel_slots().len();
        self.faults.push_module(scan.time, module, &self.live.counts()[taxels.clone()], scan.status.0);
        let board = site.board as usize;
        let doubt = self.boards[board].on_module(scan.time, scan.status, self.plan.live.power_cycle_after);
        let address = self.plan.patch.boards()[board].address;
        if let Some(why) = doubt.filter(|_| !self.bring_up.is_busy()) {
            self.lose_zero(format!("board {address} {why}"));
        }
        if self.faults.faults(first).contains(Fault::BoardStep) {
            self.lose_zero(format!("all taxels of board {address} stepped at once: it has taken a new zero"));
        }
        if let Some(end) = end {
            self.on_scan(now, end, out);
        }
    }

    fn on_scan(&mut self, now: Now, end: ScanEnd, out: &mut Vec<Output>) {
        self.watch_rest(now, end, out);
        self.watch_lift();
        self.offer_to_session(now, end, out);
        self.follow_drift(now, end);
        self.follow_hysteresis(end);
        self.publish(now, out);
    }

    /// The plays of sound taxels follow the scan.
    fn follow_hysteresis(&mut self, end: ScanEnd) {
        let (Some(compensator), Some(evaluator)) = (&mut self.compensator, &mut self.evaluator) else { return };
        let (faults, modules, module_of) = (&self.faults, self.live.modules(), &self.module_of);
        let sound = |taxel: usize| faults.faults(taxel).is_empty() && !modules[usize::from(module_of[taxel])].stale;
        compensator.follow(end.time, self.live.counts(), sound);
        evaluator.bend(Some(compensator.bend_kpa()));
    }

    /// Time passed.
    pub fn tick(&mut self, now: Now, out: &mut Vec<Output>) {
        while let Some((board, frame)) = self.bring_up.next_due(now.time) {
            out.push(Output::Send(self.plan.patch.boards()[board].bus, frame));
        }
        self.bring_up.tick(now.time);
        let silent = self.live.mark_stale(now.time, self.plan.live.stale_after);
        self.dirty |= !silent.is_empty();
        self.dirty |= self.faults.tick(now.time);
        self.tick_rest(now, out);
        self.advance_session(now, out);
        if self.dirty {
            self.publish(now, out);
        }
        self.show_session(now, out);
    }

    /// Installs a model set; its tables follow the zero.
    pub fn set_model_set(&mut self, set: Arc<ModelSet>) {
        self.faults.expect_noise(set.baseline.iter().map(|taxel| taxel.noise));
        self.model_set = Some(set);
        self.rebuild_tables();
    }

    /// The zero or the model set changed.
    pub(crate) fn rebuild_tables(&mut self) {
        let zero = self.zero_now();
        self.compensator = match (&self.model_set, &zero) {
            (Some(set), Some(zero)) => Compensator::new(set, zero),
            _ => None,
        };
        self.tabulate(zero.as_deref());
        self.lift = None;
        self.lift_watch = self.rest_statistics();
        self.dirty = true;
    }

    /// The zero has drifted: all that has a history keeps it.
    pub(crate) fn move_tables(&mut self) {
        let zero = self.zero_now();
        if let (Some(compensator), Some(zero)) = (&mut self.compensator, &zero) {
            compensator.shift_zero(zero);
        }
        self.tabulate(zero.as_deref());
    }

    fn tabulate(&mut self, zero: Option<&[TaxelBaseline]>) {
        self.evaluator = match (&self.model_set, zero) {
            (Some(set), Some(zero)) => {
                Some(Evaluator::new(Arc::clone(set), zero, &self.plan.areas, activation(&self.plan)))
            }
            _ => None,
        };
        if let (Some(compensator), Some(evaluator)) = (&self.compensator, &mut self.evaluator) {
            evaluator.bend(Some(compensator.bend_kpa()));
        }
        self.selected_with.clear();
    }

    /// Whether boards are expected to send.
    pub(crate) fn is_set_up(&self) -> bool {
        !matches!(self.bring_up.state(), BringUpState::Configuring | BringUpState::Proving)
    }
}

fn activation(plan: &PatchPlan) -> Activation {
    Activation { sigmas: plan.live.activation_sigmas, floor_counts: plan.live.activation_floor_counts }
}

/// Which taxels belong to each module and to each board.
fn taxel_ranges(plan: &PatchPlan) -> (Vec<Range<usize>>, Vec<Range<usize>>) {
    let mut boards: Vec<Range<usize>> = vec![0..0; plan.patch.boards().len()];
    let mut modules = Vec::new();
    for site in plan.patch.modules() {
        let first = site.first_taxel as usize;
        let range = first..first + site.kind.taxel_slots().len();
        let board = &mut boards[site.board as usize];
        // A board's modules follow each other.
        *board = if board.start == board.end { range.clone() } else { board.start..range.end };
        modules.push(range);
    }
    (modules, boards)
}
