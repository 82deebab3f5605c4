//! The operator: does things at any moment, sensible or not, and mends what has gone wrong.

use std::sync::Arc;
use std::time::Duration;

use taxel_engine::calibration::{SessionState, SessionView};
use taxel_engine::command::Command;
use taxel_engine::model_set::ModelSet;
use taxel_engine::snapshot::ForceState;
use taxel_sim::PumpCommand;
use taxel_skin::{Kilopascal, Time};

use crate::dice::Dice;
use crate::house::Course;
use crate::kinds::Kind;
use crate::mishaps::Mishaps;
use crate::rig::start_session;
use crate::stage::Stage;

/// How often the operator looks at the force.
const LOOKS_EVERY: Duration = Duration::from_millis(500);
/// What an operator of a robot does in 1,000 hours: starts of the daemon, tares soon after a load.
const RESTARTS_PER_1000_H: f64 = 20.0;
const TARES_PER_1000_H: f64 = 500.0;
/// A force below this is a free skin to the eye, in newton.
const FREE_N: f64 = 1e-3;

#[derive(Clone, Copy, Debug)]
enum Task {
    Tare,
    TareAfterLoad,
    BringUp,
    Session,
    Activate,
    Import,
    Restart,
}

/// A calibration that the operator sees through.
#[derive(Debug)]
struct Calibration {
    asked: Time,
    target_kpa: f64,
    kpa_per_s: f64,
    /// Share of the ramp after which it is finished or aborted by hand, if it is.
    cut_short: Option<(f64, bool)>,
    further_ramps: u8,
    activate: bool,
    stage: CalibrationStage,
    /// Of which patches, by position; one ramp serves all.
    patches: Vec<usize>,
}

