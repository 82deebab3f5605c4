//! Where each limit of the drift of a patch lies, and what it comes to in figures.

use taxel_skin::{
    Board, BoardAddress, BusIndex, CountRange, Geometry, Module, ModuleKind, Newton, Patch, TaxelPose, Time,
};

use super::coefficient::Coefficient;
use super::common::Common;
use super::others::Others;
use super::smooth::{Shares, Smooth};
use super::*;
use crate::baseline::{Activation, TaxelBaseline};
use crate::counts::Counts;
use crate::now::Now;

fn is_near(is: f64, expected: f64) -> bool {
    (is - expected).abs() < 1e-6
}

/// What is learned from steps to these places: pads and taxels, counts from their zero.
fn learned(places: &[[f64; 2]]) -> Coefficient {
    let mut coefficient = Coefficient::default();
    places.iter().for_each(|[pads, taxels]| coefficient.learn(*pads, *taxels));
    coefficient
}

#[test]
fn a_coefficient_in_figures() {
    let table: [(&[[f64; 2]], f64, f64); 13] = [
        (&[], 0.625, 0.25),
        // Half a count of the pads is a step.
        (&[[0.49, 0.3]], 0.625, 0.25),
        (&[[0.5, 0.3125]], 0.625, 0.076_193),
        (&[[1.0, 0.5]], 0.503_120, 0.039_498),
        (&[[-1.0, -0.5]], 0.503_120, 0.039_498),
        // A step of its own kind is left out, and the next begins where it ended.
        (&[[1.0, 0.5], [2.0, 1.3]], 0.503_120, 0.039_498),
        (&[[1.0, 0.5], [2.0, 1.3], [3.0, 1.8]], 0.500_355, 0.013_315),
        (&[[2.0, 1.0], [1.0, 0.2]], 0.500_795, 0.019_936),
        // What two steps do not agree on is their noise.
        (&[[1.0, 0.4], [2.0, 1.0]], 0.508_569, 0.065_458),
        // It is no more than 1.25, and what boards seldom leave may be all that they do.
        (&[[1.0, 1.27]], 1.25, 0.526_483_7),
        (&[[1.0, 0.17]], 0.181_357_3, 0.084_385_4),
        (&[[1.0, 0.05]], 0.064_352_6, 0.494_404),
        // The first step may be 0.15 counts and twice 0.25 of the pads away from the guess.
        (&[[1.0, 1.28]], 0.625, 0.25),
    ];
    for (places, coefficient, sigma) in table {
        let (is, is_sigma) = learned(places).estimate();
        assert!(is_near(is, coefficient) && is_near(is_sigma, sigma), "{places:?}: {is} +- {is_sigma}");
    }
    assert_eq!(learned(&[[1.49, 0.8]]).value(), None, "pads that moved by less than a count and a half");
    assert_eq!(learned(&[[1.5, 0.8]]).value(), Some(learned(&[[1.5, 0.8]]).estimate()));
    assert!(
        learned(&[[-1.5, -0.8], [-0.5, -0.3]]).value().is_some(),
        "it counts how far they were, not where they are"
    );
}

/// Four modules that have been `common` counts from their zero, with pads at theirs, and that weigh so many newton a count each.
fn common(newton_per_count: f64, seen: &[f64]) -> Common {
    let mut common = Common::default();
    common.weigh(vec![newton_per_count; 4]);
    seen.iter().for_each(|counts| common.look(*counts, 0.0));
    common
}

