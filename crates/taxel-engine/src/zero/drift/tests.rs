use proptest::prelude::*;
use taxel_skin::{ModuleKind, Time};

use super::follow::GAP_S;
use super::limits::{ABSORBED_MAX, UNEXPLAINED_COUNTS};
use super::others::Others;
use super::smooth::Shares;
use super::*;
use crate::baseline::{Activation, TaxelBaseline};
use crate::now::Now;
use crate::zero::rest::tests::Noise;

const MODULES: usize = 8;
const SCAN_NS: i64 = 100_000_000;
const MINUTE: f64 = 60.0;

/// Modules in a row, each beside the next, ten taxels and two pads of 0.4 counts of noise each.
struct Skin {
    drift: Drift,
    noise: Noise,
    now: Now,
    zero: Vec<TaxelBaseline>,
    kind: ModuleKind,
    moved: usize,
}

fn sites(kind: ModuleKind) -> Vec<DriftSite> {
    let taxels = kind.taxel_slots().len();
    let site = |m: usize| DriftSite {
        taxels: taxels * m..taxels * (m + 1),
        kind,
        beside: [m.wrapping_sub(1), m + 1].into_iter().filter(|&other| other < MODULES).collect(),
    };
    (0..MODULES).map(site).collect()
}

impl Skin {
    fn new() -> Self {
        Self::of(ModuleKind::Triangle, DriftPlan { follow: true, ..DriftPlan::default() })
    }

    fn of(kind: ModuleKind, plan: DriftPlan) -> Self {
        let activation = Activation { sigmas: 4.0, floor_counts: 2.0 };
        let zero = |t: usize| TaxelBaseline { mean: 200.0 + 0.37 * (t % 7) as f64, noise: 0.9 };
        let zero: Vec<_> = (0..MODULES * kind.taxel_slots().len()).map(zero).collect();
        let mut drift = Drift::new(plan, activation, sites(kind));
        let now = Now { time: Time::from_nanos(1_000), wall_ns: 1_000_000_000 };
        drift.begin(now, &zero, &[]);
        Self { drift, noise: Noise(7), now, zero, kind, moved: 0 }
    }

    /// Scans for so long; `taxel(taxel, s)` and `pad(module, s)` are how far they are from their zero after `s` seconds.
    fn run(&mut self, seconds: f64, taxel: impl Fn(usize, f64) -> f64, pad: impl Fn(usize, f64) -> f64) {
        for scan in 0..(seconds * 10.0) as u64 {
            let s = scan as f64 / 10.0;
            let counts: Vec<u8> = (0..self.zero.len())
                .map(|t| (self.zero[t].mean + taxel(t, s) + 0.9 * self.noise.normal()).round() as u8)
                .collect();
            let pads: Vec<[u8; 2]> = (0..MODULES)
                .map(|m| [0; 2].map(|_: u8| (230.0 + pad(m, s) + 0.4 * self.noise.normal()).round() as u8))
                .collect();
            self.now.time = Time::from_nanos(self.now.time.as_nanos() + SCAN_NS);
            self.now.wall_ns += SCAN_NS;
            self.moved += usize::from(self.drift.on_scan(self.now, &counts, |m| Some(pads[m]), |_| true));
        }
    }

    /// The drift of each module, counts.
    fn drifts(&self) -> Vec<f64> {
        let taxels = self.kind.taxel_slots().len();
        let now = self.drift.applied_to(&self.zero);
        (0..MODULES).map(|m| now[m * taxels].mean - self.zero[m * taxels].mean).collect()
    }

    fn furthest_from(&self, expected: f64) -> f64 {
        self.drifts().into_iter().map(|d| (d - expected).abs()).fold(0.0, f64::max)
    }
}

fn module_of(taxel: usize) -> usize {
    taxel / 10
}

