//! One board's account: what is paid in, and what follows from it.

use std::ops::Range;

use super::inputs::{Taxel, is_vanished, sum};
use crate::scan::Scan;
use crate::zero::bag::Bag;

/// The account from which on a board is suspect, below which it is clear again, and from which on its zero is lost.
const SUSPECT: f32 = 12.0;
const CLEAR: f32 = 8.0;
const LOST: f32 = 25.0;
/// Normalised evidence that is chance, and of a board that is suspect already; the most that an account falls by in a scan.
const CHANCE: [f32; 2] = [4.0, 2.5];
const FALL: [f32; 2] = [2.0, 0.5];
/// The same of what a load that vanished left unclear: it lasts for eight scans, in which the means come to show most of a new zero.
const UNCLEAR_FALL: f32 = 1.5;
/// Scans from which the expectation is learned.
pub(super) const LEARNING_SCANS: u32 = 64;
/// Fewest sound inputs, pads counted twice, that may clear a board; so many scans a suspicion waits for them.
const WITNESSES_MIN: f32 = 8.0;
const UNJUDGED_SCANS_MAX: u32 = 160;
/// Scans for which a load that vanished may leave it unclear whether the board has its zero, and for which it counts as lately.
const UNCLEAR_SCANS: u8 = 16;
const VANISHED_LATELY_SCANS: u8 = 32;
/// Scans until all modules of a board that was silent are heard again.
const RETURN_SCANS: u8 = 3;

/// What is said of a board by its counts.
const BY_COUNTS: &str = "reads less than its zero on taxels that nothing touches, or its thermal pads stepped: it has taken a \
                         new zero, or the zero was taken under a load that has gone";
/// The same while it is a suspicion.
const MAYBE_BY_COUNTS: &str = "reads less than its zero on taxels that nothing touches, or its thermal pads stepped: it may have \
                               taken a new zero";

/// A board and its account.
#[derive(Clone, Debug, Default)]
pub(super) struct Board {
    /// `board 13 `, to begin a sentence with.
    pub(super) name: String,
    pub(super) taxels: Range<usize>,
    pub(super) modules: Range<usize>,
    /// Sum over its taxels of what their variances weigh, per counts squared, how many these are, and the squares of what a count
    /// of each weighs, N squared.
    pub(super) per_variance: f32,
    pub(super) witnesses: f32,
    pub(super) newton2: f64,
    pub(super) account: f32,
    /// Why it is suspect.
    pub(super) suspect: Option<String>,
    pub(super) unjudged_scans: u32,
    /// What it had more evidence than by chance at first: sum and scans.
    pub(super) learned: (f32, u32),
    /// A second account, paid in when its load vanishes: until it is empty, nothing bounds the force above.
    pub(super) unclear: f32,
    /// For how many scans yet its load has vanished lately.
    pub(super) vanished_lately: u8,
    /// All its modules are silent, or it is not well.
    pub(super) silent: bool,
    pub(super) unwell: bool,
    /// What presses on it is the bag, as far as known when it was heard last.
    pub(super) bag: Bag,
    /// What its taxels read when it fell silent or became suspect, and for how many scans yet this is compared with.
    pub(super) before: Option<(Vec<f32>, u8)>,
}

impl Board {
    pub(super) fn begin(&mut self) {
        (self.account, self.suspect, self.unjudged_scans, self.learned) = (0.0, None, 0, (0.0, 0));
        (self.unclear, self.vanished_lately) = (0.0, 0);
        self.before.take_if(|_| !self.unwell);
    }

    pub(super) fn suspect(&mut self, why: String) {
        (self.account, self.suspect, self.unjudged_scans, self.silent) =
            (self.account.max(SUSPECT), Some(why), 0, false);
    }

    /// Keeps what the board read, unless that is kept already, or what presses is a bag that lets go.
    pub(super) fn keep(&mut self, taxels: &[Taxel]) {
        if self.bag.presses && !self.bag.holds && self.before.is_none() {
            return;
        }
        let read = || taxels[self.taxels.clone()].iter().map(|taxel| taxel.now).collect();
        let (_, scans) = self.before.get_or_insert_with(|| (read(), 0));
        *scans = RETURN_SCANS;
    }

