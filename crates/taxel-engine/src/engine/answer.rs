//! When a command is answered.

use crate::boundary::command::Done;

/// A command is answered at once, or its effect answers it later.
pub(super) enum Answer {
    /// With this.
    Now(Done),
    /// When it is on disk, or read from there.
    Later,
}
