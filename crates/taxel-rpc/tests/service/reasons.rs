//! What programs read of a refusal: every one says why in the standard details, beside its words.

use std::collections::HashMap;

use taxel_engine::command::ErrorReason as Engine;
use tonic_types::StatusExt;

use crate::fixture::*;

/// Why a call was refused. Fails if the status does not say that in all the ways in which it has to.
pub fn reason(status: &Status) -> ErrorReason {
    let info = status.get_details_error_info().unwrap_or_else(|| panic!("no ErrorInfo: {status:?}"));
    assert_eq!(info.domain, "taxeld", "{status:?}");
    let reason = ErrorReason::from_str_name(&info.reason);
    let reason = reason.unwrap_or_else(|| panic!("`{}` is not in the list: {status:?}", info.reason));
    assert_ne!(reason, ErrorReason::Unspecified, "{status:?}");
    let request = status.get_details_bad_request();
    // A message that cannot be read has no field to name.
    assert_eq!(request.is_some(), info.metadata.contains_key("field"), "{status:?}");
    if let Some(request) = request {
        assert_eq!(reason, ErrorReason::FieldInvalid, "{status:?}");
        let [violation] = request.field_violations.as_slice() else { panic!("{request:?}") };
        assert_eq!(Some(&violation.field), info.metadata.get("field"), "{status:?}");
        let words = format!("{}: {}", violation.field, violation.description);
        assert!(status.message().starts_with(&words), "{status:?}");
    }
    if status.code() == Code::FailedPrecondition {
        let failure = status.get_details_precondition_failure();
        let failure = failure.unwrap_or_else(|| panic!("no PreconditionFailure: {status:?}"));
        let [violation] = failure.violations.as_slice() else { panic!("{failure:?}") };
        assert_eq!(violation.r#type, info.reason, "{status:?}");
        assert!(status.message().starts_with(&violation.description), "{status:?}");
    }
    reason
}

/// Why, and what it is about.
fn about(status: &Status) -> (ErrorReason, Vec<(String, String)>) {
    let metadata: HashMap<String, String> = status.get_details_error_info().unwrap().metadata;
    let mut metadata: Vec<_> = metadata.into_iter().collect();
    metadata.sort();
    (reason(status), metadata)
}

#[tokio::test]
async fn the_engines_refusal_keeps_its_words_and_its_reason_says_what_the_command_was_about() {
    let mut daemon = start().await;
    let mut client = SkinServiceClient::new(daemon.connect().await);
    let loaded = Rejection::FailedPrecondition(Engine::TareLoaded, "something presses on the skin".to_owned());
    let argument = Rejection::InvalidArgument { field: "confirmed_by", problem: "-1 is no name".to_owned() };
    let unknown = Rejection::NotFound(Engine::SessionUnknown, "session 4".into());
    let full = Rejection::Unavailable(Engine::StoreUnavailable, "the disk is full".into());
    for (refused, code, why, words) in [
        (loaded, Code::FailedPrecondition, ErrorReason::SkinLoaded, "something presses on the skin"),
        (argument, Code::InvalidArgument, ErrorReason::FieldInvalid, "confirmed_by: -1 is no name"),
        (unknown, Code::NotFound, ErrorReason::SessionUnknown, "there is no session 4"),
        (full.clone(), Code::Unavailable, ErrorReason::StoreUnavailable, "the disk is full"),
    ] {
        let status = daemon.replied(client.tare(v1::TareRequest::default()), Err(refused), |_| {}).await.unwrap_err();
        assert!(status.code() == code && status.message().contains(words), "{status:?}");
        let (reason, metadata) = about(&status);
        assert_eq!(reason, why, "{status:?}");
        assert!(
            metadata.contains(&("patch".to_owned(), FOREARM.to_owned())),
            "the only patch, by its name: {status:?}"
        );
        if let Some(failure) = status.get_details_precondition_failure() {
            assert_eq!(failure.violations[0].subject, format!("patches/{FOREARM}"));
        }
    }
    let mut models = ModelServiceClient::new(daemon.connect().await);
    let request = v1::ActivateModelSetRequest { model_set: "m-1".to_owned(), ..Default::default() };
    let status = daemon.replied(models.activate_model_set(request), Err(full), |_| {}).await.unwrap_err();
    let expected = [("model_set", "m-1"), ("patch", FOREARM)].map(|(what, which)| (what.to_owned(), which.to_owned()));
    assert_eq!(about(&status).1, expected);
}

#[tokio::test]
async fn however_long_a_refusal_would_be_it_fits_into_the_headers_that_clients_take() {
    let daemon = start().await;
    let mut models = ModelServiceClient::new(daemon.connect().await);
    let request = v1::ImportModelSetRequest { json: "\u{fc}".repeat(100_000), insist: false };
    let status = models.import_model_set(request).await.unwrap_err();
    assert_eq!((status.code(), reason(&status)), (Code::InvalidArgument, ErrorReason::FieldInvalid));
    let mut headers = tonic::codegen::http::HeaderMap::new();
    status.add_header(&mut headers).unwrap();
    let bytes: usize = headers.iter().map(|(name, value)| name.as_str().len() + value.len() + 32).sum();
    assert!(bytes <= 8 << 10, "{bytes} bytes of headers, and gRPC's own clients take 8 KiB");
}
