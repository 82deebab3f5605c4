//! The procedure of a drive against a simulated rig: bag, pump, valve, regulator, gauge, line, session, each with faults.
//!
//! Left out: the foil's own stiffness, temperature, a pump that heats up, and any drive's real protocol.

#![allow(clippy::unwrap_used)] // clippy exempts only functions that are tests themselves

use std::collections::VecDeque;
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use taxel_rig::drive::{Abilities, Ask, Drive, Limits, Order, Phase, Programme, Seen, State};

const TICK: Duration = Duration::from_millis(50);
/// Steps of the pneumatics in a tick.
const FINE: u32 = 10;
const LIMITS: Limits = Limits { highest_kpa: 75.0, hold: Duration::from_secs(20), total: Duration::from_secs(600) };
const PROGRAMME: Programme = Programme { kpa_per_s: 1.0, ramps: 1 };
const TARGET_KPA: f64 = 70.0;
const OWN_LIMIT: Duration = Duration::from_secs(2);

/// What goes wrong, and the highest pressure that the bag may come to, kPa: the limit and what noise and overshoot add to it, or more
/// where the gauge itself reads too little.
macro_rules! faults {
    ($($name:ident $highest_kpa:expr,)*) => {
        #[derive(Clone, Copy, Debug, PartialEq)]
        enum Fault { $($name,)* }
        const FAULTS: &[(Fault, f64)] = &[$((Fault::$name, $highest_kpa),)*];
    };
}

const HIGHEST_KPA: f64 = LIMITS.highest_kpa + 3.0;

faults! {
    GaugeFreezes HIGHEST_KPA,
    GaugeSilent HIGHEST_KPA,
    GaugeSign HIGHEST_KPA,
    GaugeHalf 95.0,
    GaugeLags 95.0,
    GaugeNotANumber HIGHEST_KPA,
    GaugeSpikes HIGHEST_KPA,
    GaugeDrifts 95.0,
    GaugeJumps HIGHEST_KPA,
    GaugeCoarse HIGHEST_KPA,
    GaugeLate HIGHEST_KPA,
    OwnGaugeFreezes HIGHEST_KPA,
    OwnGaugeHalf HIGHEST_KPA,
    DriveIgnores HIGHEST_KPA,
    DriveFullPower HIGHEST_KPA,
    DriveOff HIGHEST_KPA,
    DriveSilent HIGHEST_KPA,
    DriveTakesAnother HIGHEST_KPA,
    DriveBiased HIGHEST_KPA,
    DriveInAnotherUnit HIGHEST_KPA,
    DriveRestarts HIGHEST_KPA,
    OrdersLost HIGHEST_KPA,
    PumpEnds HIGHEST_KPA,
    ValveSticks HIGHEST_KPA,
    ValveOpen HIGHEST_KPA,
    VentNarrow HIGHEST_KPA,
    LeakStep HIGHEST_KPA,
    LeakSlow HIGHEST_KPA,
    BagOpens HIGHEST_KPA,
    Blocked HIGHEST_KPA,
    ProgramHeld HIGHEST_KPA,
    SessionAborted HIGHEST_KPA,
    SessionStandsStill HIGHEST_KPA,
    SessionWantsMore HIGHEST_KPA,
    Asked HIGHEST_KPA,
}

/// What kind of rig it is.
#[derive(Clone, Debug, Default)]
struct Rig {
    kpa: f64,
    /// What it was told last; before that it vents.
    order: Option<Order>,
    /// Orders on their way: a dead time.
    waiting: VecDeque<(Duration, Order)>,
    dead: Duration,
    lag_s: f64,
    dead_band_kpa: f64,
    moves: bool,
    power_kpa_per_s: f64,
    pump_end_kpa: f64,
    leak_per_s: f64,
    vent_s: f64,
    offset_kpa: f64,
    noise_kpa: f64,
    own_limit: Option<Duration>,
    heard: Duration,
    fault: Option<(Fault, Duration)>,
    frozen_kpa: f64,
    lagging_kpa: f64,
    read_at: Duration,
    /// From one reading to the next, with up to half of that more or less; at each look where it is zero.
    every: Duration,
    next_at: Duration,
    last_kpa: f64,
    /// What the gauge read in the last second.
    late: VecDeque<f64>,
    /// A step of the drive's own gauge, kPa, if it has one.
    own_step_kpa: Option<f64>,
    own_frozen_kpa: f64,
}

