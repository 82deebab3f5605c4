//! Why a command of a client did not come to a good end, what to do about it, and the exit code that tells scripts so.

use std::fmt;
use std::process::ExitCode;

use taxel_proto::refusal::reason_of;
use taxel_proto::v1::ErrorReason;
use tonic::{Code, Status};

/// Exit code of a command that the daemon refused, or that found no good force or a fault in the health.
const REFUSED: u8 = 3;
/// Exit code of a calibration that gave a set which is not good.
const NOT_GOOD: u8 = 4;
/// Exit code where the daemon could not be asked, or its answer could not be used.
const BROKEN: u8 = 1;

/// Why a command did not come to a good end.
#[derive(Debug)]
pub struct Failure {
    why: String,
    code: u8,
    /// A command that helps.
    help: Option<String>,
    /// The daemon's own reason.
    reason: ErrorReason,
}

/// What a command of a client gives.
pub type Outcome<T = ()> = Result<T, Failure>;

impl Failure {
    /// A refusal in these words: exit code 3.
    pub fn refused(why: impl Into<String>) -> Self {
        Self { why: why.into(), code: REFUSED, help: None, reason: ErrorReason::Unspecified }
    }

    /// A set that is not used, because it is not good: exit code 4.
    pub fn not_good(why: impl Into<String>) -> Self {
        Self { code: NOT_GOOD, ..Self::refused(why) }
    }

    /// The same with a command that helps.
    pub fn help(self, command: impl Into<String>) -> Self {
        Self { help: Some(command.into()), ..self }
    }

    /// The code that the programme ends with.
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(self.code)
    }

    /// A command that helps after `command`.
    pub fn help_for(&self, command: &str) -> Option<String> {
        self.help.clone().or_else(|| helps(self.reason, command))
    }
}

/// What to type where the daemon refuses `command` for this reason.
fn helps(reason: ErrorReason, command: &str) -> Option<String> {
    Some(match reason {
        ErrorReason::SkinLoaded | ErrorReason::ZeroInvalid if matches!(command, "tare" | "bring-up" | "calibrate") => {
            format!("taxeld {command} --confirmed-by NAME   # only if nothing touches the skin")
        }
        ErrorReason::ZeroInvalid => "taxeld tare".to_owned(),
        ErrorReason::NoModelSet => "taxeld calibrate".to_owned(),
        ErrorReason::SessionUnknown | ErrorReason::SessionWrongState => "taxeld sessions list".to_owned(),
        ErrorReason::ModelSetUnknown | ErrorReason::ActiveSetChanged => "taxeld models list".to_owned(),
        ErrorReason::RoleTooLow | ErrorReason::CredentialsRefused => format!("taxeld {command} --token FILE"),
        ErrorReason::PatchUnknown
        | ErrorReason::SkinSilent
        | ErrorReason::BoardsNotConfigured
        | ErrorReason::GaugeOffset
        | ErrorReason::DaemonUnavailable
        | ErrorReason::StoreUnavailable => "taxeld health".to_owned(),
        _ => return None,
    })
    .filter(|help| *help != format!("taxeld {command}"))
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.why)
    }
}

impl From<Status> for Failure {
    fn from(status: Status) -> Self {
        let name = reason_of(&status).unwrap_or_default();
        let reason = ErrorReason::from_str_name(&name).unwrap_or(ErrorReason::Unspecified);
        let says_no = matches!(
            status.code(),
            Code::InvalidArgument
                | Code::NotFound
                | Code::AlreadyExists
                | Code::PermissionDenied
                | Code::Unauthenticated
                | Code::FailedPrecondition
                | Code::OutOfRange
                | Code::Aborted
                | Code::ResourceExhausted
        );
        if says_no {
            return Self { reason, ..Self::refused(status.message()) };
        }
        let why = format!("the daemon answered {:?}: {}", status.code(), status.message());
        Self { reason, code: BROKEN, ..Self::refused(why) }
    }
}

impl From<anyhow::Error> for Failure {
    fn from(error: anyhow::Error) -> Self {
        Self { code: BROKEN, ..Self::refused(format!("{error:#}")) }
    }
}

impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        anyhow::Error::from(error).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_proto::refusal::Refusal;

    #[test]
    fn a_refusal_names_the_command_that_helps() {
        let of = |reason| Failure::from(Status::from(Refusal::failed_precondition(reason, "no")));
        let loaded = of(ErrorReason::SkinLoaded);
        assert!(loaded.help_for("tare").unwrap().starts_with("taxeld tare --confirmed-by NAME"), "{loaded:?}");
        assert_eq!(of(ErrorReason::ZeroInvalid).help_for("load").as_deref(), Some("taxeld tare"));
        assert_eq!(of(ErrorReason::SkinSilent).help_for("health"), None, "what was just done is no help");
        assert_eq!(Failure::refused("no").help("taxeld run").help_for("tare").as_deref(), Some("taxeld run"));
    }
}
