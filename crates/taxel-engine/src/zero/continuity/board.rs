//! What is held against one board: doubts, silence, a load that is gone.

use std::ops::Range;

use crate::counts::{CountBuffer, Counts};
use crate::scan::Scan;
use crate::zero::bag::Bag;
use crate::zero::inputs::{KEPT, LANES};
use crate::zero::lanes::Reference;

/// Scans that a doubt lasts: as many as the longest mean runs over.
const PROBATION_SCANS: u8 = KEPT as u8;
/// Scans until all modules of a board that was silent are in a scan again.
const RETURN_SCANS: u8 = 3;
/// Fewest sound inputs, pads counted twice, that may clear a board of a doubt.
const WITNESSES_MIN: f32 = 8.0;
/// For so many scans at the most, in a row, a doubt waits for them.
const BLIND_SCANS_MAX: u8 = 160;
/// Of the load on a board less than this share remains when it vanishes.
const VANISHED_SHARE: f32 = 0.4;
/// A load on so many taxels, or fewer, may be their noise.
const LOAD_TAXELS_MIN: f32 = 3.0;
/// A load of so many counts in all is worth a doubt.
const LOAD_MIN_COUNTS: f32 = 12.0;

/// What is said of a board whose counts alone show it.
const CERTAIN: &str = "reads less than its zero on taxels that nothing touches, or on its thermal pads: it has taken a new \
                       zero, or the zero was taken under a load that has gone";
/// What is said of a board whose counts may show it.
const LIKELY: &str = "reads less than its zero on taxels that nothing touches: it may have taken a new zero";
/// What is said of a board that was suspected and whose counts bear it out.
const SINCE_SUSPECTED: &str = "lost its load at once, was not heard or reported a fault, and since then reads less than \
                               its zero on taxels that nothing touches: it has taken a new zero, or the zero was taken \
                               under a load that has gone";
/// What is said of a board that was silent or reported a fault.
const SINCE_SILENT: &str = "lost its load while it was silent or reported a fault: it has taken a new zero under it, or \
                            the load was lifted; unload the skin, ask for BringUp, and say with confirmed_by that nothing touches it";
/// What is said of a board on which the bag presses.
const IN_BAG: &str = "lost its load at once while the bag was pressing: it has taken a new zero";

/// What the test says of a board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Finding {
    /// It has taken a new zero, or nobody can tell any more; in words that name the board.
    NewZero(String),
    /// It may have; in words.
    Doubt(String),
}

/// What the counts of a scan show of a board.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// The means over four or sixteen scans are beyond any chance.
    pub certain: bool,
    /// The mean over sixteen scans is hardly chance.
    pub likely: bool,
    /// The scan itself is hardly chance.
    pub likely_now: bool,
    /// The mean over sixteen scans may be no chance.
    pub possible: bool,
    /// The load that lay on it is gone with this scan.
    pub load_vanishes: bool,
    /// That load was all over the board, and the bag presses as it did.
    pub vanishes_in_bag: bool,
    /// Sound inputs, pads counted twice.
    pub witnesses: f32,
}

/// A board and what is held against it.
#[derive(Clone, Debug, Default)]
pub struct BoardWatch {
    /// `board 13 `, to begin a sentence with.
    name: String,
    /// Its taxels and modules in the patch.
    pub taxels: Range<usize>,
    pub modules: Range<usize>,
    /// What its taxels are compared with, [`LANES`] at a time.
    pub references: Vec<Reference>,
    /// Why its zero is in doubt, and for how many scans yet.
    doubt: Option<(String, u8)>,
    /// For how many scans the doubt has waited because too few inputs were sound.
    blind: u8,
    /// For how many scans yet its force is a lower bound: its load vanished at once.
    vanished: u8,
    /// For how many scans yet its load has vanished lately, as far as another patch may find the reason for it later.
    vanished_lately: u8,
    /// For how many scans longer than that the counts have left it unclear.
    unclear: u8,
    /// All its modules are silent, or it is not well.
    silent: bool,
    /// It says that it is not well: what it sends says nothing.
    unwell: bool,
    /// What presses on it is the bag, as far as known when it was heard last.
    bag: Bag,
    /// What it read when it fell silent or was doubted, and for how many scans yet this is compared with.
    before: Option<(CountBuffer, u8)>,
}

