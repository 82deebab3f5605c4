//! The whole installation on one bus, driven by time alone.
//!
//! Every part keeps the time of its own next event; the world takes them in order. So the course of things depends on
//! the seed and on when commands come, never on how the caller cuts time.

use crate::bag::{Bag, PumpCommand, STEP_NS};
use crate::board::{Board, bring_up};
use crate::bus::Bus;
use crate::config::{Config, ConfigError};
use crate::converter::Flicker;
use crate::dielectric::Fabric;
use crate::faults::{Fault, FaultError};
use crate::gauge::Gauge;
use crate::load::{LoadError, Mass};
use crate::rng::{Rng, Stream};
use crate::skin::Skin;
use crate::thermal::Temperature;
use std::collections::VecDeque;
use std::time::Duration;
use taxel_skin::{BoardAddress, Kilopascal, Newton, TaxelIndex, Time};
use taxel_wire::icub::Command;
use taxel_wire::{Frame, TimedFrame};

/// One grid step of the bag.
const BAG_STEP: Duration = Duration::from_nanos(STEP_NS as u64);
/// Commands that wait for their time; a host sends a few dozen at once.
const INBOX_FRAMES: usize = 4096;

/// What happens next, in the order in which simultaneous events are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Event {
    Bag,
    PowerOn(usize),
    Command,
    Conversion(usize),
    Scan(usize),
    Thermometer(usize),
    Gauge,
    Bus,
}

/// What became of the frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameCounts {
    /// Frames that the receiver got.
    pub received: u64,
    /// Frames that went over the wire and were lost at the receiver ([`Fault::FramesLost`]).
    pub lost: u64,
    /// Frames that never left their sender because the bus was full, or that a dying sender took along.
    pub unsent: u64,
    /// Frames from the host that no board understood, or that came when too many were waiting.
    pub ignored: u64,
}

/// A skin in a bag, with boards, gauge, pump and masses, on one CAN bus.
#[derive(Clone, Debug)]
pub struct World {
    skin: Skin,
    start: Time,
    now: Time,
    bag: Bag,
    bag_time: Time,
    temperature: Temperature,
    gauge: Gauge,
    boards: Vec<Board>,
    bus: Bus,
    inbox: VecDeque<TimedFrame>,
    insensitive: Vec<bool>,
    loads_kpa: Vec<f64>,
    /// Bag and loads together, of the last conversion; kept to save an allocation.
    pressures_kpa: Vec<f64>,
    counts: FrameCounts,
}

impl World {
    /// A world at rest: no vacuum, no load.
    ///
    /// # Errors
    /// [`ConfigError`] for a field out of its range.
    pub fn new(skin: Skin, config: Config) -> Result<Self, ConfigError> {
        config.validate()?;
        let Config { seed, start, .. } = config;
        let taxels = skin.sites().len();
        let mut fabric = Fabric::new(&config.dielectric, taxels, Rng::new(seed, Stream::Fabric));
        let mut boards = Vec::new();
        let mut first_taxel = 0;
        for (index, board) in skin.patch().boards().iter().enumerate() {
            let origin = (seed, start);
            let name = (index, board.address);
            boards.push(Board::new(name, &board.modules, first_taxel, &mut fabric, &config.boards, origin));
            first_taxel += board.modules.iter().map(|(_, kind)| kind.taxel_slots().len()).sum::<usize>();
        }
        Ok(Self {
            start,
            now: start,
            bag: Bag::new(config.bag),
            bag_time: start,
            temperature: Temperature::new(config.thermal, seed),
            gauge: Gauge::new(config.gauge, seed, start),
            bus: Bus::new(boards.len() + 1, seed, start),
            boards,
            inbox: VecDeque::new(),
            insensitive: fabric.insensitive().to_vec(),
            loads_kpa: vec![0.0; taxels],
            pressures_kpa: vec![0.0; taxels],
            counts: FrameCounts::default(),
            skin,
        })
    }

    /// Lets time pass up to and including `until`; appends the frames that the host receives, in order of time.
    /// Time never goes back: an earlier `until` does nothing.
    pub fn advance(&mut self, until: Time, out: &mut Vec<TimedFrame>) {
        while let Some((time, event)) = self.next_event().filter(|(time, _)| *time <= until) {
            self.now = self.now.max(time);
            self.handle(time, event, out);
        }
        self.now = self.now.max(until);
    }

    /// The host sends a frame at `time`, or now if that is past. Boards understand the commands of `taxel_wire`.
    pub fn send(&mut self, time: Time, frame: &Frame) {
        if self.inbox.len() >= INBOX_FRAMES {
            self.counts.ignored += 1;
            return;
        }
        let time = time.max(self.now);
        let place = self.inbox.partition_point(|waiting| waiting.time <= time);
        self.inbox.insert(place, TimedFrame { time, frame: *frame });
    }

