//! The operator: does things at any moment, sensible or not, and mends what has gone wrong.

use std::sync::Arc;
use std::time::Duration;

use taxel_engine::calibration::SessionState;
use taxel_engine::command::Command;
use taxel_engine::model_set::ModelSet;
use taxel_engine::snapshot::ForceState;
use taxel_sim::PumpCommand;
use taxel_skin::{Kilopascal, Time};

use crate::dice::Dice;
use crate::kinds::Kind;
use crate::mishaps::Mishaps;
use crate::stage::Stage;

/// How often the operator looks at the force.
const LOOKS_EVERY: Duration = Duration::from_millis(500);
/// A force below this is a free skin to the eye, in newton.
const FREE_N: f64 = 1e-3;

#[derive(Clone, Copy, Debug)]
enum Task {
    Tare,
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
    /// Since when there is no force.
    gone_since: Option<Time>,
    patience: Duration,
    listens_only: bool,
    start_again: Option<Time>,
    /// Nothing new is put on the skin until then.
    free_until: Time,
    imports: u64,
}

impl Operator {
    pub fn new(mut dice: Dice, now: Time, length: Duration, listens_only: bool) -> Self {
        let mut agenda = Vec::new();
        for _ in 0..dice.below(5) {
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
        agenda.sort_by_key(|(at, _)| std::cmp::Reverse(*at));
        let patience = dice.span(1.0, 6.0);
        Self {
            dice,
            agenda,
            calibration: None,
            next_look: now,
            gone_since: None,
            patience,
            listens_only,
            start_again: None,
            free_until: now,
            imports: 0,
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
        let patch = String::new;
        match task {
            Task::Tare => self.tare(stage),
            Task::BringUp => stage.give(Kind::BringUp, Command::BringUp { patch: patch(), confirmed_by: None }),
            Task::Session if self.calibration.is_none() => self.begin_session(stage),
            Task::Session => {}
            Task::Activate => {
                let sets: Vec<_> = stage.daemon.catalogue.model_sets.iter().map(|set| set.id.clone()).collect();
                if sets.is_empty() {
                    return;
                }
                let model_set = sets[self.dice.below(sets.len())].clone();
                stage.give(Kind::Activation, Command::Activate { patch: patch(), model_set, expected: None });
            }
            Task::Import => {
                self.imports += 1;
                let id = format!("m-{:016x}", self.imports);
                let session = self.dice.chance(0.5).then(|| self.dice.below(4) as u64);
                let model_set = Arc::new(ModelSet { id, session, ..ModelSet::clone(&stage.house.set) });
                stage.give(Kind::Activation, Command::Import { model_set, insist: false });
            }
            Task::Restart => self.restart(stage),
        }
    }

    /// Vouches for a free skin only where it is free.
    fn tare(&mut self, stage: &mut Stage) {
        let vouches = stage.truth.newest() < FREE_N && self.dice.chance(0.3);
        let confirmed_by = vouches.then(|| "Ada".to_owned());
        stage.give(Kind::Tare, Command::Tare { patch: String::new(), confirmed_by });
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
        let (dice, now) = (&mut self.dice, stage.now());
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
        });
        stage.new_session();
        stage.suspects.begin(Kind::Session, now);
        let command = Command::StartSession {
            patch: String::new(),
            target: Some(Kilopascal(target_kpa)),
            branches: None,
            confirmed_by: None,
            leave_out: Vec::new(),
        };
        stage.give(Kind::Session, command);
    }