    /// Whether all its modules are silent.
    pub(super) fn falls_silent(&mut self, scan: &Scan<'_>, bag: Bag, taxels: &[Taxel]) -> bool {
        self.silent = self.unwell || self.modules.clone().all(|module| scan.silent[module]);
        if self.silent {
            if self.unwell {
                self.before.iter_mut().for_each(|(_, scans)| *scans = RETURN_SCANS);
            } else {
                self.keep(taxels);
            }
            return true;
        }
        self.before.take_if(|_| self.bag.presses && !bag.holds); // the bag has let go meanwhile
        self.bag = bag;
        false
    }

    /// Whether a board that was silent or suspect until now reads nothing of the load that lay on it before.
    pub(super) fn has_lost_its_load(&mut self, taxels: &[Taxel]) -> bool {
        let Some((then, left)) = &mut self.before else { return false };
        *left -= 1;
        let loads = taxels[self.taxels.clone()].iter().zip(&*then).map(|(taxel, then)| taxel.load(*then));
        let lost = is_vanished(sum(loads));
        self.before.take_if(|(_, left)| *left == 0);
        lost
    }

    /// What it has more evidence than by chance, as learned in its first scans.
    pub(super) fn expected(&self) -> f32 {
        let (learned, scans) = self.learned;
        if scans < LEARNING_SCANS { 0.0 } else { (learned / scans as f32).clamp(0.0, CHANCE[1]) }
    }

    /// Variance of the remnants of a new zero, counts squared, that pay in just enough to lose it within the scans from which the
    /// expectation is learned: they add half of that over the taxels' variances to T. Pads would only show it sooner.
    pub(super) fn missed_counts2(&self) -> f64 {
        if self.per_variance <= 0.0 {
            return 0.0;
        }
        let enough = CHANCE[0] + self.expected() + LOST / LEARNING_SCANS as f32;
        f64::from(2.0 * enough * (1.25 * self.witnesses).sqrt() / self.per_variance)
    }

    /// Pays in what a scan shows: evidence of so many taxels and pads, and whether the load vanished with it. Returns why its
    /// zero is another, or nobody can tell any more.
    pub(super) fn pay(&mut self, evidence: f32, [taxels, pads]: [f32; 2], vanishes: bool) -> Option<String> {
        self.vanished_lately = self.vanished_lately.saturating_sub(1);
        if vanishes && self.vanished_lately <= VANISHED_LATELY_SCANS - UNCLEAR_SCANS {
            (self.unclear, self.vanished_lately) = (SUSPECT, VANISHED_LATELY_SCANS);
        }
        if taxels + 2.0 * pads < WITNESSES_MIN {
            self.unjudged_scans += 1;
            let why = self.suspect.as_ref().filter(|_| self.unjudged_scans > UNJUDGED_SCANS_MAX)?;
            return Some(format!("{why}, and too few of its taxels are sound to show that it has not"));
        }
        self.unjudged_scans = 0;
        let (by_chance, sd) = (0.5 * taxels + pads, (1.25 * taxels + 2.0 * pads).sqrt());
        let (more, expected) = ((evidence - by_chance) / sd, self.expected());
        let (learned, scans) = self.learned;
        if scans < LEARNING_SCANS && self.account == 0.0 {
            self.learned = (learned + more, scans + 1);
        }
        let (chance, fall) = if self.suspect.is_some() { (CHANCE[1], FALL[1]) } else { (CHANCE[0], FALL[0]) };
        self.account = (self.account + (more - expected - chance).max(-fall)).max(0.0);
        if self.unclear > 0.0 {
            let lasts = self.vanished_lately > VANISHED_LATELY_SCANS - UNCLEAR_SCANS;
            let left = (self.unclear + (more - expected - CHANCE[1]).max(-UNCLEAR_FALL)).max(0.0);
            self.unclear = if lasts { left } else { 0.0 };
        }
        if self.account >= LOST {
            return Some(format!("{}{BY_COUNTS}", self.name));
        }
        if self.account < CLEAR {
            self.suspect = None;
        }
        if self.account >= SUSPECT && self.suspect.is_none() {
            self.suspect = Some(format!("{}{MAYBE_BY_COUNTS}", self.name));
        }
        None
    }
}
