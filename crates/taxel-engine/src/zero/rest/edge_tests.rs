//! Where each limit of the test of rest lies: a little less is rest, a little more is not.

use super::judge::{Reference, judge, lighter};
use super::tests::{TAXELS, modules};
use super::verdict::RestVerdict;
use super::window::RestWindow;
use crate::baseline::TaxelBaseline;
use crate::zero::rest::verdict::{Beyond, Figure};

const SCANS: usize = 20;
const NOISE: f64 = 1.1;

/// A window of scans in which taxel `t` lies `level(t, scan)` counts towards load from 240, and goes up and down about that
/// by `wiggle(t)`, which moves neither half of the window.
fn wiggling(scans: usize, wiggle: impl Fn(usize) -> f64, level: impl Fn(usize, usize) -> f64) -> RestWindow {
    let mut window = RestWindow::new(TAXELS, &modules());
    for scan in 0..scans {
        let sign = |t: usize| if (scan + t).is_multiple_of(2) { 1.0 } else { -1.0 };
        let count = |t: usize| Some(240.0 - level(t, scan) + sign(t) * wiggle(t));
        window.push(2 * scan >= scans, (0..TAXELS).map(count));
    }
    window
}

fn window(level: impl Fn(usize, usize) -> f64) -> RestWindow {
    wiggling(SCANS, |_| 0.4, level)
}

fn models() -> Vec<TaxelBaseline> {
    vec![TaxelBaseline { mean: 240.0, noise: NOISE }; TAXELS]
}

/// The verdict by the models, and by a zero like them that lies `zero` counts away from load.
fn say(window: &RestWindow, zero: Option<f64>) -> RestVerdict {
    let models = models();
    let zero = zero.map(|away| vec![TaxelBaseline { mean: 240.0 + away, noise: NOISE }; TAXELS]);
    judge(window, Reference { models: Some(&models), zero: zero.as_deref(), sign: &[-1; TAXELS] })
}

fn is_rest(window: &RestWindow, zero: Option<f64>) -> bool {
    matches!(say(window, zero), RestVerdict::Rest { .. })
}

/// What moved or presses by the models.
fn figure(window: &RestWindow) -> Option<Figure> {
    match say(window, None) {
        RestVerdict::Moved(beyond) | RestVerdict::Loaded(beyond) => Some(beyond.figure),
        _ => None,
    }
}

/// `common` counts everywhere and `own` on so many taxels of module 3.
fn on(taxels: usize, common: f64, own: f64) -> RestWindow {
    window(|t, _| if (30..30 + taxels).contains(&t) { own } else { common })
}

#[test]
fn what_a_day_may_move_counts_by() {
    assert!(is_rest(&on(0, 3.45, 0.0), None));
    assert!(matches!(say(&on(0, 3.55, 0.0), None), RestVerdict::Loaded { .. }));
    // A module beyond the rest of the skin, or beyond its zero where the rest of the skin is lighter.
    for (common, from) in [(0.0, 0.0), (2.0, 2.0), (-2.0, 0.0)] {
        assert!(is_rest(&on(10, common, from + 4.95), None), "{common}");
        let verdict = say(&on(10, common, from + 5.05), None);
        let RestVerdict::Loaded(Beyond { module: Some(3), seen, .. }) = verdict else { panic!("{common}: {verdict}") };
        assert!((seen - 5.05).abs() < 0.01, "{verdict}");
    }
    for (taxels, max) in [(3, 8.0), (2, 16.0)] {
        for (common, from) in [(0.0, 0.0), (2.0, 2.0), (-2.0, 0.0)] {
            assert!(is_rest(&on(taxels, common, from + max - 0.05), None), "{taxels} from {common}");
            let verdict = say(&on(taxels, common, from + max + 0.05), None);
            let RestVerdict::Loaded(Beyond { figure, module: Some(3), seen, limit }) = verdict else {
                panic!("{taxels} from {common}: {verdict}");
            };
            assert_eq!((figure, limit), (Figure::Taxels(taxels), max));
            assert!((seen - max - 0.05).abs() < 0.01, "{verdict}");
        }
    }
    assert!(is_rest(&on(1, 0.0, 60.0), None), "one taxel may be odd");
    assert!(is_rest(&on(0, -9.95, 0.0), None));
    assert!(matches!(say(&on(0, -10.05, 0.0), None), RestVerdict::OtherZero { .. }));
}

/// By the zero that holds, beyond what all taxels have in common, at most 3.5 counts.
#[test]
fn what_temperature_may_move_counts_by_since_the_zero() {
    for common in [0.0, 0.3, 1.0, 2.0] {
        for (taxels, max) in [(3, 2.5), (2, 8.0)] {
            let limit = common + max;
            assert!(is_rest(&on(taxels, common, limit - 0.05), Some(0.0)), "{taxels}: {common}");
            let verdict = say(&on(taxels, common, limit + 0.05), Some(0.0));
            let RestVerdict::Loaded(Beyond { figure, module: Some(3), limit, .. }) = verdict else {
                panic!("{taxels}: {common}: {verdict}");
            };
            assert_eq!((figure, limit), (Figure::Taxels(taxels), max));
        }
    }
    // Three counts towards load by the models are five by a zero that lies two away from load.
    assert!(is_rest(&on(3, 3.0, 3.95), Some(2.0)), "{}", say(&on(3, 3.0, 3.95), Some(2.0)));
    assert!(!is_rest(&on(3, 3.0, 4.05), Some(2.0)), "3.5 counts are the most that is put down to temperature");
    // What lies away from load explains nothing.
    assert!(is_rest(&on(3, -1.0, 2.45), Some(0.0)) && !is_rest(&on(3, -1.0, 2.55), Some(0.0)));
}

