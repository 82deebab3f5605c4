//! Identifiers: which bus, which board, which module, which taxel.

use std::fmt;
use thiserror::Error;

/// A number that cannot be the identifier it is given as.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum IdError {
    /// Board addresses are four bits, 0 is the host and 15 everyone.
    #[error("board address {0} is not in 1..=15")]
    BoardAddress(u8),
    /// The message type nibble numbers the modules of a board.
    #[error("module {0} is not in 0..=15")]
    Module(u8),
}

/// A CAN bus of this installation, by its position in the configuration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BusIndex(pub u8);

/// The CAN address of a skin board, 1 to 15. Commands to 15 go to all boards of the bus: nothing is ever sent to that address.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BoardAddress(u8);

impl BoardAddress {
    /// # Errors
    /// [`IdError::BoardAddress`] unless `address` is in 1..=15.
    pub const fn new(address: u8) -> Result<Self, IdError> {
        if address >= 1 && address <= 15 { Ok(Self(address)) } else { Err(IdError::BoardAddress(address)) }
    }

    /// The address, 1 to 15.
    #[must_use]
    pub const fn get(self) -> u8 {
        self.0
    }
}

impl fmt::Display for BoardAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// A module (triangle) of a board, 0 to 15.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Module(u8);

impl Module {
    /// # Errors
    /// [`IdError::Module`] unless `module` is in 0..=15.
    pub const fn new(module: u8) -> Result<Self, IdError> {
        if module < 16 { Ok(Self(module)) } else { Err(IdError::Module(module)) }
    }

    /// The module that the low nibble of `bits` names; total.
    #[must_use]
    pub const fn from_nibble(bits: u8) -> Self {
        Self(bits & 0xF)
    }

    /// The module's number, 0 to 15.
    #[must_use]
    pub const fn get(self) -> u8 {
        self.0
    }
}

impl fmt::Display for Module {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// A pressure taxel of a patch: its position in [`crate::Patch::taxels`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TaxelIndex(pub u16);

impl TaxelIndex {
    /// The position as a slice index.
    #[must_use]
    pub const fn get(self) -> usize {
        self.0 as usize
    }
}
