//! What the counts of a board show, and what they are worth.

use taxel_skin::{Board, BoardAddress, BusIndex, Module, Patch, Time};

use super::*;
use crate::baseline::{Activation, TaxelBaseline};
use crate::zero::rest::tests::Noise;

const MODULES: usize = 8;
const ZERO: u8 = 240;
/// A session holds the patch, and its bag presses on.
const IN_BAG: Bag = Bag { session_open: true, presses: true, holds: true };

/// One board of eight triangles at a zero of 240, with pads of 100.
struct Watched {
    continuity: Continuity,
    scans: i64,
    pads: [u8; 2],
    silent: [bool; MODULES],
    bag: Bag,
}

impl Watched {
    fn new() -> Self {
        Self::at_rest(true)
    }

    fn at_rest(at_rest: bool) -> Self {
        let modules = (0..MODULES as u8).map(|module| (Module::from_nibble(module), ModuleKind::Triangle)).collect();
        let board = Board { bus: BusIndex(0), address: BoardAddress::new(12).unwrap(), modules };
        let regions = Regions::new(&Patch::new("bag", vec![board]).unwrap());
        let zero = vec![TaxelBaseline { mean: f64::from(ZERO), noise: 0.8 }; regions.taxels()];
        let mut continuity = Continuity::new(&regions, &["12".to_owned()]);
        continuity.begin(at_rest);
        let mut ground = Ground::new(&regions, Activation { sigmas: 4.0, floor_counts: 2.0 });
        ground.take(&zero);
        continuity.compare_with(&ground);
        Self { continuity, scans: 0, pads: [100; 2], silent: [false; MODULES], bag: Bag::default() }
    }

    /// Takes so many scans in which each taxel feels `load` counts; the first finding.
    fn scan(&mut self, scans: usize, load: impl Fn(usize) -> i16) -> Option<Finding> {
        let counts: Vec<u8> = (0..10 * MODULES).map(|taxel| (i16::from(ZERO) - load(taxel)) as u8).collect();
        let sound: Vec<bool> = (0..counts.len()).map(|taxel| !self.silent[taxel / 10]).collect();
        let mut found = None;
        for _ in 0..scans {
            self.scans += 1;
            let scan = Scan {
                time: Time::from_nanos(self.scans * 50_000_000),
                whole: true,
                counts: (&counts).into(),
                pads: &[self.pads; MODULES],
                silent: &self.silent,
                sound: &sound,
                soundness: self.silent.iter().filter(|silent| **silent).count() as u64,
                jumps: &[],
            };
            let finding = self.continuity.on_scan(&scan, self.bag);
            found = found.or(finding.map(|(_, finding)| finding));
        }
        found
    }

    fn evidence(&self) -> Evidence {
        self.continuity.evidence(0, true).0
    }
}

/// Every taxel feels `load` counts for thirty scans and then, at once, nothing; the bag presses.
fn finding_after(load: impl Fn(usize) -> i16) -> Option<Finding> {
    let mut watched = Watched { bag: IN_BAG, ..Watched::new() };
    watched.scan(30, load).or(watched.scan(30, |_| 0))
}

#[test]
fn the_load_of_a_whole_board_does_not_vanish_while_the_bag_presses() {
    let found = finding_after(|_| 6);
    assert!(matches!(&found, Some(Finding::NewZero(why)) if why.contains("board 12 lost its load")), "{found:?}");
}

/// As on a real insole, whose noise now and then looks like a light touch of three taxels.
#[test]
fn a_few_taxels_that_read_nothing_again_are_no_new_zero_in_the_bag() {
    assert_eq!(finding_after(|taxel| if taxel % 27 == 0 { 6 } else { 0 }), None);
}

fn is_near(is: f32, expected: f64) -> bool {
    (f64::from(is) / expected - 1.0).abs() < 1e-4
}

/// Noise of 0.8 counts and the share that the recent mean adds; the mean over 16 scans is of 9.6 conversions.
#[test]
fn the_variance_of_a_mean_is_that_of_its_own_conversions_and_of_what_it_is_compared_with() {
    for (scans, expected) in [(1, 0.7265), (4, 0.353_167), (16, 0.153_167)] {
        assert!((variance(0.8, scans) - expected).abs() < 1e-6, "{scans}: {}", variance(0.8, scans));
    }
}

/// For twenty taxels and four pads, of which 16.1 are by chance and 5.74 a standard deviation.
#[test]
fn evidence_is_beyond_chance_by_so_many_standard_deviations() {
    for (bound, limit) in [(POSSIBLE, 46.057), (LIKELY, 60.248), (CERTAIN, 95.610)] {
        for mean in 0..3 {
            let of = |sum: f32| {
                let mut sums = [0.0; 3];
                sums[mean] = sum;
                Evidence { sums, taxels: 20.0, pads: 4.0 }
            };
            assert!(!of(limit - 0.01).exceeds(mean, bound) && of(limit + 0.01).exceeds(mean, bound), "{limit}");
        }
    }
    assert_eq!(Evidence { sums: [0.0; 3], taxels: 20.0, pads: 4.0 }.witnesses(), 28.0, "pads count twice");
    assert!(!Evidence { sums: [f32::MAX; 3], taxels: 0.0, pads: 0.0 }.exceeds(0, POSSIBLE), "who says nothing");
}

