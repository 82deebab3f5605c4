//! The zero follows the skin's temperature: slowly, within a bound, and never a hand.
//!
//! Capacitive skin drifts by up to about a count per kelvin. Other software takes the drift away with a high-pass,
//! which also takes a hand that lies still: within a minute a sustained contact has faded. Nothing here looks at a
//! taxel's own value to move its own zero. What moves the zero of a module is
//!
//! - what its own *thermal pads* say. No load reaches them. How many counts the taxels of this module move per count of
//!   its pads is learned while nothing touches it (`Coefficient`);
//! - the *common mode*: the median over the other untouched modules of the patch, each the median of its taxels. It is
//!   believed only as far as the pads explain it: at most `COEFFICIENT_MAX` counts per count of the pads, and
//!   `UNEXPLAINED_COUNTS` more. So neither a load that creeps in on one module nor one that creeps in on all of them
//!   is taken for drift, and a skin without pads is not followed.
//!
//! Together, for an untouched module: `drift = limited(common) + k (pads - common pads)`. A module that is touched, or
//! lies beside a touched one, is *held*: `drift = drift then + k (pads - pads then)`, and constant while `k` is not
//! known. A taxel counts as touched when its smoothed count is beyond its activation threshold, or has moved by half
//! of that threshold from where it rested before; a silent module counts as touched. A module is untouched again when
//! it has been so for `HOLD_OFF_S`. Without geometry every module lies beside every other.
//!
//! The drift moves by at most a configured rate and up to a configured bound from the proven zero. At the bound it
//! stays, and the force says so. A new zero begins at no drift, with nothing learned. While a session is open nothing
//! is followed.
//!
//! All of it is exponential smoothing that is exact in the time step, `1 - exp(-dt / tau)`. Time comes from scans; one
//! that is not later than the last is ignored; after a gap of more than `GAP_S` every average begins anew and every
//! module is held. Only live force follows drift: a table of counts (`taxeld apply`) has no pads, so nothing is
//! followed there.
//!
//! A scan costs some 20 ns a taxel. The live tables are made anew when a module has moved by a tenth of a count, at
//! most every five seconds; 230 taxels take 3.7 ms (`cargo run --release -p taxel-engine --example drift_time`). On the
//! simulated skin that warms up by 5 K in 20 minutes at boards that compensate half of its drift, a mass of 0.5 kg reads
//! 1 % too much (82 % if nothing is followed), the skin at rest 0.01 N (2.2 N), and a hand that lies still for half an
//! hour at 3 K loses 0.9 % (the scenarios of `drift.rs` print these).
//!
//! What it cannot do: it knows a module's coefficient only while the pads have moved by more than a count and a half
//! since the zero; taxels of a module differ from each other in their drift, and nothing is done about that; a thermal
//! gradient that pads do not see is followed by at most half a count.

mod coefficient;
mod module;
mod others;
mod smooth;
#[cfg(test)]
mod tests;

use std::ops::Range;

use taxel_skin::{ModuleKind, ModuleSite, Time};

use crate::evaluate::Activation;
use crate::io::Now;
use crate::plan::{DriftPlan, PatchPlan};
use crate::rest::TaxelBaseline;
use coefficient::Coefficient;
use module::{ModuleDrift, TaxelDrift};
use others::Others;
use smooth::Shares;

/// Most counts that a taxel can move per count of a pad: the boards compensate a part of its drift, never add to it.
const COEFFICIENT_MAX: f64 = 1.25;
/// Common mode that is believed without the pads, in counts: half of what they can be told apart by.
const UNEXPLAINED_COUNTS: f64 = 0.5;
/// Other untouched modules that a common mode needs.
const OTHERS_MIN: usize = 3;
/// A module learns its coefficient while it is so close to what the others explain, in counts.
const AGREEMENT_COUNTS: f64 = 0.5;
/// Between two looks at the drift, seconds of scans.
const UPDATE_S: f64 = 1.0;
/// A longer time without scans is a gap.
const GAP_S: f64 = 2.0;
/// So long after a touch a module is not followed: fabric creeps back within some ten seconds.
const HOLD_OFF_S: f64 = 30.0;
/// The tables follow in steps of so many counts ...
const TABLES_COUNTS: f64 = 0.1;
/// ... and at most so often, seconds.
const TABLES_S: f64 = 5.0;
/// Uncertainty of a coefficient that is not known: the boards leave a quarter to all of the drift.
const COEFFICIENT_SIGMA: f64 = 0.5;
/// Least uncertainty of a drift, counts: that of the averages it comes from.
const SIGMA_MIN_COUNTS: f64 = 0.05;

