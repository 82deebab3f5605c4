//! What presses below the activation thresholds: the force that a scan cannot show as a touch.
//!
//! The counts of all taxels that are not in the total still say how much may lie there. With `w` the force per count of a taxel
//! below its threshold (`Light`) and `c` its counts from the zero towards pressure, that is `R = sum w c`. Its standard
//! uncertainty is the noise of single readings, `sum (w s)^2`, and what the zero's uncertainty weighs on the whole skin.
//!
//! A zero is taken where nothing seems to lie on the skin, so what the zero itself may hide counts, too: `H`, with an
//! uncertainty of its own (`hidden.rs`).
//!
//! What the zero has followed of the temperature since it was taken is no part of `H`: what a load may have had in that
//! is known to the zero, and comes on top.
//!
//! What is undetected is `max(R, 0) + max(H, 0)` with the uncertainties of both, to which comes what all forces have: that of the
//! areas, of the gauge's gain and of the day's, relative to the sum of the two.
//!
//! Whether anything is touched hangs on noise, too: of a total of which no taxel reads three times its threshold that of a contact
//! on the modules that have most of it, `sqrt(2 sum (w s)^2)`, is uncertain, 2 being what taxels of a module share.

mod hidden;

use std::ops::Range;

pub use self::hidden::Zeros;

use self::hidden::{CONTACT_MODULES, hidden};
use crate::counts::Counts;
use crate::force::sample::Undetected;
use crate::force::source::Light;
use crate::force::tables::Tables;

/// The taxels of a patch at one zero and one selection, of which those are looked at that are in no total.
#[derive(Clone, Debug, Default)]
pub struct Untouched {
    /// Force per raw count of every taxel, N, for the walk over all.
    newton_per_count: Vec<f32>,
    /// By taxel; of one that is not selected nothing.
    taxels: Vec<Light>,
    /// Force of all zeros: what the walk over raw counts has too much.
    zeros_n: f64,
    /// Sum of the squared noises, N squared.
    noise_n2: f64,
    /// Squared noise of a contact on the modules that have most of it, N squared.
    contact_noise_n2: f64,
    /// Sum of the forces per count, N.
    per_count_n: f64,
    /// What the zero may hide.
    hidden: Undetected,
    /// Standard uncertainty that all forces share, relative to them.
    relative_sigma: f64,
    /// How many taxels are selected.
    selected: usize,
}

/// So many taxels that are in no total tell how far all of them lie from their zero.
const FAR_TAXELS_MIN: usize = 20;

/// Taxels of a module share some of their noise: on real skin a sum of ten has so many times the variance of independent ones.
pub(super) const SHARED_NOISE: f64 = 2.0;

/// A touch of which a taxel reads so many times its threshold is no noise.
const SURE_OF_TOUCH: f64 = 3.0;

/// What presses below the thresholds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Below {
    /// Standard uncertainty because a touch may be noise, N.
    pub choice_n: f64,
    /// The force that may press in addition without activating a taxel.
    pub undetected: Undetected,
    /// How far the taxels lie from their zero that no contact is near, counts; 0 where they are too few to tell.
    pub off_counts: f64,
}

impl Untouched {
    /// For the taxels that are `selected`; all slices by taxel. `relative_sigma` is the standard
    /// uncertainty that all forces share, relative to them.
    pub fn new(
        tables: &Tables,
        zeros: Zeros<'_>,
        selected: &[bool],
        modules: &[Range<usize>],
        relative_sigma: f64,
    ) -> Self {
        let light = |taxel: usize| if selected[taxel] { *tables.light(taxel) } else { Light::default() };
        let taxels: Vec<Light> = (0..selected.len()).map(light).collect();
        let sum = |of: &dyn Fn(&Light) -> f64| taxels.iter().map(of).sum::<f64>();
        let of_module = |range: &Range<usize>| taxels[range.clone()].iter().map(|light| light.noise_n().powi(2)).sum();
        let mut noise_n2: Vec<f64> = modules.iter().map(of_module).collect();
        noise_n2.sort_by(|a, b| b.total_cmp(a));
        Self {
            newton_per_count: taxels.iter().map(|light| (light.sign * light.newton_per_count) as f32).collect(),
            zeros_n: sum(&|light| light.sign * light.newton_per_count * light.zero),
            hidden: hidden(tables, &taxels, zeros, modules),
            noise_n2: sum(&|light| light.noise_n().powi(2)),
            contact_noise_n2: noise_n2.iter().take(CONTACT_MODULES).sum(),
            per_count_n: sum(&|light| light.newton_per_count),
            relative_sigma,
            selected: taxels.iter().filter(|light| light.newton_per_count > 0.0).count(),
            taxels,
        }
    }

