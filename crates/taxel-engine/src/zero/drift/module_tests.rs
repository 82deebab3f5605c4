//! Where each limit of one module's drift lies, and what it comes to in figures.

use taxel_skin::{CountRange, ModuleKind};

use super::common::{Allowed, Warming};
use super::module::{ModuleDrift, TaxelDrift};
use super::site::DriftSite;
use super::smooth::Shares;
use crate::counts::Counts;

/// A step after which every mean is what was counted last.
const LONG_S: f64 = 500.0;

fn is_near(is: f64, expected: f64) -> bool {
    (is - expected).abs() < 1e-6
}

/// A module whose taxels have their zero at 200 counts, and their pads at 230 and 100.
struct One {
    module: ModuleDrift,
    taxels: Vec<TaxelDrift>,
}

impl One {
    fn new(kind: ModuleKind, distance: f64) -> Self {
        let taxels = kind.taxel_slots().len();
        let mut module = ModuleDrift::new(DriftSite { taxels: 0..taxels, kind, beside: Vec::new() });
        module.begin([None; 2]);
        Self { module, taxels: vec![TaxelDrift::new(200.0, distance); taxels] }
    }

    /// One whose pads' zero is known and whose taxels rest at 200.
    fn known() -> Self {
        let mut one = Self::new(ModuleKind::Triangle, 8.0);
        (0..5).for_each(|_| one.scan(1.0, 200.0, Some([230, 100]), |_| true));
        one.settle(200.0, [230, 100]);
        one
    }

    fn take(&mut self, dt_s: f64, counts: f64, pads: Option<[u8; 2]>, sound: impl Fn(usize) -> bool) -> bool {
        let range = CountRange::to(65_535).unwrap();
        let words = vec![range.nearest(counts); self.taxels.len()];
        self.module.take(&mut self.taxels, Counts::Words(&words, range), pads, &sound, &Shares::of(dt_s));
        self.module.is_touched()
    }

    /// A scan of a skin that nothing touches.
    fn scan(&mut self, dt_s: f64, counts: f64, pads: Option<[u8; 2]>, sound: impl Fn(usize) -> bool) {
        self.take(dt_s, counts, pads, sound);
        self.rest(dt_s, counts, false);
    }

    fn rest(&mut self, dt_s: f64, counts: f64, near: bool) {
        let range = CountRange::to(65_535).unwrap();
        let words = vec![range.nearest(counts); self.taxels.len()];
        self.module.rest(&mut self.taxels, Counts::Words(&words, range), near, &Shares::of(dt_s));
    }

    /// Rests there.
    fn settle(&mut self, counts: f64, pads: [u8; 2]) {
        (0..3).for_each(|_| self.scan(LONG_S, counts, Some(pads), |_| true));
    }

    /// Whether a skin that is there from now on is touched.
    fn touches(&self, counts: f64) -> bool {
        let mut one = Self { module: self.module.clone(), taxels: self.taxels.clone() };
        one.take(LONG_S, counts, Some([230, 100]), |_| true)
    }

    fn offset(&self) -> Option<f64> {
        self.module.offset(&self.taxels)
    }

    fn follow(&mut self, offset: f64, allowed: f64, common_pads: f64) {
        self.module.follow(offset, Allowed { counts: allowed, unexplained: 0.25 * allowed }, common_pads);
    }
}

fn pads(moved: [i16; 2]) -> [u8; 2] {
    [(230 + moved[0]) as u8, (100 + moved[1]) as u8]
}

