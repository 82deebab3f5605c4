//! The drift of one module, and what its taxels and pads do.

use std::ops::Range;

use super::coefficient::Coefficient;
use super::common::{Allowed, Warming};
use super::limits::{AGREEMENT_COUNTS, BETWEEN_MODULES, HOLD_OFF_S};
use super::site::DriftSite;
use super::smooth::{Shares, Smooth};
use crate::counts::Counts;
use crate::statistics::median;

/// Fewest taxels that may speak for a module.
const TAXELS_MIN: usize = 5;
/// The fast mean of a taxel is judged once it has this share of its weight, half a second after its first value.
const FAST_WEIGHT: f64 = 0.6;
/// The slow mean is followed once it has this share of its weight, after 2.3 time constants.
const SLOW_WEIGHT: f64 = 0.9;
/// A taxel that moves by this share of its activation threshold is touched.
const TOUCH_SHARE: f64 = 0.5;
/// Where nobody knows where the pads were at the taxels' zero, it is their mean over so many seconds after it.
const PADS_ZERO_S: f64 = 5.0;
/// The two pads of a module are believed while they agree within this, counts ...
const PADS_APART_COUNTS: f64 = 2.0;
/// ... and this share of how far they moved.
const PADS_APART_SHARE: f64 = 0.5;

/// One taxel.
#[derive(Clone, Copy, Debug)]
pub(super) struct TaxelDrift {
    /// Its proven zero, counts; NaN: it takes no part.
    zero: f64,
    /// Its activation threshold, counts from the zero.
    distance: f64,
    /// Shows a touch.
    fast: Smooth,
    /// While untouched: what it rests at.
    slow: Smooth,
    /// Where it rested last, counts.
    rest: f64,
}

impl Default for TaxelDrift {
    fn default() -> Self {
        Self::new(f64::NAN, 0.0)
    }
}

impl TaxelDrift {
    pub(super) fn new(zero: f64, distance: f64) -> Self {
        Self { zero, distance, fast: Smooth::default(), slow: Smooth::default(), rest: zero }
    }

    /// Its zero was found to lie elsewhere.
    pub(super) fn rebase(&mut self, zero: f64) {
        self.zero = zero;
    }

    fn restart(&mut self) {
        self.fast.restart();
        self.slow.restart();
    }

    /// Beyond its threshold, or away from where it rested. `drift` is that of its module now, `rested_at` then.
    fn is_touched(&self, drift: f64, rested_at: f64) -> bool {
        let Some(now) = self.fast.mean(FAST_WEIGHT) else { return false };
        let (from_zero, from_rest) = (now - self.zero - drift, now - self.rest - (drift - rested_at));
        from_zero.abs() > self.distance || from_rest.abs() > TOUCH_SHARE * self.distance
    }
}

/// A thermal pad.
#[derive(Clone, Copy, Debug, Default)]
struct Pad {
    /// Where it is now.
    fast: Smooth,
    /// What the drift is worked out from.
    slow: Smooth,
    /// Sum and number of the counts that its zero is the mean of.
    sum: f64,
    n: f64,
}

impl Pad {
    fn restart(&mut self) {
        self.fast.restart();
        self.slow.restart();
    }

    /// How far the mean of some readings lies from the zero, counts.
    fn moved(&self, mean: Option<f64>) -> Option<f64> {
        mean.map(|mean| mean - self.sum / self.n).filter(|moved| moved.is_finite())
    }
}

/// Where a module was when it was held.
#[derive(Clone, Copy, Debug, Default)]
struct Hold {
    drift: f64,
    pads: Option<f64>,
    /// Those of the other modules.
    others: f64,
}

/// One module.
#[derive(Clone, Debug)]
pub(super) struct ModuleDrift {
    site: DriftSite,
    pads: [Pad; 2],
    /// Time since the zero.
    zero_s: f64,
    touched: bool,
    /// How long nothing has touched it or a module beside it.
    untouched_s: f64,
    /// Its drift when its taxels last rested.
    rested_at: f64,
    coefficient: Coefficient,
    hold: Hold,
    following: bool,
    /// Where the drift is heading, and where it is, counts.
    target: f64,
    drift: f64,
    /// What of it no pads explain, counts.
    unexplained: f64,
    bounded: bool,
    in_tables: f64,
}

impl ModuleDrift {
    pub(super) fn new(site: DriftSite) -> Self {
        Self {
            site,
            pads: [Pad::default(); 2],
            zero_s: 0.0,
            touched: false,
            untouched_s: 0.0,
            rested_at: 0.0,
            coefficient: Coefficient::default(),
            hold: Hold::default(),
            following: false,
            target: 0.0,
            drift: 0.0,
            unexplained: 0.0,
            bounded: false,
            in_tables: 0.0,
        }
    }

