//! The whole installation on one bus, driven by time alone.
//!
//! Every part keeps the time of its own next event; the world takes them in order. So the course of things depends on
//! the seed and on when commands come, never on how the caller cuts time.

mod faults;
mod loads;
mod truth;

use crate::bag::{Bag, PumpCommand, STEP_NS};
use crate::board::{Board, bring_up};
use crate::bus::Bus;
use crate::config::Config;
use crate::dielectric::Fabric;
use crate::foreign::ForeignNode;
use crate::gauge::Gauge;
use crate::loads::Loads;
use crate::receiver::Receiver;
use crate::rng::{Rng, Stream};
use crate::skin::Skin;
use crate::thermal::Temperature;
use std::collections::VecDeque;
use std::time::Duration;
use taxel_skin::{BoardAddress, Time};
use taxel_wire::icub::Command;
use taxel_wire::{Frame, TimedFrame};

/// One grid step of the bag.
const BAG_STEP: Duration = Duration::from_nanos(STEP_NS as u64);

/// What happens next, in the order in which simultaneous events are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Event {
    Bag,
    PowerOn(usize),
    Command,
    Conversion(usize),
    Scan(usize),
    Gauge,
    Bus,
    Recover(usize),
    Foreign(usize),
    Receiver,
}

/// A skin in a bag, with boards, gauge, pump and masses, on one CAN bus.
#[derive(Clone, Debug)]
pub struct World {
    skin: Skin,
    seed: u64,
    start: Time,
    now: Time,
    bag: Bag,
    bag_time: Time,
    temperature: Temperature,
    gauge: Gauge,
    boards: Vec<Board>,
    /// Nodes that use the identifiers of the board of the same number.
    foreign: Vec<Option<ForeignNode>>,
    bus: Bus,
    receiver: Receiver,
    inbox: VecDeque<TimedFrame>,
    loads: Loads,
    /// Of the bag's pressure, by taxel.
    bag_share: Vec<f64>,
    days: usize,
    day_gain_sd: [f64; 2],
    /// Bag and loads together, of the last conversion; kept to save an allocation.
    pressures_kpa: Vec<f64>,
}

impl World {
    /// A world at rest: no vacuum, no load.
    #[must_use]
    pub fn new(skin: Skin, config: Config) -> Self {
        let Config { seed, start, .. } = config;
        let taxels = skin.poses().len();
        let mut fabric = Fabric::new(&config.dielectric, taxels, Rng::new(seed, Stream::Fabric));
        let mut boards = Vec::new();
        let mut first_taxel = 0;
        for (index, board) in skin.patch().boards().iter().enumerate() {
            let origin = (seed, start);
            let name = (index, board.address);
            boards.push(Board::new(name, &board.modules, first_taxel, &mut fabric, &config.boards, origin));
            first_taxel += board.modules.iter().map(|(_, kind)| kind.taxel_slots().len()).sum::<usize>();
        }
        Self {
            seed,
            start,
            now: start,
            bag_share: wrinkles(config.bag.wrinkle_sd, taxels, seed),
            days: 0,
            day_gain_sd: config.dielectric.day_gain_sd,
            loads: Loads::new(&skin, config.loads),
            bag: Bag::new(config.bag),
            bag_time: start,
            temperature: Temperature::new(config.thermal, seed),
            gauge: Gauge::new(config.gauge, seed, start),
            // The boards, the gauge, and a foreign node for each board.
            bus: Bus::new(2 * boards.len() + 1, seed, start),
            receiver: Receiver::new(seed),
            foreign: vec![None; boards.len()],
            boards,
            inbox: VecDeque::new(),
            pressures_kpa: vec![0.0; taxels],
            skin,
        }
    }

    /// Lets time pass up to and including `until`; appends the frames that the host receives, in order of time.
    /// Time never goes back: an earlier `until` does nothing.
    pub fn advance(&mut self, until: Time, out: &mut Vec<TimedFrame>) {
        let mut of_boards = self.next_of_boards();
        while let Some((time, event)) = self.next_event(of_boards).filter(|(time, _)| *time <= until) {
            self.now = self.now.max(time);
            self.handle(time, event, out);
            // Most events are of the wire, and none of these three changes what a board does next.
            if !matches!(event, Event::Bag | Event::Gauge | Event::Bus) {
                of_boards = self.next_of_boards();
            }
        }
        self.now = self.now.max(until);
    }

