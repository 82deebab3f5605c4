//! What a zero may hide: a load that lay on the skin while it was taken.
//!
//! A zero is taken where nothing seems to lie on the skin, which the counts can tell from a light load only as far as
//! they return from day to day. So what the zero itself may hide counts, too: with `h = sum w (zero - zero of the models)`
//! over a module (beyond the threshold what the taxel's curve says instead), `H` is the sum of all `h`, a load on
//! everything, or that of the three greatest, a contact, whichever is more. A skin that lies away from load as a whole, as a
//! colder one does, hides a contact by as much, so a contact is told from the median taxel then. Boards that took a zero
//! of their own since the models were gathered leave a residue on every taxel, which may hide a load as well: how far the
//! taxels lie apart is how large these are, `H` has the standard uncertainty `sqrt(sum (w d)^2)` of its taxels, `d` from the
//! median deviation. And where the daemon configured the boards, their zero holds whatever its look before had let pass:
//! that is added to every `h`, less the median of the skin where that lay away from load. Where somebody has vouched for a zero
//! since, the same is told from that zero, and what is more counts.

use std::ops::Range;

use super::share::{CONTACT_MODULES, FLOOR_SIGMAS, Share};
use crate::baseline::TaxelBaseline;
use crate::force::tables::Tables;
use crate::statistics::{MEDIAN_DEVIATIONS, median};

/// The zero that holds, and what it took for rest.
#[derive(Clone, Copy, Debug)]
pub struct Rest<'a> {
    /// One per taxel.
    pub zero: &'a [TaxelBaseline],
    /// The same without what it has followed of the temperature since it was taken.
    pub taken: &'a [TaxelBaseline],
    /// How far each taxel lay from the rest of the models when the boards took zeros of their own, counts; empty where nobody
    /// looked.
    pub hidden: &'a [f32],
    /// The zero that somebody vouched for since they took these, one per taxel; empty without one.
    pub vouched: &'a [TaxelBaseline],
}

/// Force that the zero would hide if everything by which it lies towards load from that of the models were load.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Hidden {
    pub(super) newton: f64,
    /// Its standard uncertainty, N.
    pub(super) sigma_n: f64,
}

impl Hidden {
    /// The more of what it may hide beside the models' rest, and beside a zero that somebody vouched for.
    pub(super) fn of(tables: &Tables, shares: &[Share], rest: Rest<'_>, modules: &[Range<usize>]) -> Self {
        let models = Self::beside(tables, shares, &tables.set().baseline, rest, modules);
        if rest.vouched.is_empty() {
            return models;
        }
        let vouched = Self::beside(tables, shares, rest.vouched, Rest { hidden: &[], ..rest }, modules);
        if vouched.upper_n() > models.upper_n() { vouched } else { models }
    }

