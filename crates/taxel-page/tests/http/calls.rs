//! Calls: the same answers as over gRPC, as JSON.

use taxel_engine::command::{Command, ErrorReason, Rejection};

use crate::fixture::*;

#[tokio::test]
async fn a_call_by_post_answers_with_the_messages_json() {
    let daemon = start().await;
    daemon.engine.patch(0, snapshot(7));
    let answer = daemon.post("/taxel.v1.ForceService/GetForce", "{}").await;
    assert_eq!(answer.status, 200, "{answer:?}");
    assert!(answer.head.contains("content-type: application/json"), "{answer:?}");
    let force = answer.json();
    assert_eq!((&force["sequence"], &force["totalN"]), (&"7".into(), &7.0.into()));
    assert_eq!(force["state"], "FORCE_STATE_OK");
    for request in [r#"{"patch": "left_forearm"}"#, ""] {
        let mut same = daemon.post("/taxel.v1.ForceService/GetForce", request).await.json();
        same["sent"] = force["sent"].clone();
        assert_eq!(same, force, "{request}");
    }
}

#[tokio::test]
async fn a_refusal_says_why_for_programs_too() {
    let daemon = start().await;
    for (path, body, reason) in [
        ("/taxel.v1.ForceService/GetForce", r#"{"patch": "nose"}"#, "PATCH_UNKNOWN"),
        ("/taxel.v1.CalibrationService/GetSession", "{}", "FIELD_INVALID"),
        ("/taxel.v1.CalibrationService/GetSession", "{", "FIELD_INVALID"),
        ("/taxel.v1.CalibrationService/GetNothing", "{}", "METHOD_UNKNOWN"),
        // A proxy with rules about paths must not be passed by another spelling of one.
        ("//taxel.v1.ForceService/GetForce", "{}", "METHOD_UNKNOWN"),
        ("/taxel.v1.ForceService/GetForce/", "{}", "METHOD_UNKNOWN"),
    ] {
        let answer = daemon.post(path, body).await;
        assert_eq!(answer.json()["reason"], reason, "{path} {body}: {answer:?}");
    }
    let answer = daemon.post("/taxel.v1.ForceService/GetForce", r#"{"patch": "nose"}"#).await;
    assert_eq!(answer.json()["metadata"], serde_json::json!({ "patch": "nose" }));
}

#[tokio::test]
async fn a_command_reaches_the_engine_and_its_refusal_comes_back() {
    let mut daemon = start().await;
    let mut requests = std::mem::replace(&mut daemon.requests, tokio::sync::mpsc::channel(1).1);
    let engine = async {
        let request = requests.recv().await.unwrap();
        let Command::Tare { patch, confirmed_by } = request.command else { panic!("{:?}", request.command) };
        assert_eq!((patch.as_str(), confirmed_by.as_deref()), ("left_forearm", Some("Ada")));
        let refused = Rejection::FailedPrecondition(ErrorReason::TareUnproven, "rest is not proven".to_owned());
        request.reply.send(Err(refused)).unwrap();
    };
    let call = daemon.post("/taxel.v1.SkinService/Tare", r#"{"confirmedBy": "Ada"}"#);
    let ((), answer) = tokio::join!(engine, call);
    assert_eq!(answer.status, 400, "{answer:?}");
    let says = |words| answer.body.contains(words);
    assert!(says("FAILED_PRECONDITION") && says("rest is not proven"), "{answer:?}");
}

#[tokio::test]
async fn every_call_of_the_service_can_be_reached() {
    let daemon = start().await;
    let pool = prost_reflect::DescriptorPool::decode(taxel_proto::DESCRIPTORS).unwrap();
    let all = pool.services().flat_map(|service| service.methods().collect::<Vec<_>>());
    let all: Vec<_> = all.filter(|method| !method.is_client_streaming()).collect();
    assert!(all.len() >= 25);
    for method in all {
        let path = format!("/{}/{}", method.parent_service().full_name(), method.name());
        // The other verb is refused by name, so the path is known and the right one would not be.
        let (answer, right) = match method.is_server_streaming() {
            true => (daemon.post(&path, "{}").await, "get"),
            false => (daemon.get(&path).await, "post"),
        };
        assert_eq!(answer.status, 405, "{path}: {answer:?}");
        assert!(answer.head.contains(&format!("allow: {right}")), "{answer:?}");
    }
}

#[tokio::test]
async fn the_page_is_served_with_a_policy_and_without_cors() {
    let daemon = start().await;
    for path in ["/", "/page.css", "/main.js"] {
        let answer = daemon.get(path).await;
        assert_eq!(answer.status, 200, "{path}");
        assert!(answer.head.contains("content-security-policy: default-src 'none'"), "{answer:?}");
        assert!(answer.head.contains("x-content-type-options: nosniff"), "{answer:?}");
        assert!(!answer.head.contains("access-control"), "{answer:?}");
    }
}