#[test]
fn how_far_what_the_pads_leave_unexplained_is_followed() {
    // Newton a count of a module, what was seen, and what is followed to both sides. 8 N a count: an eighth of a count.
    let table: [(f64, &[f64], [f64; 2]); 9] = [
        // Where nobody knows the weights half a count is followed, from the least on.
        (0.0, &[0.3, -0.3], [-0.5, 0.2]),
        (-2.0, &[], [-0.125, 0.5]),
        (2.0, &[], [-0.5, 0.125]),
        (-2.0, &[0.3, -0.4], [0.175, 0.5]),
        (2.0, &[0.4, -0.3], [-0.5, -0.175]),
        (-2.0, &[5.0], [0.375, 0.5]),
        (2.0, &[-5.0], [-0.5, -0.375]),
        // A light skin is followed by half a count at most.
        (-0.25, &[], [-0.5, 0.5]),
        (0.25, &[], [-0.5, 0.5]),
    ];
    for (newton_per_count, seen, expected) in table {
        let common = common(newton_per_count, seen);
        let most = [-9.0, 9.0].map(|counts| common.allowed(counts, 0.0));
        assert!(
            most.iter().zip(expected).all(|(is, to)| is_near(is.counts, to)),
            "{newton_per_count} {seen:?}: {most:?}"
        );
        // What the pads explain comes on top: 0.625 counts per count of theirs.
        let most = [-9.0, 9.0].map(|counts| common.allowed(counts, -2.0));
        assert!(most.iter().zip(expected).all(|(is, to)| is_near(is.counts, to - 1.25)), "{most:?}");
        assert!(most.iter().zip(expected).all(|(is, to)| is_near(is.unexplained, to)), "{most:?}");
    }
    let mut common = common(-2.0, &[0.3]);
    [-1.0, 1.0].into_iter().for_each(|pads| common.look(0.625 * pads, pads));
    assert!(is_near(common.allowed(-9.0, 0.0).counts, 0.175), "what the pads explain was not unexplained");
    common.begin();
    assert!(is_near(common.allowed(-9.0, 0.0).counts, -0.125), "with a new zero only the weights are known");
}

#[test]
fn how_much_of_a_load_may_have_been_absorbed() {
    let absorbed = |newton_per_count: f64, seen: &[f64], unexplained: [f64; 4]| {
        common(newton_per_count, seen).absorbed(unexplained.into_iter()).0
    };
    assert!(is_near(absorbed(-2.0, &[0.3, -0.1], [0.1, 0.2, 0.3, 0.3]), 0.6));
    assert!(is_near(absorbed(2.0, &[-0.3, 0.1], [-0.1, -0.2, -0.3, -0.3]), 0.6));
    assert!(is_near(absorbed(-2.0, &[0.1], [0.5; 4]), 0.0), "further away from load is none");
    assert!(is_near(absorbed(0.0, &[0.3], [-0.5; 4]), 0.0));
}

#[test]
fn the_uncertainty_of_what_is_followed_is_that_of_the_absorbed_force_and_of_the_coefficient() {
    for newton_per_count in [-2.0, 2.0] {
        let mut common = common(newton_per_count, &[]);
        assert!(is_near(common.sigma_counts(Newton(0.8), 0.0), 0.1 / 3.0_f64.sqrt()));
        common.look(0.0, 0.4);
        assert!(is_near(common.sigma_counts(Newton(0.8), 0.0), (0.01_f64 / 3.0 + 0.01).sqrt()));
    }
    let mut unknown = common(0.0, &[]);
    unknown.look(0.0, -0.4);
    assert!(is_near(unknown.sigma_counts(Newton(0.8), 0.0), 0.1));
}

/// Pads that have moved by 2 counts explain 1.25 with an uncertainty of 0.5, and what is not followed of that is uncertain, too.
#[test]
fn what_the_pads_say_has_come_and_is_not_followed_yet_is_uncertain() {
    for sign in [1.0, -1.0] {
        let mut common = common(0.0, &[]);
        common.feel(2.0 * sign);
        for (followed, behind) in [(0.0, 1.25), (0.25, 1.0), (1.25, 0.0), (1.5, 0.25)] {
            assert!(is_near(common.sigma_counts(Newton(0.0), sign * followed), 0.5_f64.hypot(behind)), "{followed}");
        }
        common.begin();
        assert_eq!(common.sigma_counts(Newton(0.0), 0.0), 0.0, "a new zero");
    }
}

#[test]
fn a_median_needs_as_many_as_are_asked_for() {
    let others = Others::new(vec![(0, 5.0), (1, 1.0), (2, 2.0)]);
    assert_eq!([3, 4].map(|least| others.median(least)), [Some(2.0), None]);
    assert_eq!([2, 3].map(|least| others.median_without(2, least)), [Some(3.0), None]);
    assert_eq!(others.median_without(7, 3), Some(2.0));
    assert_eq!(Others::new(Vec::new()).median(0), None);
}

