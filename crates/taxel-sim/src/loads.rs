//! Masses that come, move and go over time.

use crate::load::{LoadError, Mass};
use crate::path::{LoadPath, Path, Pressed, between};
use crate::skin::Skin;
use std::time::Duration;
use taxel_skin::{TaxelIndex, Time};

/// A load that was placed on the skin; see [`crate::World::place`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct LoadId(u32);

/// A linear change between two values.
#[derive(Clone, Copy, Debug)]
struct Change<T> {
    from: T,
    to: T,
    begin: Time,
    over: Duration,
}

impl<T> Change<T> {
    /// 0 before the change, 1 after it.
    fn share(&self, now: Time) -> f64 {
        let over_s = self.over.as_secs_f64();
        if over_s > 0.0 { (now.seconds_since(self.begin) / over_s).clamp(0.0, 1.0) } else { 1.0 }
    }
}

/// A mass, how much of its weight rests on the skin, and where.
#[derive(Clone, Debug)]
struct Placed {
    id: LoadId,
    mass: Mass,
    /// Share of its weight that rests on the skin.
    weight: Change<f64>,
    centre_mm: Change<[f64; 2]>,
    /// What its whole weight does at the end of its way.
    arrived: Pressed,
    /// The same at places of equal distance on its way, first and last included; empty where that is worked out at each
    /// moment.
    way: Vec<Pressed>,
}

/// Through a layer of some millimetres, what a load does changes over no shorter way than this.
const WAY_STEP_MM: f64 = 2.0;

impl Placed {
    fn weight(&self, now: Time) -> f64 {
        let share = self.weight.share(now);
        self.weight.from + (self.weight.to - self.weight.from) * share
    }

    fn centre_mm(&self, now: Time) -> [f64; 2] {
        let Change { from, to, .. } = self.centre_mm;
        let share = self.centre_mm.share(now);
        [from[0] + (to[0] - from[0]) * share, from[1] + (to[1] - from[1]) * share]
    }

    /// Hands over what it does now, and the share of its weight that rests on the skin.
    fn pressing<R>(&self, now: Time, skin: &Skin, path: &Path, then: impl FnOnce(f64, &Pressed) -> R) -> R {
        let (weight, share) = (self.weight(now), self.centre_mm.share(now));
        let on_way = || match self.way.len().checked_sub(1) {
            None => path.press(skin, &self.mass, self.centre_mm(now)),
            Some(steps) => {
                let along = share * steps as f64;
                let step = (along as usize).min(steps.saturating_sub(1));
                Ok(between(&self.way[step], &self.way[(step + 1).min(steps)], along - step as f64))
            }
        };
        match (share < 1.0).then(on_way) {
            // Where its way leads over no skin it stays where it goes to.
            Some(Ok(on_its_way)) => then(weight, &on_its_way),
            Some(Err(_)) | None => then(weight, &self.arrived),
        }
    }
}

/// All masses on the skin.
#[derive(Clone, Debug)]
pub(crate) struct Loads {
    /// Those that lie still until all are cleared.
    still_kpa: Vec<f64>,
    /// Their force, each with the taxel that it lies about, N.
    still_n: Vec<(TaxelIndex, f64)>,
    path: Path,
    placed: Vec<Placed>,
    next: u32,
}

impl Loads {
    pub(crate) fn new(skin: &Skin, path: LoadPath) -> Self {
        Self {
            still_kpa: vec![0.0; skin.poses().len()],
            still_n: Vec::new(),
            path: Path::new(path, skin),
            placed: Vec::new(),
            next: 1,
        }
    }

    fn pressed(&self, skin: &Skin, mass: &Mass) -> Result<Pressed, LoadError> {
        self.path.press(skin, mass, mass.footprint.centre_mm(skin)?)
    }

    /// A mass lies there from now on.
    pub(crate) fn lay(&mut self, skin: &Skin, mass: &Mass) -> Result<(), LoadError> {
        let pressed = self.pressed(skin, mass)?;
        for (taxel, kpa) in pressed {
            self.still_kpa[taxel] += kpa;
        }
        self.still_n.push((mass.footprint.centre, mass.weight().0));
        Ok(())
    }

