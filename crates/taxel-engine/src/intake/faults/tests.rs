use super::detector::FaultDetector;
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