    /// A new zero: rest has just been proven, with its pads at `pads`, where that is known. Pads that have not moved are where
    /// the hold is.
    pub(super) fn begin(&mut self, pads: [Option<f64>; 2]) {
        *self = Self::new(self.site.clone());
        for (pad, counts) in self.pads.iter_mut().zip(pads) {
            (pad.sum, pad.n) = counts.map_or((0.0, 0.0), |counts| (counts, 1.0));
        }
        if pads != [None; 2] {
            self.zero_s = f64::INFINITY; // what they say from here on is of the warmth
        }
        self.untouched_s = HOLD_OFF_S;
        self.hold.pads = Some(0.0);
    }

    pub(super) fn restart(&mut self, taxels: &mut [TaxelDrift]) {
        taxels.iter_mut().for_each(TaxelDrift::restart);
        self.lose_pads();
        self.untouched_s = 0.0;
        self.begin_hold();
    }

    /// Takes the counts of a scan, `counts` being those of the whole patch; `pads` is `None` while it is silent.
    pub(super) fn take(
        &mut self,
        taxels: &mut [TaxelDrift],
        counts: Counts<'_>,
        pads: Option<[u8; 2]>,
        sound: &impl Fn(usize) -> bool,
        shares: &Shares,
    ) {
        let Some(pads) = pads else {
            self.restart(taxels);
            self.touched = true; // who knows
            return;
        };
        self.touched = false;
        for (index, taxel) in self.site.taxels.clone().zip(taxels) {
            if !sound(index) {
                taxel.restart();
                continue;
            }
            let Some(count) = counts.units(index) else { continue };
            taxel.fast.push(count, shares.fast);
            self.touched |= taxel.is_touched(self.drift, self.rested_at);
        }
        self.feel(pads, shares);
    }

    /// Takes the pads of a scan.
    pub(super) fn feel(&mut self, pads: [u8; 2], shares: &Shares) {
        self.zero_s += shares.dt_s;
        for (pad, count) in self.pads.iter_mut().zip(pads).take(self.site.kind.thermal_slots().len()) {
            if matches!(count, u8::MIN | u8::MAX) {
                pad.restart(); // at an end of the converter's range
                continue;
            }
            pad.fast.push(f64::from(count), shares.fast);
            pad.slow.push(f64::from(count), shares.slow);
            if self.zero_s <= PADS_ZERO_S {
                (pad.sum, pad.n) = (pad.sum + f64::from(count), pad.n + 1.0);
            }
        }
    }

    /// It is silent, or was for a while.
    pub(super) fn lose_pads(&mut self) {
        self.pads.iter_mut().for_each(Pad::restart);
    }

    /// Lets the taxels rest, unless something touches the module or is `near` it.
    pub(super) fn rest(&mut self, taxels: &mut [TaxelDrift], counts: Counts<'_>, near: bool, shares: &Shares) {
        if near {
            if self.untouched_s > 0.0 {
                taxels.iter_mut().for_each(|taxel| taxel.slow.restart());
            }
            self.untouched_s = 0.0;
            return;
        }
        self.untouched_s += shares.dt_s;
        if self.untouched_s < HOLD_OFF_S {
            return;
        }
        for (taxel, count) in taxels.iter_mut().zip(counts.slice(self.range()).iter_units()) {
            if taxel.fast.is_empty() {
                continue; // it has a fault
            }
            taxel.slow.push(count, shares.slow);
            if let Some(rest) = taxel.slow.mean(SLOW_WEIGHT) {
                (taxel.rest, self.rested_at) = (rest, self.drift);
            }
        }
    }

    /// How far the module lies from its zero, counts: the median over its taxels, once they rest. `taxels` are those of
    /// the whole patch. `None` while it is touched or too few of its taxels are sound.
    pub(super) fn offset(&self, taxels: &[TaxelDrift]) -> Option<f64> {
        if self.untouched_s < HOLD_OFF_S {
            return None;
        }
        let offset = |taxel: &TaxelDrift| Some(taxel.slow.mean(SLOW_WEIGHT)? - taxel.zero).filter(|o| o.is_finite());
        let offsets: Vec<f64> = taxels.get(self.range())?.iter().filter_map(offset).collect();
        if offsets.len() < TAXELS_MIN { None } else { median(offsets) }
    }

    /// How far its pads have moved since the zero, in the mean over tens of seconds, counts; `None` without pads that are
    /// known and agree.
    pub(super) fn pads_moved(&self) -> Option<f64> {
        self.pads_at(|pad| pad.moved(pad.slow.mean(SLOW_WEIGHT)))
    }

