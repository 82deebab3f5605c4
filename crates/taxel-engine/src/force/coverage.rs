//! What cannot be read: one rule for taxels without a model, with a fault, without a zero or of a silent module.
//!
//! An *unread* taxel bears the mean of the read ones beside it, and at most that and two standard deviations of theirs: three times as
//! much at the rim of the skin, where they lie on one side of it. Without positions those of its module count as beside it. Of
//! fewer than two nothing follows: such a taxel is *uncovered*. Where unread taxels are filled, contacts that fit those beside them say
//! what they bear (`fill.rs`). A contact that lies on one taxel alone, or in a gap of several, is not
//! held by this rule; nothing in the counts shows it.

use std::ops::Range;

use crate::baseline::{Activation, TaxelBaseline};
use crate::force::neighbours::Neighbours;
use crate::force::reason::positions;
use crate::force::tables::Tables;
use crate::scan::Scan;

/// So many others at least say what a taxel bears.
const READ_BESIDE_MIN: usize = 2;
/// Standard deviations of the readings beside it that an unread taxel bears more at most: 95 %.
const SIGMAS: f64 = 2.0;
/// How many times as much a taxel at the rim may bear as the same readings amid the skin say.
const AT_RIM: f64 = 3.0;
/// A taxel at the corner of a module and those beside it.
const CORNER_TAXELS: usize = 3;
/// A taxel without a zero that lies so far towards load from where it was calibrated may bear one, counts: from day to day a
/// taxel moves by less (see [`crate::zero::rest`]).
const LOADED_COUNTS: f64 = 16.0;

/// A taxel under or beside a contact that cannot be read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unread {
    /// Which.
    pub taxel: usize,
    /// The label of the contact; 0 while that was not looked for.
    pub contact: u16,
    /// What it bears, kPa: the mean of those beside it, or what made-up contacts that fit them say.
    pub kpa: f64,
    /// Standard uncertainty of that, kPa.
    pub sigma_kpa: f64,
    /// What it bears at most, kPa.
    pub at_most_kpa: f64,
}

impl Unread {
    /// By what the taxels beside it read, which `kpa` gives as often as it is asked; `None` where too few of them do.
    pub fn by<I: Iterator<Item = f64>>(taxel: usize, at_rim: bool, kpa: impl Fn() -> I) -> Option<Self> {
        let (count, sum) = kpa().fold((0, 0.0), |(count, sum), kpa| (count + 1, sum + kpa));
        if count < READ_BESIDE_MIN {
            return None;
        }
        let mean = sum / count as f64;
        let variance = kpa().map(|kpa| (kpa - mean).powi(2)).sum::<f64>() / (count - 1) as f64;
        let at_most_kpa = (mean + SIGMAS * variance.sqrt()) * if at_rim { AT_RIM } else { 1.0 };
        Some(Self { taxel, contact: 0, kpa: mean, sigma_kpa: (at_most_kpa - mean) / SIGMAS, at_most_kpa })
    }

    /// Standard uncertainty where it is taken to bear nothing, kPa.
    pub fn missing_kpa(&self) -> f64 {
        self.at_most_kpa / SIGMAS
    }
}

/// A taxel that is heard and has a model, but does not count: it has a fault, or no zero.
#[derive(Clone, Copy, Debug)]
pub struct Watched {
    /// Which.
    pub taxel: usize,
    /// Whether it has a fault; else it has no zero.
    pub has_fault: bool,
    /// Beyond this count, turned so that load is positive, it reads a load.
    loaded_from: f64,
    sign: f64,
}

impl Watched {
    /// `None` of a taxel without a usable model.
    pub fn new(
        tables: &Tables,
        zero: &[TaxelBaseline],
        activation: Activation,
        taxel: usize,
        is_sound: bool,
    ) -> Option<Self> {
        let set = tables.set();
        let model = set.taxels.get(taxel).filter(|model| model.is_usable())?;
        let sign = model.sign.as_f64();
        let loaded_from = match zero.get(taxel).filter(|_| tables.has(taxel)) {
            Some(zero) => sign * zero.mean + activation.distance_counts(zero.noise),
            None => sign * set.baseline[taxel].mean + LOADED_COUNTS,
        };
        Some(Self { taxel, has_fault: !is_sound, loaded_from, sign })
    }