impl Rig {
    fn new(random: &mut ChaCha8Rng, fault: Option<(Fault, Duration)>) -> Self {
        Self {
            dead: Duration::from_millis(random.random_range(0..600)),
            lag_s: random.random_range(0.05..1.0),
            dead_band_kpa: random.random_range(0.0..0.4),
            power_kpa_per_s: random.random_range(4.0..25.0),
            pump_end_kpa: random.random_range(82.0..95.0),
            leak_per_s: random.random_range(0.0..0.002),
            vent_s: random.random_range(0.2..0.8),
            offset_kpa: random.random_range(-0.5..0.5),
            noise_kpa: random.random_range(0.0..0.1),
            own_limit: Some(OWN_LIMIT),
            fault,
            own_step_kpa: random.random_bool(0.5).then(|| random.random_range(0.01..1.0)),
            ..Self::default()
        }
    }

    fn fault(&self, now: Duration) -> Option<Fault> {
        self.fault.filter(|(_, at)| now >= *at).map(|(fault, _)| fault)
    }

    fn since_fault(&self, now: Duration) -> Duration {
        self.fault.map_or(Duration::ZERO, |(_, at)| now.saturating_sub(at))
    }

    /// Takes an order; whether it answers as it should.
    fn hear(&mut self, now: Duration, order: Order) -> bool {
        match self.fault(now) {
            _ if order == Order::Silence => return false,
            Some(Fault::DriveSilent) => return false,
            Some(Fault::DriveRestarts) if self.since_fault(now) < Duration::from_secs(1) => {
                self.order = Some(Order::Vent);
                return false;
            }
            Some(Fault::OrdersLost) if !(now.as_millis() / 50).is_multiple_of(3) => return false,
            Some(Fault::DriveTakesAnother) if matches!(order, Order::Set(_)) => {
                self.heard = now;
                return false;
            }
            Some(Fault::DriveIgnores) if order != Order::Vent => {
                self.heard = now;
                return true;
            }
            _ => {}
        }
        self.heard = now;
        self.waiting.push_back((now + self.dead, order));
        true
    }

    fn advance(&mut self, now: Duration) {
        let fault = self.fault(now);
        while self.waiting.front().is_some_and(|(due, _)| *due <= now) {
            self.order = self.waiting.pop_front().map(|(_, order)| order);
        }
        let lost = self.own_limit.is_some_and(|limit| now.saturating_sub(self.heard) > limit);
        let dt = TICK.as_secs_f64() / f64::from(FINE);
        for _ in 0..FINE {
            let leak = match fault {
                Some(Fault::LeakStep) => 0.08,
                Some(Fault::LeakSlow) => 0.004 * self.since_fault(now).as_secs_f64(),
                Some(Fault::BagOpens) => 3.0,
                _ => 0.0,
            } + self.leak_per_s;
            let end_kpa = if fault == Some(Fault::PumpEnds) { 40.0 } else { self.pump_end_kpa };
            let power = self.power_kpa_per_s * (1.0 - self.kpa / end_kpa).max(0.0);
            let vent_s = self.vent_s * if fault == Some(Fault::VentNarrow) { 2.5 } else { 1.0 };
            let flow = match self.order.filter(|_| !lost).unwrap_or(Order::Vent) {
                Order::Vent => -self.kpa / vent_s,
                _ if fault == Some(Fault::ValveOpen) => -self.kpa / vent_s,
                _ if fault == Some(Fault::DriveOff) => 0.0,
                _ if fault == Some(Fault::DriveFullPower) => power,
                Order::Hold | Order::Silence => 0.0,
                Order::Set(set) => {
                    let set = match fault {
                        Some(Fault::DriveBiased) => set + 10.0,
                        Some(Fault::DriveInAnotherUnit) => 6.9 * set, // psi
                        _ => set,
                    };
                    let band_kpa = if fault == Some(Fault::ValveSticks) { 3.0 } else { self.dead_band_kpa };
                    let error = set - self.kpa;
                    self.moves = error.abs() > if self.moves { 0.2 * band_kpa } else { band_kpa };
                    let wanted = if self.moves { error / self.lag_s } else { 0.0 };
                    if fault == Some(Fault::Blocked) { 0.0 } else { wanted.clamp(-self.kpa / vent_s, power) }
                }
            };
            self.kpa = (self.kpa + dt * (flow - leak * self.kpa)).max(0.0);
        }
        self.lagging_kpa += (self.kpa - self.lagging_kpa) * TICK.as_secs_f64() / 6.0;
    }

