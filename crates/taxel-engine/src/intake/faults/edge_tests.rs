//! Where each limit of the detector lies: a little less is sound, a little more is a fault. And every fault ends.

use proptest::prelude::*;
use std::time::Duration;
use taxel_skin::{ModuleKind, Time};

use super::detector::FaultDetector;
use super::fault::Fault;
use super::limits::FaultLimits;
use super::taxel::TaxelWatch;

const HOLD: Duration = Duration::from_secs(2);

fn at(seconds: f64) -> Time {
    Time::from_nanos((seconds * 1e9).round() as i64)
}

/// A taxel that is scanned every 20 ms.
struct One {
    watch: TaxelWatch,
    scans: u32,
}

impl One {
    fn new(noise: f32) -> Self {
        let mut watch = TaxelWatch::default();
        watch.expect_noise(noise, 1.0);
        let mut one = Self { watch, scans: 0 };
        one.push(100.0);
        one
    }

    fn push(&mut self, count: f32) {
        self.watch.push(at(0.02 * f64::from(self.scans)), count, true, HOLD, &FaultLimits::default());
        self.scans += 1;
    }

    fn has(&self, fault: Fault) -> bool {
        self.watch.faults.contains(fault)
    }

    /// Goes up and down by so much from 100 counts until it jumps: after how many changes.
    fn flicker(&mut self, by: f32) -> Option<u32> {
        (1..=400).find(|change| {
            self.push(if change % 2 == 1 { 100.0 + by } else { 100.0 });
            self.has(Fault::Jumping)
        })
    }
}

/// The noise is 4 counts, or four times what is known; a jump counts for no more than ten counts. It began 1.5 s before.
#[test]
fn after_how_many_changes_a_taxel_jumps() {
    for (noise, by, changes) in [
        (0.0, 4.0, None),
        (0.0, 4.5, Some(32)),
        (0.0, 8.0, Some(4)),
        (0.0, 20.0, Some(3)),
        (0.5, 5.0, Some(16)),
        (2.0, 8.0, None),
        (2.0, 9.0, Some(32)),
        (f32::NAN, 5.0, Some(16)),
    ] {
        let mut one = One::new(noise);
        assert_eq!(one.flicker(by), changes, "{noise} {by}");
        let began = changes.map(|changes| at(0.02 * f64::from(changes) - 1.5));
        assert_eq!(one.watch.wrong_since(), began);
    }
    // Scans without a change are none: the converter is slower than the bus.
    let mut one = One::new(0.0);
    for count in [108.0, 108.0, 108.0, 100.0, 100.0, 108.0, 108.0, 108.0] {
        one.push(count);
        assert!(!one.has(Fault::Jumping));
    }
    one.push(100.0);
    assert!(one.has(Fault::Jumping));
}

#[test]
fn the_rails_are_the_ends_of_the_range() {
    for (count, rail) in [(-1.0, true), (0.0, true), (0.5, false), (254.5, false), (255.0, true), (256.0, true)] {
        let mut one = One::new(0.0);
        one.push(101.0);
        one.push(count);
        assert_eq!(one.has(Fault::Rail), rail, "{count}");
        assert_eq!(one.watch.wrong_since(), rail.then_some(at(0.04)));
    }
}

/// Seconds from the last change to when it is told, in scans of 50 ms.
fn still(watch: &mut TaxelWatch, from: f64, fault: Fault, others_change: bool) -> Option<f64> {
    (1..2_000).map(|scan| 0.05 * f64::from(scan)).find(|seconds| {
        watch.push(at(from + seconds), 100.0, others_change, HOLD, &FaultLimits::default());
        watch.faults.contains(fault)
    })
}

#[test]
fn after_how_many_seconds_a_still_taxel_is_frozen() {
    // Its known noise, how long its changes took in turns, whether others change.
    for (noise, intervals, others, after) in [
        (0.0, [0.05; 2], true, Some(2.05)),
        (0.0, [0.05; 2], false, None),
        (0.0, [0.5; 2], true, Some(10.05)),
        (0.0, [0.2, 0.6], true, Some(8.05)),
        (0.29, [0.05; 2], false, None),
        (0.31, [0.05; 2], false, Some(2.05)),
        (0.31, [0.5; 2], true, Some(2.05)),
    ] {
        let mut watch = TaxelWatch::default();
        watch.expect_noise(noise, 1.0);
        let mut last = 0.0;
        for change in 0..=10 {
            last += if change == 0 { 0.0 } else { intervals[change % 2] };
            let count = if change % 2 == 0 { 100.0 } else { 101.0 };
            watch.push(at(last), count, others, HOLD, &FaultLimits::default());
            assert_eq!(watch.is_lively, change > 0);
        }
        let is = still(&mut watch, last, Fault::Frozen, others);
        assert!(is.is_some() == after.is_some(), "{noise} {intervals:?} {others}: {is:?}");
        let Some((is, after)) = is.zip(after) else { continue };
        assert!((is - after).abs() < 1e-6, "{noise} {intervals:?} {others}: {is}");
        assert!(!watch.is_lively && watch.wrong_since() == Some(at(last)) && !watch.faults.contains(Fault::Dead));
    }
}

