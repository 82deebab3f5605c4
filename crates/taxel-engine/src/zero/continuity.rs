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
//! mean is below `POSSIBLE`, the bound for 1e-3. If it is not within 16 further scans, the zero is lost. A suspicion waits
//! as well while fewer than `WITNESSES_MIN` inputs were sound in all of the 16 scans, but for 160 scans at most.
//!
//! A board that is silent or doubted and then reads nothing of what lay on it has lost its zero without further proof: its
//! load may have been lifted just then, but nobody can tell. In a bag that presses, the load of a whole board does not
//! vanish at all.
//!
//! What it cannot see: a board with fewer than `WITNESSES_MIN` sound inputs; a new zero whose residues differ from the
//! old ones by less than about a count (root mean square, of a board with twenty taxels; by less than about two thirds
//! of a suspected one), pads included; and for the first scans a step that is small against the noise of one scan. For
//! the last, the load of a board that vanishes from one scan to the next makes the force a lower bound until 16 scans
//! have shown nothing. What a shift that stays below all this does to a force is in the uncertainty: [`UNSEEN_COUNTS`].

mod board;
#[cfg(test)]
mod tests;

use std::ops::Range;
use taxel_skin::ModuleKind;

use crate::regions::Regions;
use crate::scan::Scan;
use crate::zero::bag::Bag;
use crate::zero::ground::Ground;
use crate::zero::inputs::{Inputs, KEPT, LANES, TaxelInputs};
use crate::zero::lanes::{EVIDENCE_MAX, Reference, Sums};
pub use board::Finding;
use board::{BoardWatch, Seen, is_vanished};

/// Standard uncertainty, in counts, of a common shift of a board that the test would miss.
pub const UNSEEN_COUNTS: f64 = 0.15;

/// Noise that an input is credited with at least, counts: rounding and what a short watch did not show.
const NOISE_MIN_COUNTS: f64 = 0.5;
/// Noise of a thermal pad, counts: 0.8 before it is rounded to a whole count.
const PAD_NOISE_COUNTS: f64 = 0.85;
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
/// A bag that presses touches at least this share of a board's taxels.
const IN_BAG_SHARE: f32 = 0.5;

/// Scans of the three means that evidence is formed of.
const MEANS: [usize; 3] = [1, 4, KEPT];

/// Watches the boards of a patch. Begins anew with each zero.
#[derive(Clone, Debug)]
pub struct Continuity {
    boards: Vec<BoardWatch>,
    taxels: TaxelInputs,
    /// Two per module, whether it has them or not.
    pads: Inputs<u8>,
    /// Which of the pads there are.
    is_pad: Vec<bool>,
    /// Why the counts cannot show any more that the skin is at rest.
    unproven: Option<String>,
    /// Whether the present zero is one of a skin at rest. If somebody vouched for another one, a skin that a load leaves reads
    /// less than it without any fault of a board.
    at_rest: bool,
    /// Whether the module of each pad is heard, and the soundness of the scan that this is of.
    pads_heard: (Option<u64>, Vec<bool>),
}

impl Continuity {
    /// Boards of which nothing was seen yet; `names` has one entry per board.
    #[must_use]
    pub fn new(regions: &Regions, names: &[String]) -> Self {
        let boards = regions.boards().iter().zip(regions.board_modules()).enumerate();
        let watch = |(board, (taxels, modules)): (usize, (&Range<usize>, &Range<usize>))| {
            let name = names.get(board).map_or_else(String::new, |name| format!("board {name} "));
            BoardWatch::new(name, taxels.clone(), modules.clone())
        };
        let pads = |kind: &ModuleKind| [0, 1].map(|pad| pad < kind.thermal_slots().len());
        Self {
            boards: boards.map(watch).collect(),
            taxels: TaxelInputs::new(regions.taxels(), regions.counts()),
            pads: Inputs::new(2 * regions.modules().len()),
            is_pad: regions.kinds().iter().flat_map(pads).collect(),
            unproven: None,
            at_rest: true,
            pads_heard: (None, vec![false; 2 * regions.modules().len()]),
        }
    }

    /// A zero was taken, `at_rest` by the counts or by somebody's word: nothing that was seen before counts.
    pub fn begin(&mut self, at_rest: bool) {
        self.forget();
        self.at_rest = at_rest;
        self.taxels.begin();
        self.pads.begin();
    }

    /// From now on counts are compared with this; what was seen before stays.
    pub fn compare_with(&mut self, ground: &Ground) {
        for board in &mut self.boards {
            let blocks = board.taxels.len().div_ceil(LANES);
            board.references = vec![Reference::default(); blocks];
            for (i, taxel) in board.taxels.clone().enumerate() {
                let (Some(zero), Some(&sign)) = (ground.zero().get(taxel), ground.signs().get(taxel)) else { continue };
                let touched = ground.touched_counts(taxel);
                if sign != 0 && zero.mean.is_finite() {
                    let per_variance = MEANS.map(|scans| 1.0 / variance(zero.noise.max(NOISE_MIN_COUNTS), scans));
                    board.references[i / LANES].set(i % LANES, f64::from(sign), zero.mean, per_variance, touched);
                }
            }
        }
    }

