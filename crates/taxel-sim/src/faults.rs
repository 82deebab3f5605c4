//! What can go wrong, on demand.

use std::time::Duration;
use taxel_skin::{BoardAddress, Module, TaxelIndex};
use thiserror::Error;

/// A fault to inject. Those that last end with [`crate::World::repair`].
///
/// Every fault draws from random streams of its own: it never shifts the noise of anything else.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// The board says and hears nothing, but keeps its settings: a broken cable.
    BoardSilent(BoardAddress),
    /// The board loses power and comes back after `off`, with the settings and the tare of a fresh start: it streams
    /// nothing until it is brought up again. Happens once.
    PowerCycle {
        /// The board.
        board: BoardAddress,
        /// How long it is without power.
        off: Duration,
    },
    /// The board hangs, says and hears nothing for `off`, then takes whatever lies on it as its new zero and streams on
    /// with its old settings: a watchdog that restarts it. Happens once.
    Glitch {
        /// The board.
        board: BoardAddress,
        /// How long it hangs.
        off: Duration,
    },
    /// The board takes the present signal as its new zero, without a word. Happens once.
    SilentRetare(BoardAddress),
    /// The board sends at another period than it was told.
    OtherPeriod {
        /// The board.
        board: BoardAddress,
        /// Its period in milliseconds; 0 counts as 1.
        period_ms: u8,
    },
    /// Another node sends scans of all of the board's enabled modules under its identifiers, at the board's period and
    /// a phase of its own.
    ForeignNode {
        /// The board whose identifiers it uses.
        board: BoardAddress,
        /// What it sends.
        sends: ForeignScan,
    },
    /// No frames from this module.
    ModuleSilent(BoardAddress, Module),
    /// The module's converter is gone: all ones, and a status word that says so.
    ModuleUnplugged(BoardAddress, Module),
    /// The module's converter does not acknowledge: all zeros, the status word says so, and after five such readings
    /// the board tares itself silently, again and again.
    ModuleNoAck(BoardAddress, Module),
    /// All taxels of the module jump down together now and then.
    ModuleFlicker {
        /// The board.
        board: BoardAddress,
        /// The module.
        module: Module,
        /// Chance of a jump at each conversion, 0 to 1.
        probability: f64,
        /// How far the sent values jump down, in counts at shift 2.
        depth_counts: f64,
    },
    /// The taxel keeps its last reading. A taxel has one fault at a time: a new one takes the place of the old one.
    TaxelFrozen(TaxelIndex),
    /// The taxel sends always the same value.
    TaxelStuck {
        /// The taxel.
        taxel: TaxelIndex,
        /// What it sends.
        value: u8,
    },
    /// The taxel has more noise than it was made with.
    TaxelNoisy {
        /// The taxel.
        taxel: TaxelIndex,
        /// Standard deviation of the noise that is added, in counts at shift 2.
        sd_counts: f64,
    },
    /// The taxel reads the upper rail, 255, now and then.
    TaxelFlicker {
        /// The taxel.
        taxel: TaxelIndex,
        /// Chance of it at each conversion, 0 to 1.
        probability: f64,
    },
    /// The receiver loses frames at random.
    FramesLost {
        /// Chance to lose each frame, 0 to 1.
        probability: f64,
    },
    /// The receiver gets frames twice at random.
    FramesDuplicated {
        /// Chance of each frame, 0 to 1.
        probability: f64,
    },
    /// The receiver gets frames after the one that followed them, at random.
    FramesSwapped {
        /// Chance of each frame, 0 to 1.
        probability: f64,
    },
    /// The adapter gives nothing for `span`, then all of it in order within `within`, with fresh receive times.
    /// Happens once.
    FramesHeld {
        /// How long nothing comes.
        span: Duration,
        /// How long the frames that waited take to come.
        within: Duration,
    },
    /// The adapter gives all frames of the last `span` again within `within`, with fresh receive times, between the
    /// live ones. It remembers a few thousand frames. Happens once.
    FramesReplayed {
        /// How far back it begins.
        span: Duration,
        /// How long the old frames take to come.
        within: Duration,
    },
    /// The gauge sends nothing.
    GaugeSilent,
    /// The gauge repeats its last reading.
    GaugeStuck,
    /// The gauge reads more than there is.
    GaugeOffset {
        /// How much more, in kPa.
        kpa: f64,
    },
    /// Single readings of the gauge are far off.
    GaugeSpikes {
        /// Chance of each reading, 0 to 1.
        probability: f64,
        /// How far they are off, in kPa.
        kpa: f64,
    },
    /// The bag leaks more than it was made to.
    BagLeak {
        /// Time constant of the leak in seconds.
        leak_s: f64,
    },
    /// The skin and its electronics become warmer, or cooler, on top of the course of the configuration. Happens once;
    /// several add up.
    Warming {
        /// By how much, in kelvin.
        kelvin: f64,
        /// How long that takes, linearly.
        over: Duration,
    },
}

/// What a foreign node puts into the frames of the board that it pretends to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ForeignScan {
    /// This value for everything.
    Level(u8),
    /// What the board would have sent when the node appeared, all taxels shifted by so many counts.
    Shifted(i16),
}

/// A fault that cannot be.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum FaultError {
    /// No such board.
    #[error("the simulated skin has no board {0}")]
    Board(BoardAddress),
    /// No such taxel.
    #[error("the simulated skin has no taxel {taxel}, only {taxels}")]
    Taxel {
        /// The taxel asked for.
        taxel: u16,
        /// How many there are.
        taxels: usize,
    },
}