/// An eighth of a count is two steps of a converter of twelve bits: such a taxel never stands still either, also where all of
/// them do.
#[test]
fn a_fine_converter_that_stands_still_stays_frozen() {
    for (steps_per_count, frozen) in [(1.0, false), (16.0, true)] {
        let mut watch = TaxelWatch::default();
        watch.expect_noise(0.125, steps_per_count);
        for scan in 0..40 {
            let count = if scan % 2 == 0 { 100.0 } else { 100.125 };
            watch.push(at(0.02 * f64::from(scan)), count, true, HOLD, &FaultLimits::default());
        }
        for scan in 40..1_000 {
            watch.push(at(0.02 * f64::from(scan)), 100.0, false, HOLD, &FaultLimits::default());
        }
        assert_eq!(watch.faults.contains(Fault::Frozen), frozen, "{steps_per_count}");
    }
}

#[test]
fn after_how_many_seconds_a_taxel_that_never_changed_is_dead() {
    for (noise, others, after) in [(0.0, true, true), (0.0, false, false), (0.31, false, true), (0.29, false, false)] {
        let mut watch = TaxelWatch::default();
        watch.expect_noise(noise, 1.0);
        watch.push(at(5.0), 100.0, others, HOLD, &FaultLimits::default());
        let is = still(&mut watch, 5.0, Fault::Dead, others);
        assert!(is.map_or(!after, |is| after && (is - 3.05).abs() < 1e-6), "{noise} {others}: {is:?}");
        assert!(!watch.is_lively && !watch.faults.contains(Fault::Frozen));
        assert_eq!(watch.wrong_since(), after.then_some(at(5.0)));
    }
}

/// Four triangles.
fn detector() -> FaultDetector {
    let modules: Vec<_> = (0..4).map(|m| 10 * m..10 * m + 10).collect();
    FaultDetector::new(40, &modules, FaultLimits::default()).with_kinds([ModuleKind::Triangle; 4])
}

fn says(detector: &FaultDetector, taxel: usize) -> String {
    detector.faults(taxel).to_string()
}

#[test]
fn a_quarter_of_the_patch_says_that_the_rest_should_live() {
    for (lively, dead) in [(9, false), (10, true)] {
        let mut detector = detector();
        for scan in 0..100 {
            for module in 0..4 {
                let count = |t: usize| if module == 0 && t < lively { (100 + scan % 2) as f32 } else { 100.0 };
                let counts: Vec<f32> = (0..10).map(count).collect();
                detector.push_reals(at(0.05 * f64::from(scan)), module, &counts, 0);
            }
        }
        assert_eq!(detector.lively, lively);
        assert_eq!(says(&detector, 39), if dead { "dead" } else { "" }, "{lively}");
    }
}

#[test]
fn seven_of_ten_at_a_rail_condemn_their_module() {
    for (broken, flicker) in [(6, false), (7, true)] {
        let mut detector = detector();
        let counts = |at_rail: usize| -> Vec<f32> { (0..10).map(|t| if t < at_rail { 0.0 } else { 100.0 }).collect() };
        assert!(detector.push_reals(at(0.0), 1, &counts(broken), 0));
        assert_eq!(says(&detector, 10), if flicker { "saturated, module flicker" } else { "saturated" });
        assert_eq!(says(&detector, 19), if flicker { "module flicker" } else { "" });
        assert_eq!(detector.wrong_since(19), flicker.then_some(at(0.0)));
        assert!(!detector.push_reals(at(1.0), 1, &counts(broken), 0), "nothing is new");
        assert!(!detector.push_reals(at(2.9), 1, &counts(0), 0) && detector.push_reals(at(3.0), 1, &counts(0), 0));
        assert_eq!((says(&detector, 10), says(&detector, 19)), (String::new(), String::new()));
    }
}

/// The counts before and after more than a second of silence do not belong together.
#[test]
fn a_flicker_does_not_go_on_over_a_silence() {
    for (interval, jumps) in [(1.0, true), (1.01, false)] {
        let mut detector = detector();
        for scan in 0..8 {
            let count = if scan % 2 == 0 { 100.0 } else { 120.0 };
            detector.push_reals(at(interval * f64::from(scan)), 0, &[count; 10], 0);
        }
        assert_eq!(detector.faults(0).contains(Fault::Jumping), jumps, "{interval}");
    }
}

