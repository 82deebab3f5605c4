//! What the counts of one taxel mean at one zero, worked out for all whole units at once: it takes 16 us and 7 kB a taxel.

use taxel_model::{Beyond, Extension, Plays, Sign, TaxelModel};
use taxel_skin::{CountRange, SquareMillimetre};

use crate::baseline::{Activation, NOISE_FLOOR_COUNTS, TaxelBaseline};
use crate::force::dead_zone::DeadZone;
use crate::force::light_end::LightEnd;
use crate::force::sample::RangeFlag;
use crate::model_set::{ModelSet, RecordedTaxel};

/// A reading so close to the end of the calibrated range, in multiples of the noise, counts as beyond it.
const RANGE_MARGIN_SIGMAS: f64 = 2.0;

/// Least uncertainty of what a curve's extension adds, as a share of it. Live, a count beyond the range may also come from
/// a zero that is wrong or a fault that is not seen yet: two standard deviations reach back to the range's end, which is
/// all that the calibration has seen.
const EXTENSION_SHARE: f64 = 0.5;

/// A unit is a 256th of the range, so that one more entry is the end of the last.
pub(super) const ENTRIES: usize = 257;

/// Entries from one force table to the next. Taxels at rest all read about the same count; if their tables lay a power
/// of two apart, all those entries would compete for the same few sets of the cache (5,000 taxels: 7 us instead of 4).
const FORCE_STRIDE: usize = 256 + 16;

/// Force by whole units, N, whether or not it is a touch; the entries beyond `ENTRIES` are never read.
pub(super) type ForceTable = [f32; FORCE_STRIDE];

/// Beside an activated taxel this share of the threshold suffices: the low one of two thresholds.
const LOW_SHARE: f64 = 0.375;

/// One taxel's tables, by whole units.
#[derive(Clone, Debug)]
pub(super) struct TaxelTable {
    pub(super) pressure_kpa: [f32; ENTRIES],
    pub(super) sigma_kpa: [f32; ENTRIES],
    pub(super) range: [RangeFlag; ENTRIES],
    pub(super) shares: [Share; ENTRIES],
}

/// What a taxel's count contributes to a force and to its uncertainty, side by side, so that one access to the memory
/// has it all.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Share {
    /// Variance of the force that this taxel does not share with the others, N squared.
    pub(crate) own_n2: f32,
    /// Standard uncertainties of the force that it does share with them, N: of what the calibration leaves open,
    pub(crate) curve_n: f32,
    /// and of how stiff the skin is beyond its range.
    pub(crate) beyond_n: f32,
    /// How much the force changes with the count here, N per count, not negative.
    pub(crate) per_count_n: f32,
    /// Whether the count is beyond the calibrated range, on the side of pressure.
    pub(crate) is_above: bool,
}

impl Share {
    /// Of a taxel's standard uncertainty, kPa, and what of it others share: curve, range.
    fn of_sigmas(newton_per_kpa: f64, sigma_kpa: f64, shared_kpa: [f64; 2]) -> Self {
        let shared_kpa2: f64 = shared_kpa.iter().map(|kpa| kpa * kpa).sum();
        let [curve_n, beyond_n] = shared_kpa.map(|kpa| (newton_per_kpa * kpa) as f32);
        let own_n2 = (newton_per_kpa.powi(2) * (sigma_kpa * sigma_kpa - shared_kpa2).max(0.0)) as f32;
        Self { own_n2, curve_n, beyond_n, ..Self::default() }
    }

    /// What of its uncertainty others share, N.
    pub(super) fn shared_n(&self) -> f32 {
        self.curve_n.hypot(self.beyond_n)
    }
}

/// All that the meaning of one taxel's counts follows from.
pub(super) struct Source<'a> {
    model: &'a TaxelModel,
    /// Where hysteresis is compensated; the play operators add their offset scan by scan.
    plays: Option<&'a Plays>,
    in_use: Option<&'a RecordedTaxel>,
    set: &'a ModelSet,
    /// How the curve goes on beyond its range.
    extension: Option<Extension>,
    /// What lies between its zero and its range; `None` where hysteresis is compensated.
    light: Option<LightEnd>,
    /// What its calibration leaves open and neighbouring taxels share, kPa.
    curve_sigma_kpa: f64,
    /// The present zero.
    now: TaxelBaseline,
    /// What is added to a count to get the count that the models refer to.
    shift: f64,
    dead_zone: DeadZone,
    /// Which way pressure moves the count.
    pub(super) sign: Sign,
}

/// What the counts of a taxel weigh that is not touched: one model for those beside a touch, for what may lie on the others without
/// being seen, and for what a zero hides.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Light {
    /// The present zero, counts.
    pub(crate) zero: f64,
    /// +1 where the count rises with pressure, -1 where it falls.
    pub(crate) sign: f64,
    /// So many counts from it towards load are a touch,
    pub(crate) threshold_counts: f64,
    /// and so many beside an activated taxel.
    pub(crate) touched_counts: f64,
    /// N per count towards load below that; 0 without a usable model.
    pub(crate) newton_per_count: f64,
    /// Of a single reading.
    pub(crate) noise_counts: f64,
    /// Its dead zone: what lies on it where its count begins to move, N.
    pub(crate) dead_n: f64,
}

