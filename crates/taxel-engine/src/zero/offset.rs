//! Where the zero is now: how far the counts of each module lie from it though nothing presses, estimated all the time.
//!
//! Model. Counts are turned so that load is positive: `c_i = s_i (y_i - zero_i) = b_m(t) + g_i(p_i) + e_i` with `p_i >= 0`.
//! The offset `b_m` of a module follows its thermal pads, which no load reaches, and wanders: `db = k dT + dW`
//! (`ModuleOffset`). It is predicted from the pads and read as the trimmed mean of the taxels of a module that nothing has
//! touched for `HOLD_OFF_S` (PX4's estimators of biases have this form).
//!
//! Load is one-sided, and so is the gate. What is lighter than predicted is always taken. What is heavier is taken only
//! within three standard deviations, and while what no warmth of the pads explains weighs less than `ABSORBED_MAX`: else
//! it may be a load. That force is reported as [`DriftView::absorbed`].
//!
//! Where the zero follows (`follow_drift`) the tables move by `b`, up to the bound; else only as far as the skin becomes
//! lighter, which no load does. What is not followed stays in the uncertainty: `hypot(b - followed, sqrt P)`.
//!
//! What it cannot tell: a load on everything that comes as the skin cools, in step with the pads, where boards compensate none
//! of the warmth, and 1 N that creeps in.

use std::ops::Range;
use taxel_skin::{Newton, Time};

use crate::baseline::TaxelBaseline;
use crate::force::reason::{Reason, ReasonCode, positions};
use crate::regions::Regions;
use crate::scan::Scan;
use crate::statistics::{exponential_share, median};
use crate::zero::ground::Ground;
use crate::zero::module_offset::{ModuleOffset, coefficient_of_all};
use crate::zero::rest::RestStatistics;
use crate::zero::rest::judge::lighter;
use crate::zero::rest::verdict::Beyond;
use crate::zero::view::DriftView;

/// Standard uncertainty of a new zero, counts.
const ZERO_SIGMA: f64 = 0.15;
/// How an offset wanders by itself, counts per root of a second. What creeps back of the residue that a zero was taken with is no
/// part of it: it may as well be a load that the zero hides (`force/untouched/hidden.rs`), and is in the undetected force as one.
const WANDER: f64 = 0.004;
/// Least standard uncertainty of what a module's taxels say together, counts: they differ by hysteresis and warmth.
const READING_SIGMA: f64 = 0.12;
/// Most of a load on everything that may be taken for an offset.
const ABSORBED_MAX: Newton = Newton(1.0);
/// The same while nobody knows what a count weighs, counts of each module.
const ABSORBED_MAX_COUNTS: f64 = 0.5;
/// So long after a touch a module is not read: fabric creeps back within some ten seconds.
const HOLD_OFF_S: f64 = 30.0;
/// A taxel that moves by this share of its activation threshold is touched.
const TOUCH_SHARE: f64 = 0.5;
/// Fewest taxels that may speak for a module.
const TAXELS_MIN: usize = 5;
/// Time constant of the pads' mean, and how often the offsets are predicted from them, seconds.
const PADS_S: f64 = 1.0;
const PREDICT_S: f64 = 0.2;
/// Length of a window of counts, and what is a gap, seconds.
const WINDOW_S: f64 = 2.0;
const GAP_S: f64 = 2.0;
/// The tables follow in steps of so many counts, and at most so often, seconds.
const TABLES_COUNTS: f64 = 0.15;
const TABLES_S: f64 = 10.0;
/// How far at most from the proven zero, counts.
const BOUND_COUNTS: f64 = 3.0;

/// The offsets of one patch.
#[derive(Clone, Debug)]
pub struct Offset {
    /// Whether the tables follow what is heavier, too.
    follows: bool,
    /// Of each module its taxels.
    taxels: Vec<Range<usize>>,
    modules: Vec<ModuleOffset>,
    window: RestStatistics,
    /// Whether the counts of all scans of the window count.
    counts: bool,
    /// N per count of each module as a whole; empty while nobody knows.
    newton_per_count: Vec<f64>,
    last: Option<Time>,
    /// Time since the last prediction, the window's begin, and the tables, seconds.
    predict_s: f64,
    window_s: f64,
    tables_s: f64,
    view: DriftView,
}