    /// Sends every board the commands of [`bring_up`] for the modules it carries.
    pub fn bring_up_boards(&mut self, time: Time) {
        let mut frames = Vec::new();
        for board in self.skin.patch().boards() {
            let modules: Vec<_> = board.modules.iter().map(|(module, _)| *module).collect();
            frames.extend(bring_up(&modules).iter().map(|command| command.encode(board.address)));
        }
        for frame in frames {
            self.send(time, &frame);
        }
    }

    /// Tells the pump what to do from now on.
    pub fn pump(&mut self, command: PumpCommand) {
        self.bag.command(command);
    }

    /// Lays a mass on the skin, beside those that lie there; the force it adds.
    ///
    /// # Errors
    /// [`LoadError`] for a mass that cannot lie there; then nothing changes.
    pub fn lay(&mut self, mass: Mass) -> Result<Newton, LoadError> {
        for (taxel, kpa) in mass.pressures(&self.skin)? {
            self.loads_kpa[taxel] += kpa;
        }
        Ok(mass.weight())
    }

    /// Takes all masses away.
    pub fn clear(&mut self) {
        self.loads_kpa.fill(0.0);
    }

    /// Makes something go wrong, from now on.
    ///
    /// # Errors
    /// [`FaultError`] for a board or taxel that does not exist.
    pub fn inject(&mut self, fault: Fault) -> Result<(), FaultError> {
        self.set_fault(fault, true)
    }

    /// Ends a fault of this kind at this place; its numbers do not matter. What happens once cannot be repaired.
    ///
    /// # Errors
    /// [`FaultError`] for a board or taxel that does not exist.
    pub fn repair(&mut self, fault: Fault) -> Result<(), FaultError> {
        self.set_fault(fault, false)
    }

    fn set_fault(&mut self, fault: Fault, on: bool) -> Result<(), FaultError> {
        match fault {
            Fault::BoardSilent(board) => {
                let index = self.board(board)?;
                self.boards[index].silent = on;
                self.counts.unsent += self.bus.discard(index);
            }
            Fault::PowerCycle { board, off } => {
                let index = self.board(board)?;
                if on {
                    self.boards[index].power_off(self.now + off);
                    self.counts.unsent += self.bus.discard(index);
                }
            }
            Fault::SilentRetare(board) => {
                let index = self.board(board)?;
                if on {
                    self.boards[index].retare();
                }
            }
            Fault::ModuleSilent(board, module) => {
                let index = self.board(board)?;
                self.boards[index].converter(module).ailments.silent = on;
            }
            Fault::ModuleUnplugged(board, module) => {
                let index = self.board(board)?;
                self.boards[index].converter(module).ailments.unplugged = on;
            }
            Fault::ModuleNoAck(board, module) => {
                let index = self.board(board)?;
                self.boards[index].converter(module).ailments.no_ack = on;
            }
            Fault::ModuleFlicker { board, module, probability, depth_counts } => {
                let index = self.board(board)?;
                let flicker = on.then_some(Flicker { probability, depth_counts });
                self.boards[index].converter(module).ailments.flicker = flicker;
            }
            Fault::TaxelFrozen(taxel) => self.freeze(taxel, on)?,
            Fault::FramesLost { probability } => self.bus.loss_probability = if on { probability } else { 0.0 },
            Fault::GaugeSilent => self.gauge.silent = on,
            Fault::GaugeStuck => self.gauge.stuck = on,
        }
        Ok(())
    }

    fn freeze(&mut self, taxel: TaxelIndex, on: bool) -> Result<(), FaultError> {
        let patch = self.skin.patch();
        let taxels = patch.taxels().len();
        let site = patch.taxels().get(taxel.get()).ok_or(FaultError::Taxel { taxel: taxel.0, taxels })?;
        let module = patch.modules()[usize::from(site.module)];
        let converter = self.boards[usize::from(module.board)].converter(module.module);
        converter.ailments.frozen[usize::from(site.slot)] = on;
        Ok(())
    }

    fn board(&self, address: BoardAddress) -> Result<usize, FaultError> {
        self.boards.iter().position(|board| board.address == address).ok_or(FaultError::Board(address))
    }

    fn next_event(&self) -> Option<(Time, Event)> {
        let mut next = (self.bag_time + BAG_STEP, Event::Bag);
        let mut offer = |time: Option<Time>, event: Event| {
            if let Some(time) = time {
                next = next.min((time, event));
            }
        };
        offer(Some(self.gauge.next), Event::Gauge);
        offer(self.bus.next(), Event::Bus);
        offer(self.inbox.front().map(|waiting| waiting.time), Event::Command);
        for (index, board) in self.boards.iter().enumerate() {
            offer(Some(board.next_conversion), Event::Conversion(index));
            offer(board.next_scan, Event::Scan(index));
            offer(board.next_thermometer, Event::Thermometer(index));
            offer(board.power_on_at, Event::PowerOn(index));
        }
        // Saturated time is the end of the world: nothing may happen twice at the same instant for ever.
        (next.0 < Time::from_nanos(i64::MAX)).then_some(next)
    }