    /// The host sends a frame at `time`, or now if that is past. Boards understand the commands of `taxel_wire`.
    pub fn send(&mut self, time: Time, frame: &Frame) {
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

    /// What happens from now on is drawn from another seed: noise, residues of tares, times on the bus, faults. The skin,
    /// its history and the clocks of the boards stay as they are.
    pub fn reseed(&mut self, seed: u64) {
        for (index, board) in self.boards.iter_mut().enumerate() {
            board.reseed(seed, index);
        }
        self.gauge.reseed(seed);
        self.bus.reseed(seed);
        self.receiver.reseed(seed);
        self.seed = seed;
    }

    /// Another day: the gains of skin and taxels are others; see [`crate::DielectricConfig::day_gain_sd`].
    pub fn next_day(&mut self) {
        self.days += 1;
        let mut rng = Rng::new(self.seed, Stream::Day(self.days));
        let [common_sd, own_sd] = self.day_gain_sd;
        let common = common_sd * rng.truncated_normal(2.5);
        for board in &mut self.boards {
            board.scale_gains(|| 1.0 + common + own_sd * rng.truncated_normal(2.5));
        }
    }

    fn board(&self, address: BoardAddress) -> Option<usize> {
        self.boards.iter().position(|board| board.address == address)
    }

    fn next_event(&self, of_boards: (Time, Event)) -> Option<(Time, Event)> {
        let mut next = of_boards.min((self.bag_time + BAG_STEP, Event::Bag));
        let mut offer = |time: Option<Time>, event: Event| {
            if let Some(time) = time {
                next = next.min((time, event));
            }
        };
        offer(Some(self.gauge.next), Event::Gauge);
        offer(self.bus.next(), Event::Bus);
        offer(self.inbox.front().map(|waiting| waiting.time), Event::Command);
        offer(self.receiver.next(), Event::Receiver);
        // Saturated time is the end of the world: nothing may happen twice at the same instant for ever.
        (next.0 < Time::from_nanos(i64::MAX)).then_some(next)
    }

    /// What the boards, and nodes that pretend to be boards, do next.
    fn next_of_boards(&self) -> (Time, Event) {
        let mut next = (Time::from_nanos(i64::MAX), Event::Receiver);
        let mut offer = |time: Option<Time>, event: Event| {
            if let Some(time) = time {
                next = next.min((time, event));
            }
        };
        for (index, board) in self.boards.iter().enumerate() {
            offer(Some(board.next_conversion), Event::Conversion(index));
            offer(board.next_scan, Event::Scan(index));
            offer(board.power_on_at, Event::PowerOn(index));
            offer(board.hung_until, Event::Recover(index));
        }
        for (index, node) in self.foreign.iter().enumerate() {
            offer(node.as_ref().map(|node| node.next), Event::Foreign(index));
        }
        next
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
                self.loads.write(time, &self.skin, &mut self.pressures_kpa);
                let all = self.pressures_kpa.iter_mut().zip(&self.bag_share);
                all.for_each(|(pressure, share)| *pressure += bag_kpa * share);
                self.boards[index].convert(&self.pressures_kpa, temperature);
            }
            Event::Scan(index) => self.scan(index, time),
            Event::Gauge => {
                if let Some(frame) = self.gauge.read(self.bag_kpa(time)) {
                    self.bus.queue(self.boards.len(), time, frame);
                }
            }
            Event::Bus => {
                if let Some(frame) = self.bus.step(time) {
                    self.receiver.take(frame, out);
                }
            }
            Event::Recover(index) => self.boards[index].recover(),
            Event::Foreign(index) => self.pretend(index, time),
            Event::Receiver => self.receiver.step(time, out),
        }
    }

    fn obey(&mut self, now: Time) {
        let Some(waiting) = self.inbox.pop_front() else { return };
        let command = Command::decode(&waiting.frame);
        let index = command.and_then(|(address, _)| self.board(address));
        let (Some((_, command)), Some(index)) = (command, index) else { return };
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

    /// A foreign node sends its scan.
    fn pretend(&mut self, index: usize, now: Time) {
        let frames = self.foreign[index].as_mut().map(|node| node.scan().to_vec()).unwrap_or_default();
        for frame in frames {
            self.bus.queue(self.boards.len() + 1 + index, now, frame);
        }
    }

    /// A board sends, if it can. What its queue has no room for is lost, as in the firmware.
    fn emit(&mut self, index: usize, now: Time, frame: Frame) {
        if self.boards[index].speaks() {
            self.bus.queue(index, now, frame);
        }
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
}

/// What of the bag's pressure reaches each taxel.
fn wrinkles(sd: f64, taxels: usize, seed: u64) -> Vec<f64> {
    let mut rng = Rng::new(seed, Stream::Wrinkles);
    (0..taxels).map(|_| 1.0 + sd * rng.truncated_normal(2.5)).collect()
}
