//! From a count to a pressure and a force: tables for one model set at one zero.
//!
//! Counts have eight bits, so everything that depends on one taxel's count alone (curve, range, activation threshold,
//! area) is baked into a table of 256 entries when the zero or the model set changes.

use std::sync::Arc;
use taxel_model::{Beyond, Extension, Plays, RangeState, Sign, TaxelModel};
use taxel_skin::SquareMillimetre;

use crate::baseline::{Activation, NOISE_FLOOR_COUNTS, TaxelBaseline};
use crate::force::sample::RangeFlag;
use crate::model_set::{ModelSet, RecordedTaxel};

/// A reading so close to the end of the calibrated range, in multiples of the noise, counts as beyond it.
const RANGE_MARGIN_SIGMAS: f64 = 2.0;

/// Least uncertainty of what a curve's extension adds, as a share of it. Live, a count beyond the range may also come from
/// a zero that is wrong or a fault that is not seen yet: two standard deviations reach back to the range's end, which is
/// all that the calibration vouches for.
const UNVOUCHED_SHARE: f64 = 0.5;

/// Entries from one force table to the next. Taxels at rest all read about the same count; if their tables lay a power
/// of two apart, all those entries would compete for the same few sets of the cache (5,000 taxels: 7 us instead of 4).
const FORCE_STRIDE: usize = 256 + 16;

/// Force by raw count; the entries beyond 255 are never read.
pub(crate) type ForceTable = [f32; FORCE_STRIDE];

/// Beside an activated taxel this share of the threshold suffices: the low one of two thresholds.
const LOW_SHARE: f64 = 0.375;

/// What of a residue touched taxels are read at more: on skins with a play all of it would be right, on skins that creep
/// nothing. Half of it reads the former more too little than the latter too much.
const RESIDUE_SHARE: f64 = 0.6;
/// Standard deviation, about this share, of a share that may as well be anything from 0 to 1.
const RESIDUE_SIGMA: f64 = 0.31;

/// One taxel's tables, indexed by raw count.
#[derive(Clone, Debug)]
struct TaxelTable {
    pressure_kpa: [f32; 256],
    sigma_kpa: [f32; 256],
    range: [RangeFlag; 256],
    shares: [Share; 256],
    /// What of `sigma_kpa` all taxels have in common.
    shared_kpa: f32,
    /// The count at the present zero.
    zero: f64,
}

/// What a taxel's count contributes to a force and to its uncertainty, side by side, so that one access to the memory
/// has it all.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Share {
    /// Force in newton with the low threshold that holds beside an activated taxel.
    pub(crate) low_n: f32,
    /// Variance of the force that this taxel does not share with the others, N squared.
    pub(crate) own_n2: f32,
    /// How much the force changes with the count here, N per count, not negative.
    pub(crate) per_count_n: f32,
    /// 1 where the count is beyond the calibrated range, on the side of pressure, and 0 elsewhere.
    pub(crate) above: f32,
}

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
    /// Force in newton by count; zero below the activation threshold and without a usable model.
    force_n: Vec<ForceTable>,
    /// Polarity mask: 255 where counts fall with pressure. A count exclusive or its mask grows with pressure.
    polarity: Vec<u8>,
    /// Threshold code: the greatest count in that polarity that is no touch; 255 where nothing is.
    threshold: Vec<u8>,
    newton_per_kpa: Vec<f32>,
    hysteresis_n: Vec<f32>,
    residue_counts: f64,
}

impl Tables {
    /// Tables for `set` at the zero `rest`. Taxels without a usable model get none.
    ///
    /// All slices have one entry per taxel of the patch.
    #[must_use]
    pub fn new(set: Arc<ModelSet>, rest: &[TaxelBaseline], areas: &[SquareMillimetre], activation: Activation) -> Self {
        Self::with_residue(set, rest, areas, activation, 0.0)
    }