impl Calibration {
    /// Those of its sessions that there are.
    fn sessions(&self, stage: &Stage) -> Vec<Arc<SessionView>> {
        self.patches.iter().filter_map(|patch| stage.daemon.sessions[*patch].clone()).collect()
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum CalibrationStage {
    Waiting,
    Pumping(Time),
    Venting(Time),
}

pub struct Operator {
    dice: Dice,
    agenda: Vec<(Time, Task)>,
    calibration: Option<Calibration>,
    next_look: Time,
    /// Since when there is no force, by patch.
    gone_since: Vec<Option<Time>>,
    patience: Duration,
    listens_only: bool,
    start_again: Option<Time>,
    /// Nothing new is put on the skin until then.
    free_until: Time,
    imports: u64,
    /// The next load that leaves is followed by a tare at once.
    tares_after_load: bool,
    loads: usize,
}

impl Operator {
    pub fn new(mut dice: Dice, stage: &Stage, (course, length): (Course, Duration), listens_only: bool) -> Self {
        let now = stage.now();
        let mut agenda = Vec::new();
        for _ in 0..if course == Course::Minutes { dice.below(5) } else { 0 } {
            let all = [Task::Tare, Task::BringUp, Task::Session, Task::Activate, Task::Import, Task::Restart];
            let weights = [0.5, 0.08, 0.15, 0.07, 0.05, 0.15];
            let mut left = dice.uniform();
            let drawn = all.iter().zip(weights).find(|(_, weight)| {
                left -= weight;
                left < 0.0
            });
            let task = drawn.map_or(Task::Tare, |(task, _)| *task);
            agenda.push((now + length.mul_f64(dice.uniform()), task));
        }
        if course == Course::Day {
            for (task, per_1000_h) in [(Task::Restart, RESTARTS_PER_1000_H), (Task::TareAfterLoad, TARES_PER_1000_H)] {
                agenda.extend(dice.arrivals(per_1000_h, length).into_iter().map(|after| (now + after, task)));
            }
        }
        agenda.sort_by_key(|(at, _)| std::cmp::Reverse(*at));
        let patience = dice.span(1.0, 6.0);
        Self {
            dice,
            agenda,
            calibration: None,
            next_look: now,
            gone_since: vec![None; stage.house.parts.len()],
            patience,
            listens_only,
            start_again: None,
            free_until: now,
            imports: 0,
            tares_after_load: false,
            loads: 0,
        }
    }

    /// Whether the skin is kept free, for a calibration or a tare.
    pub fn keeps_free(&self, now: Time) -> bool {
        self.calibration.is_some() || now < self.free_until
    }

    pub fn act(&mut self, stage: &mut Stage, mishaps: &mut Mishaps) {
        let now = stage.now();
        if let Some(at) = self.start_again {
            if now >= at {
                self.start_again = None;
                mishaps.store_failed = false;
                stage.restart();
                stage.suspects.end(Kind::Restart, now);
            }
            return;
        }
        if self.tares_after_load && self.loads > 0 && stage.loads == 0 {
            self.tares_after_load = false;
            self.agenda.push((now + self.dice.span(0.5, 5.0), Task::Tare));
        }
        self.loads = stage.loads;
        while self.agenda.last().is_some_and(|(at, _)| *at <= now) {
            let Some((_, task)) = self.agenda.pop() else { break };
            self.carry_out(stage, task);
        }
        if now >= self.next_look && self.start_again.is_none() {
            self.next_look = now + LOOKS_EVERY;
            self.calibrate(stage);
            self.mend(stage, mishaps);
        }
    }

    fn carry_out(&mut self, stage: &mut Stage, task: Task) {
        let patch = self.some_patch(stage);
        match task {
            Task::Tare => self.tare(stage, patch),
            Task::TareAfterLoad => self.tares_after_load = true,
            Task::BringUp => self.bring_up(stage, patch),
            Task::Session if self.calibration.is_none() => self.begin_session(stage),
            Task::Session => {}
            Task::Activate => {
                let patch = name_of(stage, patch);
                let sets = stage.daemon.catalogue.model_sets.iter().filter(|set| set.patch == patch);
                let sets: Vec<_> = sets.map(|set| set.id.clone()).collect();
                if sets.is_empty() {
                    return;
                }
                let model_set = sets[self.dice.below(sets.len())].clone();
                stage.give(Kind::Activation, Command::Activate { patch, model_set, expected: None });
            }
            Task::Import => {
                self.imports += 1;
                let id = format!("m-{:016x}", self.imports);
                let session = self.dice.chance(0.5).then(|| self.dice.below(4) as u64);
                let model_set = Arc::new(ModelSet { id, session, ..ModelSet::clone(&stage.house.parts[patch].set) });
                stage.give(Kind::Activation, Command::Import { model_set, insist: false });
            }
            Task::Restart => self.restart(stage),
        }
    }

    /// Any of the skin's patches.
    fn some_patch(&mut self, stage: &Stage) -> usize {
        match stage.house.parts.len() {
            1 => 0,
            patches => self.dice.below(patches),
        }
    }

    /// Confirms a free skin only where it is free.
    fn tare(&mut self, stage: &mut Stage, patch: usize) {
        let confirms = stage.force_on(patch).0 < FREE_N && self.dice.chance(0.3);
        let confirmed_by = confirms.then(|| "Ada".to_owned());
        stage.give(Kind::Tare, Command::Tare { patch: name_of(stage, patch), confirmed_by });
    }

    /// Of a skin of one patch nobody confirms when its boards are configured.
    fn bring_up(&mut self, stage: &mut Stage, patch: usize) {
        let confirms = stage.house.parts.len() > 1 && stage.force_on(patch).0 < FREE_N && self.dice.chance(0.3);
        let confirmed_by = confirms.then(|| "Ada".to_owned());
        stage.give(Kind::BringUp, Command::BringUp { patch: name_of(stage, patch), confirmed_by });
    }

    fn restart(&mut self, stage: &mut Stage) {
        let cleanly = self.dice.chance(0.5);
        stage.tell(if cleanly { "the daemon stops" } else { "the daemon crashes" });
        stage.daemon.stop(cleanly);
        stage.suspects.begin(Kind::Restart, stage.now());
        self.start_again = Some(stage.now() + self.dice.span(0.1, 5.0));
        if self.calibration.take().is_some() {
            stage.pump(PumpCommand::Vent);
            stage.suspects.end(Kind::Session, stage.now());
        }
    }

    fn begin_session(&mut self, stage: &mut Stage) {
        let now = stage.now();
        let patches = match stage.house.parts.len() {
            1 => vec![0],
            // One of them, or both with the same ramp.
            patches => match self.dice.below(patches + 1) {
                patch if patch < patches => vec![patch],
                _ => (0..patches).collect(),
            },
        };
        let dice = &mut self.dice;
        let target_kpa = dice.between(20.0, 70.0);
        let cut_short = dice.chance(0.3).then(|| (dice.between(0.1, 1.0), dice.chance(0.5)));
        self.calibration = Some(Calibration {
            asked: now,
            target_kpa,
            kpa_per_s: dice.octaves(1.0, 6.0),
            cut_short,
            further_ramps: dice.pick(&[0, 0, 0, 1]),
            activate: dice.chance(0.7),
            stage: CalibrationStage::Waiting,
            patches: patches.clone(),
        });
        stage.new_session();
        stage.suspects.begin(Kind::Session, now);
        for patch in patches {
            let command = start_session(&name_of(stage, patch), Some(target_kpa), None);
            stage.give(Kind::Session, command);
        }
    }

    fn calibrate(&mut self, stage: &mut Stage) {
        let Some(calibration) = &mut self.calibration else { return };
        let now = stage.now();
        let sessions = calibration.sessions(stage);
        let is = |state: SessionState| move |session: &Arc<SessionView>| session.state == state;
        let Some(first) = sessions.first().filter(|_| sessions.len() == calibration.patches.len()) else {
            return self.give_up(stage);
        };
        let number = first.number;
        match calibration.stage {
            CalibrationStage::Waiting if sessions.iter().all(is(SessionState::Ramping)) => {
                calibration.stage = CalibrationStage::Pumping(now);
                let target = Kilopascal(calibration.target_kpa + 3.0);
                stage.pump(PumpCommand::Ramp { target, kpa_per_s: calibration.kpa_per_s });
            }
            CalibrationStage::Waiting => {
                let closed = sessions.iter().any(|session| !session.state.is_open());
                if closed || now.since(calibration.asked) > Duration::from_secs(20) {
                    self.give_up(stage);
                }
            }
            CalibrationStage::Pumping(since) => {
                let ramp_s = calibration.target_kpa / calibration.kpa_per_s;
                let cut = calibration.cut_short.filter(|(share, _)| now.since(since).as_secs_f64() > share * ramp_s);
                if let Some((_, abort)) = cut {
                    calibration.cut_short = None;
                    let command = if abort {
                        Command::AbortSession { session: number, reason: None }
                    } else {
                        Command::FinishRamp { session: number }
                    };
                    stage.give(Kind::Session, command);
                }
                let late = now.since(since).as_secs_f64() > 1.5 * ramp_s + 10.0;
                if !sessions.iter().any(is(SessionState::Ramping)) || late {
                    calibration.stage = CalibrationStage::Venting(now);
                    stage.pump(PumpCommand::Vent);
                }
            }
            CalibrationStage::Venting(since) if now.since(since) > Duration::from_secs(6) => self.review(stage),
            CalibrationStage::Venting(_) => {}
        }
    }

    /// Those of its sessions that have models go on; the others are given up.
    fn review(&mut self, stage: &mut Stage) {
        let Some(calibration) = &mut self.calibration else { return };
        let (done, failed): (Vec<_>, Vec<_>) =
            calibration.sessions(stage).into_iter().partition(|session| session.state == SessionState::Review);
        if done.is_empty() {
            return self.give_up(stage);
        }
        for session in failed.iter().filter(|session| session.state.is_open()) {
            stage.give(Kind::Session, Command::AbortSession { session: session.number, reason: None });
        }
        if calibration.further_ramps > 0 {
            calibration.further_ramps -= 1;
            (calibration.stage, calibration.asked) = (CalibrationStage::Waiting, stage.now());
            calibration
                .patches
                .retain(|patch| done.iter().any(|session| session.patch == stage.house.parts[*patch].name()));
            for session in done {
                stage.give(Kind::Session, Command::StartRamp { session: session.number });
            }
            return;
        }
        let activate = calibration.activate;
        for session in done {
            match session.model_set.clone().filter(|_| activate) {
                Some(model_set) => {
                    let (patch, model_set) = (session.patch.clone(), model_set.to_string());
                    stage.give(Kind::Activation, Command::Activate { patch, model_set, expected: None });
                }
                None => stage.give(Kind::Session, Command::DiscardSession { session: session.number }),
            }
        }
        self.calibration = None;
        stage.suspects.end(Kind::Session, stage.now());
    }

    fn give_up(&mut self, stage: &mut Stage) {
        let Some(calibration) = self.calibration.take() else { return };
        for session in calibration.sessions(stage).iter().filter(|session| session.state.is_open()) {
            stage.give(Kind::Session, Command::AbortSession { session: session.number, reason: None });
        }
        stage.pump(PumpCommand::Vent);
        stage.suspects.end(Kind::Session, stage.now());
    }

    /// Without a force for too long the operator does what the state asks for.
    fn mend(&mut self, stage: &mut Stage, mishaps: &mut Mishaps) {
        for patch in 0..stage.house.parts.len() {
            if self.start_again.is_none() {
                self.mend_one(stage, mishaps, patch);
            }
        }
    }

    fn mend_one(&mut self, stage: &mut Stage, mishaps: &mut Mishaps, patch: usize) {
        let now = stage.now();
        let state = stage.daemon.newest[patch].force.state;
        if matches!(state, ForceState::Ok | ForceState::Degraded) {
            self.gone_since[patch] = None;
        }
        let since = *self.gone_since[patch].get_or_insert(now);
        if matches!(state, ForceState::Ok | ForceState::Degraded) && !mishaps.store_failed {
            return;
        }
        if now.since(since) < self.patience || self.calibration.is_some() {
            return;
        }
        self.gone_since[patch] = None;
        match state {
            _ if mishaps.store_failed => self.restart(stage),
            ForceState::Stale if mishaps.power_cycled => {
                mishaps.power_cycled = false;
                if self.listens_only {
                    stage.bring_up_by_another();
                } else {
                    self.bring_up(stage, patch);
                }
            }
            ForceState::TareInvalid if stage.force_on(patch).0 < FREE_N || self.dice.chance(0.1) => {
                if self.dice.chance(0.7) {
                    self.free_until = now + Duration::from_secs(2);
                }
                self.tare(stage, patch);
            }
            _ => {}
        }
    }
}

fn name_of(stage: &Stage, patch: usize) -> String {
    stage.house.parts[patch].name().to_owned()
}
