//! The source `sim`: the simulated forearm in real time, with a hand that runs the pump and lays masses. Where the bus's
//! patch has boards that the forearm does not have, that patch is simulated in its place, as a sleeve of triangles.
//!
//! The hand does what an operator would: it pumps up and down as a session's ramp wants it and vents otherwise. While no session is open
//! it lays half a kilogram on the skin for five seconds out of ten, each time at the next of three places, so that there is
//! a force to look at, and loads say something of more than one place.
//!
//! The simulation has a thread of its own, as a bus has hardware of its own: each frame is handed over at its own time
//! and stamped then, as a kernel does it, which a timer of whole milliseconds could not do; and what the simulation
//! costs can be told from what the daemon costs.

use std::io;
use std::sync::mpsc::{Receiver, Sender};
use std::time::Duration;

use taxel_can::{Batch, BusEvent, ClockReading, FrameSource, SendError, SourceError};
use taxel_engine::calibration::{Direction, PLATEAUS_MIN, SessionState, SessionView};
use taxel_engine::plan::Plan;
use taxel_rpc::Handle;
use taxel_sim::{BoardsConfig, Config, Mass, PumpCommand, Skin, World};
use taxel_skin::{Board, BusIndex, Kilopascal, ModuleKind, Patch, TaxelIndex, Time};
use taxel_wire::{Frame, TimedFrame};
use tokio::sync::mpsc;

use crate::runtime;
use crate::sim_drive::Pump;

/// The world is computed so far ahead; a command takes effect at most so much later.
const AHEAD: Duration = Duration::from_millis(5);

/// A frame that is late by this share of the boards' period is dropped: with half a period scans would count as too fast.
const LATE_SHARE: f64 = 0.4;
/// Of boards without a plan.
const PERIOD: Duration = Duration::from_millis(50);

/// Frames that may wait for the bus's task: as many as a kernel's buffer holds, half a second of a full bus. The forearm
/// fills that in four seconds. Then the simulation waits.
const FRAMES_WAITING_MAX: usize = 4_505;

/// Frames handed over at once, as many as one read of a kernel's buffer gives.
const BATCH_FRAMES: usize = 64;

const RISE: PumpCommand = PumpCommand::Ramp { target: Kilopascal(74.0), kpa_per_s: 2.0 };
const FALL: PumpCommand = PumpCommand::Ramp { target: Kilopascal(0.0), kpa_per_s: 2.0 };
const MASS_KG: f64 = 0.5;
const FOOTPRINT_MM2: f64 = 600.0;
/// The taxels of the forearm that are under the mass one after the other; of other patches those at the same share of them.
const UNDER_THE_MASS: [usize; 3] = [100, 40, 170];
const FOREARM_TAXELS: usize = 230;
const MASS_PERIOD_S: u64 = 10;

/// A simulated skin on a bus.
pub struct SimBus {
    /// From the simulation's thread, which ends when this is dropped.
    frames: mpsc::Receiver<TimedFrame>,
    /// To the simulation's thread. Bounded by the bring-up, which alone sends.
    commands: Sender<Frame>,
    told_up: bool,
}

impl SimBus {
    /// The skin of this seed that the plan expects on this bus; `handle` says what the calibration is at. With a `pump` that does as
    /// somebody else says, the hand leaves it alone.
    ///
    /// # Errors
    /// If the simulator's own defaults contradict each other, or there is no thread to be had.
    pub fn new(seed: u64, (plan, bus): (&Plan, BusIndex), handle: Handle, pump: Option<Pump>) -> anyhow::Result<Self> {
        let begun = ClockReading::now().time;
        // A robot's boards stream already when a daemon comes that only listens.
        let boards = BoardsConfig { start_streaming: true, ..BoardsConfig::default() };
        let (forearm, config) = crate::demo::skin(seed)?;
        let skin = match beyond(&forearm, plan, bus) {
            Some(patch) => Skin::sleeve(patch.clone()),
            None => forearm,
        };
        let places = UNDER_THE_MASS.map(|taxel| TaxelIndex((taxel * skin.poses().len() / FOREARM_TAXELS) as u16));
        let world = World::new(skin, Config { start: begun, boards, ..config });
        let (to_bus, frames) = mpsc::channel(FRAMES_WAITING_MAX);
        let (commands, received) = std::sync::mpsc::channel();
        let period = plan.patches.iter().map(|patch| patch.period).min().unwrap_or(PERIOD);
        let (pumping, loaded, lag) = (None, false, Duration::ZERO);
        let simulation =
            Simulation { world, begun, handle, received, to_bus, pump, pumping, places, loaded, period, lag };
        runtime::start("sim-bus", move || simulation.run())?;
        Ok(Self { frames, commands, told_up: false })
    }
}

