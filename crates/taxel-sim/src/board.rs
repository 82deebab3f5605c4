//! A skin board of the fourth generation (MTB4): its firmware's states, commands and clock. It stops at a 0x50 until it is
//! started again.

use crate::converter::{Arithmetic, Converter, Reading, Surroundings};
use crate::dielectric::{Fabric, LSB_PER_COUNT, Sense};
use crate::faults::ForeignScan;
use crate::rng::{Rng, Stream};
use std::time::Duration;
use taxel_skin::{BoardAddress, Module, ModuleKind, Time, VALUES_PER_MODULE};
use taxel_wire::Frame;
use taxel_wire::icub::{BoardConfig, Command, FirmwareVersion, Message, StatusWord, TriangleConfig};

/// Modules that a board can carry.
const MODULES: usize = 16;
/// The converter's twelve stages at decimation 256 (AD7147, data sheet table 10): 27.1 conversions a second.
pub const CONVERSION: Duration = Duration::from_micros(36_864);
/// Readings without acknowledge after which the firmware silently tares the board.
const NO_ACKS_BEFORE_RETARE: u8 = 5;
/// What a robot's host writes into every board.
pub const HOST_BOARD_CONFIG: BoardConfig = BoardConfig { kind: 0, period_ms: 50, no_load: 240 };
/// Shift and offset that a robot's host writes into every module.
const HOST_SHIFT: u8 = 2;
const HOST_CDC_OFFSET: u16 = 0x2200;
/// What the firmware starts with.
const POWER_ON_CONFIG: BoardConfig = BoardConfig { kind: 0, period_ms: 50, no_load: 245 };

/// The boards of the skin.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardsConfig {
    /// Whether they stream from the first moment with a host's usual settings; otherwise they wait for commands.
    pub start_streaming: bool,
    /// Each board's clock is off by up to this, in millionths.
    pub clock_ppm: f64,
    /// The firmware's drift compensation in 128ths, used in kinds 0 and 8. The firmware has a table per dot, whose
    /// numbers are not ours; any imperfect number does.
    pub drift_gain: u8,
}

impl Default for BoardsConfig {
    fn default() -> Self {
        Self { start_streaming: false, clock_ppm: 30.0, drift_gain: 96 }
    }
}

/// The commands with which a robot's host brings up a board that carries `modules`: settings, modules, start.
///
/// A host waits 500 ms before the last one. The simulated boards need no more than one conversion.
#[must_use]
pub fn bring_up(modules: &[Module]) -> Vec<Command> {
    let enable = |module: &Module| {
        Command::SetTriangles(TriangleConfig {
            first: *module,
            last: *module,
            shift: HOST_SHIFT,
            enabled: true,
            cdc_offset: HOST_CDC_OFFSET,
        })
    };
    let mut commands = vec![Command::SetBoardConfig(HOST_BOARD_CONFIG)];
    commands.extend(modules.iter().map(enable));
    commands.push(Command::Start);
    commands
}

/// A module position and its settings.
#[derive(Clone, Debug)]
struct Slot {
    converter: Converter,
    enabled: bool,
    shift: u8,
    cdc_offset: u16,
}

/// One board.
#[derive(Clone, Debug)]
pub(crate) struct Board {
    pub(crate) address: BoardAddress,
    drift_gain: u8,
    residue_lsb: f64,
    slots: Vec<Slot>,
    config: BoardConfig,
    streaming: bool,
    /// The next conversion becomes the zero.
    tare_pending: bool,
    /// There is a zero; nothing is sent before.
    zeroed: bool,
    no_acks: u8,
    pub(crate) powered: bool,
    pub(crate) silent: bool,
    /// It hangs until then.
    pub(crate) hung_until: Option<Time>,
    /// A period in milliseconds that it was not told.
    pub(crate) other_period_ms: Option<u8>,
    /// Nominal time over the time of this board's clock.
    clock: f64,
    phase: f64,
    pub(crate) next_conversion: Time,
    pub(crate) next_scan: Option<Time>,
    pub(crate) power_on_at: Option<Time>,
    noise: Rng,
    tares: Rng,
    faults: Rng,
}

