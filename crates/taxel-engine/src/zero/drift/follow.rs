//! The drift of a whole patch, scan by scan.

use taxel_skin::{Newton, Time};

use super::common::Common;
use super::module::{ModuleDrift, TaxelDrift};
use super::others::Others;
use super::plan::DriftPlan;
use super::site::DriftSite;
use super::smooth::Shares;
use super::view::{DriftState, DriftView};
use crate::baseline::{Activation, TaxelBaseline};
use crate::counts::Counts;
use crate::force::reason::{Reason, ReasonCode, positions};
use crate::now::Now;
use crate::statistics::{MEDIAN_DEVIATIONS, median};

/// Other untouched modules that a common mode needs.
const OTHERS_MIN: usize = 3;
/// Between two looks at the drift, seconds of scans.
const UPDATE_S: f64 = 1.0;
/// A longer time without scans is a gap.
pub(super) const GAP_S: f64 = 2.0;
/// The tables follow in steps of so many counts ...
const TABLES_COUNTS: f64 = 0.1;
/// ... and at most so often, seconds.
const TABLES_S: f64 = 5.0;
/// Least uncertainty of a drift, counts: that of the averages it comes from.
const SIGMA_MIN_COUNTS: f64 = 0.05;

/// Follows the drift of one patch.
#[derive(Clone, Debug)]
pub struct Drift {
    plan: DriftPlan,
    activation: Activation,
    taxels: Vec<TaxelDrift>,
    modules: Vec<ModuleDrift>,
    common: Common,
    /// Whether there is a zero to follow from.
    zeroed: bool,
    /// Whether the counts do not count for now.
    held: bool,
    last: Option<Time>,
    /// Scan time since the last look.
    due_s: f64,
    /// Scan time since the tables were made.
    tables_s: f64,
    view: DriftView,
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
            common: Common::default(),
            zeroed: false,
            held: false,
            last: None,
            due_s: 0.0,
            tables_s: 0.0,
            view: DriftView::default(),
        }
    }

    /// A zero was taken: no drift from here, and nothing learned. A taxel whose zero is NaN takes no part. `pads` are the means
    /// of each module's pads while it was taken, counts; empty where nobody knows.
    pub fn begin(&mut self, now: Now, zero: &[TaxelBaseline], pads: &[[Option<f64>; 2]]) {
        for (taxel, zero) in self.taxels.iter_mut().zip(zero) {
            let distance = self.activation.distance_counts(zero.noise);
            *taxel = TaxelDrift::new(zero.mean, distance);
        }
        for (index, module) in self.modules.iter_mut().enumerate() {
            module.begin(pads.get(index).copied().unwrap_or_default());
        }
        self.common.begin();
        (self.zeroed, self.held) = (true, false);
        self.last = None;
        (self.due_s, self.tables_s) = (0.0, 0.0);
        self.enter(DriftState::Held, now.wall_ns);
        self.view.absorbed = Newton(0.0);
        self.describe(SIGMA_MIN_COUNTS);
    }

    /// How much a count more of each taxel weighs, N, negative where counts fall with load; empty while nobody knows.
    pub fn weigh(&mut self, newton_per_count: &[f64]) {
        let of = |module: &ModuleDrift| newton_per_count.get(module.range()).map(|taxels| taxels.iter().sum());
        self.common.weigh(self.modules.iter().filter_map(of).collect());
    }

    /// The zero was found to lie elsewhere, for a reason that is not drift.
    pub fn rebase(&mut self, zero: &[TaxelBaseline]) {
        for (taxel, zero) in self.taxels.iter_mut().zip(zero) {
            taxel.rebase(zero.mean);
        }
    }

    /// There is no zero any more.
    pub fn end(&mut self) {
        self.zeroed = false;
        self.view = DriftView::default();
    }

    /// Takes one scan whose counts do not count: a session is open, or the zero is in doubt. What the pads say meanwhile is
    /// in the uncertainty. Time and pads are those of [`Drift::on_scan`].
    pub fn hold(&mut self, now: Now, pads: impl Fn(usize) -> Option<[u8; 2]>) {
        let first = self.last.is_none();
        let Some(dt) = self.passed_s(now.time) else { return };
        if !std::mem::replace(&mut self.held, true) && !first {
            self.restart();
            self.view.following.0 = 0;
            if self.view.state == DriftState::Following {
                self.enter(DriftState::Held, now.wall_ns);
            }
        }
        let shares = Shares::of(dt);
        for (index, module) in self.modules.iter_mut().enumerate() {
            match pads(index) {
                Some(pads) => module.feel(pads, &shares),
                None => module.lose_pads(),
            }
        }
        self.due_s += dt;
        if self.due_s >= UPDATE_S {
            self.due_s = 0.0;
            self.feel();
            self.describe(self.sigma_counts());
        }
    }

    /// The time since the last scan, s, 0 for the first; `None` without a zero and for a scan that is not later than the
    /// last. After a gap every average begins anew, and nothing of the scan counts.
    fn passed_s(&mut self, time: Time) -> Option<f64> {
        if !self.zeroed {
            return None;
        }
        let dt = self.last.map_or(0.0, |last| time.seconds_since(last));
        if dt < 0.0 || (dt == 0.0 && self.last.is_some()) {
            return None;
        }
        self.last = Some(time);
        if dt > GAP_S {
            self.restart();
            return None;
        }
        Some(dt)
    }

    /// What the pads of all modules say now.
    fn feel(&mut self) {
        if let Some(pads) = median(self.modules.iter().filter_map(ModuleDrift::pads_now)) {
            self.common.feel(pads);
        }
    }

    /// Takes one scan. `counts` has one entry per taxel, `pads` gives the pads of a module, `None` while it is silent,
    /// and `sound` says whether a taxel is free of faults. Returns whether the zero has moved by so much since it last
    /// did that tables have to be made anew.
    ///
    /// `now.time` is that of the scan; one that is not later than the last is ignored.
    pub fn on_scan<'a>(
        &mut self,
        now: Now,
        counts: impl Into<Counts<'a>>,
        pads: impl Fn(usize) -> Option<[u8; 2]>,
        sound: impl Fn(usize) -> bool,
    ) -> bool {
        let Some(dt) = self.passed_s(now.time) else { return false };
        self.held = false;
        let (shares, counts) = (Shares::of(dt), counts.into());
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
    pub fn shortcoming(&self) -> Option<Reason> {
        let furthest = |a: f64, b: f64| if b.abs() > a.abs() { b } else { a };
        let bounded = || self.modules.iter().filter(|m| m.is_bounded());
        let target = bounded().map(ModuleDrift::target).reduce(furthest)?;
        let text = format!("drift of {target:+.1} counts reached its bound of {} counts: tare", self.plan.bound_counts);
        Some(Reason::about(positions(bounded().flat_map(ModuleDrift::range)), ReasonCode::DriftBounded, text))
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
        self.feel();
        let quiet: Vec<(usize, f64)> = self.offsets();
        let moved = |&(module, _): &(usize, f64)| Some((module, self.modules[module].pads_moved()?));
        let pads = Others::new(quiet.iter().filter_map(moved).collect());
        let common = Others::new(quiet.clone());
        if let Some((common, pads)) = common.median(OTHERS_MIN).zip(pads.median(OTHERS_MIN)) {
            self.common.look(common, pads);
        }
        let warming = self.common.warming();
        let mut own = quiet.into_iter().peekable();
        for (index, module) in self.modules.iter_mut().enumerate() {
            let offset = own.next_if(|&(quiet, _)| quiet == index).map(|(_, offset)| offset);
            let others = common.median_without(index, OTHERS_MIN).zip(pads.median_without(index, OTHERS_MIN));
            match offset.zip(others) {
                Some((offset, (common, pads))) => module.follow(offset, self.common.allowed(common, pads), pads),
                None => module.hold(&warming),
            }
            module.advance(step_max, self.plan.bound_counts);
        }
        let state = match () {
            () if self.modules.iter().any(ModuleDrift::is_bounded) => DriftState::Bounded,
            () if self.modules.iter().any(ModuleDrift::is_following) => DriftState::Following,
            () => DriftState::Held,
        };
        self.enter(state, wall_ns);
        self.view.absorbed = self.common.absorbed(self.modules.iter().map(ModuleDrift::unexplained));
        self.describe(self.sigma_counts());
    }

    /// How far each untouched module lies from its zero, counts.
    fn offsets(&self) -> Vec<(usize, f64)> {
        let offset = |(index, module): (usize, &ModuleDrift)| Some((index, module.offset(&self.taxels)?));
        self.modules.iter().enumerate().filter_map(offset).collect()
    }

    /// Standard uncertainty of the drift, counts: how well it fits the modules that follow (1.4826 times the median
    /// deviation, which for normal errors is their standard deviation), and what the pads cannot say of the module that is held
    /// and of which they say least, or what all have in common that may be no drift or is not followed yet, whichever is more:
    /// it is the same warmth. What is held is what is touched, and the force is made of that, however many modules rest.
    fn sigma_counts(&self) -> f64 {
        let deviation = |module: &ModuleDrift| Some((module.offset(&self.taxels)? - module.drift()).abs());
        let fit = MEDIAN_DEVIATIONS * median(self.modules.iter().filter_map(deviation)).unwrap_or(0.0);
        let warming = self.common.warming();
        let held = self.modules.iter().map(|module| module.held_sigma(&warming)).fold(0.0, f64::max);
        let explained = median(self.modules.iter().map(|m| m.drift() - m.unexplained())).unwrap_or(0.0);
        let common = self.common.sigma_counts(self.view.absorbed, explained);
        fit.max(SIGMA_MIN_COUNTS).hypot(common.max(held))
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
        self.view.median_counts = median(drifts).unwrap_or(0.0);
        self.view.sigma_counts = sigma_counts;
        let following = self.modules.iter().filter(|m| m.is_following()).count();
        self.view.following = (following as u32, self.modules.len() as u32);
    }
}