#[test]
fn how_still_a_skin_is_at_rest() {
    let ramp = |counts: f64| window(move |_, scan| counts * scan as f64 / SCANS as f64);
    assert!(is_rest(&ramp(0.4), None));
    assert_eq!(figure(&ramp(0.75)), Some(Figure::Drift));
    assert_eq!(figure(&ramp(-0.75)), Some(Figure::Drift));
    let step = |taxels: usize, counts: f64| {
        window(move |t, scan| if scan >= SCANS / 2 && (30..30 + taxels).contains(&t) { counts } else { 0.0 })
    };
    for way in [1.0, -1.0] {
        // Of all ten together, chi-square may be 58.9 of 15 modules, their means taken to have a noise of 0.22 counts.
        assert!(is_rest(&step(10, 1.07 * way), None), "{}", say(&step(10, 1.07 * way), None));
        assert_eq!(figure(&step(10, 1.10 * way)), Some(Figure::Unlike));
        // Of each of two, by five standard errors of 0.5 counts.
        assert_eq!(figure(&step(2, 1.55 * way)), None);
        assert_eq!(figure(&step(2, 1.61 * way)), Some(Figure::Jumps));
    }
    assert!(is_rest(&step(1, 30.0), None), "one may be broken");
    // The noise of three, 1.9 times the models'.
    let shaking = |taxels: usize, counts: f64| {
        wiggling(SCANS, move |t| if (30..30 + taxels).contains(&t) { counts } else { 0.4 }, |_, _| 0.0)
    };
    assert!(is_rest(&shaking(3, 2.02), None) && is_rest(&shaking(2, 2.06), None));
    assert_eq!(figure(&shaking(3, 2.06)), Some(Figure::Noise));
    assert!(!is_rest(&wiggling(9, |_| 0.4, |_, _| 0.0), None) && is_rest(&wiggling(10, |_| 0.4, |_, _| 0.0), None));
}

/// Without models the quieter half says what a taxel's noise is.
#[test]
fn how_still_a_skin_without_models_is() {
    let said = |window: &RestWindow| judge(window, Reference::default());
    let shaken_late = |counts: f64| {
        wiggling(
            SCANS,
            |_| 0.6,
            move |t, scan| match (30..33).contains(&t) && scan >= SCANS / 2 {
                true if (scan + t).is_multiple_of(2) => -counts,
                true => counts,
                false => 0.0,
            },
        )
    };
    // 0.63 counts in the first half, of which 1.9 times is 1.2; with 1.4 in the second half it is 1.1 in all, with 1.7 it is 1.3.
    assert!(matches!(said(&shaken_late(0.8)), RestVerdict::Unproven { taxels: TAXELS, .. }));
    let verdict = said(&shaken_late(1.1));
    assert!(matches!(verdict, RestVerdict::Moved(Beyond { figure: Figure::Noise, .. })), "{verdict}");
}

#[test]
fn how_much_lighter_than_its_zero_a_skin_may_become() {
    let zero = models();
    let found = |window: &RestWindow| lighter_than(&zero, window);
    let (all, module, three) = ((Figure::Median, None), (Figure::Median, Some(0)), (Figure::Taxels(3), Some(0)));
    for (taxels, max, what) in [(TAXELS, 0.75, all), (10, 1.5, module), (3, 2.5, three)] {
        let lighter = |by: f64| window(move |t, _| if t < taxels { -by } else { 0.0 });
        assert_eq!(found(&lighter(max - 0.02)), None, "{taxels}");
        let beyond = found(&lighter(max + 0.02)).expect("a load has gone");
        assert_eq!((beyond.figure, beyond.module), what);
        assert!((beyond.seen - max - 0.02).abs() < 1e-9, "{beyond:?}");
        let of_scans = |scans: usize| found(&wiggling(scans, |_| 0.4, |t, _| if t < taxels { -9.0 } else { 0.0 }));
        assert!(of_scans(9).is_none() && of_scans(10).is_some(), "nine scans say nothing");
    }
}

fn lighter_than(zero: &[TaxelBaseline], window: &RestWindow) -> Option<Beyond> {
    lighter(zero, (&window.all().baseline(), window.all().count()), &modules(), &[-1; TAXELS])
}