    /// A mass comes to rest within `over`.
    pub(crate) fn place(&mut self, now: Time, skin: &Skin, mass: Mass, over: Duration) -> Result<LoadId, LoadError> {
        let arrived = self.pressed(skin, &mass)?;
        let centre = mass.footprint.centre_mm(skin)?;
        let id = LoadId(self.next);
        self.next += 1;
        self.placed.push(Placed {
            id,
            mass,
            weight: Change { from: 0.0, to: 1.0, begin: now, over },
            centre_mm: Change { from: centre, to: centre, begin: now, over: Duration::ZERO },
            arrived,
            way: Vec::new(),
        });
        Ok(id)
    }

    /// A placed mass leaves within `over`. What has left already stays away.
    pub(crate) fn lift(&mut self, now: Time, load: LoadId, over: Duration) {
        // Those that are gone are forgotten here, where a load has its last event.
        self.placed.retain(|placed| placed.weight.to > 0.0 || placed.weight.share(now) < 1.0);
        if let Some(placed) = self.placed.iter_mut().find(|placed| placed.id == load) {
            placed.weight = Change { from: placed.weight(now), to: 0.0, begin: now, over };
        }
    }

    /// A placed mass rolls to another place within `over`, in a straight line on the unrolled skin.
    pub(crate) fn roll(
        &mut self,
        now: Time,
        skin: &Skin,
        load: LoadId,
        to: TaxelIndex,
        over: Duration,
    ) -> Result<(), LoadError> {
        let Some(index) = self.placed.iter().position(|placed| placed.id == load) else { return Ok(()) };
        let mut mass = self.placed[index].mass;
        mass.footprint.centre = to;
        let arrived = self.pressed(skin, &mass)?;
        let end = mass.footprint.centre_mm(skin)?;
        let begin = self.placed[index].centre_mm(now);
        let way = self.way(skin, &mass, begin, end);
        let placed = &mut self.placed[index];
        placed.centre_mm = Change { from: begin, to: end, begin: now, over };
        (placed.mass, placed.arrived, placed.way) = (mass, arrived, way);
        Ok(())
    }

    /// What a mass does on its way, where the layer makes that costly; where its way leads over no skin, what it does at
    /// the end.
    fn way(&self, skin: &Skin, mass: &Mass, from_mm: [f64; 2], to_mm: [f64; 2]) -> Vec<Pressed> {
        if matches!(self.path, Path::Shared) {
            return Vec::new();
        }
        let way_mm = [to_mm[0] - from_mm[0], to_mm[1] - from_mm[1]];
        let steps = (way_mm[0].hypot(way_mm[1]) / WAY_STEP_MM).ceil().max(1.0) as u32;
        let at = |step: u32| {
            let share = f64::from(step) / f64::from(steps);
            self.path.press(skin, mass, [from_mm[0] + share * way_mm[0], from_mm[1] + share * way_mm[1]])
        };
        let end = at(steps);
        (0..=steps).filter_map(|step| at(step).or_else(|_| end.clone()).ok()).collect()
    }

    /// All masses are gone at once.
    pub(crate) fn clear(&mut self) {
        self.still_kpa.fill(0.0);
        self.still_n.clear();
        self.placed.clear();
    }

    /// The pressure of all masses on every taxel, in kPa.
    pub(crate) fn write(&self, now: Time, skin: &Skin, kpa: &mut Vec<f64>) {
        kpa.clone_from(&self.still_kpa);
        for placed in &self.placed {
            placed.pressing(now, skin, &self.path, |weight, pressed| {
                pressed.iter().for_each(|&(taxel, pressure)| kpa[taxel] += weight * pressure);
            });
        }
    }

    /// The force of the masses that lie about, or roll to, a taxel of these, N.
    pub(crate) fn force_about_n(&self, now: Time, these: &dyn Fn(TaxelIndex) -> bool) -> f64 {
        let still = self.still_n.iter().filter(|(centre, _)| these(*centre)).map(|(_, newton)| newton);
        let placed = self.placed.iter().filter(|placed| these(placed.mass.footprint.centre));
        still.sum::<f64>() + placed.map(|placed| placed.weight(now) * placed.mass.weight().0).sum::<f64>()
    }
}
