//! The engine driven by data alone: no runtime, no clock, no disk. Replays and the demo run on it.
//!
//! Time is cut into slots of 10 ms; a slot's frames are one input and its end is a tick, so that the result does not
//! depend on how the frames were read, and a log gives bit-identical results every time.

use std::sync::Arc;
use std::time::Duration;

use taxel_can::each_bus_error;
use taxel_engine::calibration::{FitJob, NotLoaded, SessionView};
use taxel_engine::command::{Command, Done, Reply, RequestId};
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::Plan;
use taxel_engine::record::Record;
use taxel_engine::snapshot::{Health, PatchSnapshot};
use taxel_engine::{BusNotice, Engine, Input, Now, Output, Restored};
use taxel_skin::{BusIndex, Kilopascal, Time};
use taxel_store::models_json::content_id;
use taxel_wire::{Frame, FrameKind, TimedFrame};

use crate::bus::of_controller;

const SLOT: Duration = Duration::from_millis(10);

/// A gap in the data is ticked through for so long, which is beyond every deadline of the engine but a session's
/// patience; then time jumps.
const TICKED_GAP: Duration = Duration::from_secs(120);

/// The engine and all that came out of it.
pub struct Offline {
    engine: Engine,
    out: Vec<Output>,
    /// The present, as the data have it.
    pub now: Time,
    slot_end: Option<Time>,
    reply: Option<Reply>,
    /// What the engine waits for: there is no disk, so that it comes at once.
    answers: Vec<Input<'static>>,
    /// Fits that were asked for; they come back with the next tick, as if they took that long.
    fits: Vec<FitJob>,
    /// Newest state per patch.
    pub snapshots: Vec<Arc<PatchSnapshot>>,
    /// Each of them with its patch, where somebody collects them.
    pub collected: Option<Vec<(usize, Arc<PatchSnapshot>)>>,
    /// Newest session per patch.
    pub sessions: Vec<Option<Arc<SessionView>>>,
    /// Newest health.
    pub health: Arc<Health>,
    /// Model sets made, oldest first.
    pub model_sets: Vec<Arc<ModelSet>>,
    /// Frames that the engine wants sent, for the simulated bus.
    pub to_send: Vec<(BusIndex, Frame)>,
}

impl Offline {
    /// An engine that knows nothing yet.
    pub fn new(plan: Arc<Plan>) -> Self {
        let patches = plan.patches.len();
        Self {
            engine: Engine::new(plan, Restored::default()),
            out: Vec::new(),
            now: Time::default(),
            slot_end: None,
            reply: None,
            answers: Vec::new(),
            fits: Vec::new(),
            snapshots: vec![Arc::default(); patches],
            collected: None,
            sessions: vec![None; patches],
            health: Arc::default(),
            model_sets: Vec::new(),
            to_send: Vec::new(),
        }
    }

    /// Frames of one bus in the order of reception. What the controller reports in error frames is told as on a real bus.
    pub fn frames(&mut self, bus: BusIndex, frames: &[TimedFrame]) {
        let is_error = |timed: &TimedFrame| timed.frame.kind == FrameKind::Error;
        for same in frames.chunk_by(|a, b| is_error(a) == is_error(b)) {
            if same.first().is_some_and(is_error) {
                same.iter().for_each(|timed| self.error_frame(bus, timed));
            } else {
                self.data_frames(bus, same);
            }
        }
    }

    /// Frames of a bus were lost behind those that were taken last.
    pub fn frames_lost(&mut self, bus: BusIndex, frames: u64) {
        if frames > 0 {
            self.step(Input::Bus(bus, BusNotice::Dropped(frames)));
        }
    }

    fn error_frame(&mut self, bus: BusIndex, timed: &TimedFrame) {
        self.advance(timed.time);
        self.now = self.now.max(timed.time);
        let mut notices = Vec::new();
        each_bus_error(&timed.frame, |error| notices.push(of_controller(&error)));
        notices.into_iter().for_each(|notice| self.step(Input::Bus(bus, notice)));
    }