impl BoardWatch {
    /// A board of which nothing was seen yet.
    #[must_use]
    pub fn new(name: String, taxels: Range<usize>, modules: Range<usize>) -> Self {
        Self { name, taxels, modules, ..Self::default() }
    }

    /// A zero was taken: nothing is held against the board, but what lay on one that is not well.
    pub fn begin(&mut self) {
        (self.doubt, self.blind, self.vanished, self.unclear) = (None, 0, 0, 0);
        self.vanished_lately = 0;
        if !self.unwell {
            self.before = None;
        }
    }

    /// It says that it is not well; `read` are the counts of the patch before, if there are.
    pub fn on_unwell(&mut self, read: Option<Counts<'_>>) {
        if let Some(counts) = read.filter(|_| !self.unwell) {
            self.keep(counts);
        }
        self.unwell = true;
    }

    /// It says that it is well again, and may have taken a new zero meanwhile.
    pub fn on_well(&mut self, why: String) {
        self.unwell = false;
        self.silent = false;
        self.doubt = Some((why, PROBATION_SCANS));
    }

    /// Something that it sent says that it may have taken a new zero; `read` are the counts of the patch before, if there
    /// are.
    pub fn suspect(&mut self, why: String, read: Option<Counts<'_>>) {
        self.doubt = Some((why, PROBATION_SCANS));
        self.silent = false;
        if let Some(counts) = read {
            self.keep(counts);
        }
    }

    /// Why its zero is in doubt. A silent board has no part in the force, and its doubt waits.
    #[must_use]
    pub fn doubted(&self) -> Option<&str> {
        self.doubt.as_ref().filter(|_| !self.silent).map(|(why, _)| why.as_str())
    }

    /// Whether its load has just vanished at once.
    #[must_use]
    pub const fn load_vanished(&self) -> bool {
        self.vanished > 0
    }

    /// Whether its load has vanished at once within twice as many scans as a proof of a new zero takes.
    #[must_use]
    pub const fn load_vanished_lately(&self) -> bool {
        self.vanished_lately > 0
    }

    /// Whether all its modules are silent. What it read is kept, and what it was doubted for waits.
    pub fn is_silent(&mut self, scan: &Scan<'_>, bag: Bag) -> bool {
        self.silent = self.unwell || self.modules.clone().all(|module| scan.silent[module]);
        if self.silent {
            if self.unwell {
                self.before.iter_mut().for_each(|(_, scans)| *scans = RETURN_SCANS);
            } else {
                self.keep(scan.counts);
            }
            if let Some((_, left)) = &mut self.doubt {
                *left = PROBATION_SCANS;
            }
        } else if self.bag.presses && !bag.holds {
            self.before = None; // the bag has let go meanwhile
        }
        if !self.silent {
            self.bag = bag;
        }
        self.silent
    }

    /// Keeps what the board read, of the counts of the patch, unless that is kept already, or what presses is a bag
    /// that lets go.
    fn keep(&mut self, counts: Counts<'_>) {
        if self.bag.presses && !self.bag.holds && self.before.is_none() {
            return;
        }
        let (_, scans) = self.before.get_or_insert_with(|| (counts.slice(self.taxels.clone()).into(), 0));
        *scans = RETURN_SCANS;
    }

