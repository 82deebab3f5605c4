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

/// The samples of a stored session, as the store has answered.
pub(crate) fn samples_of<T>(session: u64, read: Result<T, String>) -> Result<T, Status> {
    Ok(read.map_err(|why| {
        let why = format!("the samples of session {session}: {why}");
        Refusal::failed_precondition(v1::ErrorReason::DataDamaged, why).about("session", session)
    })?)
}

pub(crate) const SHUTTING_DOWN: &str = "the daemon is shutting down";
pub(crate) const STOPPED: &str = "the engine has stopped";

/// Why streams end when the daemon stops.
pub(crate) fn shutting_down() -> Status {
    Refusal::unavailable(v1::ErrorReason::ShuttingDown, SHUTTING_DOWN).into()
}

/// Why a command that the engine has is not answered: it may have been handed to the disk already.
pub(crate) fn left_open(code: Code, reason: v1::ErrorReason, why: impl fmt::Display) -> Status {
    Refusal::new(code, reason, format!("{why}; what was asked for may still come to pass")).into()
}

/// The engine's task is gone.
pub(crate) fn engine_stopped() -> Status {
    Refusal::unavailable(v1::ErrorReason::EngineStopped, STOPPED).into()
}

/// The system has no timer left for another fixed rate, or took one away.
pub(crate) fn no_timer(error: &std::io::Error) -> Status {
    Refusal::exhausted(v1::ErrorReason::NoPlace, format!("no timer for a fixed rate: {error}")).into()
}

/// The engine's reasons under the same names.
const fn sent_as(reason: ErrorReason) -> v1::ErrorReason {
    use v1::ErrorReason as Sent;
    match reason {
        ErrorReason::FieldInvalid => Sent::FieldInvalid,
        ErrorReason::PatchUnknown => Sent::PatchUnknown,
        ErrorReason::SessionUnknown => Sent::SessionUnknown,
        ErrorReason::ModelSetUnknown => Sent::ModelSetUnknown,
        ErrorReason::LoadUnknown => Sent::LoadUnknown,
        ErrorReason::SessionOpen => Sent::SessionOpen,
        ErrorReason::SessionWrongState => Sent::SessionWrongState,
        ErrorReason::BeingDeleted => Sent::BeingDeleted,
        ErrorReason::LimitReached => Sent::LimitReached,
        ErrorReason::NoPressureSensor => Sent::NoPressureSensor,
        ErrorReason::BoardsNotConfigured => Sent::BoardsNotConfigured,
        ErrorReason::ListenOnly => Sent::ListenOnly,
        ErrorReason::BagPresses => Sent::BagPresses,
        ErrorReason::GaugeOffset => Sent::GaugeOffset,
        ErrorReason::SkinLoaded => Sent::SkinLoaded,
        ErrorReason::SkinSilent => Sent::SkinSilent,
        ErrorReason::TareLoaded => Sent::TareLoaded,
        ErrorReason::TareUnsteady => Sent::TareUnsteady,
        ErrorReason::TareUnproven => Sent::TareUnproven,
        ErrorReason::TareSuperseded => Sent::TareSuperseded,
        ErrorReason::ZeroLost => Sent::ZeroLost,
        ErrorReason::NoModelSet => Sent::NoModelSet,
        ErrorReason::NoForce => Sent::NoForce,
        ErrorReason::LoadBeingRead => Sent::LoadBeingRead,
        ErrorReason::LoadNotFelt => Sent::LoadNotFelt,
        ErrorReason::LoadUnsteady => Sent::LoadUnsteady,
        ErrorReason::LoadInterrupted => Sent::LoadInterrupted,
        ErrorReason::ModelSetInUse => Sent::ModelSetInUse,
        ErrorReason::ModelSetDiscarded => Sent::ModelSetDiscarded,
        ErrorReason::ActiveSetChanged => Sent::ActiveSetChanged,
        ErrorReason::ActivationUnderWay => Sent::ActivationUnderWay,
        ErrorReason::LayoutChanged => Sent::LayoutChanged,
        ErrorReason::SessionsDiffer => Sent::SessionsDiffer,
        ErrorReason::SessionsTooLarge => Sent::SessionsTooLarge,
        ErrorReason::DataDamaged => Sent::DataDamaged,
        ErrorReason::NotPushed => Sent::NotPushed,
        ErrorReason::StoreUnavailable => Sent::StoreUnavailable,
        ErrorReason::ProgramFault => Sent::ProgramFault,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reason_is_sent_under_its_own_name() {
        let all = {
            use ErrorReason::*;
            [
                FieldInvalid,
                PatchUnknown,
                SessionUnknown,
                ModelSetUnknown,
                LoadUnknown,
                SessionOpen,
                SessionWrongState,
                BeingDeleted,
                LimitReached,
                NoPressureSensor,
                BoardsNotConfigured,
                ListenOnly,
                BagPresses,
                GaugeOffset,
                SkinLoaded,
                SkinSilent,
                TareLoaded,
                TareUnsteady,
                TareUnproven,
                TareSuperseded,
                ZeroLost,
                NoModelSet,
                NoForce,
                LoadBeingRead,
                LoadNotFelt,
                LoadUnsteady,
                LoadInterrupted,
                ModelSetInUse,
                ModelSetDiscarded,
                ActiveSetChanged,
                ActivationUnderWay,
                LayoutChanged,
                SessionsDiffer,
                SessionsTooLarge,
                DataDamaged,
                NotPushed,
                StoreUnavailable,
                ProgramFault,
            ]
        };
        for reason in all {
            assert_eq!(format!("{:?}", sent_as(reason)), format!("{reason:?}"));
        }
    }
}
