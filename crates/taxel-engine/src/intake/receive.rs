//! From frames to scans: the assembler, the faults, the boards, their bring-up and the gauge of one patch.
//!
//! Order of calls: [`Intake::on_module_frame`] and its sisters for each frame, at the frame's own time; when one of them
//! gives [`IntakeEvent::Scan`], [`Intake::scan`] is that scan. [`Intake::tick`] at the latest at [`Intake::deadline`].

mod reports;

use std::sync::Arc;
use std::time::Duration;
use taxel_skin::{BusIndex, Patch, Time};
use taxel_wire::array::TooShort;
use taxel_wire::icub::{Message, Refusal, StatusWord, decode};
use taxel_wire::{Frame, TimedFrame};

use crate::baseline::TaxelBaseline;
use crate::boundary::pushed::PushedScan;
use crate::intake::assembler::{ScanAssembler, ScanEnd};
use crate::intake::boards::{BoardNews, BoardState, ZeroSign};
use crate::intake::bring_up::BringUp;
use crate::intake::cells::Device;
use crate::intake::faults::detector::FaultDetector;
use crate::intake::faults::fault::FaultSet;
use crate::intake::gauge::GaugeHistory;
use crate::intake::pace::Pace;
use crate::plan::PatchPlan;
use crate::regions::Regions;
use crate::scan::Scan;

/// The status of a device that says that it is not well, as a board would say it: nothing is connected.
const NOT_WELL: u16 = 2;

/// What came of frames or of time passing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum IntakeEvent {
    /// A scan has ended; ask for it.
    Scan,
    /// What is learnt of the zero of the board at this position in the patch, in words that name it.
    Board(usize, ZeroSign),
    /// Another patch has the board at this position, too, and must know this of it.
    News(usize, BoardNews),
    /// A module fell silent, or a taxel's faults changed with time alone: readers must see that before the next scan.
    Changed,
}

/// The intake of one patch.
#[derive(Debug)]
pub struct Intake {
    plan: Arc<PatchPlan>,
    /// Per board, whether another patch has modules of it, too.
    shared: Vec<bool>,
    regions: Regions,
    assembler: ScanAssembler,
    paces: Vec<Pace>,
    faults: FaultDetector,
    boards: Vec<BoardState>,
    bring_up: BringUp,
    /// One per board, or none at all.
    devices: Vec<Device>,
    gauge: GaugeHistory,
    /// The scan that ended last.
    end: ScanEnd,
    silent: Vec<bool>,
    sound: Vec<bool>,
    soundness: u64,
    /// One per module, counts.
    jumps: Vec<f32>,
}

impl Intake {
    /// Nothing heard, nothing sent; `shared` says which boards other patches have, too.
    pub fn new(plan: Arc<PatchPlan>, shared: Vec<bool>) -> Self {
        let regions = Regions::new(&plan.patch);
        let modules = plan.patch.modules().len();
        let faults = FaultDetector::new(regions.taxels(), regions.modules(), plan.fault_limits())
            .with_kinds(regions.kinds().iter().copied());
        Self {
            assembler: ScanAssembler::new(&plan.patch, plan.period),
            paces: vec![Pace::new(plan.period); modules],
            faults,
            boards: plan
                .patch
                .boards()
                .iter()
                .map(|board| BoardState::new(format!("board {}", board.address)))
                .collect(),
            bring_up: BringUp::new(modules),
            devices: (0..)
                .zip(&plan.devices)
                .map(|(at, d)| Device::new(&plan.patch, at, d.clone(), plan.period))
                .collect(),
            gauge: GaugeHistory::default(),
            end: ScanEnd::default(),
            silent: vec![true; modules],
            sound: vec![false; regions.taxels()],
            soundness: 0,
            jumps: vec![0.0; modules],
            regions,
            shared,
            plan,
        }
    }

    /// Configures the boards that are `wanted`, if the plan has settings for them: their zeros are lost.
    pub fn start_bring_up(&mut self, now: Time, wanted: &[bool]) {
        let boards = self.boards.iter_mut().zip(self.regions.board_modules()).zip(wanted);
        for ((board, modules), _) in boards.filter(|(_, wanted)| **wanted) {
            board.on_bring_up();
            self.paces[modules.clone()].iter_mut().for_each(Pace::on_bring_up);
        }
        let PatchPlan { patch, bring_up, devices, .. } = &*self.plan;
        self.bring_up.start(now, patch, bring_up, devices, wanted);
    }

    /// Whether each board streams, also if only other patches hear it.
    pub fn streams(&self, now: Time) -> Vec<bool> {
        self.boards.iter().map(|board| board.is_heard(now)).collect()
    }