#[test]
fn a_warming_skin_is_followed_and_said_so() {
    let mut skin = Skin::new();
    // 8 counts on the pads, of which the boards leave a quarter on the taxels, some more and some less.
    let own = |t: usize| 1.0 + 0.3 * ((t % 5) as f64 - 2.0) / 2.0;
    skin.run(20.0 * MINUTE, |t, s| -2.0 * own(t) * s / (20.0 * MINUTE), |_, s| -8.0 * s / (20.0 * MINUTE));
    assert!(skin.furthest_from(-2.0) < 0.15, "{:?}", skin.drifts());
    let view = *skin.drift.view();
    assert_eq!((view.state, view.following), (DriftState::Following, (8, 8)));
    assert!((view.median_counts + 2.0).abs() < 0.15 && view.max_counts <= view.median_counts, "{view:?}");
    assert!(view.sigma_counts < 0.15, "{view:?}");
    assert!((20_000_000_000..60_000_000_000).contains(&view.since_wall_ns), "since the averages rest: {view:?}");
    assert!((15..40).contains(&skin.moved), "tables were made {} times for 2 counts", skin.moved);
    assert_eq!(skin.drift.shortcoming(), None);
}

#[test]
fn a_load_that_creeps_in_on_one_module_is_not_followed() {
    let mut skin = Skin::new();
    let load = |t: usize, s: f64| if module_of(t) == 3 { -2.0 * (s / (10.0 * MINUTE)).min(1.0) } else { 0.0 };
    skin.run(20.0 * MINUTE, load, |_, _| 0.0);
    assert!(skin.furthest_from(0.0) < 0.1, "{:?}", skin.drifts());
    skin.run(2.0 * MINUTE, |_, _| 0.0, |_, _| 0.0);
    assert!(skin.furthest_from(0.0) < 0.1, "{:?}", skin.drifts());
}

#[test]
fn a_load_that_creeps_in_while_the_skin_warms_up_is_told_from_the_warmth() {
    let mut skin = Skin::new();
    let load = |t: usize, s: f64| if module_of(t) == 3 { -2.0 * (s / (10.0 * MINUTE)).min(1.0) } else { 0.0 };
    let warm = |s: f64| -6.0 * s / (20.0 * MINUTE);
    skin.run(20.0 * MINUTE, |t, s| 0.25 * warm(s) + load(t, s), |_, s| warm(s));
    assert!(skin.furthest_from(-1.5) < 0.2, "{:?}", skin.drifts());
}

#[test]
fn a_load_that_creeps_in_everywhere_is_no_drift_while_the_pads_are_steady() {
    let mut skin = Skin::new();
    skin.run(30.0 * MINUTE, |_, s| -1.6 * (s / (10.0 * MINUTE)).min(1.0), |_, _| 0.0);
    assert!(skin.furthest_from(0.0) < UNEXPLAINED_COUNTS + 0.15, "{:?}", skin.drifts());
}

/// What a count more weighs: 8 N for all taxels, as on the forearm, and counts fall with load.
fn weighed() -> Skin {
    let mut skin = Skin::new();
    skin.drift.weigh(&[-0.1; 10 * MODULES]);
    skin
}

/// The most that a load of so many counts everywhere may press with unseen, N; it has to be told.
fn hides(skin: &Skin, load_counts: f64) -> f64 {
    let view = skin.drift.view();
    let taken: f64 = skin.drifts().iter().sum::<f64>() / MODULES as f64;
    let told = view.absorbed.0 + 8.0 * (load_counts + taken).max(0.0) + 2.0 * 8.0 * view.sigma_counts;
    assert!(told > 8.0 * load_counts, "{load_counts} counts of load, {taken} in the zero, {view:?}");
    assert!(view.absorbed.0 <= ABSORBED_MAX.0 + 1e-9, "{view:?}");
    -8.0 * taken
}