    /// What the gauge reads, and its age.
    fn gauge(&mut self, now: Duration, random: &mut ChaCha8Rng) -> (f64, Duration) {
        let fault = self.fault(now);
        let noise = self.noise_kpa * (random.random_range(-1.0..1.0) + random.random_range(-1.0..1.0));
        let read = self.kpa + self.offset_kpa + noise;
        if fault.is_none() {
            self.frozen_kpa = read;
            self.lagging_kpa = self.kpa;
        }
        if fault != Some(Fault::GaugeSilent) && self.every.is_zero() {
            (self.read_at, self.last_kpa) = (now, read);
        }
        while !self.every.is_zero() && now >= self.next_at {
            (self.read_at, self.last_kpa) = (self.next_at, read);
            self.next_at += self.every.mul_f64(random.random_range(0.5..1.5));
        }
        let read = if self.every.is_zero() { read } else { self.last_kpa };
        self.late.push_back(read);
        let late_kpa = if self.late.len() > 20 { self.late.pop_front() } else { None }.unwrap_or(read);
        let read = match fault {
            Some(Fault::GaugeFreezes | Fault::GaugeSilent) => self.frozen_kpa,
            Some(Fault::GaugeSpikes) if random.random_bool(0.05) => read + random.random_range(-40.0..40.0),
            Some(Fault::GaugeDrifts) => read - 0.3 * self.since_fault(now).as_secs_f64(),
            Some(Fault::GaugeJumps) => read + 15.0,
            Some(Fault::GaugeCoarse) => (read / 2.0).round() * 2.0,
            Some(Fault::GaugeLate) => late_kpa,
            Some(Fault::GaugeSign) => -read,
            Some(Fault::GaugeHalf) => 0.5 * read,
            Some(Fault::GaugeLags) => self.lagging_kpa + self.offset_kpa,
            Some(Fault::GaugeNotANumber) => f64::NAN,
            _ => read,
        };
        (read, now - self.read_at)
    }
}

impl Rig {
    /// What the drive's own gauge reads, and its age.
    fn own(&mut self, now: Duration) -> Option<(f64, Duration)> {
        let read = match self.fault(now) {
            Some(Fault::OwnGaugeFreezes) => self.own_frozen_kpa,
            Some(Fault::OwnGaugeHalf) => 0.5 * self.kpa,
            _ => self.kpa,
        };
        self.own_frozen_kpa = read;
        self.own_step_kpa.map(|step_kpa| ((read / step_kpa).round() * step_kpa + 0.3, Duration::ZERO))
    }
}

/// The daemon's session: it sees the gauge alone.
#[derive(Default)]
struct Session {
    phase: Option<(Phase, Duration)>,
    both: bool,
    ramps: u32,
}

