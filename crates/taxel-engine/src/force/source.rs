//! What the counts of one taxel mean at one zero: worked out for all 256 of a byte at once, or for one count of a finer
//! converter when it is asked for.
//!
//! A table of a byte takes 7 kB and 16 us a taxel. One of twelve bits would take sixteen times that each time that the
//! zero moves, 60 ms for 230 taxels in the middle of the live path, and only touched taxels are ever looked up. So counts
//! of more than eight bits are read from the curve itself.

use taxel_model::{Beyond, Extension, Plays, Sign, TaxelModel};
use taxel_skin::{CountRange, SquareMillimetre};

use crate::baseline::{Activation, NOISE_FLOOR_COUNTS, TaxelBaseline};
use crate::force::light_end::LightEnd;
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
pub(super) const FORCE_STRIDE: usize = 256 + 16;

/// Force by raw count; the entries beyond 255 are never read.
pub(crate) type ForceTable = [f32; FORCE_STRIDE];

/// Beside an activated taxel this share of the threshold suffices: the low one of two thresholds.
pub(super) const LOW_SHARE: f64 = 0.375;

/// One taxel's tables, indexed by raw count.
#[derive(Clone, Debug)]
pub(super) struct TaxelTable {
    pub(super) pressure_kpa: [f32; 256],
    pub(super) sigma_kpa: [f32; 256],
    pub(super) range: [RangeFlag; 256],
    pub(super) shares: [Share; 256],
    /// The count at the present zero.
    pub(super) zero: f64,
}

/// What a taxel's count contributes to a force and to its uncertainty, side by side, so that one access to the memory
/// has it all.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Share {
    /// Force in newton with the low threshold that holds beside an activated taxel.
    pub(crate) low_n: f32,
    /// Variance of the force that this taxel does not share with the others, N squared.
    pub(crate) own_n2: f32,
    /// Standard uncertainties of the force that it does share with them, N: of the hysteresis,
    pub(crate) hysteresis_n: f32,
    /// of what the calibration leaves open,
    pub(crate) curve_n: f32,
    /// and of how stiff the skin is beyond its range.
    pub(crate) beyond_n: f32,
    /// How much the force changes with the count here, N per count, not negative.
    pub(crate) per_count_n: f32,
    /// 1 where the count is beyond the calibrated range, on the side of pressure, and 0 elsewhere.
    pub(crate) above: f32,
}

impl Share {
    /// Of a taxel's standard uncertainty, kPa, and what others share: hysteresis, which is no part of it, curve, range.
    fn of_sigmas(newton_per_kpa: f64, sigma_kpa: f64, shared_kpa: [f64; 3]) -> Self {
        let shared_kpa2: f64 = shared_kpa[1..].iter().map(|kpa| kpa * kpa).sum();
        let [hysteresis_n, curve_n, beyond_n] = shared_kpa.map(|kpa| (newton_per_kpa * kpa) as f32);
        let own_n2 = (newton_per_kpa.powi(2) * (sigma_kpa * sigma_kpa - shared_kpa2).max(0.0)) as f32;
        Self { own_n2, hysteresis_n, curve_n, beyond_n, ..Self::default() }
    }

    /// What of its uncertainty others share, N.
    pub(super) fn shared_n(&self) -> f32 {
        self.hysteresis_n.hypot(self.curve_n).hypot(self.beyond_n)
    }
}

/// Where the counts of a taxel stand against those that its model refers to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// How the curve goes on beyond its range.
    pub(super) extension: Option<Extension>,
    /// What lies between its zero and its range; `None` where hysteresis is compensated.
    light: Option<LightEnd>,
    /// What its calibration leaves open and neighbouring taxels share, kPa.
    doubt_kpa: f64,
    /// The present zero.
    pub(super) now: TaxelBaseline,
    /// What is added to a count to get the count that the models refer to.
    shift: f64,
    pub(super) sign: Sign,
}