    /// The force of all raw counts, N.
    fn walk_n(&self, counts: Counts<'_>) -> f64 {
        dot(&self.newton_per_count, counts.all()) / counts.range().per_unit()
    }

    /// What may press beside the taxels that are `summed` in a total, where the zero hides a load of `hides_n` on the whole skin,
    /// and its uncertainty weighs `zero_n`, N.
    pub fn below<'a>(
        &self,
        counts: impl Into<Counts<'a>>,
        summed: impl Iterator<Item = usize>,
        [hides_n, zero_n]: [f64; 2],
    ) -> Below {
        let counts = counts.into();
        let (mut rest_n, mut noise_n2, mut per_count_n) =
            (self.walk_n(counts) - self.zeros_n, self.noise_n2, self.per_count_n);
        let (mut untouched, mut strongest) = (self.selected, 0.0_f64);
        for taxel in summed {
            let (Some(light), Some(count)) = (self.taxels.get(taxel), counts.units(taxel)) else { continue };
            let pressed = light.pressed(count);
            rest_n -= light.newton_per_count * pressed;
            strongest = strongest.max(pressed / light.threshold_counts);
            noise_n2 -= light.noise_n().powi(2);
            per_count_n -= light.newton_per_count;
            untouched -= usize::from(light.newton_per_count > 0.0);
        }
        // Of none nothing but rounding is left of these sums.
        let tell = untouched >= FAR_TAXELS_MIN && per_count_n > 0.0;
        let off_counts = if tell { rest_n / per_count_n } else { 0.0 };
        let newton = rest_n.max(0.0) + hides_n + self.hidden.newton;
        let shared_n = self.relative_sigma * newton;
        let sigma_n2 =
            SHARED_NOISE * noise_n2.max(0.0) + zero_n.powi(2) + self.hidden.sigma_n.powi(2) + shared_n.powi(2);
        let choice_n = (SHARED_NOISE * self.contact_noise_n2).sqrt() * (SURE_OF_TOUCH - strongest).clamp(0.0, 1.0);
        let undetected = Undetected { newton, sigma_n: sigma_n2.sqrt() };
        Below { choice_n, undetected, off_counts }
    }
}