#[test]
fn a_mean_weighs_what_came_by_its_shares() {
    let shares = Shares::of(0.5);
    assert!(is_near(shares.dt_s, 0.5) && is_near(shares.fast, 0.632_121) && is_near(shares.slow, 0.048_771));
    let mut mean = Smooth::default();
    assert!(mean.is_empty() && mean.mean(0.01).is_none());
    mean.push(9.0, 0.0);
    assert!(mean.is_empty());
    mean.push(3.0, 0.5);
    assert_eq!((mean.is_empty(), mean.mean(0.5), mean.mean(0.51)), (false, Some(3.0), None));
    mean.push(5.0, 0.5);
    assert!(is_near(mean.mean(0.75).unwrap(), 13.0 / 3.0) && mean.mean(0.76).is_none(), "{mean:?}");
    mean.restart();
    assert!(mean.is_empty());
}

#[test]
fn modules_are_beside_each_other_where_taxels_are_near_or_nobody_knows() {
    let board = |address: u8, modules: &[u8]| Board {
        bus: BusIndex(0),
        address: BoardAddress::new(address).unwrap(),
        modules: modules.iter().map(|m| (Module::from_nibble(*m), ModuleKind::Triangle)).collect(),
    };
    let patch = Patch::new("p", vec![board(12, &[0, 1]), board(13, &[0, 1])]).unwrap();
    // The taxels of a module in a row, a tenth of a metre from those of the next but for the nearest two; the last has no place.
    let place = |taxel: usize| match taxel / 10 {
        0 => Some([0.001 * taxel as f64, 0.0, 0.0]),
        1 => Some([0.009, 0.003, if taxel == 14 { 0.004 } else { 0.1 }]),
        2 => Some([0.009, 0.003, if taxel == 25 { 0.1051 } else { 0.2 }]),
        _ => None,
    };
    let pose = |position: [f64; 3]| TaxelPose { position, normal: [0.0, 0.0, 1.0] };
    let geometry = Geometry::from_poses((0..40).map(|t| place(t).map(pose)).collect());
    let beside = |reach_m: f64| -> Vec<Vec<usize>> {
        drift_sites(&patch, Some(&geometry), reach_m).into_iter().map(|site| site.beside).collect()
    };
    assert_eq!(beside(0.004_99), [vec![3], vec![3], vec![3], vec![0, 1, 2]]);
    assert_eq!(beside(0.005_01), [vec![1, 3], vec![0, 3], vec![3], vec![0, 1, 2]]);
    assert_eq!(beside(0.005_11), [vec![1, 3], vec![0, 2, 3], vec![1, 3], vec![0, 1, 2]]);
    let nowhere = drift_sites(&patch, None, 0.01);
    let ranges: Vec<_> = nowhere.iter().map(|site| site.taxels.clone()).collect();
    assert_eq!(ranges, [0..10, 10..20, 20..30, 30..40]);
    assert_eq!(nowhere[1].beside, [0, 2, 3]);
}

/// Modules without noise, none beside another, that are scanned twice a second at 200 counts and at 230 of their pads.
struct Still {
    drift: Drift,
    zero: Vec<TaxelBaseline>,
    half_seconds: i64,
    /// After how many half seconds tables were to be made.
    tables: Vec<i64>,
}

impl Still {
    fn new(modules: usize, plan: DriftPlan) -> Self {
        let site = |m: usize| DriftSite { taxels: 10 * m..10 * m + 10, kind: ModuleKind::Triangle, beside: Vec::new() };
        let activation = Activation { sigmas: 4.0, floor_counts: 2.0 };
        let zero = vec![TaxelBaseline { mean: 200.0, noise: 1.0 }; 10 * modules];
        let mut drift = Drift::new(plan, activation, (0..modules).map(site).collect());
        drift.begin(Now { time: Time::from_nanos(0), wall_ns: 0 }, &zero, &[]);
        Self { drift, zero, half_seconds: 0, tables: Vec::new() }
    }

    fn plan(rate_max_counts_per_min: f64) -> DriftPlan {
        DriftPlan { follow: true, rate_max_counts_per_min, ..DriftPlan::default() }
    }