/// What a scan says of the offset.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Change {
    /// The tables have to be made anew.
    pub moves: bool,
    /// The skin is lighter than its zero may be.
    pub lighter: Option<Beyond>,
}

impl Offset {
    /// Of no zero yet.
    pub fn new(follows: bool, regions: &Regions) -> Self {
        Self {
            follows,
            taxels: regions.modules().to_vec(),
            modules: vec![ModuleOffset::default(); regions.modules().len()],
            window: RestStatistics::new(regions.taxels()),
            counts: true,
            newton_per_count: Vec::new(),
            last: None,
            predict_s: 0.0,
            window_s: 0.0,
            tables_s: 0.0,
            view: DriftView::default(),
        }
    }

    /// A zero was taken, with this mean of the pads of each module, counts.
    pub fn begin(&mut self, pads: &[Option<f64>]) {
        let pads = pads.iter().copied().chain(std::iter::repeat(None));
        self.modules.iter_mut().zip(pads).for_each(|(module, then)| module.begin(ZERO_SIGMA, then, HOLD_OFF_S));
        self.tables_s = 0.0;
        self.predict_s = PREDICT_S; // what the pads say since, after a restart: at once
        self.view = DriftView::default();
        self.restart();
        self.describe();
    }

    /// There is no zero any more.
    pub fn end(&mut self) {
        self.view = DriftView::default();
    }

    /// What was seen of the counts says nothing of what comes.
    pub fn restart(&mut self) {
        self.window.restart();
        (self.window_s, self.counts) = (0.0, true);
    }

    /// Mean of the pads of each module in the last second, counts, `None` without one.
    pub fn pads(&self) -> Vec<Option<f64>> {
        self.modules.iter().map(ModuleOffset::pads).collect()
    }

    /// How much a count more of each taxel weighs, N; empty while nobody knows.
    pub fn weigh(&mut self, newton_per_count: &[f64]) {
        let of = |taxels: &Range<usize>| Some(newton_per_count.get(taxels.clone())?.iter().sum::<f64>().abs());
        self.newton_per_count = self.taxels.iter().filter_map(of).collect();
        self.describe();
    }

    /// Takes a scan, `ground` being what it is compared with and `taken` the zero as it was taken. While its counts do not
    /// `count`, as in a session or in a check, only the pads are followed.
    pub fn on_scan(
        &mut self,
        scan: &Scan<'_>,
        count: bool,
        ground: &Ground,
        taken: Option<&[TaxelBaseline]>,
    ) -> Change {
        let dt_s = self.last.map_or(0.0, |last| scan.time.seconds_since(last));
        if dt_s < 0.0 {
            return Change::default();
        }
        self.last = Some(scan.time);
        let gap = dt_s > GAP_S;
        let share = if gap { 1.0 } else { exponential_share(dt_s, PADS_S) };
        for ((module, taxels), (pads, silent)) in
            self.modules.iter_mut().zip(&self.taxels).zip(scan.pads.iter().zip(scan.silent))
        {
            let sign = ground.signs().get(taxels.start).map_or(-1.0, |sign| f64::from(*sign));
            if !silent {
                module.feel(*pads, sign, share);
            }
        }
        let Some(taken) = taken else { return Change::default() };
        self.predict_s += dt_s;
        self.tables_s += dt_s;
        if self.predict_s >= PREDICT_S {
            let wandered = WANDER * WANDER * std::mem::take(&mut self.predict_s);
            self.modules.iter_mut().for_each(|module| module.predict(wandered));
            self.describe();
        }
        if gap {
            self.restart();
            self.modules.iter_mut().for_each(|module| module.untouched_s = 0.0);
            return Change::default();
        }
        self.window.push(scan.sound_counts());
        self.window_s += dt_s;
        self.counts &= count;
        let mut change = Change::default();
        if self.window_s >= WINDOW_S {
            let (seen, scans) = (self.window.baseline(), self.window.count());
            if self.counts {
                self.read(&seen, taken, ground);
            }
            change.lighter = lighter(ground.zero(), (&seen, scans), &self.taxels, ground.signs());
            self.restart();
            self.describe();
        }
        change.moves = self.follow();
        change
    }

