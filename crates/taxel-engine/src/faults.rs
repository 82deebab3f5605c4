//! Live faults per taxel and module: named, and ending by themselves when they are over.
//!
//! Streaming, a fixed amount of work per taxel and scan. The limits come from recordings of a real 280-taxel skin
//! (8 bit, 48.7 scans/s of a 27 Hz conversion): a sound taxel has noise of 0.9 to 1.5 counts and repeats a value for
//! at most 1.2 s; a flickering one has noise of 4 to 7 counts.

mod taxel;
#[cfg(test)]
mod tests;

use std::fmt;
use std::ops::Range;
use std::time::Duration;
use taxel_skin::{ModuleKind, Time, VALUES_PER_MODULE};

use taxel::TaxelWatch;

/// What is wrong with a taxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Fault {
    /// At an end of the converter's range: the true value lies beyond.
    Rail,
    /// Has stopped to change while others, or its known noise, say that it must.
    Frozen,
    /// Goes back and forth by far more than noise: a contact or converter flickers.
    Jumping,
    /// Has never changed since it was first heard.
    Dead,
    /// Most of its module jumps or sits on a rail, so that the rest cannot be trusted either.
    ModuleFlicker,
    /// The module's status word says that this value is out of range.
    StatusOutOfRange,
    /// The module's status word says that nothing is connected.
    NotConnected,
    /// The module's status word reports a lost acknowledgement.
    NoAck,
    /// Its module has been silent for too long.
    Stale,
    /// Its whole board stepped at once: a silent re-tare.
    BoardStep,
}

impl Fault {
    /// Every fault, in the order of its bit.
    pub const ALL: [Self; 10] = [
        Self::Rail,
        Self::Frozen,
        Self::Jumping,
        Self::Dead,
        Self::ModuleFlicker,
        Self::StatusOutOfRange,
        Self::NotConnected,
        Self::NoAck,
        Self::Stale,
        Self::BoardStep,
    ];

    /// The fault in words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rail => "rail",
            Self::Frozen => "frozen",
            Self::Jumping => "jumping",
            Self::Dead => "dead",
            Self::ModuleFlicker => "module flicker",
            Self::StatusOutOfRange => "out of range by status",
            Self::NotConnected => "not connected",
            Self::NoAck => "no acknowledgement",
            Self::Stale => "stale",
            Self::BoardStep => "board step",
        }
    }
}

/// A set of faults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct FaultSet(u16);

impl FaultSet {
    /// Whether there is none.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether `fault` is among them.
    #[must_use]
    pub const fn contains(self, fault: Fault) -> bool {
        self.0 & (1 << fault as u16) != 0
    }

    /// The set with `fault` in it.
    #[must_use]
    pub const fn with(self, fault: Fault) -> Self {
        Self(self.0 | 1 << fault as u16)
    }

    /// Its faults, in the order of [`Fault::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Fault> {
        Fault::ALL.into_iter().filter(move |&fault| self.contains(fault))
    }

    const fn set(&mut self, fault: Fault, on: bool) {
        let bit = 1 << fault as u16;
        self.0 = if on { self.0 | bit } else { self.0 & !bit };
    }
}

impl fmt::Display for FaultSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, fault) in self.iter().enumerate() {
            write!(f, "{}{}", if i == 0 { "" } else { ", " }, fault.name())?;
        }
        Ok(())
    }
}

/// Limits of the detector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultLimits {
    /// A count at or below is on the lower rail.
    pub rail_low: f32,
    /// A count at or above is on the upper rail.
    pub rail_high: f32,
    /// A lively taxel is frozen after so many seconds without a change; sound ones stay below 1.2 s.
    pub frozen_after_s: f32,
    /// A taxel that has never changed is dead after so many seconds.
    pub dead_after_s: f32,
    /// Back-and-forth noise (standard deviation, counts) above which a taxel is jumping ...
    pub jump_on_counts: f32,
    /// ... and below which it is not any more.
    pub jump_off_counts: f32,
    /// Share of a module's taxels that jump or sit on a rail, from which on the whole module is flickering.
    /// Above one half: one of a module's two converters may flicker alone.
    pub module_share: f32,
    /// A step of a whole board, counts. Above what a fast vent does between flat stretches.
    pub board_step_counts: f32,
    /// Share of a board's taxels that must step.
    pub board_step_share: f32,
    /// A fault is over when its cause has been absent for so many seconds.
    pub hold_s: f32,
    /// A module is stale after so many seconds of silence.
    pub stale_after_s: f32,
}

impl Default for FaultLimits {
    fn default() -> Self {
        Self {
            rail_low: 0.0,
            rail_high: 255.0,
            frozen_after_s: 3.0,
            dead_after_s: 3.0,
            jump_on_counts: 4.0,
            jump_off_counts: 3.0,
            module_share: 0.7,
            board_step_counts: 10.0,
            board_step_share: 0.75,
            hold_s: 2.0,
            stale_after_s: 1.0,
        }
    }
}

