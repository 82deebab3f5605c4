//! Does every board still have the zero that was taken? The strongest test that the counts allow.
//!
//! A board takes a new zero without a word: after five lost acknowledgements, after a brown-out, when another host
//! configures it. Whatever lies on it then reads as nothing. What gives it away are the taxels that nothing touches: a
//! new zero is taken from single noisy conversions and leaves a new residue on every input of the board, up or down. A
//! load only ever moves counts towards pressure, and its removal only back to rest. So
//!
//! - a taxel that reads *less* than both its zero and what it read lately is evidence, whatever load came or went;
//! - a thermal pad, which no load reaches, is evidence in both directions.
//!
//! With `a` the excess of a taxel away from load over `min(zero, recent mean)`, `p` the change of a pad, both over
//! their standard deviations, a board's evidence is `T = sum min(max(a, 0)^2, 16) + sum min(p^2, 16)`. The bound of 16
//! keeps a single flickering input from deciding. It is formed of the newest scan, and of the means over the last 4 and
//! 16 scans, in which noise averages out and a step does not. While nothing happens `T` has the mean `N/2 + M` and the
//! variance `1.25 N + 2 M` for N taxels and M pads; [`LIKELY`] and [`CERTAIN`] are fits to Chernoff bounds of its tail
//! for 1e-5 and 1e-11 (N from 8 to 400). A single scan beyond the first takes the force away for 16 scans; means beyond
//! the second prove a new zero.
//!
//! Of a board that is suspected already, because it was not heard, reported a fault or lost its whole load at once, less
//! is asked: the mean over 16 scans proves a new zero beyond the first bound, and the suspicion is over only when that
//! mean is below [`POSSIBLE`], the bound for 1e-3. If it is not within 16 further scans, the zero is lost.
//!
//! What it cannot see: a board with fewer than [`WITNESSES_MIN`] sound inputs; a new zero whose residues differ from the
//! old ones by less than about a count (root mean square, of a board with twenty taxels; by less than about two thirds
//! of a suspected one), pads included; and for the first scans a step that is small against the noise of one scan. For
//! the last, the load of a board that vanishes from one scan to the next makes the force a lower bound until 16 scans
//! have shown nothing. What a shift that stays below all this does to a force is in the uncertainty: [`UNSEEN_COUNTS`].

use std::ops::Range;

use crate::baseline::TaxelBaseline;
use crate::regions::Regions;
use crate::scan::Scan;

/// Standard uncertainty, in counts, of a common shift of a board that the test would miss.
pub const UNSEEN_COUNTS: f64 = 0.15;

/// Scans that a doubt lasts: as many as the longest mean runs over.
const PROBATION_SCANS: u8 = 16;
/// Fewest sound inputs, pads counted twice, that may clear a board of a doubt.
const WITNESSES_MIN: f64 = 8.0;
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
/// One input counts for at most so much.
const EVIDENCE_MAX: f64 = 16.0;
/// Weight of a scan in the recent mean: 40 scans.
const RECENT_SHARE: f64 = 1.0 / 40.0;
/// Noise estimates may be low by so much.
const MEAN_SLACK: f64 = 1.15;
/// Standard deviations and offset above the mean: once in 1e5 scans by chance.
const LIKELY: [f64; 2] = [4.9, 16.0];
/// Once in 1e11 scans by chance.
const CERTAIN: [f64; 2] = [7.4, 37.0];
/// Once in 1e3 scans by chance.
const POSSIBLE: [f64; 2] = [3.3, 11.0];
/// What is said of a board that was suspected and whose counts bear it out.
const SINCE_SUSPECTED: &str = "lost its load at once, was not heard or reported a fault, and since then reads less than \
                               its zero on taxels that nothing touches: it has taken a new zero, or the zero was taken \
                               under a load that has gone";
/// Of the load on a board less than this share remains when it vanishes.
const VANISHED_SHARE: f64 = 0.4;
/// A load on so many taxels, or fewer, may be their noise.
const LOAD_TAXELS_MIN: usize = 3;
/// A load of so many counts in all is worth a doubt.
const LOAD_MIN_COUNTS: f64 = 12.0;

/// What the test says of a board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Finding {
    /// It has taken a new zero, or nobody can tell any more; in words that name the board.
    NewZero(String),
    /// It may have; in words.
    Doubt(String),
}

/// One input of a board: a taxel or a pad.
#[derive(Clone, Copy, Debug, Default)]
struct Input {
    /// Mean over the scans before the last 16; NaN before there is one.
    recent: f64,
    /// Sums over the last 4 and 16 scans.
    sums: [f64; 2],
    /// Scans until all of the last 16 were sound.
    unsound: u8,
}

/// A board's doubts.
#[derive(Clone, Debug, Default)]
struct BoardWatch {
    /// `board 13 `, to begin a sentence with.
    name: String,
    taxels: Range<usize>,
    modules: Range<usize>,
    /// Why its zero is in doubt, and for how many scans yet.
    doubt: Option<(String, u8)>,
    /// For how many scans yet its force is a lower bound: its load vanished at once.
    vanished: u8,
    /// For how many scans longer than that the counts have left it unclear.
    unclear: u8,
}