#[test]
fn a_taxel_is_touched_beyond_its_threshold_and_half_of_it_from_where_it_rested() {
    let mut one = One::new(ModuleKind::Triangle, 4.0);
    // Where it rests, the drift then and now, and what is no touch.
    for (rest, drifts, low, high) in [
        (201.0, [0.0, 0.0], 199.0, 203.0),
        (203.0, [0.0, 0.0], 201.0, 204.0),
        (197.0, [0.0, 0.0], 196.0, 199.0),
        (201.0, [0.0, -1.0], 198.0, 202.0),
        (200.0, [-1.0, -1.0], 198.0, 202.0),
        (202.0, [-1.0, -1.0], 200.0, 203.0),
        (201.0, [-1.0, 0.5], 200.5, 204.5),
    ] {
        let drift = |one: &mut One, to: f64| {
            one.follow(0.0, to, 0.0);
            one.module.advance(9.0, 9.0);
        };
        drift(&mut one, drifts[0]);
        one.settle(rest, [230, 100]);
        drift(&mut one, drifts[1]);
        let touched = [low - 0.05, low + 0.05, high - 0.05, high + 0.05].map(|counts| one.touches(counts));
        assert_eq!(touched, [true, false, false, true], "{rest} {drifts:?}");
    }
}

#[test]
fn a_taxel_is_judged_half_a_second_after_its_first_value() {
    let mut one = One::new(ModuleKind::Triangle, 4.0);
    assert!(!one.take(0.45, 230.0, Some([230, 100]), |_| true));
    assert!(one.take(0.02, 230.0, Some([230, 100]), |_| true));
    assert!(one.take(0.02, 230.0, Some([230, 100]), |taxel| taxel == 3), "one is enough");
    assert!(!one.take(0.02, 230.0, Some([230, 100]), |_| false));
    assert!(one.take(0.02, 200.0, None, |_| true), "who knows of a silent one");
}

#[test]
fn what_was_touched_is_followed_half_a_minute_after_it_and_once_its_new_rest_is_known() {
    let mut one = One::known();
    assert_eq!(one.offset(), Some(0.0));
    one.scan(1.0, 201.0, Some([230, 100]), |_| true);
    assert!(one.offset().is_some_and(|offset| is_near(offset, 1.0 - (-0.1_f64).exp())), "{:?}", one.offset());
    one.rest(1.0, 203.0, true);
    assert_eq!(one.offset(), None);
    one.rest(29.9, 203.0, false);
    one.rest(0.2, 203.0, false);
    one.rest(22.0, 203.0, false);
    assert_eq!(one.offset(), None, "less than nine tenths of its mean is known");
    one.rest(1.0, 203.0, false);
    assert_eq!(one.offset(), Some(3.0));
    // As after a gap.
    one.module.restart(&mut one.taxels);
    assert_eq!((one.offset(), one.module.pads_moved()), (None, None));
    one.scan(30.0, 202.0, Some([230, 100]), |_| true);
    assert_eq!((one.offset(), one.module.pads_moved()), (Some(2.0), Some(0.0)), "thirty seconds are enough");
}

#[test]
fn five_sound_taxels_speak_for_a_module() {
    for (sound, offset) in [(4, None), (5, Some(1.0))] {
        let mut one = One::new(ModuleKind::Triangle, 8.0);
        one.scan(LONG_S, 201.0, Some([230, 100]), |taxel| taxel < sound);
        assert_eq!(one.offset(), offset);
        // What is not sound any more does not speak on.
        let mut one = One::known();
        one.scan(LONG_S, 201.0, Some([230, 100]), |taxel| taxel < sound);
        one.scan(LONG_S, 201.0, Some([230, 100]), |taxel| taxel < sound);
        assert_eq!(one.offset().is_some(), offset.is_some());
    }
    let mut one = One::new(ModuleKind::Triangle, 8.0);
    one.taxels[..6].fill(TaxelDrift::default());
    one.settle(201.0, [230, 100]);
    assert_eq!(one.offset(), None, "a taxel without a zero is none");
}