/// All that the meaning of one taxel's counts follows from.
pub(super) struct Source<'a> {
    model: &'a TaxelModel,
    /// Where hysteresis is compensated; the play operators add their offset scan by scan.
    plays: Option<&'a Plays>,
    in_use: Option<&'a RecordedTaxel>,
    set: &'a ModelSet,
    place: Place,
}

/// What a count of a taxel weighs that lies beside a touch and is none itself.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Light {
    /// The present zero, counts.
    pub(crate) zero: f64,
    /// N per count towards load.
    pub(crate) newton_per_count: f64,
    /// Of a single reading.
    pub(crate) noise_counts: f64,
}

/// What one count means.
#[derive(Clone, Copy, Debug)]
pub(super) struct Meaning {
    /// The count, in units.
    units: f64,
    pub(super) pressure_kpa: f32,
    pub(super) sigma_kpa: f32,
    pub(super) kpa_per_count: f32,
    pub(super) range: RangeFlag,
    /// Counts from rest towards pressure.
    pub(super) pressed: f64,
}

impl Place {
    /// `zeros` are the present one and that of the models.
    pub(super) fn new(
        set: &ModelSet,
        taxel: usize,
        extension: Option<Extension>,
        doubt_kpa: f64,
        zeros: (TaxelBaseline, TaxelBaseline),
        more_counts: f64,
    ) -> Self {
        let (now, then) = zeros;
        let plays = set.plays(taxel);
        let sign = plays.map_or(set.taxels[taxel].sign, |plays| plays.sign);
        let light = plays.is_none().then(|| LightEnd::new(&set.taxels[taxel], then.mean)).flatten();
        let shift = then.mean - now.mean + sign.as_f64() * more_counts;
        Self { extension, light, doubt_kpa, now, shift, sign }
    }
}

impl<'a> Source<'a> {
    pub(super) fn new(set: &'a ModelSet, taxel: usize, place: Place) -> Self {
        Self { model: &set.taxels[taxel], plays: set.plays(taxel), in_use: set.in_use(taxel), set, place }
    }

    /// What a count of so many units means in the range of counts, of which `kpa` gives the pressures.
    fn meaning_by(&self, units: f64, counts: CountRange, kpa: impl Fn(f64) -> f32) -> Meaning {
        let (count, top) = (units + self.place.shift, counts.units(counts.top()));
        let sigma_kpa = self.sigma_in_use_kpa().unwrap_or_else(|| {
            let inside = |[low, high]: [f64; 2]| count.max(low).min(high);
            let slope = self.model.served().zip(self.model.range).map(|(curve, range)| curve.slope(inside(range)));
            let rounding_kpa = slope.map_or(0.0, |slope| slope.abs() / (12.0_f64.sqrt() * counts.per_unit()));
            let sigma_kpa = self.model.evaluate(count).map_or(f64::INFINITY, |reading| reading.sigma_kpa);
            sigma_kpa.max(rounding_kpa).hypot(self.single_kpa())
        });
        // Noise must not decide whether a reading near the end of the range says that it is beyond.
        let margin = RANGE_MARGIN_SIGMAS * self.place.now.noise.max(NOISE_FLOOR_COUNTS);
        let nearer = counts.units(counts.nearest((units + self.sign().as_f64() * margin).clamp(0.0, top)));
        let range = match self.range_at(nearer) {
            RangeFlag::Above => RangeFlag::Above,
            _ => self.range_at(units),
        };
        let (before, after) = ((units - 1.0).max(0.0), (units + 1.0).min(top));
        // Left-out readings of a skin fit show what the calibration leaves open, too.
        let doubt_kpa = self.doubt_kpa(units) as f32;
        let in_sigma = self.model.points.is_some();
        let sigma_kpa = if in_sigma { doubt_kpa.max(sigma_kpa as f32) } else { doubt_kpa.hypot(sigma_kpa as f32) };
        let beyond = self.beyond(units);
        Meaning {
            units,
            pressure_kpa: kpa(units),
            sigma_kpa: sigma_kpa.hypot(beyond.sigma_kpa().max(UNVOUCHED_SHARE * beyond.kpa) as f32),
            kpa_per_count: (kpa(after) - kpa(before)).abs() / (after - before) as f32,
            range,
            pressed: self.pressed(units),
        }
    }

