//! Why a command of a client did not come to a good end, and the exit code that tells scripts so.

use std::fmt;
use std::process::ExitCode;

use tonic::{Code, Status};

/// Exit code of a command that the daemon refused, or that found no good force or a fault in the health.
const REFUSED: u8 = 3;

/// Why a command did not come to a good end.
#[derive(Debug)]
pub enum Failure {
    /// The daemon answered, and the answer is no: exit code 3.
    Refused(String),
    /// It could not be asked, or its answer could not be used: exit code 1.
    Broken(anyhow::Error),
}

/// What a command of a client gives.
pub type Outcome<T = ()> = Result<T, Failure>;

impl Failure {
    /// A refusal in these words.
    pub fn refused(why: impl Into<String>) -> Self {
        Self::Refused(why.into())
    }

    /// The code that the programme ends with.
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Refused(_) => ExitCode::from(REFUSED),
            Self::Broken(_) => ExitCode::FAILURE,
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refused(why) => f.write_str(why),
            Self::Broken(error) => write!(f, "{error:#}"),
        }
    }
}

impl From<Status> for Failure {
    fn from(status: Status) -> Self {
        match status.code() {
            Code::InvalidArgument
            | Code::NotFound
            | Code::AlreadyExists
            | Code::PermissionDenied
            | Code::Unauthenticated
            | Code::FailedPrecondition
            | Code::OutOfRange
            | Code::Aborted
            | Code::ResourceExhausted => Self::Refused(status.message().to_owned()),
            code => Self::Broken(anyhow::anyhow!("the daemon answered {code:?}: {}", status.message())),
        }
    }
}

impl From<anyhow::Error> for Failure {
    fn from(error: anyhow::Error) -> Self {
        Self::Broken(error)
    }
}

impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        Self::Broken(error.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_daemon_that_says_no_is_told_from_one_that_cannot_be_asked() {
        assert!(matches!(Failure::from(Status::failed_precondition("rest")), Failure::Refused(why) if why == "rest"));
        assert!(matches!(Failure::from(Status::permission_denied("role")), Failure::Refused(_)));
        assert!(matches!(Failure::from(Status::unavailable("gone")), Failure::Broken(_)));
        assert!(matches!(Failure::from(Status::deadline_exceeded("late")), Failure::Broken(_)));
    }
}