    /// Says so if a board that was silent or doubted until now reads nothing of the load that lay on it before. Nobody can
    /// tell whether the load was lifted meanwhile or the board has taken a new zero under it.
    pub fn has_lost_its_load(&mut self, counts: Counts<'_>) -> Option<String> {
        let (then, left) = self.before.as_mut()?;
        *left -= 1;
        let mut load = [0.0; 3];
        let now = counts.slice(self.taxels.clone()).iter_units();
        for (i, (then, now)) in then.counts().iter_units().zip(now).enumerate() {
            let Some(reference) = self.references.get(i / LANES) else { break };
            let of_one = reference.load(i % LANES, then as f32, now as f32);
            load.iter_mut().zip(of_one).for_each(|(sum, value)| *sum += value);
        }
        self.before.take_if(|(_, left)| *left == 0);
        is_vanished(load).then(|| format!("{}{SINCE_SILENT}", self.name))
    }

    /// What follows from a scan.
    pub fn judge(&mut self, seen: &Seen) -> Option<Finding> {
        let clears = wait(self.vanished, seen.possible);
        self.vanished = if seen.load_vanishes { PROBATION_SCANS } else { self.vanished };
        self.vanished_lately =
            if seen.load_vanishes { 2 * PROBATION_SCANS } else { self.vanished_lately.saturating_sub(1) };
        if seen.certain {
            return Some(self.new_zero(CERTAIN));
        }
        if seen.vanishes_in_bag {
            return Some(self.new_zero(IN_BAG));
        }
        if seen.likely && (self.doubt.is_some() || self.vanished > 0) {
            return Some(self.new_zero(SINCE_SUSPECTED));
        }
        if !seen.load_vanishes {
            self.vanished = clears;
        }
        if seen.likely_now && self.doubt.is_none() {
            let why = format!("{}{LIKELY}", self.name);
            self.doubt = Some((why.clone(), PROBATION_SCANS));
            return Some(Finding::Doubt(why));
        }
        let blind = seen.witnesses < WITNESSES_MIN;
        self.blind = if blind && self.doubt.is_some() { self.blind.saturating_add(1) } else { 0 };
        if let Some((_, left)) = &mut self.doubt {
            // Its last scan waits for taxels that are sound again, as they soon are after frames came late and all at once.
            *left = wait(*left, seen.possible || (blind && self.blind <= BLIND_SCANS_MAX));
        }
        self.end_doubt(seen)
    }

    /// Ends a doubt whose scans are over, or finds that nobody can end it.
    fn end_doubt(&mut self, seen: &Seen) -> Option<Finding> {
        let waits = self.vanished.max(self.doubt.as_ref().map_or(0, |(_, left)| *left));
        // Whoever is suspected has its last scan to wait for as long as the counts leave it unclear.
        self.unclear = if seen.possible && waits == 1 { self.unclear + 1 } else { 0 };
        if self.unclear >= PROBATION_SCANS {
            return Some(self.new_zero(SINCE_SUSPECTED));
        }
        let (why, _) = self.doubt.take_if(|(_, left)| *left == 0)?;
        let blind = seen.witnesses < WITNESSES_MIN;
        blind.then(|| Finding::NewZero(format!("{why}, and too few of its taxels are sound to show that it has not")))
    }

    fn new_zero(&self, why: &str) -> Finding {
        Finding::NewZero(format!("{}{why}", self.name))
    }
}

/// Whether a load (its counts then and now, and how many taxels it lay on) was one, and has vanished.
#[must_use]
pub fn is_vanished([was, is, touched]: [f32; 3]) -> bool {
    touched >= LOAD_TAXELS_MIN && was >= LOAD_MIN_COUNTS && is < VANISHED_SHARE * was
}