/// The patch on this bus, and on this one alone, that the forearm cannot stand for.
fn beyond<'a>(forearm: &Skin, plan: &'a Plan, bus: BusIndex) -> Option<&'a Patch> {
    let has = |board: &Board| {
        let same = forearm.patch().boards().iter().find(|own| own.address == board.address);
        same.is_some_and(|own| board.modules.iter().all(|(module, _)| own.modules.iter().any(|(m, _)| m == module)))
    };
    let simulated = |patch: &Patch| {
        let on_the_bus = patch.boards().iter().all(|board| board.bus == bus);
        on_the_bus && !patch.modules().iter().any(|site| matches!(site.kind, ModuleKind::Cells(_)))
    };
    let mut patches = plan.patches.iter().map(|plan| &plan.patch).filter(|patch| simulated(patch));
    patches.find(|patch| !patch.boards().iter().all(has))
}

/// What the thread holds.
struct Simulation {
    world: World,
    begun: Time,
    handle: Handle,
    received: Receiver<Frame>,
    to_bus: mpsc::Sender<TimedFrame>,
    /// Who else tells the pump.
    pump: Option<Pump>,
    /// What the pump does.
    pumping: Option<PumpCommand>,
    places: [TaxelIndex; UNDER_THE_MASS.len()],
    loaded: bool,
    /// Of the boards.
    period: Duration,
    /// Frames are handed over so late, which only grows: so two scans of a module never come too close.
    lag: Duration,
}

impl Simulation {
    /// Runs until nobody takes frames any more.
    fn run(mut self) {
        let (mut until, mut frames) = (self.begun, Vec::new());
        while !self.to_bus.is_closed() {
            for command in self.received.try_iter() {
                self.world.send(until, &command);
            }
            until = until + AHEAD;
            self.lend_a_hand(until);
            self.world.advance(until, &mut frames);
            for frame in frames.drain(..) {
                let due = frame.time + self.lag;
                sleep_until(due);
                let time = ClockReading::now().time;
                // A burst of late frames would look like a board that sends too fast.
                if time.since(due) > self.period.mul_f64(LATE_SHARE) {
                    // As on a bus, where a board that was held up sends no second scan for it. What a machine is always late
                    // by is no hold-up.
                    self.lag = (self.lag + time.since(due)).min(self.period);
                    continue;
                }
                let stamped = TimedFrame { time, ..frame };
                if self.to_bus.blocking_send(stamped).is_err() {
                    return;
                }
            }
            sleep_until(until);
        }
    }

    fn lend_a_hand(&mut self, now: Time) {
        let sessions = (0..self.handle.patches()).filter_map(|patch| self.handle.session(patch));
        let session = sessions.max_by_key(|session| rank(session));
        let session = session.as_deref();
        let wanted = session.filter(|one| one.state == SessionState::Ramping).map_or(PumpCommand::Vent, pump_of);
        if let Some(pump) = &self.pump {
            pump.commands.try_iter().for_each(|command| self.world.pump(command));
            pump.gauge.send_replace(self.world.true_pressure().0);
        } else if self.pumping.replace(wanted) != Some(wanted) {
            self.world.pump(wanted);
        }
        let open = session.is_some_and(|one| one.state.is_open());
        let seconds = now.since(self.begun).as_secs();
        let in_second_half = seconds % MASS_PERIOD_S >= MASS_PERIOD_S / 2;
        let place = self.places[(seconds / MASS_PERIOD_S) as usize % UNDER_THE_MASS.len()];
        // In a bag that is being pumped nothing is laid on the skin.
        let loaded = in_second_half && !open && self.pump.is_none();
        if loaded != self.loaded {
            self.loaded = loaded;
            if !loaded {
                self.world.clear();
            } else if let Err(error) = self.world.lay(Mass::on_disc(MASS_KG, place, FOOTPRINT_MM2)) {
                tracing::warn!(%error, "the simulated mass");
            }
        }
    }
}

