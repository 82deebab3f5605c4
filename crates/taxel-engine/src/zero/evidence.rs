//! Does every board still have the zero that was taken? One account a board, into which all evidence is paid.
//!
//! A board takes a new zero without a word: after five lost acknowledgements, after a brown-out, when another host
//! configures it. Whatever lies on it then reads as nothing. What gives it away are inputs that nothing touches: a new zero
//! is taken from single noisy conversions and leaves a new residue on every input. A load only ever moves counts towards
//! pressure, and its removal only back to the zero. So a taxel that reads *less* than its zero is evidence, and so is a
//! thermal pad, which no load reaches, that steps either way.
//!
//! With `c` how far the mean of a taxel over some 8 scans lies towards load, from its zero or from what it reads on the long run
//! if that is less (skins creep), and `d` the step of a pad: `T = sum min(max(-c, 0)^2 / v, 16) + sum min(d^2 / v, 16)`; the bound
//! keeps one flickering input from deciding. While nothing happens T has the mean `N/2 + M` and the variance `1.25 N + 2 M` of
//! N taxels and M pads; what a skin has more in its first `LEARNING_SCANS` is expected from then on. With z the normalised T
//! the account is a one-sided cumulative sum (CUSUM, Page 1954), `A = max(0, A + max(z - 4, -fall))`: suspect from `SUSPECT`,
//! clear below `CLEAR`, lost from `LOST`. All else is paid in by name: a silence, a lost acknowledgement, a fault that the board
//! reports make it suspect. A load that vanishes in one scan pays as much into a second account, and nothing bounds the force above
//! until that is empty again, or for 16 scans.
//!
//! A board that was silent or suspect and then reads nothing of what lay on it has lost its zero without further proof: its
//! load may have been lifted just then, but nobody can tell. In a bag that presses, the load of a whole board does not
//! vanish at all.
//!
//! What it cannot see: a board with fewer than `WITNESSES_MIN` sound inputs; a new zero whose residues differ from the old
//! ones by less than [`Evidence::missed_counts`], about half a count on a board of twenty taxels. What such a zero does to a force
//! is in the uncertainty. Its remnants are those of single conversions, so that they add up as noise does, over taxels and boards.
//! A load that a board takes into its new zero is no part of that: it vanishes, or a taken zero hides it (`force/remainder/hidden.rs`).

use std::ops::Range;
use taxel_skin::ModuleKind;

use crate::regions::Regions;
use crate::scan::Scan;
use crate::zero::bag::Bag;
use crate::zero::ground::Ground;

/// The account from which on a board is suspect, below which it is clear again, and from which on its zero is lost.
const SUSPECT: f32 = 12.0;
const CLEAR: f32 = 8.0;
const LOST: f32 = 25.0;
/// Normalised evidence that is chance, and of a board that is suspect already; the most that an account falls by in a scan.
const CHANCE: [f32; 2] = [4.0, 2.5];
const FALL: [f32; 2] = [2.0, 0.5];
/// The same of what a load that vanished left unclear: it lasts for eight scans, in which the means come to show most of a new zero.
const UNCLEAR_FALL: f32 = 1.5;
/// Weight of a scan in the mean of a taxel or pad, and in the slow mean that a pad is compared with and that of a taxel.
const SHARE: f32 = 1.0 / 8.0;
const PAD_SLOW_SHARE: f32 = 1.0 / 100.0;
const TAXEL_SLOW_SHARE: f32 = 1.0 / 400.0;
/// The same in the mean that tells how much a load was that vanishes.
const QUICK_SHARE: f32 = 0.4;
/// Variance of the mean over that of a scan, of which boards repeat some, and of a zero.
const MEAN_VARIANCE: f64 = 0.11 + 0.1;
/// Noise that an input is credited with at least, and that of a pad, counts.
const NOISE_MIN_COUNTS: f64 = 0.5;
const PAD_NOISE_COUNTS: f64 = 0.85;
/// Slow changes that are no evidence, counts.
const SLOW_COUNTS: f64 = 0.15;
/// One input counts for at most so much.
const EVIDENCE_MAX: f32 = 16.0;
/// Scans from which the expectation is learned, and until an input counts that was not sound.
const LEARNING_SCANS: u32 = 64;
const SOUND_SCANS: u8 = 12;
/// Fewest sound inputs, pads counted twice, that may clear a board; so many scans a suspicion waits for them.
const WITNESSES_MIN: f32 = 8.0;
const BLIND_SCANS_MAX: u32 = 160;
/// Scans for which a load that vanished may leave it unclear whether the board has its zero, and for which it counts as lately.
const UNCLEAR_SCANS: u8 = 16;
const VANISHED_LATELY_SCANS: u8 = 32;
/// Scans until all modules of a board that was silent are heard again.
const RETURN_SCANS: u8 = 3;
/// Of the load on a board less than this share remains when it vanishes; it lay on so many taxels with so many counts.
const VANISHED_SHARE: f32 = 0.4;
const LOAD_TAXELS_MIN: f32 = 3.0;
const LOAD_MIN_COUNTS: f32 = 12.0;
/// A bag that presses touches at least this share of a board's taxels.
const IN_BAG_SHARE: f32 = 0.5;

