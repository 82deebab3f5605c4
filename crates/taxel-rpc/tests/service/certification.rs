//! The certificate: what it is made of comes from the catalogue and the store, and what cannot be certified is refused.

use std::sync::{Arc, Mutex};

use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::calibration::{RampBaseline, Sample, SessionSamples, SessionState, SessionView};
use taxel_engine::loads::{JudgedLoad, Load, Validation};
use taxel_engine::model_set::ModelSet;
use taxel_engine::snapshot::Catalogue;
use taxel_proto::v1;
use taxel_proto::v1::model_service_client::ModelServiceClient;
use taxel_rpc::{CertificateMaker, CertificateOf, MadeCertificate, Told};
use tonic::Code;

use crate::fixture::{FOREARM, Store, TAXELS, model_set, patient, start, start_backed};

fn certifying(maker: CertificateMaker) -> Store {
    let samples = |session, told: Told<SessionSamples>| {
        if session != 7 {
            return told(Err(format!("session {session} is damaged")));
        }
        let taxels = vec![TaxelBaseline { mean: 240.0, noise: 0.5 }; TAXELS];
        let counts = vec![200; TAXELS].as_slice().into();
        let samples = vec![Sample { ramp: 0, time_ns: 5, pressure_kpa: 1.0, counts }];
        told(Ok(SessionSamples { ramps: vec![RampBaseline { ramp: 0, taxels, gauge_kpa: Some(5.8) }], samples }));
    };
    Store { samples: Some(Box::new(samples)), certificates: Some(maker), ..Store::default() }
}

fn catalogue() -> Arc<Catalogue> {
    let of = |id: &str, session| Arc::new(ModelSet { session, ..ModelSet::clone(&model_set(id, FOREARM)) });
    let session = |number| {
        let (patch, state) = (FOREARM.to_owned(), SessionState::Active);
        Arc::new(SessionView { number, patch, state, ..SessionView::default() })
    };
    let load = Arc::new(Load { number: 3, ..Load::default() });
    let judged = JudgedLoad { load, outdated_because: String::new(), left_out_because: "of a test".to_owned() };
    Arc::new(Catalogue {
        sessions: vec![session(7), session(8)],
        model_sets: [of("m-7", Some(7)), of("m-8", Some(8)), of("m-9", Some(9)), of("m-file", None)]
            .map(Into::into)
            .to_vec(),
        active: vec![(FOREARM.to_owned(), Some("m-7".to_owned()))],
        validations: vec![Arc::new(Validation { loads: vec![judged], ..Validation::default() })],
    })
}

#[tokio::test]
async fn a_certificate_is_made_of_the_set_its_session_its_samples_and_the_loads() {
    let seen: Arc<Mutex<Option<CertificateOf>>> = Arc::default();
    let keep = Arc::clone(&seen);
    let maker: CertificateMaker = Arc::new(move |of| {
        *keep.lock().unwrap() = Some(of.clone());
        let [number, json, html] = ["c-1", "{}", "<p>"].map(str::to_owned);
        Ok(MadeCertificate { number, json, html })
    });
    let daemon = start_backed(certifying(maker), patient()).await;
    daemon.engine().catalogue(catalogue());
    let mut client = ModelServiceClient::new(daemon.connect().await);
    let made = client.get_certificate(v1::GetCertificateRequest::default()).await.unwrap().into_inner();
    assert_eq!((made.model_set.as_str(), made.number.as_str()), ("m-7", "c-1"));
    assert_eq!((made.json.as_str(), made.html.as_str()), ("{}", "<p>"));
    let seen = seen.lock().unwrap().take().unwrap();
    assert_eq!((seen.set.id.as_str(), seen.models_json.as_str(), seen.session.number), ("m-7", "set m-7", 7));
    assert_eq!((seen.samples.samples.len(), seen.loads[0].number, seen.patch), (1, 3, 0));
}

#[tokio::test]
async fn what_has_no_samples_here_is_not_certified_and_the_reason_is_told() {
    let maker: CertificateMaker = Arc::new(|of| Err(format!("{} has no usable taxel", of.set.id)));
    let daemon = start_backed(certifying(maker), patient()).await;
    daemon.engine().catalogue(catalogue());
    let mut client = ModelServiceClient::new(daemon.connect().await);
    let cases = [
        ("m-7", Code::FailedPrecondition, "m-7 has no usable taxel"),
        ("m-8", Code::FailedPrecondition, "session 8 is damaged"),
        ("m-9", Code::FailedPrecondition, "session 9, which is not in the store"),
        (
            "m-file",
            Code::FailedPrecondition,
            "m-file was imported, fitted from a file or merged, not made of one session here",
        ),
        ("m-0", Code::NotFound, "m-0"),
    ];
    for (model_set, code, words) in cases {
        let request = v1::GetCertificateRequest { model_set: model_set.to_owned(), ..Default::default() };
        let status = client.get_certificate(request).await.unwrap_err();
        assert_eq!(status.code(), code, "{status}");
        assert!(status.message().contains(words), "{status}");
    }
}

#[tokio::test]
async fn a_build_without_certificates_says_so() {
    let daemon = start().await;
    daemon.engine().catalogue(catalogue());
    let mut client = ModelServiceClient::new(daemon.connect().await);
    let status = client.get_certificate(v1::GetCertificateRequest::default()).await.unwrap_err();
    assert_eq!(status.code(), Code::FailedPrecondition);
    assert!(status.message().contains("cargo feature `certificate`"), "{status}");
}
