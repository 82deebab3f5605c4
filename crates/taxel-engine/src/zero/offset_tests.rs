//! Where the zero is: by the pads, by what nothing touches, and never by what may be a load.

use taxel_skin::ModuleKind;

use super::*;
use crate::tests::patch;
use crate::zero::module_offset::GUESS;
use crate::zero::rest::tests::Noise;

const MODULES: usize = 8;
const TAXELS: usize = 10 * MODULES;
const ZERO: f64 = 240.3;

/// A board of eight triangles, scanned every 50 ms.
struct Watched {
    offset: Offset,
    ground: Ground,
    taken: Vec<TaxelBaseline>,
    noise: Noise,
    scans: i64,
    pads: f64,
}

impl Watched {
    fn new(follow: bool) -> Self {
        let regions = Regions::new(&patch(&[ModuleKind::Triangle; MODULES]));
        let taken = vec![TaxelBaseline { mean: ZERO, noise: 0.85 }; TAXELS];
        let mut ground = Ground::new(&regions);
        ground.take(&taken);
        let offset = Offset::new(follow, &regions);
        let mut new = Self { offset, ground, taken, noise: Noise(5), scans: 0, pads: 100.4 };
        new.seconds(2.0, |_| 0.0);
        new.zero();
        new
    }

    fn zero(&mut self) {
        let pads = self.offset.pads();
        self.offset.begin(&pads);
        self.offset.weigh(&vec![-0.1; TAXELS]);
    }

    /// In which each taxel reads so many counts towards load.
    fn seconds(&mut self, seconds: f64, load: impl Fn(usize) -> f64) {
        for _ in 0..(20.0 * seconds).round() as usize {
            self.scans += 1;
            let mut count = |mean: f64| (mean + 0.8 * self.noise.normal()).round() as u16;
            let counts: Vec<u16> = (0..TAXELS).map(|taxel| count(ZERO - load(taxel))).collect();
            let pads: Vec<[u8; 2]> = (0..MODULES).map(|_| [0; 2].map(|_: u8| count(self.pads) as u8)).collect();
            let scan = Scan {
                time: Time::from_nanos(self.scans * 50_000_000),
                whole: true,
                counts: (&counts).into(),
                pads: &pads,
                silent: &[false; MODULES],
                sound: &[true; TAXELS],
                soundness: 0,
                jumps: &[],
            };
            self.offset.on_scan(&scan, true, &self.ground, Some(&self.taken));
        }
    }

    fn offset(&self, module: usize) -> f64 {
        self.offset.modules[module].offset()
    }

    fn sigma(&self, module: usize) -> f64 {
        self.offset.modules[module].variance().sqrt()
    }
}

fn near(is: f64, expected: f64, within: f64) {
    assert!((is - expected).abs() <= within, "{is}, expected {expected}");
}

#[test]
fn what_a_module_learns_of_its_pads_it_and_the_others_know_later() {
    let mut watched = Watched::new(true);
    let touched = |taxel: usize| if taxel < 10 { 20.0 } else { 0.0 };
    for minute in 0..40 {
        watched.pads = 100.4 - 0.1 * f64::from(minute);
        watched.seconds(60.0, |taxel| 0.04 * f64::from(minute) + touched(taxel));
    }
    near(coefficient_of_all(&watched.offset.modules)[0], 0.4, 0.1);
    near(watched.offset(3), 1.56, 0.1);
    near(watched.offset(0), 1.56, 0.6);
    near(watched.ground.zero()[0].mean, ZERO, 1e-9);
    near(watched.offset.applied_to(&watched.taken, watched.ground.signs())[40].mean, ZERO - 1.56, 0.2);
}

/// The tables follow lighter alone, unless the zero is to follow the temperature; then to its bound.
#[test]
fn the_tables_follow_what_no_load_can_be_and_the_rest_where_it_is_asked_for() {
    for (follow, drift, moved) in [(false, -0.5, -0.5), (false, 0.3, 0.0), (true, -0.5, -0.5), (true, -6.0, -3.0)] {
        let mut watched = Watched::new(follow);
        watched.seconds(60.0, |_| drift);
        near(watched.offset.followed_counts(), moved, 0.1);
        assert_eq!(watched.offset.shortcoming().is_some(), follow && drift < -3.0, "{follow} {drift}");
    }
}

/// A load that lay on the skin when its zero was taken hides in it no longer once it has gone. Cold takes none away.
#[test]
fn what_has_left_the_skin_hides_in_the_zero_no_longer_unless_cold_explains_it() {
    for (pads, left) in [(0.0, -0.8), (0.9, 0.0), (-0.9, -0.8 - 0.45)] {
        let mut watched = Watched::new(false);
        watched.pads += pads;
        watched.seconds(60.0, |_| -0.8);
        let stays = watched.offset.what_stays_of(&watched.taken, watched.ground.signs());
        near(ZERO - stays[40].mean, left, 0.2);
    }
}

/// Of 0.1 N a count of each taxel, modules are off together, and a skin that is lighter by less than a step of the tables hides
/// as much of a load.
#[test]
fn what_the_zero_hides_and_its_uncertainty_are_told_as_forces() {
    let mut watched = Watched::new(false);
    near(watched.offset.sigma().0, MODULES as f64 * ZERO_SIGMA, 1e-9);
    near(watched.offset.hides().0, 0.0, 1e-9);
    watched.seconds(8.0, |_| -0.1);
    near(watched.offset.hides().0, 0.1 * MODULES as f64, 0.4);
    assert!(watched.offset.sigma().0 < 0.8, "{:?}", watched.offset.sigma());
    watched.pads += 4.0;
    watched.seconds(4.0, |_| 10.0);
    assert!(watched.offset.sigma().0 > 1.0, "what pads predict is common: {:?}", watched.offset.sigma());
}

#[test]
fn after_a_restart_the_first_scan_tells_what_the_pads_say_of_the_time_between() {
    let mut watched = Watched::new(false);
    let then = watched.offset.pads();
    watched.pads += 6.0;
    watched.seconds(2.0, |_| 0.0);
    watched.offset.begin(&then);
    watched.seconds(0.1, |_| 0.0);
    near(watched.offset(0), -6.0 * GUESS, 0.4);
    assert!(watched.sigma(0) > 1.0, "{}", watched.sigma(0));
}