/// What is said of a board by its counts.
const BY_COUNTS: &str = "reads less than its zero on taxels that nothing touches, or its thermal pads stepped: it has taken a \
                         new zero, or the zero was taken under a load that has gone";
/// The same while it is a suspicion.
const MAYBE_BY_COUNTS: &str = "reads less than its zero on taxels that nothing touches, or its thermal pads stepped: it may have \
                               taken a new zero";
/// What is said of a board whose load is gone after a silence.
const SINCE_SILENT: &str = "lost its load while it was silent or reported a fault: it has taken a new zero under it, or \
                            the load was lifted; unload the skin, then `taxeld bring-up --confirmed-by NAME`";
/// What is said of a board on which the bag presses.
const IN_BAG: &str = "lost its load at once while the bag was pressing: it has taken a new zero";

/// One taxel; all in counts, turned so that load is positive. Without a sign it takes no part.
#[derive(Clone, Copy, Debug, Default)]
struct Taxel {
    sign: f32,
    zero: f32,
    per_variance: f32,
    touched: f32,
    /// Newest value, the mean, and the mean of some four scans now, one scan and two scans ago.
    now: f32,
    mean: f32,
    quick: [f32; 3],
    /// What it has read on the long run since the zero.
    slow: f32,
    /// For how many scans it has been sound.
    sound: u8,
}

impl Taxel {
    fn push(&mut self, count: f32, sound: bool) {
        self.now = self.sign * count - self.zero;
        self.sound = if sound { self.sound.saturating_add(1) } else { 0 };
        let towards = |mean: f32, share: f32| mean + share * (self.now - mean);
        // After what was not sound, and at first, a mean is one of few scans.
        let few = 1.0 / f32::from(self.sound.max(1));
        self.mean = towards(self.mean, SHARE.max(few));
        self.quick = [towards(self.quick[0], QUICK_SHARE.max(few)), self.quick[0], self.quick[1]];
        if sound {
            self.slow = towards(self.slow, TAXEL_SLOW_SHARE);
        }
    }

    /// The load on it, then and now, and whether there was one.
    fn load(&self, then: f32) -> [f32; 3] {
        if self.sign != 0.0 && then > self.touched { [then, self.now.max(0.0), 1.0] } else { [0.0; 3] }
    }
}

/// One thermal pad.
#[derive(Clone, Copy, Debug, Default)]
struct Pad {
    there: bool,
    mean: f32,
    slow: f32,
    sound: u8,
}

impl Pad {
    /// One at an end of its range is broken, or its module is.
    fn push(&mut self, count: u8, heard: bool) {
        let sound = heard && !matches!(count, u8::MIN | u8::MAX);
        self.sound = if sound { self.sound.saturating_add(1) } else { 0 };
        let few = 1.0 / f32::from(self.sound.max(1));
        self.mean += SHARE.max(few) * (f32::from(count) - self.mean);
        self.slow += PAD_SLOW_SHARE.max(few) * (f32::from(count) - self.slow);
    }
}