    /// The same at a zero that lies `residue_counts` (not negative) towards load from that of the models.
    ///
    /// A skin that was pressed returns not quite to its rest, and a zero that is taken then takes what remains for nothing.
    /// Whether the next load finds that remainder again (as with play: it reads as much too little) or it has gone
    /// (creep), counts do not tell. So touched taxels are read at a share of it more, and which share is right is uncertain.
    /// Where hysteresis is compensated it is known, and nothing is added.
    #[must_use]
    pub fn with_residue(
        set: Arc<ModelSet>,
        rest: &[TaxelBaseline],
        areas: &[SquareMillimetre],
        activation: Activation,
        residue_counts: f64,
    ) -> Self {
        let residue_counts = if set.recorded.is_none() { residue_counts } else { 0.0 };
        let taxels = set.taxels.len();
        let mut tables = Self {
            id: Arc::from(set.id.as_str()),
            taxels: vec![None; taxels],
            force_n: vec![[0.0; FORCE_STRIDE]; taxels],
            polarity: vec![0; taxels],
            threshold: vec![u8::MAX; taxels],
            hysteresis_n: vec![0.0; taxels],
            residue_counts,
            newton_per_kpa: areas.iter().map(|area| (area.0 * 1e-3) as f32).collect(), // 1 kPa on 1 mm2 is 1e-3 N
            set,
        };
        let extensions = tables.set.extensions();
        for (taxel, extension) in extensions.into_iter().enumerate() {
            let then = tables.set.baseline.get(taxel);
            if let (Some(now), Some(then), Some(area)) = (rest.get(taxel), then, areas.get(taxel))
                // A zero or a reference that was never measured proves nothing about the taxel.
                && (tables.set.taxels[taxel].is_usable() && now.mean.is_finite() && then.mean.is_finite())
            {
                let more_counts = RESIDUE_SHARE * residue_counts;
                let source = Source::new(&tables.set, taxel, extension, (*now, *then), more_counts);
                let (table, force_n) = source.tabulate(*area, activation);
                tables.polarity[taxel] = if source.sign == Sign::Falling { u8::MAX } else { 0 };
                tables.threshold[taxel] = source.threshold(activation);
                tables.hysteresis_n[taxel] = table.shared_kpa * tables.newton_per_kpa[taxel];
                tables.taxels[taxel] = Some(Box::new(table));
                tables.force_n[taxel] = force_n;
            }
        }
        tables
    }

    /// Standard uncertainty of the zero under touched taxels because the skin remembers earlier loads, counts.
    pub(crate) fn residue_sigma_counts(&self) -> f64 {
        RESIDUE_SIGMA * self.residue_counts
    }

    /// The model set.
    #[must_use]
    pub const fn set(&self) -> &Arc<ModelSet> {
        &self.set
    }

    /// The model set's id.
    #[must_use]
    pub const fn id(&self) -> &Arc<str> {
        &self.id
    }

    /// How many taxels there are.
    #[must_use]
    pub fn taxels(&self) -> usize {
        self.taxels.len()
    }

    /// Whether a taxel has a usable model and a zero.
    #[must_use]
    pub fn has(&self, taxel: usize) -> bool {
        self.taxels.get(taxel).is_some_and(Option::is_some)
    }

    /// What `count` means for `taxel`, to whose pressure its history adds `offset_kpa`; `None` without a usable model.
    #[must_use]
    pub fn reading(&self, taxel: usize, count: u8, offset_kpa: f32) -> Option<TaxelReading> {
        let (table, code) = (self.taxels.get(taxel)?.as_ref()?, usize::from(count));
        Some(TaxelReading {
            // Hysteresis takes no touch below nothing.
            pressure_kpa: (table.pressure_kpa[code] + offset_kpa).max(0.0),
            kpa_per_count: kpa_per_count(&table.pressure_kpa, count),
            sigma_kpa: table.sigma_kpa[code],
            shared_kpa: table.shared_kpa,
            range: table.range[code],
            active: self.force_n[taxel][code] > 0.0,
        })
    }

