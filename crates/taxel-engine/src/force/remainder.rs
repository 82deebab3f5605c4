//! What presses below the activation thresholds: the force that a scan cannot show as a touch.
//!
//! The counts of all taxels that are not active still say how much may lie there. With `w` the force per count of a taxel
//! (area times threshold pressure, or its uncertainty if that is more, over threshold distance) and `c` its counts from
//! the zero towards pressure, the remainder is `R = sum w c`. Its standard uncertainty is the noise of single readings, `sum (w s)^2`, and what all
//! taxels share, the zero's: `(z sum w)^2`.
//!
//! A zero is taken where nothing seems to lie on the skin, so what the zero itself may hide counts, too: `H`, with an
//! uncertainty of its own (`hidden.rs`).
//!
//! What the zero has followed of the temperature since it was taken is no part of `H`: what a load may have had in that
//! is known to the zero, and the caller adds it to the floor.
//!
//! Where the taxels that are not active lie away from load by `o = -R / sum w` counts in the mean, as those of a skin do
//! whose temperature has changed since the zero, a contact that activates none hides by as much: `C = max(o, 0) sum w` over
//! the modules of a contact.
//!
//! Taxels that are not active were chosen, too: where a load lies about the threshold of many, noise keeps those below that read
//! too little. Of one that lies at its threshold what is left reads `sqrt(2 / pi) s` less than it should, of one that lies at
//! its zero nothing: `B = sqrt(2 / pi) sum w s R / sum w t`, at most for all of them, with `t` the threshold distance.
//!
//! The floor is `max(R, 0) + B + C + max(H, 0)` and two standard uncertainties, to which comes what all forces have: that of the
//! areas and of the gauge's gain, relative to the sum of the four. The owner counts of the first three no less than their
//! mean over the last half second (`lately.rs`).
//!
//! Where the taxels of a module jump together, one that jumps away from load hides a touch by as much: the owner adds the jump
//! times the sum of `w` over the module ([`Remainder::jumped_n`]).
//!
//! Which taxels are in a total hangs on their noise, too. That of a contact on the modules that have most of it,
//! `sqrt(sum (w s)^2)`, is in every total, as is that of taxels below the threshold that are in it because they touch an
//! active one: these were chosen by their reading, so that their noise does not average out but adds up, `sum w s`.

mod hidden;
mod share;

use std::ops::Range;
use taxel_skin::Newton;

pub use self::hidden::Rest;
pub use self::share::{CONTACT_MODULES, FLOOR_SIGMAS, newton_per_count};

use self::hidden::Hidden;
use self::share::Share;
use crate::baseline::Activation;
use crate::counts::Counts;
use crate::force::source::LOW_SHARE;
use crate::force::tables::Tables;

/// Noise alone seldom takes a taxel so many times as far as its activation threshold: at the default one that is six standard
/// deviations, which of 250 taxels with normal noise one reaches once in 23 hours at 50 scans a second.
const TELLING_DISTANCE: f64 = 1.5;
/// So many taxels beyond their activation thresholds are seldom noise either: at four standard deviations two of 250 are in the
/// same scan once in ten minutes, and hardly ever beside the same one that cannot be read.
const TELLING_TAXELS: i32 = 2;

/// The remainder of a patch at one zero and one selection.
#[derive(Clone, Debug, Default)]
pub struct Remainder {
    /// Force per raw count of every taxel, N, for the walk over all.
    newton_per_count: Vec<f32>,
    shares: Vec<Share>,
    /// Force of all zeros: what the walk over raw counts has too much.
    zeros_n: f64,
    /// Sum of the squared noises, N squared.
    noise_n2: f64,
    /// Sums of the noises and of the forces at the thresholds, N.
    noise_n: f64,
    threshold_n: f64,
    /// Squared noise of a contact on the modules that have most of it, N squared.
    contact_noise_n2: f64,
    /// Sum of the forces per count, N.
    per_count_n: f64,
    /// The same of a contact on the modules that have most of it, N.
    contact_per_count_n: f64,
    /// What the zero may hide.
    hidden: Hidden,
    /// Standard uncertainty that all forces share, relative to them.
    relative_sigma: f64,
}