/// Watches the boards of a patch. Begins anew with each zero.
#[derive(Clone, Debug)]
pub struct Continuity {
    boards: Vec<BoardWatch>,
    taxels: Vec<Input>,
    /// Two per module.
    pads: Vec<Input>,
    has_pads: Vec<usize>,
    /// Counts of the last 16 scans, taxels then pads; the newest is at `at`.
    ring: Vec<Vec<u8>>,
    at: usize,
    scans: usize,
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
    /// A bag presses on everything, so that no load can vanish by itself.
    pub pressing: bool,
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
        let input = Input { recent: f64::NAN, sums: [0.0; 2], unsound: 0 };
        Self {
            boards: boards.map(watch).collect(),
            taxels: vec![input; regions.taxels()],
            pads: vec![input; 2 * regions.modules().len()],
            has_pads: regions.kinds().iter().map(|kind| kind.thermal_slots().len()).collect(),
            ring: vec![Vec::new(); usize::from(PROBATION_SCANS)],
            at: 0,
            scans: 0,
        }
    }

    /// A zero was taken: nothing that was seen before counts.
    pub fn begin(&mut self) {
        let input = Input { recent: f64::NAN, sums: [0.0; 2], unsound: 0 };
        self.taxels.fill(input);
        self.pads.fill(input);
        self.scans = 0;
        for board in &mut self.boards {
            (board.doubt, board.vanished, board.unclear) = (None, 0, 0);
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

    /// Takes a scan. Returns what is found, the worst of all boards.
    pub fn on_scan(&mut self, scan: &Scan<'_>, ground: &Ground<'_>) -> Option<Finding> {
        self.push(scan);
        let mut worst = None;
        for index in 0..self.boards.len() {
            match self.judge(index, scan, ground) {
                Some(finding @ Finding::NewZero(_)) => return Some(finding),
                Some(doubt) => worst = worst.or(Some(doubt)),
                None => {}
            }
        }
        worst
    }

    fn push(&mut self, scan: &Scan<'_>) {
        self.at = (self.at + 1) % self.ring.len();
        let fourth = (self.at + self.ring.len() - 4) % self.ring.len();
        let (full, quarter) = (self.scans >= self.ring.len(), self.scans >= 4);
        let taxels = self.taxels.len();
        let mut newest = std::mem::take(&mut self.ring[self.at]);
        newest.resize(taxels + self.pads.len(), 0);
        for (i, input) in self.taxels.iter_mut().chain(&mut self.pads).enumerate() {
            let count = if i < taxels { scan.counts[i] } else { scan.pads[(i - taxels) / 2][(i - taxels) % 2] };
            let leaves = std::mem::replace(&mut newest[i], count);
            let leaves_quarter = if quarter { f64::from(self.ring[fourth][i]) } else { 0.0 };
            input.sums[0] += f64::from(count) - leaves_quarter;
            input.sums[1] += f64::from(count) - if full { f64::from(leaves) } else { 0.0 };
            if full && input.unsound == 0 {
                let leaves = f64::from(leaves);
                input.recent =
                    if input.recent.is_nan() { leaves } else { input.recent + RECENT_SHARE * (leaves - input.recent) };
            }
            let sound = if i < taxels { scan.sound[i] } else { !scan.silent[(i - taxels) / 2] };
            input.unsound = if sound { input.unsound.saturating_sub(1) } else { PROBATION_SCANS };
        }
        self.ring[self.at] = newest;
        self.scans += 1;
    }

    /// What the newest scan says of one board.
    fn judge(&mut self, index: usize, scan: &Scan<'_>, ground: &Ground<'_>) -> Option<Finding> {
        let silent = self.boards[index].modules.clone().all(|module| scan.silent[module]);
        if silent {
            return None; // nothing to be judged by, and nothing of it in the force
        }
        let newest = self.evidence(index, ground, 1);
        let means = [4, 16].map(|scans| (self.scans >= scans).then(|| self.evidence(index, ground, scans)));
        let vanishes = self.vanishes(index, scan, ground);
        let board = &mut self.boards[index];
        // Where something else speaks for a new zero, too, less evidence is enough.
        let needed = if board.doubt.is_some() || board.vanished > 0 { LIKELY } else { CERTAIN };
        if means.iter().flatten().any(|e| e.exceeds(needed)) {
            let why = "reads less than its zero on taxels that nothing touches, or on its thermal pads: it has taken a \
                       new zero, or the zero was taken under a load that has gone";
            return Some(Finding::NewZero(format!("{}{why}", board.name)));
        }
        if vanishes && ground.pressing {
            let why = "lost its load at once while the bag was pressing: it has taken a new zero";
            return Some(Finding::NewZero(format!("{}{why}", board.name)));
        }
        if board.is_suspected() && means[1].is_some_and(|e| e.exceeds(LIKELY)) {
            return Some(Finding::NewZero(format!("{}{SINCE_SUSPECTED}", board.name)));
        }
        let unclear = means[1].is_some_and(|e| e.exceeds(POSSIBLE));
        board.vanished = if vanishes { PROBATION_SCANS } else { wait(board.vanished, unclear) };
        if newest.exceeds(LIKELY) && board.doubt.is_none() {
            let why = "reads less than its zero on taxels that nothing touches: it may have taken a new zero";
            let why = format!("{}{why}", board.name);
            board.doubt = Some((why.clone(), PROBATION_SCANS));
            return Some(Finding::Doubt(why));
        }
        if let Some((_, left)) = &mut board.doubt {
            *left = wait(*left, unclear);
        }
        board.end_doubt(unclear, newest.witnesses)
    }

    /// The evidence of the mean over the last `scans`, which is 1, 4 or 16.
    fn evidence(&self, index: usize, ground: &Ground<'_>, scans: usize) -> Evidence {
        let board = &self.boards[index];
        let mean = |input: &Input, position: usize| match scans {
            1 => f64::from(self.ring[self.at][position]),
            4 => input.sums[0] / 4.0,
            _ => input.sums[1] / 16.0,
        };
        let independent = if scans == 1 { 1.0 } else { INDEPENDENT_SHARE * scans as f64 };
        let share = 1.0 / independent + REFERENCE_VARIANCE;
        let mut evidence = Evidence::default();
        for taxel in board.taxels.clone() {
            let (input, zero) = (&self.taxels[taxel], ground.zero[taxel]);
            let sign = f64::from(ground.signs[taxel]);
            if input.unsound > 0 || sign == 0.0 || !zero.mean.is_finite() {
                continue;
            }
            // f64::min takes the number of the two where there is no recent mean yet.
            let least = (sign * zero.mean).min(sign * input.recent);
            let variance = zero.noise.max(NOISE_MIN_COUNTS).powi(2) * share + SLOW_COUNTS * SLOW_COUNTS;
            let away = (least - sign * mean(input, taxel)).max(0.0);
            evidence.add(away * away / variance, [0.5, 1.25, 1.0]);
        }
        let pad_variance = PAD_NOISE_COUNTS * PAD_NOISE_COUNTS * share + SLOW_COUNTS * SLOW_COUNTS;
        for module in board.modules.clone() {
            for pad in 2 * module..2 * module + self.has_pads[module] {
                let input = &self.pads[pad];
                let change = mean(input, self.taxels.len() + pad) - input.recent;
                if input.unsound == 0 && change.is_finite() {
                    evidence.add(change * change / pad_variance, [1.0, 2.0, 2.0]);
                }
            }
        }
        evidence
    }

    /// Whether the load that lay on the board is gone with this scan.
    fn vanishes(&self, index: usize, scan: &Scan<'_>, ground: &Ground<'_>) -> bool {
        if self.scans < 8 {
            return false;
        }
        // The four scans before the last: the boards' scans are cut anew now and then, and one may be of both.
        let before = [2, 3, 4, 5].map(|back| &self.ring[(self.at + self.ring.len() - back) % self.ring.len()]);
        let (mut was, mut is, mut taxels) = (0.0, 0.0, 0);
        for taxel in self.boards[index].taxels.clone() {
            let (sign, zero) = (f64::from(ground.signs[taxel]), ground.zero[taxel].mean);
            let pressed = |count: f64| sign * (count - zero);
            let then = pressed(before.iter().map(|scan| f64::from(scan[taxel])).sum::<f64>() / 4.0);
            if scan.sound[taxel] && self.taxels[taxel].unsound == 0 && then > ground.touched_counts[taxel] {
                was += then;
                is += pressed(f64::from(scan.counts[taxel])).max(0.0);
                taxels += 1;
            }
        }
        taxels >= LOAD_TAXELS_MIN && was >= LOAD_MIN_COUNTS && is < VANISHED_SHARE * was
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
    fn end_doubt(&mut self, unclear: bool, witnesses: f64) -> Option<Finding> {
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

/// The evidence of a board.
#[derive(Clone, Copy, Debug, Default)]
struct Evidence {
    sum: f64,
    mean: f64,
    variance: f64,
    witnesses: f64,
}

impl Evidence {
    /// One input, with the mean, the variance and the weight as a witness that it has by chance.
    fn add(&mut self, square: f64, [mean, variance, witness]: [f64; 3]) {
        self.sum += square.min(EVIDENCE_MAX);
        self.mean += mean;
        self.variance += variance;
        self.witnesses += witness;
    }

    fn exceeds(&self, [deviations, offset]: [f64; 2]) -> bool {
        self.witnesses > 0.0 && self.sum > MEAN_SLACK * self.mean + deviations * self.variance.sqrt() + offset
    }
}
