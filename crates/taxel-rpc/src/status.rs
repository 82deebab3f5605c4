//! Refusals as gRPC statuses. Every text names the thing, its value and what was expected, and beside it stands the same
//! for programs.

use std::fmt;

use taxel_engine::command::{ErrorReason, Rejection};
use taxel_proto::refusal::Refusal;
use taxel_proto::v1;
use tonic::{Code, Status};

/// The engine's refusal with its own words.
pub(crate) fn of_rejection(rejection: &Rejection) -> Refusal {
    let (reason, text) = (sent_as(rejection.reason()), rejection.to_string());
    match rejection {
        Rejection::InvalidArgument { field, problem } => Refusal::invalid(field, problem),
        Rejection::FailedPrecondition(..) => Refusal::failed_precondition(reason, text),
        Rejection::NotFound(..) => Refusal::not_found(reason, text),
        Rejection::Unavailable(..) => Refusal::unavailable(reason, text),
    }
}

/// A field is not what it can be.
pub(crate) fn invalid(field: &str, problem: impl std::fmt::Display) -> Status {
    Refusal::invalid(field, problem).into()
}

pub(crate) const SHUTTING_DOWN: &str = "the daemon is shutting down";
pub(crate) const STOPPED: &str = "the engine has stopped";

/// The daemon cannot do anything now.
pub(crate) fn unavailable(why: &str) -> Refusal {
    Refusal::unavailable(v1::ErrorReason::DaemonUnavailable, why)
}

/// Why a command that the engine has is not answered: it may have been handed to the disk already.
pub(crate) fn left_open(code: Code, why: impl fmt::Display) -> Refusal {
    Refusal::new(code, v1::ErrorReason::DaemonUnavailable, format!("{why}; what was asked for may still come to pass"))
}

/// The system has no timer left for another fixed rate, or took one away.
pub(crate) fn no_timer(error: &std::io::Error) -> Refusal {
    Refusal::exhausted(v1::ErrorReason::DaemonBusy, format!("no timer for a fixed rate: {error}"))
}

/// The engine's reasons as programs have them: one for all that a program would answer in the same way.
const fn sent_as(reason: ErrorReason) -> v1::ErrorReason {
    use v1::ErrorReason as Sent;
    match reason {
        ErrorReason::FieldInvalid => Sent::FieldInvalid,
        ErrorReason::PatchUnknown => Sent::PatchUnknown,
        ErrorReason::SessionUnknown => Sent::SessionUnknown,
        ErrorReason::ModelSetUnknown => Sent::ModelSetUnknown,
        ErrorReason::LoadUnknown
        | ErrorReason::NoForce
        | ErrorReason::LoadBeingRead
        | ErrorReason::LoadNotFelt
        | ErrorReason::LoadUnsteady
        | ErrorReason::LoadInterrupted => Sent::LoadUnusable,
        ErrorReason::SessionOpen | ErrorReason::SessionWrongState | ErrorReason::ModelSetDiscarded => {
            Sent::SessionWrongState
        }
        ErrorReason::NoPressureSensor | ErrorReason::ListenOnly | ErrorReason::NotPushed => Sent::NotConfigured,
        ErrorReason::BoardsNotConfigured => Sent::BoardsNotConfigured,
        ErrorReason::BagPresses | ErrorReason::SkinLoaded | ErrorReason::TareLoaded => Sent::SkinLoaded,
        ErrorReason::GaugeOffset => Sent::GaugeOffset,
        ErrorReason::SkinSilent => Sent::SkinSilent,
        ErrorReason::TareUnsteady | ErrorReason::TareUnproven | ErrorReason::TareSuperseded | ErrorReason::ZeroLost => {
            Sent::ZeroInvalid
        }
        ErrorReason::NoModelSet => Sent::NoModelSet,
        ErrorReason::ModelSetInUse | ErrorReason::ActiveSetChanged => Sent::ActiveSetChanged,
        ErrorReason::ChangeUnderWay => Sent::DaemonBusy,
        ErrorReason::LayoutChanged => Sent::LayoutChanged,
        ErrorReason::SessionsDiffer | ErrorReason::SessionsTooLarge => Sent::NotFitted,
        ErrorReason::DataDamaged => Sent::DataDamaged,
        ErrorReason::StoreUnavailable => Sent::StoreUnavailable,
        ErrorReason::ProgramFault => Sent::ProgramFault,
    }
}
