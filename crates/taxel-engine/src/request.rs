//! Who asked for something, and why it was refused.

use thiserror::Error;

/// Which request an answer belongs to; made by the shell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct RequestId(pub u64);

/// Why a command was refused: for programs the reason, for people a text that names the value and what was expected.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum Rejection {
    /// A field is not what it can be.
    #[error("{field}: {problem}")]
    InvalidArgument {
        /// The field's name in the request.
        field: &'static str,
        /// What is wrong and what was expected.
        problem: String,
    },
    /// Not in this state.
    #[error("{1}")]
    FailedPrecondition(ErrorReason, String),
    /// There is no such thing.
    #[error("there is no {1}")]
    NotFound(ErrorReason, String),
    /// The store or the bus cannot do it now.
    #[error("{1}")]
    Unavailable(ErrorReason, String),
}

impl Rejection {
    /// A field is not what it can be.
    pub(crate) fn invalid(field: &'static str, problem: impl Into<String>) -> Self {
        Self::InvalidArgument { field, problem: problem.into() }
    }

    /// There is no session of this number.
    pub(crate) fn no_session(number: u64) -> Self {
        Self::NotFound(ErrorReason::SessionUnknown, format!("session {number}"))
    }

    /// There is no model set of this id.
    pub(crate) fn no_model_set(id: &str) -> Self {
        Self::NotFound(ErrorReason::ModelSetUnknown, format!("model set `{id}`"))
    }

    /// Why, for programs.
    #[must_use]
    pub const fn reason(&self) -> ErrorReason {
        match self {
            Self::InvalidArgument { .. } => ErrorReason::FieldInvalid,
            Self::FailedPrecondition(reason, _) | Self::NotFound(reason, _) | Self::Unavailable(reason, _) => *reason,
        }
    }
}

impl ErrorReason {
    /// Refuses what cannot be in this state.
    pub(crate) fn because(self, why: impl Into<String>) -> Rejection {
        Rejection::FailedPrecondition(self, why.into())
    }

    /// Refuses it unless something `holds`.
    pub(crate) fn unless(self, holds: bool, why: impl FnOnce() -> String) -> Result<(), Rejection> {
        if holds { Ok(()) } else { Err(self.because(why())) }
    }
}

/// Why a command was refused, for programs: one value for all refusals that a program would answer in the same way.
/// `taxel.v1.ErrorReason` has the same values under the same names, and says what can be done about each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ErrorReason {
    /// A field is not what it can be.
    FieldInvalid,
    /// No patch of this name.
    PatchUnknown,
    /// No session of this number.
    SessionUnknown,
    /// No model set of this id.
    ModelSetUnknown,
    /// No known load of this number.
    LoadUnknown,
    /// A session is open, and has to be finished or aborted first.
    SessionOpen,
    /// The session is in a state in which this cannot be done.
    SessionWrongState,
    /// The patch has no pressure sensor.
    NoPressureSensor,
    /// The boards are still being configured.
    BoardsNotConfigured,
    /// The daemon sends nothing to the boards.
    ListenOnly,
    /// The bag presses on the skin.
    BagPresses,
    /// The gauge reads what a vented bag cannot have.
    GaugeOffset,
    /// A load is felt.
    SkinLoaded,
    /// Too few scans came, or none.
    SkinSilent,
    /// Something lies on the skin that is to be tared.
    TareLoaded,
    /// The skin moved while it was watched for a tare.
    TareUnsteady,
    /// The counts cannot show that nothing touches the skin; somebody may confirm it.
    TareUnproven,
    /// Another tare began meanwhile.
    TareSuperseded,
    /// Something has moved the zero, or there is none.
    ZeroLost,
    /// No model set is active.
    NoModelSet,
    /// There is no force.
    NoForce,
    /// Another known load is being read.
    LoadBeingRead,
    /// The skin feels next to nothing of a known load.
    LoadNotFelt,
    /// The force under a known load is unsteady.
    LoadUnsteady,
    /// The zero or the model set changed while a known load was read.
    LoadInterrupted,
    /// The model set is in use.
    ModelSetInUse,
    /// The session of the model set was laid aside.
    ModelSetDiscarded,
    /// Another model set is active than was expected.
    ActiveSetChanged,
    /// Another change of sessions or model sets is being written to disk.
    ChangeUnderWay,
    /// What was asked for is of another layout of the patch, or was gathered with other settings of its boards.
    LayoutChanged,
    /// Sessions cannot be fitted together.
    SessionsDiffer,
    /// Sessions have too many samples to be fitted together.
    SessionsTooLarge,
    /// What is on disk is damaged.
    DataDamaged,
    /// The scans of the patch are not pushed.
    NotPushed,
    /// The store cannot take records or give them.
    StoreUnavailable,
    /// This cannot happen.
    ProgramFault,
}
