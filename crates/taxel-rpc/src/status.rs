//! Refusals as gRPC statuses. Every text names the thing, its value and what was expected.

use taxel_engine::command::Rejection;
use tonic::Status;

/// The engine's refusal with its own words.
pub(crate) fn of_rejection(rejection: &Rejection) -> Status {
    let text = rejection.to_string();
    match rejection {
        Rejection::InvalidArgument { .. } => Status::invalid_argument(text),
        Rejection::FailedPrecondition(_) => Status::failed_precondition(text),
        Rejection::NotFound(_) => Status::not_found(text),
        Rejection::Unavailable(_) => Status::unavailable(text),
    }
}

/// A field is not what it can be.
pub(crate) fn invalid(field: &str, problem: impl std::fmt::Display) -> Status {
    Status::invalid_argument(format!("{field}: {problem}"))
}

/// Why streams end and commands fail when the daemon stops.
pub(crate) fn shutting_down() -> Status {
    Status::unavailable("the daemon is shutting down")
}

/// The engine's task is gone.
pub(crate) fn engine_stopped() -> Status {
    Status::unavailable("the engine has stopped")
}
