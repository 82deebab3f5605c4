//! What a zero may hide: a load that lay on the skin while it was taken.
//!
//! A zero is taken where nothing seems to lie on the skin, which the counts can tell from a light load only as far as
//! they return from day to day. So what the zero itself may hide counts, too: with `h = sum w (zero - zero of the models)`
//! over a module (beyond the threshold what the taxel's curve says instead), `H` is the sum of all `h`, a load on
//! everything, or that of the three greatest, a contact, whichever is more. What has left the skin since its zero was taken
//! hides in it no longer. A skin that lies away from load as a whole, as a colder one does, hides a contact by as much, so a
//! contact is measured from the median taxel of the other modules then, and has its error. Boards that took a zero of their own
//! since the models were gathered leave a residue on every taxel, which may hide a load as well: how far the taxels lie apart is how large these
//! are, `H` has the standard uncertainty `sqrt(sum (w d)^2)` of its taxels, `d` from the median deviation. Where somebody has
//! confirmed a zero since, the same is measured from that zero, and what is more counts.

use std::ops::Range;

use crate::baseline::TaxelBaseline;
use crate::force::sample::Undetected;
use crate::force::source::Light;
use crate::force::tables::Tables;
use crate::statistics::{MEDIAN_DEVIATIONS, median, median_error};

/// A contact touches so many modules at the most that a fingertip or a known mass does.
pub(super) const CONTACT_MODULES: usize = 3;

/// The zeros of a patch, one entry per taxel.
#[derive(Clone, Copy, Debug)]
pub struct Zeros<'a> {
    /// That which holds as it was taken, without what has left the skin since: not moved by what follows the temperature.
    pub taken: &'a [TaxelBaseline],
    /// That which somebody confirmed since the boards took theirs; empty without one.
    pub confirmed: &'a [TaxelBaseline],
}

/// Force that the zero would hide if everything by which it lies towards load from that of the models, or from one that somebody
/// confirmed, were load: the more of both.
pub(super) fn hidden(tables: &Tables, taxels: &[Light], zeros: Zeros<'_>, modules: &[Range<usize>]) -> Undetected {
    let beside = |other: &[TaxelBaseline]| hidden_beside(tables, taxels, other, zeros.taken, modules);
    let models = beside(&tables.set().baseline);
    if zeros.confirmed.is_empty() { models } else { greater(models, beside(zeros.confirmed)) }
}

fn greater(one: Undetected, other: Undetected) -> Undetected {
    if other.at_most() > one.at_most() { other } else { one }
}

