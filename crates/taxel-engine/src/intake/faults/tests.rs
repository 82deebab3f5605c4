use super::detector::FaultDetector;
use super::fault::Fault;
use super::limits::FaultLimits;
use proptest::prelude::*;
use std::time::Duration;
use taxel_skin::Time;

const MODULES: usize = 4;
const TAXELS: usize = 10 * MODULES;
const PERIOD: Duration = Duration::from_millis(20);

/// A small linear congruential generator: tests need repeatable noise, not good noise.
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }

    /// About normal, standard deviation 1.
    fn normal(&mut self) -> f32 {
        (0..12).map(|_| self.uniform()).sum::<f32>() - 6.0
    }
}

struct Rig {
    detector: FaultDetector,
    noise: Noise,
    now: Time,
    last: Vec<u8>,
    scan: u32,
}

impl Rig {
    fn new(seed: u64) -> Self {
        let modules: Vec<_> = (0..MODULES).map(|m| 10 * m..10 * m + 10).collect();
        let detector = FaultDetector::new(TAXELS, &modules, FaultLimits::default());
        Self { detector, noise: Noise(seed), now: Time::from_nanos(0), last: vec![240; TAXELS], scan: 0 }
    }

    /// One scan; `level` gives what each taxel would read without noise, `None` where it keeps 240 for ever.
    fn scan(&mut self, status: u16, level: impl Fn(usize, u32) -> Option<f32>) {
        self.now = self.now + PERIOD;
        self.scan += 1;
        for taxel in 0..TAXELS {
            let converted = (self.scan as usize + taxel).is_multiple_of(2); // the converter is half as fast as the bus
            let noisy =
                level(taxel, self.scan).map(|l| (l + 1.1 * self.noise.normal()).round().clamp(0.0, 255.0) as u8);
            self.last[taxel] = match noisy {
                None => 240,
                Some(count) if converted => count,
                Some(_) => self.last[taxel],
            };
        }
        for module in 0..MODULES {
            let status = if module == 0 { status } else { 0 };
            self.detector.push_module(self.now, module, &self.last[10 * module..10 * module + 10], status);
        }
    }

    fn seconds(&mut self, seconds: f32, level: impl Fn(usize, u32) -> Option<f32> + Copy) {
        for _ in 0..(seconds / 0.02) as u32 {
            self.scan(0, level);
        }
    }

    fn faulty(&self) -> Vec<(usize, String)> {
        let named = |t| (t, self.detector.faults(t).to_string());
        (0..TAXELS).map(named).filter(|(_, f)| !f.is_empty()).collect()
    }
}

fn sound(_: usize, _: u32) -> Option<f32> {
    Some(235.0)
}

#[test]
fn a_sound_skin_has_no_fault_under_rest_ramps_and_blows() {
    let mut rig = Rig::new(1);
    let load = |_: usize, scan: u32| {
        let ramp = 40.0 * (scan as f32 / 400.0).min(1.0);
        let blow = if scan.is_multiple_of(300) { 60.0 } else { 0.0 };
        Some(235.0 - ramp - blow)
    };
    for _ in 0..1500 {
        rig.scan(0, load);
        assert_eq!(rig.faulty(), vec![], "at {}", rig.now);
    }
}

#[test]
fn a_fast_vent_and_a_load_that_lands_on_everything_are_no_fault() {
    let mut rig = Rig::new(2);
    rig.seconds(4.0, |_, _| Some(190.0));
    let begun = rig.scan;
    for _ in 0..100 {
        rig.scan(0, |_, s| Some(240.0 - 50.0 * (-((s - begun) as f32) * 0.02 / 0.3).exp()));
        assert_eq!(rig.faulty(), vec![], "venting at {}", rig.now);
    }
    rig.seconds(2.0, |_, _| Some(240.0));
    for _ in 0..100 {
        rig.scan(0, |_, _| Some(200.0));
        assert_eq!(rig.faulty(), vec![], "loaded at {}", rig.now);
    }
}

#[test]
fn rails_are_named_at_once_and_end_by_themselves() {
    let mut rig = Rig::new(3);
    rig.seconds(1.0, sound);
    rig.scan(0, |t, _| Some(if t == 7 { -20.0 } else { 235.0 }));
    rig.scan(0, |t, _| Some(if t == 7 { -20.0 } else { 235.0 }));
    assert_eq!(rig.faulty(), vec![(7, "rail".to_owned())]);
    rig.seconds(1.5, sound);
    assert_eq!(rig.faulty(), vec![(7, "rail".to_owned())], "held");
    rig.seconds(1.5, sound);
    assert_eq!(rig.faulty(), vec![]);
}