impl Session {
    fn step(&mut self, now: Duration, (kpa, target_kpa): (f64, f64), ask: Option<Ask>, fault: Option<Fault>) -> Phase {
        match ask {
            Some(Ask::Begin | Ask::Ramp) => (self.phase, self.ramps) = (Some((Phase::Taring, now)), self.ramps + 1),
            Some(Ask::Abort) => self.phase = Some((Phase::Failed, now)),
            None => {}
        }
        let Some((phase, since)) = self.phase else { return Phase::None };
        if fault == Some(Fault::SessionAborted) {
            self.phase = Some((Phase::Failed, now));
            return Phase::Failed;
        }
        let next = match phase {
            Phase::Taring if now - since > Duration::from_secs(3) => Phase::Rising,
            Phase::Rising if fault == Some(Fault::SessionStandsStill) => phase,
            Phase::Rising if kpa >= target_kpa => {
                if self.both {
                    Phase::Falling
                } else {
                    Phase::Over
                }
            }
            Phase::Falling if kpa < 1.5 => Phase::Over,
            _ => phase,
        };
        if next != phase {
            self.phase = Some((next, now));
        }
        next
    }
}

struct Procedure {
    /// When it was ended, and when the bag was vented after that.
    ended: Option<Duration>,
    vented: Option<Duration>,
    /// Where it was then.
    state: State,
    drive: Drive,
    highest_kpa: f64,
    /// What the gauge read, while the session gathered a rise.
    rise: Vec<(f64, f64)>,
    kpa: f64,
    ramps: u32,
    phase: Phase,
    rig: Rig,
}

fn run(seed: u64, programme: Programme, both: bool, fault: Option<(Fault, Duration)>, until: Duration) -> Procedure {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let rig = Rig::new(&mut random, fault);
    run_rig(rig, random, programme, both, until)
}

fn run_rig(mut rig: Rig, mut random: ChaCha8Rng, programme: Programme, both: bool, until: Duration) -> Procedure {
    let abilities = Abilities { own_limit: rig.own_limit, holds: true };
    let mut drive = Drive::new(Duration::ZERO, LIMITS, abilities, programme);
    let (mut session, mut phase, mut answered) = (Session { both, ..Session::default() }, Phase::None, Duration::ZERO);
    let (mut highest_kpa, mut rise, mut now, mut over) = (0.0_f64, Vec::new(), Duration::ZERO, 0);
    let (mut ended, mut vented, mut state) = (None, None, State::Armed);
    while now < until && over < 200 {
        now += TICK;
        rig.advance(now);
        highest_kpa = highest_kpa.max(rig.kpa);
        let gauge = rig.gauge(now, &mut random);
        if rig.fault(now) == Some(Fault::Asked) {
            drive.stop(now, "somebody");
        }
        let (fault, own) = (rig.fault(now), rig.own(now));
        let target_kpa = if fault == Some(Fault::SessionWantsMore) { 90.0 } else { TARGET_KPA };
        let seen = Seen { now, gauge: Some(gauge), own, answer_age: now - answered, phase, target_kpa };
        // A program that is held up sees nothing and says nothing.
        let is_held = fault == Some(Fault::ProgramHeld) && rig.since_fault(now) < Duration::from_secs(3);
        let mut ask = None;
        if !is_held {
            let (order, asked) = drive.step(&seen);
            ask = asked;
            if rig.hear(now, order) {
                answered = now;
            }
        }
        phase = session.step(now, (gauge.0 - rig.offset_kpa, target_kpa), ask, fault);
        if phase == Phase::Rising {
            rise.push((now.as_secs_f64(), rig.kpa));
        }
        match drive.state() {
            State::Done | State::SafeVent => over += 1,
            on => state = on,
        }
        if drive.stopped().is_some() {
            ended = ended.or(Some(now));
            vented = vented.or((rig.kpa < 1.0).then_some(now));
        }
    }
    Procedure { ended, vented, state, drive, highest_kpa, rise, kpa: rig.kpa, ramps: session.ramps, phase, rig }
}