/// What the test says of a board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Finding {
    /// It has taken a new zero, or nobody can tell any more; in words that name the board.
    NewZero(String),
    /// It may have; in words.
    Doubt(String),
}

/// A board and its account.
#[derive(Clone, Debug, Default)]
struct Board {
    /// `board 13 `, to begin a sentence with.
    name: String,
    taxels: Range<usize>,
    modules: Range<usize>,
    /// Sum over its taxels of what their variances weigh, per counts squared, how many these are, and the squares of what a count
    /// of each weighs, N squared.
    per_variance: f32,
    witnesses: f32,
    newton2: f64,
    account: f32,
    /// Why it is suspect.
    suspect: Option<String>,
    blind: u32,
    /// What it had more evidence than by chance at first: sum and scans.
    learned: (f32, u32),
    /// A second account, paid in when its load vanishes: until it is empty, nothing bounds the force above.
    unclear: f32,
    /// For how many scans yet its load has vanished lately.
    vanished_lately: u8,
    /// All its modules are silent, or it is not well.
    silent: bool,
    unwell: bool,
    /// What presses on it is the bag, as far as known when it was heard last.
    bag: Bag,
    /// What its taxels read when it fell silent or became suspect, and for how many scans yet this is compared with.
    before: Option<(Vec<f32>, u8)>,
}

impl Board {
    fn begin(&mut self) {
        (self.account, self.suspect, self.blind, self.learned) = (0.0, None, 0, (0.0, 0));
        (self.unclear, self.vanished_lately) = (0.0, 0);
        self.before.take_if(|_| !self.unwell);
    }

    fn suspect(&mut self, why: String) {
        (self.account, self.suspect, self.blind, self.silent) = (self.account.max(SUSPECT), Some(why), 0, false);
    }

    /// Keeps what the board read, unless that is kept already, or what presses is a bag that lets go.
    fn keep(&mut self, taxels: &[Taxel]) {
        if self.bag.presses && !self.bag.holds && self.before.is_none() {
            return;
        }
        let read = || taxels[self.taxels.clone()].iter().map(|taxel| taxel.now).collect();
        let (_, scans) = self.before.get_or_insert_with(|| (read(), 0));
        *scans = RETURN_SCANS;
    }

    /// Whether all its modules are silent.
    fn falls_silent(&mut self, scan: &Scan<'_>, bag: Bag, taxels: &[Taxel]) -> bool {
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
    fn has_lost_its_load(&mut self, taxels: &[Taxel]) -> bool {
        let Some((then, left)) = &mut self.before else { return false };
        *left -= 1;
        let loads = taxels[self.taxels.clone()].iter().zip(&*then).map(|(taxel, then)| taxel.load(*then));
        let lost = is_vanished(sum(loads));
        self.before.take_if(|(_, left)| *left == 0);
        lost
    }

    /// What it has more evidence than by chance, as learned in its first scans.
    fn expected(&self) -> f32 {
        let (learned, scans) = self.learned;
        if scans < LEARNING_SCANS { 0.0 } else { (learned / scans as f32).clamp(0.0, CHANCE[1]) }
    }

    /// Variance of the remnants of a new zero, counts squared, that pay in just enough to lose it within the scans from which the
    /// expectation is learned: they add half of that over the taxels' variances to T. Pads would only show it sooner.
    fn missed_counts2(&self) -> f64 {
        if self.per_variance <= 0.0 {
            return 0.0;
        }
        let enough = CHANCE[0] + self.expected() + LOST / LEARNING_SCANS as f32;
        f64::from(2.0 * enough * (1.25 * self.witnesses).sqrt() / self.per_variance)
    }

    /// Pays in what a scan shows: evidence of so many taxels and pads, and whether the load vanished with it.
    fn pay(&mut self, evidence: f32, [taxels, pads]: [f32; 2], vanishes: bool) -> Option<Finding> {
        self.vanished_lately = self.vanished_lately.saturating_sub(1);
        if vanishes && self.vanished_lately <= VANISHED_LATELY_SCANS - UNCLEAR_SCANS {
            (self.unclear, self.vanished_lately) = (SUSPECT, VANISHED_LATELY_SCANS);
        }
        if taxels + 2.0 * pads < WITNESSES_MIN {
            self.blind += 1;
            let why = self.suspect.as_ref().filter(|_| self.blind > BLIND_SCANS_MAX)?;
            return Some(Finding::NewZero(format!(
                "{why}, and too few of its taxels are sound to show that it has not"
            )));
        }
        self.blind = 0;
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
            return Some(Finding::NewZero(format!("{}{BY_COUNTS}", self.name)));
        }
        if self.account < CLEAR {
            self.suspect = None;
        }
        if self.account >= SUSPECT && self.suspect.is_none() {
            let why = format!("{}{MAYBE_BY_COUNTS}", self.name);
            self.suspect = Some(why.clone());
            return Some(Finding::Doubt(why));
        }
        None
    }
}