#[test]
fn what_a_status_word_or_a_suspicion_says_ends_after_its_time() {
    let mut detector = detector();
    for (status, words) in [(1, "no acknowledgement"), (2, "not connected"), (1 << 4, "out of range by status")] {
        let mut detector = detector.clone();
        assert!(detector.push_reals(at(1.0), 0, &[100.0; 10], status));
        assert_eq!(says(&detector, 0), words);
        assert_eq!(detector.wrong_since(0), Some(at(1.0)));
        assert!(!detector.push_reals(at(2.99), 0, &[100.0; 10], 0) && says(&detector, 0) == words);
        assert!(detector.push_reals(at(3.0), 0, &[100.0; 10], 0) && says(&detector, 0).is_empty());
    }
    // Several at once, each with its own end.
    detector.push_reals(at(1.0), 0, &[100.0; 10], 1);
    detector.push_reals(at(2.0), 0, &[100.0; 10], 2);
    assert_eq!(says(&detector, 0), "not connected, no acknowledgement");
    detector.push_reals(at(3.0), 0, &[100.0; 10], 0);
    assert_eq!(says(&detector, 0), "not connected");
    // Scans that come too fast, until the latest moment that was named.
    detector.suspect_module(at(4.0), 1, at(6.0));
    detector.suspect_module(at(4.0), 1, at(5.0));
    assert_eq!((says(&detector, 10), says(&detector, 20)), ("too fast".to_owned(), String::new()));
    assert_eq!(detector.wrong_since(10), Some(at(4.0)));
    assert!(!detector.push_reals(at(5.99), 1, &[100.0; 10], 0) && says(&detector, 10) == "too fast");
    assert!(detector.push_reals(at(6.0), 1, &[100.0; 10], 0) && says(&detector, 10).is_empty());
}

/// Which of its values a module's taxels are: the pads of a triangle are its values 6 and 10.
#[test]
fn a_status_bit_blames_the_taxel_of_its_value() {
    for (taxels, kind, blamed) in [
        (10, ModuleKind::Triangle, [Some(6), None, Some(9)]),
        (11, ModuleKind::PalmPad11, [Some(7), Some(10), None]),
        (12, ModuleKind::Fingertip, [Some(7), Some(10), Some(11)]),
        (11, ModuleKind::PalmPad7, [None, Some(9), Some(10)]),
    ] {
        for (value, blamed) in [7, 10, 11].into_iter().zip(blamed) {
            let module = std::slice::from_ref(&(0..taxels)).to_vec();
            let mut detector = FaultDetector::new(taxels, &module, FaultLimits::default()).with_kinds([kind]);
            detector.push_reals(at(0.0), 0, &vec![100.0; taxels], 16 << value);
            let found = (0..taxels).find(|taxel| detector.faults(*taxel).contains(Fault::StatusOutOfRange));
            assert_eq!(found, blamed, "value {value} of {taxels}");
        }
    }
}

#[test]
fn a_module_that_is_known_to_be_noisy_has_to_jump_further() {
    let jumps = |noise: f64, counts: &[f32]| {
        let mut detector = detector();
        detector.expect_noise([noise; 40], 1.0);
        for (scan, &count) in (1..).zip(counts) {
            detector.push_reals(at(0.02 * f64::from(scan)), 1, &[count; 10], 0);
        }
        detector.jump_counts(at(0.02 * counts.len() as f64), 1)
    };
    // The mean of ten has 0.63 of 2 counts, and five times as much is 3.2.
    assert_eq!(jumps(2.0, &[240.0, 237.0, 240.0, 237.0, 240.0]), 0.0);
    assert_eq!(jumps(2.0, &[240.0, 236.5, 240.0, 236.5, 240.0]), 3.5);
}

/// Half a minute of scans every 20 ms, in which each taxel goes between two counts at half the pace of the bus.
fn sound_scans(detector: &mut FaultDetector, from: Time) {
    for scan in 0..1_500_u32 {
        let count = |taxel: u32| if (scan / 2 + taxel).is_multiple_of(3) { 234 } else { 235 };
        let counts: Vec<u16> = (0..10).map(count).collect();
        for module in 0..4 {
            detector.push_module(from + Duration::from_millis(20) * scan, module, &counts, 0);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    /// Whatever comes, nothing panics, and 30 s of sound scans later nothing is left.
    #[test]
    fn every_fault_ends(
        garbage in prop::collection::vec((0usize..6, prop::collection::vec(0..=255_u16, 0..14), any::<u16>(), 0i64..3000), 0..60),
    ) {
        let (mut detector, mut now) = (detector(), at(0.0));
        for (module, counts, status, millis) in garbage {
            now = now + Duration::from_millis(millis as u64);
            detector.push_module(now, module, &counts, status);
            detector.on_silent(now, module);
        }
        sound_scans(&mut detector, now + Duration::from_millis(20));
        prop_assert!((0..40).all(|taxel| detector.faults(taxel).is_empty()));
        prop_assert_eq!(detector.lively, 40);
    }
}
