//! What the taxels and thermal pads of a board show: means over some scans, and how much they speak for a new zero.

use crate::baseline::TaxelBaseline;

/// Weight of a scan in the mean of a taxel or pad, and in the slow mean that a pad is compared with and that of a taxel.
const SHARE: f32 = 1.0 / 8.0;
const PAD_SLOW_SHARE: f32 = 1.0 / 100.0;
const TAXEL_SLOW_SHARE: f32 = 1.0 / 400.0;
/// The same in the mean that tells how much a load was that vanishes.
const QUICK_SHARE: f32 = 0.4;
/// Variance of the mean over that of a scan, of which boards repeat some, and with that of a zero.
const SCAN_VARIANCE: f64 = 0.11;
const MEAN_VARIANCE: f64 = SCAN_VARIANCE + 0.1;
/// Noise that an input is credited with at least, and that of a pad, counts.
const NOISE_MIN_COUNTS: f64 = 0.5;
const PAD_NOISE_COUNTS: f64 = 0.85;
/// Slow changes that are no evidence, counts.
const SLOW_COUNTS: f64 = 0.15;
/// One input counts for at most so much.
const EVIDENCE_MAX: f32 = 16.0;
/// Scans until an input counts that was not sound.
const SOUND_SCANS: u8 = 12;
/// Of the load on a board less than this share remains when it vanishes; it lay on so many taxels with so many counts.
const VANISHED_SHARE: f32 = 0.4;
const LOAD_TAXELS_MIN: f32 = 3.0;
const LOAD_MIN_COUNTS: f32 = 12.0;

/// One taxel; all in counts, turned so that load is positive. Without a sign it takes no part.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Taxel {
    pub(super) sign: f32,
    pub(super) zero: f32,
    pub(super) per_variance: f32,
    pub(super) touched: f32,
    /// Newest value, the mean, and the mean of some four scans now, one scan and two scans ago.
    pub(super) now: f32,
    pub(super) mean: f32,
    pub(super) quick: [f32; 3],
    /// What it has read on the long run since the zero.
    pub(super) slow: f32,
    /// For how many scans it has been sound.
    pub(super) sound: u8,
}

impl Taxel {
    pub(super) fn push(&mut self, count: f32, sound: bool) {
        self.now = self.sign * count - self.zero;
        self.sound = if sound { self.sound.saturating_add(1) } else { 0 };
        let towards = |mean: f32, share: f32| mean + share * (self.now - mean);
        // After what was not sound, and at first, a mean is one of few scans.
        let few = 1.0 / f32::from(self.sound.max(1));
        self.mean = towards(self.mean, SHARE.max(few));
        self.quick = [towards(self.quick[0], QUICK_SHARE.max(few)), self.quick[0], self.quick[1]];
        if sound {
            self.slow = towards(self.slow, TAXEL_SLOW_SHARE);
        }
    }

    /// From now on it is compared with `zero`, turned by `sign`; from `touched` counts on it is touched. What was seen stays.
    pub(super) fn compare_with(&mut self, sign: i8, zero: TaxelBaseline, touched: f64) {
        if sign == 0 || !zero.mean.is_finite() {
            self.sign = 0.0;
            return;
        }
        let turned = (f64::from(sign) * zero.mean) as f32;
        let moved = if self.sign == f32::from(sign) { self.zero - turned } else { 0.0 };
        let Self { mean, slow, quick: [quick, one, two], .. } = self;
        [mean, slow, quick, one, two].into_iter().for_each(|mean| *mean += moved);
        let noise = zero.noise.max(NOISE_MIN_COUNTS);
        (self.sign, self.zero) = (f32::from(sign), turned);
        self.per_variance = (1.0 / (noise * noise * MEAN_VARIANCE + SLOW_COUNTS * SLOW_COUNTS)) as f32;
        self.touched = touched as f32;
    }

    /// Whether it may speak for its board.
    pub(super) fn is_sound(&self) -> bool {
        self.sound >= SOUND_SCANS && self.sign != 0.0
    }

    /// What it reads less than its zero, and than on the long run, normalised and squared.
    pub(super) fn evidence(&self) -> f32 {
        let less = (self.slow.min(0.0) - self.mean).max(0.0);
        (less * less * self.per_variance).min(EVIDENCE_MAX)
    }

    /// The load on it, then and now, and whether there was one.
    pub(super) fn load(&self, then: f32) -> [f32; 3] {
        if self.sign != 0.0 && then > self.touched { [then, self.now.max(0.0), 1.0] } else { [0.0; 3] }
    }
}

/// One thermal pad.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pad {
    pub(super) there: bool,
    pub(super) mean: f32,
    pub(super) slow: f32,
    pub(super) sound: u8,
}

impl Pad {
    /// One at an end of its range is broken, or its module is.
    pub(super) fn push(&mut self, count: u8, heard: bool) {
        let sound = heard && !matches!(count, u8::MIN | u8::MAX);
        self.sound = if sound { self.sound.saturating_add(1) } else { 0 };
        let few = 1.0 / f32::from(self.sound.max(1));
        self.mean += SHARE.max(few) * (f32::from(count) - self.mean);
        self.slow += PAD_SLOW_SHARE.max(few) * (f32::from(count) - self.slow);
    }

    /// Whether it may speak for its board.
    pub(super) fn is_sound(&self) -> bool {
        self.there && self.sound >= SOUND_SCANS
    }

    /// How far it has stepped, normalised and squared.
    pub(super) fn evidence(&self) -> f32 {
        const VARIANCE: f64 = PAD_NOISE_COUNTS * PAD_NOISE_COUNTS * SCAN_VARIANCE + SLOW_COUNTS * SLOW_COUNTS;
        ((self.mean - self.slow).powi(2) * (1.0 / VARIANCE) as f32).min(EVIDENCE_MAX)
    }
}

/// The load of several taxels: counts then and now, and how many it lay on.
pub(super) fn sum(loads: impl Iterator<Item = [f32; 3]>) -> [f32; 3] {
    loads.fold([0.0; 3], |sum, load| [sum[0] + load[0], sum[1] + load[1], sum[2] + load[2]])
}

/// Whether a load was one, and has vanished.
pub(super) fn is_vanished([was, is, touched]: [f32; 3]) -> bool {
    touched >= LOAD_TAXELS_MIN && was >= LOAD_MIN_COUNTS && is < VANISHED_SHARE * was
}