    /// A frame with an identifier of one of this patch's modules.
    ///
    /// # Errors
    /// [`Refusal`] if its content is not a message; the caller counts it.
    pub fn on_module_frame(
        &mut self,
        module: usize,
        frame: &TimedFrame,
        events: &mut Vec<IntakeEvent>,
    ) -> Result<(), Refusal> {
        match decode(&frame.frame)? {
            Message::Head { values, .. } => self.assembler.pairer(module).head(frame.time, values),
            Message::Tail { values, status, .. } => {
                if let Some(scan) = self.assembler.pairer(module).tail(frame.time, values, status) {
                    self.on_values(module, [scan.time; 2], scan.status, events, |assembler, patch| {
                        assembler.on_module(patch, module, &scan)
                    });
                }
            }
            other => {
                let board = usize::from(self.plan.patch.modules()[module].board);
                self.on_board_message(board, other, events);
            }
        }
        Ok(())
    }

    /// A frame with an identifier of this patch's devices. Returns whether it was one of theirs.
    ///
    /// # Errors
    /// [`TooShort`] if it ends before its numbers do; the caller counts it.
    pub fn on_device_frame(&mut self, frame: &TimedFrame, events: &mut Vec<IntakeEvent>) -> Result<bool, TooShort> {
        let mut ours = false;
        for position in 0..self.devices.len() {
            let Some(brought) = self.devices[position].on_frame(frame)? else { continue };
            ours = true;
            if brought.status {
                let is_well = self.devices[position].is_well();
                let sign = self.boards[position].on_device(frame.time, is_well, &self.plan.live);
                // Before its counts are taken, which may be of another zero.
                events.extend(sign.map(|sign| IntakeEvent::Board(position, sign)));
            }
            for module in brought.modules {
                let device = &self.devices[position];
                let status = if device.is_well() { StatusWord(0) } else { StatusWord(NOT_WELL) };
                let raw = device.counts(module).to_vec();
                self.on_values(module, [frame.time; 2], status, events, |assembler, patch| {
                    assembler.on_cells(patch, module, frame.time, &raw)
                });
            }
        }
        Ok(ours)
    }

    /// A scan that was handed over whole: one raw count per taxel.
    pub fn on_pushed(&mut self, scan: &PushedScan, events: &mut Vec<IntakeEvent>) {
        for module in 0..self.regions.modules().len() {
            let Some(own) = scan.counts.get(self.regions.modules()[module].clone()) else { continue };
            self.on_values(module, [scan.time, scan.taken], StatusWord(0), events, |assembler, patch| {
                assembler.on_cells(patch, module, scan.time, own)
            });
        }
    }

    /// A frame with another identifier of one of this patch's boards.
    ///
    /// # Errors
    /// [`Refusal`] if its content is not a message; the caller counts it.
    pub fn on_board_frame(
        &mut self,
        board: usize,
        frame: &Frame,
        events: &mut Vec<IntakeEvent>,
    ) -> Result<(), Refusal> {
        self.on_board_message(board, decode(frame)?, events);
        Ok(())
    }

    fn on_board_message(&mut self, board: usize, message: Message, events: &mut Vec<IntakeEvent>) {
        self.boards[board].on_message(message);
        self.tell_others(board, BoardNews::Said(message), events);
    }

    fn tell_others(&self, board: usize, news: BoardNews, events: &mut Vec<IntakeEvent>) {
        if self.shared.get(board) == Some(&true) {
            events.push(IntakeEvent::News(board, news));
        }
    }

    /// What another patch has learnt of a board that this one has, too.
    pub fn on_news(&mut self, board: usize, news: &BoardNews, events: &mut Vec<IntakeEvent>) {
        match news {
            BoardNews::Heard(time, status) => self.watch_board(board, *time, *status, events),
            BoardNews::Said(message) => self.boards[board].on_message(*message),
            BoardNews::Moved(why) => events.push(IntakeEvent::Board(board, ZeroSign::Moved(why.clone()))),
        }
    }

    /// All values of a module came, of this time and at that; `write` hands them to the assembler. If its board cannot have sent them
    /// now, the module is out for a while.
    fn on_values(
        &mut self,
        module: usize,
        [time, came]: [Time; 2],
        status: StatusWord,
        events: &mut Vec<IntakeEvent>,
        write: impl FnOnce(&mut ScanAssembler, &Patch) -> Option<ScanEnd>,
    ) {
        if let Some(until) = self.paces[module].on_scan(came) {
            self.faults.suspect_module(came, module, until);
            self.refresh_soundness();
            events.push(IntakeEvent::Changed);
            return;
        }
        let taxels = self.regions.modules()[module].clone();
        let ended = write(&mut self.assembler, &self.plan.patch);
        self.bring_up.heard(module);
        let counts = self.assembler.counts().slice(taxels);
        let faults_changed = self.faults.push_module(time, module, counts, status.0);
        self.jumps[module] = self.faults.jump_counts(time, module);
        let board = usize::from(self.plan.patch.modules()[module].board);
        self.watch_board(board, time, status, events);
        self.tell_others(board, BoardNews::Heard(time, status), events);
        if faults_changed || self.silent[module] {
            self.refresh_soundness();
        }
        if let Some(end) = ended {
            self.end = end;
            events.push(IntakeEvent::Scan);
        }
    }