impl Light {
    /// How far a count lies from the zero towards load.
    pub(crate) fn pressed(&self, count: f64) -> f64 {
        self.sign * (count - self.zero)
    }

    /// Noise of a single reading, N.
    pub(crate) fn noise_n(&self) -> f64 {
        self.newton_per_count * self.noise_counts
    }
}

/// What one count means.
#[derive(Clone, Copy, Debug)]
struct Meaning {
    /// The count, in units.
    units: f64,
    sigma_kpa: f32,
    kpa_per_count: f32,
    range: RangeFlag,
}

impl<'a> Source<'a> {
    /// The zeros are the present one and that of the models; counts are read nearer to load by what stays in the dead zone.
    pub(super) fn new(
        set: &'a ModelSet,
        taxel: usize,
        extension: Option<Extension>,
        curve_sigma_kpa: f64,
        (now, then): (TaxelBaseline, TaxelBaseline),
        dead_zone: DeadZone,
    ) -> Self {
        let (model, plays) = (&set.taxels[taxel], set.plays(taxel));
        let sign = plays.map_or(model.sign, |plays| plays.sign);
        let light = plays.is_none().then(|| LightEnd::new(model, then.mean)).flatten();
        let shift = then.mean - now.mean + sign.as_f64() * dead_zone.stays_counts;
        Self {
            model,
            plays,
            in_use: set.in_use(taxel),
            set,
            extension,
            light,
            curve_sigma_kpa,
            now,
            shift,
            dead_zone,
            sign,
        }
    }

    /// What a count of so many units means in the range of counts, of which `pressure_kpa` are the pressures.
    fn meaning(&self, units: usize, counts: CountRange, pressure_kpa: &[f32; ENTRIES]) -> Meaning {
        let (before, after) = (units.saturating_sub(1), (units + 1).min(ENTRIES - 1));
        let kpa_per_count = (pressure_kpa[after] - pressure_kpa[before]).abs() / (after - before) as f32;
        let units = units as f64;
        let (count, top) = (units + self.shift, counts.units(counts.top()));
        let inside = |[low, high]: [f64; 2]| count.max(low).min(high);
        let slope = self.model.served().zip(self.model.range).map(|(curve, range)| curve.slope(inside(range)));
        let rounding_kpa = slope.map_or(0.0, |slope| slope.abs() / (12.0_f64.sqrt() * counts.per_unit()));
        let sigma_kpa = self.model.evaluate(count).map_or(f64::INFINITY, |reading| reading.sigma_kpa);
        let sigma_kpa = sigma_kpa.max(rounding_kpa).hypot(self.single_kpa());
        // Noise must not decide whether a reading near the end of the range says that it is beyond.
        let margin = RANGE_MARGIN_SIGMAS * self.now.noise.max(NOISE_FLOOR_COUNTS);
        let nearer = counts.units(counts.nearest((units + self.sign.as_f64() * margin).clamp(0.0, top)));
        let range = match self.range_at(nearer) {
            RangeFlag::Above => RangeFlag::Above,
            _ => self.range_at(units),
        };
        // Left-out readings of a skin fit show what the calibration leaves open, too.
        let curve_sigma_kpa = self.curve_sigma_kpa(units) as f32;
        let in_sigma = self.model.points.is_some();
        let sigma_kpa =
            if in_sigma { curve_sigma_kpa.max(sigma_kpa as f32) } else { curve_sigma_kpa.hypot(sigma_kpa as f32) };
        let beyond = self.beyond(units);
        let sigma_kpa = sigma_kpa.hypot(beyond.sigma_kpa().max(EXTENSION_SHARE * beyond.kpa) as f32);
        Meaning { units, sigma_kpa, kpa_per_count, range }
    }

    fn pressure_kpa(&self, units: f64) -> f32 {
        if let Some((kpa, _)) = self.light_end(units) {
            return kpa as f32;
        }
        let count = units + self.shift;
        self.model.evaluate(count).map_or(0.0, |reading| reading.kpa) as f32 + self.beyond(units).kpa as f32
    }

    fn range_at(&self, units: f64) -> RangeFlag {
        let range = self.plays.map(|plays| plays.range).or(self.model.range);
        let count = units + self.shift;
        let rises = self.sign == Sign::Rising;
        match range {
            Some([low, _]) if count < low => {
                if rises {
                    RangeFlag::Below
                } else {
                    RangeFlag::Above
                }
            }
            Some([_, high]) if count > high => {
                if rises {
                    RangeFlag::Above
                } else {
                    RangeFlag::Below
                }
            }
            Some(_) => RangeFlag::In,
            None => RangeFlag::Below,
        }
    }