impl Board {
    /// Board number `index` of the skin with `modules` plugged in, the first of its taxels being `first_taxel`.
    pub(crate) fn new(
        (index, address): (usize, BoardAddress),
        modules: &[(Module, ModuleKind)],
        mut first_taxel: usize,
        fabric: &mut Fabric<'_>,
        config: &BoardsConfig,
        (seed, start): (u64, Time),
    ) -> Self {
        let common = fabric.common_noise_counts() * LSB_PER_COUNT;
        let mut slots: Vec<Slot> = (0..MODULES).map(|_| Slot::new(Converter::new(Vec::new(), false))).collect();
        for &(module, kind) in modules {
            let mut dots = Vec::with_capacity(VALUES_PER_MODULE);
            for slot in 0..VALUES_PER_MODULE as u8 {
                if kind.taxel_slots().contains(&slot) {
                    dots.push(fabric.taxel(first_taxel));
                    first_taxel += 1;
                } else {
                    dots.push(fabric.pad());
                }
            }
            slots[usize::from(module.get())] =
                Slot::new(Converter::new(dots, kind == ModuleKind::Triangle).with_common_noise(common));
        }
        let mut clock_rng = Rng::new(seed, Stream::BoardClock(index));
        let clock = 1.0 + config.clock_ppm * 1e-6 * clock_rng.between(-1.0, 1.0);
        let mut board = Self {
            address,
            drift_gain: config.drift_gain,
            residue_lsb: fabric.tare_residue_counts() * LSB_PER_COUNT,
            slots,
            config: POWER_ON_CONFIG,
            streaming: false,
            tare_pending: true,
            zeroed: false,
            no_acks: 0,
            powered: true,
            silent: false,
            hung_until: None,
            other_period_ms: None,
            clock,
            phase: clock_rng.uniform(),
            next_conversion: start + CONVERSION.mul_f64(clock_rng.uniform()),
            next_scan: None,
            power_on_at: None,
            noise: Rng::new(seed, Stream::Conversion(index)),
            tares: Rng::new(seed, Stream::Tare(index)),
            faults: Rng::new(seed, Stream::BoardFault(index)),
        };
        if config.start_streaming {
            let fitted: Vec<Module> = modules.iter().map(|(module, _)| *module).collect();
            for command in bring_up(&fitted) {
                board.command(start, command);
            }
        }
        board
    }

    /// Noise and residues of tares are drawn from another seed from now on.
    pub(crate) fn reseed(&mut self, seed: u64, index: usize) {
        self.noise = Rng::new(seed, Stream::Conversion(index));
        self.tares = Rng::new(seed, Stream::Tare(index));
        self.faults = Rng::new(seed, Stream::BoardFault(index));
    }

    /// Carries out a command; the answer, if the command has one. Commands to a board without power are lost.
    pub(crate) fn command(&mut self, now: Time, command: Command) -> Option<Message> {
        if !self.speaks() {
            return None;
        }
        match command {
            Command::SetBoardConfig(config) => {
                self.config = config;
                for slot in &mut self.slots {
                    slot.enabled = false;
                }
            }
            Command::SetTriangles(triangles) => self.set_triangles(triangles),
            Command::Start => self.start(now),
            Command::Stop => (self.streaming, self.next_scan) = (false, None),
            Command::QueryFirmware { protocol } => return Some(self.firmware(protocol)),
        }
        None
    }

    fn set_triangles(&mut self, triangles: TriangleConfig) {
        for slot in &mut self.slots[usize::from(triangles.first.get())..=usize::from(triangles.last.get())] {
            slot.enabled = triangles.enabled;
            slot.shift = triangles.shift;
            slot.cdc_offset = triangles.cdc_offset;
        }
        (self.tare_pending, self.zeroed) = (true, false);
        (self.streaming, self.next_scan) = (false, None);
    }

    fn start(&mut self, now: Time) {
        if !self.streaming {
            self.streaming = true;
            self.next_scan = Some(now + self.period().mul_f64(self.phase));
        }
    }

    fn firmware(&self, required: (u8, u8)) -> Message {
        let compatible = required == (2, 0);
        let version = FirmwareVersion { board_type: 11, app: (1, 25, 0), protocol: (2, 0), compatible };
        Message::FirmwareVersion { board: self.address, version }
    }

    /// The time between scans on the run's clock.
    pub(crate) fn period(&self) -> Duration {
        let ms = u64::from(self.other_period_ms.unwrap_or(self.config.period_ms).max(1));
        self.local(Duration::from_millis(ms))
    }

    fn local(&self, nominal: Duration) -> Duration {
        nominal.mul_f64(self.clock)
    }

    /// Converts all dots. Goes on without power too: the fabric has its history even so.
    pub(crate) fn convert(&mut self, pressures_kpa: &[f64], temperature_k: f64) {
        let period = self.local(CONVERSION);
        self.next_conversion = self.next_conversion + period;
        let around = Surroundings { pressures_kpa, temperature_k, elapsed_s: period.as_secs_f64() };
        for slot in self.slots.iter_mut().filter(|slot| !slot.converter.dots.is_empty()) {
            let tare = self.tare_pending.then_some((&mut self.tares, self.residue_lsb));
            slot.converter.convert(&around, slot.cdc_offset, &mut self.noise, &mut self.faults, tare);
        }
        (self.tare_pending, self.zeroed) = (false, true);
    }