/// Watches the boards of a patch. Begins anew with each zero.
#[derive(Clone, Debug)]
pub struct Evidence {
    boards: Vec<Board>,
    taxels: Vec<Taxel>,
    /// Two per module, whether it has them or not.
    pads: Vec<Pad>,
    scans: u32,
    /// Why the counts cannot show any more that nothing lies on the skin.
    unproven: Option<String>,
    /// Whether the present zero is one of an unloaded skin. If somebody confirmed another one, a skin that a load leaves
    /// reads less than it without any fault of a board.
    at_rest: bool,
}

impl Evidence {
    /// Boards of which nothing was seen yet; `names` has one entry per board.
    #[must_use]
    pub fn new(regions: &Regions, names: &[String]) -> Self {
        let boards = regions.boards().iter().zip(regions.board_modules()).enumerate();
        let board = |(board, (taxels, modules)): (usize, (&Range<usize>, &Range<usize>))| {
            let name = names.get(board).map_or_else(String::new, |name| format!("board {name} "));
            Board { name, taxels: taxels.clone(), modules: modules.clone(), ..Board::default() }
        };
        let pads = |kind: &ModuleKind| [0, 1].map(|pad| pad < kind.thermal_slots().len());
        let pads = regions.kinds().iter().flat_map(pads).map(|there| Pad { there, ..Pad::default() });
        Self {
            boards: boards.map(board).collect(),
            taxels: vec![Taxel::default(); regions.taxels()],
            pads: pads.collect(),
            scans: 0,
            unproven: None,
            at_rest: true,
        }
    }

    /// A zero was taken, `at_rest` by the counts or by somebody's word: nothing that was seen before counts.
    pub fn begin(&mut self, at_rest: bool) {
        self.forget();
        self.at_rest = at_rest;
        self.scans = 0;
        self.taxels.iter_mut().for_each(|taxel| (taxel.sound, taxel.slow) = (0, 0.0)); // its zero
        self.pads.iter_mut().for_each(|pad| pad.sound = 0);
    }

    /// From now on counts are compared with this; what was seen before stays.
    pub fn compare_with(&mut self, ground: &Ground) {
        for (number, taxel) in self.taxels.iter_mut().enumerate() {
            let (Some(zero), Some(&sign)) = (ground.zero().get(number), ground.signs().get(number)) else { continue };
            if sign == 0 || !zero.mean.is_finite() {
                taxel.sign = 0.0;
                continue;
            }
            let turned = (f64::from(sign) * zero.mean) as f32;
            let moved = if taxel.sign == f32::from(sign) { taxel.zero - turned } else { 0.0 };
            let Taxel { mean, slow, quick: [quick, one, two], .. } = taxel;
            [mean, slow, quick, one, two].into_iter().for_each(|mean| *mean += moved);
            let noise = zero.noise.max(NOISE_MIN_COUNTS);
            (taxel.sign, taxel.zero) = (f32::from(sign), turned);
            taxel.per_variance = (1.0 / (noise * noise * MEAN_VARIANCE + SLOW_COUNTS * SLOW_COUNTS)) as f32;
            taxel.touched = ground.touched_counts(number) as f32;
        }
        for board in &mut self.boards {
            let taxels = || self.taxels[board.taxels.clone()].iter().filter(|taxel| taxel.sign != 0.0);
            board.per_variance = taxels().map(|taxel| taxel.per_variance).sum();
            board.witnesses = taxels().count() as f32;
        }
    }

