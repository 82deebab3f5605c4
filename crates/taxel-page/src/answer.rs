//! Answers over HTTP: JSON, refusals, and the headers that every answer has.

use http_body_util::combinators::UnsyncBoxBody;
use http_body_util::{BodyExt, Full};
use hyper::body::Bytes;
use hyper::header::{ALLOW, CACHE_CONTROL, CONNECTION, CONTENT_TYPE, HeaderName, HeaderValue, REFERRER_POLICY};
use hyper::header::{CONTENT_SECURITY_POLICY, X_CONTENT_TYPE_OPTIONS};
use hyper::{Response, StatusCode};
use serde::Serialize;
use serde_json::json;
use std::convert::Infallible;
use taxel_proto::code_name;
use taxel_proto::refusal::{Refusal, info_of};
use taxel_proto::v1::ErrorReason;
use tonic::{Code, Status};

use crate::large_answers::LargeAnswer;

/// The body of every answer.
pub(crate) type Body = UnsyncBoxBody<Bytes, Infallible>;

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
pub(crate) fn hardened(mut response: Response<Body>) -> Response<Body> {
    for (name, value) in ON_EVERY_ANSWER {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

/// An answer with a body that is there.
pub(crate) fn whole(status: StatusCode, content_type: &'static str, bytes: impl Into<Bytes>) -> Response<Body> {
    let mut response = Response::new(Full::new(bytes.into()).boxed_unsync());
    *response.status_mut() = status;
    response.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static(content_type));
    response
}

/// An answer that is JSON.
pub(crate) fn json_of(value: &impl Serialize) -> Response<Body> {
    json_bytes(value).map_or_else(|status| refusal(&status), |bytes| whole(StatusCode::OK, JSON, bytes))
}

/// The JSON of an answer, in no more memory than it takes: a slow reader holds it for long.
pub(crate) fn json_bytes(value: &impl Serialize) -> Result<Vec<u8>, Status> {
    let written = serde_json::to_vec(value);
    let mut json = written.map_err(|error| Refusal::fault(format!("the answer is no JSON: {error}")))?;
    json.shrink_to_fit();
    Ok(json)
}

/// Bytes that hold a place for as long as anybody has them. The body of an answer does not last so long: the server takes
/// all of it at once and then writes what the peer has room for.
pub(crate) fn with_place(bytes: Vec<u8>, place: LargeAnswer) -> Bytes {
    Bytes::from_owner(Placed { bytes, _place: place })
}

struct Placed {
    bytes: Vec<u8>,
    _place: LargeAnswer,
}

impl AsRef<[u8]> for Placed {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

/// Refuses a method that the path does not have.
pub(crate) fn wrong_method(allowed: &'static str, why: &str) -> Response<Body> {
    let refused = Refusal::new(Code::Unimplemented, ErrorReason::MethodUnknown, why).into();
    let mut response = refusal_as(StatusCode::METHOD_NOT_ALLOWED, &refused);
    response.headers_mut().insert(ALLOW, HeaderValue::from_static(allowed));
    response
}

/// The same as the last of its connection, on which the rest of a body may still come.
pub(crate) fn closing(mut response: Response<Body>) -> Response<Body> {
    response.headers_mut().insert(CONNECTION, HeaderValue::from_static("close"));
    response
}

/// A gRPC status as an answer.
pub(crate) fn refusal(status: &Status) -> Response<Body> {
    refusal_as(http_status(status.code()), status)
}

/// The same under another HTTP status.
pub(crate) fn refusal_as(http: StatusCode, status: &Status) -> Response<Body> {
    whole(http, JSON, status_json(status).to_string())
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
