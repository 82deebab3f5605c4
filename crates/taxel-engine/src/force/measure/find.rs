//! Which taxels a scan touches, and what of a contact may lie on those that cannot be read.

use std::ops::Range;

use taxel_skin::Newton;

use super::{Coverage, ForceModel};
use crate::counts::Counts;
use crate::force::evaluator::Evaluator;
use crate::force::neighbours::{Neighbours, Reading};
use crate::force::remainder::{CONTACT_MODULES, Remainder, Weak};
use crate::force::sampling::Contact;
use crate::force::touch::{Hiding, Rim, Touch};

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
            touch.rim = self.rim_of_modules(&touch.active, evaluator.selection(), &mut touch.missing);
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

    /// The force of a contact that may lie on excluded taxels and touches none of those beside them, N, if it is more than
    /// `floor`; else that. One that lies amid several of them is on all of these.
    #[must_use]
    pub fn untouched_floor(
        &self,
        evaluator: &Evaluator,
        remainder: &Remainder,
        counts: Counts<'_>,
        hiding: Hiding<'_>,
        floor: Newton,
    ) -> Newton {
        if hiding.excluded.is_empty() {
            return floor;
        }
        let reading = |taxel: usize| self.reading(evaluator, remainder, counts, taxel);
        let newton = match &self.neighbours {
            Some(neighbours) => self.untouched_beside_n(neighbours, hiding, floor.0, reading),
            None => self.untouched_of_modules_n(hiding, reading),
        };
        if newton > floor.0 { Newton(newton) } else { floor }
    }

    /// The greatest of them by what those beside each excluded taxel read, N, where it is more than `floor_n`.
    fn untouched_beside_n(
        &self,
        neighbours: &Neighbours,
        Hiding { excluded, beside: touched, .. }: Hiding<'_>,
        floor_n: f64,
        reading: impl Fn(usize) -> Option<Reading>,
    ) -> f64 {
        let newton = |taxel: usize, kpa: f64| self.newton_per_kpa(taxel) * kpa;
        let is_untouched = |taxel: &usize| touched.binary_search(taxel).is_err();
        let about = |taxel: usize, of_one: &dyn Fn(usize) -> f64| {
            let beside =
                neighbours.of(taxel).filter(|other| excluded.binary_search(other).is_ok() && is_untouched(other));
            beside.chain([taxel]).map(|taxel| newton(taxel, of_one(taxel))).sum::<f64>()
        };
        excluded.iter().filter(|taxel| is_untouched(taxel)).fold(floor_n, |most_n, &taxel| {
            let at_most = about(taxel, &|taxel| neighbours.untouched_at_most_kpa(taxel, &reading));
            if at_most <= most_n {
                return most_n; // nearly always
            }
            about(taxel, &|taxel| neighbours.untouched_kpa(taxel, &reading)).max(most_n)
        })
    }

    /// Without positions those of a module may lie side by side, and so may modules: a contact amid those of the three that may
    /// hide most, N.
    fn untouched_of_modules_n(
        &self,
        Hiding { excluded, beside, touched }: Hiding<'_>,
        reading: impl Fn(usize) -> Option<Reading>,
    ) -> f64 {
        let is_touched = |taxel: usize| touched.binary_search_by_key(&taxel, |&(other, _)| other).is_ok();
        let most_kpa = |range: Range<usize>| {
            let readings = range.filter(|&taxel| !is_touched(taxel)).filter_map(&reading);
            readings.map(|reading| reading.at_most_kpa()).fold(0.0, f64::max)
        };
        let of_patch = touched.is_empty().then(|| most_kpa(0..self.areas_mm2.len()));
        let of_module = |range: &Range<usize>| {
            let missing =
                within(excluded, range, |&taxel| taxel).iter().filter(|taxel| beside.binary_search(taxel).is_err());
            let areas_mm2 = || missing.clone().map(|&taxel| self.areas_mm2[taxel]);
            let (sum_mm2, most_mm2) = (areas_mm2().sum::<f64>(), areas_mm2().fold(0.0, f64::max));
            if sum_mm2 == 0.0 {
                return 0.0; // nearly always
            }
            1e-3 * sum_mm2 * Neighbours::untouched_anywhere_kpa(most_kpa(range.clone()), of_patch, most_mm2)
        };
        let mut most_n = [0.0_f64; CONTACT_MODULES];
        for newton in self.modules.iter().map(of_module) {
            let least = most_n.iter_mut().min_by(|a, b| a.total_cmp(b));
            if let Some(least) = least.filter(|least| newton > **least) {
                *least = newton;
            }
        }
        most_n.iter().sum()
    }

    /// Without positions all taxels of a module may be beside each other. If no more are touched than may lie about its excluded ones,
    /// or no more than half of those that can be read, the tip of a contact may lie amid these, which come to `missing`. Gives
    /// of such modules the one with most of them for each taxel that is touched. `active` are ascending.
    fn rim_of_modules(&self, active: &[(usize, f64)], selected: &[bool], missing: &mut Vec<usize>) -> Rim {
        let mut most = Rim::default();
        for range in &self.modules {
            let touched = within(active, range, |&(taxel, _)| taxel).len();
            if touched == 0 {
                continue; // nearly always
            }
            let begin = missing.len();
            missing.extend(range.clone().filter(|&taxel| !selected[taxel]));
            let without = missing.len() - begin;
            if touched > NEIGHBOURS_MAX * without && 2 * touched > range.len() - without {
                missing.truncate(begin);
            } else if without * most.touched > most.without * touched || most.without == 0 && without > 0 {
                most = Rim { without, touched, hidden_n: f64::INFINITY };
            }
        }
        most
    }
}

/// Those of `items`, ascending by their taxels, that are in a range.
fn within<'a, T>(items: &'a [T], range: &Range<usize>, taxel: impl Fn(&T) -> usize) -> &'a [T] {
    let place = |end: usize| items.partition_point(|item| taxel(item) < end);
    &items[place(range.start)..place(range.end)]
}