    /// What it may hide if the skin is at rest where it reads `other`.
    fn beside(
        tables: &Tables,
        shares: &[Share],
        other: &[TaxelBaseline],
        rest: Rest<'_>,
        modules: &[Range<usize>],
    ) -> Self {
        // What lay away from load as a whole is warmth, and hides no less of a load.
        let hidden =
            |taxel: usize| rest.hidden.get(taxel).map_or(0.0, |counts| f64::from(*counts) * tables.sign(taxel));
        let away = median((0..rest.hidden.len()).map(hidden)).unwrap_or(0.0).min(0.0);
        let moved = |taxel: usize| {
            let then = other.get(taxel).filter(|_| shares.get(taxel).is_some_and(|share| share.noise_n > 0.0))?;
            let counts = (rest.taken.get(taxel)?.mean - then.mean) * tables.sign(taxel);
            counts.is_finite().then_some(counts + hidden(taxel) - away)
        };
        let all: Vec<Option<f64>> = (0..shares.len()).map(moved).collect();
        let middle = median(all.iter().copied().flatten()).unwrap_or(0.0);
        let apart = MEDIAN_DEVIATIONS * median(all.iter().flatten().map(|moved| (moved - middle).abs())).unwrap_or(0.0);
        let newton = |taxel: usize, moved: f64| {
            let share = &shares[taxel];
            let linear = f64::from(share.newton_per_count).abs() * moved;
            // Beyond the threshold skin becomes stiffer: the curve says more than its beginning.
            let curve = || tables.threshold_n(taxel, moved).unwrap_or(linear).max(linear);
            if linear > f64::from(share.threshold_n) { curve() } else { linear }
        };
        // Of each module its force, that beside what moved the whole skin away from load, and its squared uncertainty.
        let of_module = |range: &Range<usize>| {
            let moved = range.clone().filter_map(|taxel| Some((taxel, all.get(taxel).copied()??)));
            moved.fold([0.0; 3], |[force, contact, squared], (taxel, moved)| {
                let sigma = f64::from(shares[taxel].newton_per_count) * apart;
                let beside = newton(taxel, moved - middle.min(0.0));
                [force + newton(taxel, moved), contact + beside, squared + sigma * sigma]
            })
        };
        let mut by_module: Vec<[f64; 3]> = modules.iter().map(of_module).collect();
        let sum = |modules: &[[f64; 3]], of: usize| modules.iter().map(|module| module[of].max(0.0)).sum::<f64>();
        let everything: f64 = by_module.iter().map(|module| module[0]).sum();
        let everything = Self { newton: everything.max(0.0), sigma_n: sum(&by_module, 2).sqrt() };
        by_module.sort_by(|a, b| b[1].total_cmp(&a[1]));
        by_module.truncate(CONTACT_MODULES);
        let contact = Self { newton: sum(&by_module, 1), sigma_n: sum(&by_module, 2).sqrt() };
        if everything.upper_n() > contact.upper_n() { everything } else { contact }
    }

