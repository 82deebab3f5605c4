//! From a count to a pressure and a force, for one model set at one zero.
//!
//! Everything that depends on one taxel's count alone (curve, range, activation threshold, area) is tabulated by whole units when the
//! zero or the model set changes. Pressures of a finer converter lie between two entries on a line; for all else the nearest does.

use std::sync::Arc;
use taxel_model::Sign;
use taxel_skin::{CountRange, SquareMillimetre};

use crate::baseline::{Activation, TaxelBaseline};
use crate::force::dead_zone::DeadZone;
use crate::force::sample::RangeFlag;
use crate::force::source::{ENTRIES, ForceTable, Light, Share, Source, TaxelTable};
use crate::model_set::ModelSet;

/// What a taxel's count means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaxelReading {
    /// Pressure; beyond the calibrated range by the curve's extension (see [`taxel_model::SkinSlope`]).
    pub pressure_kpa: f32,
    /// Its standard uncertainty.
    pub sigma_kpa: f32,
    /// What of that uncertainty all taxels have in common, so that it does not average out over a contact.
    pub shared_kpa: f32,
    /// How much the pressure changes with the count here, not negative.
    pub kpa_per_count: f32,
    /// Whether it is beyond the calibrated range.
    pub range: RangeFlag,
    /// Whether the count is beyond the activation threshold.
    pub active: bool,
}

/// The tables of a patch, all by taxel; immutable, so that snapshots can share them.
#[derive(Debug)]
pub struct Tables {
    set: Arc<ModelSet>,
    id: Arc<str>,
    /// `None` without a usable model.
    taxels: Vec<Option<Box<TaxelTable>>>,
    /// Force in newton, whether or not the count is a touch; nothing without a usable model.
    force_n: Vec<ForceTable>,
    /// Polarity mask: all ones where counts fall with pressure. A raw count exclusive or its mask grows with pressure.
    polarity: Vec<u16>,
    /// The greatest raw count in that polarity that is no touch; [`NEVER`] without a usable model.
    threshold: Vec<u16>,
    counts: CountRange,
    units_per_count: f32,
    newton_per_kpa: Vec<f32>,
    light: Vec<Light>,
    residue_counts: f64,
    /// What of that touched taxels are read at more.
    stays_counts: f64,
}

/// A threshold that no count is beyond.
pub(crate) const NEVER: u16 = u16::MAX;

/// A number between two entries of a table.
fn between(table: &[f32], (entry, part): (usize, f32)) -> f32 {
    let value = table[entry];
    if part > 0.0 { value + part * (table[entry + 1] - value) } else { value }
}

impl Tables {
    /// Tables for `set` at the zero `rest`. Taxels without a usable model get none.
    ///
    /// All slices have one entry per taxel of the patch.
    pub fn new(set: Arc<ModelSet>, rest: &[TaxelBaseline], areas: &[SquareMillimetre], activation: Activation) -> Self {
        Self::of_range(CountRange::BYTE, set, rest, areas, activation, 0.0)
    }

    /// The same for counts of another range, at a zero that lies `residue_counts` (not negative) towards load from that of the
    /// models.
    ///
    /// A skin that was pressed returns not quite to its rest, and a zero that is taken then takes what remains for nothing.
    /// The next load finds of that what the skin's dead zone explains (`dead_zone.rs`), and reads as much too little; the
    /// rest creeps back. So touched taxels are read at that much more.
    pub fn of_range(
        counts: CountRange,
        set: Arc<ModelSet>,
        rest: &[TaxelBaseline],
        areas: &[SquareMillimetre],
        activation: Activation,
        residue_counts: f64,
    ) -> Self {
        let taxels = set.taxels.len();
        let dead_zone = DeadZone::of(&set, activation, residue_counts);
        let mut tables = Self {
            id: Arc::from(set.id.as_str()),
            taxels: vec![None; taxels],
            force_n: vec![[0.0; _]; taxels],
            polarity: vec![0; taxels],
            threshold: vec![NEVER; taxels],
            counts,
            units_per_count: (1.0 / counts.per_unit()) as f32,
            residue_counts,
            stays_counts: dead_zone.stays_counts,
            light: vec![Light::default(); taxels],
            newton_per_kpa: areas.iter().map(|area| (area.0 * 1e-3) as f32).collect(), // 1 kPa on 1 mm2 is 1e-3 N
            set,
        };
        let of_set = tables.set.extensions().into_iter().zip(tables.set.curve_sigmas_kpa());
        for (taxel, (extension, curve_sigma_kpa)) in of_set.enumerate() {
            let then = tables.set.baseline.get(taxel);
            if let (Some(now), Some(then), Some(area)) = (rest.get(taxel), then, areas.get(taxel))
                // A zero or a reference that was never measured proves nothing about the taxel.
                && (tables.set.taxels[taxel].is_usable() && now.mean.is_finite() && then.mean.is_finite())
            {
                let source = Source::new(&tables.set, taxel, extension, curve_sigma_kpa, (*now, *then), dead_zone);
                let (table, force_n) = source.tabulate(*area, counts);
                tables.light[taxel] = source.light(&table, *area, activation);
                tables.polarity[taxel] = if source.sign == Sign::Falling { u16::MAX } else { 0 };
                tables.threshold[taxel] = source.threshold(activation, counts);
                tables.force_n[taxel] = force_n;
                tables.taxels[taxel] = Some(Box::new(table));
            }
        }
        tables
    }

