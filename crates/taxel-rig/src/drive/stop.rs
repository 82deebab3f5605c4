//! Why a procedure was ended.

use std::fmt;

/// Why a procedure was ended, in words that say what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stop(pub(super) String);

impl fmt::Display for Stop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}
