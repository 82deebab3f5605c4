//! Masses that come, move and go over time.

use crate::load::{LoadError, Mass};
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
    /// Pressures of the whole weight at the end of its way.
    arrived_kpa: Vec<(usize, f64)>,
}

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

    fn add_to(&self, now: Time, skin: &Skin, kpa: &mut [f64]) {
        let weight = self.weight(now);
        let mut add = |pressures: &[(usize, f64)]| {
            for &(taxel, pressure) in pressures {
                kpa[taxel] += weight * pressure;
            }
        };
        if self.centre_mm.share(now) < 1.0 {
            add(&self.mass.spread(skin, self.centre_mm(now)));
        } else {
            add(&self.arrived_kpa);
        }
    }
}

/// All masses on the skin.
#[derive(Clone, Debug)]
pub(crate) struct Loads {
    /// Those that lie still until all are cleared.
    still_kpa: Vec<f64>,
    placed: Vec<Placed>,
    next: u32,
}

impl Loads {
    pub(crate) fn new(taxels: usize) -> Self {
        Self { still_kpa: vec![0.0; taxels], placed: Vec::new(), next: 1 }
    }

    /// A mass lies there from now on.
    pub(crate) fn lay(&mut self, skin: &Skin, mass: &Mass) -> Result<(), LoadError> {
        for (taxel, kpa) in mass.pressures(skin)? {
            self.still_kpa[taxel] += kpa;
        }
        Ok(())
    }

    /// A mass comes to rest within `over`.
    pub(crate) fn place(&mut self, now: Time, skin: &Skin, mass: Mass, over: Duration) -> Result<LoadId, LoadError> {
        let arrived_kpa = mass.pressures(skin)?;
        let centre = skin.poses()[mass.footprint.centre.get()].unrolled_mm;
        let id = LoadId(self.next);
        self.next += 1;
        self.placed.push(Placed {
            id,
            mass,
            weight: Change { from: 0.0, to: 1.0, begin: now, over },
            centre_mm: Change { from: centre, to: centre, begin: now, over: Duration::ZERO },
            arrived_kpa,
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
        let Some(placed) = self.placed.iter_mut().find(|placed| placed.id == load) else { return Ok(()) };
        let mut mass = placed.mass;
        mass.footprint.centre = to;
        let arrived_kpa = mass.pressures(skin)?;
        let end = skin.poses()[to.get()].unrolled_mm;
        placed.centre_mm = Change { from: placed.centre_mm(now), to: end, begin: now, over };
        (placed.mass, placed.arrived_kpa) = (mass, arrived_kpa);
        Ok(())
    }

    /// All masses are gone at once.
    pub(crate) fn clear(&mut self) {
        self.still_kpa.fill(0.0);
        self.placed.clear();
    }

    /// The pressure of all masses on every taxel, in kPa.
    pub(crate) fn write(&self, now: Time, skin: &Skin, kpa: &mut Vec<f64>) {
        kpa.clone_from(&self.still_kpa);
        for placed in &self.placed {
            placed.add_to(now, skin, kpa);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_skin::Kilopascal;

    fn force_n(loads: &Loads, now_s: f64, skin: &Skin) -> f64 {
        let mut kpa = Vec::new();
        loads.write(Time::from_seconds(now_s), skin, &mut kpa);
        kpa.iter().map(|p| Kilopascal(*p).on(skin.taxel_area()).0).sum()
    }

    #[test]
    fn a_mass_comes_and_goes_linearly() {
        let skin = Skin::forearm().unwrap();
        let mut loads = Loads::new(230);
        let mass = Mass::on_disc(0.5, TaxelIndex(100), 600.0);
        let second = Duration::from_secs(1);
        let id = loads.place(Time::from_seconds(1.0), &skin, mass, 2 * second).unwrap();
        let weight = mass.weight().0;
        for (now_s, share) in [(0.0, 0.0), (1.5, 0.25), (3.0, 1.0), (9.0, 1.0)] {
            assert!((force_n(&loads, now_s, &skin) - share * weight).abs() < 1e-9, "at {now_s} s");
        }
        loads.lift(Time::from_seconds(10.0), id, second);
        assert!((force_n(&loads, 10.5, &skin) - 0.5 * weight).abs() < 1e-9);
        assert!(force_n(&loads, 11.0, &skin).abs() < 1e-12);
    }

    #[test]
    fn a_mass_that_leaves_before_it_has_come_leaves_from_where_it_is() {
        let skin = Skin::forearm().unwrap();
        let mut loads = Loads::new(230);
        let mass = Mass::on_disc(1.0, TaxelIndex(100), 600.0);
        let id = loads.place(Time::default(), &skin, mass, Duration::from_secs(4)).unwrap();
        loads.lift(Time::from_seconds(1.0), id, Duration::from_secs(1));
        assert!((force_n(&loads, 1.5, &skin) - mass.weight().0 / 8.0).abs() < 1e-9);
    }

    #[test]
    fn a_rolling_mass_keeps_its_weight_and_arrives() {
        let skin = Skin::forearm().unwrap();
        let mut loads = Loads::new(230);
        let mass = Mass::on_disc(0.5, TaxelIndex(40), 300.0);
        let id = loads.place(Time::default(), &skin, mass, Duration::ZERO).unwrap();
        loads.roll(Time::default(), &skin, id, TaxelIndex(180), Duration::from_secs(2)).unwrap();
        for n in 0..=40 {
            let force = force_n(&loads, f64::from(n) * 0.05, &skin);
            assert!((force - mass.weight().0).abs() < 1e-9, "{force} N after {n} steps");
        }
        let (mut there, mut moved) = (Vec::new(), Vec::new());
        let mut at_rest = Loads::new(230);
        at_rest.lay(&skin, &Mass::on_disc(0.5, TaxelIndex(180), 300.0)).unwrap();
        at_rest.write(Time::default(), &skin, &mut there);
        loads.write(Time::from_seconds(3.0), &skin, &mut moved);
        assert_eq!(there, moved);
        let gone = loads.roll(Time::default(), &skin, id, TaxelIndex(999), Duration::ZERO);
        assert!(matches!(gone, Err(LoadError::Taxel { .. })));
    }
}
