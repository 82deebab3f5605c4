//! Where each limit of the test of rest lies: a little less is rest, a little more is not.

use super::judge::{Reference, judge};
use super::verdict::RestVerdict;
use super::window::RestWindow;
use crate::baseline::TaxelBaseline;
use crate::zero::rest::moves::Moves;
use crate::zero::rest::verdict::{Beyond, Unsteadiness};

const TAXELS: usize = 150;
const SCANS: usize = 20;
const NOISE: f64 = 1.1;

fn modules() -> Vec<std::ops::Range<usize>> {
    (0..TAXELS / 10).map(|module| 10 * module..10 * module + 10).collect()
}

/// A window of scans in which taxel `t` lies `level(t, scan)` counts towards load from 240, and goes up and down about that
/// by `wiggle(t)`, which moves neither half of the window.
fn wiggling(scans: usize, wiggle: impl Fn(usize) -> f64, level: impl Fn(usize, usize) -> f64) -> RestWindow {
    wiggling_in(&modules(), scans, wiggle, level)
}

fn wiggling_in(
    modules: &[std::ops::Range<usize>],
    scans: usize,
    wiggle: impl Fn(usize) -> f64,
    level: impl Fn(usize, usize) -> f64,
) -> RestWindow {
    let mut window = RestWindow::new(TAXELS, modules);
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

/// The verdict by the models, and by a zero like them so many minutes ago that lies `zero` counts away from load.
fn say(window: &RestWindow, zero: Option<(f64, f64)>) -> RestVerdict {
    let models = models();
    let at = |away: f64| vec![TaxelBaseline { mean: 240.0 + away, noise: NOISE }; TAXELS];
    let zero = zero.map(|(away, minutes)| (at(away), minutes));
    let zero = zero.as_ref().map(|(zero, minutes)| (zero.as_slice(), *minutes));
    judge(window, Reference { models: Some(&models), zero, sign: &[-1; TAXELS] })
}

fn is_rest(window: &RestWindow, zero: Option<(f64, f64)>) -> bool {
    matches!(say(window, zero), RestVerdict::Rest { .. })
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
            let RestVerdict::LoadedInPart(said, Beyond { module: Some(3), seen, limit }) = verdict else {
                panic!("{taxels} from {common}: {verdict}");
            };
            assert!((usize::from(said), limit) == (taxels, max) && (seen - max - 0.05).abs() < 0.01, "{verdict}");
        }
    }
    assert!(is_rest(&on(1, 0.0, 60.0), None), "one taxel may be odd");
    assert!(is_rest(&on(0, -9.95, 0.0), None));
    assert!(matches!(say(&on(0, -10.05, 0.0), None), RestVerdict::OtherZero { .. }));
}

/// By the zero that holds, beyond what all taxels have in common as far as time explains that: 0.4 counts at once and a
/// count a minute, at most 3.5.
#[test]
fn what_temperature_may_move_counts_by_since_the_zero() {
    for (minutes, common, explained) in
        [(0.0, 0.0, 0.0), (0.0, 0.3, 0.3), (0.0, 1.0, 0.4), (-5.0, 1.0, 0.4), (0.5, 2.0, 0.9), (1.0, 1.0, 1.0)]
    {
        for (taxels, max) in [(3, 2.5), (2, 8.0)] {
            let limit = explained + max;
            assert!(is_rest(&on(taxels, common, limit - 0.05), Some((0.0, minutes))), "{taxels}: {minutes} {common}");
            let verdict = say(&on(taxels, common, limit + 0.05), Some((0.0, minutes)));
            let RestVerdict::LoadedInPart(said, Beyond { module: Some(3), limit, .. }) = verdict else {
                panic!("{taxels}: {minutes} {common}: {verdict}");
            };
            assert_eq!((usize::from(said), limit), (taxels, max));
        }
    }
    // Three counts towards load by the models are five by a zero that lies two away from load.
    assert!(is_rest(&on(3, 3.0, 3.95), Some((2.0, 60.0))), "{}", say(&on(3, 3.0, 3.95), Some((2.0, 60.0))));
    assert!(!is_rest(&on(3, 3.0, 4.05), Some((2.0, 60.0))), "3.5 counts are the most that is put down to time");
    // What lies away from load explains nothing.
    assert!(is_rest(&on(3, -1.0, 2.45), Some((0.0, 60.0))) && !is_rest(&on(3, -1.0, 2.55), Some((0.0, 60.0))));
}