/// One scan less to wait for, but not the last one while the counts leave it unclear.
fn wait(left: u8, unclear: bool) -> u8 {
    if unclear { left.saturating_sub(1).max(left.min(1)) } else { left.saturating_sub(1) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUIET: Seen = Seen {
        certain: false,
        likely: false,
        likely_now: false,
        possible: false,
        load_vanishes: false,
        vanishes_in_bag: false,
        witnesses: WITNESSES_MIN,
    };
    const LIKELY: Seen = Seen { likely: true, ..QUIET };
    const POSSIBLE: Seen = Seen { possible: true, ..QUIET };
    const VANISHES: Seen = Seen { load_vanishes: true, ..QUIET };

    fn board() -> BoardWatch {
        BoardWatch::new("board 12 ".to_owned(), 0..80, 0..8)
    }

    fn doubted() -> BoardWatch {
        let mut board = board();
        board.suspect("board 12 was not heard".to_owned(), None);
        board
    }

    /// How many scans of this come before the first finding, and what that is; `None` of two hundred.
    fn scans(board: &mut BoardWatch, seen: Seen) -> Option<(usize, Finding)> {
        (0..200).find_map(|scan| Some((scan, board.judge(&seen)?)))
    }

    #[test]
    fn what_is_likely_of_any_board_is_proof_of_a_suspected_one() {
        assert_eq!(board().judge(&LIKELY), None);
        assert!(matches!(doubted().judge(&LIKELY), Some(Finding::NewZero(why)) if why.contains("and since then")));
        // A load that vanished is a suspicion for sixteen scans.
        for (quiet, suspected) in [(0, true), (15, true), (16, false)] {
            let mut board = board();
            assert_eq!(board.judge(&VANISHES), None);
            (0..quiet).for_each(|_| assert_eq!(board.judge(&QUIET), None));
            assert_eq!((board.load_vanished(), board.judge(&LIKELY).is_some()), (suspected, suspected), "{quiet}");
        }
    }

    #[test]
    fn a_doubt_is_over_after_sixteen_scans_unless_they_leave_it_unclear() {
        let mut clear = doubted();
        (0..15).for_each(|_| assert!(clear.judge(&QUIET).is_none() && clear.doubted().is_some()));
        assert!(clear.judge(&QUIET).is_none() && clear.doubted().is_none());
        // Fifteen scans of the doubt, and its last one sixteen times.
        assert!(matches!(scans(&mut doubted(), POSSIBLE), Some((29, Finding::NewZero(_)))));
        let mut late = doubted();
        (0..15).for_each(|_| assert_eq!(late.judge(&QUIET), None));
        assert!(matches!(scans(&mut late, POSSIBLE), Some((15, Finding::NewZero(_)))));
        assert_eq!(scans(&mut board(), POSSIBLE), None, "of a board that nobody suspects");
    }

    #[test]
    fn a_doubt_waits_for_sound_taxels_but_not_for_ever() {
        let blind = Seen { witnesses: WITNESSES_MIN - 0.1, ..QUIET };
        let mut hidden = doubted();
        let Some((160, Finding::NewZero(why))) = scans(&mut hidden, blind) else { panic!("{hidden:?}") };
        assert!(why.starts_with("board 12 was not heard, and too few"), "{why}");
        // A taxel counts as sound if it was so in sixteen scans: one scan with enough of them shows what a doubt asks for.
        for scans_blind in [15, 16, 160] {
            let mut board = doubted();
            (0..scans_blind).for_each(|_| assert!(board.judge(&blind).is_none() && board.doubted().is_some()));
            assert!(board.judge(&QUIET).is_none() && board.doubted().is_none(), "{scans_blind}");
        }
    }

    #[test]
    fn a_scan_that_is_hardly_chance_is_a_doubt_once() {
        let mut board = board();
        let now = Seen { likely_now: true, ..QUIET };
        assert!(matches!(board.judge(&now), Some(Finding::Doubt(_))) && board.doubted().is_some());
        assert_eq!(board.judge(&now), None);
    }

    #[test]
    fn a_load_is_so_many_counts_on_so_many_taxels_and_vanishes_when_little_of_it_is_left() {
        assert!(is_vanished([12.0, 4.7, 3.0]));
        for other in [[12.0, 4.9, 3.0], [11.9, 0.0, 3.0], [12.0, 0.0, 2.0]] {
            assert!(!is_vanished(other), "{other:?}");
        }
    }
}