    /// How much a count more of each taxel weighs, N; empty while nobody knows.
    pub fn weigh(&mut self, newton_per_count: &[f64]) {
        for board in &mut self.boards {
            let taxels = newton_per_count.get(board.taxels.clone()).unwrap_or_default();
            board.newton2 = taxels.iter().map(|newton| newton * newton).sum();
        }
    }

    /// Remnants of a new zero on each taxel that the accounts would miss, root mean square, counts: of the board that would miss most.
    #[must_use]
    pub fn missed_counts(&self) -> f64 {
        self.boards.iter().map(Board::missed_counts2).fold(0.0, f64::max).sqrt()
    }

    /// What the remnants that the accounts would miss weigh on the whole skin, N, standard uncertainty.
    #[must_use]
    pub fn missed_n(&self) -> f64 {
        self.boards.iter().map(|board| board.missed_counts2() * board.newton2).sum::<f64>().sqrt()
    }

    /// Something else says that the zero of a board may be another: the next scans have to show that it is not.
    pub fn doubt(&mut self, board: usize, why: String) {
        if let Some(board) = self.boards.get_mut(board) {
            board.suspect(why);
            if self.scans > 0 {
                board.keep(&self.taxels);
            }
        }
    }

    /// A board says that it is not well: what it read before is kept, and it is judged no further until it is.
    pub fn on_unwell(&mut self, board: usize) {
        if let Some(board) = self.boards.get_mut(board) {
            if self.scans > 0 && !board.unwell {
                board.keep(&self.taxels);
            }
            board.unwell = true;
        }
    }

    /// It is well again: the next scans have to show that it has taken no new zero.
    pub fn on_well(&mut self, board: usize, why: String) {
        if let Some(board) = self.boards.get_mut(board) {
            board.unwell = false;
            board.suspect(why);
        }
    }

    /// The board has taken a new zero within the last scans: if its load has vanished with that, nothing shows it any more.
    pub fn moved(&mut self, board: usize, why: &str) {
        if self.at_rest && self.boards.get(board).is_some_and(|board| board.vanished_lately > 0) {
            self.distrust(why.to_owned());
        }
    }

    /// Why the zero of some board is in doubt now. A silent one has no part in the force, and its doubt waits.
    #[must_use]
    pub fn doubted(&self) -> Option<&str> {
        self.boards.iter().filter(|board| !board.silent).find_map(|board| board.suspect.as_deref())
    }

    /// The boards whose load vanished at once, until their counts have shown that they took no new zero with that.
    pub fn unloaded(&self) -> impl Iterator<Item = usize> {
        (0..self.boards.len()).filter(|&board| self.boards[board].unclear > 0.0)
    }

    /// Why the counts cannot show that the skin is unloaded: a load vanished while its board was silent, or with a new zero
    /// of its board. Over with the next zero, which somebody has to confirm, or once the boards are configured and somebody does.
    #[must_use]
    pub fn unproven(&self) -> Option<&str> {
        self.unproven.as_deref()
    }

    /// As if that had been found here: it was, before the daemon started, or nobody saw what the boards were configured under.
    /// What was found first stays.
    pub fn distrust(&mut self, why: String) {
        self.unproven.get_or_insert(why);
    }

    /// What was distrusted for this reason no longer is.
    pub fn trust_again(&mut self, why: &str) {
        self.unproven.take_if(|unproven| unproven == why);
    }