    /// What the calibration leaves open at a count, kPa.
    fn curve_sigma_kpa(&self, units: f64) -> f64 {
        self.curve_sigma_kpa.hypot(self.light_end(units).map_or(0.0, |(_, sigma_kpa)| sigma_kpa))
    }

    /// What of the uncertainty beyond the calibrated range all taxels have in common, kPa: how stiff the skin is there.
    fn beyond_shared_kpa(&self, units: f64) -> f64 {
        let beyond = self.beyond(units);
        beyond.shared_kpa.max(EXTENSION_SHARE * beyond.kpa)
    }

    /// What a count contributes to the uncertainty of a force.
    fn share(&self, meaning: &Meaning, area: SquareMillimetre) -> Share {
        let newton_per_kpa = area.0 * 1e-3;
        let shared_kpa = [self.curve_sigma_kpa(meaning.units), self.beyond_shared_kpa(meaning.units)];
        Share {
            per_count_n: (newton_per_kpa * f64::from(meaning.kpa_per_count)) as f32,
            is_above: meaning.range == RangeFlag::Above,
            ..Share::of_sigmas(newton_per_kpa, f64::from(meaning.sigma_kpa), shared_kpa)
        }
    }

    /// Below the threshold that suffices beside an activated taxel a reading is not taken for a pressure, and adds up over taxels
    /// without a preference for those that noise favours. Where the curve is flat there, its uncertainty says what may lie on it.
    pub(super) fn light(&self, table: &TaxelTable, area: SquareMillimetre, activation: Activation) -> Light {
        let threshold_counts = activation.distance_counts(self.now.noise);
        let low = LOW_SHARE * threshold_counts;
        let at = |counts: f64| self.now.mean + self.sign.as_f64() * counts;
        let kpa = |counts: f64| f64::from(self.pressure_kpa(at(counts))).max(0.0);
        let sigma_kpa = || f64::from(table.sigma_kpa[at(low).round().clamp(0.0, (ENTRIES - 1) as f64) as usize]);
        let rise_kpa = Some(kpa(low) - kpa(0.0)).filter(|rise| *rise > 0.0).unwrap_or_else(sigma_kpa);
        Light {
            zero: self.now.mean,
            sign: self.sign.as_f64(),
            threshold_counts,
            touched_counts: low,
            newton_per_count: area.0 * 1e-3 * rise_kpa / low,
            noise_counts: self.now.noise.max(NOISE_FLOOR_COUNTS),
            dead_n: area.0 * 1e-3 * self.dead_zone.kpa,
        }
    }

    /// The threshold code of raw counts of this range: the greatest in the taxel's polarity that is no touch.
    pub(super) fn threshold(&self, activation: Activation, range: CountRange) -> u16 {
        let distance = activation.distance_counts(self.now.noise);
        let edge = (self.now.mean + self.sign.as_f64() * distance) * range.per_unit();
        let top = f64::from(range.top());
        match self.sign {
            Sign::Rising => edge.floor().clamp(0.0, top) as u16,
            Sign::Falling => !(edge.ceil().clamp(0.0, top) as u16),
        }
    }

    /// Tables for what is looked up now and then, and the force that every scan needs.
    pub(super) fn tabulate(&self, area: SquareMillimetre, counts: CountRange) -> (TaxelTable, ForceTable) {
        let pressure_kpa: [f32; ENTRIES] = std::array::from_fn(|units| self.pressure_kpa(units as f64));
        let meanings: [Meaning; ENTRIES] = std::array::from_fn(|units| self.meaning(units, counts, &pressure_kpa));
        let mut force_n = [0.0; FORCE_STRIDE];
        for (newton, kpa) in force_n.iter_mut().zip(pressure_kpa) {
            *newton = (f64::from(kpa) * area.0 * 1e-3).max(0.0) as f32;
        }
        let table = TaxelTable {
            pressure_kpa,
            sigma_kpa: meanings.map(|meaning| meaning.sigma_kpa),
            range: meanings.map(|meaning| meaning.range),
            shares: meanings.map(|meaning| self.share(&meaning, area)),
        };
        (table, force_n)
    }

    /// What a code beyond the calibrated range adds to the pressure at the range's end, and how uncertain that is.
    fn beyond(&self, units: f64) -> Beyond {
        self.extension.map_or(Beyond::default(), |extension| extension.at(units + self.shift))
    }

    /// Pressure before the calibrated range, and what adds to its uncertainty.
    fn light_end(&self, units: f64) -> Option<(f64, f64)> {
        self.light?.at(units + self.shift)
    }

    /// What the noise of a single count adds to an error that was taken of averaged ones, kPa.
    fn single_kpa(&self) -> f64 {
        let averaged = self.set.recorded.as_ref().is_some_and(|recorded| recorded.smooth_s > 0.0);
        let noise = if averaged { self.now.noise.max(NOISE_FLOOR_COUNTS) } else { 0.0 };
        self.in_use.map_or(0.0, |in_use| noise / in_use.sensitivity)
    }
}