/// How far below its mean what is left of normal noise lies that is cut off there, standard deviations: `sqrt(2 / pi)`.
const KEPT_BELOW: f64 = 0.797_884_560_802_865_4;

/// What a taxel reads below its threshold.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Weak {
    /// On a straight line through its zero, N; negative away from load.
    pub newton: f64,
    /// Standard deviation of that, N.
    pub noise_n: f64,
    /// Whether it is a touch beside an active taxel: then its curve says more.
    pub is_touch: bool,
}

/// What may press unseen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Unseen {
    /// Standard uncertainty of a total because noise decides which taxels are in it, N.
    pub choice_n: f64,
    /// The force that may press in addition without activating a taxel.
    pub floor: Newton,
    /// The same without what the zero may hide: a total above it is there.
    pub told: Newton,
    /// What this scan reads of it, noise included, N.
    pub read_n: f64,
    /// How far the taxels that are not active lie from their zero in the mean, counts towards pressure: by so much the
    /// zero may be off under the active ones, too.
    pub offset_counts: f64,
    /// Whether active taxels read more than noise makes of nothing: then a contact is there.
    pub has_contact: bool,
}

impl Remainder {
    /// For the taxels that are `selected` at the zero `rest`; all slices by taxel. `relative_sigma` is the standard
    /// uncertainty that all forces share, relative to them.
    #[must_use]
    pub fn new(
        tables: &Tables,
        rest: Rest<'_>,
        activation: Activation,
        selected: &[bool],
        modules: &[Range<usize>],
        relative_sigma: f64,
    ) -> Self {
        let share = |taxel: usize| Share::of(tables, rest.zero[taxel], activation, taxel);
        let shares: Vec<Share> =
            (0..selected.len()).map(|t| selected[t].then(|| share(t)).flatten().unwrap_or_default()).collect();
        let sum = |of: &dyn Fn(&Share) -> f64| shares.iter().map(of).sum::<f64>();
        let contact = |of: &dyn Fn(&Share) -> f64| {
            let of_module = |range: &Range<usize>| range.clone().filter_map(|taxel| shares.get(taxel)).map(of).sum();
            let mut by_module: Vec<f64> = modules.iter().map(of_module).collect();
            by_module.sort_by(|a, b| b.total_cmp(a));
            by_module.iter().take(CONTACT_MODULES).sum::<f64>()
        };
        Self {
            newton_per_count: shares.iter().map(|s| s.newton_per_count).collect(),
            zeros_n: sum(&|s| f64::from(s.newton_per_count) * f64::from(s.zero)),
            hidden: Hidden::of(tables, &shares, rest, modules),
            noise_n2: sum(&|s| f64::from(s.noise_n).powi(2)),
            noise_n: sum(&|s| f64::from(s.noise_n)),
            threshold_n: sum(&|s| f64::from(s.threshold_n)),
            contact_noise_n2: contact(&|s| f64::from(s.noise_n).powi(2)),
            per_count_n: sum(&|s| f64::from(s.newton_per_count).abs()),
            contact_per_count_n: contact(&|s| f64::from(s.newton_per_count).abs()),
            relative_sigma,
            shares,
        }
    }

    /// What a taxel reads without a threshold; nothing of one that is not selected.
    #[must_use]
    pub fn weak(&self, taxel: usize, counts: Counts<'_>) -> Weak {
        let (Some(share), Some(count)) = (self.shares.get(taxel), counts.units(taxel)) else { return Weak::default() };
        let newton = f64::from(share.newton_per_count) * (count - f64::from(share.zero));
        let is_touch = newton > LOW_SHARE * f64::from(share.threshold_n);
        Weak { newton, noise_n: f64::from(share.noise_n), is_touch }
    }