    /// Something else says that the zero of a board may be another: the next scans have to show that it is not.
    pub fn doubt(&mut self, board: usize, why: String) {
        let read = (self.taxels.scans() > 0).then(|| self.taxels.newest());
        if let Some(board) = self.boards.get_mut(board) {
            board.suspect(why, read);
        }
    }

    /// A board says that it is not well: what it read before is kept, and it is judged no further until it is.
    pub fn on_unwell(&mut self, board: usize) {
        let read = (self.taxels.scans() > 0).then(|| self.taxels.newest());
        if let Some(board) = self.boards.get_mut(board) {
            board.on_unwell(read);
        }
    }

    /// It is well again: the next scans have to show that it has taken no new zero.
    pub fn on_well(&mut self, board: usize, why: String) {
        if let Some(board) = self.boards.get_mut(board) {
            board.on_well(why);
        }
    }

    /// The board has taken a new zero within the last scans: if its load has vanished with that, nothing shows it any more.
    pub fn moved(&mut self, board: usize, why: &str) {
        let lately = self.boards.get(board).is_some_and(BoardWatch::load_vanished_lately);
        if self.at_rest && lately {
            self.unproven = Some(why.to_owned());
        }
    }

    /// Why the zero of some board is in doubt now. A silent one has no part in the force, and its doubt waits.
    #[must_use]
    pub fn doubted(&self) -> Option<&str> {
        self.boards.iter().find_map(BoardWatch::doubted)
    }

    /// The boards whose load has just vanished at once.
    pub fn unloaded(&self) -> impl Iterator<Item = usize> {
        (0..self.boards.len()).filter(|&board| self.boards[board].load_vanished())
    }

    /// Why the counts cannot show that the skin is at rest: a load vanished while its board was silent, or with a new zero of
    /// its board. Over with the next zero, which somebody has to vouch for, or once the boards are configured and somebody does.
    #[must_use]
    pub fn unproven(&self) -> Option<&str> {
        self.unproven.as_deref()
    }

    /// As if that had been found here: it was, before the daemon started, or nobody saw what the boards were configured under.
    pub fn distrust(&mut self, why: String) {
        self.unproven = Some(why);
    }

    /// What was distrusted for this reason no longer is.
    pub fn trust_again(&mut self, why: &str) {
        self.unproven.take_if(|unproven| unproven == why);
    }

    /// A zero was taken, or somebody vouches for the skin on which the boards take zeros of their own: what was seen before says
    /// nothing of these.
    pub fn forget(&mut self) {
        self.unproven = None;
        self.boards.iter_mut().for_each(BoardWatch::begin);
    }

    /// Takes a scan while there is no zero: only boards that take a new zero under a load are looked for, which would read
    /// as a skin at rest.
    pub fn without_zero(&mut self, scan: &Scan<'_>, bag: Bag) {
        self.push(scan);
        for index in 0..self.boards.len() {
            self.judge(index, scan, bag);
        }
    }

    /// Takes a scan. Returns what is found, the worst of all boards, and on which of them.
    pub fn on_scan(&mut self, scan: &Scan<'_>, bag: Bag) -> Option<(usize, Finding)> {
        self.push(scan);
        let mut worst = None;
        for index in 0..self.boards.len() {
            match self.judge(index, scan, bag) {
                Some(finding @ Finding::NewZero(_)) => return Some((index, finding)),
                Some(doubt) => worst = worst.or(Some((index, doubt))),
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
    fn judge(&mut self, index: usize, scan: &Scan<'_>, bag: Bag) -> Option<Finding> {
        let board = &mut self.boards[index];
        if board.is_silent(scan, bag) {
            return None; // nothing to be judged by, and nothing of it in the force
        }
        if let Some(why) = board.has_lost_its_load(scan.counts) {
            self.unproven = Some(why.clone());
            return Some(Finding::NewZero(why));
        }
        let (evidence, vanishes) = self.evidence(index, !bag.session_open);
        let scans = self.taxels.scans();
        let seen = |mean: usize, bound| scans >= MEANS[mean] && evidence.exceeds(mean, bound);
        let finding = self.boards[index].judge(&Seen {
            certain: seen(1, CERTAIN) || seen(2, CERTAIN),
            likely: seen(2, LIKELY),
            likely_now: seen(0, LIKELY),
            possible: seen(2, POSSIBLE),
            load_vanishes: vanishes.is_some(),
            vanishes_in_bag: bag.holds && vanishes.is_some_and(|share| share >= IN_BAG_SHARE),
            witnesses: evidence.witnesses(),
        });
        let under_a_load = self.at_rest && self.boards[index].load_vanished();
        if let Some(Finding::NewZero(why)) = finding.as_ref().filter(|_| under_a_load) {
            self.unproven = Some(why.clone());
        }
        finding
    }

    /// The evidence of a board, all three means in one walk, and, if the load that lay on it is gone with this scan, the
    /// share of its taxels that it lay on.
    fn evidence(&self, index: usize, with_pads: bool) -> (Evidence, Option<f32>) {
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
        let vanishes = self.taxels.scans() >= 8 && is_vanished([was, is, touched]);
        (evidence, vanishes.then(|| touched / evidence.taxels))
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
