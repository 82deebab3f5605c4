//! A refused call: words for people, and the same for programs in the standard details of a gRPC status.
//!
//! What they are is written at [`ErrorReason`]; here is the one place that makes them, and the one that reads them.

use std::collections::HashMap;

use tonic::codegen::http::HeaderMap;
use tonic::{Code, Status};
use tonic_types::{ErrorDetails, StatusExt};

use crate::v1::ErrorReason;

/// Whose reasons these are: [`ErrorReason`].
pub const DOMAIN: &str = "taxeld";

/// Longest text, in bytes. It is in the headers twice, as itself (where one character beyond ASCII takes three bytes for
/// one of its own) and in the details (in base64), and gRPC's own clients take 8 KiB of headers in all.
const TEXT_BYTES_MAX: usize = 1_400;

/// Longest description in a detail, in bytes.
const DESCRIPTION_BYTES_MAX: usize = 256;

/// Longest value of the metadata, in bytes: enough for every name that the daemon keeps.
const VALUE_BYTES_MAX: usize = 256;

/// Why a call is refused. It becomes a [`Status`] that carries all of this.
#[derive(Clone, Debug)]
pub struct Refusal {
    code: Code,
    reason: ErrorReason,
    text: String,
    /// What was asked for: kinds of things and which of them, such as `patch` and its name.
    about: Vec<(&'static str, String)>,
    field: Option<(String, String)>,
}

impl Refusal {
    /// A refusal with this code, for this reason, in these words.
    pub fn new(code: Code, reason: ErrorReason, text: impl Into<String>) -> Self {
        let (mut text, about) = (text.into(), Vec::new());
        if text.len() > TEXT_BYTES_MAX {
            text = format!("{} ... ({} bytes in all)", cut(&text, TEXT_BYTES_MAX), text.len());
        }
        Self { code, reason, text, about, field: None }
    }

    /// `INVALID_ARGUMENT`: a field is not what it can be.
    pub fn invalid(field: &str, problem: impl std::fmt::Display) -> Self {
        let problem = problem.to_string();
        let text = format!("{field}: {problem}");
        Self {
            field: Some((field.to_owned(), problem)),
            ..Self::new(Code::InvalidArgument, ErrorReason::FieldInvalid, text)
        }
    }

    /// `INVALID_ARGUMENT`: the message is not one of the call.
    pub fn unreadable(text: impl Into<String>) -> Self {
        Self::new(Code::InvalidArgument, ErrorReason::FieldInvalid, text)
    }

    /// `FAILED_PRECONDITION`: not in this state.
    pub fn failed_precondition(reason: ErrorReason, text: impl Into<String>) -> Self {
        Self::new(Code::FailedPrecondition, reason, text)
    }

    /// `NOT_FOUND`: there is no such thing.
    pub fn not_found(reason: ErrorReason, text: impl Into<String>) -> Self {
        Self::new(Code::NotFound, reason, text)
    }

    /// `RESOURCE_EXHAUSTED`: there is no room for it now.
    pub fn exhausted(reason: ErrorReason, text: impl Into<String>) -> Self {
        Self::new(Code::ResourceExhausted, reason, text)
    }

    /// `UNAVAILABLE`: it cannot be done now.
    pub fn unavailable(reason: ErrorReason, text: impl Into<String>) -> Self {
        Self::new(Code::Unavailable, reason, text)
    }

    /// `UNAUTHENTICATED`: the credentials are not taken.
    pub fn unauthenticated(text: impl Into<String>) -> Self {
        Self::new(Code::Unauthenticated, ErrorReason::CredentialsRefused, text)
    }

    /// `INTERNAL`: a fault of the daemon.
    pub fn fault(text: impl Into<String>) -> Self {
        Self::new(Code::Internal, ErrorReason::ProgramFault, text)
    }

    /// The same, about one thing more: `what` is the kind, such as `patch` or `session`, `which` its name or number.
    #[must_use]
    pub fn about(mut self, what: &'static str, which: impl std::fmt::Display) -> Self {
        self.about.push((what, which.to_string()));
        self
    }

    /// What the condition that failed is one of: the last thing named, which is the narrowest.
    fn subject(&self) -> String {
        self.about.last().map_or_else(String::new, |(what, which)| {
            let plural = if what.ends_with('h') { "es" } else { "s" };
            format!("{what}{plural}/{which}")
        })
    }

