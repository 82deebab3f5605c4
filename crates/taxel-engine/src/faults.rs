//! Live faults per taxel and module: named, and ending by themselves.

use std::ops::Range;
use taxel_skin::Time;

/// What is wrong with a taxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Fault {
    /// At 0, 255 or a clip value of the firmware.
    Rail,
    /// Has not changed for far longer than the conversion rate explains.
    Frozen,
    /// Steps no load makes.
    Jumping,
    /// Never answers a load that its neighbours see.
    Dead,
    /// Its whole module jumps.
    ModuleFlicker,
    /// The module's status word says that the value is out of range.
    StatusOutOfRange,
    /// The module's status word says that nothing is connected.
    NotConnected,
    /// The module's status word reports a lost acknowledgement.
    NoAck,
    /// No value within the time limit.
    Stale,
    /// Its whole board stepped at once: a silent re-tare.
    BoardStep,
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
}

/// Limits of the detector.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FaultLimits {}

/// Watches every taxel of a patch.
#[derive(Clone, Debug)]
pub struct FaultDetector {
    taxels: Vec<FaultSet>,
}

impl FaultDetector {
    /// `modules` and `boards` are ranges of taxel numbers.
    #[must_use]
    pub fn new(taxel_count: usize, modules: &[Range<usize>], boards: &[Range<usize>], limits: FaultLimits) -> Self {
        let _ = (modules, boards, limits);
        Self { taxels: vec![FaultSet::default(); taxel_count] }
    }

    /// Takes the counts of one module; `status` is the word of its tail frame, 0 where all is well.
    pub fn push_module(&mut self, now: Time, module: usize, counts: &[u8], status: u16) {
        let _ = (now, module, counts, status);
    }

    /// The faults of a taxel now.
    #[must_use]
    pub fn faults(&self, taxel: usize) -> FaultSet {
        self.taxels.get(taxel).copied().unwrap_or_default()
    }
}