    /// Where a raw count lies in a table: the whole unit below it, and what part of a unit is left.
    fn entry(&self, count: u16) -> (usize, f32) {
        if self.counts.is_byte() {
            return (usize::from(count).min(ENTRIES - 2), 0.0);
        }
        let units = f32::from(count) * self.units_per_count;
        let entry = (units as usize).min(ENTRIES - 2);
        (entry, (units - entry as f32).min(1.0))
    }

    /// The whole unit nearest to a raw count.
    fn nearest(&self, count: u16) -> usize {
        let (entry, part) = self.entry(count);
        entry + usize::from(part >= 0.5)
    }

    /// How far touched taxels lie from where they are read, counts, where untouched ones lie `off_counts`, 0 or less, from their zero.
    /// What these have lost of the residue has gone.
    pub(crate) fn offset_of_touched(&self, off_counts: f64) -> f64 {
        let left = (self.residue_counts + off_counts).max(0.0);
        off_counts + (self.stays_counts - left).max(0.0)
    }

    /// The model set.
    pub const fn set(&self) -> &Arc<ModelSet> {
        &self.set
    }

    /// The model set's id.
    pub const fn id(&self) -> &Arc<str> {
        &self.id
    }

    /// How many taxels there are.
    pub fn taxels(&self) -> usize {
        self.taxels.len()
    }

    /// Whether a taxel has a usable model and a zero.
    pub fn has(&self, taxel: usize) -> bool {
        self.taxels.get(taxel).is_some_and(Option::is_some)
    }

    /// What `count` means for `taxel`, to whose pressure its history adds `offset_kpa`; `None` without a usable model.
    pub fn reading(&self, taxel: usize, count: impl Into<u16>, offset_kpa: f32) -> Option<TaxelReading> {
        let (table, count) = (self.taxels.get(taxel)?.as_ref()?, count.into());
        let nearest = self.nearest(count);
        let share = &table.shares[nearest];
        Some(TaxelReading {
            // Hysteresis takes no touch below nothing.
            pressure_kpa: (between(&table.pressure_kpa, self.entry(count)) + offset_kpa).max(0.0),
            kpa_per_count: share.per_count_n / self.newton_per_kpa[taxel],
            sigma_kpa: table.sigma_kpa[nearest],
            shared_kpa: share.shared_n() / self.newton_per_kpa[taxel],
            range: table.range[nearest],
            active: count ^ self.polarity[taxel] > self.threshold[taxel] && self.newton(taxel, count) > 0.0,
        })
    }

    /// Force in newton of a taxel, whether or not its count is a touch; nothing without a usable model.
    #[inline]
    pub(crate) fn newton(&self, taxel: usize, count: u16) -> f32 {
        between(&self.force_n[taxel], self.entry(count))
    }

    /// Force in newton of a taxel beside an activated one, where a weaker touch counts.
    #[inline]
    pub(crate) fn low_n(&self, taxel: usize, count: u16) -> f32 {
        let light = &self.light[taxel];
        let is_touched = light.pressed(self.counts.units(count)) > light.touched_counts;
        if is_touched { self.newton(taxel, count) } else { 0.0 }
    }

    /// What `count` of a taxel contributes to the uncertainty of a force; `None` without a usable model.
    #[inline]
    pub(crate) fn share(&self, taxel: usize, count: u16) -> Option<&Share> {
        Some(&self.taxels.get(taxel)?.as_ref()?.shares[self.nearest(count)])
    }

    /// What a count weighs where it is no touch; nothing without a usable model.
    pub(crate) fn light(&self, taxel: usize) -> &Light {
        &self.light[taxel]
    }

    /// What a raw count is combined with so that it grows with pressure, one per taxel.
    pub(crate) fn polarity(&self) -> &[u16] {
        &self.polarity
    }