/// What is done about drift now.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DriftState {
    /// It is not asked for, or there is no zero.
    #[default]
    Off,
    /// No module follows the others: touched, a session is open, a gap, too few modules, or the zero is too young.
    Held,
    /// Some modules follow, the others are held.
    Following,
    /// It has come to its bound in some module: the zero must be taken again.
    Bounded,
}

/// The drift of a patch as readers see it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriftView {
    /// What is done about it.
    pub state: DriftState,
    /// Since when, nanoseconds since 1970.
    pub since_wall_ns: i64,
    /// Median over the modules of what was added to the zero, counts; falls with warmth where counts fall with load.
    pub median_counts: f64,
    /// That of the module that drifted furthest, counts.
    pub max_counts: f64,
    /// Standard uncertainty of the drift, counts.
    pub sigma_counts: f64,
    /// Modules that follow the others now, and all.
    pub following: (u32, u32),
}

/// One module of a patch, as the drift needs to know it.
#[derive(Clone, Debug)]
pub struct DriftSite {
    /// Its taxels.
    pub taxels: Range<usize>,
    /// What its values are.
    pub kind: ModuleKind,
    /// The modules beside it, itself not among them.
    pub beside: Vec<usize>,
}

/// Follows the drift of one patch.
#[derive(Clone, Debug)]
pub struct Drift {
    plan: DriftPlan,
    activation: Activation,
    taxels: Vec<TaxelDrift>,
    modules: Vec<ModuleDrift>,
    /// Whether there is a zero to follow from.
    zeroed: bool,
    last: Option<Time>,
    /// Scan time since the last look.
    due_s: f64,
    /// Scan time since the tables were made.
    tables_s: f64,
    view: DriftView,
}

