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
//! A load that a board takes into its new zero is no part of that: it vanishes, or a taken zero hides it (`force/untouched/hidden.rs`).

mod account;
mod inputs;

use std::ops::Range;
use taxel_skin::{ModuleKind, Patch};

use self::account::Board;
use self::inputs::{Pad, Taxel, is_vanished, sum};
use crate::regions::Regions;
use crate::scan::Scan;
use crate::zero::bag::Bag;
use crate::zero::ground::Ground;

/// A bag that presses touches at least this share of a board's taxels.
const IN_BAG_SHARE: f32 = 0.5;

/// A board whose load is gone after a silence.
const SINCE_SILENT: &str = "lost its load while it was silent or reported a fault: it has taken a new zero under it, or \
                            the load was lifted; unload the skin, then `taxeld bring-up --confirmed-by NAME`";
/// A board on which the bag presses.
const IN_BAG: &str = "lost its load at once while the bag was pressing: it has taken a new zero";

/// Watches the boards of a patch. Begins anew with each zero.
#[derive(Clone, Debug)]
pub struct Evidence {
    boards: Vec<Board>,
    taxels: Vec<Taxel>,
    /// Two per module, whether it has them or not.
    pads: Vec<Pad>,
    scans: u32,
    /// Why the counts cannot show any more that nothing lies on the skin, so that somebody has to confirm it.
    needs_confirmation: Option<String>,
    /// Whether the present zero is one of an unloaded skin. If somebody confirmed another one, a skin that a load leaves
    /// reads less than it without any fault of a board.
    at_rest: bool,
}

impl Evidence {
    /// Boards of which nothing was seen yet.
    #[must_use]
    pub fn new(regions: &Regions, patch: &Patch) -> Self {
        let boards = regions.boards().iter().zip(regions.board_modules()).enumerate();
        let board = |(board, (taxels, modules)): (usize, (&Range<usize>, &Range<usize>))| {
            let name = format!("board {} ", patch.boards()[board].address);
            Board { name, taxels: taxels.clone(), modules: modules.clone(), ..Board::default() }
        };
        let pads = |kind: &ModuleKind| [0, 1].map(|pad| pad < kind.thermal_slots().len());
        let pads = regions.kinds().iter().flat_map(pads).map(|there| Pad { there, ..Pad::default() });
        Self {
            boards: boards.map(board).collect(),
            taxels: vec![Taxel::default(); regions.taxels()],
            pads: pads.collect(),
            scans: 0,
            needs_confirmation: None,
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
            taxel.compare_with(sign, *zero, ground.touched_counts(number));
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
    pub fn suspect(&mut self, board: usize, why: String) {
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

    /// It is well again, and suspect.
    pub fn on_well(&mut self, board: usize) {
        self.boards.get_mut(board).into_iter().for_each(|board| board.unwell = false);
    }

    /// The board has taken a new zero within the last scans: if its load has vanished with that, nothing shows it any more.
    pub fn moved(&mut self, board: usize, why: &str) {
        if self.at_rest && self.boards.get(board).is_some_and(|board| board.vanished_lately > 0) {
            self.require_confirmation(why.to_owned());
        }
    }

    /// Why some board is suspect now. A silent one has no part in the force, and waits.
    #[must_use]
    pub fn suspicion(&self) -> Option<&str> {
        self.boards.iter().filter(|board| !board.silent).find_map(|board| board.suspect.as_deref())
    }

    /// The boards whose load vanished at once, until their counts have shown that they took no new zero with that.
    pub fn unloaded(&self) -> impl Iterator<Item = usize> {
        (0..self.boards.len()).filter(|&board| self.boards[board].unclear > 0.0)
    }

    /// Why the counts cannot show that the skin is unloaded: a load vanished while its board was silent, or with a new zero
    /// of its board. Over with the next zero, which somebody has to confirm, or once the boards are configured and somebody does.
    #[must_use]
    pub fn needs_confirmation(&self) -> Option<&str> {
        self.needs_confirmation.as_deref()
    }

    /// The same for a reason that was found elsewhere: before the daemon started, or because nothing showed what lay on the boards
    /// when they were configured. The first reason stays.
    pub fn require_confirmation(&mut self, why: String) {
        self.needs_confirmation.get_or_insert(why);
    }

    /// This reason is none any more.
    pub fn no_longer_needs(&mut self, why: &str) {
        self.needs_confirmation.take_if(|reason| reason == why);
    }

    /// A zero was taken, or somebody confirms the skin on which the boards take zeros of their own: what was seen before says
    /// nothing of these.
    pub fn forget(&mut self) {
        self.needs_confirmation = None;
        self.boards.iter_mut().for_each(Board::begin);
    }

    /// Takes a scan. Returns which board has taken a new zero, or may have and nobody can tell any more, and why. Without a zero
    /// only boards that take a new one under a load are of interest, which would read as an unloaded skin.
    pub fn on_scan(&mut self, scan: &Scan<'_>, bag: Bag) -> Option<(usize, String)> {
        self.scans = self.scans.saturating_add(1);
        for ((taxel, count), sound) in self.taxels.iter_mut().zip(scan.counts.iter_units()).zip(scan.sound) {
            taxel.push(count as f32, *sound);
        }
        let heard = scan.silent.iter().flat_map(|silent| [!silent; 2]);
        for ((pad, count), heard) in self.pads.iter_mut().zip(scan.pads.as_flattened()).zip(heard) {
            pad.push(*count, heard);
        }
        (0..self.boards.len()).find_map(|index| Some((index, self.judge(index, scan, bag)?)))
    }

    /// What the newest scan says of one board.
    fn judge(&mut self, index: usize, scan: &Scan<'_>, bag: Bag) -> Option<String> {
        let board = &mut self.boards[index];
        if board.falls_silent(scan, bag, &self.taxels) {
            return None; // nothing to be judged by, and nothing of it in the force
        }
        if board.has_lost_its_load(&self.taxels) {
            let why = format!("{}{SINCE_SILENT}", board.name);
            self.require_confirmation(why.clone());
            return Some(why);
        }
        let taxels = &self.taxels[board.taxels.clone()];
        let sound = || taxels.iter().filter(|taxel| taxel.is_sound());
        let (mut evidence, mut inputs) = (0.0, [0.0; 2]);
        for taxel in sound() {
            evidence += taxel.evidence();
            inputs[0] += 1.0;
        }
        if !bag.session_open {
            let pads = &self.pads[2 * board.modules.start..2 * board.modules.end];
            for pad in pads.iter().filter(|pad| pad.is_sound()) {
                evidence += pad.evidence();
                inputs[1] += 1.0;
            }
        }
        let load = sum(sound().map(|taxel| taxel.load(taxel.quick[2])));
        let vanishes = is_vanished(load);
        if vanishes && bag.holds && load[2] >= IN_BAG_SHARE * inputs[0] {
            return Some(format!("{}{IN_BAG}", board.name));
        }
        let under_a_load = self.at_rest && (board.vanished_lately > 0 || vanishes);
        let finding = board.pay(evidence, inputs, vanishes);
        if let Some(why) = finding.as_ref().filter(|_| under_a_load) {
            self.require_confirmation(why.clone());
        }
        finding
    }
}

#[cfg(test)]
mod tests;