    /// Force in newton of a taxel beside an activated one, where a weaker touch counts.
    pub(crate) fn low_n(&self, taxel: usize, count: u8) -> Option<f32> {
        Some(self.share(taxel, count)?.low_n)
    }

    /// What `count` of a taxel contributes; `None` without a usable model.
    pub(crate) fn share(&self, taxel: usize, count: u8) -> Option<&Share> {
        Some(&self.taxels.get(taxel)?.as_ref()?.shares[usize::from(count)])
    }

    /// Hysteresis that is not compensated, as a force that all taxels have in common, N; 0 without a usable model.
    pub(crate) fn hysteresis_n(&self, taxel: usize) -> f32 {
        self.hysteresis_n[taxel]
    }

    pub(crate) fn force_n(&self) -> &[ForceTable] {
        &self.force_n
    }

    pub(crate) fn polarity(&self) -> &[u8] {
        &self.polarity
    }

    pub(crate) fn threshold(&self, taxel: usize) -> u8 {
        self.threshold[taxel]
    }

    /// +1 where the count of a taxel rises with pressure, -1 where it falls.
    pub(crate) fn sign(&self, taxel: usize) -> f64 {
        if self.polarity[taxel] == 0 { 1.0 } else { -1.0 }
    }

    /// Force in newton that may press on a taxel up to `distance` counts from its zero: the most that its curve says on
    /// the way, for the paper's may turn there, or the curve's own uncertainty at that distance where that is more, as
    /// where it is flat. `None` without a usable model.
    pub(crate) fn threshold_n(&self, taxel: usize, distance: f64) -> Option<f64> {
        let table = self.taxels.get(taxel)?.as_ref()?;
        let code = |distance: f64| (table.zero + self.sign(taxel) * distance).round().clamp(0.0, 255.0) as usize;
        let (zero, end) = (code(0.0), code(distance));
        let on_the_way = &table.pressure_kpa[zero.min(end)..=zero.max(end)];
        let kpa = on_the_way.iter().copied().fold(table.sigma_kpa[end].max(0.0), f32::max);
        Some(f64::from(kpa) * f64::from(self.newton_per_kpa[taxel]))
    }

    pub(crate) fn newton_per_kpa(&self, taxel: usize) -> f32 {
        self.newton_per_kpa[taxel]
    }
}

/// All that one taxel's tables are made from.
struct Source<'a> {
    model: &'a TaxelModel,
    /// Where hysteresis is compensated the mid curve is served; the play operators add their offset scan by scan.
    plays: Option<&'a Plays>,
    in_use: Option<&'a RecordedTaxel>,
    /// How the curve goes on beyond its range.
    extension: Option<Extension>,
    set: &'a ModelSet,
    now: TaxelBaseline,
    /// What is added to a raw count to get the count that the models refer to.
    shift: f64,
    sign: Sign,
}

impl<'a> Source<'a> {
    /// `zeros` are the present one and that of the models.
    fn new(
        set: &'a ModelSet,
        taxel: usize,
        extension: Option<Extension>,
        zeros: (TaxelBaseline, TaxelBaseline),
        more_counts: f64,
    ) -> Self {
        let (model, plays, (now, then)) = (&set.taxels[taxel], set.plays(taxel), zeros);
        let sign = plays.map_or(model.sign, |plays| plays.sign);
        let shift = then.mean - now.mean + sign.as_f64() * more_counts;
        Self { model, plays, in_use: set.in_use(taxel), extension, set, now, shift, sign }
    }

