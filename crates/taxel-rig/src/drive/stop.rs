//! Why a procedure was ended.

use std::fmt;

/// Why a procedure was ended, in words that say what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stop(pub(super) String);

/// How it begins where the drive is at fault.
pub(super) const NOT_TAKEN: &str = "the drive has not taken a command";

impl Stop {
    /// Whether it is because the drive does not answer as it should: what it was told and answered says more.
    #[must_use]
    pub fn is_not_taken(&self) -> bool {
        self.0.starts_with(NOT_TAKEN)
    }
}

impl fmt::Display for Stop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}