#[test]
fn how_still_a_skin_is_at_rest() {
    let ramp = |counts: f64| window(move |_, scan| counts * scan as f64 / SCANS as f64);
    assert!(is_rest(&ramp(0.4), None));
    assert!(matches!(say(&ramp(0.75), None), RestVerdict::Restless { .. }));
    assert!(matches!(say(&ramp(-0.75), None), RestVerdict::Restless { .. }));
    // Of ten taxels that step with the second half, the median may move by 0.5 and four standard errors of a median.
    let step = |taxels: usize, counts: f64| {
        window(move |t, scan| if scan >= SCANS / 2 && (30..30 + taxels).contains(&t) { counts } else { 0.0 })
    };
    for way in [1.0, -1.0] {
        // Of all ten together, chi-square may be 58.9 of 15 modules, their means taken to have a noise of 0.22 counts.
        assert!(is_rest(&step(10, 1.07 * way), None), "{}", say(&step(10, 1.07 * way), None));
        for counts in [1.10, 1.59] {
            let verdict = say(&step(10, counts * way), None);
            assert!(matches!(verdict, RestVerdict::Unlike { .. }), "{verdict}");
        }
        let verdict = say(&step(10, 1.61 * way), None);
        assert!(matches!(verdict, RestVerdict::Unsteady(3, Unsteadiness::Median(..))), "{verdict}");
        // Of three, by 3.3 standard errors.
        assert!(is_rest(&step(3, 2.28 * way), None), "{}", say(&step(3, 2.28 * way), None));
        let verdict = say(&step(3, 2.32 * way), None);
        assert!(matches!(verdict, RestVerdict::Unsteady(3, Unsteadiness::Third(..))), "{verdict}");
    }
    assert!(is_rest(&step(2, 2.32), None), "two may be odd");
    // The noise of three, 1.9 times the models'.
    let shaking = |taxels: usize, counts: f64| {
        wiggling(SCANS, move |t| if (30..30 + taxels).contains(&t) { counts } else { 0.4 }, |_, _| 0.0)
    };
    assert!(is_rest(&shaking(3, 2.02), None) && is_rest(&shaking(2, 2.06), None));
    let verdict = say(&shaking(3, 2.06), None);
    assert!(matches!(verdict, RestVerdict::Unsteady(3, Unsteadiness::Noise(..))), "{verdict}");
    assert!(!is_rest(&wiggling(9, |_| 0.4, |_, _| 0.0), None) && is_rest(&wiggling(10, |_| 0.4, |_, _| 0.0), None));
}

/// A load that lands at the end of a watch, on two taxels of a module or one of each of two: 5 standard errors of 1.08 counts.
#[test]
fn a_load_on_few_taxels_of_each_module_is_no_rest() {
    let step = |taxels: &'static [usize], counts: f64| {
        window(move |t, scan| if scan >= SCANS / 2 && taxels.contains(&t) { counts } else { 0.0 })
    };
    let single = |taxels, all| if all { Unsteadiness::JumpsOfSkin(taxels) } else { Unsteadiness::Jumps(taxels) };
    for (taxels, counts, found) in [
        (&[31, 32][..], 3.6, Some((3, single(2, false)))),
        (&[31, 32], -3.6, Some((3, single(2, false)))),
        (&[31, 32], 3.3, None),
        (&[31], 30.0, None),
        (&[31, 41], 3.6, Some((4, single(2, true)))),
        (&[31, 41], 3.3, None),
    ] {
        let verdict = say(&step(taxels, counts), None);
        match found {
            None => assert!(matches!(verdict, RestVerdict::Rest { .. }), "{taxels:?} {counts}: {verdict}"),
            Some((module, what)) => assert_eq!(verdict, RestVerdict::Unsteady(module, what), "{taxels:?} {counts}"),
        }
    }
}