/// Sum of the products, in a fixed order, sixteen chains at a time.
fn dot(weights: &[f32], counts: &[u16]) -> f64 {
    const LANES: usize = 16;
    let mut lanes = [0.0_f32; LANES];
    let (weights, weights_rest) = weights.as_chunks::<LANES>();
    let (counts, counts_rest) = counts.as_chunks::<LANES>();
    for (weights, counts) in weights.iter().zip(counts) {
        for i in 0..LANES {
            lanes[i] += weights[i] * f32::from(counts[i]);
        }
    }
    let product = |(&weight, &count): (&f32, &u16)| f64::from(weight) * f64::from(count);
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
    fn taxels(counts: std::ops::RangeInclusive<u16>) -> impl Strategy<Value = Vec<(u16, bool, bool)>> {
        proptest::collection::vec((counts, prop::bool::weighted(0.9), prop::bool::weighted(0.2)), TAXELS)
    }

    fn below(tables: &Tables, taxels: &[(u16, bool, bool)], zero_n: f64) -> Below {
        below_of(tables, taxels, zero_n, 0.0)
    }

    fn below_of(tables: &Tables, taxels: &[(u16, bool, bool)], zero_n: f64, relative_sigma: f64) -> Below {
        let counts: Vec<u16> = taxels.iter().map(|t| t.0).collect();
        let selected: Vec<bool> = taxels.iter().map(|t| t.1).collect();
        let active = (0..TAXELS).filter(|&t| taxels[t].1 && taxels[t].2);
        let zero = rest(TAXELS);
        let zeros = Zeros { taken: &zero, confirmed: &[] };
        let untouched = Untouched::new(tables, zeros, &selected, &MODULES, relative_sigma);
        untouched.below(&counts, active, [0.0, zero_n])
    }

    proptest! {
        #[test]
        fn it_is_what_a_plain_loop_over_the_taxels_gives(
            taxels in prop_oneof![taxels(0..=255), taxels(REST - 6..=REST + 2), taxels(REST - 2..=REST + 6)],
            zero_n in 0.0..0.5_f64,
            relative_sigma in 0.0..0.2_f64,
        ) {
            let tables = tables();
            let (mut pressed_n, mut noise, mut per_count, mut strongest) = (0.0, 0.0, 0.0, 0.0_f64);
            let mut of_modules = [0.0; 4];
            for (taxel, &(count, selected, active)) in taxels.iter().enumerate() {
                let distance = ACTIVATION.distance_counts(0.5);
                let newton_per_count = tables.light(taxel).newton_per_count;
                if selected {
                    of_modules[taxel / 10] += (newton_per_count * 0.5).powi(2);
                }
                if selected && active {
                    strongest = strongest.max((f64::from(REST) - f64::from(count)) / distance);
                }
                if selected && !active {
                    pressed_n += newton_per_count * (f64::from(REST) - f64::from(count));
                    noise += (newton_per_count * 0.5).powi(2);
                    per_count += newton_per_count;
                }
            }
            let found = below_of(&tables, &taxels, zero_n, relative_sigma);
            of_modules.sort_by(f64::total_cmp);
            let choice = (SHARED_NOISE * of_modules[1..].iter().sum::<f64>()).sqrt() * (SURE_OF_TOUCH - strongest).clamp(0.0, 1.0);
            prop_assert!((found.choice_n - choice).abs() < 1e-4 * (1.0 + choice), "{found:?} {choice}");
            let offset = if per_count > 0.0 { pressed_n / per_count } else { 0.0 };
            // The walk is one of single precision over raw counts: 37 products of up to 255 counts that weigh 0.1 N each.
            let slack = 1e-3;
            let untouched = taxels.iter().filter(|&&(_, selected, active)| selected && !active).count();
            let off = if untouched < FAR_TAXELS_MIN { 0.0 } else { offset };
            prop_assert!((found.off_counts - off).abs() * per_count < slack, "{found:?} {off}");
            let pressing = pressed_n.max(0.0);
            let sigma = (SHARED_NOISE * noise + zero_n * zero_n).sqrt().hypot(relative_sigma * pressing);
            let is_near = |is: f64, expected: f64| (is - expected).abs() < 2.0 * slack;
            prop_assert!(is_near(found.undetected.newton, pressing) && is_near(found.undetected.sigma_n, sigma), "{found:?} {pressing} {sigma}");
        }

        /// Whatever lies on taxels below their thresholds, as their own curves tell it, is less than the floor.
        #[test]
        fn the_floor_holds_what_presses_below_the_thresholds(taxels in taxels(REST - 2..=REST), zero_n in 0.0..0.5_f64) {
            let tables = tables();
            let newton = |(taxel, &(count, selected, active)): (usize, &(u16, bool, bool))| {
                let kpa = tables.reading(taxel, count, 0.0).map_or(0.0, |reading| f64::from(reading.pressure_kpa));
                if selected && !active { kpa * AREA.0 * 1e-3 } else { 0.0 }
            };
            let pressing: f64 = taxels.iter().enumerate().map(newton).sum();
            let found = below(&tables, &taxels, zero_n);
            prop_assert!(found.undetected.newton + 2.0 * found.undetected.sigma_n >= pressing - 1e-4, "{found:?} {pressing}");
        }
    }

    /// All taxels rest a count nearer to load than the models' zero.
    #[test]
    fn what_all_forces_have_in_common_is_uncertain_of_what_the_zero_hides_too() {
        let mut zero = rest(TAXELS);
        zero.iter_mut().for_each(|taxel| taxel.mean -= 1.0);
        let found = |relative_sigma: f64| {
            let zeros = Zeros { taken: &zero, confirmed: &[] };
            let untouched = Untouched::new(&tables(), zeros, &[true; TAXELS], &MODULES, relative_sigma);
            untouched.below(&[REST - 1; TAXELS], std::iter::empty(), [0.0; 2]).undetected
        };
        let (alone, shared) = (found(0.0), found(0.2));
        assert!(alone.newton > 1.0 && shared.newton == alone.newton, "{alone:?}");
        assert!((shared.sigma_n - alone.sigma_n.hypot(0.2 * alone.newton)).abs() < 1e-6, "{shared:?}");
    }

    #[test]
    fn a_taxel_whose_zero_is_not_known_leaves_no_room_and_makes_no_number_that_is_none() {
        let mut unknown = rest(TAXELS);
        unknown[3] = TaxelBaseline::UNKNOWN;
        unknown[4].noise = f64::NAN;
        unknown[5].mean = f64::NAN;
        let tables = Tables::new(set(TAXELS), &unknown, &[AREA; TAXELS], ACTIVATION);
        let below = |selected: &[bool; TAXELS]| {
            let zeros = Zeros { taken: &unknown, confirmed: &[] };
            let untouched = Untouched::new(&tables, zeros, selected, &MODULES, 0.1);
            untouched.below(&[REST - 1; TAXELS], std::iter::once(4), [0.0, 0.1])
        };
        let found = below(&[true; TAXELS]);
        assert!(found.undetected.newton > 0.1 && found.choice_n > 0.0, "{found:?}");
        assert_eq!(found, below(&std::array::from_fn(|taxel| taxel != 3 && taxel != 5)), "those do not count");
    }
}
