//! Does every board still have the zero that was taken? The strongest test that the counts allow.
//!
//! A board takes a new zero without a word: after five lost acknowledgements, after a brown-out, when another host
//! configures it. Whatever lies on it then reads as nothing. What gives it away are the taxels that nothing touches: a
//! new zero is taken from single noisy conversions and leaves a new residue on every input of the board, up or down. A
//! load only ever moves counts towards pressure, and its removal only back to rest. So
//!
//! - a taxel that reads *less* than both its zero and what it read lately is evidence, whatever load came or went;
//! - a thermal pad, which no load reaches, is evidence in both directions. While a session has the patch in the bag pads
//!   do not count: whether 70 kPa on all sides move them was not measured.
//!
//! With `a` the excess of a taxel away from load over `min(zero, recent mean)`, `p` the change of a pad, both over
//! their standard deviations, a board's evidence is `T = sum min(max(a, 0)^2, 16) + sum min(p^2, 16)`. The bound of 16
//! keeps a single flickering input from deciding. It is formed of the newest scan, and of the means over the last 4 and
//! 16 scans, in which noise averages out and a step does not. While nothing happens `T` has the mean `N/2 + M` and the
//! variance `1.25 N + 2 M` for N taxels and M pads; `LIKELY` and `CERTAIN` are fits to Chernoff bounds of its tail
//! for 1e-5 and 1e-11 (N from 8 to 400). A single scan beyond the first takes the force away for 16 scans; means beyond
//! the second prove a new zero.
//!
//! Of a board that is suspected already, because it was not heard, reported a fault or lost its whole load at once, less
//! is asked: the mean over 16 scans proves a new zero beyond the first bound, and the suspicion is over only when that
//! mean is below `POSSIBLE`, the bound for 1e-3. If it is not within 16 further scans, the zero is lost.
//!
//! What it cannot see: a board with fewer than `WITNESSES_MIN` sound inputs; a new zero whose residues differ from the
//! old ones by less than about a count (root mean square, of a board with twenty taxels; by less than about two thirds
//! of a suspected one), pads included; and for the first scans a step that is small against the noise of one scan. For
//! the last, the load of a board that vanishes from one scan to the next makes the force a lower bound until 16 scans
//! have shown nothing. What a shift that stays below all this does to a force is in the uncertainty: [`UNSEEN_COUNTS`].

use std::ops::Range;
use taxel_skin::ModuleKind;

use crate::baseline::TaxelBaseline;
use crate::regions::Regions;
use crate::scan::Scan;
use crate::zero::inputs::{Inputs, KEPT, LANES};
use crate::zero::lanes::{EVIDENCE_MAX, Reference, Sums};

/// Standard uncertainty, in counts, of a common shift of a board that the test would miss.
pub const UNSEEN_COUNTS: f64 = 0.15;

/// Scans that a doubt lasts: as many as the longest mean runs over.
const PROBATION_SCANS: u8 = KEPT as u8;
/// Fewest sound inputs, pads counted twice, that may clear a board of a doubt.
const WITNESSES_MIN: f32 = 8.0;
/// Noise that an input is credited with at least, counts: rounding and what a short watch did not show.
const NOISE_MIN_COUNTS: f64 = 0.5;
/// Noise of a thermal pad, counts.
const PAD_NOISE_COUNTS: f64 = 0.6;
/// Share of the scans that are conversions of their own: boards repeat some.
const INDEPENDENT_SHARE: f64 = 0.6;
/// Variance of a recent mean or a zero over that of a single scan.
const REFERENCE_VARIANCE: f64 = 0.1;
/// Slow changes that the recent mean lags behind, counts.
const SLOW_COUNTS: f64 = 0.15;
/// Noise estimates may be low by so much.
const MEAN_SLACK: f32 = 1.15;
/// Standard deviations and offset above the mean: once in 1e5 scans by chance.
const LIKELY: [f32; 2] = [4.9, 16.0];
/// Once in 1e11 scans by chance.
const CERTAIN: [f32; 2] = [7.4, 37.0];
/// Once in 1e3 scans by chance.
const POSSIBLE: [f32; 2] = [3.3, 11.0];
/// What is said of a board that was suspected and whose counts bear it out.
const SINCE_SUSPECTED: &str = "lost its load at once, was not heard or reported a fault, and since then reads less than \
                               its zero on taxels that nothing touches: it has taken a new zero, or the zero was taken \
                               under a load that has gone";