#[test]
fn a_slow_load_on_everything_is_bounded_in_newton_and_told() {
    let mut skin = weighed();
    for step in 1..=10 {
        let at = |s: f64| -0.05 * (f64::from(step) - 1.0 + (s / MINUTE).min(1.0));
        skin.run(2.0 * MINUTE, |_, s| at(s), |_, _| 0.0);
        let hidden = hides(&skin, 0.05 * f64::from(step));
        assert!(hidden < ABSORBED_MAX.0 + 0.2, "{hidden} N");
    }
    // Nor is it when the skin had been lighter first.
    let mut skin = weighed();
    skin.run(5.0 * MINUTE, |_, s| 0.3 * (s / MINUTE).min(1.0), |_, _| 0.0);
    let light = skin.drifts();
    skin.run(10.0 * MINUTE, |_, s| 0.3 - 0.5 * (s / (5.0 * MINUTE)).min(1.0), |_, _| 0.0);
    let moved: Vec<f64> = skin.drifts().iter().zip(&light).map(|(now, then)| then - now).collect();
    assert!(moved.iter().all(|counts| 8.0 * counts < ABSORBED_MAX.0 + 0.2), "{moved:?} counts");
    assert!(skin.drift.view().absorbed.0 > 0.8, "{:?}", skin.drift.view());
}

/// While the temperature comes and goes a load that stays is not learned as warmth, round after round.
#[test]
fn a_load_that_stays_is_no_warmth_however_often_the_temperature_changes() {
    let mut skin = weighed();
    let warm = |s: f64| -4.0 * s / (10.0 * MINUTE);
    skin.run(10.0 * MINUTE, |_, s| 0.5 * warm(s), |_, s| warm(s));
    assert!(skin.furthest_from(-2.0) < 0.15, "{:?}", skin.drifts());
    skin.run(10.0 * MINUTE, |_, s| -2.0 - s / (10.0 * MINUTE), |_, _| -4.0);
    for _ in 0..4 {
        let swing = |s: f64| -4.0 + 2.0 * (1.0 - (s / (5.0 * MINUTE) * std::f64::consts::PI).cos());
        skin.run(10.0 * MINUTE, |_, s| 0.5 * swing(s) - 1.0, |_, s| swing(s));
    }
    let drifts = skin.drifts();
    assert!(drifts.iter().all(|drift| -8.0 * (drift + 2.0) < ABSORBED_MAX.0 + 0.8), "{drifts:?}");
}

#[test]
fn a_taxel_of_its_own_mind_moves_nothing() {
    let mut skin = Skin::new();
    skin.run(5.0 * MINUTE, |t, s| if t % 10 == 4 { -1.5 * s / (5.0 * MINUTE) } else { 0.0 }, |_, _| 0.0);
    assert!(skin.furthest_from(0.0) < 0.1, "{:?}", skin.drifts());
    assert_eq!(skin.drift.view().state, DriftState::Following);
}

#[test]
fn a_hand_is_held_without_knowledge_and_follows_its_pads_with_it() {
    let mut skin = Skin::new();
    let hand = |t: usize| if module_of(t) == 3 { -12.0 } else { 0.0 };
    skin.run(30.0 * MINUTE, |t, _| hand(t), |_, _| 0.0);
    assert_eq!(skin.drifts()[2..5], [0.0; 3], "the module under the hand and those beside it");
    assert_eq!(skin.drift.view().following, (5, 8));
    // The hand goes, the skin warms up and learns, the hand comes again and warms its module by 4 more.
    let warm = |s: f64| -6.0 * s / (10.0 * MINUTE);
    skin.run(10.0 * MINUTE, |_, s| 0.25 * warm(s), |_, s| warm(s));
    let under = |module: usize, s: f64| if module == 3 { -4.0 * s / (30.0 * MINUTE) } else { 0.0 };
    let taxel = |t: usize, s: f64| 0.25 * (-6.0 + under(module_of(t), s)) + hand(t);
    skin.run(30.0 * MINUTE, taxel, |m, s| -6.0 + under(m, s));
    let drifts = skin.drifts();
    assert!((drifts[3] + 2.5).abs() < 0.3, "{drifts:?}");
    assert!(drifts.iter().enumerate().all(|(m, d)| m == 3 || (d + 1.5).abs() < 0.15), "{drifts:?}");
}

