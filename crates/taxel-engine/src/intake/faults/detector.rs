//! Live faults per taxel and module: named, and ending by themselves when they are over.
//!
//! Streaming, a fixed amount of work per taxel and scan. The limits come from recordings of a real 280-taxel skin
//! (8 bit, 48.7 scans/s of a 27 Hz conversion): a sound taxel has noise of 0.9 to 1.5 counts and repeats a value for
//! at most 1.2 s; a flickering one has noise of 4 to 7 counts.

use std::ops::Range;
use std::time::Duration;
use taxel_skin::{ModuleKind, Time};

use crate::counts::Counts;

use super::fault::{Fault, FaultSet};
use super::jumps::ModuleJumps;
use super::limits::FaultLimits;
use super::taxel::TaxelWatch;

/// Bits of the status word of a tail frame: a conversion was not acknowledged, nothing is connected, and from here on that each
/// value is out of range.
const NO_ACK_BIT: usize = 0;
const NOT_CONNECTED_BIT: usize = 1;
const OUT_OF_RANGE_BIT: usize = 4;

#[derive(Clone, Debug, Default)]
struct ModuleWatch {
    taxels: Range<usize>,
    /// Which of the module's twelve values each taxel is.
    slots: &'static [u8],
    heard: Option<Time>,
    too_fast_until: Option<Time>,
    /// Until when each bit of its status word counts, and any of them.
    bits_until: [Option<Time>; u16::BITS as usize],
    status_until: Option<Time>,
    /// Its taxels carry faults that they share.
    marked: bool,
    jumps: ModuleJumps,
}

/// Watches every taxel of a patch.
#[derive(Clone, Debug)]
pub struct FaultDetector {
    limits: FaultLimits,
    hold: Duration,
    taxels: Vec<TaxelWatch>,
    modules: Vec<ModuleWatch>,
    /// Taxels that changed within the freezing time, as of their last scan.
    pub(super) lively: usize,
    /// Counts of a module in units; kept so that no scan has to ask for memory.
    units: Vec<f32>,
}

impl FaultDetector {
    /// `modules` are ranges of taxel numbers; those beyond `taxel_count` are cut off.
    pub fn new(taxel_count: usize, modules: &[Range<usize>], limits: FaultLimits) -> Self {
        let clip = |r: &Range<usize>| r.start.min(taxel_count)..r.end.min(taxel_count).max(r.start.min(taxel_count));
        let watch = |range: &Range<usize>| ModuleWatch { taxels: clip(range), ..ModuleWatch::default() };
        Self {
            limits,
            hold: Duration::from_secs_f32(limits.hold_s.clamp(0.0, 1e6)),
            taxels: vec![TaxelWatch::default(); taxel_count],
            modules: modules.iter().map(watch).collect(),
            lively: 0,
            units: Vec::new(),
        }
    }

    /// Says which of each module's values are its taxels, for the bits of its status.
    pub fn with_kinds(mut self, kinds: impl IntoIterator<Item = ModuleKind>) -> Self {
        for (module, kind) in self.modules.iter_mut().zip(kinds) {
            module.slots = kind.taxel_slots();
        }
        self
    }

    /// The noise that each taxel is known to have at rest, in counts (NaN: unknown), of which a converter makes
    /// `steps_per_count` steps: more than one where it is finer than eight bits. It raises the limit for jumping on a noisy
    /// skin, and lets a freeze of the whole patch be seen.
    pub fn expect_noise(&mut self, noise_counts: impl IntoIterator<Item = f64>, steps_per_count: f64) {
        for (taxel, noise) in self.taxels.iter_mut().zip(noise_counts) {
            taxel.expect_noise(noise as f32, steps_per_count as f32);
        }
        for module in &mut self.modules {
            let known = self.taxels[module.taxels.clone()].iter().map(TaxelWatch::noise).filter(|noise| *noise > 0.0);
            let (squares, taxels) = known.fold((0.0, 0), |(sum, n), noise| (sum + noise * noise, n + 1));
            module.jumps.expect_noise((squares / taxels.max(1) as f32).sqrt());
        }
    }