    /// What the window says of each module that nothing touches.
    fn read(&mut self, seen: &[TaxelBaseline], taken: &[TaxelBaseline], ground: &Ground) {
        let offsets = |(taxels, module): (&Range<usize>, &ModuleOffset)| {
            let mut touched = false;
            let mut offsets = Vec::with_capacity(taxels.len());
            for taxel in taxels.clone() {
                let (Some(zero), Some(seen)) = (taken.get(taxel), seen.get(taxel)) else { continue };
                let moved = f64::from(ground.signs()[taxel]) * (seen.mean - zero.mean);
                if moved.is_finite() && ground.signs()[taxel] != 0 {
                    touched |= moved - module.offset() > TOUCH_SHARE * ground.touched_counts(taxel);
                    offsets.push((moved, zero.noise));
                }
            }
            if touched || offsets.len() < TAXELS_MIN.min(taxels.len()) {
                return None;
            }
            let (seen, noise) = trimmed(offsets);
            Some((seen, noise.hypot(READING_SIGMA)))
        };
        let read: Vec<Option<(f64, f64)>> = self.taxels.iter().zip(&self.modules).map(offsets).collect();
        let heavier_may = self.absorbs(&read);
        for (module, read) in self.modules.iter_mut().zip(&read) {
            module.untouched_s = if read.is_some() { module.untouched_s + WINDOW_S } else { 0.0 };
            if let Some((seen, sigma)) = *read
                && module.untouched_s >= HOLD_OFF_S
                && !module.read(seen, sigma, heavier_may)
            {
                module.untouched_s = 0.0;
            }
        }
        // What the modules have learned is news to those that could not.
        let patch = coefficient_of_all(&self.modules);
        self.modules.iter_mut().for_each(|module| module.hear(patch));
    }

    /// Whether what would be absorbed with these readings is little enough.
    fn absorbs(&self, read: &[Option<(f64, f64)>]) -> bool {
        let after = self.modules.iter().zip(read).map(|(module, read)| {
            module.unexplained(read.map_or(module.offset(), |(seen, sigma)| module.after(seen, sigma)))
        });
        if self.newton_per_count.is_empty() {
            return after.fold(0.0, f64::max) < ABSORBED_MAX_COUNTS;
        }
        after.zip(&self.newton_per_count).map(|(counts, weighs)| counts * weighs).sum::<f64>() < ABSORBED_MAX.0
    }

    /// How much of a load on everything does not show: what may have been absorbed, and by how much the tables lag behind a
    /// skin that has become lighter.
    pub fn hides(&self) -> Newton {
        let behind = self.weighed(|module| (module.followed - module.offset()).max(0.0));
        Newton(behind + self.view.absorbed.0)
    }

    /// Standard uncertainty of what the offsets weigh on the whole skin. Modules have it in common, as warmth is.
    pub fn sigma(&self) -> Newton {
        Newton(self.weighed(|module| module.variance().sqrt()))
    }

    fn weighed(&self, of: impl Fn(&ModuleOffset) -> f64) -> f64 {
        self.modules.iter().zip(&self.newton_per_count).map(|(module, newton)| of(module) * newton).sum()
    }

    /// Whether the tables have to move.
    fn follow(&mut self) -> bool {
        if self.tables_s < TABLES_S {
            return false;
        }
        let follows = self.follows;
        let to = |module: &ModuleOffset| {
            let offset = module.offset();
            if follows { offset.clamp(-BOUND_COUNTS, BOUND_COUNTS) } else { offset.min(0.0) }
        };
        if !self.modules.iter().any(|module| (to(module) - module.followed).abs() >= TABLES_COUNTS) {
            return false;
        }
        self.tables_s = 0.0;
        for module in &mut self.modules {
            module.followed = to(module);
        }
        true
    }