#[test]
fn pads_are_believed_as_far_as_they_agree() {
    for (moved, said) in [
        ([6, 3], Some(4.5)),
        ([6, 1], Some(3.5)),
        ([6, 0], None),
        ([1, 6], Some(3.5)),
        ([0, 6], None),
        ([-6, -3], Some(-4.5)),
        ([-6, 0], None),
        ([-2, 1], Some(-0.5)),
        ([-2, 2], None),
    ] {
        let mut one = One::known();
        one.settle(200.0, pads(moved));
        let is = one.module.pads_moved();
        assert!(is.is_some() == said.is_some() && is.zip(said).is_none_or(|(is, said)| is_near(is, said)), "{moved:?}");
    }
    let mut one = One::known();
    one.scan(1.0, 200.0, Some([255, 100]), |_| true);
    assert_eq!(one.module.pads_moved(), None, "an end of the range");
    one.scan(1.0, 200.0, Some([0, 100]), |_| true);
    one.scan(22.0, 200.0, Some([233, 100]), |_| true);
    assert_eq!(one.module.pads_moved(), None);
    one.scan(1.1, 200.0, Some([233, 100]), |_| true);
    assert!(one.module.pads_moved().is_some_and(|moved| is_near(moved, 1.5)));
}

/// Where nobody knows where the pads were at the zero, it is their mean over the first five seconds after it.
#[test]
fn where_the_pads_were_at_the_zero() {
    let mut one = One::new(ModuleKind::Triangle, 8.0);
    let first = [[229, 102], [231, 98], [255, 100], [230, 0], [234, 100], [240, 110]];
    first.into_iter().for_each(|pads| one.scan(1.0, 200.0, Some(pads), |_| true));
    one.settle(200.0, [234, 103]);
    // 231 and 100.
    assert!(one.module.pads_moved().is_some_and(|moved| is_near(moved, 3.0)), "{:?}", one.module.pads_moved());
    let mut palm = One::new(ModuleKind::PalmPad11, 8.0);
    (0..5).for_each(|_| palm.scan(1.0, 200.0, Some([230, 100]), |_| true));
    palm.settle(200.0, [233, 100]);
    assert!(palm.module.pads_moved().is_some_and(|moved| is_near(moved, 3.0)), "one pad speaks where there is one");
    let mut bare = One::new(ModuleKind::Fingertip, 8.0);
    bare.settle(200.0, [233, 100]);
    assert_eq!(bare.module.pads_moved(), None);
    let mut half = One::new(ModuleKind::Triangle, 8.0);
    (0..6).for_each(|_| half.scan(1.0, 200.0, Some([230, 0]), |_| true));
    half.settle(200.0, [233, 100]);
    assert_eq!(half.module.pads_moved(), None, "one of two does not");
}

/// What comes after the zero is of the warmth, however soon. It is told within half a second, while the slow mean that is
/// followed needs 23; under a hand, too, and without the counts.
#[test]
fn pads_that_were_known_at_the_zero_tell_at_once_how_far_they_have_moved() {
    let mut one = One::new(ModuleKind::Triangle, 8.0);
    one.module.begin([Some(230.5), Some(100.5)]);
    assert_eq!(one.module.pads_now(), None, "nothing was heard yet");
    one.take(0.5, 100.0, Some([227, 97]), |_| true);
    assert!(one.module.pads_now().is_some_and(|moved| is_near(moved, -3.5)), "{:?}", one.module.pads_now());
    assert_eq!(one.module.pads_moved(), None);
    one.module.lose_pads();
    assert_eq!(one.module.pads_now(), None, "silent");
    one.module.feel([233, 103], &Shares::of(0.5));
    assert!(one.module.pads_now().is_some_and(|moved| is_near(moved, 2.5)), "{:?}", one.module.pads_now());
    // A pad that was not there at the zero has none.
    one.module.begin([Some(230.0), None]);
    (0..9).for_each(|_| one.scan(1.0, 200.0, Some([227, 97]), |_| true));
    assert_eq!(one.module.pads_now(), None, "one of two says nothing");
}

#[test]
fn its_own_pads_say_more_once_a_module_has_learned() {
    // Half a count from what is allowed is agreement.
    for (offset, learned) in [(1.5, true), (1.51, false), (0.5, true), (0.49, false)] {
        let mut one = One::known();
        one.settle(200.0, pads([2, 2]));
        one.follow(offset, 1.0, 5.0);
        assert_eq!(one.module.target(), 1.0, "nothing was known");
        assert!(is_near(one.module.unexplained(), 0.25));
        one.follow(offset, 1.0, 5.0);
        assert_eq!(one.module.target() < 1.0, learned, "{offset}");
    }
    let mut one = One::known();
    one.settle(200.0, pads([2, 2]));
    (0..2).for_each(|_| one.follow(1.0, 1.0, 1.0));
    assert!(is_near(one.module.target(), 1.500_795), "{}", one.module.target());
    one.follow(1.0, 1.0, 5.0);
    assert!(is_near(one.module.target(), 1.0 - 1.502_385), "{}", one.module.target());
}