    /// Takes the counts of one module; `status` is the word of its tail frame, 0 where all is well.
    /// Returns whether the faults of any taxel of the module changed. An unknown module is ignored.
    pub fn push_module<'a>(&mut self, now: Time, module: usize, counts: impl Into<Counts<'a>>, status: u16) -> bool {
        let counts = counts.into();
        let mut units = std::mem::take(&mut self.units);
        units.clear();
        units.extend(counts.iter_units().map(|count| count as f32));
        let changed = self.push_reals(now, module, &units, status);
        self.units = units;
        changed
    }

    /// As [`FaultDetector::push_module`], for counts in units that are reals; a value that is not finite is a missing one.
    pub fn push_reals(&mut self, now: Time, module: usize, counts: &[f32], status: u16) -> bool {
        let Some(watch) = self.modules.get_mut(module) else { return false };
        let silent = watch.heard.is_some_and(|last| now.seconds_since(last) > f64::from(self.limits.stale_after_s));
        watch.heard = Some(now);
        watch.take_status(now + self.hold, status);
        let others_change = 4 * self.lively >= self.taxels.len();
        let (mut broken, mut changed) = (0, false);
        // Of the taxels without a fault: of all, less those that have one.
        let range = watch.taxels.clone();
        let counts = &counts[..counts.len().min(range.len())];
        let (mut sum, mut sound) = (sum_of(counts), counts.len() as u32);
        for (taxel, &count) in self.taxels[range.clone()].iter_mut().zip(counts) {
            let before = (taxel.faults, taxel.is_lively);
            if silent {
                taxel.forget_trend();
            }
            if count.is_finite() && taxel.push(now, count, others_change, self.hold, &self.limits) {
                self.lively += usize::from(!before.1);
                continue; // nearly always
            }
            if !taxel.faults.is_empty() {
                (sum, sound) = (sum - count, sound - 1);
            }
            match (before.1, taxel.is_lively) {
                (false, true) => self.lively += 1,
                (true, false) => self.lively -= 1,
                _ => {}
            }
            broken += usize::from(taxel.faults.contains(Fault::Jumping) || taxel.faults.contains(Fault::Rail));
            changed |= taxel.faults != before.0;
        }
        let flicker = !range.is_empty() && broken as f32 >= self.limits.module_share * range.len() as f32;
        let watch = &mut self.modules[module];
        if silent {
            watch.jumps.forget();
        }
        if sum.is_finite() {
            watch.jumps.on_scan(now, sum, sound);
        }
        let shares = flicker || Some(now) < watch.status_until || Some(now) < watch.too_fast_until;
        if shares || watch.marked {
            watch.marked = shares;
            changed |= self.mark(now, module, flicker);
        }
        changed
    }

    /// Sets the faults that a whole module shares.
    fn mark(&mut self, now: Time, module: usize, flicker: bool) -> bool {
        let watch = &self.modules[module];
        let says = |bit: usize| watch.bits_until.get(bit).is_some_and(|until| Some(now) < *until);
        let mut changed = false;
        for (i, taxel) in self.taxels[watch.taxels.clone()].iter_mut().enumerate() {
            let before = taxel.faults;
            let out = watch.slots.get(i).is_some_and(|slot| says(OUT_OF_RANGE_BIT + usize::from(*slot)));
            taxel.faults.set(Fault::ModuleFlicker, flicker);
            taxel.faults.set(Fault::StatusOutOfRange, out);
            taxel.faults.set(Fault::NotConnected, says(NOT_CONNECTED_BIT));
            taxel.faults.set(Fault::NoAck, says(NO_ACK_BIT));
            taxel.faults.set(Fault::TooFast, Some(now) < watch.too_fast_until);
            taxel.faults.set(Fault::Stale, false);
            taxel.note_onset(now);
            changed |= taxel.faults != before;
        }
        changed
    }

    /// The module's scans come faster than its board can send them: none of its values can be trusted until then.
    pub fn suspect_module(&mut self, now: Time, module: usize, until: Time) {
        if let Some(watch) = self.modules.get_mut(module) {
            watch.too_fast_until = watch.too_fast_until.max(Some(until));
            self.blame(now, module, Fault::TooFast);
        }
    }

    /// The module has fallen silent.
    pub fn on_silent(&mut self, now: Time, module: usize) {
        self.blame(now, module, Fault::Stale);
    }

    fn blame(&mut self, now: Time, module: usize, fault: Fault) {
        let Some(watch) = self.modules.get_mut(module) else { return };
        watch.marked = true;
        for taxel in &mut self.taxels[watch.taxels.clone()] {
            taxel.faults.set(fault, true);
            taxel.note_onset(now);
        }
    }

    /// The faults of a taxel now; none for an unknown taxel.
    pub fn faults(&self, taxel: usize) -> FaultSet {
        self.taxels.get(taxel).map(|t| t.faults).unwrap_or_default()
    }

    /// By how many counts the taxels of a module jump together, there and back within a scan or two; 0 nearly always, and of
    /// a module that there is not.
    pub fn jump_counts(&self, now: Time, module: usize) -> f32 {
        self.modules.get(module).map_or(0.0, |watch| watch.jumps.counts(now))
    }

    /// Since when the taxel's values are wrong: a freeze is known only seconds after it began. `None` if it has no
    /// fault. Who can still change what it wrote, as a reader of a file, excludes the taxel from here on.
    pub fn wrong_since(&self, taxel: usize) -> Option<Time> {
        self.taxels.get(taxel).and_then(TaxelWatch::wrong_since)
    }
}

impl ModuleWatch {
    fn take_status(&mut self, until: Time, status: u16) {
        if status == 0 {
            return; // nearly always
        }
        self.status_until = Some(until);
        let said = self.bits_until.iter_mut().enumerate().filter(|(bit, _)| status >> bit & 1 != 0);
        said.for_each(|(_, said)| *said = Some(until));
    }
}

/// Four chains at a time: one after the other takes as long as all else that is done to a taxel.
fn sum_of(counts: &[f32]) -> f32 {
    let (fours, rest) = counts.as_chunks::<4>();
    let lanes =
        fours.iter().fold([0.0; 4], |lanes: [f32; 4], four| std::array::from_fn(|lane| lanes[lane] + four[lane]));
    lanes.iter().chain(rest).sum()
}