/// The modules of a patch, and which lie beside which: those with taxels closer than one contact reaches. Without
/// positions of both, two modules count as beside each other.
#[must_use]
pub fn drift_sites(plan: &PatchPlan) -> Vec<DriftSite> {
    let modules = plan.patch.modules();
    let range =
        |site: &ModuleSite| site.first_taxel as usize..site.first_taxel as usize + site.kind.taxel_slots().len();
    let place = |taxel: usize| plan.geometry.as_ref()?.poses.get(taxel).copied().flatten().map(|pose| pose.position);
    let places: Vec<Vec<[f64; 3]>> = modules.iter().map(|site| range(site).filter_map(place).collect()).collect();
    let near = |a: &[f64; 3], b: &[f64; 3]| {
        (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>() <= plan.live.contact_reach_m.powi(2)
    };
    let beside = |a: usize, b: usize| {
        let (a, b) = (&places[a], &places[b]);
        a.is_empty() || b.is_empty() || a.iter().any(|a| b.iter().any(|b| near(a, b)))
    };
    let site = |(index, site): (usize, &ModuleSite)| DriftSite {
        taxels: range(site),
        kind: site.kind,
        beside: (0..modules.len()).filter(|&other| other != index && beside(index, other)).collect(),
    };
    modules.iter().enumerate().map(site).collect()
}

impl Drift {
    /// Follows nothing until there is a zero.
    #[must_use]
    pub fn new(plan: DriftPlan, activation: Activation, sites: Vec<DriftSite>) -> Self {
        let taxels = sites.iter().map(|site| site.taxels.end).max().unwrap_or(0);
        Self {
            plan,
            activation,
            taxels: vec![TaxelDrift::default(); taxels],
            modules: sites.into_iter().map(ModuleDrift::new).collect(),
            zeroed: false,
            last: None,
            due_s: 0.0,
            tables_s: 0.0,
            view: DriftView::default(),
        }
    }

    /// A zero was taken: no drift from here, and nothing learned. A taxel whose zero is NaN takes no part.
    pub fn begin(&mut self, now: Now, zero: &[TaxelBaseline]) {
        for (taxel, zero) in self.taxels.iter_mut().zip(zero) {
            let distance = (self.activation.sigmas * zero.noise).max(self.activation.floor_counts);
            *taxel = TaxelDrift::new(zero.mean, distance);
        }
        self.modules.iter_mut().for_each(ModuleDrift::begin);
        self.zeroed = true;
        self.last = None;
        (self.due_s, self.tables_s) = (0.0, 0.0);
        self.enter(DriftState::Held, now.wall_ns);
        self.describe(SIGMA_MIN_COUNTS);
    }

    /// There is no zero any more.
    pub fn end(&mut self) {
        self.zeroed = false;
        self.view = DriftView::default();
    }

    /// The scans do not count for now: a session is open.
    pub fn hold(&mut self, now: Now) {
        if self.zeroed && self.last.is_some() {
            self.last = None;
            self.restart();
            self.view.following.0 = 0;
            if self.view.state == DriftState::Following {
                self.enter(DriftState::Held, now.wall_ns);
            }
        }
    }

    /// Takes one scan. `counts` has one entry per taxel, `pads` gives the pads of a module, `None` while it is silent,
    /// and `sound` says whether a taxel is free of faults. Returns whether the zero has moved by so much since it last
    /// did that tables have to be made anew.
    ///
    /// `now.time` is that of the scan; one that is not later than the last is ignored.
    pub fn on_scan(
        &mut self,
        now: Now,
        counts: &[u8],
        pads: impl Fn(usize) -> Option<[u8; 2]>,
        sound: impl Fn(usize) -> bool,
    ) -> bool {
        if !self.zeroed {
            return false;
        }
        let dt = self.last.map_or(0.0, |last| now.time.seconds_since(last));
        if dt < 0.0 || (dt == 0.0 && self.last.is_some()) {
            return false;
        }
        self.last = Some(now.time);
        if dt > GAP_S {
            self.restart();
            return false;
        }
        let shares = Shares::of(dt);
        for (index, module) in self.modules.iter_mut().enumerate() {
            let taxels = &mut self.taxels[module.range()];
            module.take(taxels, counts, pads(index), &sound, &shares);
        }
        for index in 0..self.modules.len() {
            let touched = |module: &ModuleDrift| module.is_touched();
            let near = touched(&self.modules[index])
                || self.modules[index].beside().iter().any(|&other| self.modules.get(other).is_some_and(touched));
            let module = &mut self.modules[index];
            module.rest(&mut self.taxels[module.range()], counts, near, &shares);
        }
        self.due_s += dt;
        self.tables_s += dt;
        if self.due_s >= UPDATE_S {
            let elapsed_s = std::mem::take(&mut self.due_s);
            self.follow(elapsed_s, now.wall_ns);
        }
        let moved = self.modules.iter().any(|m| m.since_tables() >= TABLES_COUNTS);
        if !moved || self.tables_s < TABLES_S {
            return false;
        }
        self.tables_s = 0.0;
        self.modules.iter_mut().for_each(ModuleDrift::note_tables);
        true
    }

    /// The proven zero with the drift added to it.
    #[must_use]
    pub fn applied_to(&self, zero: &[TaxelBaseline]) -> Vec<TaxelBaseline> {
        let mut zero = zero.to_vec();
        for module in &self.modules {
            for taxel in zero.get_mut(module.range()).unwrap_or_default() {
                taxel.mean += module.drift();
            }
        }
        zero
    }

    /// What readers see.
    #[must_use]
    pub const fn view(&self) -> &DriftView {
        &self.view
    }

    /// Why the force is not what it should be, if the drift is at its bound.
    #[must_use]
    pub fn shortcoming(&self) -> Option<String> {
        let furthest = |a: f64, b: f64| if b.abs() > a.abs() { b } else { a };
        let bounded = self.modules.iter().filter(|m| m.is_bounded()).map(ModuleDrift::target);
        let target = bounded.reduce(furthest)?;
        Some(format!("drift of {target:+.1} counts reached its bound of {} counts: tare", self.plan.bound_counts))
    }

    /// Every average begins anew, every module is held.
    fn restart(&mut self) {
        for module in &mut self.modules {
            module.restart(&mut self.taxels[module.range()]);
        }
    }

    /// Moves every module towards where it belongs.
    fn follow(&mut self, elapsed_s: f64, wall_ns: i64) {
        let step_max = self.plan.rate_max_counts_per_min / 60.0 * elapsed_s;
        let quiet: Vec<(usize, f64)> = self.offsets();
        let moved = |&(module, _): &(usize, f64)| Some((module, self.modules[module].pads_moved()?));
        let pads = Others::new(quiet.iter().filter_map(moved).collect());
        let common = Others::new(quiet.clone());
        let mut own = quiet.into_iter().peekable();
        for (index, module) in self.modules.iter_mut().enumerate() {
            let offset = own.next_if(|&(quiet, _)| quiet == index).map(|(_, offset)| offset);
            let others = common.median_without(index, OTHERS_MIN).zip(pads.median_without(index, OTHERS_MIN));
            match offset.zip(others) {
                Some((offset, (common, pads))) => module.follow(offset, common, pads),
                None => module.hold(),
            }
            module.advance(step_max, self.plan.bound_counts);
        }
        let state = match () {
            () if self.modules.iter().any(ModuleDrift::is_bounded) => DriftState::Bounded,
            () if self.modules.iter().any(ModuleDrift::is_following) => DriftState::Following,
            () => DriftState::Held,
        };
        self.enter(state, wall_ns);
        self.describe(self.sigma_counts());
    }

    /// How far each untouched module lies from its zero, counts.
    fn offsets(&self) -> Vec<(usize, f64)> {
        let offset = |(index, module): (usize, &ModuleDrift)| Some((index, module.offset(&self.taxels)?));
        self.modules.iter().enumerate().filter_map(offset).collect()
    }

    /// Standard uncertainty of the drift, counts: how well it fits the modules that follow (1.4826 times the median
    /// deviation, which for normal errors is their standard deviation), and what the pads cannot say of those that are
    /// held, as root mean square over all.
    fn sigma_counts(&self) -> f64 {
        let deviation = |module: &ModuleDrift| Some((module.offset(&self.taxels)? - module.drift()).abs());
        let fit = 1.4826 * others::median(self.modules.iter().filter_map(deviation).collect()).unwrap_or(0.0);
        let held: f64 = self.modules.iter().map(|module| module.held_variance()).sum();
        let held = held / self.modules.len().max(1) as f64;
        (fit.max(SIGMA_MIN_COUNTS).powi(2) + held).sqrt()
    }

    fn enter(&mut self, state: DriftState, wall_ns: i64) {
        if self.view.state != state {
            (self.view.state, self.view.since_wall_ns) = (state, wall_ns);
        }
    }

    fn describe(&mut self, sigma_counts: f64) {
        let drifts: Vec<f64> = self.modules.iter().map(ModuleDrift::drift).collect();
        let furthest = |a: f64, b: f64| if b.abs() > a.abs() { b } else { a };
        self.view.max_counts = drifts.iter().copied().fold(0.0, furthest);
        self.view.median_counts = others::median(drifts).unwrap_or(0.0);
        self.view.sigma_counts = sigma_counts;
        let following = self.modules.iter().filter(|m| m.is_following()).count();
        self.view.following = (following as u32, self.modules.len() as u32);
    }
}
