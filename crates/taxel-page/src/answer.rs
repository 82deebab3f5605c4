//! Answers over HTTP: JSON, refusals, and the headers that every answer has.

use axum::http::StatusCode;
use axum::http::header::{ALLOW, CACHE_CONTROL, CONTENT_TYPE, HeaderName, HeaderValue, REFERRER_POLICY};
use axum::http::header::{CONTENT_SECURITY_POLICY, X_CONTENT_TYPE_OPTIONS};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use serde_json::json;
use taxel_proto::code_name;
use taxel_proto::refusal::{Refusal, info_of};
use taxel_proto::v1::ErrorReason;
use tonic::{Code, Status};

/// What the JSON of an answer is sent as.
pub(crate) const JSON: &str = "application/json";

/// The page runs its own scripts, speaks to its own origin, and is framed by nobody.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; \
    base-uri 'none'; form-action 'none'; frame-ancestors 'none'; require-trusted-types-for 'script'";

/// Headers that keep a browser from sharing, sniffing or keeping anything.
const ON_EVERY_ANSWER: [(HeaderName, &str); 6] = [
    (CONTENT_SECURITY_POLICY, POLICY),
    (X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (REFERRER_POLICY, "no-referrer"),
    (CACHE_CONTROL, "no-store"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
];

/// Adds the headers that every answer has.
pub(crate) fn hardened(mut response: Response) -> Response {
    for (name, value) in ON_EVERY_ANSWER {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

/// An answer that is JSON.
pub(crate) fn json_of(value: &impl Serialize) -> Response {
    match serde_json::to_vec(value) {
        Ok(json) => ([(CONTENT_TYPE, JSON)], json).into_response(),
        Err(error) => refusal(&Refusal::fault(format!("the answer is no JSON: {error}")).into()),
    }
}

/// Refuses a method that the path does not have.
pub(crate) fn wrong_method(allowed: &'static str, why: &str) -> Response {
    let refused = Refusal::new(Code::Unimplemented, ErrorReason::MethodUnknown, why).into();
    let mut response = refusal_as(StatusCode::METHOD_NOT_ALLOWED, &refused);
    response.headers_mut().insert(ALLOW, HeaderValue::from_static(allowed));
    response
}

/// A gRPC status as an answer.
pub(crate) fn refusal(status: &Status) -> Response {
    refusal_as(http_status(status.code()), status)
}

/// The same under another HTTP status.
pub(crate) fn refusal_as(http: StatusCode, status: &Status) -> Response {
    (http, [(CONTENT_TYPE, JSON)], status_json(status).to_string()).into_response()
}

/// `{"code": "NOT_FOUND", "message": "...", "reason": "PATCH_UNKNOWN", "metadata": {"patch": "..."}}`; the last two are as
/// in google.rpc.ErrorInfo, and not there if nothing was refused.
pub(crate) fn status_json(status: &Status) -> serde_json::Value {
    let mut told = json!({ "code": code_name(status.code()), "message": status.message() });
    if let Some((reason, metadata)) = info_of(status) {
        told["reason"] = reason.into();
        told["metadata"] =
            metadata.into_iter().map(|(what, which)| (what, which.into())).collect::<serde_json::Map<_, _>>().into();
    }
    told
}

/// The HTTP status that google.rpc.Code names for each code.
const fn http_status(code: Code) -> StatusCode {
    match code {
        Code::Ok => StatusCode::OK,
        Code::InvalidArgument | Code::FailedPrecondition | Code::OutOfRange => StatusCode::BAD_REQUEST,
        Code::Unauthenticated => StatusCode::UNAUTHORIZED,
        Code::PermissionDenied => StatusCode::FORBIDDEN,
        Code::NotFound | Code::Unimplemented => StatusCode::NOT_FOUND,
        Code::AlreadyExists | Code::Aborted => StatusCode::CONFLICT,
        Code::ResourceExhausted => StatusCode::TOO_MANY_REQUESTS,
        Code::Unavailable => StatusCode::SERVICE_UNAVAILABLE,
        Code::DeadlineExceeded => StatusCode::GATEWAY_TIMEOUT,
        Code::Cancelled | Code::Unknown | Code::Internal | Code::DataLoss => StatusCode::INTERNAL_SERVER_ERROR,
    }
}
