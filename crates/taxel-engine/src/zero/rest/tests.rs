use super::judge::{Reference, judge};
use super::statistics::RestStatistics;
use super::verdict::RestVerdict;
use super::window::RestWindow;
use crate::baseline::TaxelBaseline;
use proptest::prelude::*;

pub const TAXELS: usize = 150;
const SCANS: usize = 100;

/// A small linear congruential generator: tests need repeatable noise, not good noise.
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// About normal, standard deviation 1.
    pub(crate) fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

fn reference() -> Vec<TaxelBaseline> {
    vec![TaxelBaseline { mean: 240.0, noise: 1.1 }; TAXELS]
}

pub fn modules() -> Vec<std::ops::Range<usize>> {
    (0..TAXELS / 10).map(|m| 10 * m..10 * m + 10).collect()
}

/// A window of so many scans in which taxel `t` reads `level(t, scan)` with noise, rounded.
fn window_of(scans: usize, noise: &mut Noise, level: impl Fn(usize, usize) -> f64) -> RestWindow {
    let mut window = RestWindow::new(TAXELS, &modules());
    for scan in 0..scans {
        let counts = (0..TAXELS).map(|t| Some((level(t, scan) + 1.1 * noise.normal()).round()));
        window.push(2 * scan >= scans, counts);
    }
    window
}

fn window(noise: &mut Noise, level: impl Fn(usize, usize) -> f64) -> RestWindow {
    window_of(SCANS, noise, level)
}

/// Zeros of another day: both sides, 10th to 90th percentile about -2.6 to +2.6 around `common`.
fn another_day(noise: &mut Noise, common: f64) -> Vec<f64> {
    (0..TAXELS).map(|_| 240.0 + common + 2.0 * noise.normal()).collect()
}

fn falling() -> Vec<i8> {
    vec![-1; TAXELS]
}

fn against(window: &RestWindow, models: Option<&[TaxelBaseline]>, sign: &[i8]) -> RestVerdict {
    judge(window, Reference { models, zero: None, sign })
}

fn say(window: &RestWindow) -> RestVerdict {
    against(window, Some(&reference()), &falling())
}

#[test]
fn the_sign_of_the_skin_decides_which_way_is_load() {
    let mut noise = Noise(7);
    let statistics = window(&mut noise, |_, _| 246.0);
    let rising = against(&statistics, Some(&reference()), &[1; TAXELS]);
    assert!(matches!(rising, RestVerdict::Loaded { .. }), "{rising}");
    let falling = say(&statistics);
    assert!(matches!(falling, RestVerdict::Rest { .. }), "{falling}");
    let unknown = against(&statistics, Some(&reference()), &[0; TAXELS]);
    assert!(matches!(unknown, RestVerdict::TooFew { .. }), "{unknown}");
    let elsewhere = say(&window(&mut noise, |_, _| 254.0));
    assert!(matches!(elsewhere, RestVerdict::OtherZero { .. }), "{elsewhere}");
}

#[test]
fn too_few_scans_or_taxels_say_nothing() {
    let mut statistics = RestWindow::new(TAXELS, &modules());
    statistics.push(false, (0..TAXELS).map(|_| Some(240.0)));
    assert!(matches!(say(&statistics), RestVerdict::TooShort(1)));
    let mut faulty = RestWindow::new(TAXELS, &modules());
    for scan in 0..SCANS {
        let wavering = if scan % 2 == 0 { 241.0 } else { 239.0 };
        faulty.push(
            2 * scan >= SCANS,
            (0..TAXELS).map(|t| match t {
                0..40 => Some(wavering),
                40..60 => Some(240.0), // lifeless
                _ => (scan == 0).then_some(240.0),
            }),
        );
    }
    assert!(matches!(say(&faulty), RestVerdict::TooFew { sound: 40, comparable: TAXELS }), "{}", say(&faulty));
}

/// How many of 300 windows of a second the test calls rest: zeros of another day, and `load(taxel, scan of 20)` on them.
fn called_rest(load: impl Fn(usize, usize) -> f64) -> u32 {
    let mut called = 0;
    for seed in 0..300 {
        let mut noise = Noise(seed);
        let zero = another_day(&mut noise, [0.9, -0.7, -2.3, 0.0][seed as usize % 4]);
        let verdict = say(&window_of(20, &mut noise, |t, scan| zero[t] - load(t, scan)));
        called += u32::from(matches!(verdict, RestVerdict::Rest { .. }));
    }
    called
}