/// Of the load on a board less than this share remains when it vanishes.
const VANISHED_SHARE: f32 = 0.4;
/// A load on so many taxels, or fewer, may be their noise.
const LOAD_TAXELS_MIN: f32 = 3.0;
/// A load of so many counts in all is worth a doubt.
const LOAD_MIN_COUNTS: f32 = 12.0;

/// What the test says of a board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Finding {
    /// It has taken a new zero, or nobody can tell any more; in words that name the board.
    NewZero(String),
    /// It may have; in words.
    Doubt(String),
}

/// A board's doubts.
#[derive(Clone, Debug, Default)]
struct BoardWatch {
    /// `board 13 `, to begin a sentence with.
    name: String,
    taxels: Range<usize>,
    modules: Range<usize>,
    /// What its taxels are compared with, [`LANES`] at a time.
    references: Vec<Reference>,
    /// Why its zero is in doubt, and for how many scans yet.
    doubt: Option<(String, u8)>,
    /// For how many scans yet its force is a lower bound: its load vanished at once.
    vanished: u8,
    /// For how many scans longer than that the counts have left it unclear.
    unclear: u8,
}

/// Scans of the three means that evidence is formed of.
const MEANS: [usize; 3] = [1, 4, KEPT];

/// Watches the boards of a patch. Begins anew with each zero.
#[derive(Clone, Debug)]
pub struct Continuity {
    boards: Vec<BoardWatch>,
    taxels: Inputs,
    /// Two per module, whether it has them or not.
    pads: Inputs,
    /// Which of the pads there are.
    is_pad: Vec<bool>,
    /// Whether the module of each pad is heard, and the soundness of the scan that this is of.
    pads_heard: (Option<u64>, Vec<bool>),
}

/// What the test compares with, all per taxel.
#[derive(Clone, Copy, Debug)]
pub struct Ground<'a> {
    /// The zero now, with its drift.
    pub zero: &'a [TaxelBaseline],
    /// Which way pressure moves the count: +1, -1, or 0 where that is not known.
    pub signs: &'a [i8],
    /// Counts from the zero from which on a taxel is touched.
    pub touched_counts: &'a [f64],
}

impl Continuity {
    /// Boards of which nothing was seen yet; `names` has one entry per board.
    #[must_use]
    pub fn new(regions: &Regions, names: &[String]) -> Self {
        let boards = regions.boards().iter().zip(regions.board_modules()).enumerate();
        let watch = |(board, (taxels, modules)): (usize, (&Range<usize>, &Range<usize>))| BoardWatch {
            name: names.get(board).map_or_else(String::new, |name| format!("board {name} ")),
            taxels: taxels.clone(),
            modules: modules.clone(),
            ..BoardWatch::default()
        };
        let pads = |kind: &ModuleKind| [0, 1].map(|pad| pad < kind.thermal_slots().len());
        Self {
            boards: boards.map(watch).collect(),
            taxels: Inputs::new(regions.taxels()),
            pads: Inputs::new(2 * regions.modules().len()),
            is_pad: regions.kinds().iter().flat_map(pads).collect(),
            pads_heard: (None, vec![false; 2 * regions.modules().len()]),
        }
    }

    /// A zero was taken: nothing that was seen before counts.
    pub fn begin(&mut self) {
        self.taxels.begin();
        self.pads.begin();
        for board in &mut self.boards {
            (board.doubt, board.vanished, board.unclear) = (None, 0, 0);
        }
    }

    /// From now on counts are compared with this; what was seen before stays.
    pub fn compare_with(&mut self, ground: &Ground<'_>) {
        for board in &mut self.boards {
            let blocks = board.taxels.len().div_ceil(LANES);
            board.references = vec![Reference::default(); blocks];
            for (i, taxel) in board.taxels.clone().enumerate() {
                let (Some(zero), Some(&sign)) = (ground.zero.get(taxel), ground.signs.get(taxel)) else { continue };
                let touched = ground.touched_counts.get(taxel).copied().unwrap_or(f64::MAX);
                if sign != 0 && zero.mean.is_finite() {
                    let per_variance = MEANS.map(|scans| 1.0 / variance(zero.noise.max(NOISE_MIN_COUNTS), scans));
                    board.references[i / LANES].set(i % LANES, f64::from(sign), zero.mean, per_variance, touched);
                }
            }
        }
    }

