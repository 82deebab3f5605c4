//! Who asked for something, and why it was refused.

use thiserror::Error;

/// Which request an answer belongs to; made by the shell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct RequestId(pub u64);

/// Why a command was refused. The text is for people and names the value and what was expected.
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
    #[error("{0}")]
    FailedPrecondition(String),
    /// There is no such thing.
    #[error("there is no {0}")]
    NotFound(String),
    /// The store or the bus cannot do it now.
    #[error("{0}")]
    Unavailable(String),
}