    fn upper_n(self) -> f64 {
        self.newton + FLOOR_SIGMAS * self.sigma_n
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::force::tests::{ACTIVATION, AREA, REST, rest, set};

    /// Of modules of ten; a count of a taxel weighs `w`, up to its threshold of three counts.
    const TAXELS: usize = 50;

    struct Zero {
        tables: Tables,
        zero: Vec<TaxelBaseline>,
        hidden: Vec<f32>,
        vouched: Vec<TaxelBaseline>,
    }

    impl Zero {
        /// Taxels that have moved so many counts towards load since the models' zero, and had done so before the boards took
        /// zeros of their own.
        fn new(moved: impl Fn(usize) -> f64, before: impl Fn(usize) -> f32) -> Self {
            let at = |moved: f64| TaxelBaseline { mean: f64::from(REST) - moved, noise: 0.5 };
            let zero: Vec<TaxelBaseline> = (0..TAXELS).map(|taxel| at(moved(taxel))).collect();
            // Curves are read from the models' zero on, as the figures below are.
            let tables = Tables::new(set(TAXELS), &rest(TAXELS), &[AREA; TAXELS], ACTIVATION);
            Self { tables, zero, hidden: (0..TAXELS).map(|taxel| -before(taxel)).collect(), vouched: Vec::new() }
        }

        fn force_n(&self, counts: f64) -> f64 {
            self.tables.threshold_n(0, counts).unwrap()
        }

        fn hidden(&self) -> Hidden {
            let shares: Vec<Share> = (0..TAXELS)
                .map(|taxel| Share::of(&self.tables, self.zero[taxel], ACTIVATION, taxel).unwrap_or_default())
                .collect();
            let modules: Vec<Range<usize>> = (0..TAXELS / 10).map(|module| 10 * module..10 * module + 10).collect();
            let rest = Rest { zero: &self.zero, taken: &self.zero, hidden: &self.hidden, vouched: &self.vouched };
            Hidden::of(&self.tables, &shares, rest, &modules)
        }
    }

    #[test]
    fn what_a_zero_may_hide_in_figures() {
        type Moved = fn(usize) -> f64;
        // How far each taxel has moved, what may lie there in counts of a taxel, and its uncertainty in median deviations of one.
        let all = 50.0_f64.sqrt();
        let table: [(&str, Moved, f64, f64); 8] = [
            ("a load on everything", |_| 1.0, 50.0, 0.0),
            ("on one module, which is as much as everything", |t| if t / 10 == 2 { 2.0 } else { 0.0 }, 20.0, 0.0),
            // The median is 1, and half of the taxels lie 0.5 or less from it.
            (
                "the three greatest of four, where the fifth is lighter",
                |t| [1.0, 2.0, 1.5, 0.5, -3.0][t / 10],
                45.0,
                30.0_f64.sqrt() * 0.5,
            ),
            ("a colder skin, of which one module is not", |t| if t / 10 == 4 { 0.0 } else { -1.0 }, 10.0, 0.0),
            ("a warmer one, of which one is not", |t| if t / 10 == 4 { 0.0 } else { 1.0 }, 40.0, 0.0),
            ("residues", |t| if t % 2 == 0 { 1.0 } else { -1.0 }, 0.0, all),
            // A contact may hide 4.8 counts, and 30 taxels of residues: more, but less with two uncertainties.
            (
                "residues, and one module that is lighter",
                |t| [0.12, 0.12, 0.12, 0.0, -0.2][t / 10] + if t % 2 == 0 { 1.0 } else { -1.0 },
                1.6,
                all,
            ),
            ("residues under a load", |t| if t % 2 == 0 { 2.0 } else { 0.0 }, 50.0, all),
        ];
        for (what, moved, counts, deviations) in table {
            let zero = Zero::new(moved, |_| 0.0);
            let (weight, found) = (zero.force_n(3.0) / 3.0, zero.hidden());
            let (is, sigma) = (found.newton / weight, found.sigma_n / weight);
            let fits = (is - counts).abs() < 1e-4 && (sigma - 1.4826 * deviations).abs() < 1e-4;
            assert!(fits, "{what}: {is} +- {sigma} counts");
        }
    }

    #[test]
    fn beyond_the_threshold_skin_is_stiffer_and_the_curve_says_how_much() {
        let zero = Zero::new(|taxel| if taxel == 7 { 20.0 } else { 0.0 }, |_| 0.0);
        let linear = 20.0 * zero.force_n(3.0) / 3.0;
        let curve = zero.force_n(20.0);
        assert!((zero.hidden().newton - curve.max(linear)).abs() < 1e-6, "{:?} {curve} {linear}", zero.hidden());
    }

    #[test]
    fn what_a_look_had_let_pass_before_boards_took_zeros_of_their_own_is_hidden_too() {
        let weight = |zero: &Zero| zero.force_n(3.0) / 3.0;
        let both = Zero::new(|_| 0.5, |_| 0.25);
        assert!((both.hidden().newton - 37.5 * weight(&both)).abs() < 1e-6, "{:?}", both.hidden());
        // What lay away from load as a whole is warmth, and takes nothing off.
        let colder = Zero::new(|_| 0.5, |taxel| if taxel < 10 { 1.0 } else { -2.0 });
        assert!((colder.hidden().newton - (25.0 + 30.0) * weight(&colder)).abs() < 1e-6, "{:?}", colder.hidden());
        // Beside a zero that somebody vouched for it may be more, and is never less.
        for (vouched_at, counts) in [(0.5, 37.5), (-0.5, 50.0), (f64::NAN, 37.5)] {
            let mut vouched = Zero::new(|_| 0.5, |_| 0.25);
            vouched.vouched = Zero::new(|_| vouched_at, |_| 0.0).zero;
            assert!((vouched.hidden().newton - counts * weight(&vouched)).abs() < 1e-6, "{:?}", vouched.hidden());
        }
        // Of one without a zero nothing is.
        let unknown = Zero::new(|taxel| if taxel == 0 { f64::NAN } else { 0.5 }, |_| 0.25);
        assert!((unknown.hidden().newton - 36.75 * weight(&unknown)).abs() < 1e-6, "{:?}", unknown.hidden());
    }
}