#[test]
fn at_its_bound_it_stays_and_says_so_and_a_new_zero_clears_it() {
    let mut skin = Skin::of(ModuleKind::Triangle, DriftPlan { follow: true, ..DriftPlan::default() });
    let warm = |s: f64| -15.0 * (s / (20.0 * MINUTE)).min(1.0);
    skin.run(25.0 * MINUTE, |_, s| 0.25 * warm(s), |_, s| warm(s));
    assert_eq!(skin.drift.view().state, DriftState::Bounded);
    assert!(skin.drifts().iter().all(|d| d.to_bits() == (-3.0_f64).to_bits() || (d + 3.0).abs() < 1e-9));
    let reason = skin.drift.shortcoming().expect("a reason");
    let why = reason.text();
    assert!(why.starts_with("drift of -3.") && why.ends_with(" counts reached its bound of 3 counts: tare"), "{why}");
    skin.drift.begin(skin.now, &skin.zero.clone(), &[]);
    assert_eq!((skin.drift.shortcoming(), skin.furthest_from(0.0)), (None, 0.0));
    assert_eq!(skin.drift.view().state, DriftState::Held);
}

#[test]
fn without_pads_or_with_pads_that_disagree_nothing_is_followed() {
    let mut bare = Skin::of(ModuleKind::Fingertip, DriftPlan { follow: true, ..DriftPlan::default() });
    bare.run(3.0 * MINUTE, |_, s| -0.3 * s / MINUTE, |_, _| 0.0);
    assert_eq!((bare.drift.view().state, bare.furthest_from(0.0)), (DriftState::Held, 0.0));
    let mut broken = Skin::new();
    for _ in 0..10 * 180 {
        broken.now.time = Time::from_nanos(broken.now.time.as_nanos() + SCAN_NS);
        let counts: Vec<u8> = broken.zero.iter().map(|z| z.mean.round() as u8 - 1).collect();
        broken.drift.on_scan(broken.now, &counts, |_| Some([0, 255]), |_| true);
    }
    assert_eq!((broken.drift.view().state, broken.furthest_from(0.0)), (DriftState::Held, 0.0));
}

#[test]
fn a_gap_and_a_session_go_on_from_where_it_was() {
    let mut skin = Skin::new();
    let warm = |s: f64| -4.0 * s / (5.0 * MINUTE);
    skin.run(5.0 * MINUTE, |_, s| 0.25 * warm(s), |_, s| warm(s));
    let before = skin.drifts();
    skin.now.time = Time::from_nanos(skin.now.time.as_nanos() + 3_600_000_000_000);
    skin.run(20.0, |_, _| -2.5, |_, _| -4.0);
    assert_eq!(skin.drift.view().state, DriftState::Held);
    let moved = skin.drifts().iter().zip(&before).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(moved < 1e-9, "{moved}");
    skin.now.time = Time::from_nanos(skin.now.time.as_nanos() + SCAN_NS);
    skin.drift.hold(skin.now, |_| Some([226; 2]));
    skin.run(20.0, |_, _| -1.0, |_, _| -4.0);
    assert_eq!(skin.drift.view().state, DriftState::Held);
    skin.run(2.0 * MINUTE, |_, _| -1.0, |_, _| -4.0);
    assert_eq!(skin.drift.view().state, DriftState::Following);
    assert!(skin.furthest_from(-1.0) < 0.15, "{:?}", skin.drifts());
}

#[test]
fn a_silent_module_is_held_and_so_are_those_beside_it() {
    let mut skin = Skin::new();
    for scan in 0..10 * 120 {
        skin.now.time = Time::from_nanos(skin.now.time.as_nanos() + SCAN_NS);
        let counts: Vec<u8> = skin.zero.iter().map(|z| z.mean.round() as u8 - (scan % 2) as u8).collect();
        skin.drift.on_scan(skin.now, &counts, |m| (m != 0).then_some([230, 230]), |_| true);
    }
    assert_eq!(skin.drift.view().following, (6, 8));
    assert_eq!(skin.drifts()[..2], [0.0; 2]);
}

