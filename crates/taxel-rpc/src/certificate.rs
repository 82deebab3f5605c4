//! The certificate of a model set: the service brings together what it is made of, and somebody else makes it.

use std::sync::Arc;

use taxel_engine::model_set::ModelSet;
use taxel_proto::refusal::Refusal;
use taxel_proto::v1;
use taxel_proto::v1::ErrorReason;
use tonic::Status;

use crate::certificate_maker::{CertificateOf, MadeCertificate};
use crate::samples::read;
use crate::service::Service;
use crate::status::samples_not_kept;

impl Service {
    /// The certificate of a model set.
    pub(crate) async fn certificate(&self, set: Arc<ModelSet>) -> Result<v1::Certificate, Status> {
        let missing = || {
            Refusal::failed_precondition(
                ErrorReason::NotOffered,
                "this build makes no certificates (cargo feature `certificate`)",
            )
        };
        let maker = self.handle.certificates.clone().ok_or_else(missing)?;
        let source = self.handle.samples.clone().ok_or_else(samples_not_kept)?;
        let not_here = || {
            let id = &set.id;
            let why = match (set.session, set.derived_from()) {
                (Some(session), _) => {
                    format!("{id} is of session {session}, which is not in the store: deleted, or of another daemon")
                }
                (None, Some(source)) => {
                    format!("{id} was made of {source} by known loads: ask for the certificate of that")
                }
                (None, None) => format!("{id} was not made of a session: there are no samples to certify it by"),
            };
            Refusal::failed_precondition(ErrorReason::SamplesMissing, why).about("model_set", id)
        };
        let session = set.session.ok_or_else(not_here)?;
        let session = self.sessions().into_iter().find(|view| view.number == session && view.patch == set.patch);
        let session = session.ok_or_else(not_here)?;
        let patch = self.patch(&set.patch)?;
        let models_json = (self.handle.codec.to_json)(&set).map_err(Refusal::fault)?;
        let loads = self.handle.catalogue.borrow().validations.get(patch).map(Arc::clone);
        let loads = loads.iter().flat_map(|view| view.loads.iter().map(|judged| Arc::clone(&judged.load))).collect();
        let turn = Arc::clone(&self.exports).try_acquire_owned().map_err(|_| {
            let limit = self.limits.exports;
            Refusal::exhausted(
                ErrorReason::NoPlace,
                format!("{limit} sessions are being read, which is the limit: try again later"),
            )
        })?;
        let number = session.number;
        let failed = |reason, why: String| Refusal::failed_precondition(reason, why).about("session", number);
        let (samples, turn) = read(&source, number, turn).await?;
        let model_set = set.id.clone();
        let evidence = CertificateOf { set, models_json, patch, session, samples, loads };
        // A whole session is gone through several times: no stream should wait for that. The turn goes along: a certificate
        // whose client is gone ends by itself.
        let make = move || {
            let _turn = turn;
            maker(&evidence)
        };
        let made = tokio::task::spawn_blocking(make).await;
        let made = made.map_err(|failed| Refusal::fault(format!("the certificate was not made: {failed}")))?;
        let MadeCertificate { number, json, html } = made.map_err(|why| failed(ErrorReason::NotFitted, why))?;
        Ok(v1::Certificate { model_set, number, json, html })
    }
}
