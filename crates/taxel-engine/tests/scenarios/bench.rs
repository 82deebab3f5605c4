//! A simulated skin on a simulated bus, and the engine that listens to it, in virtual time.

use std::cell::Cell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use taxel_engine::calibration::fit::Branch;
use taxel_engine::calibration::{SessionState, SessionView};
use taxel_engine::command::{Command, Done, ErrorReason, Rejection, Reply};
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::{PatchPlan, Plan};
use taxel_engine::snapshot::ForceState;
use taxel_engine::{BusNotice, Restored};
use taxel_sim::{Fault, Mass, PumpCommand, World};
use taxel_skin::{Kilopascal, Newton, TaxelIndex, Time};
use taxel_wire::{CanId, Frame, TimedFrame};

use crate::disk::Disk;
use crate::host::{Host, SLOT};
use crate::rig::{patch_plan, plan, small_skin, small_world, start_session};
use crate::say;
use crate::truth::Truth;

pub struct Bench {
    pub world: World,
    pub host: Host,
    /// Every frame that went to the engine, while it is asked for.
    pub log: Option<Vec<TimedFrame>>,
    /// Which frames reach the engine.
    pub passes: Box<dyn FnMut(&TimedFrame) -> bool>,
    /// What the bus does to the frames that do.
    pub alters: Box<dyn FnMut(&mut TimedFrame)>,
    /// Frames of somebody else on the bus, in order of time.
    pub foreign: VecDeque<TimedFrame>,
    /// What the skin truly bore.
    pub truth: Truth,
    /// How many of the engine's frames the boards have got.
    delivered: usize,
}

impl Bench {
    /// The engine starts at the world's present.
    pub fn new(world: World, plan: Arc<Plan>, restored: Restored) -> Self {
        let host = Host::new(plan, restored, world.now());
        Self {
            world,
            host,
            log: None,
            passes: Box::new(|_| true),
            alters: Box::new(|_| ()),
            foreign: VecDeque::new(),
            truth: Truth::default(),
            delivered: 0,
        }
    }

    /// An engine that starts on what another one left on disk; the boards are as they are in `world`.
    pub fn after(world: World, plan: Arc<Plan>, disk: Disk) -> Self {
        let mut bench = Self::new(world, plan, disk.found());
        bench.host.disk.samples = disk.samples;
        bench
    }

    /// The daemon starts anew at once, on what is on its disk.
    pub fn again(self, plan: Arc<Plan>) -> Self {
        Self::after(self.world, plan, self.host.disk)
    }

    pub fn now(&self) -> Time {
        self.host.now
    }

    pub fn run(&mut self, span: Duration) {
        let end = self.now() + span;
        while self.now() < end {
            self.slot();
        }
    }

    pub fn seconds(&mut self, seconds: f64) {
        self.run(Duration::from_secs_f64(seconds));
    }

    fn slot(&mut self) {
        let end = self.now() + SLOT;
        let mut frames = Vec::new();
        self.world.advance(end, &mut frames);
        frames.retain(|frame| (self.passes)(frame));
        frames.iter_mut().for_each(|frame| (self.alters)(frame));
        let theirs = self.foreign.partition_point(|frame| frame.time <= end);
        frames.extend(self.foreign.drain(..theirs));
        frames.sort_by_key(|frame| frame.time);
        self.host.frames(&frames);
        if let Some(log) = &mut self.log {
            log.extend(frames);
        }
        self.host.tick(end);
        for (time, frame) in &self.host.sent[self.delivered..] {
            self.world.send(*time, frame);
        }
        self.delivered = self.host.sent.len();
        self.truth.note(self.world.true_force().0, self.host.snapshots.len());
    }

    /// Lets time pass until `done`, which must come within `limit_s`.
    pub fn until(&mut self, limit_s: f64, what: &str, done: impl Fn(&Host) -> bool) {
        let end = self.now() + Duration::from_secs_f64(limit_s);
        while !done(&self.host) {
            assert!(self.now() < end, "{what} did not happen within {limit_s} s: {}", self.host.present());
            self.slot();
        }
    }