    /// Looks for signs that the board has lost its zero.
    fn watch_board(&mut self, board: usize, time: Time, status: StatusWord, events: &mut Vec<IntakeEvent>) {
        let suspicion = self.boards[board].on_module(time, status, &self.plan.live);
        // While boards are configured, silence and new zeros are what that is for.
        let suspicion = suspicion.filter(|_| !self.bring_up.is_busy());
        events.extend(suspicion.map(|why| IntakeEvent::Board(board, ZeroSign::Suspect(why))));
    }

    /// A reading of the gauge.
    pub fn on_pressure(&mut self, time: Time, pressure: taxel_skin::Kilopascal) {
        self.gauge.push(time, pressure);
    }

    /// What the gauge reads as `kpa` is 0 kPa.
    pub fn count_gauge_from(&mut self, kpa: taxel_skin::Kilopascal) {
        self.gauge.count_from(kpa.0);
    }

    /// The host may have lost frames of a bus, of all without one, of so long a time before `now` at the most.
    pub fn on_frames_lost(&mut self, now: Time, bus: Option<BusIndex>, gap: Duration) {
        let states = self.boards.iter_mut().zip(self.plan.patch.boards());
        let there = states.filter(|(_, board)| bus.is_none_or(|bus| board.bus == bus));
        there.for_each(|(state, _)| state.on_frames_lost(now, gap));
    }

    /// Time passed. Frames to send come with the position of their board.
    pub fn tick(&mut self, now: Time, send: &mut Vec<(usize, Frame)>, events: &mut Vec<IntakeEvent>) {
        send.extend(std::iter::from_fn(|| self.bring_up.next_due(now)));
        let incomplete = self.bring_up.tick(now);
        let silent = self.assembler.mark_stale(now, self.plan.live.stale_after);
        let unsound = !silent.is_empty();
        silent.into_iter().for_each(|module| self.faults.on_silent(now, module));
        if unsound {
            self.refresh_soundness();
        }
        if incomplete || unsound {
            events.push(IntakeEvent::Changed);
        }
    }

    /// When [`Intake::tick`] has something to do at the latest, if nothing comes before.
    pub fn deadline(&self) -> Option<Time> {
        let silence = self.assembler.first_silence(self.plan.live.stale_after);
        [self.bring_up.deadline(), silence].into_iter().flatten().min()
    }

    /// What the counts of each taxel scatter by at rest, counts (NaN: not known).
    pub fn expect_noise(&mut self, baseline: &[TaxelBaseline]) {
        let steps_per_count = self.regions.counts().per_unit();
        self.faults.expect_noise(baseline.iter().map(|taxel| taxel.noise), steps_per_count);
    }

    fn refresh_soundness(&mut self) {
        let (modules, module_of) = (self.assembler.modules(), self.regions.module_of());
        for (silent, module) in self.silent.iter_mut().zip(modules) {
            *silent = module.stale;
        }
        for (taxel, sound) in self.sound.iter_mut().enumerate() {
            *sound = !self.silent[usize::from(module_of[taxel])] && self.faults.faults(taxel).is_empty();
        }
        self.soundness += 1;
    }

    /// The scan that ended last, with what is valid of it now.
    pub fn scan(&self) -> Scan<'_> {
        Scan {
            time: self.end.time,
            whole: self.end.whole,
            counts: self.assembler.counts(),
            pads: self.assembler.pads(),
            silent: &self.silent,
            sound: &self.sound,
            soundness: self.soundness,
            jumps: &self.jumps,
        }
    }

    /// Whether every module but those that are `left_out` was received within `limit` of the newest one.
    pub fn is_whole_without(&self, limit: Duration, left_out: impl Fn(usize) -> bool) -> bool {
        self.assembler.is_whole_without(limit, left_out)
    }

    /// Receive time of the newest frame; `None` before the first.
    pub fn newest(&self) -> Option<Time> {
        self.assembler.newest()
    }

    /// When each module was last received whole.
    pub fn last_heard(&self) -> impl Iterator<Item = Option<Time>> {
        self.assembler.modules().iter().map(|module| module.last)
    }

    /// The faults of a taxel now.
    pub fn faults(&self, taxel: usize) -> FaultSet {
        self.faults.faults(taxel)
    }

    /// The recent past of the pressure.
    pub const fn gauge(&self) -> &GaugeHistory {
        &self.gauge
    }

    /// Where the bring-up stands.
    pub const fn bring_up(&self) -> &BringUp {
        &self.bring_up
    }

    /// The parts of the patch.
    pub const fn regions(&self) -> &Regions {
        &self.regions
    }

    /// Taxels of silent modules.
    pub fn silent_taxels(&self) -> usize {
        let modules = self.silent.iter().zip(self.regions.modules());
        modules.filter(|(silent, _)| **silent).map(|(_, range)| range.len()).sum()
    }
}
