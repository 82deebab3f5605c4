//! Which taxels a scan touches, and what of a contact may lie on those that cannot be read.

use std::ops::Range;

use taxel_skin::Newton;

use super::{Coverage, ForceModel};
use crate::counts::Counts;
use crate::force::evaluator::Evaluator;
use crate::force::neighbours::{Neighbours, Reading};
use crate::force::remainder::{Remainder, Weak};
use crate::force::sampling::Contact;
use crate::force::touch::{Rim, Touch};

/// A taxel has so many others about it at most, on skins of triangles.
const NEIGHBOURS_MAX: usize = 6;

impl ForceModel {
    /// Which taxels are touched, those at the rim of a contact with them, and what lies on excluded ones beside them.
    pub fn touch(
        &self,
        evaluator: &Evaluator,
        remainder: &Remainder,
        counts: Counts<'_>,
        coverage: Coverage,
        touch: &mut Touch,
    ) {
        touch.active.clear();
        touch.beside.clear();
        touch.contacts.clear();
        touch.missing.clear();
        touch.rim = Rim::default();
        evaluator.find_active(counts, &mut touch.active);
        if touch.active.is_empty() {
            return;
        }
        let mut contacts = 0;
        if let Some(neighbours) = &self.neighbours {
            let low = |taxel: usize| counts.raw(taxel).and_then(|count| evaluator.low_n(taxel, count)).unwrap_or(0.0);
            contacts = neighbours.grow(&mut touch.active, &mut touch.labels, low);
            if coverage.uncovered_share > 0.0 {
                let has = |taxel: usize| evaluator.selection()[taxel];
                let kpa = |taxel| low(taxel) / self.newton_per_kpa(taxel);
                neighbours.missing_beside(&touch.active, has, &mut touch.missing);
                neighbours.fill(&touch.missing, has, kpa, &mut touch.beside);
                let hidden_n =
                    self.hidden_n(neighbours, touch, |taxel| self.reading(evaluator, remainder, counts, taxel));
                touch.rim = Rim { without: touch.missing.len(), touched: touch.active.len(), hidden_n };
            }
        } else if coverage.uncovered_share > 0.0 {
            self.missing_of_modules(&touch.active, evaluator.selection(), &mut touch.missing);
            touch.rim = self.rim_of_modules(&touch.active, evaluator.selection());
        }
        touch.contacts.resize(contacts + 1, Contact::default());
        for &(taxel, newton) in &touch.active {
            let contact = touch.labels.get(taxel).map_or(0, |&label| usize::from(label));
            // Without positions any taxel may lie there.
            let at_rim = self.neighbours.as_ref().is_none_or(|neighbours| neighbours.is_at_rim(taxel));
            touch.contacts[contact].add(newton / self.newton_per_kpa(taxel), newton, at_rim);
        }
    }

    /// What of a contact's tip may lie on the excluded taxels that it is beside, N. Each of their rings is looked at several times, and
    /// a reading of a fine converter is worked out from its curve, so that all are read first.
    fn hidden_n(&self, neighbours: &Neighbours, touch: &mut Touch, reading: impl Fn(usize) -> Option<Reading>) -> f64 {
        if touch.missing.is_empty() {
            return 0.0; // nearly always
        }
        let Touch { missing, readings, .. } = touch;
        readings.clear();
        readings.extend((0..self.areas_mm2.len()).map(reading));
        let hidden_kpa = |taxel: usize| neighbours.hidden_kpa(taxel, |taxel| readings.get(taxel).copied().flatten());
        missing.iter().map(|&taxel| hidden_kpa(taxel) * self.newton_per_kpa(taxel)).sum()
    }

    /// What a taxel reads without a threshold; `None` of one that is not selected.
    fn reading(
        &self,
        evaluator: &Evaluator,
        remainder: &Remainder,
        counts: Counts<'_>,
        taxel: usize,
    ) -> Option<Reading> {
        if !*evaluator.selection().get(taxel)? {
            return None;
        }
        let Weak { newton, noise_n, is_touch } = remainder.weak(taxel, counts);
        let per_newton = 1.0 / self.newton_per_kpa(taxel);
        let touch_n =
            || counts.raw(taxel).and_then(|count| evaluator.low_n(taxel, count)).filter(|newton| *newton > 0.0);
        let newton = if is_touch { touch_n().unwrap_or(newton) } else { newton };
        Some(Reading { kpa: newton * per_newton, noise_kpa: noise_n * per_newton })
    }