#[test]
fn error_rates_of_a_second() {
    let module = |t: usize, counts: f64| if t / 10 == 3 { counts } else { 0.0 };
    let mass = |t: usize, counts: f64| if (30..36).contains(&t) || (40..46).contains(&t) { counts } else { 0.0 };
    let rates = [
        ("at rest", called_rest(|_, _| 0.0), 290..=300),
        ("5 counts everywhere", called_rest(|_, _| 5.0), 0..=3),
        ("9 counts on a module", called_rest(|t, _| module(t, 9.0)), 0..=3),
        ("ramp of 3 counts/s", called_rest(|_, scan| 0.15 * scan as f64), 0..=0),
        (
            "a mass of 12 counts that lands in the last scan",
            called_rest(|t, s| mass(t, if s > 18 { 12.0 } else { 0.0 })),
            0..=0,
        ),
        ("in the last three", called_rest(|t, s| mass(t, if s > 16 { 12.0 } else { 0.0 })), 0..=0),
        ("in the middle", called_rest(|t, s| mass(t, if s > 9 { 12.0 } else { 0.0 })), 0..=0),
        ("that leaves after the second", called_rest(|t, s| mass(t, if s < 2 { 12.0 } else { 0.0 })), 0..=0),
        (
            "a mass of one count on five modules that lands in the middle",
            called_rest(|t, s| if s > 9 && t < 50 { 1.0 } else { 0.0 }),
            0..=30,
        ),
        ("of 5 counts that lands in the middle", called_rest(|t, s| mass(t, if s > 9 { 5.0 } else { 0.0 })), 0..=0),
    ];
    for (what, called, allowed) in rates {
        eprintln!("{what}: of 300 windows {called} are called rest");
        assert!(allowed.contains(&called), "{what}: {called} of 300");
    }
}

proptest! {
    /// More load is never judged more restful, whatever the day.
    #[test]
    fn load_never_helps(seed in any::<u64>(), common in -3.0..3.0f64, load in 0.0..60.0f64, more in 0.0..60.0f64) {
        let mut noise = Noise(seed);
        let zero = another_day(&mut noise, common);
        let at = |load: f64| matches!(say(&window(&mut Noise(seed), |t, _| zero[t] - load)), RestVerdict::Rest { .. });
        prop_assert!(at(load) || !at(load + more));
        prop_assert!(!at(12.0 + load), "12 counts on every taxel are never rest");
    }

    /// Mean and noise are those of the two-pass formulas.
    #[test]
    fn moments_agree_with_two_passes(values in prop::collection::vec(prop::option::of(-1e3..1e3f64), 2..60)) {
        let mut statistics = RestStatistics::new(1);
        for &value in &values {
            statistics.push([value]);
        }
        let seen: Vec<f64> = values.iter().flatten().copied().collect();
        let n = seen.len() as f64;
        let baseline = statistics.baseline()[0];
        if seen.is_empty() || 2 * seen.len() < values.len() {
            prop_assert!(baseline.mean.is_nan());
            return Ok(());
        }
        let mean = seen.iter().sum::<f64>() / n;
        prop_assert!((baseline.mean - mean).abs() < 1e-9, "{} against {mean}", baseline.mean);
        if seen.len() >= 2 {
            let variance = seen.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0);
            prop_assert!((baseline.noise - variance.sqrt()).abs() < 1e-9);
        }
    }
}

#[test]
fn a_taxel_at_rest_keeps_its_zero() {
    const WATCHES: usize = 4000;
    for counts in [0.3, 0.8, 1.1, 2.0] {
        let (mut noise, mut lost) = (Noise(11), 0);
        for _ in 0..WATCHES {
            // A second of scans, each conversion of the boards sent twice.
            let mut window = RestWindow::new(TAXELS, &modules());
            let levels: Vec<f64> = (0..TAXELS).map(|_| 240.0 + noise.uniform()).collect();
            for conversion in 0..10 {
                let scan: Vec<_> = levels.iter().map(|level| Some((level + counts * noise.normal()).round())).collect();
                for _ in 0..2 {
                    window.push(conversion >= 5, scan.iter().copied());
                }
            }
            lost += window.steady_baseline().iter().filter(|taxel| taxel.mean.is_nan()).count();
        }
        let share = lost as f64 / (WATCHES * TAXELS) as f64;
        assert!(share < 2e-5, "with a noise of {counts} counts {share:.1e} of the taxels at rest lost their zero");
    }
}