/// What a zero `taken` may hide if the skin is unloaded where it reads `other`.
fn hidden_beside(
    tables: &Tables,
    taxels: &[Light],
    other: &[TaxelBaseline],
    taken: &[TaxelBaseline],
    modules: &[Range<usize>],
) -> Undetected {
    let moved = |taxel: usize| {
        let light = taxels.get(taxel).filter(|light| light.newton_per_count > 0.0)?;
        let counts = (taken.get(taxel)?.mean - other.get(taxel)?.mean) * light.sign;
        counts.is_finite().then_some(counts)
    };
    let all: Vec<Option<f64>> = (0..taxels.len()).map(moved).collect();
    let middle = median(all.iter().copied().flatten()).unwrap_or(0.0);
    let apart = MEDIAN_DEVIATIONS * median(all.iter().flatten().map(|moved| (moved - middle).abs())).unwrap_or(0.0);
    let newton = |taxel: usize, moved: f64| {
        let light = &taxels[taxel];
        let linear = light.newton_per_count * moved;
        // Beyond the threshold skin becomes stiffer: the curve says more than its beginning.
        let curve = || tables.threshold_n(taxel, moved).unwrap_or(linear).max(linear);
        if moved > light.threshold_counts { curve() } else { linear }
    };
    // A contact on a skin that lies away from load is measured from the median of the modules beside it, whose error its taxels have
    // in common.
    let of_module = |range: &Range<usize>| all[range.clone()].iter().copied().flatten();
    let mut medians: Vec<(f64, usize)> =
        modules.iter().enumerate().filter_map(|(module, range)| Some((median(of_module(range))?, module))).collect();
    medians.sort_by(|a, b| b.0.total_cmp(&a.0));
    let beside: Vec<f64> =
        medians.iter().skip(CONTACT_MODULES).flat_map(|&(_, module)| of_module(&modules[module])).collect();
    let level = median(beside.iter().copied()).unwrap_or(middle).min(0.0);
    let level_off = if level < 0.0 { median_error(apart, beside.len()) } else { 0.0 };
    // Of each module its force, that beside what moved the whole skin away from load, its squared uncertainty, and N per count.
    let of_module = |range: &Range<usize>| {
        let moved = range.clone().filter_map(|taxel| Some((taxel, all.get(taxel).copied()??)));
        moved.fold([0.0; 4], |[force, contact, squared, per_count], (taxel, moved)| {
            let weight = taxels[taxel].newton_per_count;
            let sigma = weight * apart;
            let beside = newton(taxel, moved - level);
            [force + newton(taxel, moved), contact + beside, squared + sigma * sigma, per_count + weight]
        })
    };
    let mut by_module: Vec<[f64; 4]> = modules.iter().map(of_module).collect();
    let sum = |modules: &[[f64; 4]], of: usize| modules.iter().map(|module| module[of].max(0.0)).sum::<f64>();
    let everything: f64 = by_module.iter().map(|module| module[0]).sum();
    let everything = Undetected { newton: everything.max(0.0), sigma_n: sum(&by_module, 2).sqrt() };
    by_module.sort_by(|a, b| b[1].total_cmp(&a[1]));
    by_module.truncate(CONTACT_MODULES);
    let sigma_n = sum(&by_module, 2).sqrt().hypot(level_off * sum(&by_module, 3));
    greater(Undetected { newton: sum(&by_module, 1), sigma_n }, everything)
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
        confirmed: Vec<TaxelBaseline>,
    }

    impl Zero {
        /// Taxels that have moved so many counts towards load since the models' zero.
        fn new(moved: impl Fn(usize) -> f64) -> Self {
            let at = |moved: f64| TaxelBaseline { mean: f64::from(REST) - moved, noise: 0.5 };
            let zero: Vec<TaxelBaseline> = (0..TAXELS).map(|taxel| at(moved(taxel))).collect();
            // Curves are read from the models' zero on, as the figures below are.
            let tables = Tables::new(set(TAXELS), &rest(TAXELS), &[AREA; TAXELS], ACTIVATION);
            Self { tables, zero, confirmed: Vec::new() }
        }

        /// What a count weighs.
        fn weight(&self) -> f64 {
            self.tables.light(0).newton_per_count
        }

        fn hidden(&self) -> Undetected {
            let taxels: Vec<Light> = (0..TAXELS).map(|taxel| *self.tables.light(taxel)).collect();
            let modules: Vec<Range<usize>> = (0..TAXELS / 10).map(|module| 10 * module..10 * module + 10).collect();
            let zeros = Zeros { taken: &self.zero, confirmed: &self.confirmed };
            hidden(&self.tables, &taxels, zeros, &modules)
        }
    }

    #[test]
    fn what_a_zero_may_hide_in_figures() {
        type Moved = fn(usize) -> f64;
        // How far each taxel has moved, what may lie there in counts of a taxel, and its uncertainty in median deviations of one.
        let all = 50.0_f64.sqrt();
        // Of a contact 30 taxels of residues, and the median of 20 that it is measured from is off by 1.25 / sqrt(20).
        let of_contact = 30.0_f64.sqrt().hypot(30.0 * 1.2533 / 20.0_f64.sqrt());
        let table: [(&str, Moved, f64, f64); 5] = [
            ("a load on everything", |_| 1.0, 50.0, 0.0),
            // The median is 1, and half of the taxels lie 0.5 or less from it; the median of the other two modules is -1.25.
            (
                "the three greatest of four, where the fifth is lighter",
                |t| [1.0, 2.0, 1.5, 0.5, -3.0][t / 10],
                82.5,
                0.5 * of_contact,
            ),
            ("a colder skin, of which one module is not", |t| if t / 10 == 4 { 0.0 } else { -1.0 }, 10.0, 0.0),
            ("residues", |t| if t % 2 == 0 { 1.0 } else { -1.0 }, 0.0, all),
            ("residues under a load", |t| if t % 2 == 0 { 2.0 } else { 0.0 }, 50.0, all),
        ];
        for (what, moved, counts, deviations) in table {
            let zero = Zero::new(moved);
            let (weight, found) = (zero.weight(), zero.hidden());
            let (is, sigma) = (found.newton / weight, found.sigma_n / weight);
            let fits = (is - counts).abs() < 1e-4 && (sigma - 1.4826 * deviations).abs() < 1e-4;
            assert!(fits, "{what}: {is} +- {sigma} counts");
        }
    }

    #[test]
    fn beyond_the_threshold_skin_is_stiffer_and_the_curve_says_how_much() {
        let zero = Zero::new(|taxel| if taxel == 7 { 20.0 } else { 0.0 });
        let linear = 20.0 * zero.weight();
        let curve = zero.tables.threshold_n(0, 20.0).unwrap();
        assert!((zero.hidden().newton - curve.max(linear)).abs() < 1e-6, "{:?} {curve} {linear}", zero.hidden());
    }

    #[test]
    fn beside_a_zero_that_somebody_confirmed_it_may_be_more_and_is_never_less() {
        for (confirmed_at, counts) in [(0.5, 25.0), (-0.5, 50.0), (f64::NAN, 25.0)] {
            let mut zero = Zero::new(|_| 0.5);
            zero.confirmed = Zero::new(|_| confirmed_at).zero;
            assert!((zero.hidden().newton - counts * zero.weight()).abs() < 1e-6, "{:?}", zero.hidden());
        }
        // Of a taxel without a zero nothing is.
        let unknown = Zero::new(|taxel| if taxel == 0 { f64::NAN } else { 0.5 });
        assert!((unknown.hidden().newton - 24.5 * unknown.weight()).abs() < 1e-6, "{:?}", unknown.hidden());
    }
}