    /// The same in the mean over half a second, which is known before the other is, whether something touches it or not.
    pub(super) fn pads_now(&self) -> Option<f64> {
        self.pads_at(|pad| pad.moved(pad.fast.mean(FAST_WEIGHT)))
    }

    fn pads_at(&self, moved: impl Fn(&Pad) -> Option<f64>) -> Option<f64> {
        match (moved(&self.pads[0]), moved(&self.pads[1])) {
            (Some(a), Some(b)) => {
                let agree = (a - b).abs() <= PADS_APART_COUNTS + PADS_APART_SHARE * a.abs().max(b.abs());
                agree.then_some(0.5 * (a + b))
            }
            (Some(moved), None) if self.site.kind.thermal_slots().len() == 1 => Some(moved),
            _ => None,
        }
    }

    /// It is untouched: heads for where the others are, as far as that is `allowed`, which its own pads may say more of.
    /// All in counts.
    pub(super) fn follow(&mut self, offset: f64, allowed: Allowed, common_pads: f64) {
        let pads = self.pads_moved();
        let own = match (pads, self.coefficient.value()) {
            (Some(pads), Some((coefficient, _))) => coefficient * (pads - common_pads),
            _ => 0.0,
        };
        self.target = allowed.counts + own;
        self.unexplained = allowed.unexplained;
        if let Some(pads) = pads.filter(|_| (offset - self.target).abs() <= AGREEMENT_COUNTS) {
            self.coefficient.learn(pads, offset);
        }
        (self.hold.pads, self.hold.others) = (pads, common_pads);
        self.following = true;
    }

    /// It is touched, or nothing is known of the others: heads for where its own pads say.
    pub(super) fn hold(&mut self, patch: &Warming) {
        self.begin_hold();
        self.target = self.warmed(patch).0;
    }

    /// Where it heads for while it is held, counts, and how uncertain that is. Where its coefficient or its pads are not known it
    /// stays, and all of what it may have moved by is uncertain: it may warm as the patch does, or otherwise, and pads that are not
    /// known move as all do.
    fn warmed(&self, patch: &Warming) -> (f64, f64) {
        let moved = self.pads_moved().zip(self.hold.pads).map(|(now, then)| now - then);
        if let Some((moved, (coefficient, sigma))) = moved.zip(self.coefficient.value()) {
            return (self.hold.drift + coefficient * moved, (sigma * moved).abs());
        }
        let moved = moved.unwrap_or(patch.pads - self.hold.others);
        let coefficient = patch.coefficient.hypot(patch.sigma.max(BETWEEN_MODULES));
        (self.hold.drift, (coefficient * moved).abs())
    }

    fn begin_hold(&mut self) {
        if std::mem::take(&mut self.following) {
            self.hold.drift = self.drift; // from here, not from where it was heading
        }
    }

    /// Moves towards the target by at most `step_max` and not beyond `bound`, counts.
    pub(super) fn advance(&mut self, step_max: f64, bound: f64) {
        let step = (self.target - self.drift).clamp(-step_max, step_max);
        self.drift = (self.drift + step).clamp(-bound, bound);
        // A little below its bound it is free again, so that noise does not make it come and go.
        let at = if self.bounded { 0.9 } else { 1.0 };
        self.bounded = self.drift.abs() >= at * bound && self.target.abs() >= at * bound;
    }

    /// Standard uncertainty of its drift while it is held, counts: of where it belongs, and all that it has not gone yet.
    pub(super) fn held_sigma(&self, patch: &Warming) -> f64 {
        let (belongs, sigma) = self.warmed(patch);
        if self.following { 0.0 } else { sigma.hypot(belongs - self.drift) }
    }

    pub(super) fn range(&self) -> Range<usize> {
        self.site.taxels.clone()
    }

    pub(super) fn beside(&self) -> &[usize] {
        &self.site.beside
    }

    pub(super) const fn is_touched(&self) -> bool {
        self.touched
    }

    pub(super) const fn is_following(&self) -> bool {
        self.following
    }

    pub(super) const fn is_bounded(&self) -> bool {
        self.bounded
    }

    pub(super) const fn drift(&self) -> f64 {
        self.drift
    }

    pub(super) const fn unexplained(&self) -> f64 {
        self.unexplained
    }

    pub(super) const fn target(&self) -> f64 {
        self.target
    }

    pub(super) fn since_tables(&self) -> f64 {
        (self.drift - self.in_tables).abs()
    }

    pub(super) const fn note_tables(&mut self) {
        self.in_tables = self.drift;
    }
}
