//! Carries out what goes wrong in a story.

use std::time::Duration;

use taxel_engine::BusNotice;
use taxel_skin::Time;

use crate::dice::Dice;
use crate::faults::{Trouble, trouble};
use crate::kinds::{Kind, Kinds};
use crate::stage::Stage;

/// The troubles of one story, by time.
pub struct Mishaps {
    due: Vec<(Time, Trouble)>,
    under_way: Vec<(Time, Trouble)>,
    /// A board has lost its settings, which somebody has to notice.
    pub power_cycled: bool,
    /// The store has failed, which somebody has to notice.
    pub store_failed: bool,
}

impl Mishaps {
    /// None in a quarter of the stories, else one kind or several, each up to three times; those of the kinds `without` are
    /// left out, which changes nothing else of the story but what follows from them.
    pub fn new(mut dice: Dice, stage: &Stage, length: Duration, without: Kinds) -> Self {
        let kinds = if dice.chance(0.25) { 0 } else { dice.pick(&[1, 1, 1, 1, 2, 2, 3]) };
        let mut due = Vec::new();
        for _ in 0..kinds {
            let kind = dice.pick(Kind::faults());
            for _ in 0..dice.pick(&[1, 1, 2, 3]) {
                let at = stage.now() + length.mul_f64(dice.uniform());
                due.push((at, trouble(kind, stage.world.skin(), &mut dice)));
            }
        }
        due.retain(|(_, trouble)| !without.has(trouble.kind));
        due.sort_by_key(|(at, _)| std::cmp::Reverse(*at));
        Self { due, under_way: Vec::new(), power_cycled: false, store_failed: false }
    }

    pub fn act(&mut self, stage: &mut Stage) {
        let now = stage.now();
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