    /// What may press unseen because the taxels of modules jump together, N; `jumps` by module, counts.
    #[must_use]
    pub fn jumped_n(&self, modules: &[Range<usize>], jumps: &[f32]) -> f64 {
        let of_module = |(range, jump): (&Range<usize>, &f32)| {
            let shares = range.clone().filter_map(|taxel| self.shares.get(taxel));
            f64::from(*jump) * shares.map(|share| f64::from(share.newton_per_count).abs()).sum::<f64>()
        };
        modules.iter().zip(jumps).filter(|(_, jump)| **jump > 0.0).map(of_module).sum()
    }

    /// The force of all raw counts, N.
    fn walk_n(&self, counts: Counts<'_>) -> f64 {
        match counts {
            Counts::Bytes(bytes) => dot(&self.newton_per_count, bytes),
            Counts::Words(words, range) => dot(&self.newton_per_count, words) / range.per_unit(),
        }
    }

    /// What may press beside the `active` taxels, at a zero that all taxels share an uncertainty of.
    #[must_use]
    pub fn unseen<'a>(
        &self,
        counts: impl Into<Counts<'a>>,
        active: impl Iterator<Item = usize>,
        zero_sigma_counts: f64,
    ) -> Unseen {
        let counts = counts.into();
        let (mut rest_n, mut noise_n2, mut per_count_n) =
            (self.walk_n(counts) - self.zeros_n, self.noise_n2, self.per_count_n);
        let (mut noise_n, mut threshold_n) = (self.noise_n, self.threshold_n);
        let (mut chosen_n, mut has_contact, mut beyond) = (0.0, false, 0);
        for taxel in active {
            let (Some(share), Some(count)) = (self.shares.get(taxel), counts.units(taxel)) else {
                has_contact = true; // who knows
                continue;
            };
            let pressed_n = f64::from(share.newton_per_count) * (count - f64::from(share.zero));
            rest_n -= pressed_n;
            // Of a taxel of which nothing is known both are 0.
            has_contact |= pressed_n >= TELLING_DISTANCE * f64::from(share.threshold_n);
            beyond += i32::from(pressed_n >= f64::from(share.threshold_n));
            if pressed_n < f64::from(share.threshold_n) {
                chosen_n += f64::from(share.noise_n);
            }
            noise_n2 -= f64::from(share.noise_n).powi(2);
            (noise_n, threshold_n) = (noise_n - f64::from(share.noise_n), threshold_n - f64::from(share.threshold_n));
            per_count_n -= f64::from(share.newton_per_count).abs();
        }
        let unseen_n2 = noise_n2.max(0.0) + (zero_sigma_counts * per_count_n).powi(2);
        let offset_counts = if per_count_n > 0.0 { rest_n / per_count_n } else { 0.0 };
        let beside_n = (-offset_counts).max(0.0) * self.contact_per_count_n;
        // Where all taxels are active nothing but rounding is left of these sums.
        let at_threshold = if threshold_n > 0.0 { (rest_n / threshold_n).clamp(0.0, 1.0) } else { 0.0 };
        let kept_below_n = KEPT_BELOW * noise_n.max(0.0) * at_threshold;
        let (unseen, hidden) = (rest_n.max(0.0) + kept_below_n + beside_n, self.hidden);
        let shared = self.relative_sigma * (unseen + hidden.newton);
        let floor_sigma = (unseen_n2 + hidden.sigma_n.powi(2) + shared.powi(2)).sqrt();
        Unseen {
            choice_n: (chosen_n.powi(2) + self.contact_noise_n2).sqrt(),
            floor: Newton(unseen + hidden.newton + FLOOR_SIGMAS * floor_sigma),
            told: Newton(unseen - kept_below_n + FLOOR_SIGMAS * unseen_n2.sqrt()),
            read_n: unseen,
            offset_counts,
            has_contact: has_contact || beyond >= TELLING_TAXELS,
        }
    }
}