    /// Something else says that the zero of a board may be another: the next scans have to show that it is not.
    pub fn doubt(&mut self, board: usize, why: String) {
        if let Some(board) = self.boards.get_mut(board) {
            board.doubt = Some((why, PROBATION_SCANS));
        }
    }

    /// Why the zero of some board is in doubt now.
    #[must_use]
    pub fn doubted(&self) -> Option<&str> {
        self.boards.iter().find_map(|board| board.doubt.as_ref()).map(|(why, _)| why.as_str())
    }

    /// Whether the load of some board has just vanished at once.
    #[must_use]
    pub fn load_vanished(&self) -> bool {
        self.boards.iter().any(|board| board.vanished > 0)
    }

    /// Takes a scan. Returns what is found, the worst of all boards. A bag that is `pressing` presses on everything, so
    /// that no load can vanish by itself; `in_bag` is a session under way, in which thermal pads do not count.
    pub fn on_scan(&mut self, scan: &Scan<'_>, pressing: bool, in_bag: bool) -> Option<Finding> {
        self.push(scan);
        let mut worst = None;
        for index in 0..self.boards.len() {
            match self.judge(index, scan, pressing, in_bag) {
                Some(finding @ Finding::NewZero(_)) => return Some(finding),
                Some(doubt) => worst = worst.or(Some(doubt)),
                None => {}
            }
        }
        worst
    }

    fn push(&mut self, scan: &Scan<'_>) {
        if self.pads_heard.0 != Some(scan.soundness) {
            let heard = scan.silent.iter().flat_map(|silent| [!silent; 2]);
            self.pads_heard.1.iter_mut().zip(heard).for_each(|(known, heard)| *known = heard);
            self.pads_heard.0 = Some(scan.soundness);
        }
        self.taxels.push(scan.counts, scan.sound);
        self.pads.push(scan.pads.as_flattened(), &self.pads_heard.1);
    }

    /// What the newest scan says of one board.
    fn judge(&mut self, index: usize, scan: &Scan<'_>, pressing: bool, in_bag: bool) -> Option<Finding> {
        let silent = self.boards[index].modules.clone().all(|module| scan.silent[module]);
        if silent {
            return None; // nothing to be judged by, and nothing of it in the force
        }
        let (evidence, vanishes) = self.evidence(index, !in_bag);
        let scans = self.taxels.scans();
        let seen = |mean: usize, bound| scans >= MEANS[mean] && evidence.exceeds(mean, bound);
        let board = &mut self.boards[index];
        if seen(1, CERTAIN) || seen(2, CERTAIN) {
            let why = "reads less than its zero on taxels that nothing touches, or on its thermal pads: it has taken a \
                       new zero, or the zero was taken under a load that has gone";
            return Some(Finding::NewZero(format!("{}{why}", board.name)));
        }
        if vanishes && pressing {
            let why = "lost its load at once while the bag was pressing: it has taken a new zero";
            return Some(Finding::NewZero(format!("{}{why}", board.name)));
        }
        if board.is_suspected() && seen(2, LIKELY) {
            return Some(Finding::NewZero(format!("{}{SINCE_SUSPECTED}", board.name)));
        }
        let unclear = seen(2, POSSIBLE);
        board.vanished = if vanishes { PROBATION_SCANS } else { wait(board.vanished, unclear) };
        if seen(0, LIKELY) && board.doubt.is_none() {
            let why = "reads less than its zero on taxels that nothing touches: it may have taken a new zero";
            let why = format!("{}{why}", board.name);
            board.doubt = Some((why.clone(), PROBATION_SCANS));
            return Some(Finding::Doubt(why));
        }
        if let Some((_, left)) = &mut board.doubt {
            *left = wait(*left, unclear);
        }
        board.end_doubt(unclear, evidence.witnesses())
    }