/// A taxel that moved while it was watched has no zero: by more than a count, and than five standard errors of the noise of
/// all taxels, or of its own if that is more.
#[test]
fn how_far_a_taxel_may_move_and_have_a_zero() {
    let has_zero = |scans: usize, wiggle: f64, of_own: f64, step: f64| {
        let level = |t: usize, scan: usize| if t == 33 && 2 * scan >= scans { step } else { 0.0 };
        let window = wiggling(scans, |t| if t == 33 { of_own } else { wiggle }, level);
        let zero = window.steady_baseline();
        let others = zero.iter().enumerate().all(|(t, taxel)| t == 33 || (taxel.mean - 240.0).abs() < 1e-9);
        assert!(others, "{zero:?}");
        zero[33].mean.is_finite()
    };
    // 20 scans: ten of them count; five standard errors of 0.5 counts, of 1.05, of 2.11.
    for (wiggle, of_own, max) in [(0.4, 0.4, 1.581), (1.0, 1.0, 3.333), (1.0, 0.4, 3.333), (0.4, 2.0, 6.667)] {
        for way in [1.0, -1.0] {
            assert!(has_zero(20, wiggle, of_own, way * (max - 0.03)), "{wiggle} {of_own}");
            assert!(!has_zero(20, wiggle, of_own, way * (max + 0.03)), "{wiggle} {of_own}");
        }
    }
    // With many scans the count decides.
    assert!(has_zero(100, 0.4, 0.4, 0.97) && !has_zero(100, 0.4, 0.4, 1.03));
}

#[test]
fn what_is_said_of_a_load() {
    let rest = say(&on(10, 2.0, 6.05), None).to_string();
    assert!(
        rest.starts_with(
            "unloaded: median shift from the models' zero 2.00 counts, largest 6.1 (module 3); the skin may still"
        ),
        "{rest}"
    );
    assert_eq!(say(&on(10, 2.0, 7.05), None).to_string(), "something presses on module 3 (5.1 counts, limit 5)");
}

/// Taxels that stand still are no measure of rest. Two of a module that do so far towards load may lie beyond their range
/// under a load, whether their fault has been found already or not.
#[test]
fn two_taxels_of_a_module_that_stand_far_towards_load_are_no_rest() {
    let two = || RestVerdict::Loaded(Beyond { figure: Figure::Standing, module: Some(3), seen: 2.0, limit: 1.0 });
    let standing = |taxels: &[usize], level: f64, sound: bool, flutter: f64| {
        let mut seen = RestWindow::new(TAXELS, &modules());
        for scan in 0..SCANS {
            let wiggle = |t: usize| if (scan + t).is_multiple_of(2) { 0.4 } else { -0.4 };
            let stands = |t: &usize| taxels.contains(t);
            let count = |t: usize| match stands(&t) {
                true => sound.then_some(240.0 - level),
                false => Some(240.0 + wiggle(t)),
            };
            seen.push(2 * scan >= SCANS, (0..TAXELS).map(count));
            let faulty = |t: usize| (stands(&t) && !sound).then_some(240.0 - level + flutter * wiggle(t));
            seen.push_faulty((0..TAXELS).map(faulty));
        }
        say(&seen, None)
    };
    let is_standing = |said: &RestVerdict| matches!(said, RestVerdict::Loaded(Beyond { figure: Figure::Standing, .. }));
    for sound in [false, true] {
        let loaded = |level| standing(&[32, 37, 90], level, sound, 0.0);
        assert_eq!(loaded(16.1), two(), "{sound}");
        assert!(loaded(16.1).is_still(), "somebody may confirm broken ones");
        for level in [15.9, 0.0, -200.0] {
            assert!(matches!(loaded(level), RestVerdict::Rest { .. }), "{sound}, {level}: {}", loaded(level));
        }
        let apart = standing(&[32, 47, 90], 200.0, sound, 0.0);
        assert!(matches!(apart, RestVerdict::Rest { .. }), "one of a module may be broken: {apart}");
        // Of a module with less than five taxels that are read nothing is known, and its force says so.
        for (broken, loaded) in [(5, true), (6, false)] {
            let module: Vec<usize> = (30..30 + broken).collect();
            assert_eq!(is_standing(&standing(&module, 200.0, sound, 0.0)), loaded, "{sound}, {broken}");
        }
    }
    // At the end of its range a taxel flutters by its noise; what goes back and forth by more is broken.
    for (flutter, loaded) in [(2.5 * NOISE, true), (7.0 * NOISE, false)] {
        assert_eq!(is_standing(&standing(&[32, 37], 200.0, false, flutter)), loaded, "{flutter}");
    }
}

#[test]
fn halves_of_any_length_are_compared() {
    for late_from in [SCANS - 1, SCANS - 2, 1, 2] {
        let mut window = RestWindow::new(TAXELS, &modules());
        for scan in 0..SCANS {
            let late = scan >= late_from;
            let wiggle = |t: usize| if (scan + t).is_multiple_of(2) { 0.4 } else { -0.4 };
            let count = |t: usize| Some(240.0 + wiggle(t) - if late && (30..40).contains(&t) { 3.0 } else { 0.0 });
            window.push(late, (0..TAXELS).map(count));
        }
        assert!(!is_rest(&window, None), "{late_from}: {}", say(&window, None));
    }
}