proptest! {
    /// Whatever comes, whenever it comes: the drift is a number within its bound, its path is no longer than its rate
    /// allows, and the same scans give the same bits.
    #[test]
    fn any_time_steps_and_any_counts_keep_it_bounded(
        scans in prop::collection::vec(
            (prop_oneof![-5_000_000_000_i64..0, Just(0_i64), 1_000_i64..1_000_000, 1_000_000_i64..2_000_000_000,
                2_000_000_000_i64..3_600_000_000_000], any::<u8>(), any::<u8>(), any::<bool>()), 1..300),
    ) {
        let plan = DriftPlan { follow: true, rate_max_counts_per_min: 30.0, bound_counts: 0.7 };
        let (mut one, mut two) = (Skin::of(ModuleKind::Triangle, plan), Skin::of(ModuleKind::Triangle, plan));
        let (mut path, mut allowed, mut before, mut last) = (0.0, 0.0, one.drifts(), None);
        for (step, count, pad, sound) in scans {
            one.now.time = Time::from_nanos(one.now.time.as_nanos() + step);
            let dt = last.map_or(0.0, |last| one.now.time.seconds_since(last));
            if dt >= 0.0 {
                last = Some(one.now.time);
                allowed += if dt <= GAP_S { 0.5 * dt } else { 0.0 };
            }
            let counts = vec![200_u8.saturating_add(count % 3); one.zero.len()];
            let now = one.now;
            for drift in [&mut one.drift, &mut two.drift] {
                let pads = |m: usize| (m != 1 || sound).then_some([pad, pad ^ 1]);
                drift.on_scan(now, &counts, pads, |t| sound || t % 3 > 0);
            }
            let after = one.drifts();
            prop_assert!(after.iter().all(|d| d.is_finite() && d.abs() <= 0.7 + 1e-9), "{after:?}");
            path += after.iter().zip(&before).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            prop_assert!(path <= allowed + 1e-6, "{path} in a time for {allowed}");
            prop_assert_eq!(&after, &two.drifts());
            prop_assert_eq!(one.drift.view(), two.drift.view());
            prop_assert!(one.drift.view().sigma_counts.is_finite());
            before = after;
        }
    }

    /// The mean of a value that stays does not depend on how the time is cut, from microseconds to hours.
    #[test]
    fn a_mean_does_not_depend_on_the_steps(
        first in -300.0..300.0f64, value in -300.0..300.0f64, log_s in -6.0..3.6f64, cuts in 1_usize..200,
    ) {
        let (seconds, mut whole) = (10.0_f64.powf(log_s), smooth::Smooth::default());
        whole.push(first, Shares::of(5.0).slow);
        let mut cut = whole;
        whole.push(value, Shares::of(seconds).slow);
        for _ in 0..cuts {
            cut.push(value, Shares::of(seconds / cuts as f64).slow);
        }
        let (whole, cut) = (whole.mean(0.0).unwrap(), cut.mean(0.0).unwrap());
        prop_assert!((whole - cut).abs() <= 1e-9 * (1.0 + first.abs() + value.abs()), "{whole} {cut}");
        prop_assert!(whole >= first.min(value) - 1e-9 && whole <= first.max(value) + 1e-9);
    }

    /// The median without one is the median of the rest.
    #[test]
    fn the_median_without_one_is_that_of_the_rest(values in prop::collection::vec(-9.0..9.0f64, 1..20), without in 0_usize..25) {
        let all: Vec<(usize, f64)> = values.iter().copied().enumerate().collect();
        let mut rest: Vec<f64> = all.iter().filter(|(m, _)| *m != without).map(|(_, v)| *v).collect();
        rest.sort_by(f64::total_cmp);
        let n = rest.len();
        let expected = (n > 0).then(|| 0.5 * (rest[(n - 1) / 2] + rest[n / 2]));
        prop_assert_eq!(Others::new(all).median_without(without, 1), expected);
    }
}
