//! Carries out what goes wrong in a story.

use std::time::Duration;

use taxel_engine::BusNotice;
use taxel_sim::Fault;
use taxel_skin::Time;

use crate::dice::Dice;
use crate::faults::{OF_A_ROBOT, Trouble, trouble};
use crate::house::Course;
use crate::kinds::{Kind, Kinds};
use crate::stage::Stage;

/// The troubles of one story, by time.
pub struct Mishaps {
    due: Vec<(Time, Trouble)>,
    under_way: Vec<(Time, Trouble)>,
    /// What the skin's temperature does though nothing is wrong, the last first.
    weather: Vec<(Time, Fault)>,
    /// A board has lost its settings, which somebody has to notice.
    pub power_cycled: bool,
    /// The store has failed, which somebody has to notice.
    pub store_failed: bool,
}

impl Mishaps {
    /// None in a quarter of the stories, else one kind or several, each up to three times; those of the kinds `without` are
    /// left out, which changes nothing else of the story but what follows from them.
    pub fn new(mut dice: Dice, stage: &Stage, (course, length): (Course, Duration), without: Kinds) -> Self {
        let (mut due, weather) = match course {
            Course::Minutes => (Self::some(&mut dice, stage, length), Vec::new()),
            Course::HalfHour => (Vec::new(), Self::cycle(&mut dice, stage, length)),
            Course::Day => (Self::of_a_robot(&mut dice, stage, length), Vec::new()),
        };
        due.retain(|(_, trouble)| !without.has(trouble.kind));
        due.sort_by_key(|(at, _)| std::cmp::Reverse(*at));
        Self { due, under_way: Vec::new(), weather, power_cycled: false, store_failed: false }
    }

    /// It warms, or cools, for a third of the time, and goes back within another.
    fn cycle(dice: &mut Dice, stage: &Stage, length: Duration) -> Vec<(Time, Fault)> {
        let kelvin = if dice.chance(0.5) { 1.0 } else { -1.0 } * dice.octaves(1.0, 5.0);
        let over = length / 3;
        let begin = stage.now() + over.mul_f64(0.5 * dice.uniform());
        let there = Fault::Warming { kelvin, over };
        vec![(begin + over, Fault::Warming { kelvin: -kelvin, over }), (begin, there)]
    }

    fn of_a_robot(dice: &mut Dice, stage: &Stage, length: Duration) -> Vec<(Time, Trouble)> {
        let mut due = Vec::new();
        for (kind, per_1000_h) in OF_A_ROBOT {
            for after in dice.arrivals(per_1000_h, length) {
                let mut trouble = trouble(kind, stage.world.skin(), dice);
                if matches!(kind, Kind::TaxelStuck | Kind::TaxelNoisy | Kind::TaxelFlicker) {
                    trouble.lasts = length;
                }
                due.push((stage.now() + after, trouble));
            }
        }
        due
    }

    fn some(dice: &mut Dice, stage: &Stage, length: Duration) -> Vec<(Time, Trouble)> {
        let kinds = if dice.chance(0.25) { 0 } else { dice.pick(&[1, 1, 1, 1, 2, 2, 3]) };
        let mut due = Vec::new();
        for _ in 0..kinds {
            let kind = dice.pick(Kind::faults());
            for _ in 0..dice.pick(&[1, 1, 2, 3]) {
                let at = stage.now() + length.mul_f64(dice.uniform());
                due.push((at, trouble(kind, stage.world.skin(), dice)));
            }
        }
        due
    }

    pub fn act(&mut self, stage: &mut Stage) {
        let now = stage.now();
        while self.weather.last().is_some_and(|(at, _)| *at <= now) {
            let Some((_, fault)) = self.weather.pop() else { break };
            stage.tell(format!("{fault:?}"));
            stage.world.inject(fault).unwrap();
        }
        while self.due.last().is_some_and(|(at, _)| *at <= now) {
            let Some((_, trouble)) = self.due.pop() else { break };
            stage.tell(format!("FAULT {} for {:.2?}: {:?}", trouble.kind.name(), trouble.lasts, trouble.faults));
            if trouble.befalls(stage.part()) {
                stage.suspects.begin(trouble.kind, now);
            }
            self.begin(stage, &trouble);
            self.under_way.push((now + trouble.lasts, trouble));
        }
        while let Some(place) = self.under_way.iter().position(|(end, _)| *end <= now) {
            let (_, trouble) = self.under_way.swap_remove(place);
            stage.tell(format!("end of {}", trouble.kind.name()));
            if trouble.befalls(stage.part()) {
                stage.suspects.end(trouble.kind, now);
                if matches!(trouble.kind, Kind::Glitch | Kind::BoardRetare | Kind::NoAcks | Kind::PowerCycle) {
                    stage.board_zero(trouble.kind);
                }
            }
            Self::end(stage, &trouble);
        }
    }

    fn begin(&mut self, stage: &mut Stage, trouble: &Trouble) {
        for fault in &trouble.faults {
            stage.world.inject(*fault).unwrap();
        }
        match trouble.kind {
            Kind::Stall => stage.daemon.stall(trouble.lasts),
            Kind::BusOff => stage.daemon.notice(BusNotice::BusOff),
            Kind::PowerCycle => self.power_cycled = true,
            Kind::StoreFails => {
                stage.daemon.fail_store();
                self.store_failed = true;
            }
            _ => {}
        }
    }

    fn end(stage: &mut Stage, trouble: &Trouble) {
        for fault in &trouble.faults {
            stage.world.repair(*fault).unwrap();
        }
        if trouble.kind == Kind::BusOff {
            stage.daemon.notice(BusNotice::Up);
        }
    }
}