    fn handle(&mut self, time: Time, event: Event, out: &mut Vec<TimedFrame>) {
        match event {
            Event::Bag => {
                self.bag.step();
                self.bag_time = time;
            }
            Event::PowerOn(index) => self.boards[index].power_on(),
            Event::Command => self.obey(time),
            Event::Conversion(index) => {
                let temperature = self.temperature.rise_k(time.seconds_since(self.start));
                let bag_kpa = self.bag_kpa(time);
                for (pressure, load) in self.pressures_kpa.iter_mut().zip(&self.loads_kpa) {
                    *pressure = bag_kpa + load;
                }
                self.boards[index].convert(&self.pressures_kpa, temperature);
            }
            Event::Scan(index) => self.scan(index, time),
            Event::Thermometer(index) => {
                let celsius = self.temperature.celsius(time.seconds_since(self.start));
                let frame = self.boards[index].thermometer(time, celsius);
                self.emit(index, time, frame);
            }
            Event::Gauge => {
                if let Some(frame) = self.gauge.read(self.bag_kpa(time)) {
                    self.queue(self.boards.len(), time, frame);
                }
            }
            Event::Bus => {
                if let Some(frame) = self.bus.step(time) {
                    self.counts.received += 1;
                    out.push(frame);
                }
            }
        }
    }

    fn obey(&mut self, now: Time) {
        let Some(waiting) = self.inbox.pop_front() else { return };
        let command = Command::decode(&waiting.frame);
        let index = command.and_then(|(address, _)| self.board(address).ok());
        let (Some((_, command)), Some(index)) = (command, index) else {
            self.counts.ignored += 1;
            return;
        };
        if let Some(reply) = self.boards[index].command(now, command) {
            self.emit(index, now, reply.encode());
        }
    }

    fn scan(&mut self, index: usize, now: Time) {
        // The board's frames are built first: sending needs the bus, which belongs to the world.
        let mut frames = Vec::with_capacity(32);
        self.boards[index].scan(now, |frame| frames.push(frame));
        for frame in frames {
            self.emit(index, now, frame);
        }
    }

    /// A board sends, if it can.
    fn emit(&mut self, index: usize, now: Time, frame: Frame) {
        if !self.boards[index].speaks() || self.queue(index, now, frame) {
            return;
        }
        if let Some(notice) = self.boards[index].overflow() {
            self.counts.unsent += self.bus.discard(index);
            self.queue(index, now, notice);
        }
    }

    fn queue(&mut self, port: usize, now: Time, frame: Frame) -> bool {
        let taken = self.bus.queue(port, now, frame);
        self.counts.unsent += u64::from(!taken);
        taken
    }

    fn bag_kpa(&self, time: Time) -> f64 {
        self.bag.pressure_after(time.seconds_since(self.bag_time))
    }

    /// The skin of this world.
    #[must_use]
    pub const fn skin(&self) -> &Skin {
        &self.skin
    }

    /// The time up to which everything has happened.
    #[must_use]
    pub const fn now(&self) -> Time {
        self.now
    }

    /// What became of the frames so far.
    #[must_use]
    pub const fn frame_counts(&self) -> FrameCounts {
        FrameCounts { lost: self.bus.frames_lost, ..self.counts }
    }

    /// The true differential pressure of the bag.
    #[must_use]
    pub fn true_pressure(&self) -> Kilopascal {
        Kilopascal(self.bag_kpa(self.now))
    }

    /// The true pressure on every taxel, bag and masses together, in the patch's order.
    pub fn true_taxel_pressures(&self) -> impl Iterator<Item = Kilopascal> {
        let bag = self.true_pressure().0;
        self.loads_kpa.iter().map(move |load| Kilopascal(bag + load))
    }

    /// The true normal force on the skin, bag and masses together: the sum of pressure times area over all taxels.
    /// Without vacuum it is the weight of the masses.
    #[must_use]
    pub fn true_force(&self) -> Newton {
        self.true_taxel_pressures().map(|pressure| pressure.on(self.skin.taxel_area())).sum()
    }

    /// The same as a vector in newton: the sum of pressure times area times *outward* normal, as calibrated skin
    /// reports it. The push on the limb is its opposite.
    #[must_use]
    pub fn true_force_vector(&self) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (pressure, pose) in self.true_taxel_pressures().zip(self.skin.poses()) {
            let force = pressure.on(self.skin.taxel_area()).0;
            for (sum, n) in sum.iter_mut().zip(pose.normal) {
                *sum += force * n;
            }
        }
        sum
    }

    /// Which taxels were made insensitive, in the patch's order.
    #[must_use]
    pub fn insensitive_taxels(&self) -> &[bool] {
        &self.insensitive
    }
}