    fn scan(&mut self, step: i64, away: impl Fn(usize) -> f64, pads: u8) {
        self.half_seconds += step;
        let range = CountRange::to(65_535).unwrap();
        let words: Vec<u16> = (0..self.zero.len()).map(|t| range.nearest(200.0 + away(t / 10))).collect();
        let now =
            Now { time: Time::from_nanos(500_000_000 * self.half_seconds), wall_ns: 500_000_000 * self.half_seconds };
        if self.drift.on_scan(now, Counts::Words(&words, range), |_| Some([pads; 2]), |_| true) {
            self.tables.push(self.half_seconds);
        }
    }

    fn seconds(&mut self, seconds: i64, away: impl Fn(usize) -> f64 + Copy, pads: u8) {
        (0..2 * seconds).for_each(|_| self.scan(1, away, pads));
    }

    fn drifts(&self) -> Vec<f64> {
        self.drift.applied_to(&self.zero).iter().step_by(10).map(|taxel| taxel.mean - 200.0).collect()
    }

    fn all_at(&self, counts: f64) -> bool {
        self.drifts().iter().all(|drift| is_near(*drift, counts))
    }
}

/// The slow means are followed after 23 s, looked at every second, and the tables are made at most every 5 s.
#[test]
fn how_fast_what_rests_is_followed() {
    let mut skin = Still::new(4, Still::plan(1.1));
    skin.scan(1, |_| -0.5, 230);
    for (seconds, counts) in [(23, 0.0), (1, -1.1 / 60.0), (6, -7.7 / 60.0), (10, -18.7 / 60.0), (30, -0.5)] {
        skin.seconds(seconds, |_| -0.5, 230);
        assert!(skin.all_at(counts), "{:?}", skin.drifts());
    }
    assert_eq!(skin.tables, [59, 71, 83, 95], "after six seconds each, in which it moves by 0.11 counts");
    assert_eq!(skin.drift.view().since_wall_ns, 24_500_000_000, "the first look at what rests");
    let mut skin = Still::new(4, Still::plan(6.6));
    skin.scan(1, |_| -0.5, 230);
    skin.seconds(40, |_| -0.5, 230);
    assert_eq!(skin.tables, [49, 59], "it moves by 0.11 counts a second");
    // However long a look has to wait for its scan.
    let mut skin = Still::new(4, Still::plan(6.6));
    skin.scan(1, |_| -0.5, 230);
    for (scans, counts) in [(11, 0.0), (1, -0.22), (1, -0.44)] {
        (0..scans).for_each(|_| skin.scan(4, |_| -0.5, 230));
        assert!(skin.all_at(counts), "{:?}", skin.drifts());
    }
}

#[test]
fn nothing_is_followed_without_a_zero_and_a_session_before_the_first_scan_changes_nothing() {
    let mut skin = Still::new(4, Still::plan(60.0));
    skin.drift.hold(Now { time: Time::from_nanos(0), wall_ns: 0 }, |_| Some([230; 2]));
    skin.scan(1, |_| -0.5, 230);
    skin.seconds(24, |_| -0.5, 230);
    assert!(skin.all_at(-0.5), "{:?}", skin.drifts());
    skin.drift.end();
    assert_eq!(*skin.drift.view(), DriftView::default());
    skin.seconds(30, |_| -0.25, 230);
    assert!(*skin.drift.view() == DriftView::default() && skin.all_at(-0.5), "{:?}", skin.drifts());
}

#[test]
fn a_module_follows_three_others_at_least() {
    for (modules, following) in [(3, 0), (4, 4)] {
        let mut skin = Still::new(modules, Still::plan(60.0));
        skin.scan(1, |_| -0.5, 230);
        skin.seconds(30, |_| -0.5, 230);
        assert_eq!(skin.drift.view().following, (following, modules as u32));
        assert!(skin.all_at(if following == 0 { 0.0 } else { -0.5 }));
    }
}