    /// The zero as it was taken, moved by what is followed; `signs` say which way pressure moves the counts.
    pub fn applied_to(&self, zero: &[TaxelBaseline], signs: &[i8]) -> Vec<TaxelBaseline> {
        self.moved(zero, signs, |module| module.followed)
    }

    /// The zero as it was taken, without what has left the skin since.
    pub fn what_stays_of(&self, zero: &[TaxelBaseline], signs: &[i8]) -> Vec<TaxelBaseline> {
        self.moved(zero, signs, ModuleOffset::left)
    }

    fn moved(&self, zero: &[TaxelBaseline], signs: &[i8], by: impl Fn(&ModuleOffset) -> f64) -> Vec<TaxelBaseline> {
        let mut zero = zero.to_vec();
        for (taxels, module) in self.taxels.iter().zip(&self.modules) {
            let signs = signs.get(taxels.clone()).unwrap_or_default();
            for (taxel, sign) in zero.get_mut(taxels.clone()).unwrap_or_default().iter_mut().zip(signs) {
                taxel.mean += f64::from(*sign) * by(module);
            }
        }
        zero
    }

    /// How far the median module's zero has followed, counts towards load.
    pub fn followed_counts(&self) -> f64 {
        median(self.modules.iter().map(|module| module.followed)).unwrap_or(0.0)
    }

    /// Standard uncertainty of the zero, counts, that taxels share: of the modules that are touched, or of all.
    pub fn sigma_counts(&self) -> f64 {
        let of = |held: bool| {
            let these = self.modules.iter().filter(|module| !held || module.untouched_s < HOLD_OFF_S);
            let (sum, n) = these.fold((0.0, 0), |(sum, n), module| {
                (sum + module.variance() + (module.offset() - module.followed).powi(2), n + 1)
            });
            (n > 0).then(|| (sum / f64::from(n)).sqrt())
        };
        of(true).or_else(|| of(false)).unwrap_or(ZERO_SIGMA)
    }

    /// What readers see.
    pub const fn view(&self) -> &DriftView {
        &self.view
    }

    /// Why the force is not what it should be, if the drift is at its bound.
    pub fn shortcoming(&self) -> Option<Reason> {
        let bounded = || self.taxels.iter().zip(&self.modules).filter(|(_, module)| module.is_bounded);
        let target = bounded().map(|(_, module)| module.offset()).reduce(furthest)?;
        let text = format!("drift of {target:+.1} counts reached its bound of {BOUND_COUNTS} counts: tare");
        let taxels = bounded().flat_map(|(taxels, _)| taxels.clone());
        Some(Reason::about(positions(taxels), ReasonCode::DriftBounded, text))
    }

    fn describe(&mut self) {
        if !self.follows {
            return;
        }
        self.view.absorbed = Newton(self.weighed(|module| module.unexplained(module.offset())));
        for module in &mut self.modules {
            // A little below its bound it is free again, so that noise does not make it come and go.
            let at = if module.is_bounded { 0.9 } else { 1.0 };
            module.is_bounded = module.offset().abs() >= at * BOUND_COUNTS;
        }
        self.view.max_counts = self.modules.iter().map(|module| module.followed).fold(0.0, furthest);
        self.view.median_counts = self.followed_counts();
    }
}

const fn furthest(a: f64, b: f64) -> f64 {
    if b.abs() > a.abs() { b } else { a }
}

/// The mean of the inner half of the offsets, with its standard error by the taxels' noise; a window has some 24 conversions.
fn trimmed(mut offsets: Vec<(f64, f64)>) -> (f64, f64) {
    offsets.sort_by(|a, b| a.0.total_cmp(&b.0));
    let cut = offsets.len() / 4;
    let inner = &offsets[cut..offsets.len() - cut];
    let n = inner.len() as f64;
    let noise = inner.iter().map(|(_, noise)| noise).sum::<f64>() / n;
    (inner.iter().map(|(moved, _)| moved).sum::<f64>() / n, 1.1 * noise / (24.0 * n).sqrt())
}

#[cfg(test)]
#[path = "offset_tests.rs"]
mod tests;