#[test]
fn a_half_of_a_single_scan_says_nothing_of_the_other() {
    for (late_from, says) in [(SCANS - 1, false), (SCANS - 2, true), (1, false), (2, true)] {
        let mut window = RestWindow::new(TAXELS, &modules());
        for scan in 0..SCANS {
            let late = scan >= late_from;
            let wiggle = |t: usize| if (scan + t).is_multiple_of(2) { 0.4 } else { -0.4 };
            let count = |t: usize| Some(240.0 + wiggle(t) - if late && (30..40).contains(&t) { 3.0 } else { 0.0 });
            window.push(late, (0..TAXELS).map(count));
        }
        assert_eq!(!is_rest(&window, None), says, "{late_from}: {}", say(&window, None));
    }
}

/// Three taxels cannot speak for a module of two: the noise of the median taxel of all does, 2.5 times the models'.
#[test]
fn how_much_noise_a_skin_of_small_modules_has_at_rest() {
    let pairs: Vec<_> = (0..TAXELS / 2).map(|module| 2 * module..2 * module + 2).collect();
    let shaking = |counts: f64| wiggling_in(&pairs, SCANS, move |_| counts, |_, _| 0.0);
    assert!(is_rest(&shaking(2.66), None), "{}", say(&shaking(2.66), None));
    let verdict = say(&shaking(2.70), None);
    let RestVerdict::Trembling(noise_ratio) = verdict else { panic!("{verdict}") };
    assert!((noise_ratio - 2.518).abs() < 0.001, "{noise_ratio}");
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
    assert!(matches!(verdict, RestVerdict::Unsteady(3, Unsteadiness::Noise(..))), "{verdict}");
}

#[test]
fn how_much_lighter_than_its_zero_a_skin_may_become() {
    let zero = models();
    let found = |window: &RestWindow| window.lighter_than(&zero, &[-1; TAXELS]);
    for (taxels, max) in [(TAXELS, 0.75), (10, 1.5), (3, 2.5)] {
        let lighter = |by: f64| window(move |t, _| if t < taxels { -by } else { 0.0 });
        assert_eq!(found(&lighter(max - 0.02)), None, "{taxels}");
        let unloading = found(&lighter(max + 0.02)).expect("a load has gone");
        let expected = [if taxels == TAXELS { max + 0.02 } else { 0.0 }, if taxels == 3 { 0.0 } else { max + 0.02 }];
        let is = [unloading.median, unloading.module_median];
        assert!(is.iter().zip(expected).all(|(is, expected)| (is - expected).abs() < 1e-9), "{unloading:?}");
        assert!((unloading.third - max - 0.02).abs() < 1e-9, "{unloading:?}");
        let of_scans = |scans: usize| found(&wiggling(scans, |_| 0.4, |t, _| if t < taxels { -9.0 } else { 0.0 }));
        assert!(of_scans(9).is_none() && of_scans(10).is_some(), "nine scans say nothing");
    }
}

#[test]
fn what_a_skin_that_became_lighter_says() {
    let lighter = window(|t, _| if (30..40).contains(&t) { -2.0 } else { -1.0 });
    let said = lighter.lighter_than(&models(), &[-1; TAXELS]).expect("a load has gone");
    let expected = "the skin is 1.00 counts lighter than its zero in the median, module 3 by 2.00, three taxels of a \
                    module by 2.00 and more";
    assert_eq!(said.to_string(), expected);
}