/// 1.4826 times the median of how far the modules lie from what is followed, a twentieth of a count at least.
#[test]
fn the_uncertainty_is_how_well_the_drift_fits() {
    let mut skin = Still::new(5, Still::plan(60.0));
    let away = |module: usize| [-0.75, -0.5, -0.25, 0.0, 0.25][module];
    skin.scan(1, away, 230);
    skin.seconds(60, away, 230);
    // The median of the other four of each.
    let expected = [-0.125, -0.125, -0.25, -0.375, -0.375];
    assert!(skin.drifts().iter().zip(expected).all(|(is, to)| is_near(*is, to)), "{:?}", skin.drifts());
    let view = skin.drift.view();
    assert!(is_near(view.sigma_counts, 1.4826 * 0.375), "{view:?}");
    assert!(is_near(view.median_counts, -0.25) && is_near(view.max_counts, -0.375), "{view:?}");
    let mut skin = Still::new(5, Still::plan(60.0));
    skin.scan(1, |_| -0.25, 230);
    skin.seconds(60, |_| -0.25, 230);
    assert!(is_near(skin.drift.view().sigma_counts, 0.05), "{:?}", skin.drift.view());
}

/// A module that is touched knows nothing of its own pads: half a count per count of theirs, over all five modules. That is
/// more than the two counts times 0.0199 that are uncertain of what the pads explain to the others.
#[test]
fn what_the_pads_cannot_say_of_a_held_module_is_uncertain() {
    let mut skin = Still::new(5, Still::plan(60.0));
    let away = |warm: f64| move |module: usize| if module == 0 { 30.0 } else { warm };
    skin.scan(1, away(0.0), 230);
    skin.seconds(30, away(0.0), 230);
    skin.scan(6, away(1.25), 232);
    skin.seconds(60, away(1.25), 232);
    let view = skin.drift.view();
    assert!(view.following == (4, 5) && is_near(view.median_counts, 1.25), "{view:?}, {:?}", skin.drifts());
    // It stays, and may have moved with the others, by two counts of the pads, give or take a quarter of a count for each.
    let sigma = 0.05_f64.hypot(2.0 * 0.625_f64.hypot(0.25));
    assert!((view.sigma_counts - sigma).abs() < 1e-3, "{view:?}, not {sigma}");
}

/// The force is that of what is touched, and so is its uncertainty.
#[test]
fn what_the_pads_cannot_say_of_a_held_module_is_as_uncertain_beside_many_others() {
    let sigma = |modules: usize| {
        let mut skin = Still::new(modules, Still::plan(60.0));
        let away = |warm: f64| move |module: usize| if module == 0 { 30.0 } else { warm };
        skin.scan(1, away(0.0), 230);
        skin.seconds(30, away(0.0), 230);
        skin.scan(6, away(1.25), 232);
        skin.seconds(60, away(1.25), 232);
        skin.drift.view().sigma_counts
    };
    assert!(is_near(sigma(5), sigma(100)) && sigma(100) > 1.25, "{} and {}", sigma(5), sigma(100));
}

#[test]
fn a_scan_counts_if_it_is_later_and_no_more_than_two_seconds() {
    let mut skin = Still::new(4, Still::plan(60.0));
    skin.scan(1, |_| -0.5, 230);
    skin.seconds(30, |_| -0.5, 230);
    assert!(skin.all_at(-0.5));
    for step in [0, -9] {
        let before = *skin.drift.view();
        (0..100).for_each(|_| skin.scan(step, |_| -3.0, 230));
        skin.half_seconds -= 100 * step;
        assert_eq!(*skin.drift.view(), before);
    }
    (0..9).for_each(|_| skin.scan(4, |_| -0.5, 230));
    skin.seconds(1, |_| -0.5, 230);
    assert_eq!(skin.drift.view().following, (4, 4), "two seconds are no gap");
    skin.scan(5, |_| -0.5, 230);
    skin.seconds(1, |_| -0.5, 230);
    assert_eq!((skin.drift.view().following, skin.drift.view().state), ((0, 4), DriftState::Held));
    skin.seconds(60, |_| -0.5, 230);
    let before = skin.drift.view().since_wall_ns;
    let later = |ns: i64| Time::from_nanos(500_000_000 * skin.half_seconds + ns);
    let now = Now { time: later(1), wall_ns: before + 1 };
    skin.drift.hold(now, |_| Some([230; 2]));
    assert_eq!((skin.drift.view().following, skin.drift.view().since_wall_ns), ((0, 4), before + 1));
    skin.drift.hold(Now { time: later(2), wall_ns: before + 2 }, |_| Some([230; 2]));
    assert_eq!(skin.drift.view().since_wall_ns, before + 1);
}

