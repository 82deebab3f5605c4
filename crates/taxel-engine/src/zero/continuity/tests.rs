//! Loads that vanish while the bag presses.

use taxel_skin::{Board, BoardAddress, BusIndex, Module, Patch, Time};

use super::*;
use crate::baseline::{Activation, TaxelBaseline};

/// One board of eight triangles at a zero of 240, every taxel of which feels `load` counts for thirty scans and then, at
/// once, nothing; the bag presses.
fn finding_after(load: impl Fn(usize) -> u8) -> Option<Finding> {
    let modules = (0..8).map(|module| (Module::from_nibble(module), ModuleKind::Triangle)).collect();
    let board = Board { bus: BusIndex(0), address: BoardAddress::new(12).unwrap(), modules };
    let regions = Regions::new(&Patch::new("bag", vec![board]).unwrap());
    let taxels = regions.taxels();
    let zero = vec![TaxelBaseline { mean: 240.0, noise: 0.8 }; taxels];
    let mut continuity = Continuity::new(&regions, &["12".to_owned()]);
    continuity.begin();
    let mut ground = Ground::new(&regions, Activation { sigmas: 4.0, floor_counts: 2.0 });
    ground.take(&zero);
    continuity.compare_with(&ground);
    let (pads, silent, sound) = (vec![[100; 2]; 8], [false; 8], vec![true; taxels]);
    let mut found = None;
    for scan in 0..60 {
        let counts: Vec<u8> = (0..taxels).map(|taxel| if scan < 30 { 240 - load(taxel) } else { 240 }).collect();
        let time = Time::from_nanos(scan * 50_000_000);
        let scan = Scan {
            time,
            whole: true,
            counts: (&counts).into(),
            pads: &pads,
            silent: &silent,
            sound: &sound,
            soundness: 1,
        };
        let finding = continuity.on_scan(&scan, Bag { session_open: true, presses: true, holds: true });
        found = found.or(finding.map(|(_, finding)| finding));
    }
    found
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