    /// What a count of so many units means.
    pub(super) fn meaning(&self, units: f64, counts: CountRange) -> Meaning {
        self.meaning_by(units, counts, |units| self.pressure_kpa(units))
    }

    fn pressure_kpa(&self, units: f64) -> f32 {
        if let Some((kpa, _)) = self.light_end(units) {
            return kpa as f32;
        }
        let count = units + self.place.shift;
        self.model.kpa(count).unwrap_or(0.0) as f32 + self.beyond(units).kpa as f32
    }

    fn range_at(&self, units: f64) -> RangeFlag {
        let range = self.plays.map(|plays| plays.range).or(self.model.range);
        let count = units + self.place.shift;
        let rises = self.sign() == Sign::Rising;
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
    fn doubt_kpa(&self, units: f64) -> f64 {
        self.place.doubt_kpa.hypot(self.light_end(units).map_or(0.0, |(_, sigma_kpa)| sigma_kpa))
    }

    /// What of the uncertainty beyond the calibrated range all taxels have in common, kPa: how stiff the skin is there.
    fn beyond_shared_kpa(&self, units: f64) -> f64 {
        let beyond = self.beyond(units);
        beyond.shared_kpa.max(UNVOUCHED_SHARE * beyond.kpa)
    }

    /// What of the uncertainty of a reading all taxels have in common while a load decreases, as both branches of pressure have
    /// shown, kPa. How far the zero stays away from where it was does not average out either.
    fn hysteresis_kpa(&self) -> f64 {
        let (Some(in_use), Some(recorded)) = (self.in_use, self.set.recorded.as_ref()) else { return 0.0 };
        in_use.hysteresis_kpa.unwrap_or(0.0).hypot(recorded.zero_return_common_counts() / in_use.sensitivity)
    }

    /// What a count contributes to a force and to its uncertainty; `newton` is its force without a threshold.
    pub(super) fn share(&self, meaning: &Meaning, area: SquareMillimetre, activation: Activation) -> Share {
        let newton_per_kpa = area.0 * 1e-3;
        let low = LOW_SHARE * activation.distance_counts(self.place.now.noise);
        let shared_kpa = [self.hysteresis_kpa(), self.doubt_kpa(meaning.units), self.beyond_shared_kpa(meaning.units)];
        Share {
            low_n: if meaning.pressed > low { meaning.newton(area) } else { 0.0 },
            per_count_n: (newton_per_kpa * f64::from(meaning.kpa_per_count)) as f32,
            above: if meaning.range == RangeFlag::Above { 1.0 } else { 0.0 },
            ..Share::of_sigmas(newton_per_kpa, f64::from(meaning.sigma_kpa), shared_kpa)
        }
    }

    /// Newton per count and noise in counts below the threshold that suffices beside an activated taxel: there the reading is not
    /// taken for a pressure, and adds up over taxels without a preference for those that noise favours.
    pub(super) fn light(&self, area: SquareMillimetre, activation: Activation) -> Light {
        let low = LOW_SHARE * activation.distance_counts(self.place.now.noise);
        let kpa =
            |counts: f64| f64::from(self.pressure_kpa(self.place.now.mean + self.sign().as_f64() * counts)).max(0.0);
        let newton_per_count = area.0 * 1e-3 * (kpa(low) - kpa(0.0)).max(0.0) / low;
        Light {
            zero: self.place.now.mean,
            newton_per_count,
            noise_counts: self.place.now.noise.max(NOISE_FLOOR_COUNTS),
        }
    }

    /// The threshold code of raw counts of this range: the greatest in the taxel's polarity that is no touch.
    pub(super) fn threshold(&self, activation: Activation, range: CountRange) -> u16 {
        let distance = activation.distance_counts(self.place.now.noise);
        let edge = (self.place.now.mean + self.sign().as_f64() * distance) * range.per_unit();
        let top = f64::from(range.top());
        match self.sign() {
            Sign::Rising => edge.floor().clamp(0.0, top) as u16,
            Sign::Falling => !(edge.ceil().clamp(0.0, top) as u16),
        }
    }

    const fn sign(&self) -> Sign {
        self.place.sign
    }

    /// Tables for what is looked up now and then, and the force that every scan needs.
    pub(super) fn tabulate(&self, area: SquareMillimetre, activation: Activation) -> (TaxelTable, ForceTable) {
        let pressure_kpa: [f32; 256] = std::array::from_fn(|code| self.pressure_kpa(code as f64));
        let meanings: [Meaning; 256] = std::array::from_fn(|code| {
            self.meaning_by(code as f64, CountRange::BYTE, |units| pressure_kpa[units as usize])
        });
        let distance = activation.distance_counts(self.place.now.noise);
        let mut force_n = [0.0; FORCE_STRIDE];
        for (newton, meaning) in force_n.iter_mut().zip(&meanings) {
            *newton = if meaning.pressed > distance { meaning.newton(area) } else { 0.0 };
        }
        let table = TaxelTable {
            pressure_kpa,
            sigma_kpa: meanings.map(|meaning| meaning.sigma_kpa),
            range: meanings.map(|meaning| meaning.range),
            shares: meanings.map(|meaning| self.share(&meaning, area, activation)),
            zero: self.place.now.mean,
        };
        (table, force_n)
    }

    /// What a code beyond the calibrated range adds to the pressure at the range's end, and how uncertain that is.
    fn beyond(&self, units: f64) -> Beyond {
        self.place.extension.map_or(Beyond::default(), |extension| extension.at(units + self.place.shift))
    }

    /// Pressure before the calibrated range, and what adds to its uncertainty.
    fn light_end(&self, units: f64) -> Option<(f64, f64)> {
        self.place.light?.at(units + self.place.shift)
    }

    /// Counts from rest towards pressure.
    fn pressed(&self, units: f64) -> f64 {
        self.sign().as_f64() * (units - self.place.now.mean)
    }

    /// What the noise of a single count adds to an error that was taken of averaged ones, kPa.
    fn single_kpa(&self) -> f64 {
        let averaged = self.set.recorded.as_ref().is_some_and(|recorded| recorded.smooth_s > 0.0);
        let noise = if averaged { self.place.now.noise.max(NOISE_FLOOR_COUNTS) } else { 0.0 };
        self.in_use.map_or(0.0, |in_use| noise / in_use.sensitivity)
    }

    /// The error of a reading as a recording of both branches has shown it, and what is not in there: the noise of a
    /// single count, which was averaged out when that error was taken.
    fn sigma_in_use_kpa(&self) -> Option<f64> {
        // A skin fit has the error by the reading, single scans and hysteresis included.
        let recorded = self.set.recorded.as_ref().filter(|_| self.model.points.is_none())?;
        let noise = if recorded.smooth_s > 0.0 { self.place.now.noise.max(NOISE_FLOOR_COUNTS) } else { 0.0 };
        Some(self.in_use?.sigma_kpa(recorded.zero_return_counts().hypot(noise))).filter(|sigma| sigma.is_finite())
    }
}

impl Meaning {
    /// The force on an area, N.
    pub(super) fn newton(&self, area: SquareMillimetre) -> f32 {
        (f64::from(self.pressure_kpa) * area.0 * 1e-3).max(0.0) as f32
    }
}

/// How much the pressure changes with the count at `count`, not negative.
pub(super) fn kpa_per_count(pressure_kpa: &[f32; 256], count: u8) -> f32 {
    let (before, after) = (count.saturating_sub(1), count.saturating_add(1));
    let rise = pressure_kpa[usize::from(after)] - pressure_kpa[usize::from(before)];
    rise.abs() / f32::from(after - before)
}