    /// Tables for what is looked up now and then, and the force that every scan needs.
    fn tabulate(&self, area: SquareMillimetre, activation: Activation) -> (TaxelTable, ForceTable) {
        let mut table = self.model.tabulate(self.shift);
        // Noise must not decide whether a reading near the end of the range says that it is beyond.
        let margin = RANGE_MARGIN_SIGMAS * self.now.noise.max(NOISE_FLOOR_COUNTS);
        let nearer = |code: f64| (code + self.sign.as_f64() * margin).round().clamp(0.0, 255.0);
        let mut range = std::array::from_fn(|code| {
            let beyond = in_pressure(table.range_state(nearer(code as f64) as u8), self.sign);
            if beyond == RangeFlag::Above { beyond } else { in_pressure(table.range_state(code as u8), self.sign) }
        });
        if let Some(plays) = self.plays {
            for code in 0..=u8::MAX {
                let count = f64::from(code) + self.shift;
                table.pressure_kpa[usize::from(code)] = plays.mid_kpa(count) as f32;
                let beyond = in_pressure(plays.range_state(nearer(f64::from(code)) + self.shift), self.sign);
                let here = in_pressure(plays.range_state(count), self.sign);
                range[usize::from(code)] = if beyond == RangeFlag::Above { beyond } else { here };
            }
        }
        if let Some(sigma_kpa) = self.sigma_in_use_kpa() {
            table.sigma_kpa = [sigma_kpa as f32; 256];
        }
        for code in 0..=u8::MAX {
            let (beyond, code) = (self.beyond(code), usize::from(code));
            table.pressure_kpa[code] += beyond.kpa as f32;
            let sigma_kpa = beyond.sigma_kpa().max(UNVOUCHED_SHARE * beyond.kpa);
            table.sigma_kpa[code] = table.sigma_kpa[code].hypot(sigma_kpa as f32);
        }
        let shared_kpa = self.in_use.map_or(0.0, |in_use| in_use.shared_kpa(self.set.plays_error_ratio()));
        let beyond = |distance: f64| -> [f32; 256] {
            std::array::from_fn(|code| {
                let newton = f64::from(table.pressure_kpa[code]) * area.0 * 1e-3;
                if self.pressed(code as u8) > distance { newton.max(0.0) as f32 } else { 0.0 }
            })
        };
        let distance = activation.distance_counts(self.now.noise);
        let (low_n, newton_per_kpa) = (beyond(LOW_SHARE * distance), area.0 * 1e-3);
        let shares = std::array::from_fn(|code| {
            let own_kpa2 = (f64::from(table.sigma_kpa[code]).powi(2) - shared_kpa.powi(2)).max(0.0);
            Share {
                low_n: low_n[code],
                own_n2: (newton_per_kpa.powi(2) * own_kpa2) as f32,
                per_count_n: (newton_per_kpa * f64::from(kpa_per_count(&table.pressure_kpa, code as u8))) as f32,
                above: if range[code] == RangeFlag::Above { 1.0 } else { 0.0 },
            }
        });
        let mut force_n = [0.0; FORCE_STRIDE];
        force_n[..256].copy_from_slice(&beyond(distance));
        let (pressure_kpa, sigma_kpa) = (table.pressure_kpa, table.sigma_kpa);
        (
            TaxelTable { pressure_kpa, sigma_kpa, range, shares, shared_kpa: shared_kpa as f32, zero: self.now.mean },
            force_n,
        )
    }

    /// What a code beyond the calibrated range adds to the pressure at the range's end, and how uncertain that is.
    fn beyond(&self, code: u8) -> Beyond {
        self.extension.map_or(Beyond::default(), |extension| extension.at(f64::from(code) + self.shift))
    }

    /// Counts from rest towards pressure.
    fn pressed(&self, code: u8) -> f64 {
        self.sign.as_f64() * (f64::from(code) - self.now.mean)
    }

    /// The greatest flipped count that is no touch.
    fn threshold(&self, activation: Activation) -> u8 {
        let distance = activation.distance_counts(self.now.noise);
        let untouched = (0..=u8::MAX).filter(|&code| self.pressed(code) <= distance || self.pressed(code).is_nan());
        untouched.map(|code| if self.sign == Sign::Falling { !code } else { code }).max().unwrap_or(0)
    }