/// Sum of the products, in a fixed order, sixteen chains at a time.
fn dot<C: Copy + Into<f32> + Into<f64>>(weights: &[f32], counts: &[C]) -> f64 {
    const LANES: usize = 16;
    let mut lanes = [0.0_f32; LANES];
    let (weights, weights_rest) = weights.as_chunks::<LANES>();
    let (counts, counts_rest) = counts.as_chunks::<LANES>();
    for (weights, counts) in weights.iter().zip(counts) {
        for i in 0..LANES {
            let count: f32 = counts[i].into();
            lanes[i] += weights[i] * count;
        }
    }
    let product = |(&weight, &count): (&f32, &C)| -> f64 {
        let count: f64 = count.into();
        f64::from(weight) * count
    };
    let rest: f64 = weights_rest.iter().zip(counts_rest).map(product).sum();
    lanes.iter().fold(rest, |sum, lane| sum + f64::from(*lane))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baseline::TaxelBaseline;
    use crate::force::tests::{ACTIVATION, AREA, REST, rest, set};
    use proptest::prelude::*;

    const TAXELS: usize = 37;
    const MODULES: [Range<usize>; 4] = [0..10, 10..20, 20..30, 30..37];

    fn tables() -> Tables {
        Tables::new(set(TAXELS), &rest(TAXELS), &[AREA; TAXELS], ACTIVATION)
    }

    /// Count, selected, active.
    fn taxels(counts: std::ops::RangeInclusive<u8>) -> impl Strategy<Value = Vec<(u8, bool, bool)>> {
        proptest::collection::vec((counts, prop::bool::weighted(0.9), prop::bool::weighted(0.2)), TAXELS)
    }

    fn unseen(tables: &Tables, taxels: &[(u8, bool, bool)], zero_sigma: f64) -> Unseen {
        unseen_of(tables, taxels, zero_sigma, 0.0)
    }

    fn unseen_of(tables: &Tables, taxels: &[(u8, bool, bool)], zero_sigma: f64, relative_sigma: f64) -> Unseen {
        let counts: Vec<u8> = taxels.iter().map(|t| t.0).collect();
        let selected: Vec<bool> = taxels.iter().map(|t| t.1).collect();
        let active = (0..TAXELS).filter(|&t| taxels[t].1 && taxels[t].2);
        let zero = rest(TAXELS);
        let rest = Rest { zero: &zero, taken: &zero, vouched: &[] };
        Remainder::new(tables, rest, ACTIVATION, &selected, &MODULES, relative_sigma)
            .unseen(&counts, active, zero_sigma)
    }

    proptest! {
        #[test]
        fn it_is_what_a_plain_loop_over_the_taxels_gives(
            taxels in prop_oneof![taxels(0..=255), taxels(REST - 6..=REST + 2), taxels(REST - 2..=REST + 6)],
            zero_sigma in 0.0..0.5_f64,
            relative_sigma in 0.0..0.2_f64,
        ) {
            let tables = tables();
            let (mut remainder, mut noise, mut per_count, mut chosen) = (0.0, 0.0, 0.0, 0.0);
            let (mut of_modules, mut counts_of_modules) = ([0.0; 4], [0.0; 4]);
            let (mut noises, mut thresholds) = (0.0, 0.0);
            for (taxel, &(count, selected, active)) in taxels.iter().enumerate() {
                let distance = ACTIVATION.distance_counts(0.5);
                let newton_per_count = tables.threshold_n(taxel, distance).unwrap() / distance;
                if selected {
                    of_modules[taxel / 10] += (newton_per_count * 0.5).powi(2);
                    counts_of_modules[taxel / 10] += newton_per_count;
                }
                if selected && active && f64::from(REST) - f64::from(count) < distance {
                    chosen += newton_per_count * 0.5;
                }
                if selected && !active {
                    remainder += newton_per_count * (f64::from(REST) - f64::from(count));
                    noise += (newton_per_count * 0.5).powi(2);
                    per_count += newton_per_count;
                    noises += newton_per_count * 0.5;
                    thresholds += newton_per_count * distance;
                }
            }
            let sigma = (noise + (zero_sigma * per_count).powi(2)).sqrt();
            let found = unseen_of(&tables, &taxels, zero_sigma, relative_sigma);
            of_modules.sort_by(f64::total_cmp);
            let choice = of_modules[1..].iter().sum::<f64>().sqrt().hypot(chosen);
            prop_assert!((found.choice_n - choice).abs() < 1e-4 * (1.0 + choice), "{found:?} {choice}");
            counts_of_modules.sort_by(f64::total_cmp);
            let offset = if per_count > 0.0 { remainder / per_count } else { 0.0 };
            // The walk is one of single precision over raw counts: 37 products of up to 255 counts that weigh 0.1 N each.
            let slack = 1e-3;
            let off = (found.offset_counts - offset).abs() * per_count;
            prop_assert!(off < slack, "{found:?} {offset}");
            let contact = counts_of_modules[1..].iter().sum::<f64>();
            let beside = (-offset).max(0.0) * contact;
            // What is off in the mean of a few taxels is off by as much in all of a contact.
            let slack = 2.0 * slack * (1.0 + if per_count > 0.0 { contact / per_count } else { 0.0 });
            let is_near = |is: f64, expected: f64| (is - expected).abs() < slack;
            let kept = if thresholds > 0.0 { noises * (remainder / thresholds).clamp(0.0, 1.0) } else { 0.0 };
            let pressing = remainder.max(0.0) + (2.0 / std::f64::consts::PI).sqrt() * kept + beside;
            let floor = pressing + FLOOR_SIGMAS * sigma.hypot(relative_sigma * pressing);
            prop_assert!(is_near(found.read_n, pressing) && is_near(found.floor.0, floor), "{found:?} {floor}");
            let told = remainder.max(0.0) + beside + FLOOR_SIGMAS * sigma;
            prop_assert!(is_near(found.told.0, told), "{found:?} {told}");
        }

        /// Whatever lies on taxels below their thresholds, as their own curves tell it, is less than the floor.
        #[test]
        fn the_floor_holds_what_presses_below_the_thresholds(taxels in taxels(REST - 2..=REST), zero_sigma in 0.0..0.5_f64) {
            let tables = tables();
            let below = |(taxel, &(count, selected, active)): (usize, &(u8, bool, bool))| {
                let kpa = tables.reading(taxel, count, 0.0).map_or(0.0, |reading| f64::from(reading.pressure_kpa));
                if selected && !active { kpa * AREA.0 * 1e-3 } else { 0.0 }
            };
            let pressing: f64 = taxels.iter().enumerate().map(below).sum();
            let found = unseen(&tables, &taxels, zero_sigma);
            prop_assert!(found.floor.0 >= pressing - 1e-4, "{found:?} {pressing}");
        }

        #[test]
        fn it_is_never_certain_of_a_selected_taxel_and_never_not_a_number(
            taxels in taxels(0..=255), zero_sigma in 0.0..0.5_f64
        ) {
            let found = unseen(&tables(), &taxels, zero_sigma);
            prop_assert!(found.floor.0.is_finite() && found.floor.0 >= 0.0, "{found:?}");
            let open = taxels.iter().any(|&(_, selected, active)| selected && !active);
            prop_assert!(!open || found.floor.0 > 0.0, "{found:?}");
            let selected = taxels.iter().any(|&(_, selected, _)| selected);
            prop_assert!(found.choice_n.is_finite() && (!selected || found.choice_n > 0.0), "{found:?}");
        }
    }

    #[test]
    fn a_contact_on_a_skin_that_lies_away_from_load_is_less_than_the_floor() {
        let tables = tables();
        for warmed in 1..=3 {
            // All taxels moved away from load, and those of the first module came back by as much: it is pressed.
            let pressed = |taxel: usize| if taxel < 10 { REST } else { REST + warmed };
            let taxels: Vec<(u8, bool, bool)> = (0..TAXELS).map(|taxel| (pressed(taxel), true, false)).collect();
            let pressure = f64::from(tables.reading(0, REST - warmed, 0.0).unwrap().pressure_kpa);
            let pressing = 10.0 * pressure * AREA.0 * 1e-3;
            let found = unseen(&tables, &taxels, 0.0);
            assert!(pressing > 0.0 && found.told.0 >= pressing - 1e-4, "{warmed} counts: {found:?} {pressing}");
        }
    }

    /// All taxels rest a count nearer to load than the models' zero.
    #[test]
    fn what_all_forces_have_in_common_is_uncertain_of_what_the_zero_hides_too() {
        let mut zero = rest(TAXELS);
        zero.iter_mut().for_each(|taxel| taxel.mean -= 1.0);
        let found = |relative_sigma: f64| {
            let rest = Rest { zero: &zero, taken: &zero, vouched: &[] };
            let remainder = Remainder::new(&tables(), rest, ACTIVATION, &[true; TAXELS], &MODULES, relative_sigma);
            remainder.unseen(&[REST - 1; TAXELS], std::iter::empty(), 0.0)
        };
        let (alone, shared) = (found(0.0), found(0.2));
        let (hidden, noise) = (alone.floor.0 - alone.told.0, alone.told.0 / FLOOR_SIGMAS);
        assert!(hidden > 1.0 && alone.read_n.abs() < 1e-4, "{alone:?}");
        let expected = hidden + FLOOR_SIGMAS * noise.hypot(0.2 * hidden);
        assert!((shared.floor.0 - expected).abs() < 1e-3, "{shared:?} {expected}");
    }

    #[test]
    fn counts_of_more_than_eight_bits_leave_as_much_room() {
        let (zero, range) = (rest(TAXELS), taxel_skin::CountRange::to(65_535).unwrap());
        let bytes: Vec<u8> = (0..TAXELS as u8).map(|taxel| REST - taxel % 4).collect();
        let words: Vec<u16> = bytes.iter().map(|&count| range.nearest(f64::from(count))).collect();
        let held = Rest { zero: &zero, taken: &zero, vouched: &[] };
        let remainder = Remainder::new(&tables(), held, ACTIVATION, &[true; TAXELS], &MODULES, 0.1);
        let active = || [3, 7].into_iter();
        let (narrow, wide) =
            (remainder.unseen(&bytes, active(), 0.1), remainder.unseen(Counts::Words(&words, range), active(), 0.1));
        assert!(narrow.read_n > 0.1, "{narrow:?}");
        for (narrow, wide) in [(narrow.read_n, wide.read_n), (narrow.floor.0, wide.floor.0)] {
            assert!((narrow - wide).abs() < 1e-3, "{narrow} N of bytes, {wide} N of words");
        }
    }

    #[test]
    fn a_taxel_whose_zero_is_not_known_leaves_no_room_and_makes_no_number_that_is_none() {
        let mut unknown = rest(TAXELS);
        unknown[3] = TaxelBaseline::UNKNOWN;
        unknown[4].noise = f64::NAN;
        unknown[5].mean = f64::NAN;
        // With tables of an earlier zero, too.
        for tables in [Tables::new(set(TAXELS), &unknown, &[AREA; TAXELS], ACTIVATION), tables()] {
            let unseen = |selected: &[bool; TAXELS]| {
                let rest = Rest { zero: &unknown, taken: &unknown, vouched: &[] };
                let remainder = Remainder::new(&tables, rest, ACTIVATION, selected, &MODULES, 0.1);
                remainder.unseen(&[REST - 1; TAXELS], std::iter::once(4), 0.1)
            };
            let found = unseen(&[true; TAXELS]);
            assert!(found.read_n > 0.1 && found.choice_n > 0.0, "{found:?}");
            assert_eq!(found, unseen(&std::array::from_fn(|taxel| taxel != 3 && taxel != 5)), "those do not count");
        }
    }
}