    /// A zero was taken, or somebody confirms the skin on which the boards take zeros of their own: what was seen before says
    /// nothing of these.
    pub fn forget(&mut self) {
        self.unproven = None;
        self.boards.iter_mut().for_each(Board::begin);
    }

    /// Takes a scan. Returns what is found, the worst of all boards, and on which of them. Without a zero only boards that
    /// take a new one under a load are of interest, which would read as an unloaded skin.
    pub fn on_scan(&mut self, scan: &Scan<'_>, bag: Bag) -> Option<(usize, Finding)> {
        self.scans = self.scans.saturating_add(1);
        for ((taxel, count), sound) in self.taxels.iter_mut().zip(scan.counts.iter_units()).zip(scan.sound) {
            taxel.push(count as f32, *sound);
        }
        let heard = scan.silent.iter().flat_map(|silent| [!silent; 2]);
        for ((pad, count), heard) in self.pads.iter_mut().zip(scan.pads.as_flattened()).zip(heard) {
            pad.push(*count, heard);
        }
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

    /// What the newest scan says of one board.
    fn judge(&mut self, index: usize, scan: &Scan<'_>, bag: Bag) -> Option<Finding> {
        let board = &mut self.boards[index];
        if board.falls_silent(scan, bag, &self.taxels) {
            return None; // nothing to be judged by, and nothing of it in the force
        }
        if board.has_lost_its_load(&self.taxels) {
            let why = format!("{}{SINCE_SILENT}", board.name);
            self.distrust(why.clone());
            return Some(Finding::NewZero(why));
        }
        let taxels = &self.taxels[board.taxels.clone()];
        let sound = || taxels.iter().filter(|taxel| taxel.sound >= SOUND_SCANS && taxel.sign != 0.0);
        let (mut evidence, mut inputs) = (0.0, [0.0; 2]);
        for taxel in sound() {
            let less = (taxel.slow.min(0.0) - taxel.mean).max(0.0);
            evidence += (less * less * taxel.per_variance).min(EVIDENCE_MAX);
            inputs[0] += 1.0;
        }
        if !bag.session_open {
            let per_variance = (1.0 / (PAD_NOISE_COUNTS.powi(2) * (MEAN_VARIANCE - 0.1) + SLOW_COUNTS.powi(2))) as f32;
            let pads = &self.pads[2 * board.modules.start..2 * board.modules.end];
            for pad in pads.iter().filter(|pad| pad.there && pad.sound >= SOUND_SCANS) {
                evidence += ((pad.mean - pad.slow).powi(2) * per_variance).min(EVIDENCE_MAX);
                inputs[1] += 1.0;
            }
        }
        let load = sum(sound().map(|taxel| taxel.load(taxel.quick[2])));
        let vanishes = is_vanished(load);
        if vanishes && bag.holds && load[2] >= IN_BAG_SHARE * inputs[0] {
            return Some(Finding::NewZero(format!("{}{IN_BAG}", board.name)));
        }
        let under_a_load = self.at_rest && (board.vanished_lately > 0 || vanishes);
        let finding = board.pay(evidence, inputs, vanishes);
        if let Some(Finding::NewZero(why)) = finding.as_ref().filter(|_| under_a_load) {
            self.distrust(why.clone());
        }
        finding
    }
}

/// The load of several taxels: counts then and now, and how many it lay on.
fn sum(loads: impl Iterator<Item = [f32; 3]>) -> [f32; 3] {
    loads.fold([0.0; 3], |sum, load| [sum[0] + load[0], sum[1] + load[1], sum[2] + load[2]])
}

/// Whether a load was one, and has vanished.
fn is_vanished([was, is, touched]: [f32; 3]) -> bool {
    touched >= LOAD_TAXELS_MIN && was >= LOAD_MIN_COUNTS && is < VANISHED_SHARE * was
}

#[cfg(test)]
#[path = "evidence_tests.rs"]
mod tests;