#[test]
fn a_module_that_is_held_goes_with_its_pads() {
    let mut one = One::known();
    one.settle(200.0, pads([2, 2]));
    one.follow(1.0, 1.0, 2.0);
    one.module.advance(0.25, 3.0);
    let patch = Warming { coefficient: 0.75, sigma: 0.0, pads: 3.0 };
    assert!(one.module.is_following() && one.module.held_sigma(&patch) == 0.0);
    one.settle(200.0, pads([4, 4]));
    one.module.hold(&patch);
    assert!(!one.module.is_following());
    // From where it was, with 0.5008 +- 0.0199 counts per count of the pads.
    assert!(is_near(one.module.target(), 0.25 + 1.001_590), "{}", one.module.target());
    one.module.advance(0.5, 3.0);
    one.module.hold(&patch);
    assert!(is_near(one.module.target(), 0.25 + 1.001_590), "it is held where it was first");
    // What it has not gone yet is uncertain as a whole.
    let sigma = (4.0_f64 / 2516.0).sqrt();
    assert!(is_near(one.module.held_sigma(&patch), sigma.hypot(0.501_590)), "{}", one.module.held_sigma(&patch));
    one.module.advance(9.0, 3.0);
    assert!(is_near(one.module.held_sigma(&patch), sigma), "{}", one.module.held_sigma(&patch));
}

/// It may warm as the patch does, or otherwise.
#[test]
fn a_module_that_has_learned_nothing_stays_and_is_uncertain_by_all_that_it_may_have_moved() {
    let patch = Warming { coefficient: 0.75, sigma: 0.1, pads: 3.0 };
    // By its own pads, and by all where its own are not known, as where a warm hand lies on one of them.
    for (own, moved) in [([2, 2], 2.0), ([8, 0], 3.0)] {
        let mut one = One::known();
        one.settle(200.0, pads(own));
        one.module.hold(&patch);
        one.module.advance(9.0, 3.0);
        assert_eq!(one.module.drift(), 0.0, "{own:?}");
        let sigma = 0.75_f64.hypot(0.25);
        assert!(is_near(one.module.held_sigma(&patch), sigma * moved), "{own:?}: {}", one.module.held_sigma(&patch));
    }
}

#[test]
fn it_moves_by_its_step_and_within_its_bound_and_is_free_again_a_tenth_below() {
    let mut one = One::known();
    // Where it heads, by which step, where it is then, and whether that is the bound of 3 counts.
    for (target, step, drift, bounded) in [
        (-1.0, 0.25, -0.25, false),
        (1.0, 0.25, 0.0, false),
        (2.9, 9.0, 2.9, false),
        (3.0, 9.0, 3.0, true),
        (2.75, 9.0, 2.75, true),
        (4.0, 9.0, 3.0, true),
        (2.0, 0.125, 2.875, false),
        (3.0, 0.0625, 2.9375, false),
        (-9.0, 9.0, -3.0, true),
        (-2.65, 9.0, -2.65, false),
    ] {
        one.follow(9.0, target, 0.0);
        one.module.advance(step, 3.0);
        let is = one.module.drift();
        assert!(is_near(is, drift) && one.module.is_bounded() == bounded, "{target} {step}: {is}");
    }
    assert!(is_near(one.module.since_tables(), 2.65));
    one.module.note_tables();
    assert_eq!(one.module.since_tables(), 0.0);
    one.follow(9.0, -3.0, 0.0);
    one.module.advance(0.1, 3.0);
    assert!(is_near(one.module.since_tables(), 0.1));
}
