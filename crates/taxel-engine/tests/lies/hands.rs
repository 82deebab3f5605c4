//! Loads that come, roll and go, and a bag that presses for no reason.

use std::time::Duration;

use taxel_sim::{Footprint, LoadId, Mass, PumpCommand};
use taxel_skin::{Kilopascal, TaxelIndex, Time};

use crate::dice::Dice;
use crate::house::Course;
use crate::stage::Stage;

/// Masses that lie on the skin at the same time, at most.
const LOADS_MAX: usize = 2;

/// A mass that lies on a patch.
struct Lying {
    load: LoadId,
    patch: usize,
    leaves: Time,
}

/// Somebody who puts things on the skin.
pub struct Hands {
    dice: Dice,
    course: Course,
    /// Mean time between loads in seconds.
    gap_s: f64,
    next: Time,
    lying: Vec<Lying>,
    /// Which of them rolls on, on which patch, and when.
    rolls: Option<(LoadId, usize, Time)>,
    /// When the bag presses, and when it is vented.
    bag: Option<(Time, Time)>,
    pressing: bool,
}

impl Hands {
    pub fn new(mut dice: Dice, now: Time, (course, length): (Course, Duration)) -> Self {
        let gap_s = match course {
            Course::Minutes if dice.chance(0.05) => 1e6,
            Course::Minutes => dice.octaves(2.0, 60.0),
            Course::HalfHour => dice.octaves(5.0, 120.0),
            Course::Day => dice.octaves(20.0, 300.0),
        };
        let bag = (course == Course::Minutes && dice.chance(0.15)).then(|| {
            let begin = now + length.mul_f64(dice.uniform());
            (begin, begin + dice.span(2.0, 30.0))
        });
        let next = now + Duration::from_secs_f64(gap_s.min(1e5) * dice.uniform());
        Self { dice, course, gap_s, next, lying: Vec::new(), rolls: None, bag, pressing: false }
    }

    /// Something lies there before anything begins.
    pub fn begin_loaded(&mut self, stage: &mut Stage) {
        self.put(stage, Duration::ZERO);
    }

    /// What is due now. `quiet` hands put nothing on the skin.
    pub fn act(&mut self, stage: &mut Stage, quiet: bool) {
        let now = stage.now();
        if now >= self.next {
            self.next = now + Duration::from_secs_f64(self.gap_s * self.dice.between(0.2, 1.8));
            if self.lying.len() < LOADS_MAX && !quiet {
                let over = self.pace();
                self.put(stage, over);
            }
        }
        if let Some((load, patch, _)) = self.rolls.filter(|(.., due)| now >= *due) {
            self.rolls = None;
            let (to, over) = (self.anywhere(stage, patch), self.dice.span(0.1, 5.0));
            stage.changes(over);
            stage.tell(format!("{load:?} rolls to taxel {} in {over:.2?}", to.0));
            stage.world.roll(load, to, over).unwrap();
        }
        while let Some(place) = self.lying.iter().position(|lying| now >= lying.leaves) {
            let Lying { load, .. } = self.lying.remove(place);
            let over = self.pace();
            stage.changes(over);
            stage.tell(format!("{load:?} leaves in {over:.2?}"));
            stage.world.lift(load, over);
            self.count(stage);
            stage.note_truth();
        }
        self.press(stage, quiet);
    }

    /// At once or gradually.
    fn pace(&mut self) -> Duration {
        if self.dice.chance(0.4) { Duration::ZERO } else { self.dice.span(0.05, 15.0) }
    }

    /// Masses on the patch that is watched.
    fn count(&self, stage: &mut Stage) {
        stage.loads = self.lying.iter().filter(|lying| lying.patch == stage.watched).count();
    }

    /// The watched patch, somewhat rather than the other.
    fn some_patch(&mut self, stage: &Stage) -> usize {
        match stage.house.parts.len() {
            1 => 0,
            _ if self.dice.chance(0.6) => stage.watched,
            patches => self.dice.below(patches),
        }
    }

    /// On skins of two patches some loads are fingertips: radii of 4 to 10 mm, 10 N at most.
    fn or_finger(&mut self, stage: &Stage, kilogram: f64, area: f64) -> (f64, f64) {
        let may_be_one = stage.house.parts.len() > 1;
        if may_be_one && self.dice.chance(0.3) {
            (kilogram.min(1.0), self.dice.octaves(50.0, 300.0))
        } else {
            (kilogram, area)
        }
    }

    fn anywhere(&mut self, stage: &Stage, patch: usize) -> TaxelIndex {
        let taxels = &stage.house.parts[patch].taxels;
        taxels[self.dice.below(taxels.len())]
    }

    fn put(&mut self, stage: &mut Stage, over: Duration) {
        let (kilogram, area) = (self.dice.octaves(0.01, 3.0), self.dice.octaves(300.0, 6000.0));
        let (kilogram, area) = self.or_finger(stage, kilogram, area);
        let patch = self.some_patch(stage);
        let excluded = stage.house.parts[patch].excluded();
        // A fingertip on a taxel that has no model.
        let on_excluded = self.course == Course::Day && !excluded.is_empty() && self.dice.chance(0.05);
        let (kilogram, area, centre) = if on_excluded {
            (kilogram.min(1.0), self.dice.octaves(50.0, 300.0), self.dice.pick(&excluded))
        } else {
            (kilogram, area, self.anywhere(stage, patch))
        };
        let stretch = self.dice.octaves(0.5, 2.0);
        let mut footprint = Footprint::disc(centre, area);
        footprint.semi_axes_mm = [footprint.semi_axes_mm[0] * stretch, footprint.semi_axes_mm[1] / stretch];
        footprint.turn = self.dice.between(0.0, 3.1);
        stage.changes(over);
        let load = stage.world.place(Mass { kilogram, footprint }, over).unwrap();
        let stay = over + self.dice.span(0.2, 40.0);
        let leaves = stage.now() + stay;
        if self.dice.chance(0.15) {
            self.rolls = Some((load, patch, stage.now() + stay.mul_f64(self.dice.uniform())));
        }
        stage.tell(format!("{load:?}: {kilogram:.3} kg on {area:.0} mm2 about taxel {} in {over:.2?}", centre.0));
        self.lying.push(Lying { load, patch, leaves });
        self.count(stage);
        stage.note_truth();
    }

    fn press(&mut self, stage: &mut Stage, quiet: bool) {
        let now = stage.now();
        let Some((begin, end)) = self.bag else { return };
        if !self.pressing && now >= begin && !quiet {
            self.pressing = true;
            let target = Kilopascal(self.dice.octaves(0.3, 40.0));
            stage.pump(PumpCommand::Ramp { target, kpa_per_s: self.dice.octaves(0.3, 15.0) });
        } else if self.pressing && (now >= end || quiet) {
            (self.bag, self.pressing) = (None, false);
            stage.pump(PumpCommand::Vent);
        }
    }
}