    /// The error of a reading as a recording of both branches has shown it, and what is not in there: the noise of a
    /// single count, which was averaged out when that error was taken.
    fn sigma_in_use_kpa(&self) -> Option<f64> {
        let recorded = self.set.recorded.as_ref()?;
        let noise = if recorded.smooth_s > 0.0 { self.now.noise.max(NOISE_FLOOR_COUNTS) } else { 0.0 };
        Some(self.in_use?.sigma_kpa(recorded.zero_return_counts.hypot(noise))).filter(|sigma| sigma.is_finite())
    }
}

/// How much the pressure changes with the count at `count`, not negative.
fn kpa_per_count(pressure_kpa: &[f32; 256], count: u8) -> f32 {
    let (before, after) = (count.saturating_sub(1), count.saturating_add(1));
    let rise = pressure_kpa[usize::from(after)] - pressure_kpa[usize::from(before)];
    rise.abs() / f32::from(after - before)
}

/// Beyond which end of the pressure a count lies: where counts fall with pressure, few counts are much pressure.
const fn in_pressure(counts: RangeState, sign: Sign) -> RangeFlag {
    match (counts, sign) {
        (RangeState::InRange, _) => RangeFlag::In,
        (RangeState::Below, Sign::Rising) | (RangeState::Above, Sign::Falling) => RangeFlag::Below,
        (RangeState::Above, Sign::Rising) | (RangeState::Below, Sign::Falling) => RangeFlag::Above,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::force::tests::{ACTIVATION, AREA, rest, set};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_history_makes_a_pressure_negative(count in any::<u8>(), offset_kpa in -100.0..100.0_f32) {
            let tables = Tables::new(set(1), &rest(1), &[AREA], ACTIVATION);
            let reading = tables.reading(0, count, offset_kpa).unwrap();
            prop_assert!(reading.pressure_kpa >= 0.0, "{reading:?}");
            prop_assert!(reading.sigma_kpa >= 0.0 && reading.kpa_per_count >= 0.0, "{reading:?}");
        }
    }

    #[test]
    fn beyond_the_calibrated_range_pressure_and_uncertainty_grow_and_it_is_told() {
        let tables = Tables::new(set(1), &rest(1), &[AREA], ACTIVATION);
        let readings: Vec<TaxelReading> = (0..=u8::MAX).map(|count| tables.reading(0, count, 0.0).unwrap()).collect();
        // Counts fall with pressure: the first one in range is the one of most pressure.
        let end = readings.iter().position(|reading| reading.range != RangeFlag::Above).unwrap();
        assert!(end > 20, "{end}");
        for pair in readings[..end].windows(2) {
            assert!(pair[0].pressure_kpa >= pair[1].pressure_kpa && pair[0].sigma_kpa >= pair[1].sigma_kpa, "{pair:?}");
        }
        let (last, beyond) = (readings[end], readings[end - 15]);
        assert!(
            beyond.pressure_kpa > last.pressure_kpa + 5.0 && beyond.sigma_kpa > last.sigma_kpa,
            "{beyond:?} {last:?}"
        );
    }

    #[test]
    fn what_a_count_contributes_follows_from_what_it_means() {
        let tables = Tables::new(set(1), &rest(1), &[AREA], ACTIVATION);
        for count in 0..=u8::MAX {
            let (share, reading) = (tables.share(0, count).unwrap(), tables.reading(0, count, 0.0).unwrap());
            let near = |a: f32, b: f32| (a - b).abs() <= 1e-5 * b.abs().max(1e-3);
            assert!(near(share.per_count_n, 0.1 * reading.kpa_per_count), "{count}: {share:?} {reading:?}");
            let own_kpa2 = reading.sigma_kpa.powi(2) - reading.shared_kpa.powi(2);
            assert!(near(share.own_n2, 0.01 * own_kpa2.max(0.0)), "{count}: {share:?} {reading:?}");
            assert_eq!(share.above > 0.0, reading.range == RangeFlag::Above, "{count}");
            assert!(!reading.active || near(share.low_n, 0.1 * reading.pressure_kpa), "{count}: {share:?} {reading:?}");
        }
    }
}