/// Fewer taxels than five do not speak for a module, and one that reads a single value for ten scans is broken.
#[test]
fn who_speaks_for_a_module() {
    let moves = |sound: usize, scans: u64, noise: f64| {
        let now = |t: usize| match t {
            t if t < sound => TaxelBaseline { mean: 230.0, noise },
            t if t < 10 => TaxelBaseline::UNKNOWN,
            _ => TaxelBaseline { mean: 240.0, noise: 0.8 },
        };
        Moves::between(&models(), &(0..TAXELS).map(now).collect::<Vec<_>>(), scans, &[-1; TAXELS])
    };
    assert_eq!(moves(4, 20, 0.8).worst_module(&modules(), 0.0), (None, 0.0));
    assert_eq!(moves(5, 20, 0.8).worst_module(&modules(), 0.0), (Some(0), 10.0));
    assert_eq!(moves(5, 20, 0.8).worst_few(&modules(), 1.0, 2), (Some(0), 9.0));
    assert_eq!(moves(5, 10, 0.0).worst_module(&modules(), 0.0), (None, 0.0));
    assert_eq!(moves(5, 9, 0.0).worst_module(&modules(), 0.0), (Some(0), 10.0));
    assert_eq!(moves(5, 20, 0.8).counts(), (TAXELS - 5, TAXELS));
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
fn what_is_said_of_a_skin_that_is_not_at_rest() {
    let unsteady = |what| RestVerdict::Unsteady(3, what);
    let beyond = |seen, limit| Beyond { module: Some(3), seen, limit };
    let in_part = |taxels| RestVerdict::LoadedInPart(taxels, beyond(2.6, 2.5));
    let said = [
        (
            unsteady(Unsteadiness::Median(1.61, 1.6)),
            "something moved on module 3 (1.6 counts between the halves of the watch, limit 1.6)",
        ),
        (
            unsteady(Unsteadiness::Third(3.4)),
            "something moved on module 3 (three taxels by 3.4 standard errors, limit 3.3)",
        ),
        (
            unsteady(Unsteadiness::Noise(2.0)),
            "something moved on module 3 (three taxels have 2.0 times their noise, limit 1.9)",
        ),
        (
            RestVerdict::Unlike(beyond(5.24, 5.0)),
            "something moved on several modules (5.2 standard deviations apart, limit 5)",
        ),
        (RestVerdict::Restless(beyond(0.5, 0.45)), "the whole skin moved (+0.5 counts in the median, limit 0.5)"),
        (RestVerdict::Trembling(2.6), "the whole skin trembled (2.6 times its noise, limit 2.5)"),
        (in_part(2), "something presses on module 3 (2.6 counts on two taxels, limit 2.5)"),
        (in_part(3), "something presses on module 3 (2.6 counts on three taxels, limit 2.5)"),
        (RestVerdict::TooShort(9), "too little was seen (9 scans, at least 10)"),
        (
            RestVerdict::TooFew { sound: 40, comparable: TAXELS },
            "too few sound taxels (40 of the 150 that have a model)",
        ),
    ];
    for (verdict, words) in said {
        assert!(verdict.to_string().contains(words), "`{words}` is not in: {verdict}");
    }
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
    let two = || RestVerdict::Standing(2, Beyond { module: Some(3), seen: 16.0, limit: 16.0 });
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
    for sound in [false, true] {
        let loaded = |level| standing(&[32, 37, 90], level, sound, 0.0);
        assert_eq!(loaded(16.1), two(), "{sound}");
        assert!(loaded(16.1).is_still(), "somebody may vouch for broken ones");
        for level in [15.9, 0.0, -200.0] {
            assert!(matches!(loaded(level), RestVerdict::Rest { .. }), "{sound}, {level}: {}", loaded(level));
        }
        let apart = standing(&[32, 47, 90], 200.0, sound, 0.0);
        assert!(matches!(apart, RestVerdict::Rest { .. }), "one of a module may be broken: {apart}");
        // Of a module with less than five taxels that are read nothing is known, and its force says so.
        for (broken, loaded) in [(5, true), (6, false), (10, false)] {
            let module: Vec<usize> = (30..30 + broken).collect();
            let verdict = standing(&module, 200.0, sound, 0.0);
            assert_eq!(matches!(verdict, RestVerdict::Standing { .. }), loaded, "{sound}, {broken}: {verdict}");
        }
    }
    // At the end of its range a taxel flutters by its noise; what goes back and forth by more is broken.
    for (flutter, loaded) in [(2.5 * NOISE, true), (7.0 * NOISE, false)] {
        let verdict = standing(&[32, 37], 200.0, false, flutter);
        assert_eq!(matches!(verdict, RestVerdict::Standing { .. }), loaded, "{flutter}: {verdict}");
    }
    let words = two().to_string();
    assert!(words.starts_with("something presses on module 3, or 2 taxels are broken"), "{words}");
}