    /// Whether it reads a load.
    pub fn reads_a_load(&self, scan: &Scan<'_>) -> bool {
        scan.counts.units(self.taxel).is_some_and(|count| self.sign * count > self.loaded_from)
    }
}

/// The taxels that are not selected and lie where no selected ones tell of a load on them either, ascending.
pub fn uncovered(neighbours: Option<&Neighbours>, modules: &[Range<usize>], selected: &[bool]) -> Vec<u16> {
    let unread = |range: Range<usize>| range.filter(|&taxel| !selected[taxel]);
    let mut uncovered = match neighbours {
        Some(neighbours) => {
            let read_beside = |taxel: usize| neighbours.of(taxel).filter(|&other| selected[other]).count();
            positions(unread(0..selected.len()).filter(|&taxel| read_beside(taxel) < READ_BESIDE_MIN))
        }
        // Without positions one that lies at the corner of a module may be, with the two beside it, and on a small one sooner.
        None => {
            let is_cornered = |range: &&Range<usize>| {
                let missing = unread((*range).clone()).count();
                missing >= CORNER_TAXELS || missing > 0 && 2 * missing >= range.len()
            };
            positions(modules.iter().filter(is_cornered).flat_map(|range| unread(range.clone())))
        }
    };
    uncovered.sort_unstable();
    uncovered
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::force::tests::row;

    fn uncovered_of(neighbours: Option<&Neighbours>, lengths: &[usize], missing: impl Fn(usize) -> bool) -> Vec<u16> {
        let starts = lengths.iter().scan(0, |end, length| Some(std::mem::replace(end, *end + length)));
        let modules: Vec<Range<usize>> = starts.zip(lengths).map(|(start, length)| start..start + length).collect();
        let selected: Vec<bool> = (0..lengths.iter().sum()).map(|taxel| !missing(taxel)).collect();
        uncovered(neighbours, &modules, &selected)
    }

    #[test]
    fn a_taxel_is_uncovered_where_fewer_than_two_beside_it_can_be_read() {
        let row = Neighbours::new(&row(20));
        let uncovered = |missing: &dyn Fn(usize) -> bool| uncovered_of(Some(&row), &[10, 10], missing);
        assert!(uncovered(&|taxel| taxel == 5).is_empty(), "one among sound ones");
        assert_eq!(uncovered(&|taxel| taxel >= 10), (10..20).collect::<Vec<u16>>(), "a module");
        assert_eq!(uncovered(&|_| true).len(), 20);
    }

    #[test]
    fn without_positions_a_corner_of_a_module_may_be_missing() {
        let uncovered =
            |lengths: &[usize], missing: &[usize]| uncovered_of(None, lengths, |t| missing.contains(&t)).len();
        assert_eq!([uncovered(&[10, 10], &[0, 1, 10, 11]), uncovered(&[10, 10], &[0, 1, 2])], [0, 3]);
        assert_eq!([uncovered(&[12, 3], &[13, 14]), uncovered(&[12, 3], &[13]), uncovered(&[12, 2], &[13])], [2, 0, 1]);
        assert_eq!([uncovered(&[12, 1], &[12]), uncovered(&[12, 1], &[])], [1, 0]);
    }

    #[test]
    fn what_an_unread_taxel_bears_is_the_mean_beside_it_and_at_most_two_deviations_more() {
        let of = |at_rim| Unread::by(7, at_rim, || [8.0, 12.0, 10.0].into_iter()).unwrap();
        assert_eq!(of(false), Unread { taxel: 7, contact: 0, kpa: 10.0, sigma_kpa: 2.0, at_most_kpa: 14.0 });
        assert_eq!(of(false).missing_kpa(), 7.0);
        assert_eq!(of(true).at_most_kpa, 42.0);
        assert_eq!(Unread::by(7, false, || [8.0].into_iter()), None);
    }
}
