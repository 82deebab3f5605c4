//! What can happen in a story, as far as lies and times without a force are counted by it.

macro_rules! kinds {
    ($($kind:ident => $name:literal),+ $(,)?) => {
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Kind { $($kind),+ }
        impl Kind {
            pub const ALL: &'static [Self] = &[$(Self::$kind),+];
            pub const fn name(self) -> &'static str {
                match self { $(Self::$kind => $name),+ }
            }
        }
    };
}

kinds! {
    // What zero and models went through; the first of these that holds names a lie.
    BoardsUnderLoad => "boards configured under a load",
    ZeroWhileChanging => "zero taken while a load changed",
    ZeroUnderLoad => "zero taken under a load",
    LoadInSession => "models gathered under a load",
    // Faults.
    Glitch => "board hangs below 1 s, new zero",
    BoardRetare => "silent re-tare of a board",
    NoAcks => "lost acknowledgements",
    PowerCycle => "power cycle of a board",
    BoardSilent => "board silent",
    OtherPeriod => "board at another period",
    ForeignRest => "foreign node, rest",
    ForeignShifted => "foreign node, shifted",
    ModuleSilent => "module silent",
    ModuleUnplugged => "module unplugged",
    ModuleFlicker => "module flickers",
    TaxelFrozen => "taxel frozen",
    TaxelStuck => "taxel stuck",
    TaxelNoisy => "taxel noisy",
    TaxelFlicker => "taxel flickers on its rail",
    FramesLost => "frames lost",
    FramesDuplicated => "frames duplicated",
    FramesSwapped => "frames swapped",
    FramesHeld => "frames held back, then all at once",
    FramesReplayed => "old scans again",
    GaugeSilent => "gauge silent",
    GaugeStuck => "gauge stuck",
    GaugeOffset => "gauge jumped",
    GaugeSpikes => "gauge spikes",
    BagLeak => "bag leaks",
    WarmStep => "temperature step",
    WarmRamp => "temperature ramp",
    Stall => "engine stalled",
    BusOff => "bus-off",
    StoreFails => "store refuses",
    // What the operator does.
    Restart => "restart",
    BringUp => "bring-up",
    Session => "session",
    Activation => "activation",
    Tare => "tare",
}

impl Kind {
    /// The faults that a story draws from.
    pub fn faults() -> &'static [Self] {
        &Self::ALL[Self::Glitch as usize..=Self::StoreFails as usize]
    }

    pub const fn is_fault(self) -> bool {
        (self as usize) < Self::Restart as usize
    }
}

/// A set of kinds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Kinds(u64);

impl Kinds {
    pub const fn one(kind: Kind) -> Self {
        Self(1 << kind as u64)
    }

    pub const fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    pub fn insert(&mut self, kind: Kind) {
        *self = self.or(Self::one(kind));
    }

    pub fn remove(&mut self, kind: Kind) {
        self.0 &= !Self::one(kind).0;
    }

    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    pub const fn has(self, kind: Kind) -> bool {
        self.0 & Self::one(kind).0 != 0
    }

    pub fn iter(self) -> impl Iterator<Item = Kind> {
        let rest = std::iter::successors(Some(self.0), |rest| Some(rest & rest.wrapping_sub(1)));
        rest.take_while(|rest| *rest != 0).map(|rest| Kind::ALL[rest.trailing_zeros() as usize])
    }
}