    fn data_frames(&mut self, bus: BusIndex, mut frames: &[TimedFrame]) {
        while let Some(first) = frames.first() {
            self.advance(first.time);
            let slot_end = self.slot_end.unwrap_or(first.time);
            // Frames out of order belong to the present slot, whatever they say.
            let in_slot = frames.iter().position(|f| f.time >= slot_end).unwrap_or(frames.len()).max(1);
            let (slot, rest) = frames.split_at(in_slot);
            self.now = slot.iter().map(|f| f.time).fold(self.now, Time::max);
            self.step(Input::Frames(bus, slot));
            frames = rest;
        }
    }

    /// Time passes up to `until`.
    pub fn advance(&mut self, until: Time) {
        let mut slot_end = match self.slot_end {
            None => {
                self.now = until;
                until + SLOT
            }
            Some(end) if until.since(end) > TICKED_GAP => {
                self.tick_through(end, end + TICKED_GAP);
                until
            }
            Some(end) => end,
        };
        slot_end = self.tick_through(slot_end, until);
        self.slot_end = Some(slot_end);
    }

    fn tick_through(&mut self, mut slot_end: Time, until: Time) -> Time {
        while slot_end <= until {
            self.now = self.now.max(slot_end);
            self.step(Input::Tick);
            for job in std::mem::take(&mut self.fits) {
                self.step(Input::Fitted(job.run(content_id)));
            }
            let next = slot_end + SLOT;
            if next == slot_end {
                break; // the end of all time, which only a file can say
            }
            slot_end = next;
        }
        slot_end
    }

    /// Gives a command that is to be done; nothing if its reply takes time: then it is in [`Offline::replied`] later.
    ///
    /// # Errors
    /// Why it is refused.
    pub fn ask(&mut self, command: Command) -> anyhow::Result<Option<Done>> {
        self.step(Input::Command(RequestId(0), command));
        self.replied()
    }

    /// Begins a session of the only patch, as it is configured but for the target.
    ///
    /// # Errors
    /// Why it is refused.
    pub fn start_session(&mut self, target: Option<Kilopascal>) -> anyhow::Result<Option<Done>> {
        let patch = String::new();
        self.ask(Command::StartSession { patch, target, branches: None, confirmed_by: None, leave_out: Vec::new() })
    }

    /// What came of the last command, once that is known.
    ///
    /// # Errors
    /// Why it is refused.
    pub fn replied(&mut self) -> anyhow::Result<Option<Done>> {
        self.reply.take().transpose().map_err(|rejection| anyhow::anyhow!("{rejection}"))
    }

    /// The session of the first patch.
    pub fn session(&self) -> Option<&Arc<SessionView>> {
        self.sessions.first()?.as_ref()
    }

    fn step(&mut self, input: Input<'_>) {
        let now = Now { time: self.now, wall_ns: self.now.as_nanos() };
        let mut out = std::mem::take(&mut self.out);
        self.engine.step(now, input, &mut out);
        for output in out.drain(..) {
            self.apply(output);
        }
        self.out = out;
        for answer in std::mem::take(&mut self.answers) {
            self.step(answer);
        }
    }

    fn apply(&mut self, output: Output) {
        match output {
            Output::Patch(index, snapshot) => {
                if let Some(collected) = &mut self.collected {
                    collected.push((index, Arc::clone(&snapshot)));
                }
                self.snapshots[index] = snapshot;
            }
            Output::Session(index, view) => self.sessions[index] = Some(view),
            Output::SessionGone(index) => self.sessions[index] = None,
            Output::LoadSet { ticket, model_set } => {
                let found = self.model_sets.iter().find(|set| set.id == model_set).cloned();
                let result = found.ok_or_else(|| NotLoaded::Unavailable("there is no store".to_owned()));
                self.answers.push(Input::SetLoaded { ticket, result });
            }
            Output::Health(health) => self.health = health,
            Output::Send(bus, frame) => self.to_send.push((bus, frame)),
            Output::Fit(job) => self.fits.push(job),
            Output::Commit { ticket, records } => {
                let sets = records.into_iter().filter_map(|record| match record {
                    Record::ModelSet(set) => Some(set),
                    _ => None,
                });
                self.model_sets.extend(sets);
                self.answers.push(Input::Committed { ticket, result: Ok(()) });
            }
            Output::Reply(_, reply) => self.reply = Some(reply),
            // No earlier session goes on or is fitted here, so that none is to be loaded.
            Output::Record(_) | Output::Catalogue(_) | Output::Gauge(..) | Output::Load { .. } => {}
        }
    }
}