    fn calibrate(&mut self, stage: &mut Stage) {
        let Some(calibration) = &mut self.calibration else { return };
        let now = stage.now();
        let Some(session) = stage.daemon.session.clone() else {
            return self.give_up(stage);
        };
        let number = session.number;
        match calibration.stage {
            CalibrationStage::Waiting if session.state == SessionState::Ramping => {
                calibration.stage = CalibrationStage::Pumping(now);
                let target = Kilopascal(calibration.target_kpa + 3.0);
                stage.pump(PumpCommand::Ramp { target, kpa_per_s: calibration.kpa_per_s });
            }
            CalibrationStage::Waiting => {
                if !session.state.is_open() || now.since(calibration.asked) > Duration::from_secs(20) {
                    self.give_up(stage);
                }
            }
            CalibrationStage::Pumping(since) => {
                let ramp_s = calibration.target_kpa / calibration.kpa_per_s;
                let cut = calibration.cut_short.filter(|(share, _)| now.since(since).as_secs_f64() > share * ramp_s);
                if let Some((_, abort)) = cut {
                    calibration.cut_short = None;
                    let command = if abort {
                        Command::AbortSession { session: number }
                    } else {
                        Command::FinishRamp { session: number }
                    };
                    stage.give(Kind::Session, command);
                }
                let late = now.since(since).as_secs_f64() > 1.5 * ramp_s + 10.0;
                if session.state != SessionState::Ramping || late {
                    calibration.stage = CalibrationStage::Venting(now);
                    stage.pump(PumpCommand::Vent);
                }
            }
            CalibrationStage::Venting(since) if now.since(since) > Duration::from_secs(6) => self.review(stage, number),
            CalibrationStage::Venting(_) => {}
        }
    }

    fn review(&mut self, stage: &mut Stage, number: u64) {
        let Some(session) = stage.daemon.session.clone() else { return self.give_up(stage) };
        let Some(calibration) = &mut self.calibration else { return };
        if session.state != SessionState::Review {
            return self.give_up(stage);
        }
        if calibration.further_ramps > 0 {
            calibration.further_ramps -= 1;
            (calibration.stage, calibration.asked) = (CalibrationStage::Waiting, stage.now());
            return stage.give(Kind::Session, Command::StartRamp { session: number });
        }
        let (patch, activate) = (String::new(), calibration.activate);
        match session.model_set.clone().filter(|_| activate) {
            Some(model_set) => {
                stage.give(
                    Kind::Activation,
                    Command::Activate { patch, model_set: model_set.to_string(), expected: None },
                );
            }
            None => stage.give(Kind::Session, Command::DiscardSession { session: number }),
        }
        self.calibration = None;
        stage.suspects.end(Kind::Session, stage.now());
    }

    fn give_up(&mut self, stage: &mut Stage) {
        self.calibration = None;
        if let Some(session) = stage.daemon.session.clone().filter(|session| session.state.is_open()) {
            stage.give(Kind::Session, Command::AbortSession { session: session.number });
        }
        stage.pump(PumpCommand::Vent);
        stage.suspects.end(Kind::Session, stage.now());
    }

    /// Without a force for too long the operator does what the state asks for.
    fn mend(&mut self, stage: &mut Stage, mishaps: &mut Mishaps) {
        let now = stage.now();
        let state = stage.daemon.newest.force.state;
        if matches!(state, ForceState::Ok | ForceState::Degraded) {
            self.gone_since = None;
        }
        let since = *self.gone_since.get_or_insert(now);
        if matches!(state, ForceState::Ok | ForceState::Degraded) && !mishaps.store_failed {
            return;
        }
        if now.since(since) < self.patience || self.calibration.is_some() {
            return;
        }
        self.gone_since = None;
        match state {
            _ if mishaps.store_failed => self.restart(stage),
            ForceState::Stale if mishaps.power_cycled => {
                mishaps.power_cycled = false;
                if self.listens_only {
                    stage.bring_up_by_another();
                } else {
                    stage.give(Kind::BringUp, Command::BringUp { patch: String::new(), confirmed_by: None });
                }
            }
            ForceState::TareInvalid if stage.truth.newest() < FREE_N || self.dice.chance(0.1) => {
                if self.dice.chance(0.7) {
                    self.free_until = now + Duration::from_secs(2);
                }
                self.tare(stage);
            }
            _ => {}
        }
    }
}