    pub fn until_state(&mut self, limit_s: f64, state: SessionState) {
        self.until(limit_s, state.name(), |host| host.sessions.last().is_some_and(|s| s.state == state));
    }

    pub fn until_force(&mut self, limit_s: f64, state: ForceState) {
        self.until(limit_s, &format!("{state:?}"), |host| {
            host.snapshots.last().is_some_and(|s| s.force.state == state)
        });
    }

    /// Gives a command and waits for its reply.
    pub fn ask(&mut self, command: Command) -> Reply {
        let request = self.host.command(command);
        for _ in 0..1_000 {
            if let Some(reply) = self.host.reply(request) {
                return reply;
            }
            self.slot();
        }
        panic!("no reply within 10 s");
    }

    /// A command that must be refused as not of this state, or not now; the reason.
    pub fn refused(&mut self, command: Command) -> String {
        match self.ask(command) {
            Err(Rejection::FailedPrecondition(_, why) | Rejection::Unavailable(ErrorReason::ChangeUnderWay, why)) => {
                why
            }
            other => panic!("expected a refusal, got {other:?}"),
        }
    }

    pub fn brought_up(&mut self) {
        self.seconds(0.3); // health is shown four times a second
        self.until(5.0, "board bring-up", |host| {
            host.healths.last().is_some_and(|h| h.boards.iter().all(|b| b.bring_up == "verified"))
        });
    }

    /// Starts a session over the rising branch and waits for its ramp.
    pub fn start_session(&mut self, target_kpa: Option<f64>) -> u64 {
        self.start_session_over(Branch::Rising, target_kpa)
    }

    pub fn start_session_over(&mut self, branches: Branch, target_kpa: Option<f64>) -> u64 {
        let number = session_of(self.ask(start_session("", target_kpa, Some(branches)))).number;
        self.until_state(10.0, SessionState::Ramping);
        number
    }

    pub fn until_pressure(&mut self, kpa: f64) {
        self.until(40.0, "pressure", |host| host.session().pressure_kpa.is_some_and(|p| p >= kpa));
    }

    /// Another ramp of a session, which has its zero.
    pub fn ramp_again(&mut self, session: u64) {
        session_of(self.ask(Command::StartRamp { session }));
        self.until_state(30.0, SessionState::Ramping);
    }

    /// Ends a ramp and waits for the models; their id.
    pub fn finish(&mut self, session: u64) -> String {
        session_of(self.ask(Command::FinishRamp { session }));
        self.until_state(1.0, SessionState::Review);
        self.host.session().model_set.as_deref().unwrap().to_owned()
    }

    /// Vents the bag and waits for so long.
    pub fn vent(&mut self, seconds: f64) {
        self.world.pump(PumpCommand::Vent);
        self.seconds(seconds);
    }

    /// The daemon ends without a word and starts anew on what is on disk, after the bag was vented and the skin has settled.
    pub fn restarted(&self, plan: Arc<Plan>, change: impl FnOnce(&mut Disk)) -> Self {
        let mut world = self.world.clone();
        world.pump(PumpCommand::Vent);
        world.advance(self.now() + Duration::from_secs(20), &mut Vec::new());
        let mut disk = self.host.disk.clone();
        change(&mut disk);
        let mut bench = Self::after(world, plan, disk);
        bench.brought_up();
        bench
    }

    pub fn ramp(&mut self, target_kpa: f64, kpa_per_s: f64) {
        self.world.pump(PumpCommand::Ramp { target: Kilopascal(target_kpa), kpa_per_s });
    }

    pub fn activate(&mut self, model_set: &str) -> Reply {
        self.ask(say::activate(model_set))
    }