    /// The force of a contact that may lie on `excluded` taxels, ascending, and touches none of those beside them, N, if it is more
    /// than `floor`; else that. One that lies amid several of them is on all of these. `touched` are those of them that an
    /// active taxel is beside: what may lie there makes the total a lower bound. Without positions all of a module are beside
    /// each other.
    #[must_use]
    pub fn untouched_floor(
        &self,
        evaluator: &Evaluator,
        remainder: &Remainder,
        counts: Counts<'_>,
        (excluded, touched): (&[usize], &[usize]),
        floor: Newton,
    ) -> Newton {
        let reading = |taxel: usize| self.reading(evaluator, remainder, counts, taxel);
        let newton = |taxel: usize, kpa: f64| self.newton_per_kpa(taxel) * kpa;
        let is_untouched = |taxel: &usize| touched.binary_search(taxel).is_err();
        let Some(neighbours) = &self.neighbours else {
            let of_module = |taxels: &Range<usize>| {
                let missing = within(excluded, taxels).iter().copied().filter(is_untouched);
                self.untouched_of_module(missing, taxels.clone().filter_map(reading))
            };
            return Newton(self.modules.iter().map(of_module).fold(floor.0, f64::max));
        };
        let about = |taxel: usize, of_one: &dyn Fn(usize) -> f64| {
            let beside =
                neighbours.of(taxel).filter(|other| excluded.binary_search(other).is_ok() && is_untouched(other));
            beside.chain([taxel]).map(|taxel| newton(taxel, of_one(taxel))).sum::<f64>()
        };
        excluded.iter().filter(|taxel| is_untouched(taxel)).fold(floor, |floor, &taxel| {
            let at_most = about(taxel, &|taxel| neighbours.untouched_at_most_kpa(taxel, reading));
            if at_most <= floor.0 {
                return floor; // nearly always
            }
            let newton = about(taxel, &|taxel| neighbours.untouched_kpa(taxel, reading));
            if newton > floor.0 { Newton(newton) } else { floor }
        })
    }

    /// The force of a contact amid the `missing` taxels of a module of which nothing is touched, N: whether these lie side by side
    /// nobody knows without positions.
    fn untouched_of_module(
        &self,
        missing: impl Iterator<Item = usize>,
        readings: impl Iterator<Item = Reading>,
    ) -> f64 {
        let (sum_mm2, most_mm2) = missing.fold((0.0, 0.0_f64), |(sum, most), taxel| {
            let area_mm2 = self.areas_mm2[taxel];
            (sum + area_mm2, most.max(area_mm2))
        });
        if sum_mm2 == 0.0 {
            return 0.0; // nearly always
        }
        1e-3 * sum_mm2 * Neighbours::untouched_anywhere_kpa(readings, most_mm2)
    }

    /// Without positions the excluded taxels beside touched ones are those of the modules that are touched, ascending.
    fn missing_of_modules(&self, active: &[(usize, f64)], selected: &[bool], missing: &mut Vec<usize>) {
        let is_touched = |range: &&Range<usize>| active.iter().any(|(taxel, _)| range.contains(taxel));
        let touched = self.modules.iter().filter(is_touched);
        missing.extend(touched.flat_map(|range| range.clone().filter(|&taxel| !selected[taxel])));
    }

    /// Without positions excluded taxels are beside those of their module: the touched module with most of them for each
    /// taxel that is touched. Where no more are touched than may lie about them, the tip of the contact may lie amid these.
    fn rim_of_modules(&self, active: &[(usize, f64)], selected: &[bool]) -> Rim {
        let rim = |range: &Range<usize>| {
            let touched = active.iter().filter(|(taxel, _)| range.contains(taxel)).count();
            let without = range.clone().filter(|&taxel| !selected[taxel]).count();
            let hidden_n = if without > 0 && touched <= NEIGHBOURS_MAX * without { f64::INFINITY } else { 0.0 };
            Rim { without, touched, hidden_n }
        };
        let touched = self.modules.iter().map(rim).filter(|rim| rim.touched > 0);
        touched.max_by(|a, b| (a.without * b.touched).cmp(&(b.without * a.touched))).unwrap_or_default()
    }
}

/// Those of `taxels`, ascending, that are in a range.
fn within<'a>(taxels: &'a [usize], range: &Range<usize>) -> &'a [usize] {
    let place = |end: usize| taxels.partition_point(|&taxel| taxel < end);
    &taxels[place(range.start)..place(range.end)]
}