/// What a ramp wants of the pump. Where a dial is typed, it is held at a pressure until that was typed.
fn pump_of(session: &SessionView) -> PumpCommand {
    match (session.typed, session.direction) {
        (Some(typed), _) => {
            let step = session.target_kpa / PLATEAUS_MIN as f64;
            let target = Kilopascal(typed.last_kpa.map_or(0.0, |last| last + step));
            PumpCommand::Ramp { target, kpa_per_s: 2.0 }
        }
        (None, Direction::Rising) => RISE,
        (None, Direction::Falling) => FALL,
    }
}

/// Of several sessions in one bag the pump goes by the one of highest rank: nothing is pumped before each has its zero, and the
/// pressure falls once none wants it to rise.
fn rank(session: &SessionView) -> u8 {
    match (session.state, session.direction) {
        (SessionState::Taring, _) => 4,
        (SessionState::Ramping, Direction::Rising) => 3,
        (SessionState::Ramping, Direction::Falling) => 2,
        (SessionState::Fitting, _) => 1,
        _ => 0,
    }
}

fn sleep_until(time: Time) {
    let now = ClockReading::now().time;
    if time > now {
        std::thread::sleep(time.since(now));
    }
}

impl FrameSource for SimBus {
    async fn next(&mut self, batch: &mut Batch) -> Result<(), SourceError> {
        batch.clear();
        if !std::mem::replace(&mut self.told_up, true) {
            batch.events.push(BusEvent::Up);
            return Ok(());
        }
        if self.frames.recv_many(&mut batch.frames, BATCH_FRAMES).await == 0 {
            let error = io::Error::other("the simulation's thread has ended");
            return Err(SourceError::Runtime { interface: "sim".to_owned(), error });
        }
        Ok(())
    }

    async fn send(&mut self, frame: &Frame) -> Result<(), SendError> {
        // The thread ends after the frames' reader, so that there is one to take this.
        let _ = self.commands.send(*frame);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_engine::plan::PatchPlan;
    use taxel_skin::{BoardAddress, Module};

    fn plan(address: u8, modules: u8) -> Plan {
        let modules = (0..modules).map(|m| (Module::from_nibble(m), ModuleKind::Triangle)).collect();
        let board = Board { bus: BusIndex(1), address: BoardAddress::new(address).unwrap(), modules };
        let patch = Patch::new("palm", vec![board]).unwrap();
        Plan { buses: 2, patches: vec![PatchPlan::new(patch)] }
    }

    #[test]
    fn of_two_sessions_in_one_bag_nothing_is_pumped_before_both_have_their_zero_and_the_one_that_still_rises_goes_first()
     {
        let session = |state, direction| SessionView { state, direction, ..SessionView::default() };
        let (rising, falling) = (Direction::Rising, Direction::Falling);
        let in_order = [
            session(SessionState::Taring, rising),
            session(SessionState::Ramping, rising),
            session(SessionState::Ramping, falling),
            session(SessionState::Fitting, rising),
            session(SessionState::Review, rising),
        ];
        assert!(in_order.windows(2).all(|pair| rank(&pair[0]) > rank(&pair[1])));
    }

    #[test]
    fn a_patch_is_simulated_on_its_own_bus_unless_the_forearm_has_its_boards() {
        let (forearm, _) = crate::demo::skin(1).unwrap();
        let name = |plan: &Plan, bus| beyond(&forearm, plan, BusIndex(bus)).map(|patch| patch.name().to_owned());
        assert_eq!(name(&plan(12, 7), 1), None);
        assert_eq!(name(&plan(12, 8), 1), Some("palm".to_owned()));
        assert_eq!(name(&plan(3, 1), 1), Some("palm".to_owned()));
        assert_eq!(name(&plan(3, 1), 0), None);
    }
}