    /// The evidence of a board, all three means in one walk, and whether the load that lay on it is gone with this scan.
    fn evidence(&self, index: usize, with_pads: bool) -> (Evidence, bool) {
        let board = &self.boards[index];
        let mut sums = Sums::default();
        for (block, reference) in board.references.iter().enumerate() {
            let first = board.taxels.start + block * LANES;
            sums.add(reference, &self.taxels.block(first..(first + LANES).min(board.taxels.end)));
        }
        let mut evidence = Evidence { sums: sums.evidence(), taxels: sums.taxels(), pads: 0.0 };
        if with_pads {
            self.add_pads(board, &mut evidence);
        }
        let [was, is, touched] = sums.load();
        let is_load = touched >= LOAD_TAXELS_MIN && was >= LOAD_MIN_COUNTS;
        (evidence, self.taxels.scans() >= 8 && is_load && is < VANISHED_SHARE * was)
    }

    fn add_pads(&self, board: &BoardWatch, evidence: &mut Evidence) {
        let per_variance = MEANS.map(|scans| (1.0 / variance(PAD_NOISE_COUNTS, scans)) as f32);
        let newest = self.pads.newest();
        let [quarter, whole] = self.pads.sums();
        let (recent, unsound) = (self.pads.recent(), self.pads.unsound());
        for pad in 2 * board.modules.start..2 * board.modules.end {
            if unsound[pad] > 0 || !self.is_pad[pad] || recent[pad].is_nan() {
                continue;
            }
            let means = [f32::from(newest[pad]), f32::from(quarter[pad]) / 4.0, f32::from(whole[pad]) / 16.0];
            for ((sum, mean), per_variance) in evidence.sums.iter_mut().zip(means).zip(per_variance) {
                let change = mean - recent[pad];
                *sum += (change * change * per_variance).min(EVIDENCE_MAX);
            }
            evidence.pads += 1.0;
        }
    }
}

/// One scan less to wait for, but not the last one while the counts leave it unclear.
fn wait(left: u8, unclear: bool) -> u8 {
    if unclear { left.saturating_sub(1).max(left.min(1)) } else { left.saturating_sub(1) }
}

impl BoardWatch {
    /// Whether something beside the counts' means says that the board may have taken a new zero.
    const fn is_suspected(&self) -> bool {
        self.doubt.is_some() || self.vanished > 0
    }

    /// Ends a doubt whose scans are over, or finds that nobody can end it.
    fn end_doubt(&mut self, unclear: bool, witnesses: f32) -> Option<Finding> {
        let waits = self.vanished.max(self.doubt.as_ref().map_or(0, |(_, left)| *left));
        // Whoever is suspected has its last scan to wait for as long as the counts leave it unclear.
        self.unclear = if unclear && waits == 1 { self.unclear + 1 } else { 0 };
        if self.unclear >= PROBATION_SCANS {
            return Some(Finding::NewZero(format!("{}{SINCE_SUSPECTED}", self.name)));
        }
        let (why, _) = self.doubt.take_if(|(_, left)| *left == 0)?;
        let blind = witnesses < WITNESSES_MIN;
        blind.then(|| Finding::NewZero(format!("{why}, and too few of its taxels are sound to show that it has not")))
    }
}

/// Variance of a mean over so many scans against a zero or a recent mean, counts squared.
fn variance(noise: f64, scans: usize) -> f64 {
    let independent = if scans == 1 { 1.0 } else { INDEPENDENT_SHARE * scans as f64 };
    noise * noise * (1.0 / independent + REFERENCE_VARIANCE) + SLOW_COUNTS * SLOW_COUNTS
}

/// The evidence of a board.
#[derive(Clone, Copy, Debug, Default)]
struct Evidence {
    /// Of the newest scan and of the means over the last 4 and 16.
    sums: [f32; 3],
    /// Sound inputs that it is of.
    taxels: f32,
    pads: f32,
}

impl Evidence {
    /// How many inputs may clear the board of a doubt.
    const fn witnesses(&self) -> f32 {
        self.taxels + 2.0 * self.pads
    }

    /// Whether the evidence of one of the three means is beyond chance.
    fn exceeds(&self, mean: usize, [deviations, offset]: [f32; 2]) -> bool {
        let by_chance = 0.5 * self.taxels + self.pads;
        let variance = 1.25 * self.taxels + 2.0 * self.pads;
        self.witnesses() > 0.0 && self.sums[mean] > MEAN_SLACK * by_chance + deviations * variance.sqrt() + offset
    }
}