#[derive(Clone, Debug)]
struct ModuleWatch {
    taxels: Range<usize>,
    board: Option<usize>,
    /// Which of the module's twelve values each taxel is.
    slots: &'static [u8],
    heard: Option<Time>,
    not_connected_until: Time,
    no_ack_until: Time,
    out_of_range_until: [Time; VALUES_PER_MODULE],
    /// The last of these.
    status_until: Time,
    /// Its taxels carry faults that they share.
    marked: bool,
    /// Taxels that rose and that fell in one step, as of the last scan.
    steps: [usize; 2],
}

#[derive(Clone, Debug, Default)]
struct BoardWatch {
    taxels: usize,
    steps: [usize; 2],
    stepped_until: Option<Time>,
}

/// Watches every taxel of a patch.
#[derive(Clone, Debug)]
pub struct FaultDetector {
    limits: FaultLimits,
    hold: Duration,
    taxels: Vec<TaxelWatch>,
    modules: Vec<ModuleWatch>,
    boards: Vec<BoardWatch>,
    /// Taxels that changed within the freezing time, as of their last scan.
    lively: usize,
}

impl FaultDetector {
    /// `modules` and `boards` are ranges of taxel numbers; those beyond `taxel_count` are cut off.
    /// Modules of 10, 11 and 12 taxels are taken for triangles, palms with pad 11 and fingertips.
    #[must_use]
    pub fn new(taxel_count: usize, modules: &[Range<usize>], boards: &[Range<usize>], limits: FaultLimits) -> Self {
        let clip = |r: &Range<usize>| r.start.min(taxel_count)..r.end.min(taxel_count).max(r.start.min(taxel_count));
        let watch = |range: &Range<usize>| ModuleWatch {
            taxels: clip(range),
            board: boards.iter().position(|b| b.contains(&range.start)),
            slots: slots_by_size(range.len()),
            heard: None,
            not_connected_until: Time::from_nanos(i64::MIN),
            no_ack_until: Time::from_nanos(i64::MIN),
            out_of_range_until: [Time::from_nanos(i64::MIN); VALUES_PER_MODULE],
            status_until: Time::from_nanos(i64::MIN),
            marked: false,
            steps: [0; 2],
        };
        Self {
            limits,
            hold: Duration::from_secs_f32(limits.hold_s.clamp(0.0, 1e6)),
            taxels: vec![TaxelWatch::default(); taxel_count],
            modules: modules.iter().map(watch).collect(),
            boards: boards.iter().map(|b| BoardWatch { taxels: clip(b).len(), ..BoardWatch::default() }).collect(),
            lively: 0,
        }
    }

    /// Says what each module's values are, where their number leaves it open.
    #[must_use]
    pub fn with_kinds(mut self, kinds: impl IntoIterator<Item = ModuleKind>) -> Self {
        for (module, kind) in self.modules.iter_mut().zip(kinds) {
            module.slots = kind.taxel_slots();
        }
        self
    }

    /// The noise that each taxel is known to have at rest, in counts (NaN: unknown). It raises the limit for jumping
    /// on a noisy skin, and lets a freeze of the whole patch be seen.
    pub fn expect_noise(&mut self, noise_counts: impl IntoIterator<Item = f64>) {
        for (taxel, noise) in self.taxels.iter_mut().zip(noise_counts) {
            taxel.expect_noise(noise as f32);
        }
    }

    /// Takes the counts of one module; `status` is the word of its tail frame, 0 where all is well.
    /// Returns whether the faults of any taxel of the module changed. An unknown module is ignored.
    pub fn push_module(&mut self, now: Time, module: usize, counts: &[u8], status: u16) -> bool {
        let mut reals = [0.0; VALUES_PER_MODULE];
        let n = counts.len().min(VALUES_PER_MODULE);
        for (real, &count) in reals.iter_mut().zip(counts) {
            *real = f32::from(count);
        }
        self.push_reals(now, module, &reals[..n], status)
    }