/// Three counts of the pads explain 1.875, of which nothing is followed, with an uncertainty of 0.75.
#[test]
fn while_a_session_is_open_what_the_pads_say_is_looked_at_once_a_second() {
    let mut skin = Still::new(4, Still::plan(60.0));
    let at = |half_seconds: i64| Now { time: Time::from_nanos(500_000_000 * half_seconds), wall_ns: 0 };
    skin.drift.begin(at(0), &skin.zero.clone(), &[[Some(230.0); 2]; 4]);
    let cold = 0.05_f64.hypot(0.75).hypot(1.875);
    for (half_seconds, sigma) in [(1, 0.05), (2, 0.05), (3, cold), (4, cold)] {
        skin.drift.hold(at(half_seconds), |_| Some([227; 2]));
        assert!(is_near(skin.drift.view().sigma_counts, sigma), "{half_seconds}: {:?}", skin.drift.view());
    }
    assert_eq!(skin.drift.view().state, DriftState::Held);
    skin.drift.hold(at(5), |_| None);
    skin.drift.hold(at(7), |_| None);
    assert!(is_near(skin.drift.view().sigma_counts, cold), "what was last heard: {:?}", skin.drift.view());
    assert!(skin.all_at(0.0), "nothing is followed");
}

/// The target of the module that is furthest from its zero is told, of those at the bound.
#[test]
fn what_is_said_at_the_bound_is_the_furthest_target() {
    for sign in [1.0, -1.0] {
        let plan = DriftPlan { bound_counts: 0.125, ..Still::plan(60.0) };
        let mut skin = Still::new(5, plan);
        // The first head for 0.2 counts, the last for 0.28.
        let away = |module: usize| sign * [0.4, 0.32, 0.24, 0.16, 0.08][module];
        skin.scan(1, away, 230);
        skin.seconds(30, away, 230);
        let reason = skin.drift.shortcoming().expect("at its bound");
        let sign = if sign > 0.0 { '+' } else { '-' };
        assert_eq!(reason.text(), format!("drift of {sign}0.3 counts reached its bound of 0.125 counts: tare"));
    }
}

#[test]
fn a_zero_that_lies_elsewhere_is_no_drift() {
    let mut skin = Still::new(4, Still::plan(60.0));
    skin.drift.rebase(&[TaxelBaseline { mean: 199.5, noise: 1.0 }; 40]);
    skin.scan(1, |_| -0.5, 230);
    skin.seconds(30, |_| -0.5, 230);
    assert!(skin.all_at(0.0), "{:?}", skin.drifts());
}

/// Half of the patch weighs 3 N a count, half 1 N: 1 N in all may be absorbed, which is an eighth of a count.
#[test]
fn what_is_absorbed_is_the_sum_over_the_modules() {
    let mut skin = Still::new(4, Still::plan(60.0));
    let weights: Vec<f64> = (0..40).map(|taxel| if taxel < 20 { -0.3 } else { -0.1 }).collect();
    skin.drift.weigh(&weights);
    skin.scan(1, |_| -0.5, 230);
    skin.seconds(30, |_| -0.5, 230);
    let view = *skin.drift.view();
    assert!(skin.all_at(-0.125) && is_near(view.absorbed.0, 1.0), "{:?}, {view:?}", skin.drifts());
    let fit = 1.4826 * 0.375;
    assert!(is_near(view.sigma_counts, (fit * fit + 0.125 * 0.125 / 3.0_f64).sqrt()), "{view:?}");
    // A new zero absorbed nothing.
    skin.drift.begin(Now { time: Time::from_nanos(0), wall_ns: 0 }, &skin.zero.clone(), &[]);
    assert_eq!((skin.drift.view().absorbed.0, skin.drift.view().sigma_counts), (0.0, 0.05));
}
