//! The branches of a hysteresis loop: which of them a session gathers, and at which of them it is.

use serde::{Deserialize, Serialize};

/// Which branches of the pressure are fitted, and gathered by a session.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Branch {
    /// Rising pressure, as in the paper.
    #[default]
    Rising,
    /// Falling pressure too: the curve runs through the middle of the hysteresis.
    Both,
}

/// Which way the pressure goes while samples enter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Direction {
    /// It rises.
    #[default]
    Rising,
    /// It falls.
    Falling,
}

impl Direction {
    /// +1 where it rises, -1 where it falls.
    #[must_use]
    pub const fn sign(self) -> f64 {
        match self {
            Self::Rising => 1.0,
            Self::Falling => -1.0,
        }
    }
}