    /// As [`FaultDetector::push_module`], for counts that are reals; a value that is not finite is a missing one.
    pub fn push_reals(&mut self, now: Time, module: usize, counts: &[f32], status: u16) -> bool {
        let Some(watch) = self.modules.get_mut(module) else { return false };
        let silent = watch.heard.is_some_and(|last| now.seconds_since(last) > f64::from(self.limits.stale_after_s));
        watch.heard = Some(now);
        watch.take_status(now + self.hold, status);
        let others_change = 4 * self.lively >= self.taxels.len();
        let (mut broken, mut steps, mut changed) = (0, [0; 2], false);
        let range = watch.taxels.clone();
        for (taxel, &count) in self.taxels[range.clone()].iter_mut().zip(counts) {
            let before = (taxel.faults, taxel.is_lively);
            if silent {
                taxel.forget_trend();
            }
            if count.is_finite() {
                taxel.push(now, count, others_change, self.hold, &self.limits);
                taxel.note_onset(now);
            }
            match (before.1, taxel.is_lively) {
                (false, true) => self.lively += 1,
                (true, false) => self.lively -= 1,
                _ => {}
            }
            broken += usize::from(taxel.faults.contains(Fault::Jumping) || taxel.faults.contains(Fault::Rail));
            match taxel.step(self.limits.board_step_counts) {
                step if step > 0.0 => steps[0] += 1,
                step if step < 0.0 => steps[1] += 1,
                _ => {}
            }
            changed |= taxel.faults != before.0;
        }
        let flicker = !range.is_empty() && broken as f32 >= self.limits.module_share * range.len() as f32;
        let stepped = self.board_stepped(now, module, steps);
        let watch = &mut self.modules[module];
        let shares = flicker || stepped || now < watch.status_until;
        if shares || watch.marked {
            watch.marked = shares;
            changed |= self.mark(now, module, flicker, stepped);
        }
        changed
    }

    /// Whether the module's board has stepped within the hold time.
    fn board_stepped(&mut self, now: Time, module: usize, steps: [usize; 2]) -> bool {
        let watch = &mut self.modules[module];
        let Some(board) = watch.board.and_then(|b| self.boards.get_mut(b)) else { return false };
        for (i, &fresh) in steps.iter().enumerate() {
            board.steps[i] = board.steps[i] + fresh - watch.steps[i];
        }
        watch.steps = steps;
        let needed = (self.limits.board_step_share * board.taxels as f32).max(1.0);
        if board.steps[0].max(board.steps[1]) as f32 >= needed {
            board.stepped_until = Some(now + self.hold);
        }
        board.stepped_until.is_some_and(|until| now < until)
    }

    /// Sets the faults that a whole module shares.
    fn mark(&mut self, now: Time, module: usize, flicker: bool, stepped: bool) -> bool {
        let watch = &self.modules[module];
        let mut changed = false;
        for (i, taxel) in self.taxels[watch.taxels.clone()].iter_mut().enumerate() {
            let before = taxel.faults;
            let out = watch.slots.get(i).is_some_and(|&slot| now < watch.out_of_range_until[slot as usize]);
            taxel.faults.set(Fault::ModuleFlicker, flicker);
            taxel.faults.set(Fault::BoardStep, stepped);
            taxel.faults.set(Fault::StatusOutOfRange, out);
            taxel.faults.set(Fault::NotConnected, now < watch.not_connected_until);
            taxel.faults.set(Fault::NoAck, now < watch.no_ack_until);
            taxel.faults.set(Fault::Stale, false);
            taxel.note_onset(now);
            changed |= taxel.faults != before;
        }
        changed
    }

    /// Time passed: modules that have been silent for too long are stale. Returns whether any became so.
    pub fn tick(&mut self, now: Time) -> bool {
        let mut changed = false;
        for module in &mut self.modules {
            let silent = |last| now.seconds_since(last) > f64::from(self.limits.stale_after_s);
            if !module.heard.is_some_and(silent) {
                continue;
            }
            module.marked = true;
            for taxel in &mut self.taxels[module.taxels.clone()] {
                changed |= !taxel.faults.contains(Fault::Stale);
                taxel.faults.set(Fault::Stale, true);
                taxel.note_onset(now);
            }
        }
        changed
    }

    /// The faults of a taxel now; none for an unknown taxel.
    #[must_use]
    pub fn faults(&self, taxel: usize) -> FaultSet {
        self.taxels.get(taxel).map(|t| t.faults).unwrap_or_default()
    }

    /// Since when the taxel's values are wrong: a freeze is known only seconds after it began. `None` if it has no
    /// fault. Who can still change what it wrote, as a reader of a file, excludes the taxel from here on.
    #[must_use]
    pub fn wrong_since(&self, taxel: usize) -> Option<Time> {
        self.taxels.get(taxel).and_then(TaxelWatch::wrong_since)
    }
}

impl ModuleWatch {
    /// Status word of a tail frame: bit 4 + i says that value i is out of range, bit 1 that nothing is connected,
    /// bit 0 that a conversion was not acknowledged.
    fn take_status(&mut self, until: Time, status: u16) {
        if status == 0 {
            return; // nearly always
        }
        self.status_until = until;
        if status & 1 != 0 {
            self.no_ack_until = until;
        }
        if status & 2 != 0 {
            self.not_connected_until = until;
        }
        for (value, out) in self.out_of_range_until.iter_mut().enumerate() {
            if status & (16 << value) != 0 {
                *out = until;
            }
        }
    }
}

fn slots_by_size(taxels: usize) -> &'static [u8] {
    match taxels {
        10 => ModuleKind::Triangle.taxel_slots(),
        11 => ModuleKind::PalmPad11.taxel_slots(),
        _ => ModuleKind::Fingertip.taxel_slots(),
    }
}
