//! What the counts of a board show, and what they are worth.

use taxel_skin::Time;

use super::account::LEARNING_SCANS;
use super::*;
use crate::baseline::TaxelBaseline;
use crate::tests::patch;
use crate::zero::rest::tests::Noise;

const MODULES: usize = 8;
const ZERO: f64 = 240.3;
/// A session holds the patch, and its bag presses on.
const IN_BAG: Bag = Bag { session_open: true, presses: true, holds: true };

/// One board of eight triangles with noise of 0.8 counts, and pads of 100.
struct Watched {
    evidence: Evidence,
    noise: Noise,
    scans: i64,
    pads: f64,
    silent: [bool; MODULES],
    /// Only five taxels are sound.
    is_deaf: bool,
    bag: Bag,
    /// What the last scan showed of a new zero.
    lost: Option<String>,
}

impl Watched {
    fn new() -> Self {
        let patch = patch(&[ModuleKind::Triangle; MODULES]);
        let regions = Regions::new(&patch);
        let mut evidence = Evidence::new(&regions, &patch);
        evidence.begin(true);
        let mut ground = Ground::new(&regions);
        ground.take(&vec![TaxelBaseline { mean: ZERO, noise: 0.85 }; regions.taxels()]);
        evidence.compare_with(&ground);
        let (silent, bag) = ([false; MODULES], Bag::default());
        Self { evidence, noise: Noise(11), scans: 0, pads: 100.4, silent, is_deaf: false, bag, lost: None }
    }

    /// Takes so many scans in which each taxel feels `load` counts; when a new zero or a suspicion came first, and why.
    fn scan(&mut self, scans: usize, load: impl Fn(usize) -> f64) -> Option<(usize, String)> {
        let mut found = None;
        for after in 0..scans {
            self.scans += 1;
            let mut count = |mean: f64| (mean + 0.8 * self.noise.normal()).round() as u16;
            let counts: Vec<u16> = (0..10 * MODULES).map(|taxel| count(ZERO - load(taxel))).collect();
            let pads: Vec<[u8; 2]> = (0..MODULES).map(|_| [0; 2].map(|_: u8| count(self.pads) as u8)).collect();
            let sound: Vec<bool> =
                (0..counts.len()).map(|taxel| !self.silent[taxel / 10] && (taxel < 5 || !self.is_deaf)).collect();
            let scan = Scan {
                time: Time::from_nanos(self.scans * 50_000_000),
                whole: true,
                counts: (&counts).into(),
                pads: &pads,
                silent: &self.silent,
                sound: &sound,
                soundness: self.silent.iter().filter(|silent| **silent).count() as u64,
                jumps: &[],
            };
            let suspect = self.evidence.suspicion().is_some();
            self.lost = self.evidence.on_scan(&scan, self.bag).map(|(_, why)| why);
            let suspicion = self.evidence.suspicion().filter(|_| !suspect).map(str::to_owned);
            found = found.or_else(|| Some((after, self.lost.clone().or(suspicion)?)));
        }
        found
    }

    fn lost(&mut self, scans: usize, load: impl Fn(usize) -> f64) -> Option<String> {
        (0..scans).find_map(|_| {
            self.scan(1, &load);
            self.lost.take()
        })
    }
}

/// Residues of a new zero, a count up or down.
fn residue(taxel: usize) -> f64 {
    if (taxel * 7) % 5 < 2 { -1.0 } else { 1.0 }
}

#[test]
fn a_new_zero_shows_on_what_nothing_touches_within_two_seconds_and_a_light_load_does_not_hide_it() {
    for load in [0.0, 10.0] {
        let pressed = |taxel: usize| if taxel < 20 { load } else { 0.0 };
        let mut watched = Watched::new();
        watched.scan(200, pressed);
        let why = watched.lost(40, |taxel| if taxel < 20 { 0.0 } else { residue(taxel) });
        assert!(why.as_ref().is_some_and(|why| why.starts_with("board 1 reads less than its zero")), "{why:?}");
    }
}

/// What is said to be missed, and half and twice of it. A count of each taxel weighs 0.1 N.
#[test]
fn remnants_that_are_said_to_be_missed_are_about_the_least_that_are_found() {
    let missed = Watched::new().evidence.missed_counts();
    assert!((0.3..0.6).contains(&missed), "{missed}");
    for (times, is_found) in [(0.5, false), (2.0, true)] {
        let mut watched = Watched::new();
        watched.scan(200, |_| 0.0);
        let why = watched.lost(LEARNING_SCANS as usize, |taxel| times * missed * residue(taxel));
        assert_eq!(why.is_some(), is_found, "{times} times {missed} counts: {why:?}");
    }
    let mut watched = Watched::new();
    watched.evidence.weigh(&[0.1; 10 * MODULES]);
    let newton = 0.1 * missed * (10.0 * MODULES as f64).sqrt();
    assert!((watched.evidence.missed_n() - newton).abs() < 1e-9, "{}", watched.evidence.missed_n());
}

#[test]
fn pads_that_step_are_evidence_in_both_directions_but_in_a_bag() {
    for (step, bag, lost) in [(4.0, Bag::default(), true), (-4.0, Bag::default(), true), (4.0, IN_BAG, false)] {
        let mut watched = Watched { bag, ..Watched::new() };
        watched.scan(100, |_| 0.0);
        watched.pads += step;
        assert_eq!(watched.lost(40, |_| 0.0).is_some(), lost, "{step} {bag:?}");
    }
}

#[test]
fn a_suspect_board_is_cleared_by_its_counts_and_waits_for_sound_ones_but_not_for_ever() {
    let mut watched = Watched::new();
    watched.scan(50, |_| 0.0);
    watched.evidence.suspect(0, "board 12 was not heard".to_owned());
    assert_eq!(watched.scan(8, |_| 0.0), None);
    assert_eq!(watched.evidence.suspicion(), Some("board 12 was not heard"));
    assert_eq!(watched.scan(20, |_| 0.0), None);
    assert_eq!(watched.evidence.suspicion(), None);
    watched.evidence.suspect(0, "board 12 was not heard".to_owned());
    (watched.is_deaf, watched.pads) = (true, -20.0);
    let why = watched.lost(200, |_| 0.0).expect("nobody can tell any more");
    assert!(why.contains("too few of its taxels are sound"), "{why}");
}

/// A load that vanishes bounds nothing for some scans, and then, with a board that kept its zero, everything is as before.
#[test]
fn a_load_that_vanishes_at_once_is_told_until_the_counts_have_cleared_the_board() {
    let mut watched = Watched::new();
    watched.scan(50, |taxel| if taxel < 5 { 20.0 } else { 0.0 });
    assert_eq!(watched.evidence.unloaded().count(), 0);
    let told = (0..40).filter(|_| {
        assert_eq!(watched.scan(1, |_| 0.0), None);
        watched.evidence.unloaded().count() == 1
    });
    let told = told.count();
    assert!((4..=16).contains(&told), "{told} scans");
}

#[test]
fn the_load_of_a_whole_board_does_not_vanish_while_the_bag_presses_and_that_of_few_taxels_may() {
    for (every, lost) in [(1, true), (27, false)] {
        let mut watched = Watched { bag: IN_BAG, ..Watched::new() };
        watched.scan(30, |taxel| if taxel % every == 0 { 6.0 } else { 0.0 });
        let why = watched.lost(30, |_| 0.0);
        assert_eq!(why.is_some_and(|why| why.contains("while the bag was pressing")), lost, "one in {every}");
    }
}
