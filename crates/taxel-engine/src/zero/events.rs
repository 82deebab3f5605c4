//! What the zero takes in and what it reports.

use std::sync::Arc;

use crate::model_set::ModelSet;
use crate::request::{ErrorReason, RequestId};
use crate::zero::bag::Bag;
use crate::zero::kept::TakenZero;
use crate::zero::watch::Purpose;

/// What became of the zero.
#[derive(Clone, Debug)]
pub enum ZeroEvent {
    /// Rest is proven, or confirmed, for an operator: the zero waits for `Zero::adopt`, once it is on disk.
    Proven {
        /// Whom to answer.
        request: RequestId,
        /// The zero.
        zero: Arc<TakenZero>,
    },
    /// A zero was taken, or is that of before the start, and who wanted it.
    Taken(Purpose),
    /// There is no zero: who wanted one, and why for programs and for people.
    Refused(Purpose, ErrorReason, String),
    /// The zero does not hold any more; why.
    Lost(String),
    /// The counts show that a board has a new zero, which is why the patch's is lost; reported after [`ZeroEvent::Lost`].
    BoardMoved {
        /// Position of the board in the patch.
        board: usize,
        /// What shows it.
        why: String,
    },
    /// It has followed the temperature.
    Moved,
    /// Whether it holds is being checked.
    InCheck,
    /// It holds after all.
    Cleared,
}

/// What the zero has to know with each scan.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings<'a> {
    /// The active model set.
    pub models: Option<&'a ModelSet>,
    /// Whether the boards are expected to send.
    pub boards_ready: bool,
    /// Whether they are being configured, and take zeros of their own.
    pub configuring: bool,
    /// What the bag does. While a session holds the patch the zero does not follow the temperature.
    pub bag: Bag,
    /// Whether that session does without some modules.
    pub parts_left_out: bool,
    /// Whether the scan cannot be one of rest for a session: the bag presses, or the boards are being configured.
    pub no_rest: bool,
}