#[test]
fn a_course_rises_at_its_rate_and_comes_to_its_end() {
    for seed in 0..200 {
        let ramps = if seed % 10 == 0 { 3 } else { 1 };
        let procedure = run(seed, Programme { ramps, ..PROGRAMME }, seed % 2 == 0, None, Duration::from_secs(590));
        let rig = &procedure.rig;
        assert_eq!(procedure.drive.state(), State::Done, "seed {seed}: {:?} {rig:?}", procedure.drive.stopped());
        assert_eq!(procedure.ramps, ramps, "seed {seed}");
        assert!(procedure.highest_kpa < TARGET_KPA + 1.5, "seed {seed}: {} kPa {rig:?}", procedure.highest_kpa);
        let (from, to) =
            (procedure.rise.iter().find(|(_, kpa)| *kpa > 10.0), procedure.rise.iter().find(|(_, kpa)| *kpa > 65.0));
        let rate = 55.0 / (to.unwrap().0 - from.unwrap().0);
        assert!((rate - 1.0).abs() < 0.05, "seed {seed}: {rate} kPa/s {rig:?}");
        let leak = procedure.drive.leak_kpa_per_min().unwrap();
        assert!((leak - 60.0 * rig.leak_per_s * 20.0).abs() < 2.5, "seed {seed}: {leak} kPa/min {rig:?}");
    }
}

#[test]
fn after_a_fault_the_bag_is_vented_and_no_limit_is_exceeded() {
    for &(fault, highest) in FAULTS {
        let (mut slowest, mut venting, mut done) =
            ((Duration::ZERO, 0, State::Armed, String::new()), Duration::ZERO, 0);
        for seed in 0..200 {
            let mut random = ChaCha8Rng::seed_from_u64(1_000 + seed);
            let at = Duration::from_millis(random.random_range(500..100_000));
            let procedure = run(seed, PROGRAMME, seed % 2 == 0, Some((fault, at)), Duration::from_secs(700));
            let context =
                || format!("{fault:?} at {at:?}, seed {seed}: {:?}\n{:?}", procedure.drive.stopped(), procedure.rig);
            assert!(
                matches!(procedure.drive.state(), State::Done | State::SafeVent),
                "{:?} {}",
                procedure.drive.state(),
                context()
            );
            assert!(procedure.highest_kpa < highest, "{} kPa, {}", procedure.highest_kpa, context());
            let phase = procedure.phase;
            assert!(!matches!(phase, Phase::Taring | Phase::Rising | Phase::Falling), "{phase:?} {}", context());
            assert!(procedure.kpa < 1.0, "not vented: {} kPa, {}", procedure.kpa, context());
            let (Some(ended), Some(vented)) = (procedure.ended, procedure.vented) else {
                done += 1;
                continue;
            };
            venting = venting.max(vented - ended);
            if ended.saturating_sub(at) > slowest.0 {
                slowest = (ended - at, seed, procedure.state, procedure.drive.stopped().unwrap().0.to_string());
            }
        }
        println!(
            "{fault:?}: {done} of 200 not ended; ended at most {slowest:?} after the fault, vented {venting:?} after that"
        );
    }
}

/// Half of the interval more or less is jitter.
#[test]
fn a_gauge_that_is_too_slow_for_a_drive_is_refused_before_anything_is_pumped() {
    for (per_s, is_enough) in [(4.0, false), (10.0, false), (16.0, true), (20.0, true), (50.0, true)] {
        for seed in 0..100 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let rig = Rig { every: Duration::from_secs_f64(1.0 / per_s), ..Rig::new(&mut random, None) };
            let procedure = run_rig(rig, random, PROGRAMME, false, Duration::from_secs(590));
            let why = procedure.drive.stopped().map(|(why, _)| why.to_string()).unwrap_or_default();
            let context = format!("{per_s} a second, seed {seed}: {why}");
            assert_eq!(procedure.drive.state() == State::Done, is_enough, "{context}");
            let is_refused = why.contains("readings a second, and a drive needs 12.5") && procedure.highest_kpa == 0.0;
            assert!(is_enough || is_refused, "{context}");
        }
    }
}