    /// A model set from elsewhere, which is taken as it is.
    pub fn import(&mut self, model_set: Arc<ModelSet>) {
        self.ask(say::import(model_set)).unwrap();
    }

    /// The boards are configured once more, and heard.
    pub fn configure_again(&mut self, confirmed_by: Option<&str>) {
        self.ask(say::bring_up(confirmed_by)).unwrap();
        self.until(3.0, "configuring", |host| host.health().boards.iter().all(|b| b.bring_up == "configuring"));
        self.brought_up();
    }

    /// The bus is off and up again.
    pub fn bus_off(&mut self) {
        self.host.notice(BusNotice::BusOff);
        self.host.notice(BusNotice::Up);
    }

    pub fn tare(&mut self, confirmed_by: Option<&str>) -> Reply {
        self.ask(Command::Tare { patch: String::new(), confirmed_by: confirmed_by.map(str::to_owned) })
    }

    /// Lets the tails of a module report so many lost acknowledgements as are set, though nothing is wrong with its counts.
    pub fn reports_lost_acknowledgements(&mut self, id: u16) -> Rc<Cell<u32>> {
        let left = Rc::new(Cell::new(0));
        let reports = Rc::clone(&left);
        self.alters = Box::new(move |timed| {
            if let [0xC0, .., _] = timed.frame.bytes()
                && timed.frame.id == CanId::Standard(id)
                && reports.get() > 0
            {
                reports.set(reports.get() - 1);
                let mut tail = timed.frame.bytes().to_vec();
                tail[7] |= 1;
                timed.frame = Frame::data(timed.frame.id, &tail).unwrap();
            }
        });
        left
    }

    pub fn inject(&mut self, fault: Fault) {
        self.world.inject(fault).unwrap();
    }

    pub fn repair(&mut self, fault: Fault) {
        self.world.repair(fault).unwrap();
    }

    /// Lays a mass on a disc of 600 mm2; its weight.
    pub fn lay(&mut self, kilogram: f64, centre: u16) -> Newton {
        self.world.lay(Mass::on_disc(kilogram, TaxelIndex(centre), 600.0)).unwrap()
    }

    /// Lays a mass that presses on everything, so slowly that it is a load and not a step.
    pub fn press_everywhere(&mut self, kilogram: f64) {
        for _ in 0..20 {
            self.world.lay(Mass::on_disc(kilogram / 20.0, TaxelIndex(35), 20_000.0)).unwrap();
            self.seconds(0.15);
        }
    }

    /// Mean force over so many snapshots from now on; each must have one.
    pub fn weigh(&mut self, snapshots: usize) -> f64 {
        let first = self.host.snapshots.len();
        self.until(60.0, "weighing", |host| host.snapshots.len() >= first + snapshots);
        let totals = self.host.snapshots[first..].iter().map(|s| s.force.total.expect("a force").0);
        let totals: Vec<f64> = totals.collect();
        totals.iter().sum::<f64>() / totals.len() as f64
    }
}

/// Why a command was refused as not of this state, by this reason.
pub fn refused_as(reason: ErrorReason, reply: Reply) -> String {
    match reply {
        Err(Rejection::FailedPrecondition(is, why)) if is == reason => why,
        other => panic!("expected {reason:?}, got {other:?}"),
    }
}

/// The session that a command came to.
pub fn session_of(reply: Reply) -> Arc<SessionView> {
    match reply {
        Ok(Done::Session(view)) => view,
        other => panic!("expected a session, got {other:?}"),
    }
}

/// The boards of the small skin are brought up, and nothing was calibrated yet.
pub fn fresh() -> Bench {
    fresh_with(|_| ())
}

/// The same with a plan of its own.
pub fn fresh_with(change: impl FnOnce(&mut PatchPlan)) -> Bench {
    let mut patch = patch_plan(&small_skin());
    change(&mut patch);
    let mut bench = Bench::new(small_world(), plan(patch), Restored::default());
    bench.brought_up();
    bench
}
