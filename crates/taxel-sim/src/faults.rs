//! What can go wrong, on demand.

use std::time::Duration;
use taxel_skin::{BoardAddress, Module, TaxelIndex};
use thiserror::Error;

/// A fault to inject. Those that last end with [`crate::World::repair`].
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
    /// The board takes the present signal as its new zero, without a word. Happens once.
    SilentRetare(BoardAddress),
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
    /// The taxel keeps its last reading.
    TaxelFrozen(TaxelIndex),
    /// The receiver loses frames at random.
    FramesLost {
        /// Chance to lose each frame, 0 to 1.
        probability: f64,
    },
    /// The gauge sends nothing.
    GaugeSilent,
    /// The gauge repeats its last reading.
    GaugeStuck,
}

/// A fault at a place that does not exist.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
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