/// Pads that step by a count, seen in the newest scan, in a quarter and in a sixteenth of the means; in both directions.
#[test]
fn pads_that_move_are_evidence_in_both_directions() {
    for [little, much] in [[99, 90], [101, 110]] {
        let mut watched = Watched::new();
        watched.scan(30, |_| 0);
        assert_eq!(watched.evidence().sums, [0.0; 3]);
        watched.pads = [100, little];
        watched.scan(1, |_| 0);
        let Evidence { sums, taxels, pads } = watched.evidence();
        assert_eq!((taxels, pads), (80.0, 16.0));
        let each = [1.0 / 0.817_25, 0.0625 / 0.395_791_67, 0.003_906_25 / 0.170_010_42];
        assert!(sums.iter().zip(each).all(|(&sum, each)| is_near(sum, 8.0 * each)), "{sums:?}");
        assert_eq!(watched.continuity.evidence(0, false).0.sums, [0.0; 3], "in a bag nobody asks them");
        watched.pads = [100, much];
        watched.scan(1, |_| 0);
        assert_eq!(watched.evidence().sums[0], 8.0 * EVIDENCE_MAX, "one input counts for so much at most");
    }
}

/// Sixteen modules with two pads each, all of them with 0.8 counts of noise and rounded: four hundred zeros of a skin that
/// nothing happens to, watched for 70 scans each.
#[test]
fn noise_alone_takes_no_zero_away() {
    let modules = (0..16).map(|module| (Module::from_nibble(module), ModuleKind::Triangle)).collect();
    let board = Board { bus: BusIndex(0), address: BoardAddress::new(13).unwrap(), modules };
    let regions = Regions::new(&Patch::new("arm", vec![board]).unwrap());
    let mut ground = Ground::new(&regions, Activation { sigmas: 4.0, floor_counts: 2.0 });
    let mut noise = Noise(11);
    let mut count = |mean: f64| (mean + 0.8 * noise.normal()).round() as u8;
    let mut lost = 0;
    for _ in 0..400 {
        let zero: Vec<_> = (0..160)
            .map(|i| TaxelBaseline { mean: f64::from(ZERO) + 0.01 * f64::from(i % 100), noise: 0.85 })
            .collect();
        let mut continuity = Continuity::new(&regions, &["13".to_owned()]);
        continuity.begin(true);
        ground.take(&zero);
        continuity.compare_with(&ground);
        let found = (0..70).any(|k| {
            let counts: Vec<u8> = zero.iter().map(|taxel| count(taxel.mean)).collect();
            let pads: Vec<[u8; 2]> = (0..16).map(|_| [count(100.3), count(100.7)]).collect();
            let scan = Scan {
                time: Time::from_nanos(k * 50_000_000),
                whole: true,
                counts: (&counts).into(),
                pads: &pads,
                silent: &[false; 16],
                sound: &[true; 160],
                soundness: 0,
                jumps: &[],
            };
            matches!(continuity.on_scan(&scan, Bag::default()), Some((_, Finding::NewZero(_))))
        });
        lost += usize::from(found);
    }
    assert_eq!(lost, 0, "zeros of 400");
}

#[test]
fn pads_of_a_module_that_was_silent_lately_say_nothing() {
    let mut watched = Watched::new();
    watched.scan(30, |_| 0);
    watched.silent[2] = true;
    watched.scan(1, |_| 0);
    assert_eq!((watched.evidence().taxels, watched.evidence().pads), (70.0, 14.0));
    watched.silent[2] = false;
    watched.scan(15, |_| 0);
    assert_eq!((watched.evidence().taxels, watched.evidence().pads), (70.0, 14.0), "its means hold the silence");
    watched.scan(1, |_| 0);
    assert_eq!((watched.evidence().taxels, watched.evidence().pads), (80.0, 16.0));
}

/// A board that is heard all the time and sent a sign of trouble: its load is compared with what it was.
#[test]
fn a_doubted_board_that_reads_nothing_of_its_load_has_lost_its_zero() {
    let load = |taxel: usize| if taxel < 4 { 20 } else { 0 };
    for (scans_later, found) in [(0, true), (2, true), (3, false)] {
        let mut watched = Watched::at_rest(false);
        watched.scan(30, load);
        watched.continuity.doubt(0, "board 12 reported a lost acknowledgement".to_owned());
        assert_eq!(watched.scan(scans_later, load), None);
        let finding = watched.scan(1, |taxel| if taxel < 4 { 7 } else { 0 });
        let is = matches!(&finding, Some(Finding::NewZero(why)) if why.contains("while it was silent or reported"));
        assert_eq!(is, found, "{scans_later} scans later: {finding:?}");
    }
}

#[test]
fn a_new_zero_begins_without_any_scan() {
    let mut watched = Watched::new();
    watched.scan(30, |_| 20);
    watched.continuity.begin(true);
    assert_eq!((watched.continuity.taxels.scans(), watched.continuity.pads.scans()), (0, 0));
    assert_eq!(watched.scan(60, |_| 0), None);
}

/// A bag presses on the board, which falls silent. When it is heard again it reads nothing: of a bag that has pressed on all the
/// time that shows a new zero, of one that was let go meanwhile it shows nothing.
#[test]
fn a_board_that_was_silent_while_the_bag_let_go_has_not_lost_its_zero() {
    let vented = Bag { session_open: true, presses: false, holds: false };
    let falling = Bag { presses: true, ..vented };
    for (in_silence, after, lost) in
        [(IN_BAG, IN_BAG, true), (IN_BAG, falling, false), (falling, falling, false), (vented, vented, false)]
    {
        let mut watched = Watched { bag: IN_BAG, ..Watched::new() };
        assert_eq!(watched.scan(30, |_| 6), None);
        (watched.silent, watched.bag) = ([true; MODULES], in_silence);
        assert_eq!(watched.scan(10, |_| 6), None);
        (watched.silent, watched.bag) = ([false; MODULES], after);
        let finding = watched.scan(3, |_| 0);
        let is = matches!(&finding, Some(Finding::NewZero(why)) if why.contains("while it was silent"));
        assert_eq!(is, lost, "{in_silence:?}, {after:?}: {finding:?}");
    }
}