    fn details(&self) -> ErrorDetails {
        let reason = self.reason.as_str_name();
        let mut metadata: HashMap<String, String> =
            self.about.iter().map(|(what, which)| ((*what).to_owned(), cut(which, VALUE_BYTES_MAX))).collect();
        if let Some((field, _)) = &self.field {
            metadata.insert("field".to_owned(), field.clone());
        }
        let mut details = ErrorDetails::with_error_info(reason, DOMAIN, metadata);
        if let Some((field, problem)) = &self.field {
            details.add_bad_request_violation(field.as_str(), cut(problem, DESCRIPTION_BYTES_MAX));
        }
        if self.code == Code::FailedPrecondition {
            let description = cut(&self.text, DESCRIPTION_BYTES_MAX);
            details.add_precondition_failure_violation(reason, cut(&self.subject(), VALUE_BYTES_MAX), description);
        }
        details
    }
}

impl From<Refusal> for Status {
    fn from(refusal: Refusal) -> Self {
        let details = refusal.details();
        Self::with_error_details(refusal.code, refusal.text, details)
    }
}

/// The name of the [`ErrorReason`] that a status carries; nothing if it carries none of this daemon's.
#[must_use]
pub fn reason_of(status: &Status) -> Option<String> {
    info_of(status).map(|(reason, _)| reason)
}

/// The same with the metadata.
#[must_use]
pub fn info_of(status: &Status) -> Option<(String, HashMap<String, String>)> {
    let info = status.get_details_error_info().filter(|info| info.domain == DOMAIN)?;
    Some((info.reason, info.metadata))
}

/// Gives a reason to a refusal that comes of the libraries below the services and has none: of a message that they could
/// not take, or of something that `grpc.health.v1` or the reflection does not know. `headers` are a head or trailers.
pub fn complete(headers: &mut HeaderMap) {
    let Some(status) = Status::from_header_map(headers) else { return };
    if status.code() == Code::Ok || info_of(&status).is_some() {
        return;
    }
    let completed = completed(&status);
    // What it could not be written as is left as it was, which is whole without the details.
    let _ = completed.add_header(headers);
}

/// The same for a status that has not been sent yet.
#[must_use]
pub fn completed(status: &Status) -> Status {
    let reason = match status.code() {
        Code::NotFound => ErrorReason::MethodUnknown,
        Code::Cancelled => ErrorReason::DaemonUnavailable,
        _ => ErrorReason::FieldInvalid,
    };
    // Failures of ours have a reason: the libraries call it one of the service that a request is not what it should be.
    let code = if status.code() == Code::Internal { Code::InvalidArgument } else { status.code() };
    Refusal::new(code, reason, status.message()).into()
}

/// The first `bytes_max` bytes, ended where a character ends.
fn cut(text: &str, bytes_max: usize) -> String {
    let fits = |(start, character): &(usize, char)| start + character.len_utf8() <= bytes_max;
    text.char_indices().take_while(fits).map(|(_, character)| character).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_words_stay_whole_in_the_status_and_short_enough_for_a_header() {
        let text = "\u{fc}".repeat(TEXT_BYTES_MAX / 2);
        let status =
            Status::from(Refusal::failed_precondition(ErrorReason::DataDamaged, &text).about("session", &text));
        assert_eq!(status.message(), text);
        assert!(status.details().len() < 3 * 1024, "{} bytes", status.details().len());
        assert_eq!(info_of(&status).unwrap().1["session"].len(), VALUE_BYTES_MAX);
        let status = Status::from(Refusal::fault("x".repeat(100_000)));
        assert!(
            status.message().len() < TEXT_BYTES_MAX + 50 && status.message().ends_with("x ... (100000 bytes in all)")
        );
    }

    #[test]
    fn a_status_of_a_library_gets_a_reason_and_keeps_its_words() {
        let mut headers = HeaderMap::new();
        Status::out_of_range("too long").add_header(&mut headers).unwrap();
        complete(&mut headers);
        let status = Status::from_header_map(&headers).unwrap();
        assert_eq!((status.code(), status.message()), (Code::OutOfRange, "too long"));
        assert_eq!(reason_of(&status).as_deref(), Some("FIELD_INVALID"));
        let undecodable = completed(&Status::internal("failed to decode"));
        assert_eq!((undecodable.code(), undecodable.message()), (Code::InvalidArgument, "failed to decode"));
    }

    #[test]
    fn a_reason_of_somebody_else_is_none_of_ours() {
        let details = ErrorDetails::with_error_info("API_KEY_INVALID", "googleapis.com", HashMap::new());
        assert_eq!(reason_of(&Status::with_error_details(Code::Unavailable, "no", details)), None);
        assert_eq!(reason_of(&Status::unavailable("no connection")), None);
    }
}