    /// Every taxel's gain changes by a factor that is drawn for it.
    pub(crate) fn scale_gains(&mut self, mut factor: impl FnMut() -> f64) {
        for dot in self.slots.iter_mut().flat_map(|slot| &mut slot.converter.dots) {
            if let Sense::Taxel(_, dielectric) = &mut dot.sense {
                dielectric.scale(factor());
            }
        }
    }

    /// The frames of one scan, modules ascending, head before tail; plans the next scan.
    pub(crate) fn scan(&mut self, now: Time, mut send: impl FnMut(Frame)) {
        self.next_scan = Some(now + self.period());
        if !self.zeroed {
            return;
        }
        for number in 0..MODULES as u8 {
            let Some(reading) = self.reading(number) else { continue };
            self.no_acks += u8::from(reading.no_ack());
            if self.no_acks >= NO_ACKS_BEFORE_RETARE {
                self.retare();
            }
            self.frames_of(number, reading.values, reading.status).into_iter().for_each(&mut send);
        }
    }

    /// What the firmware would send of an enabled module now.
    fn reading(&self, number: u8) -> Option<Reading> {
        let compensates = matches!(self.config.kind, 0 | 8);
        let slot = &self.slots[usize::from(number)];
        let arithmetic = Arithmetic {
            no_load: self.config.no_load,
            shift: slot.shift,
            cdc_offset: slot.cdc_offset,
            drift_gain: if compensates { i32::from(self.drift_gain) } else { 0 },
        };
        (slot.enabled && !slot.converter.ailments.silent).then(|| slot.converter.reading(arithmetic))
    }

    /// Head and tail.
    fn frames_of(&self, number: u8, values: [u8; VALUES_PER_MODULE], status: u16) -> [Frame; 2] {
        let (board, module) = (self.address, Module::from_nibble(number));
        let [v0, v1, v2, v3, v4, v5, v6, tail @ ..] = values;
        [
            Message::Head { board, module, values: [v0, v1, v2, v3, v4, v5, v6] }.encode(),
            Message::Tail { board, module, values: tail, status: StatusWord(status) }.encode(),
        ]
    }

    /// The frames of a scan that somebody else makes up.
    pub(crate) fn pretended(&self, sends: ForeignScan) -> Vec<Frame> {
        let scan = |number: u8| {
            let values = self.reading(number)?.values;
            let values = match sends {
                ForeignScan::Level(value) => [value; VALUES_PER_MODULE],
                ForeignScan::Shifted(counts) => {
                    values.map(|v| (i16::from(v).saturating_add(counts)).clamp(0, 255) as u8)
                }
            };
            Some(self.frames_of(number, values, 0))
        };
        (0..MODULES as u8).filter_map(scan).flatten().collect()
    }

    /// The next conversion becomes the zero of all modules; the stream goes on meanwhile.
    pub(crate) const fn retare(&mut self) {
        self.no_acks = 0;
        self.tare_pending = true;
    }

    /// Says and hears nothing until then.
    pub(crate) const fn hang(&mut self, until: Time) {
        if self.powered {
            self.hung_until = Some(until);
        }
    }

    /// Goes on with the settings it had and a fresh zero.
    pub(crate) const fn recover(&mut self) {
        self.hung_until = None;
        self.retare();
        self.zeroed = false;
    }

    pub(crate) fn power_off(&mut self, back_at: Time) {
        self.hung_until = None;
        (self.powered, self.streaming) = (false, false);
        self.next_scan = None;
        self.power_on_at = Some(back_at);
    }

    /// Comes back as from the factory: nothing enabled, a fresh zero.
    pub(crate) fn power_on(&mut self) {
        self.powered = true;
        self.power_on_at = None;
        self.config = POWER_ON_CONFIG;
        for slot in &mut self.slots {
            *slot = Slot::new(slot.converter.clone());
        }
        self.retare();
        self.zeroed = false;
    }

    /// The module position `module`, for faults.
    pub(crate) fn converter(&mut self, module: Module) -> &mut Converter {
        &mut self.slots[usize::from(module.get())].converter
    }

    /// Whether the board's frames reach the bus.
    pub(crate) const fn speaks(&self) -> bool {
        self.powered && !self.silent && self.hung_until.is_none()
    }
}

impl Slot {
    fn new(converter: Converter) -> Self {
        Self { converter, enabled: false, shift: HOST_SHIFT, cdc_offset: HOST_CDC_OFFSET }
    }
}
