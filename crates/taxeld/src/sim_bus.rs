//! The source `sim`: the simulated forearm in real time, with a hand that runs the pump and lays masses.
//!
//! The hand does what an operator would: it pumps while a session ramps and vents otherwise. While no session is open
//! it lays half a kilogram on the skin for five seconds out of ten, so that there is a force to look at.

use std::time::Duration;

use taxel_can::{Batch, BusEvent, ClockReading, FrameSource, SendError, SourceError};
use taxel_engine::session::SessionState;
use taxel_sim::{Config, Mass, PumpCommand, Skin, World};
use taxel_skin::{Kilopascal, TaxelIndex, Time};
use taxel_wire::Frame;
use tokio::sync::watch;
use tokio::time::{Interval, MissedTickBehavior, interval};

/// Frames are handed over this often: a batch of a few, as a real bus's reader would see them.
const STEP: Duration = Duration::from_millis(2);

const RAMP: PumpCommand = PumpCommand::Ramp { target: Kilopascal(74.0), kpa_per_s: 2.0 };
const MASS_KG: f64 = 0.5;
const FOOTPRINT_MM2: f64 = 600.0;
const UNDER_THE_MASS: TaxelIndex = TaxelIndex(100);
const MASS_PERIOD_S: u64 = 10;

/// A simulated forearm on a bus.
pub struct SimBus {
    world: World,
    begun: Time,
    timer: Interval,
    session: watch::Receiver<Option<SessionState>>,
    pumping: bool,
    loaded: bool,
    told_up: bool,
}

impl SimBus {
    /// The forearm of this seed; `session` says what the calibration is at.
    ///
    /// # Errors
    /// If the simulator's own defaults contradict each other.
    pub fn new(seed: u64, session: watch::Receiver<Option<SessionState>>) -> anyhow::Result<Self> {
        let begun = ClockReading::now().time;
        let world = World::new(Skin::forearm()?, Config { start: begun, ..Config::seeded(seed) })?;
        let mut timer = interval(STEP);
        timer.set_missed_tick_behavior(MissedTickBehavior::Skip);
        Ok(Self { world, begun, timer, session, pumping: false, loaded: false, told_up: false })
    }

    fn lend_a_hand(&mut self, now: Time) {
        let state = *self.session.borrow();
        let ramping = state == Some(SessionState::Ramping);
        if ramping != self.pumping {
            self.pumping = ramping;
            self.world.pump(if ramping { RAMP } else { PumpCommand::Vent });
        }
        let open = state.is_some_and(SessionState::is_open);
        let in_second_half = now.since(self.begun).as_secs() % MASS_PERIOD_S >= MASS_PERIOD_S / 2;
        let loaded = in_second_half && !open;
        if loaded != self.loaded {
            self.loaded = loaded;
            if !loaded {
                self.world.clear();
            } else if let Err(error) = self.world.lay(Mass::on_disc(MASS_KG, UNDER_THE_MASS, FOOTPRINT_MM2)) {
                tracing::warn!(%error, "the simulated mass");
            }
        }
    }
}

impl FrameSource for SimBus {
    async fn next(&mut self, batch: &mut Batch) -> Result<(), SourceError> {
        batch.clear();
        if !std::mem::replace(&mut self.told_up, true) {
            batch.events.push(BusEvent::Up);
            return Ok(());
        }
        while batch.frames.is_empty() {
            self.timer.tick().await;
            let now = ClockReading::now().time;
            self.lend_a_hand(now);
            self.world.advance(now, &mut batch.frames);
        }
        Ok(())
    }

    async fn send(&mut self, frame: &Frame) -> Result<(), SendError> {
        self.world.send(ClockReading::now().time, frame);
        Ok(())
    }
}