#[test]
fn a_flickering_taxel_is_jumping_from_before_it_was_found() {
    let mut rig = Rig::new(4);
    rig.seconds(5.0, sound);
    let begun = rig.now;
    let flicker = |t: usize, s: u32| Some(if t == 12 && (s / 3).is_multiple_of(2) { 223.0 } else { 235.0 });
    rig.seconds(3.0, flicker);
    assert_eq!(rig.faulty(), vec![(12, "jumping".to_owned())]);
    let since = rig.detector.wrong_since(12).expect("it has a fault");
    assert!((since.seconds_since(begun)).abs() < 1.6, "since {since}, began {begun}");
    rig.seconds(9.0, sound);
    assert_eq!(rig.faulty(), vec![]);
    assert_eq!(rig.detector.wrong_since(12), None);
}

#[test]
fn four_flickering_taxels_do_not_condemn_their_module_but_eight_do() {
    let flicker = |many: usize| {
        move |t: usize, s: u32| {
            Some(if t / 10 == 1 && t % 10 < many && (s / 3).is_multiple_of(2) { 220.0 } else { 235.0 })
        }
    };
    let mut rig = Rig::new(5);
    rig.seconds(4.0, flicker(4));
    assert_eq!(rig.faulty().iter().map(|f| f.0).collect::<Vec<_>>(), (10..14).collect::<Vec<_>>());
    rig.seconds(4.0, flicker(8));
    assert_eq!(rig.faulty().len(), 10);
    assert!(
        rig.detector.faults(19).contains(Fault::ModuleFlicker) && !rig.detector.faults(19).contains(Fault::Jumping)
    );
    rig.seconds(9.0, sound);
    assert_eq!(rig.faulty(), vec![]);
}

#[test]
fn frozen_and_dead_taxels_are_told_apart_and_come_back() {
    let mut rig = Rig::new(6);
    rig.seconds(2.0, |t, _| (t != 5).then_some(235.0));
    let stops = rig.now;
    rig.seconds(4.0, |t, _| (t != 5 && t != 25).then_some(235.0));
    assert_eq!(rig.faulty(), vec![(5, "dead".to_owned()), (25, "frozen".to_owned())]);
    let since = rig.detector.wrong_since(25).expect("it has a fault");
    assert!(since.seconds_since(stops).abs() < 0.2, "since {since}, stopped {stops}");
    rig.seconds(1.0, sound);
    assert_eq!(rig.faulty().len(), 2, "held for 2 s");
    rig.seconds(2.0, sound);
    assert_eq!(rig.faulty(), vec![]);
}

#[test]
fn a_skin_without_noise_is_not_dead_unless_its_noise_is_known() {
    let mut rig = Rig::new(7);
    rig.seconds(10.0, |_, _| None);
    assert_eq!(rig.faulty(), vec![]);
    rig.detector.expect_noise([1.0; TAXELS], 1.0);
    rig.seconds(0.1, |_, _| None);
    assert_eq!(rig.faulty().len(), TAXELS);
}

#[test]
fn status_bits_blame_the_taxels_they_name() {
    let mut rig = Rig::new(8);
    rig.seconds(0.5, sound);
    rig.scan(1 << (4 + 11), sound); // value 11 is the triangle's last taxel
    assert_eq!(rig.faulty(), vec![(9, "out of range by status".to_owned())]);
    rig.scan(1 << (4 + 6), sound); // value 6 is a thermal pad
    assert_eq!(rig.faulty().len(), 1);
    rig.scan(3, sound);
    let words = rig.detector.faults(0).to_string();
    assert_eq!(words, "not connected, no acknowledgement");
    rig.seconds(2.1, sound);
    assert_eq!(rig.faulty(), vec![]);
}

#[test]
fn silence_makes_stale_and_the_next_scan_ends_it() {
    let mut rig = Rig::new(9);
    rig.seconds(2.0, sound);
    assert!(!rig.detector.tick(rig.now + Duration::from_millis(900)));
    assert!(rig.detector.tick(rig.now + Duration::from_millis(1100)));
    assert!(rig.detector.faults(0).contains(Fault::Stale));
    rig.now = rig.now + Duration::from_secs(2);
    rig.scan(0, sound);
    assert_eq!(rig.faulty(), vec![]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    /// Whatever comes, nothing panics, and 30 s of sound scans later nothing is left.
    #[test]
    fn every_fault_ends(
        seed in any::<u64>(),
        garbage in prop::collection::vec((0usize..6, prop::collection::vec(any::<u8>(), 0..14), any::<u16>(), 0u64..3000), 0..60),
    ) {
        let mut rig = Rig::new(seed);
        for (module, counts, status, millis) in garbage {
            rig.now = rig.now + Duration::from_millis(millis);
            rig.detector.push_module(rig.now, module, &counts, status);
            rig.detector.tick(rig.now);
        }
        rig.seconds(30.0, sound);
        prop_assert_eq!(rig.faulty(), vec![]);
        prop_assert_eq!(rig.detector.lively, TAXELS);
    }

    /// Missing values change nothing.
    #[test]
    fn missing_values_are_ignored(seed in any::<u64>()) {
        let mut rig = Rig::new(seed);
        rig.seconds(2.0, sound);
        let before = rig.faulty();
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            rig.detector.push_reals(rig.now, 0, &[bad; 10], 0);
        }
        prop_assert_eq!(rig.faulty(), before);
    }
}