    pub(crate) fn threshold(&self, taxel: usize) -> u16 {
        self.threshold[taxel]
    }

    /// Force in newton that may press on a taxel up to `distance` counts from its zero: the most that its curve says on
    /// the way, for the paper's may turn there, or the curve's own uncertainty at that distance where that is more, as
    /// where it is flat. `None` without a usable model.
    pub(crate) fn threshold_n(&self, taxel: usize, distance: f64) -> Option<f64> {
        let (table, light) = (self.taxels.get(taxel)?.as_ref()?, &self.light[taxel]);
        let unit = |distance: f64| (light.zero + light.sign * distance).round().clamp(0.0, 255.0) as usize;
        let (zero, end) = (unit(0.0), unit(distance));
        let on_the_way = &table.pressure_kpa[zero.min(end)..=zero.max(end)];
        let kpa = on_the_way.iter().copied().fold(table.sigma_kpa[end].max(0.0), f32::max);
        Some(f64::from(kpa) * f64::from(self.newton_per_kpa[taxel]))
    }

    pub(crate) fn newton_per_kpa(&self, taxel: usize) -> f32 {
        self.newton_per_kpa[taxel]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::force::light_end::tests::begun_late;
    use crate::force::tests::{ACTIVATION, AREA, REST, rest, set};
    use proptest::prelude::*;

    #[test]
    fn how_skin_bends_below_the_least_calibrated_pressure_is_common_to_a_contact() {
        let mut late = ModelSet::clone(&set(1));
        late.taxels[0] = begun_late();
        let tables = Tables::new(Arc::new(late), &rest(1), &[AREA], ACTIVATION);
        let shared_kpa = |kpa: u16| tables.reading(0, REST - kpa, 0.0).unwrap().shared_kpa;
        assert!((2.0..3.0).contains(&shared_kpa(5)), "a quarter of 10 kPa: {}", shared_kpa(5));
        assert!(shared_kpa(0) < 0.1 && shared_kpa(2) < shared_kpa(5), "{} {}", shared_kpa(0), shared_kpa(2));
        assert_eq!(shared_kpa(30), 0.0, "the curve has it");
    }

    /// The same skin with a converter of sixteen bits: what a whole unit means does not depend on how it is divided.
    #[test]
    fn a_finer_converter_reads_what_the_table_of_bytes_says() {
        for top in [1_023, 4_095, 65_535] {
            let range = CountRange::to(top).unwrap();
            let bytes = Tables::new(set(1), &rest(1), &[AREA], ACTIVATION);
            let wide = Tables::of_range(range, set(1), &rest(1), &[AREA], ACTIVATION, 0.0);
            for count in 0..=255_u16 {
                let fine = range.nearest(f64::from(count));
                let (a, b) = (bytes.reading(0, count, 0.5).unwrap(), wide.reading(0, fine, 0.5).unwrap());
                assert_eq!(
                    (a.pressure_kpa, a.active, a.shared_kpa),
                    (b.pressure_kpa, b.active, b.shared_kpa),
                    "{count}"
                );
                assert!(b.sigma_kpa <= a.sigma_kpa, "rounding is finer: {a:?} {b:?}");
                let inner = (1..255).contains(&count);
                assert!(!inner || (a.kpa_per_count - b.kpa_per_count).abs() < 1e-4, "{count}: {a:?} {b:?}");
                assert_eq!(bytes.low_n(0, count), wide.low_n(0, fine), "{count}");
            }
            let distance = ACTIVATION.distance_counts(0.5);
            let (a, b) = (bytes.threshold_n(0, distance).unwrap(), wide.threshold_n(0, distance).unwrap());
            assert!((a - b).abs() < 0.02 * a, "{a} {b}");
        }
    }

    proptest! {
        #[test]
        fn no_count_of_any_width_is_read_as_a_number_that_is_none(top in 1..=u16::MAX, count: u16, offset in -1e3..1e3_f32) {
            let range = CountRange::to(top).unwrap();
            let tables = Tables::of_range(range, set(1), &rest(1), &[AREA], ACTIVATION, 0.3);
            let (reading, share) = (tables.reading(0, count, offset).unwrap(), tables.share(0, count).unwrap());
            prop_assert!(reading.pressure_kpa >= 0.0 && reading.pressure_kpa.is_finite(), "{reading:?}");
            prop_assert!(reading.sigma_kpa.is_finite() && reading.kpa_per_count.is_finite(), "{reading:?}");
            prop_assert!(tables.low_n(0, count).is_finite());
            prop_assert!(share.own_n2 >= 0.0 && share.per_count_n >= 0.0, "{share:?}");
        }
    }
}
